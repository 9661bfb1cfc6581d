"""IKURT: the metrics, the published algorithm, the improved one, and what is said when there is no way."""

from __future__ import annotations

import itertools
import re
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import pose
from rrtik_ompl.cli.plan_report import summary
from rrtik_ompl.ik.ikurt.metric import TipMetric, reach
from rrtik_ompl.ik.ikurt.published import PublishedSearch, Steps
from rrtik_ompl.ik.ikurt.search import BatchedSearch, IkurtValidity, Options, descend
from rrtik_ompl.ik.ikurt.tree import FIRST_ROOM, IkurtTree
from rrtik_ompl.model.goal import GoalSet, PoseGoal, PositionGoal, Target
from rrtik_ompl.model.shapes import Sphere
from rrtik_ompl.ompl_bridge.contract import small_problem
from rrtik_planners import IKURT, IKURTPublished
from rrtik_tests.inverse_kinematics import random_rows

EXAMPLES = (
    *("planar3_boxes", "planar6_c", "planar6_c_pose", "puma_position", "puma_pose"),
    *("titan4_regular", "titan4_wrist", "titan4_axis1", "titan4_p_axis1"),
)


@pytest.fixture(scope="module")
def puma() -> Any:
    return rrtik.load_problem("puma_pose")


def test_published_metric_of_a_pose_is_the_formula_with_unit_quaternions(puma: Any) -> None:
    robot, goal, mu = puma.robot, puma.goal, 0.7
    rows = random_rows(robot, 50)
    metric = TipMetric.published(robot, [goal], puma.start, mu)
    wanted = pin.Quaternion(goal.T_world_tip.rotation).coeffs()
    for q, measured in zip(rows, metric.distance(rows), strict=True):
        tip = robot.fk(q)
        product = abs(wanted @ pin.Quaternion(tip.rotation).coeffs())
        away = np.linalg.norm(tip.translation - goal.T_world_tip.translation)
        assert measured == pytest.approx(np.hypot(mu * away, np.arccos(min(product, 1.0))), abs=1e-9)
    assert metric.evaluations == 50


def test_published_weight_makes_the_first_distance_count_as_the_largest_angle(puma: Any) -> None:
    metric = TipMetric.published(puma.robot, [puma.goal], puma.start)
    away = np.linalg.norm(puma.robot.fk(puma.start).translation - puma.goal.T_world_tip.translation)
    assert metric.unit * away == pytest.approx(0.5 * np.pi)


def test_metric_of_a_position_is_the_distance_in_metres(puma: Any) -> None:
    goal = PositionGoal([0.4, 0.2, 0.9])
    rows = random_rows(puma.robot, 20)
    metric = TipMetric.published(puma.robot, [goal], puma.start)
    assert metric.distance(rows) == pytest.approx(goal.distance(puma.robot, rows))


def test_within_its_radius_every_goal_is_reached(puma: Any) -> None:
    robot, end = puma.robot, np.radians([40, 60, -120, 30, 40, 20])
    rows = end + np.random.default_rng(0).normal(size=(4000, 6)) * 2e-3
    for metric in (TipMetric(robot, [puma.goal]), TipMetric.published(robot, [puma.goal], puma.start)):
        inside = metric.distance(rows) <= metric.radius
        assert 10 < inside.sum() < 3990
        assert puma.goal.satisfied(robot, rows[inside]).all()


def test_pull_is_as_long_as_the_distance_and_leads_to_the_nearest_target(puma: Any) -> None:
    robot = puma.robot
    targets = [puma.goal, PoseGoal(robot.fk(random_rows(robot, 1, 5)[0])), PositionGoal([0.3, 0.3, 0.9])]
    rows, metric = random_rows(robot, 50), TipMetric(robot, targets)
    twists, lengths = metric.pull(robot.fk_batch(rows))
    assert lengths == pytest.approx(metric.distance(rows))
    assert np.linalg.norm(twists, axis=1) == pytest.approx(lengths)
    alone = np.min([TipMetric(robot, [target]).distance(rows) for target in targets], axis=0)
    assert lengths == pytest.approx(alone)


