"""Straight lines, arcs and screws of the tip: on the line everywhere, as far as it goes, and said why not farther."""

import time

import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError, ProblemError, UnknownNameError
from rrtik_ompl.description.urdf import robot_from_urdf_text
from rrtik_ompl.model.goal import PoseGoal
from rrtik_ompl.planning.tip_motion.attempts import ENDS, RANDOM_REFERENCES, Way, attempt, leanings
from rrtik_ompl.planning.tip_motion.following import Tolerance, centred
from rrtik_ompl.planning.tip_motion.rails import arc_rail, screw_rail, straight_rail

UR5_READY = [0.0, -1.6, 1.8, -0.2, 1.6, 0.0]
DENSE = np.linspace(0.0, 1.0, 51)[:, None]


def beside(pose, x, y, z):
    """A point a shift [m] away from a pose, in world axes."""
    return pose.translation + np.array([x, y, z])


def dense_poses(robot, path):
    """Poses of the tip at 1/50 of every motion of a path, by pinocchio alone."""
    model, data = robot.model, robot.model.createData()
    frame = model.getFrameId(robot.tip)
    poses = []
    for a, b in zip(path.waypoints[:-1], path.waypoints[1:], strict=True):
        for q in a + DENSE * (b - a):
            pin.framesForwardKinematics(model, data, robot.pinocchio_configuration(q)[0])
            poses.append(data.oMf[frame].homogeneous.copy())
    return np.array(poses)


def random_lines(robot, count, seed, length=0.2):
    rng = np.random.default_rng(seed)
    world = rrtik.World(robot)
    while count:
        q = rng.uniform(*robot.finite_range())
        if world.valid(q):
            begin = robot.fk(q)
            turn = pin.exp3(rng.normal(0.0, 0.3, 3))
            yield world, q, begin, pin.SE3(begin.rotation @ turn, begin.translation + rng.normal(0.0, length, 3))
            count -= 1


@pytest.mark.kernels
@pytest.mark.parametrize("name", ["titan4", "ur5_limited", "panda", "puma560"])
def test_the_tip_is_on_the_line_between_waypoints_too_and_joints_do_not_jump(name):
    robot = rrtik.load_robot(name)
    moved = 0
    for world, q, begin, end in random_lines(robot, 6, 3):
        result = rrtik.tip.straight(world, q, end)
        assert (result.fraction == 1.0) == (result.reason == "")
        if result.path is None:
            assert result.fraction == 0.0
            continue
        moved += 1
        poses, rail = dense_poses(robot, result.path), straight_rail(begin, end)
        slide = rail.slide / np.linalg.norm(rail.slide)
        away = poses[:, :3, 3] - begin.translation
        along = away @ slide
        assert np.linalg.norm(away - along[:, None] * slide, axis=1).max() <= 1e-4
        assert along[-1] == pytest.approx(result.fraction * rail.length, abs=1e-4)
        expected = rail.poses(along / rail.length)
        turns = expected[:, :3, :3].transpose(0, 2, 1) @ poses[:, :3, :3]
        assert (
            max(np.linalg.norm(pin.log3(turn)) for turn in turns)
            <= np.radians(0.1) + 2e-4 * rail.turn_angle / rail.length
        )
        assert np.abs(np.diff(result.path.waypoints, axis=0)).max() <= 0.25
        assert result.path.proven
        assert result.path.violations(world) == ()
    assert moved >= 4


@pytest.mark.kernels
def test_a_coarser_tolerance_takes_fewer_waypoints_and_is_kept():
    robot = rrtik.load_robot("ur5")
    world, begin = rrtik.World(robot), robot.fk(UR5_READY)
    goal = beside(begin, 0.1, 0.2, -0.1)
    fine, coarse = (rrtik.tip.straight(world, UR5_READY, goal, deviation=d) for d in (1e-5, 1e-3))
    assert fine.fraction == coarse.fraction == 1.0
    assert len(fine.path.waypoints) > 3 * len(coarse.path.waypoints)
    direction = (goal - begin.translation) / np.linalg.norm(goal - begin.translation)
    for result, allowed in ((fine, 1e-5), (coarse, 1e-3)):
        away = dense_poses(robot, result.path)[:, :3, 3] - begin.translation
        assert np.linalg.norm(np.cross(away, direction), axis=1).max() <= allowed


