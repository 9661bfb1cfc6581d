"""One face of inverse kinematics."""

import re
import time

import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.base.poses import pose_from_rpy
from rrtik_ompl.ik.method_interface import IkRequest, RandomStream
from rrtik_ompl.ik.numeric.restarts import MAX_ROUNDS, restarted
from rrtik_ompl.ik.solve import list_methods, solve_ik
from rrtik_ompl.model.shapes import Box, Sphere

Q_TITAN = np.radians([20, 30, -70, 20, 30, 40])


def pose_goal(robot, q, **options):
    return rrtik.PoseGoal(robot.fk(q), **options)


WHAT_FITS = {
    "titan4": "closed-form",
    "puma560": "closed-form",
    "planar3": "closed-form",
    "ur5": "closed-form",
    "panda": "numeric",
}


@pytest.mark.parametrize(("name", "method"), WHAT_FITS.items())
def test_auto_takes_the_closed_form_where_there_is_one(name, method):
    robot = rrtik.load_robot(name)
    rng = np.random.default_rng(0)
    for q in rng.uniform(*robot.finite_range(), (5, robot.dof)):
        result = solve_ik(robot, pose_goal(robot, q))
        assert (result.found, result.reason, result.method) == (True, "", method)
        assert pose_goal(robot, q).satisfied(robot, result.solutions).all()
        assert robot.within_limits(result.solutions, 0.0).all()
        assert result.solutions.shape == (1, robot.dof)


@pytest.mark.parametrize("method", ["closed-form", "numeric"])
def test_near_a_posture_its_solution_comes_first(method):
    robot = rrtik.load_robot("puma560")
    q = np.radians([40, 60, -120, 30, 40, 20])
    result = solve_ik(robot, pose_goal(robot, q, position_tolerance=1e-6), method=method, near=q + 0.05)
    np.testing.assert_allclose(result.solutions[0], q, atol=1e-3)
    assert (result.iterations > 0) == (method == "numeric")


def test_all_gives_every_solution_nearest_first():
    robot = rrtik.load_robot("puma560")
    q = np.radians([40, 60, -120, 30, 40, 20])
    result = solve_ik(robot, pose_goal(robot, q), all=True, near=q)
    assert len(result.solutions) > 1
    np.testing.assert_allclose(result.solutions[0], q, atol=1e-9)
    assert (np.diff(np.linalg.norm(result.solutions - q, axis=1)) >= 0.0).all()
    assert result.residuals.shape == (len(result.solutions), 2)
    assert result.residuals.max() < 1e-9


def test_a_position_leaves_the_orientation_free():
    robot = rrtik.load_robot("titan4")
    result = solve_ik(robot, rrtik.PositionGoal([1.2, 0.3, 0.1], tolerance=1e-4))
    assert result.method == "numeric"
    assert result.residuals[0, 0] <= 1e-4
    three = rrtik.load_robot("puma560_3dof")
    exact = solve_ik(three, rrtik.PositionGoal(three.fk(three.posture("start")).translation), all=True)
    assert exact.method == "closed-form"
    assert 1 <= len(exact.solutions) <= 4


def test_a_region_is_reached_at_any_of_its_targets():
    robot = rrtik.load_robot("titan4")
    region = rrtik.GoalSet([pose_goal(robot, Q_TITAN)], free_rotation_axis="z", box=[0.1, 0.0, 0.0])
    result = solve_ik(robot, region, all=True)
    assert result.method == "closed-form"
    assert len(result.solutions) > 5
    assert region.satisfied(robot, result.solutions).all()
    assert result.residuals.max() < 1e-9


def test_unreachable_says_by_how_much():
    for name, method in (("titan4", "closed-form"), ("titan4", "numeric"), ("ur5", "numeric")):
        robot = rrtik.load_robot(name)
        goal = rrtik.PositionGoal([3.0, 0.0, 0.0]) if method == "numeric" else rrtik.PoseGoal(
            robot.fk(np.zeros(6)) * pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.25])))  # fmt: skip
        result = solve_ik(robot, goal, method=method, seconds=20.0)
        assert result.reason == "unreachable"
        assert not result.found
        assert result.solutions.shape == (0, 6)
        if name == "titan4":
            assert f"{0.25 if method == 'closed-form' else 3.0 - 1.922:.3g} m" in result.detail