@pytest.mark.parametrize("name", ["puma_pose", "titan4_wrist", "titan4_axis1"])
def test_descent_meets_goals_exactly_inside_the_limits(name: str) -> None:
    problem = rrtik.load_problem(name)
    robot = problem.robot
    metric = TipMetric(robot, [problem.goal])
    ends = descend(metric, np.vstack([problem.start, random_rows(robot, 30)]), robot.lower, robot.upper)
    arrived = ends.distance < 1e-8 * reach(robot)
    assert arrived[0]
    assert not arrived.all()
    assert robot.within_limits(ends.q, 0.0).all()
    assert metric.distance(ends.q) == pytest.approx(ends.distance)


def test_kinematics_and_jacobian_at_once_are_those_asked_for_one_by_one(puma: Any) -> None:
    rows = random_rows(puma.robot, 5)
    poses, jacobians = puma.robot.fk_jacobian_batch(rows)
    assert np.array_equal(poses, puma.robot.fk_batch(rows))
    assert jacobians == pytest.approx(np.array([puma.robot.jacobian(q) for q in rows]))


def test_tree_keeps_its_vertices_and_ways_when_it_grows() -> None:
    rng = np.random.default_rng(0)
    tree = IkurtTree(np.zeros((1, 3)), np.array([9.0]))
    for k in range(FIRST_ROOM + 50):
        tree.add(rng.normal(size=(1, 3)), np.array([k]), np.array([8.0 - k * 1e-3]))
    last = tree.size - 1
    assert np.array_equal(tree.branch(last), tree.q)
    assert tree.best() == last
    queries = rng.normal(size=(20, 3))
    away = np.linalg.norm(queries[:, None] - tree.q, axis=2)
    assert np.array_equal(tree.nearest(queries), away.argmin(axis=1))


def test_penalty_falls_on_the_way_that_failed_alone() -> None:
    tree = IkurtTree(np.zeros((1, 2)), np.array([2.0]))
    (first,) = tree.add(np.ones((1, 2)), np.array([0]), np.array([1.0]))
    (last,) = tree.add(2 * np.ones((1, 2)), np.array([first]), np.array([0.9]))
    (other,) = tree.add(-np.ones((1, 2)), np.array([0]), np.array([1.1]))
    tree.penalise(first, last)
    assert tree.best() == other
    assert tree.distance[last] == 0.9


STEPS = Steps(step=0.15, threshold=0.5, accuracy=1e-2)


def rounds(most: int) -> Any:
    """A condition that ends a search after so many questions."""
    asked = itertools.count(1)
    return lambda: next(asked) > most


def published(problem: Any, seed: int) -> Any:
    metric = TipMetric.published(problem.robot, [problem.goal], problem.start)
    (low, high), rng = problem.robot.finite_range(), np.random.default_rng(seed)
    return PublishedSearch(metric, STEPS, low, high, problem.world.motion_valid, rounds(1500), rng, problem.start)


def improved(problem: Any, seed: int) -> Any:
    """Without descents, which would need no CONNECT."""
    metric, rng = TipMetric(problem.robot, [problem.goal]), np.random.default_rng(seed)
    options = Options(step=0.15, stride=0.6, jacobian=False, most_vertices=10_000)
    validity = IkurtValidity(problem.world.valid_batch, problem.world.motion_valid_batch, rounds(1500))
    low, high = problem.robot.finite_range()
    return BatchedSearch(metric, options, low, high, validity, rng, problem.start[None])


@pytest.mark.parametrize("search_of", [published, improved])
def test_connect_adds_vertices_of_strictly_falling_distance(search_of: Any) -> None:
    search = search_of(rrtik.load_problem("planar6_c_pose"), seed=3)
    connect, rows = search._connect, []

    def watched(vertex: int) -> Any:
        before, first = search.tree.size, search.tree.distance[vertex]
        outcome = connect(vertex)
        rows.append(np.append(first, search.tree.distance[before:]))
        return outcome

    search._connect = watched
    search.run()
    assert sum(len(row) for row in rows) > len(rows) + 10
    assert all((np.diff(row) < 0.0).all() for row in rows)