@pytest.mark.kernels
def test_the_end_of_the_reach_is_where_geometry_puts_it():
    """Of three links in a plane: with its turn held the wrist comes as far as the first two links are long."""
    robot = rrtik.load_robot("planar3")
    lengths = np.linalg.norm(robot.fk_batch(np.zeros((1, 3)))[0, :3, 3])  # all in a row
    q = np.array([0.6, -1.0, 0.4])
    begin = robot.fk(q)
    wrist_at = robot.joint_frames(q[None])[0, 3, :3, 3]
    two = np.linalg.norm(robot.joint_frames(np.zeros((1, 3)))[0, 3, :3, 3])
    direction = np.array([1.0, 0.0, 0.0])
    along = -wrist_at @ direction + np.sqrt((wrist_at @ direction) ** 2 + two**2 - wrist_at @ wrist_at)
    goal = begin.translation + lengths * direction
    result = rrtik.tip.straight(rrtik.World(robot), q, goal)
    assert result.fraction * lengths == pytest.approx(along, abs=1e-4)
    assert "reach" in result.reason


@pytest.mark.kernels
def test_a_limit_is_named_and_reached():
    robot = rrtik.load_robot("ur5_limited")
    q = np.array([0.0, -1.6, 1.8, -0.2, 1.6, np.pi - 0.2])
    begin = robot.fk(q)
    turn = pin.exp3(begin.rotation[:, 2] * 0.5)  # the last joint's own axis
    result = rrtik.tip.straight(rrtik.World(robot), q, pin.SE3(turn @ begin.rotation, begin.translation))
    assert result.fraction == pytest.approx(0.4, abs=1e-4)
    assert result.reason.startswith("limit of joint 'wrist_3_joint'")
    assert result.path.end[5] == pytest.approx(np.pi, abs=1e-4)


@pytest.mark.kernels
def test_a_singular_posture_is_named_with_its_singular_value(titan):
    robot = rrtik.load_robot("ur5")
    q = np.array([0.0, -1.6, 1.8, -0.2, 1.6, 0.0])
    begin = robot.fk(q)
    result = rrtik.tip.straight(rrtik.World(robot), q, beside(begin, 2.0, 0.0, 0.0))
    assert 0.0 < result.fraction < 0.5
    value = float(result.reason.rpartition(" ")[2])
    assert value == pytest.approx(np.linalg.svd(robot.jacobian(result.path.end))[1][-1], rel=0.01)
    assert value < 0.01


@pytest.mark.kernels
def test_an_obstacle_stops_it_just_before_contact_and_the_pair_is_named():
    robot = rrtik.load_robot("ur5")
    begin = robot.fk(UR5_READY)
    wall = rrtik.Obstacle("wall", rrtik.Box([0.02, 1.0, 1.0]), rrtik.pose(beside(begin, 0.15, 0.0, 0.0)))
    free, world = rrtik.World(robot), rrtik.World(robot, rrtik.Scene([wall]))
    goal = beside(begin, 0.2, 0.0, 0.0)
    whole, result = rrtik.tip.straight(free, UR5_READY, goal), rrtik.tip.straight(world, UR5_READY, goal)
    assert whole.fraction == 1.0
    assert 0.0 < result.fraction < 1.0
    assert "wall" in result.reason
    assert result.path.proven
    assert 0.0 < world.clearance(result.path.end) < 1e-3
    margin = rrtik.tip.straight(world, UR5_READY, goal, clearance=0.02)
    assert margin.fraction * 0.2 == pytest.approx(result.fraction * 0.2 - 0.02, abs=1e-3)


@pytest.mark.kernels
def test_from_a_pose_the_branch_that_comes_farthest_is_taken(titan):
    world = rrtik.World(titan)
    rng = np.random.default_rng(4)
    better = 0
    while better < 3:
        begin = titan.fk(rng.uniform(*titan.finite_range()))
        branches = rrtik.solve_ik(titan, PoseGoal(begin), all=True, world=world).solutions
        if len(branches) < 2:
            continue
        goal = begin.translation + rng.normal(0.0, 0.2, 3)
        each = [rrtik.tip.straight(world, q, goal).fraction for q in branches]
        chosen = rrtik.tip.straight(world, begin, goal)
        assert chosen.fraction == pytest.approx(max(each), abs=1e-9)
        better += max(each) > min(each) + 0.01


@pytest.mark.kernels
def test_an_arc_keeps_its_distance_from_the_centre():
    robot = rrtik.load_robot("ur5")
    begin = robot.fk(UR5_READY)
    through, goal = beside(begin, 0.0, 0.1, 0.1), beside(begin, 0.0, 0.2, 0.0)
    result = rrtik.tip.arc(rrtik.World(robot), UR5_READY, goal, through)
    assert result.fraction == 1.0
    places = dense_poses(robot, result.path)[:, :3, 3]
    centre = beside(begin, 0.0, 0.1, 0.0)
    assert np.abs(np.linalg.norm(places - centre, axis=1) - 0.1).max() <= 1e-4
    assert np.linalg.norm(places - through, axis=1).min() < 5e-3
    assert np.linalg.norm(places[-1] - goal) <= 1e-6


