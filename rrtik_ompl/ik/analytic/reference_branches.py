"""The branches of a closed form placed in the world, held to the joint limits and checked, in numpy."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import TAU, Matrix
from rrtik_ompl.ik.analytic.analytic_solver import AnalyticSolver, wrapped
from rrtik_ompl.ik.tip_columns import tip_columns
from rrtik_ompl.model.robot import FEW, LIMIT_TOLERANCE, Robot, poses

BLOCK = 2048  # targets at a time: their arrays stay in the cache


@lru_cache(maxsize=64)
def tip_fault(robot: Robot, form: AnalyticSolver) -> str:
    """A line if the robot's tip is carried by another joint than the frame that the form places; else ""."""
    tip, solver_frame = (robot.model.frames[robot.model.getFrameId(name)] for name in (robot.tip, form.frame))
    if tip.parentJoint == solver_frame.parentJoint:
        return ""
    return f"its closed form places '{form.frame}', and the tip '{robot.tip}' does not move with that frame"


def reference_branches(
    robot: Robot, form: AnalyticSolver, poses: NDArray[np.float64], hints: Matrix | None, slack: float, check: bool
) -> list[NDArray[Any]]:
    """What `rrtik_ompl.ik.analytic.closed_form.ClosedForm` holds, in its order, the targets in the last axis of each.

    Args:
        robot: The arm.
        form: Its closed form.
        poses: T_world_tip, shape (m, 4, 4).
        hints: Configurations that solutions are wanted near to, shape (m, dof), or None.
        slack: See `AnalyticSolver`.
        check: Whether residuals are wanted; their array is empty if not.
    """
    parts = []
    for begin in range(0, max(len(poses), 1), BLOCK):
        rows = slice(begin, begin + BLOCK)
        parts.append(_block(robot, form, poses[rows], None if hints is None else hints[rows], slack, check))
    return parts[0] if len(parts) == 1 else [np.concatenate(each, axis=-1) for each in zip(*parts, strict=True)]


def _block(
    robot: Robot, form: AnalyticSolver, poses: NDArray[np.float64], hints: Matrix | None, slack: float, check: bool
) -> list[NDArray[Any]]:
    """The same for as many targets as the cache has room for."""
    found = form(_placed(robot, form, poses), hints, slack, (robot.lower, robot.upper))
    q = np.array(found.q.T, order="C")
    real = np.array(found.real.T)
    valid = real & _turn_inside(robot, q, hints)
    residuals = tip_residuals(robot, q, poses, form.kind == "pose") if check else np.zeros((0, *real.shape))
    return [q, real, valid, np.array(found.singular), residuals]


def _placed(robot: Robot, form: AnalyticSolver, poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """T_base_frame for T_world_tip: the base may be anywhere, and the tip may be another frame of the last link."""
    T_base_world, T_tip_frame = mountings(robot, form)
    if T_base_world is not None:
        poses = T_base_world @ poses
    return poses if T_tip_frame is None else poses @ T_tip_frame


@lru_cache(maxsize=64)
def mountings(robot: Robot, form: AnalyticSolver) -> tuple[Matrix | None, Matrix | None]:
    """T_base_world and T_tip_frame, None where they are the identity."""
    frames = robot.model.frames
    base, tip, solver_frame = (
        frames[robot.model.getFrameId(name)] for name in (robot.link_names[0], robot.tip, form.frame)
    )
    placements = (base.placement.inverse().homogeneous, (tip.placement.inverse() * solver_frame.placement).homogeneous)
    before, after = (None if np.array_equal(each, np.eye(4)) else each for each in placements)
    return before, after


def _turn_inside(robot: Robot, q: NDArray[np.float64], near: Matrix | None) -> NDArray[np.bool_]:
    """Turn joints by full turns into their limits, towards ``near`` if there is room; which configurations fit.

    Args:
        robot: The arm.
        q: Shape (dof, b, m), changed in place.
        near: Shape (m, dof) or None.
    """
    fits = np.ones(q.shape[1:], dtype=bool)
    for joint in np.flatnonzero(~robot.prismatic):
        low = robot.lower[joint]
        high = robot.upper[joint]
        values = q[joint]
        if low < -np.pi or high > np.pi:
            centre = 0.0 if near is None else near[:, joint]
            values[:] = _full_turns(values, low - LIMIT_TOLERANCE, high + LIMIT_TOLERANCE, centre)
        fits &= (values >= low - LIMIT_TOLERANCE) & (values <= high + LIMIT_TOLERANCE)
    return fits


def _full_turns(
    values: NDArray[np.float64], low: float, high: float, near: NDArray[np.float64] | float
) -> NDArray[np.float64]:
    """Equal angles: the one nearest to ``near``, or else the nearest to that inside low .. high if there is one."""
    nearest = near + wrapped(values - near)
    nearest = nearest - TAU * np.ceil(np.maximum(nearest - high, 0.0) / TAU)
    turned: NDArray[np.float64] = nearest + TAU * np.ceil(np.maximum(low - nearest, 0.0) / TAU)
    return turned


def tip_residuals(
    robot: Robot, q: NDArray[np.float64], poses: NDArray[np.float64], oriented: bool = True
) -> NDArray[np.float64]:
    """By forward kinematics how far configurations are from poses.

    Args:
        robot: The arm.
        q: Shape (dof, b, m): b configurations for each of m poses.
        poses: T_world_tip, shape (m, 4, 4).
        oriented: Whether the orientation counts; the angle is 0 if not.

    Returns:
        Distance [m] and angle [rad], shape (2, b, m).
    """
    tips = _tips(robot, q)
    squared_differences = tips - poses[:, :3].transpose(2, 1, 0)[:, :, None]
    squared_differences *= squared_differences

    residuals = np.zeros((2, *tips.shape[2:]))
    residuals[0] = np.sqrt(squared_differences[3].sum(axis=0))
    if oriented:  # |R1 - R2| = 2 sqrt(2) sin(angle / 2), accurate for small angles
        chord = np.sqrt(squared_differences[:3].sum(axis=(0, 1)) / 8.0)
        residuals[1] = 2.0 * np.arcsin(np.minimum(chord, 1.0))

    return residuals


def _tips(robot: Robot, q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Columns x, y, z and position of the tip for q of shape (dof, b, m), shape (4, 3, b, m)."""
    rows = q.reshape(robot.dof, -1).T
    if len(rows) > FEW:
        return tip_columns(robot).poses(q)
    return poses(robot, rows)[:, :3].T.reshape(4, 3, *q.shape[1:])