def test_published_steps_are_no_longer_than_delta_and_shrink_near_the_goal(puma: Any) -> None:
    search = published(puma, seed=0)
    search.run()
    tree = search.tree
    assert tree.distance.min() < 0.1  # or nothing would be seen of the shrinking
    for vertex in range(1, tree.size):
        before, after = tree.branch(vertex)[-2:]
        (parent,) = np.flatnonzero((tree.q == before).all(axis=1))
        shrunk = min(1.0, tree.distance[parent] / STEPS.threshold)
        assert np.linalg.norm(after - before) <= STEPS.step * shrunk + 1e-12


@pytest.mark.parametrize("name", EXAMPLES)
def test_every_published_example_is_solved_and_the_error_of_the_tip_reported(name: str) -> None:
    problem = rrtik.load_problem(name)
    plan = rrtik.plan(problem, IKURT, seconds=10.0, seed=1)
    assert plan.found, plan.reason
    assert np.array_equal(plan.path.start, problem.start)
    assert plan.path.violations(problem.world) == ()
    assert problem.reached(plan.path.end)
    assert isinstance(problem.goal, Target)
    tip = problem.robot.fk(plan.path.end)
    away = np.linalg.norm(tip.translation - problem.goal.point)
    assert plan.statistics["position_error"] == pytest.approx(away, abs=1e-12)
    assert away < 1e-6
    (line,) = (line for line in summary(problem, plan, plan.path) if "the tip ends" in line)
    assert ("deg" in line) == isinstance(problem.goal, PoseGoal)


def test_the_tree_alone_reaches_the_tolerance_without_the_jacobian() -> None:
    problem = rrtik.load_problem("planar6_c")
    assert isinstance(problem.goal, rrtik.PositionGoal)
    plan = rrtik.plan(problem, IKURT, seconds=10.0, seed=1, parameters={"jacobian": False})
    assert plan.found, plan.reason
    assert 1e-9 < plan.statistics["position_error"] <= problem.goal.tolerance


def test_the_published_algorithm_solves_its_second_example() -> None:
    problem = rrtik.load_problem("planar6_c")
    plan = rrtik.plan(problem, IKURTPublished, seconds=10.0, seed=1)
    assert plan.found, plan.reason
    assert plan.path.violations(problem.world) == ()


@pytest.mark.parametrize("planner", [IKURT, IKURTPublished])
def test_the_same_seed_gives_the_same_path(planner: Any) -> None:
    problem = rrtik.load_problem("planar6_c")
    one, same, other = (rrtik.plan(problem, planner, seconds=10.0, seed=seed) for seed in (4, 4, 5))
    assert np.array_equal(one.path.waypoints, same.path.waypoints)
    assert one.path.waypoints.shape != other.path.waypoints.shape or (one.path.waypoints != other.path.waypoints).any()


def test_a_region_of_several_poses_is_reached_at_one_of_them(puma: Any) -> None:
    out_of_reach = PoseGoal(pose([5.0, 0.0, 0.0]))
    problem = rrtik.Problem(puma.world, puma.start, GoalSet([out_of_reach, puma.goal]))
    plan = rrtik.plan(problem, IKURT, seconds=5.0, seed=1)
    assert plan.found, plan.reason
    assert puma.goal.satisfied(puma.robot, plan.path.end[None])[0]


def test_a_region_with_a_free_rotation_and_a_box_is_reached() -> None:
    robot = rrtik.load_robot("panda_primitives")
    start = robot.posture("default")
    region = GoalSet([PoseGoal(robot.fk(start) * pose([0.1, 0.1, -0.1]))], free_rotation_axis="z", box=[0.1, 0.1, 0.0])
    problem = rrtik.Problem(rrtik.World(robot), start, region)
    plan = rrtik.plan(problem, IKURT, seconds=5.0, seed=1)
    assert plan.found, plan.reason
    assert problem.reached(plan.path.end)