@pytest.mark.kernels
def test_a_screw_turns_and_slides_in_proportion():
    robot = rrtik.load_robot("ur5")
    begin = robot.fk(UR5_READY)
    axis, point = np.array([0.0, 0.0, 1.0]), beside(begin, 0.05, 0.0, 0.0)
    turn = pin.exp3(1.2 * axis)
    goal = pin.SE3(turn @ begin.rotation, point + turn @ (begin.translation - point) + 0.06 * axis)
    result = rrtik.tip.screw(rrtik.World(robot), UR5_READY, goal)
    assert result.fraction == 1.0
    for pose in dense_poses(robot, result.path):
        turned = pin.log3(pose[:3, :3] @ begin.rotation.T) @ axis
        assert pose[2, 3] - begin.translation[2] == pytest.approx(0.06 * turned / 1.2, abs=2e-4)
        assert np.linalg.norm(pose[:2, 3] - point[:2]) == pytest.approx(0.05, abs=1e-4)


@pytest.mark.parametrize("angle", [2e-12, 1e-10, 1e-8, 1e-6])
def test_a_screw_that_hardly_turns_ends_at_its_goal(angle):
    rng = np.random.default_rng(3)
    for _ in range(50):
        begin, axis = pin.SE3.Random(), rng.normal(size=3)
        turn = pin.exp3(angle / np.linalg.norm(axis) * axis)
        goal = pin.SE3(turn @ begin.rotation, begin.translation + rng.normal(size=3))
        assert screw_rail(begin, goal).poses([1.0])[0] == pytest.approx(goal.homogeneous, abs=1e-7)


def test_whole_turns_of_a_screw_go_the_other_way_round():
    begin = pin.SE3.Identity()
    goal = pin.SE3(pin.exp3(np.array([0.0, 0.0, 0.5])), np.array([0.0, 0.0, 0.1]))
    short, long = screw_rail(begin, goal), screw_rail(begin, goal, -1)
    assert short.turn_angle == pytest.approx(0.5)
    assert long.turn_angle == pytest.approx(0.5 - 2.0 * np.pi)
    assert np.allclose(short.poses(1.0), goal.homogeneous)
    assert np.allclose(long.poses(1.0), goal.homogeneous)


def test_rails_begin_and_end_where_they_should():
    rng = np.random.default_rng(1)
    for _ in range(20):
        begin, end = pin.SE3.Random(), pin.SE3.Random()
        for rail in (straight_rail(begin, end), screw_rail(begin, end), arc_rail(begin, end, rng.normal(size=3))):
            assert np.allclose(rail.poses([0.0, 1.0]), [begin.homogeneous, end.homogeneous], atol=1e-9)
            ahead = (rail.poses(0.5 + 1e-6) - rail.poses(0.5 - 1e-6))[0] / 2e-6
            assert np.allclose(rail.twist(0.5)[:3], ahead[:3, 3], atol=1e-6)


@pytest.mark.kernels
def test_lines_through_poses_count_by_their_lengths():
    robot = rrtik.load_robot("ur5")
    begin = robot.fk(UR5_READY)
    corners = [begin.translation + offset for offset in ([0.0, 0.1, 0.0], [0.0, 0.1, 0.1], [2.0, 0.1, 0.1])]
    whole = rrtik.tip.follow(rrtik.World(robot), UR5_READY, corners[:2])
    assert whole.fraction == 1.0
    places = dense_poses(robot, whole.path)[:, :3, 3]
    assert np.linalg.norm(places - corners[0], axis=1).min() <= 1e-6
    part = rrtik.tip.follow(rrtik.World(robot), UR5_READY, corners)
    assert np.linalg.norm(robot.fk(part.path.end).translation - corners[1]) == pytest.approx(
        part.fraction * 2.2 - 0.2, abs=1e-3
    )


