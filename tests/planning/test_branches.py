"""The goal configuration of the default plan is chosen by the length of the path."""

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.ik.goal_configurations import goal_configurations
from rrtik_ompl.planning import branches
from rrtik_ompl.planning.branches import shorter_branch

pytestmark = pytest.mark.kernels

SEEDS = range(6)


@pytest.fixture(scope="module", params=["ur5_table", "so101_bin"])
def problem(request):
    return rrtik.load_problem(request.param)


def test_the_default_is_shorter_than_a_planner_that_takes_the_first_configuration(problem):
    """It begins with the same path; where the nearest configuration is the first anyway, it has little to gain."""
    default = [rrtik.plan(problem, seed=seed) for seed in SEEDS]
    first = [rrtik.plan(problem, "fastrrtconnect", seed=seed) for seed in SEEDS]
    assert all(plan.proven and problem.reached(plan.path.end) for plan in default)
    ratios = np.array([one.path.length / other.path.length for one, other in zip(default, first, strict=True)])
    assert (ratios < 1.0 + 1e-9).all()
    assert ratios.mean() < {"ur5_table": 1.0, "so101_bin": 0.9}[problem.name]


def test_a_seed_gives_one_path(problem):
    one, again = (rrtik.plan(problem, seed=3).path for _ in range(2))
    np.testing.assert_array_equal(one.waypoints, again.waypoints)


def test_a_branch_is_a_proven_path_to_one_of_the_goals(problem):
    goals = goal_configurations(problem, np.random.default_rng(0)).rows
    path = rrtik.plan(problem, "fastrrtconnect", seed=1, shorten=False).path
    found = shorter_branch(problem, path, goals, Budget(1))
    assert found.proven
    assert found.proof.clearance == path.proof.clearance
    assert (found.start == problem.start).all()
    assert (found.end == goals).all(axis=1).any()
    assert shorter_branch(problem, path, goals[:1], Budget(1)) is path
    assert shorter_branch(problem, path, goals, Budget(1, stop=lambda: True)) is path


def test_a_straight_line_is_the_end_of_it(problem, monkeypatch):
    """No search is made to a goal that is farther than the path is long."""
    start = problem.start
    path = rrtik.plan(replace_goal(problem, start + 0.01), seed=1).path
    goals = np.array([start + 0.3, start + 0.2])

    def refuse(*_, **__):
        raise AssertionError("searched")

    monkeypatch.setattr(branches.ConnectSearch, "solve", refuse)
    assert shorter_branch(problem, path, goals, Budget(1)) is path


def replace_goal(problem, q):
    return rrtik.Problem(problem.world, problem.start, q)
