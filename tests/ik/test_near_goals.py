"""The nearest free configurations at a goal of the tip, which `plan()` searches to first."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.description.joint_weights import weighted_difference
from rrtik_ompl.ik import near_goals as module
from rrtik_ompl.ik.goal_configurations import GoalSearch
from rrtik_ompl.ik.near_goals import near_goals, starts_at_goal
from rrtik_ompl.kernels.ik.near_layout import FAR

pytestmark = pytest.mark.kernels
MOST = 4
BY_BRANCHES = ("ur5_table", "titan4_sdu")
BY_WALKING = ("panda_shelf", "kinova_table", "so101_bin")
AT_A_POINT = ("puma_position",)


def to_pose(name):
    """A shipped problem with a goal of the tip."""
    problem = rrtik.load_problem(name)
    if problem.goal.q is None:
        return problem
    return rrtik.Problem(problem.world, problem.start, rrtik.PoseGoal(problem.robot.fk(problem.goal.q)))


def distances(problem, rows):
    return np.linalg.norm(weighted_difference(problem.robot, rows, problem.start), axis=1)


def tips(problem, rows):
    """Poses of the tip by Pinocchio."""
    model, data = problem.robot.model, problem.robot.model.createData()
    for row in problem.robot.pinocchio_configuration(rows):
        pin.framesForwardKinematics(model, data, row)
        yield data.oMf[model.getFrameId(problem.robot.tip)]


@pytest.mark.parametrize("name", [*BY_BRANCHES, *BY_WALKING, *AT_A_POINT])
def test_they_are_at_the_goal_free_within_limits_sorted_apart_and_no_farther_than_a_search_finds(name):
    problem = to_pose(name)
    goal, robot = problem.goal, problem.robot
    rows = near_goals(problem, MOST)
    assert 1 <= len(rows) <= MOST
    for tip in tips(problem, rows):
        assert np.linalg.norm(tip.translation - goal.point) <= goal.tolerances[0]
        if goal.oriented:
            assert np.linalg.norm(pin.log3(tip.rotation.T @ goal.pose.rotation)) <= goal.tolerances[1]
    assert ((robot.lower <= rows) & (rows <= robot.upper)).all()
    assert problem.world.certify(rows).all()
    away = distances(problem, rows)
    assert (np.diff(away) >= -1e-9).all()
    assert away[-1] <= FAR * away[0] + 1e-9
    assert all(np.abs(a - b).max() > 1e-3 for k, a in enumerate(rows) for b in rows[:k])
    searched = GoalSearch(to_pose(name), 1).first()
    assert away[0] <= 1.02 * distances(problem, searched).min()


@pytest.mark.parametrize("name", ["panda_shelf", "ur5_table"])
def test_threads_at_once_get_the_answers_of_one_alone(name):
    problem = to_pose(name)
    alone = near_goals(problem, MOST)
    others = [rrtik.Problem(rrtik.World.of(problem.world.settings), problem.start, problem.goal) for _ in range(4)]
    with ThreadPoolExecutor(4) as pool:
        for found in pool.map(lambda each: [near_goals(each, MOST) for _ in range(20)], others):
            for rows in found:
                np.testing.assert_array_equal(rows, alone)


def test_no_kernel_writes_beyond_its_memory():
    for name in ("panda_shelf", "ur5_table"):
        problem = to_pose(name)
        assert near_goals(problem, MOST) is not None
        assert all(search.intact() for search in module._arm_of(problem.robot).spare)


def test_configurations_that_collide_are_passed_over():
    problem = to_pose("panda_shelf")
    nearest = near_goals(problem, 1)[0]
    elbow = problem.robot.fk(nearest, "panda_link4").translation
    post = rrtik.Obstacle("post", rrtik.Sphere(0.02), rrtik.pose(elbow))
    world = rrtik.World(problem.robot, rrtik.Scene([*problem.world.scene.obstacles, post]))
    blocked = rrtik.Problem(world, problem.start, problem.goal)
    rows = near_goals(blocked, MOST)
    assert len(rows)
    assert world.certify(rows).all()
    assert distances(blocked, rows)[0] > distances(problem, nearest[None])[0]


@pytest.mark.parametrize("arm", ["so101", "panda", "ur5"])
@pytest.mark.parametrize("line", [True, False])
def test_a_turn_may_be_free_about_the_tip_or_about_a_line_beside_it(arm, line):
    robot = rrtik.load_robot(arm)
    start = np.clip(0.3, robot.lower, robot.upper)
    world = rrtik.World(robot)
    tip = rrtik.pose([0.2 if arm == "so101" else 0.4, 0.1, 0.06], rpy=[np.pi, 0.0, -0.5])
    beside = tip.translation - np.array([0.02, 0.0, 0.0])
    free = rrtik.TaskRegion.about_axis(tip, [0.0, 0.0, 1.0], through=beside) if line else rrtik.GoalSet([tip], "z")

    problem = rrtik.Problem(world, start, free)
    full = rrtik.Problem(world, start, rrtik.PoseGoal(tip))
    at_tip = near_goals(full, MOST)
    rows = near_goals(problem, MOST)
    assert free.satisfied(robot, rows).all()
    assert world.certify(rows).all()
    away = distances(problem, rows)
    assert (np.diff(away) >= -1e-9).all()
    assert away[0] <= 1.02 * distances(problem, GoalSearch(problem, 1).first()).min()
    assert away[0] <= distances(full, at_tip)[0] + 1e-6
    np.testing.assert_array_equal(near_goals(full, MOST), at_tip)  # no goal leaves anything to the next one
    np.testing.assert_array_equal(near_goals(problem, MOST), rows)


def test_what_the_kernels_do_not_know_is_left_to_the_search():
    problem = to_pose("panda_shelf")
    half_turn = rrtik.TaskRegion.about_axis(problem.goal.pose, [0, 0, 1], turn=[-1.5, 1.5])
    assert near_goals(rrtik.Problem(problem.world, problem.start, half_turn), MOST) is None
    sliding = rrtik.TaskRegion.about_axis(problem.goal.pose, [0, 0, 1], slide=[-0.1, 0.1])
    assert near_goals(rrtik.Problem(problem.world, problem.start, sliding), MOST) is None
    out_of_reach = rrtik.Problem(problem.world, problem.start, rrtik.PoseGoal(rrtik.pose([9.0, 0.0, 0.0])))
    assert near_goals(out_of_reach, MOST) is None


@pytest.mark.parametrize("name", ["panda_shelf", "puma_position", "titan4_bar"])
def test_a_start_at_the_goal_is_told(name):
    problem = to_pose(name)
    assert not starts_at_goal(problem)
    there = GoalSearch(problem, 0).first()[0]
    assert starts_at_goal(rrtik.Problem(problem.world, there, problem.goal))
