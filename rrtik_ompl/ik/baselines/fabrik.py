"""FABRIK: the joints as points at fixed distances, pulled to the goal from the tip, then back to the base.

Source: [28]. On the way back each joint turns about its own axis, inside its limits, to where it brings the points
after it nearest to where they were pulled, so that the arm keeps its joints in the plane and in space. With that
convergence is no longer certain, and other starts are tried.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.ik.baselines.joint_axes import Joint, Swing, coupled_fault, joints_to_tip, room
from rrtik_ompl.ik.method_interface import Target
from rrtik_ompl.ik.residual import walked
from rrtik_ompl.model.robot import Robot, poses

ITERATIONS = 200
TIP_WEIGHT = 3.0  # in space, beside the other points; the next point alone never led spatial arms to the goal


def fabrik_misfit(robot: Robot, target: Target) -> str:
    """Why it does not fit: poses, sliding or coupled joints."""
    if target.oriented:
        return "it moves points and knows no orientation; give a position"
    if robot.prismatic.any():
        return "it keeps distances between joints, and this robot has sliding joints"
    return coupled_fault(robot)


def fabrik(
    robot: Robot, goal: Target, starts: Matrix, *, iterations: int = ITERATIONS, enough: int | None = None
) -> tuple[Matrix, int]:
    """Pull from many starts, inside the limits.

    Args:
        robot: An arm of turning joints.
        goal: A position.
        starts: Shape (m, dof).
        iterations: Backward and forward passes, at most.
        enough: Stop when so many starts have arrived; all of them if None.

    Returns:
        Where each start has led to, shape (m, dof), and the iterations taken.
    """
    joints = joints_to_tip(robot)
    return walked(robot, goal, starts, lambda Q: _pass(robot, goal, Q, joints), iterations, enough)


def _pass(robot: Robot, goal: Target, Q: Matrix, joints: tuple[Joint, ...]) -> Matrix:
    frames = robot.chain.joint_frames(Q)
    rows = [joint.row + 1 for joint in joints]
    tips = poses(robot, Q)
    points = np.concatenate([frames[:, rows][..., :3, 3], tips[:, None, :3, 3]], axis=1)
    axes = np.einsum("mkij,kj->mki", frames[:, rows][..., :3, :3], robot.chain.axis[[joint.row for joint in joints]])
    pulled = _pulled(points, goal)

    for k, joint in enumerate(joints):
        axis = axes[:, k]
        origin = points[:, k, None]
        rest = Swing.about(axis, points[:, k + 1 :] - origin)
        weights = _weights(robot, len(joints) - k)
        angle = rest.best((pulled[:, k + 1 :] - origin) * weights[:, None], *room(robot, joint, Q))
        points[:, k + 1 :] = origin + rest.turned(angle)
        axes[:, k + 1 :] = Swing.about(axis, axes[:, k + 1 :]).turned(angle)
        Q[:, joint.column] += angle / joint.gain

    return robot.clamp(Q)


def _pulled(points: NDArray[np.float64], goal: Target) -> NDArray[np.float64]:
    """The points, shape (m, k, 3), pulled after the last one, which is put on the goal; the distances are kept."""
    pulled = points.copy()
    pulled[:, -1] = goal.point
    for k in range(points.shape[1] - 2, 0, -1):
        direction = points[:, k] - pulled[:, k + 1]
        distance = np.linalg.norm(direction, axis=1, keepdims=True)
        length = np.linalg.norm(points[:, k + 1] - points[:, k], axis=1, keepdims=True)
        pulled[:, k] = pulled[:, k + 1] + direction * (length / np.where(distance > 0.0, distance, 1.0))
    return pulled


def _weights(robot: Robot, points: int) -> Vector:
    """What the points that a joint moves count in its angle: in the plane the next one alone, in space all of them."""
    weights = np.ones(points)
    if robot.planar:
        weights[1:] = 0.0
    else:
        weights[-1] = TIP_WEIGHT
    return weights
