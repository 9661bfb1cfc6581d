"""Goals of several tips at once: all of them are reached, by every kind of planner, and with path constraints."""

import re
import time

import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.cli.app import run
from rrtik_ompl.ik.goal_configurations import GoalSearch

TIPS = ("left_grip_point", "right_grip_point")


def place(robot, q, frame):
    """Pose of a frame, by pinocchio alone (SE3)."""
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, robot.pinocchio_configuration(q)[0])
    return data.oMf[robot.model.getFrameId(frame)].copy()


@pytest.fixture(scope="module")
def pair():
    return rrtik.load_robot("two_titan4")


@pytest.mark.kernels
@pytest.mark.parametrize("name", ["two_titan4", "baxter"])
def test_both_tips_are_at_their_poses_and_the_path_is_free(name):
    robot, rng = rrtik.load_robot(name), np.random.default_rng(3)
    tips = TIPS if name == "two_titan4" else ("left_gripper", "right_gripper")
    ball = rrtik.Obstacle("ball", rrtik.Sphere(0.1), [0.9, 0.0, 0.5])
    world, solved = rrtik.World(robot, rrtik.Scene([ball])), 0
    while solved < 4:
        rows = rng.uniform(*robot.finite_range(), (40, robot.dof))
        rows = rows[world.valid_batch(rows)]
        wanted = {tip: place(robot, rows[1], tip) for tip in tips}
        goal = rrtik.MultiGoal({tip: rrtik.PoseGoal(pose) for tip, pose in wanted.items()})
        plan = rrtik.plan(rrtik.Problem(world, rows[0], goal), seed=1)
        assert plan.found, plan.reason
        assert plan.path.violations(world) == ()
        for tip, pose in wanted.items():
            away = pose.actInv(place(robot, plan.path.end, tip))
            assert np.linalg.norm(away.translation) <= 1e-3
            assert np.linalg.norm(pin.log3(away.rotation)) <= 1e-2
        solved += 1


@pytest.mark.kernels
@pytest.mark.parametrize("planner", ["auto", "RRTConnect", "bicrdt", "cbirrt", "ikurt", "mbrrt"])
def test_every_kind_of_planner_solves_the_shipped_problem(planner):
    problem = rrtik.load_problem("two_titan4")
    plan = rrtik.plan(problem, planner, seed=1, seconds=20.0)
    assert plan.found, plan.reason
    assert problem.reached(plan.path.end)
    assert plan.path.violations(problem.world) == ()


@pytest.mark.kernels
def test_each_arm_may_have_its_own_path_constraint(pair):
    start = pair.posture("ready")
    heights = {tip: float(place(pair, start, tip).translation[2]) for tip in TIPS}
    goal = rrtik.MultiGoal(
        {
            "left_grip_point": rrtik.PositionGoal([1.3, 0.2, heights["left_grip_point"]]),
            "right_grip_point": rrtik.PositionGoal([1.2, -0.7, 0.0]),
        }
    )
    level = rrtik.constraints.on_plane([0.0, 0.0, heights["left_grip_point"]], [0.0, 0.0, 1.0], frame="left_grip_point")
    straight = rrtik.constraints.upright(pair, axis="z", tolerance_deg=5.0, frame="right_grip_point")
    problem = rrtik.Problem(rrtik.World(pair), start, goal, constraints=[level, straight])
    plan = rrtik.plan(problem, seed=1)
    assert plan.found, plan.reason
    assert problem.reached(plan.path.end)
    looking = place(pair, start, "right_grip_point").rotation[:, 2]
    for q in plan.path.resample(0.01).waypoints:
        assert abs(place(pair, q, "left_grip_point").translation[2] - heights["left_grip_point"]) <= 1.5e-3
        cosine = looking @ place(pair, q, "right_grip_point").rotation[:, 2]
        assert np.degrees(np.arccos(min(cosine, 1.0))) <= 5.2


