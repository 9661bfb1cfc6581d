"""The effective operating space of TITAN-4 on its vehicle."""

import numpy as np
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import pose_from_rpy
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.ik.analytic.closed_form import solutions
from rrtik_robots.titan4.workspace import Camera, EffectiveWorkspace, gripper_poses

NOWHERE = np.array([[50.0, 50.0, 50.0], [51.0, 51.0, 51.0]])


@pytest.fixture(scope="module")
def robot():
    return load_robot("titan4", parameters={"limits": "envelope"})


def seeing_all():
    return Camera(np.array([-20.0, 0.0, 0.0]), np.zeros(3), diagonal_deg=170.0, farthest=100.0)


def test_with_no_vehicle_no_margin_and_a_camera_that_sees_all_it_is_the_reachable_set(robot):
    space = EffectiveWorkspace(robot, [seeing_all()], NOWHERE, 0.0)
    Q = np.random.default_rng(0).uniform(robot.lower, robot.upper, (500, 6))
    poses = robot.fk_batch(Q)
    assert space.contains(poses).all()
    poses[:, :3, 3] += [3.0, 0.0, 0.0]
    assert space.contains(poses).sum() < 100


def test_the_margin_keeps_joints_away_from_their_limits(robot):
    q = np.radians([20, 30, -70, 20, 30, 40])
    on_limit = q.copy()
    on_limit[4] = np.radians(88.0)
    poses = robot.fk_batch([q, on_limit])
    assert EffectiveWorkspace(robot, [seeing_all()], NOWHERE).contains(poses).tolist() == [True, False]
    assert EffectiveWorkspace(robot, [seeing_all()], NOWHERE, np.radians(1.0)).contains(poses).all()


def test_a_vehicle_that_holds_the_elbow_forbids_the_posture(robot):
    poses = robot.fk_batch(np.random.default_rng(1).uniform(robot.lower, robot.upper, (50, 6)))
    found = solutions(robot, poses, check=False)
    only = int(np.flatnonzero(found.valid.sum(axis=1) == 1)[0])
    pose, q = poses[only : only + 1], found.branches[only][found.valid[only]][0]
    assert EffectiveWorkspace(robot, [seeing_all()], NOWHERE, 0.0).contains(pose)[0]
    elbow = robot.fk(q, "forearm").translation
    around = np.stack([elbow - 0.05, elbow + 0.05])
    assert not EffectiveWorkspace(robot, [seeing_all()], around, 0.0).contains(pose)[0]


def test_a_camera_sees_its_picture_and_what_pan_and_tilt_add():
    fixed = Camera(np.zeros(3), np.array([1.0, 0.0, 0.0]), pan_deg=0.0, tilt_deg=0.0)
    wide = np.degrees(np.arctan(0.8 * np.tan(np.radians(39.0))))  # half of the width of a 4:3 picture

    def at(pan_deg, tilt_deg, distance=1.0):
        pan, tilt = np.radians([pan_deg, tilt_deg])
        return distance * np.array([np.cos(tilt) * np.cos(pan), np.cos(tilt) * np.sin(pan), np.sin(tilt)])

    points = [at(0, 0), at(wide - 0.1, 0), at(wide + 0.1, 0), at(0, 25), at(0, 27), at(180, 0), at(0, 0, 0.1)]
    assert fixed.sees(points).tolist() == [True, True, False, True, False, False, False]
    turned = Camera(np.zeros(3), np.array([1.0, 0.0, 0.0]), pan_deg=10.0, tilt_deg=0.0)
    assert turned.sees([at(wide + 9, 0), at(wide + 11, 0)]).tolist() == [True, False]


def test_a_camera_that_looks_straight_down_is_refused():
    with pytest.raises(InputError, match="straight up or down"):
        Camera(np.zeros(3), np.array([0.0, 0.0, -1.0]))


def test_the_default_space_lies_in_front_of_the_vehicle_and_inside_the_reach(robot):
    space = EffectiveWorkspace(robot)
    x, z = np.arange(-2.0, 2.51, 0.1), np.arange(-1.6, 2.01, 0.1)
    side = space.side_view(x, z)
    assert side.shape == (len(z), len(x))
    assert side.any()
    assert not side[:, x < 0.0].any()
    assert not side[:, x > 1.95].any()
    top = space.top_view(x, np.arange(-2.0, 2.01, 0.1))
    assert top.shape == (41, len(x))
    np.testing.assert_array_equal(top[20], space.side_view(x, [0.0])[0])  # the two slices meet in a line


def test_moving_the_vehicle_moves_the_space_with_it(robot):
    moved = load_robot("titan4", base_pose=pose_from_rpy([1, 2, 3], [0.1, 0.2, 0.3]), parameters={"limits": "envelope"})
    x, z = np.arange(0.0, 2.0, 0.2), np.arange(-1.0, 1.0, 0.2)
    np.testing.assert_array_equal(EffectiveWorkspace(moved).side_view(x, z), EffectiveWorkspace(robot).side_view(x, z))


def test_gripper_poses_are_those_of_the_arm_with_a_straight_wrist(robot):
    q = np.radians([20, 30, -70, 15, 0, 0])
    pose = robot.fk(q)
    np.testing.assert_allclose(gripper_poses(pose.translation, q[0], q[1:4].sum()), pose.homogeneous, atol=1e-12)
