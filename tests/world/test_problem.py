"""A problem exists only if it is well posed."""

import copy
import pickle
import re
from dataclasses import fields, replace

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.copies import changed
from rrtik_ompl.base.errors import InputError, ProblemError, UnknownNameError
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.model.goal import GoalSet, JointGoal, MultiGoal, PoseGoal, PositionGoal
from rrtik_ompl.model.goal_kind import TaskRegion
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.scene import AttachedObject, Obstacle, Scene
from rrtik_ompl.model.shapes import Box
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World


@pytest.fixture(scope="module")
def world():
    box = Obstacle("panel", Box([0.2, 0.2, 0.2]), pin.SE3(np.eye(3), np.array([1.9, 0.0, 0.0])))
    return World(load_robot("titan4"), Scene([box]))


FREE = np.deg2rad([30, 20, 0, 0, 0, 0])


def test_a_start_in_collision_is_refused_with_the_pair(world):
    with pytest.raises(ProblemError, match=r"start is in collision.*panel.*mm") as caught:
        Problem(world, np.zeros(6), FREE)
    assert any("panel" in pair for pair in caught.value.contacts)


@pytest.mark.parametrize("form", [lambda T: T, lambda T: T.homogeneous, lambda T: T.homogeneous.tolist()])
def test_a_pose_of_the_tip_is_a_goal(world, form):
    T = world.robot.fk(FREE)
    problem = Problem(world, FREE + 0.05, form(T))
    assert isinstance(problem.goal, PoseGoal)
    assert problem.reached(FREE)
    assert not problem.reached(FREE + 0.05)


def test_poses_are_members_of_sets_and_goals_of_tips(world):
    T, away = world.robot.fk(FREE), pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.5]))
    assert GoalSet([away, T.homogeneous]).member_at(world.robot, FREE) == 1
    goal = MultiGoal({world.robot.tip: T})
    assert goal.satisfied(world.robot, FREE[None]).all()
    assert MultiGoal({world.robot.tip: away}).satisfied(world.robot, FREE[None]).tolist() == [False]


@pytest.mark.parametrize("gap", [-5e-7, 0.0])
def test_a_box_that_stands_on_a_table_is_said_to_touch_with_the_remedy(gap):
    robot = load_robot("panda")
    box = AttachedObject("box", "panda_hand", Box([0.05, 0.05, 0.05]), [0.0, 0.0, 0.2])
    T = robot.fk(robot.posture("default"), "panda_hand").act(box.pose)
    table = Obstacle("table", Box([0.2, 0.2, 0.02]), T * pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.035 + gap])))
    with pytest.raises(ProblemError, match=r"'(table|box)' touch.*move it"):
        Problem(World(robot, Scene([table], [box])), "default", "default")


def test_a_goal_in_collision_is_refused_with_the_pair(world):
    with pytest.raises(ProblemError, match=r"goal is in collision.*panel"):
        Problem(world, FREE, np.zeros(6))


def test_a_value_outside_its_limit_is_named_in_degrees(world):
    bad = FREE.copy()
    bad[1] = np.deg2rad(90)
    with pytest.raises(ProblemError, match=r"goal: joint.*90 deg.*-34.19 .. 85.81 deg"):
        Problem(world, FREE, bad)


@pytest.mark.parametrize("beyond", [5e-7, 9.9e-6])
def test_a_hair_outside_the_limit_is_moved_onto_it(world, beyond):
    start, goal = FREE.copy(), FREE.copy()
    start[1], goal[2] = world.robot.upper[1] + beyond, world.robot.lower[2] - beyond
    moved = Problem(World(world.robot), start, goal)
    assert moved.start[1] == world.robot.upper[1]
    assert moved.goal.q[2] == world.robot.lower[2]
    rows = JointPath.of(world.robot, [start, goal]).waypoints
    assert (rows == [moved.start, moved.goal.q]).all()


def test_a_value_just_too_far_outside_is_told_with_digits_enough(world):
    start = FREE.copy()
    start[1] = world.robot.upper[1] + 2e-5
    with pytest.raises(ProblemError, match="start: joint") as caught:
        Problem(world, start, FREE)
    value, high = re.search(r"is at (\S+) deg, .* \.\. (\S+) deg", str(caught.value)).groups()
    assert value != high
    assert float(value) - float(high) == pytest.approx(np.degrees(2e-5), rel=0.2)
    rows = JointPath.of(world.robot, [start]).waypoints
    assert rows[0, 1] == start[1]


@pytest.mark.parametrize("bad", [[0.0] * 5, [np.nan] * 6, 3.0, [[0.0] * 6]])
def test_what_is_no_configuration_is_refused(world, bad):
    with pytest.raises(InputError, match="start"):
        Problem(world, bad, FREE)
    with pytest.raises(InputError, match="goal"):
        Problem(world, FREE, bad)


def test_inputs_are_copied(world):
    start = FREE.copy()
    problem = Problem(world, start, FREE)
    start[0] = 9.0
    assert problem.start[0] == FREE[0]