def test_a_goal_in_joint_values_is_met_to_the_bit() -> None:
    problem = rrtik.load_problem("planar3_a")
    plan = rrtik.plan(problem, IKURT, seconds=10.0, seed=1)
    assert plan.found, plan.reason
    assert np.array_equal(plan.path.end, problem.goal.q)


def closest(plan: Any) -> float:
    """How far the closest configuration is away [m], as the reason tells it."""
    (told,) = re.findall(r"goal not reached: the closest configuration is (\S+) m away", plan.reason)
    return float(told)


@pytest.mark.parametrize("planner", [IKURT, IKURTPublished])
def test_a_goal_out_of_reach_is_told_with_the_nearest_miss(puma: Any, planner: Any) -> None:
    problem = rrtik.Problem(puma.world, puma.start, PositionGoal([3.0, 0.0, 0.672]))
    plan = rrtik.plan(problem, planner, seconds=0.3, seed=1)
    assert not plan.found
    assert 3.0 - reach(puma.robot) - 5e-3 <= closest(plan) < 3.0
    assert "degrees" not in plan.reason


def test_the_nearest_miss_is_that_of_the_stretched_arm(puma: Any) -> None:
    problem = rrtik.Problem(puma.world, puma.start, PositionGoal([3.0, 0.0, 0.672]))
    plan = rrtik.plan(problem, IKURT, seconds=0.5, seed=1)
    stretched = np.hypot(0.4318 + np.hypot(0.4318, 0.0203), 0.15005)
    assert closest(plan) == pytest.approx(3.0 - stretched, abs=5e-3)  # told with three digits


def test_without_descents_the_nearest_miss_is_that_of_the_tree(puma: Any) -> None:
    problem = rrtik.Problem(puma.world, puma.start, PositionGoal([3.0, 0.0, 0.672]))
    plan = rrtik.plan(problem, IKURT, seconds=0.3, seed=1, parameters={"jacobian": False})
    told = closest(plan)
    assert told == pytest.approx(plan.statistics["position_error"], rel=5e-3)
    assert told < problem.goal.distance(puma.robot, puma.start)[0] - 0.1


def test_a_goal_that_is_blocked_is_told_with_what_is_in_the_way(puma: Any) -> None:
    ball = rrtik.Obstacle("ball", Sphere(0.06), pose(puma.goal.T_world_tip.translation))
    problem = rrtik.Problem(rrtik.World(puma.robot, rrtik.Scene([ball])), puma.start, puma.goal)
    plan = rrtik.plan(problem, IKURT, seconds=0.5, seed=1)
    assert not plan.found
    assert "all configurations found at the goal are in collision" in plan.reason
    assert "'ball'" in plan.reason


@pytest.mark.parametrize(
    ("planner", "option", "value"),
    [
        (IKURT, "step", 0.0),
        (IKURT, "stride", -1.0),
        (IKURT, "metres_per_radian", float("nan")),
        (IKURT, "jacobian", "yes"),
        (IKURT, "most_vertices", 0),
        (IKURTPublished, "mu", 0.0),
        (IKURTPublished, "accuracy", "fine"),
    ],
)
def test_options_out_of_range_are_refused_by_name(puma: Any, planner: Any, option: str, value: Any) -> None:
    with pytest.raises(InputError, match=f"^{option}: "):
        rrtik.plan(puma, planner, seconds=1.0, parameters={option: value})


@pytest.mark.usefixtures("quiet_ompl")
@pytest.mark.parametrize("planner", [IKURT, IKURTPublished])
def test_a_goal_of_the_tip_needs_a_world(puma: Any, planner: Any) -> None:
    with pytest.raises(InputError, match="needs world="):
        planner(small_problem().getSpaceInformation(), goal=puma.goal)