@pytest.mark.kernels
def test_a_redundant_arm_gets_on_where_its_first_way_is_stopped():
    """Never less far than without other ways to use its freedom, and sometimes farther."""
    robot, gained = rrtik.load_robot("panda"), 0
    for world, q, begin, end in random_lines(robot, 25, 11):
        way = Way((straight_rail(begin, end),), Tolerance(1e-4, np.radians(0.1)), 0.0)
        alone, result = attempt(world, way, q, centred(robot)).fraction, rrtik.tip.straight(world, q, end).fraction
        assert result >= alone
        gained += result > alone + 0.01
    assert gained


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"T_world_goal": [0.1, 0.2]}, InputError, "not 2 numbers"),
        ({"T_world_goal": np.diag([1.0, 1.0, -1.0, 1.0])}, InputError, "mirrors"),
        ({"deviation": 0.0}, InputError, "deviation"),
        ({"turn_deviation": 30.0}, InputError, "radians"),
        ({"clearance": -1.0}, InputError, "clearance"),
        ({"q": [0.0] * 5}, InputError, "6 joints"),
        ({"q": "nowhere"}, UnknownNameError, "no posture"),
        ({"q": [0.0, -1.6, 1.8, -0.2, 1.6, 99.0]}, ProblemError, "outside its limits"),
        ({"q": pin.SE3(np.eye(3), np.array([5.0, 0.0, 0.0]))}, InputError, "no configuration"),
        ({"q": UR5_READY, "T_world_goal": None}, InputError, "T_world_goal"),
    ],
)
def test_bad_input_is_said_in_a_line(change, error, words):
    world = rrtik.World(rrtik.load_robot("ur5_limited"))
    given = {"world": world, "q": UR5_READY, "T_world_goal": [0.4, 0.2, 0.4], **change}
    with pytest.raises(error, match=words) as caught:
        rrtik.tip.straight(**given)
    assert "\n" not in str(caught.value)


def test_no_line_no_arc_no_turn():
    robot = rrtik.load_robot("ur5")
    world, begin = rrtik.World(robot), robot.fk(UR5_READY)
    with pytest.raises(InputError, match="at the goal already"):
        rrtik.tip.straight(world, UR5_READY, begin)
    with pytest.raises(InputError, match="at least one pose"):
        rrtik.tip.follow(world, UR5_READY, [])
    with pytest.raises(InputError, match="lie on a line"):
        rrtik.tip.arc(world, UR5_READY, beside(begin, 0.0, 0.2, 0.0), beside(begin, 0.0, 0.1, 0.0))
    with pytest.raises(InputError, match=r"turns=1.*goal"):
        rrtik.tip.screw(world, UR5_READY, beside(begin, 0.0, 0.2, 0.0), turns=1)
    for turns in (1.5, "one", None, 2_000, 10**400):
        with pytest.raises(InputError, match="turns must be a whole number"):
            rrtik.tip.screw(world, UR5_READY, beside(begin, 0.0, 0.2, 0.0), turns=turns)
    with pytest.raises(InputError, match="6 joints"):
        rrtik.tip.straight(world, [[1.0, 2.0], [3.0]], begin)


@pytest.mark.kernels
def test_the_clock_does_not_decide_which_ways_a_redundant_arm_tries(monkeypatch):
    panda = rrtik.load_robot("panda")
    world, q = rrtik.World(panda), panda.posture("ready")
    begin = panda.fk(q)
    end = pin.SE3(begin.rotation, beside(begin, 0.1, 0.1, 0.0))
    way = Way((straight_rail(begin, end),), Tolerance(1e-4, 1e-3), 0.0, seed=3)
    usual = [leaning.reference for leaning in leanings(world, way, q)]
    real = time.monotonic
    monkeypatch.setattr(time, "monotonic", lambda: 1e5 * real())
    hurried = [leaning.reference for leaning in leanings(world, way, q)]
    assert len(usual) == 2 + ENDS + RANDOM_REFERENCES
    assert np.array_equal(usual, hurried)


@pytest.mark.filterwarnings("ignore:.*all is free")
@pytest.mark.parametrize(("joints", "said"), [(1, "1 joint cannot move"), (3, "3 joints cannot move")])
def test_too_few_joints_are_counted(joints, said):
    links = "".join(f'<link name="l{k}"/>' for k in range(joints + 1))
    links += "".join(
        f'<joint name="j{k}" type="continuous"><parent link="l{k}"/><child link="l{k + 1}"/><origin xyz="0.3 0 0"/>'
        '<axis xyz="0 0 1"/></joint>'
        for k in range(joints)
    )
    world = rrtik.World(robot_from_urdf_text(f'<robot name="flat">{links}</robot>'))
    q = np.full(joints, 0.4)
    result = rrtik.tip.straight(world, q, beside(world.robot.fk(q), 0.0, 0.0, 0.1))
    assert result.reason.startswith(said)
