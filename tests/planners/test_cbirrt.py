"""CBiRRT along path constraints, through plan()."""

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.errors import InputError
from rrtik_tests.upright_problem import cup_problem

pytestmark = [pytest.mark.kernels, pytest.mark.usefixtures("quiet_ompl")]


@pytest.mark.parametrize("planner", ["cbirrt", "auto"])
def test_the_path_keeps_the_cup_upright_at_every_place(planner):
    problem = cup_problem()
    plan = rrtik.plan(problem, planner, seed=1, seconds=20.0)
    assert plan.found, plan.reason
    assert plan.proven
    assert plan.path.violations(problem.world) == ()
    rows = plan.path.waypoints
    shares = np.linspace(0.0, 1.0, 40)[:, None, None]
    dense = ((1.0 - shares) * rows[:-1] + shares * rows[1:]).reshape(-1, rows.shape[1])
    up = problem.robot.fk(problem.start).rotation[:, 2]
    cosines = problem.robot.fk_batch(dense)[:, :3, 2] @ up
    assert np.degrees(np.arccos(cosines.min())) <= 5.2


def test_the_same_seed_gives_the_same_path():
    first, second = (rrtik.plan(cup_problem(), "cbirrt", seed=3, seconds=20.0).path.waypoints for _ in range(2))
    np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize(
    ("planner", "why"), [("RRTConnect", "does not keep them"), ("bicrdt", "moves one joint at a time")]
)
def test_planners_that_cannot_obey_refuse_in_a_line(planner, why):
    with pytest.raises(InputError, match=f"path constraints, and it {why}.*use cbirrt"):
        rrtik.plan(cup_problem(), planner)


def test_without_constraints_it_is_a_planner_like_any_other():
    problem = rrtik.load_problem("titan4_prisms")
    plan = rrtik.plan(problem, "cbirrt", seed=1, seconds=20.0)
    assert plan.found, plan.reason
    assert plan.path.violations(problem.world) == ()