def test_the_arms_of_a_pair_are_the_single_arm_and_check_each_other(pair):
    single, q = rrtik.load_robot("titan4"), np.radians([10, 20, -50, 30, 15, 5])
    both = np.concatenate([q, -q])
    for tip, row, y in zip(TIPS, (q, -q), (0.45, -0.45), strict=True):
        assert np.allclose(
            place(pair, both, tip).homogeneous, rrtik.pose([0, y, 0]).homogeneous @ single.fk(row).homogeneous
        )
    assert np.array_equal(pair.lower, np.tile(single.lower, 2))
    assert np.array_equal(pair.velocity, np.tile(single.velocity, 2))
    crossed = np.zeros(12)
    crossed[0], crossed[6] = np.radians([-50, 50])
    assert not rrtik.World(pair).valid(crossed)
    assert "left_" in rrtik.World(pair).explain(crossed)
    assert "right_" in rrtik.World(pair).explain(crossed)
    apart = rrtik.load_robot("two_titan4", parameters={"apart": 4.0})
    assert rrtik.World(apart).valid(crossed)


@pytest.mark.kernels
def test_what_is_out_of_reach_and_what_is_no_goal_is_said_in_a_line(pair):
    world = rrtik.World(pair)
    far = rrtik.MultiGoal({TIPS[0]: rrtik.PositionGoal([1.3, 0.4, 0.1]), TIPS[1]: rrtik.PositionGoal([9.0, 0.0, 0.0])})
    plan = rrtik.plan(rrtik.Problem(world, "ready", far), seed=1, seconds=1.0)
    assert not plan.found
    assert "'right_grip_point'" in plan.reason
    with pytest.raises(UnknownNameError, match=r"'two_titan4'.*'hand'"):
        rrtik.Problem(world, "ready", rrtik.MultiGoal({"hand": rrtik.PositionGoal([1.0, 0.0, 0.0])}))
    for wrong in (None, {}, [1], {"tip": None}, {3: rrtik.PositionGoal([1.0, 0.0, 0.0])}, {"tip": far}):
        with pytest.raises(InputError) as caught:
            rrtik.MultiGoal(wrong)
        assert "\n" not in str(caught.value)


@pytest.mark.kernels
def test_the_same_seed_finds_the_same_configurations():
    problem = rrtik.load_problem("two_titan4")
    first, second = (GoalSearch(problem, 5).first() for _ in range(2))
    assert len(first) > 1
    assert np.array_equal(first, second)
    assert problem.goal.satisfied(problem.robot, first).all()


@pytest.mark.kernels
def test_which_member_of_a_set_was_reached_is_said(titan, tmp_path, capsys):
    world, q = rrtik.World(titan), np.radians([20, 30, -70, 20, 30, 40])
    near, far = rrtik.PoseGoal(titan.fk(q)), rrtik.PoseGoal(rrtik.pose([9.0, 0.0, 0.0]))
    goal = rrtik.GoalSet([far, near, far])
    plan = rrtik.plan(rrtik.Problem(world, "ready", goal), seed=1)
    assert plan.member == 1
    assert goal.member_at(titan, titan.posture("ready")) is None
    assert rrtik.plan(rrtik.Problem(world, "ready", near), seed=1).member is None
    file = tmp_path / "set.yaml"
    rrtik.Problem(world, "ready", goal).save(file)
    assert run(["plan", str(file)]) == 0
    assert "it ends at goal 2 of 3" in capsys.readouterr().out


@pytest.mark.kernels
@pytest.mark.parametrize("middle", [0.5, 2.5])  # in the post, out of reach
def test_thousands_of_grasps_that_cannot_be_reached_do_not_cost_minutes(middle):
    post = rrtik.Obstacle("post", rrtik.Box([0.1, 0.1, 1.2]), [0.5, 0.0, 0.6])
    world, rng = rrtik.World(rrtik.load_robot("panda"), rrtik.Scene([post])), np.random.default_rng(0)
    places = np.array([middle, 0.0, 0.5]) + 0.02 * rng.normal(size=(2000, 3))
    goal = rrtik.GoalSet([pin.SE3(pin.exp3(rng.normal(size=3)), place) for place in places])
    problem = rrtik.Problem(world, "default", goal)
    rrtik.plan(problem, "RRTConnect", seed=1, seconds=0.01)  # loads kernels
    begin = time.process_time()
    found = rrtik.plan(problem, "RRTConnect", seed=1, seconds=0.05)
    assert time.process_time() - begin < 5.0
    assert not found.found
    # Which of these is found first depends on the machine.
    assert re.search(r"wall time|out of reach|all in collision", found.reason)
    rows = rng.uniform(*world.robot.finite_range(), (5, 7))
    each = np.array([part.distance(world.robot, rows) for part in goal.parts])
    assert (goal.distance(world.robot, rows) == each.min(axis=0)).all()