def test_goals_of_every_kind_know_when_they_are_reached(world):
    robot = world.robot
    tip = robot.fk(FREE)
    other = FREE + 0.05
    for goal in (JointGoal(FREE), PoseGoal(tip), PositionGoal(tip.translation)):
        problem = Problem(world, other, goal)
        assert problem.reached(FREE)
        assert not problem.reached(other)


def test_the_goal_of_a_continuous_joint_is_turned_to_the_short_way():
    robot = load_robot("kinova")
    turning = int(np.flatnonzero(robot.continuous)[0])
    middle = np.where(np.isfinite(robot.lower), 0.5 * (np.maximum(robot.lower, -7) + np.minimum(robot.upper, 7)), 0.0)
    world = World(robot)
    start, goal = middle.copy(), middle.copy()
    start[turning], goal[turning] = 3.0, -3.0
    if not (world.valid(start) and world.valid(goal)):
        pytest.fail("the middle posture of the kinova arm should be free")
    problem = Problem(world, start, goal)
    assert problem.goal.q[turning] == pytest.approx(2 * np.pi - 3.0)
    assert problem.reached(goal)


def test_only_a_world_makes_a_problem():
    with pytest.raises(InputError, match="World"):
        Problem(load_robot("titan4"), FREE, FREE)


def test_things_say_what_they_are_in_one_line(world):
    path = JointPath.of(world.robot, [FREE, FREE + 0.1])
    texts = [repr(thing) for thing in (world.robot, world.scene, world, Problem(world, FREE, FREE + 0.1), path)]
    assert all("\n" not in text and len(text) < 200 for text in texts)
    assert ["titan4" in texts[0], "panel" in texts[1], "panel" in texts[2], "JointGoal" in texts[3]] == [True] * 4
    assert texts[4] == "JointPath(2 waypoints of 6 joints, 1 transitions, length 0.245 rad)"


def test_a_goal_less_than_half_a_turn_away_is_kept_to_the_bit():
    world = World(load_robot("kinova"))
    turning = np.flatnonzero(world.robot.continuous)
    start = np.mean(world.robot.finite_range(), axis=0) + 0.1
    goals = np.tile(start, (50, 1))
    goals[:, turning] = np.random.default_rng(0).uniform(-3.0, 3.0, (50, len(turning)))
    free = goals[world.valid_batch(goals)]
    assert len(free) > 10
    assert all((Problem(world, start, goal).goal.q == goal).all() for goal in free)


@pytest.mark.parametrize("matrix", [np.zeros((4, 4)), np.diag([2.0, 2.0, 2.0, 1.0]), np.diag([1.0, 1.0, -1.0, 1.0])])
def test_a_goal_pose_that_is_no_rigid_pose_is_refused(matrix):
    with pytest.raises(InputError, match="goal pose"):
        PoseGoal(matrix)


def test_a_region_takes_no_goal_in_joint_values():
    with pytest.raises(InputError, match="plan to each"):
        GoalSet([JointGoal([0.0, 0.0])])


def test_start_and_goal_may_be_named_postures(titan):
    problem = Problem(World(titan), "stowed", "ready")
    assert np.array_equal(problem.start, titan.posture("stowed"))
    assert np.array_equal(problem.goal.q, titan.posture("ready"))
    with pytest.raises(UnknownNameError, match=r"'titan4'.*'redy'"):
        Problem(World(titan), "stowed", "redy")


# --- a problem is data -------------------------------------------------------------------------------------------


def test_a_problem_goes_to_another_process_without_its_world_and_makes_one_there(world):
    problem = Problem(world, FREE, FREE + 0.1, name="reach", planner="bicrdt")
    again = pickle.loads(pickle.dumps(problem))
    assert [each.name for each in fields(Problem)] == ["settings", "start", "goal", "name", "planner"]
    assert vars(again).keys() == {each.name for each in fields(Problem)}
    assert repr(again) == repr(problem)
    assert vars(again).keys() == {each.name for each in fields(Problem)}
    assert again.world is again.world
    assert again.world.settings is again.settings
    assert again.world.valid(FREE)


def test_a_problem_keeps_the_world_in_which_it_was_checked_and_each_that_it_is_given(world):
    problem = Problem(world, FREE, FREE + 0.1)
    assert problem.world is world
    wide = world.with_clearance(0.01)
    assert problem.with_world(wide).world is wide
    assert problem.with_world(wide).settings is wide.settings


def test_a_problem_with_other_settings_has_another_world_that_shares_its_parts(world):
    problem = Problem(world, FREE, FREE + 0.1)
    other = changed(problem, settings=replace(problem.settings, motion_resolution=0.03))
    assert other.world.motion_resolution == 0.03
    assert other.world.checks.solids is world.checks.solids
    assert other.world.checks.checker is world.checks.checker
    assert copy.copy(problem).world.checks.prover is world.checks.prover


def test_path_constraints_of_a_problem_are_settings_of_its_world(world):
    region = TaskRegion(pin.SE3.Identity(), np.tile([-9.0, 9.0], (6, 1)))
    problem = Problem(world, FREE, FREE + 0.1, constraints=[region])
    assert problem.constraints == problem.settings.constraints == problem.world.settings.constraints
    assert len(problem.constraints) == 1
    assert Problem(world, FREE, FREE + 0.1).constraints == ()
