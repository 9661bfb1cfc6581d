"""CBiRRT along path constraints, through plan()."""

import re

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError
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
    with pytest.raises(InputError, match=f"path constraints.*{why}.*use cbirrt"):
        rrtik.plan(cup_problem(), planner)


def test_without_constraints_it_is_a_planner_like_any_other():
    problem = rrtik.load_problem("titan4_prisms")
    plan = rrtik.plan(problem, "cbirrt", seed=1, seconds=20.0)
    assert plan.found, plan.reason
    assert plan.path.violations(problem.world) == ()


def test_a_goal_on_another_branch_is_said_to_be_apart_at_once():
    problem = cup_problem()
    flipped = rrtik.solve_ik(problem.robot, rrtik.PoseGoal(problem.robot.fk(problem.goal.q)), all=True).solutions
    flipped = flipped[problem.world.unheld.valid_batch(flipped) & (flipped[:, 4] > 0.0)]
    other = rrtik.Problem(problem.world.unheld, problem.start, flipped[0], constraints=problem.constraints)
    plan = rrtik.plan(other, seed=1, seconds=60.0)
    assert not plan.found
    assert "cbirrt ended: path constraint 1 keeps start and goal apart" in plan.reason
    assert "Timeout" not in plan.reason  # nor is it
    assert plan.statistics["attempts"] == 1


@pytest.mark.parametrize("goal", ["pose", "position"])
def test_goals_of_the_tip_are_reached_where_the_constraint_is_kept(goal):
    problem = cup_problem()
    place = problem.robot.fk(problem.goal.q)
    wanted = rrtik.PoseGoal(place) if goal == "pose" else rrtik.PositionGoal(place.translation)
    other = rrtik.Problem(problem.world.unheld, problem.start, wanted, constraints=problem.constraints)
    plan = rrtik.plan(other, seed=1, seconds=20.0)
    assert plan.found, plan.reason
    assert other.reached(plan.path.end)
    assert plan.path.violations(other.world) == ()


def test_a_pose_that_no_path_can_keep_is_said():
    problem = cup_problem()
    place = problem.robot.fk(problem.goal.q)
    place.rotation = np.eye(3)
    other = rrtik.Problem(problem.world.unheld, problem.start, rrtik.PoseGoal(place), constraints=problem.constraints)
    plan = rrtik.plan(other, seed=1, seconds=2.0)
    assert not plan.found
    assert "at the goal and keeps the path constraints" in plan.reason
    away = re.search(r"the nearest one breaks path constraint 1 \(frame '.*'\): (\S+) degrees outside", plan.reason)
    tilt = np.degrees(np.arccos(problem.robot.fk(problem.start).rotation[2, 2]))  # between the axis and the goal's
    assert float(away[1]) == pytest.approx(tilt - 5.0, abs=0.2)


def test_shortening_keeps_the_constraint():
    problem = cup_problem()
    found = rrtik.plan(problem, "cbirrt", seed=2, seconds=20.0).path
    shorter = rrtik.shorten(found, problem, seed=1)
    assert shorter.length <= found.length
    assert shorter.violations(problem.world) == ()
    assert shorter.proven_in(problem.world)


def test_a_motion_along_the_path_keeps_the_constraint():
    problem = cup_problem()
    path = rrtik.plan(problem, seed=1, seconds=20.0).path
    motion = rrtik.time_parameterize(path, problem.robot, blend=0.2, world=problem.world)
    up = problem.robot.fk(problem.start).rotation[:, 2]
    rows = motion(np.linspace(0.0, motion.duration, 2000)).positions
    cosines = problem.robot.fk_batch(rows)[:, :3, 2] @ up
    assert np.degrees(np.arccos(cosines.min())) <= 5.2
