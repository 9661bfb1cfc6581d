"""Residuals of the tip from a goal, for methods that move towards it step by step."""

from __future__ import annotations

import math
from collections.abc import Callable
from threading import get_ident
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.base.kept import kept_with
from rrtik_ompl.base.poses import working_memory
from rrtik_ompl.model.goal import Target
from rrtik_ompl.model.robot import Robot, pinocchio_rows

SHARE = 0.01  # Share of the tolerance at which a search ends; at the full tolerance rounding could fail a later check.
NEAR_HALF_TURN = 1e-4  # [rad]: this near to pi the skew part of a rotation no longer determines its axis


def well_inside(robot: Robot, goal: Target, Q: Matrix) -> Mask:
    """Check which rows of Q, shape (m, dof), are within a hundredth of the goal's tolerances; shape (m,)."""
    position, angle = goal.errors(robot, Q)
    max_distance, max_angle = goal.tolerances
    return (position <= SHARE * max_distance) & (angle <= SHARE * max_angle)


def error_of_one(robot: Robot, goal: Target, q: Vector) -> tuple[float, float]:
    """Return distance [m] and angle [rad] (0 for a position) of the tip from a goal, for one q, shape (dof,).

    Pinocchio's forward kinematics and plain Python numbers give the same as `tip_errors`, up to rounding, in a quarter
    of its time.
    """
    model, data, frame, q_is_pinocchios = _tip_of(robot, get_ident())
    pin.forwardKinematics(model, data, q if q_is_pinocchios else pinocchio_rows(robot, q[None])[0])
    tip = pin.updateFramePlacement(model, data, frame)
    distance = math.dist(tip.translation.tolist(), goal.point.tolist())
    if not goal.oriented:
        return distance, 0.0

    # The sine from the skew part and the cosine from the trace are together accurate for small and large angles.
    a, b, c = goal.pose.actInv(tip).rotation.tolist()
    sine = 0.5 * math.hypot(c[1] - b[2], a[2] - c[0], b[0] - a[1])
    return distance, math.atan2(sine, 0.5 * (a[0] + b[1] + c[2] - 1.0))


@kept_with
def _tip_of(robot: Robot, thread: int) -> tuple[Any, Any, int, bool]:
    """Return what `error_of_one` needs of Pinocchio; one entry for each thread, which shares no working memory.

    Returns:
        Model, working memory, number of the tip's frame, and whether q needs no conversion for Pinocchio.
    """
    del thread
    chain = robot.chain
    model = robot.model
    q_is_pinocchios = model.nq == robot.dof and np.array_equal(chain.gain, np.eye(robot.dof)) and not chain.offset.any()
    return model, working_memory(model), int(model.getFrameId(robot.tip)), q_is_pinocchios


def walked(
    robot: Robot, goal: Target, starts: Matrix, step: Callable[[Matrix], Matrix], max_steps: int, enough: int | None
) -> tuple[Matrix, int]:
    """Take steps from many starts, inside the limits, until enough of them have arrived.

    Args:
        robot: The arm.
        goal: The goal.
        starts: Configurations to start from, shape (m, dof).
        step: Function from the rows that have not arrived, shape (k, dof), to their next configurations.
        max_steps: Largest number of steps.
        enough: Number of starts that have to arrive; all of them if None.

    Returns:
        The last configuration of each start, shape (m, dof), and the number of steps taken.
    """
    Q = np.clip(starts, robot.lower, robot.upper)
    for number in range(max_steps):
        not_arrived = np.flatnonzero(~well_inside(robot, goal, Q))
        if len(Q) - len(not_arrived) >= min(len(Q), enough or len(Q)):
            return Q, number
        Q[not_arrived] = step(Q[not_arrived])
    return Q, max_steps


def twist(goal: Target, tips: NDArray[np.float64]) -> Matrix:
    """Return the twists from tips, shape (m, 4, 4), to a goal: linear [m] and rotation vector [rad] in world axes.

    Shape (m, 6); the rotation vector is 0 for a position.
    """
    if not goal.oriented:
        return np.hstack([goal.point - tips[:, :3, 3], np.zeros((len(tips), 3))])
    return twist_between(tips, goal.pose.rotation, goal.point)


def twist_between(tips: NDArray[np.float64], rotations: NDArray[np.float64], positions: NDArray[np.float64]) -> Matrix:
    """Return the twists from tips to poses: linear [m] and rotation vector [rad] in world axes, shape (m, 6).

    Args:
        tips: Poses of the tip, shape (m, 4, 4).
        rotations: Wanted rotations, shape (m, 3, 3), or one for all, shape (3, 3).
        positions: Wanted positions [m], shape (m, 3), or one for all, shape (3,).
    """
    turns = rotations @ tips[:, :3, :3].transpose(0, 2, 1)
    return np.hstack([positions - tips[:, :3, 3], _rotation_vectors(turns)])


def shortened(steps: Matrix, largest: float) -> Matrix:
    """Return steps, shape (m, dof), each scaled so that no joint moves by more than ``largest`` [rad or m]."""
    largest_of_step = np.abs(steps).max(axis=1, keepdims=True)
    bounded: Matrix = steps * np.minimum(1.0, largest / np.maximum(largest_of_step, 1e-12))
    return bounded


def _rotation_vectors(R: NDArray[np.float64]) -> Matrix:
    """Return the rotation vectors (logarithms) [rad] of rotations, shape (m, 3, 3); shape (m, 3)."""
    skew = 0.5 * np.stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], axis=1)
    sine = np.linalg.norm(skew, axis=1)
    angle = np.arctan2(sine, 0.5 * (np.trace(R, axis1=1, axis2=2) - 1.0))
    vectors: Matrix = skew * np.where(sine > 0.0, angle / np.where(sine > 0.0, sine, 1.0), 1.0)[:, None]

    for k in np.flatnonzero(angle > np.pi - NEAR_HALF_TURN):
        vectors[k] = pin.log3(R[k])
    return vectors