@pytest.mark.parametrize("method", ["closed-form", "numeric"])
def test_a_pose_that_only_the_limits_forbid_says_which(method):
    robot = rrtik.load_robot("titan4")
    q = Q_TITAN.copy()
    q[5] = np.radians(150.0)
    result = solve_ik(robot, pose_goal(robot, q), method=method, seconds=20.0)
    assert result.reason == "limits"
    assert "outside its limits" in result.detail


@pytest.mark.parametrize("method", ["closed-form", "numeric"])
def test_a_pose_inside_an_obstacle_says_what_touches(method):
    robot = rrtik.load_robot("titan4")
    tip = robot.fk(Q_TITAN)
    world = rrtik.World(robot, rrtik.Scene([rrtik.Obstacle("ball", Sphere(0.05), tip)]))
    result = solve_ik(robot, pose_goal(robot, Q_TITAN), method=method, world=world, seconds=20.0)
    assert result.reason == "collision"
    assert "ball" in result.detail


def test_with_a_world_a_free_solution_is_taken_instead_of_a_nearer_one_in_collision():
    robot = rrtik.load_robot("puma560")
    q = np.radians([40, 60, -120, 30, 40, 20])
    everything = solve_ik(robot, pose_goal(robot, q), all=True, near=q).solutions
    elbows = robot.fk_batch(everything, "link3")[:, :3, 3]
    other = int(np.argmax(np.linalg.norm(elbows - elbows[0], axis=1)))
    assert np.linalg.norm(elbows[other] - elbows[0]) > 0.2
    block = rrtik.Obstacle("block", Box([0.05, 0.05, 0.05]), pin.SE3(np.eye(3), elbows[0]))
    world = rrtik.World(robot, rrtik.Scene([block]))
    result = solve_ik(robot, pose_goal(robot, q), world=world, near=q)
    assert result.found
    assert world.valid_batch(result.solutions).all()
    assert np.abs(result.solutions[0] - q).max() > 0.1


def test_a_singular_pose_whose_representatives_break_the_limits_is_still_solved():
    robot = rrtik.load_robot("titan4")
    rng = np.random.default_rng(1)
    for q in rng.uniform(robot.lower, robot.upper, (100, 6)):
        q[4] = np.pi / 2
        result = solve_ik(robot, pose_goal(robot, q, position_tolerance=1e-9, orientation_tolerance=1e-8))
        assert result.found, np.degrees(q)


@pytest.mark.parametrize(("name", "joint", "value"), [("titan4", 4, np.pi / 2), ("puma560", 4, 0.0)])
def test_a_singular_pose_that_is_known_to_six_digits_is_solved_within_its_tolerance(name, joint, value):
    robot, rng = rrtik.load_robot(name), np.random.default_rng(2)
    for q in rng.uniform(robot.lower, robot.upper, (100, 6)):
        q[joint] = value
        tip = robot.fk(q) * pin.SE3(pin.exp3(rng.normal(0.0, 1e-6, 3)), rng.normal(0.0, 1e-6, 3))
        goal = rrtik.PoseGoal(tip)
        result = solve_ik(robot, goal, method="closed-form")
        assert result.found, np.degrees(q)
        assert goal.satisfied(robot, result.solutions).all()


def turned_goal_of_five_joints():
    """A place that the arm reaches, in a direction that it cannot point in."""
    robot = rrtik.load_robot("so100")
    q = np.random.default_rng(6).uniform(*robot.finite_range())
    return robot, rrtik.PoseGoal(robot.fk(q) * pin.SE3(pin.exp3(np.array([0.0, 0.0, 1.0])), np.zeros(3)))


def test_no_time_is_a_reason_of_its_own():
    robot, goal = turned_goal_of_five_joints()
    assert solve_ik(robot, goal, method="pso", seconds=0.0).reason == "time"
    assert solve_ik(robot, goal, seconds=20.0).reason == "unreachable"


@pytest.mark.parametrize("method", ["genetic", "damped", "pinocchio", "ccd", "pso", "projection"])
def test_what_is_too_far_for_the_arms_lengths_is_unreachable_however_short_the_time(method):
    robot = rrtik.load_robot("panda")
    result = solve_ik(robot, rrtik.PositionGoal([5.0, 0.0, 0.3]), method=method, seconds=0.0)
    assert (result.reason, result.solutions.shape) == ("unreachable", (0, 7))
    assert re.search(r" 4\.0[56] m away$", result.detail)


