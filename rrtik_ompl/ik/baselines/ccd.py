"""Cyclic coordinate descent: one joint at a time, from the last to the first, each at its own optimum.

Source: [27]. The cost of a pose is the squared distance of the tip and of the ends of its three axes, drawn as long as
a part of the reach.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.ik.baselines.joint_axes import Joint, Swing, joints_to_tip, room
from rrtik_ompl.ik.method_interface import Target
from rrtik_ompl.ik.residual import walked
from rrtik_ompl.model.robot import Robot, poses
from rrtik_ompl.model.tip_distance import reach_of

SWEEPS = 300
AXIS_LENGTH = 0.3  # of the tip's axes, in units of the reach


def ccd(
    robot: Robot, goal: Target, starts: Matrix, *, sweeps: int = SWEEPS, enough: int | None = None
) -> tuple[Matrix, int]:
    """Sweep over the joints from many starts, inside the limits.

    Args:
        robot: An arm without coupled joints.
        goal: A pose, or a position with any orientation.
        starts: Shape (m, dof).
        sweeps: At most.
        enough: Stop when so many starts have arrived; all of them if None.

    Returns:
        Where each start has led to, shape (m, dof), and the sweeps taken.
    """
    joints = joints_to_tip(robot)[::-1]
    length = AXIS_LENGTH * reach_of(robot)
    return walked(robot, goal, starts, lambda Q: _sweep(robot, goal, Q, joints, length), sweeps, enough)


def _sweep(robot: Robot, goal: Target, Q: Matrix, joints: tuple[Joint, ...], length: float) -> Matrix:
    """Every joint once; the frames before a joint stay where they were, so that one forward kinematics is enough."""
    frames = robot.chain.joint_frames(Q)
    tips = poses(robot, Q)

    wanted = np.zeros((1, 4 if goal.oriented else 1, 3))
    wanted[0, 0] = goal.point
    points = tips[:, None, :3, 3]
    if goal.oriented:
        wanted[0, 1:] = wanted[0, 0] + length * goal.pose.rotation.T
        points = np.concatenate([points, points + length * tips[:, :3, :3].transpose(0, 2, 1)], axis=1)

    for joint in joints:
        axis = frames[:, joint.row + 1, :3, :3] @ robot.chain.axis[joint.row]
        origin = frames[:, joint.row + 1, None, :3, 3]
        points = _move(robot, joint, Q, axis, origin, points, wanted)

    return Q


def _move(
    robot: Robot,
    joint: Joint,
    Q: Matrix,
    axis: Matrix,
    origin: NDArray[np.float64],
    points: NDArray[np.float64],
    wanted: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Set one joint of Q in place to its optimum, and move the points, shape (m, k, 3), with it."""
    column = joint.column
    low, high = room(robot, joint, Q)
    if joint.prismatic:
        shift = np.clip(((wanted - points).mean(axis=1) * axis).sum(axis=1), low, high)
        points = points + (shift[:, None] * axis)[:, None]
    else:
        swing = Swing.about(axis, points - origin)
        shift = swing.best(wanted - origin, low, high)
        points = origin + swing.turned(shift)

    Q[:, column] = np.clip(Q[:, column] + shift / joint.gain, robot.lower[column], robot.upper[column])
    return points
