"""Messages of a task's motion, by the checks that the controllers of ros2_control make of goals before they take them.

The rules are those of ros2_controllers: validate_trajectory_msg and the interpolation of joint_trajectory_controller,
goal_callback of parallel_gripper_controller, written here once more. No controller of ROS runs here.
"""

from __future__ import annotations

import numpy as np
import pytest
import yaml

import rrtik_ompl as rrtik

# A file of controllers, as controller_manager reads it; the joints of a controller may be in any order.
CONTROLLERS = """\
controller_manager:
  ros__parameters:
    update_rate: 250
    arm_controller: {type: joint_trajectory_controller/JointTrajectoryController}
    hand_controller: {type: parallel_gripper_action_controller/GripperActionController}
arm_controller:
  ros__parameters:
    joints: [panda_joint7, panda_joint6, panda_joint5, panda_joint4, panda_joint3, panda_joint2, panda_joint1]
    command_interfaces: [position]
    state_interfaces: [position, velocity]
    allow_nonzero_velocity_at_trajectory_end: false
hand_controller:
  ros__parameters: {joint: panda_finger_joint1, goal_tolerance: 0.002, allow_stalling: true}
"""


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ros")
    timed = rrtik.Task.load("panda_pick_place").plan(seed=1).time_parameterize()
    timed.trajectory.save(folder / "motion.yaml", gripper=folder / "gripper.yaml", accelerations=False)
    message, commands = (yaml.safe_load((folder / name).read_text()) for name in ("motion.yaml", "gripper.yaml"))
    return timed.trajectory, message, commands


def parameters(controller):
    return yaml.safe_load(CONTROLLERS)[controller]["ros__parameters"]


def nanoseconds(duration):
    return duration["sec"] * 10**9 + duration["nanosec"]


@pytest.mark.kernels
def test_a_joint_trajectory_controller_takes_the_message(files):
    _, message, _ = files
    arm = parameters("arm_controller")
    names = message["joint_names"]
    points = message["points"]
    assert sorted(names) == sorted(arm["joints"])  # else allow_partial_joints_goal is needed
    assert nanoseconds(message["header"]["stamp"]) == 0  # which means now
    assert np.diff([nanoseconds(point["time_from_start"]) for point in points]).min() > 0
    for point in points:
        assert len(point["positions"]) == len(point["velocities"]) == len(names)
        assert not point.get("effort")
    assert np.abs(points[-1]["velocities"]).max() <= np.finfo(np.float32).eps


@pytest.mark.kernels
def test_its_cubics_between_the_points_are_the_motion(files):
    motion, message, _ = files
    points = message["points"]
    for first, last in zip(points[:-1:7], points[1::7], strict=False):
        begin, end = (1e-9 * nanoseconds(point["time_from_start"]) for point in (first, last))
        step = end - begin
        p, v, p1, v1 = (np.array(point[key]) for point in (first, last) for key in ("positions", "velocities"))
        c2 = (3.0 * (p1 - p) - (2.0 * v + v1) * step) / step**2
        c3 = (2.0 * (p - p1) + (v + v1) * step) / step**3
        t = 0.37 * step
        assert np.abs(p + v * t + c2 * t**2 + c3 * t**3 - motion([begin + t]).positions[0]).max() < 1e-6


@pytest.mark.kernels
def test_a_gripper_controller_takes_the_commands(files):
    motion, _, document = files
    hand = parameters("hand_controller")
    assert document["joint_names"] == [hand["joint"]]
    assert len(document["commands"]) == len(motion.gripper) > 1
    for command, event in zip(document["commands"], motion.gripper, strict=True):
        goal = command["ParallelGripperCommand"]["command"]
        assert len(goal["position"]) == 1
        assert command["GripperCommand"]["command"]["position"] == goal["position"][0] == event.positions[0]
        assert all(speed > 0.0 for speed in goal["velocity"])  # a largest velocity of 0 would hold the fingers