def test_how_far_away_is_told_in_metres_and_for_poses_in_degrees():
    robot, goal = turned_goal_of_five_joints()
    detail = solve_ik(robot, goal, seconds=20.0).detail
    assert detail.startswith("the closest configuration is ")
    assert detail.endswith(" degrees away")
    point = solve_ik(robot, rrtik.PositionGoal([3.0, 0.0, 0.0])).detail
    assert point.endswith(" m away")
    assert "and" not in point


def bars(robot, count):
    """Regions around postures inside the limits, of which a small part is in reach."""
    for q in np.random.default_rng(0).uniform(*robot.finite_range(), (count, robot.dof)):
        yield rrtik.TaskRegion.about_axis(robot.fk(q), [0.0, 0.0, 1.0], turn=[-0.5, 0.5], slide=[-0.05, 0.05])


def test_auto_walks_onto_a_region_of_which_no_drawn_target_is_in_reach():
    robot, methods = rrtik.load_robot("titan4"), set()
    for region in bars(robot, 60):
        result = solve_ik(robot, region, seconds=20.0)
        assert result.found
        assert region.satisfied(robot, result.solutions).all()
        methods.add(result.method)
    assert methods == {"closed-form", "projection"}


def test_targets_drawn_from_a_region_prove_nothing_about_the_region():
    robot = rrtik.load_robot("titan4")
    missed = [solve_ik(robot, region, method="closed-form") for region in bars(robot, 60)]
    missed = [result for result in missed if not result.found]
    assert missed
    assert {result.reason for result in missed} == {"time"}
    assert "none of 32 targets drawn from the goal" in missed[0].detail


def test_a_closed_form_looks_at_every_grasp_of_a_large_set():
    robot = rrtik.load_robot("titan4")
    far = [rrtik.PoseGoal(pose_from_rpy([5.0 + k, 0.0, 0.0], [0.0, 0.0, 0.0])) for k in range(200)]
    near = pose_goal(robot, Q_TITAN)
    for place in (0, 100, 200):
        result = solve_ik(robot, rrtik.GoalSet([*far[:place], near, *far[place:]]))
        assert (result.method, near.satisfied(robot, result.solutions).tolist()) == ("closed-form", [True])


def test_methods_that_walk_from_random_starts_give_every_target_a_round():
    robot = rrtik.load_robot("ur5")
    goals = tuple(rrtik.PositionGoal([5.0 + k, 0.0, 0.0]) for k in range(2 * MAX_ROUNDS))
    asked = []

    def stay(robot, target, Q):
        asked.append(target)
        return Q, 1

    rest = {"near": np.zeros(6), "accept": lambda Q: np.ones(len(Q), dtype=bool), "all": False, "budget": Budget()}
    restarted(stay, IkRequest(robot, rrtik.GoalSet(goals), goals, random=RandomStream(0), **rest))
    assert asked == list(goals)


@pytest.mark.parametrize("method", ["numeric", "genetic", "mb-rrt"])
def test_the_same_seed_gives_the_same_solutions_and_another_seed_others(method):
    robot = rrtik.load_robot("panda")
    goal = rrtik.PositionGoal([0.4, 0.2, 0.5])
    one, two, other = (solve_ik(robot, goal, method=method, all=True, seed=k, seconds=60.0) for k in (3, 3, 4))
    np.testing.assert_array_equal(one.solutions, two.solutions)
    assert not np.array_equal(one.solutions, other.solutions)


def test_bad_arguments_are_refused_in_one_line():
    titan, panda = rrtik.load_robot("titan4"), rrtik.load_robot("panda")
    goal = pose_goal(titan, Q_TITAN)
    with pytest.raises(UnknownNameError, match=r"'closed'.*auto, ccd, closed-form"):
        solve_ik(titan, goal, method="closed")
    with pytest.raises(InputError, match=r"'panda'.*numeric"):
        solve_ik(panda, goal, method="closed-form")
    with pytest.raises(InputError, match=r"pose.*position"):
        solve_ik(titan, rrtik.PositionGoal([1, 0, 0]), method="closed-form")
    with pytest.raises(InputError, match="holds another robot"):
        solve_ik(titan, goal, world=rrtik.World(panda))
    with pytest.raises(InputError, match=r"near.*6 joints"):
        solve_ik(titan, goal, near=[0.0])
    with pytest.raises(InputError, match="goal must be of type PoseGoal"):
        solve_ik(titan, rrtik.JointGoal(np.zeros(6)))
    with pytest.raises(InputError, match=r"NoneType.*PoseGoal\(T_world_tip\)"):
        solve_ik(titan, None)


POSES = np.tile(np.eye(4), (2, 1, 1))
CALLS = {
    "one": lambda robot, **options: solve_ik(robot, rrtik.PoseGoal(POSES[0]), **options),
    "batch": lambda robot, **options: rrtik.solve_ik_many(robot, POSES, **options),
    "trajectory": lambda robot, **options: rrtik.ik.solve_trajectory(robot, POSES, **options),
    "map": lambda robot, **options: rrtik.ik.reach_map(robot, **options),
}


@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
def test_arguments_that_all_calls_have_are_refused_in_one_line(call):
    robot, twin = rrtik.load_robot("ur5"), rrtik.load_robot("ur10")  # as many joints, other lengths
    assert robot.dof == twin.dof
    for seed in (-1, 1.5, "a", True):
        with pytest.raises(InputError, match=f"seed.*, got {seed!r}"):
            call(robot, seed=seed)
    with pytest.raises(InputError, match=r"world.*'ur10'"):
        call(robot, world=rrtik.World(twin))
    for world, kind in ((rrtik.Scene(), "Scene"), ("empty", "str")):
        with pytest.raises(InputError, match=f"world.*, got {kind}; make it with World"):
            call(robot, world=world)
    with pytest.raises(InputError, match=r"robot.*str.*load_robot"):
        call("ur5")
    if call is not CALLS["map"]:
        with pytest.raises(InputError, match=r"seconds.*-1"):
            call(robot, seconds=-1)
        with pytest.raises(InputError, match=r"seconds.*finite.*inf"):
            call(robot, seconds=np.inf)


def test_the_joint_that_forbids_a_pose_is_of_the_branch_that_breaks_the_limits_least():
    titan = rrtik.load_robot("titan4")
    q = np.radians([30.0, 80.0, -130.0, -20.0, 40.0, 124.0])
    result = solve_ik(titan, pose_goal(titan, q), method="closed-form")
    assert re.search(r"'wrist_rotate'.*124 deg.*-120 \.\. 120 deg", result.detail)


def test_with_a_tip_that_the_last_joint_does_not_carry_auto_is_numeric():
    robot = rrtik.load_robot("titan4", tip="wrist")
    goal = rrtik.PoseGoal(robot.fk(Q_TITAN))
    assert solve_ik(robot, goal).method == "numeric"
    with pytest.raises(InputError, match="tip 'wrist'"):
        solve_ik(robot, goal, method="closed-form")


def test_the_methods_have_names():
    assert list_methods()[:4] == ("closed-form", "numeric", "genetic", "mb-rrt")


def test_numeric_looks_at_every_grasp_of_a_large_set():
    robot = rrtik.load_robot("ur5")
    far = [rrtik.PoseGoal(pose_from_rpy([5.0 + k, 0.0, 0.0], [0.0, 0.0, 0.0])) for k in range(70)]
    near = pose_goal(robot, Q_TITAN)
    result = solve_ik(robot, rrtik.GoalSet([*far, near]), method="numeric", seconds=20.0)
    assert result.found
    assert near.satisfied(robot, result.solutions).all()


def test_numeric_takes_targets_drawn_from_task_regions():
    robot = rrtik.load_robot("ur5")
    bar = rrtik.TaskRegion.about_axis(robot.fk(Q_TITAN), [0.0, 0.0, 1.0], slide=[-0.1, 0.1])
    goal = rrtik.GoalSet([rrtik.PositionGoal([5.0, 0.0, 0.0]), bar])
    result = solve_ik(robot, goal, method="numeric", seconds=20.0)
    assert result.found
    assert bar.satisfied(robot, result.solutions).all()


def test_thousands_of_grasps_that_all_collide_cost_seconds_and_say_so():
    robot = rrtik.load_robot("ur5")
    rows = np.random.default_rng(5).uniform(-0.5, 0.5, (3000, robot.dof))
    grasps = rrtik.GoalSet([rrtik.PoseGoal(tip) for tip in robot.fk_batch(rows)])
    world = rrtik.World(robot, rrtik.Scene([rrtik.Obstacle("rock", Box([4.0, 4.0, 4.0]), [0.0, 0.0, 0.0])]))
    begin = time.process_time()
    found = solve_ik(robot, grasps, world=world, seconds=0.3)
    assert time.process_time() - begin < 8.0  # a second or two; comparing all with all took twenty
    assert (found.found, found.reason) == (False, "collision")
    assert "configurations or more reach the goal, all in collision" in found.detail
    assert solve_ik(robot, grasps, world=rrtik.World(robot), seconds=0.3).found
