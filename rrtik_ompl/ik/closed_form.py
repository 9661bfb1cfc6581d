"""Closed-form inverse kinematics of a robot that brings it: placed in the world, held to the limits, checked."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.arrays import Matrix, finite_array
from rrtik_ompl.errors import InputError
from rrtik_ompl.ik.form import ClosedFormSolver, wrapped
from rrtik_ompl.ik.planar import planar_form
from rrtik_ompl.ik.tip_columns import tip_columns
from rrtik_ompl.poses import LAST_ROW, LAST_ROW_TOLERANCE, NOT_RIGID
from rrtik_ompl.robot import FEW, LIMIT_TOLERANCE, Robot

BLOCK = 2048  # targets at a time: their arrays stay in the cache
SWEEP = 72  # samples of a singular pose's curve of solutions
TURN = 2.0 * np.pi


@dataclass(frozen=True, slots=True, eq=False)
class ClosedForm:
    """All postures for m targets, b branches each; labels in ``form_of(robot).branches``.

    Attributes:
        branches: Joint values, shape (m, b, dof), turned into the joint limits where a full turn does that. A branch
            that is not real holds the posture that comes nearest on it.
        real: Which branches reach the target, shape (m, b).
        valid: Which do so inside the joint limits, shape (m, b).
        singular: Bit k is set where the target belongs to family k of ``form_of(robot).families`` and has a whole
            curve of solutions, of which ``branches`` holds representatives. Shape (m,).
        residuals: Distance [m] and angle [rad] of the robot's forward kinematics from the target, shape (m, b, 2);
            the angle is 0 for a position. None if not asked for.
    """

    branches: NDArray[np.float64]
    real: NDArray[np.bool_]
    valid: NDArray[np.bool_]
    singular: NDArray[np.uint8]
    residuals: NDArray[np.float64] | None


def form_of(robot: Robot) -> ClosedFormSolver:
    """What the robot brings, or the form of planar arms if it is one.

    Raises:
        InputError: If there is none; it names the methods that fit.
    """
    if isinstance(robot.closed_form, ClosedFormSolver):
        return robot.closed_form
    form = planar_form(robot)
    if form is None:
        raise InputError(
            f"robot '{robot.name}' brings no closed-form inverse kinematics and is no planar arm of two or three "
            "joints; the method that fits every robot is 'numeric'"
        )
    return form


def has_closed_form(robot: Robot) -> bool:
    """Whether `form_of` finds a closed form."""
    return isinstance(robot.closed_form, ClosedFormSolver) or planar_form(robot) is not None


def tip_fault(robot: Robot, form: ClosedFormSolver) -> str:
    """A line if the robot's tip is carried by another joint than the frame that the form places; else ""."""
    tip, own = (robot.model.frames[robot.model.getFrameId(name)] for name in (robot.tip, form.frame))
    if tip.parentJoint == own.parentJoint:
        return ""
    return f"its closed form places '{form.frame}', and the tip '{robot.tip}' does not move with that frame"


def solutions(
    robot: Robot, targets: ArrayLike, *, near: ArrayLike | None = None, slack: float = 0.0, check: bool = True
) -> ClosedForm:
    """All branches for many targets.

    Args:
        robot: An arm with a closed form.
        targets: T_world_tip, shape (m, 4, 4); or points [m], shape (m, 3), if the robot's form is one of positions.
        near: Configuration or configurations, shape (dof,) or (m, dof): singular targets are answered by the members
            of their curve nearest to it, and full turns are chosen to lie near it. Zeros if None.
        slack: A target that is this near to a singular one [m, sine of an angle] is answered as if it were singular,
            with residuals up to about that; for targets that are only known so well.
        check: Whether forward kinematics judges every answer (``residuals``); that takes most of the time.

    Raises:
        InputError: If the robot has no closed form, or a target is no pose or lies beyond numbers.
    """
    poses = _poses(robot, form_of(robot), targets)
    return branches_of(robot, poses, None if near is None else _hints(robot, near, len(poses)), slack, check)


def branches_of(
    robot: Robot, poses: NDArray[np.float64], hints: Matrix | None = None, slack: float = 0.0, check: bool = True
) -> ClosedForm:
    """As `solutions`, for poses and configurations near them, one for each, that need no check any more."""
    form = form_of(robot)
    parts = []
    for begin in range(0, max(len(poses), 1), BLOCK):
        rows = slice(begin, begin + BLOCK)
        parts.append(_block(robot, form, poses[rows], None if hints is None else hints[rows], slack, check))
    joined = parts[0] if len(parts) == 1 else [np.concatenate(each, axis=-1) for each in zip(*parts, strict=True)]
    for array in joined:
        array.setflags(write=False)
    q, real, valid, singular, residuals = joined
    return ClosedForm(q.T, real.T, valid.T, singular, residuals.T if check else None)


def _block(
    robot: Robot, form: ClosedFormSolver, poses: NDArray[np.float64], hints: Matrix | None, slack: float, check: bool
) -> list[NDArray[Any]]:
    """What `ClosedForm` holds, the targets in the last axis, for as many as the cache has room for."""
    found = form(_placed(robot, form, poses), hints, slack)
    q, real = np.array(found.q.T, order="C"), np.array(found.real.T)
    valid = real & _turn_inside(robot, q, hints)
    residuals = tip_residuals(robot, q, poses, form.kind == "pose") if check else np.zeros((2, 0, len(poses)))
    return [q, real, valid, np.array(found.singular), residuals]


def family(robot: Robot, target: ArrayLike, *, samples: int = SWEEP, slack: float = 0.0) -> Matrix:
    """The solutions inside the joint limits of one target, singular or not: of a curve, samples along it.

    Args:
        robot: An arm with a closed form.
        target: T_world_tip, shape (4, 4), or a point, shape (3,).
        samples: Values of the free angle over a full turn.
        slack: See `solutions`.

    Returns:
        Configurations, shape (k, dof), branch by branch in the order of the free angle.
    """
    form = form_of(robot)
    near = np.zeros((samples, robot.dof))
    near[:, list(form.free)] = np.linspace(-np.pi, np.pi, samples, endpoint=False)[:, None]
    goal = np.asarray(target, dtype=np.float64)
    found = solutions(robot, goal[None], slack=slack, check=False)
    if found.singular[0]:
        many = np.broadcast_to(goal, (samples, *goal.shape))
        found = solutions(robot, many, near=near, slack=slack, check=False)
    rows: Matrix = found.branches.transpose(1, 0, 2)[found.valid.T]
    new = np.abs(np.diff(rows, axis=0, prepend=np.full((1, robot.dof), np.inf))).max(axis=1) > LIMIT_TOLERANCE
    different: Matrix = rows[new]
    return different


def _poses(robot: Robot, form: ClosedFormSolver, targets: ArrayLike) -> NDArray[np.float64]:
    if form.kind == "position" and np.ndim(targets) == 2:
        points = finite_array(targets, (None, 3), "targets")
        poses = np.tile(np.eye(4), (len(points), 1, 1))
        poses[:, :3, 3] = points
        return poses
    poses = finite_array(targets, (None, 4, 4), "targets")
    if form.kind == "pose":
        check_poses(poses, "targets")
    return poses


def check_poses(poses: NDArray[np.float64], what: str) -> None:
    """Refuse matrices, shape (m, 4, 4), that are no poses.

    Raises:
        InputError: It says which one and how far it is from orthonormal.
    """
    if len(poses) == 0:
        return
    rotations = poses[:, :3, :3]
    off = np.abs(np.swapaxes(rotations, 1, 2) @ rotations - np.eye(3)).max(axis=(1, 2))
    worst = int(np.argmax(off))
    if off[worst] > NOT_RIGID:
        raise InputError(
            f"{what}: entry {worst} is no rotation: its columns are {off[worst]:.3g} away from orthonormal "
            f"(at most {NOT_RIGID:g}); make it orthonormal"
        )
    mirrored = np.flatnonzero(np.linalg.det(rotations) < 0.0)
    if len(mirrored):
        raise InputError(f"{what}: entry {mirrored[0]} mirrors (determinant -1); a rotation is right-handed")
    odd = np.flatnonzero((np.abs(poses[:, 3] - LAST_ROW) > LAST_ROW_TOLERANCE).any(axis=1))
    if len(odd):
        raise InputError(f"{what}: the last row of entry {odd[0]} must be 0 0 0 1, got {poses[odd[0], 3].tolist()}")


def _hints(robot: Robot, near: ArrayLike, count: int) -> Matrix:
    """One configuration for every target, shape (count, dof)."""
    if np.ndim(near) < 2:
        return np.broadcast_to(robot.configuration(near, "near"), (count, robot.dof))
    return finite_array(near, (count, robot.dof), "near")


def _placed(robot: Robot, form: ClosedFormSolver, poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """T_base_frame for T_world_tip: the base may stand anywhere, and the tip may be another frame of the last link."""
    fault = tip_fault(robot, form)
    if fault:
        raise InputError(f"robot '{robot.name}': {fault}; method 'numeric' fits every tip")
    T_base_world, T_tip_frame = _mountings(robot, form)
    if T_base_world is not None:
        poses = T_base_world @ poses
    return poses if T_tip_frame is None else poses @ T_tip_frame


@lru_cache(maxsize=64)
def _mountings(robot: Robot, form: ClosedFormSolver) -> tuple[Matrix | None, Matrix | None]:
    """T_base_world and T_tip_frame, None where they are the identity."""
    frames = robot.model.frames
    base, tip, own = (frames[robot.model.getFrameId(name)] for name in (robot.link_names[0], robot.tip, form.frame))
    mountings = (base.placement.inverse().homogeneous, (tip.placement.inverse() * own.placement).homogeneous)
    before, after = (None if np.array_equal(matrix, np.eye(4)) else matrix for matrix in mountings)
    return before, after


def _turn_inside(robot: Robot, q: NDArray[np.float64], near: Matrix | None) -> NDArray[np.bool_]:
    """Turn joints by full turns into their limits, towards ``near`` if there is room; which configurations fit.

    Args:
        robot: The arm.
        q: Shape (dof, b, m), changed in place.
        near: Shape (m, dof) or None.
    """
    inside = np.ones(q.shape[1:], dtype=bool)
    for joint in np.flatnonzero(~robot.prismatic):
        low, high, values = robot.lower[joint], robot.upper[joint], q[joint]
        if low < -np.pi or high > np.pi:
            centre = 0.0 if near is None else near[:, joint]
            values[:] = _full_turns(values, low - LIMIT_TOLERANCE, high + LIMIT_TOLERANCE, centre)
        inside &= (values >= low - LIMIT_TOLERANCE) & (values <= high + LIMIT_TOLERANCE)
    return inside


def _full_turns(
    values: NDArray[np.float64], low: float, high: float, near: NDArray[np.float64] | float
) -> NDArray[np.float64]:
    """Equal angles: the one nearest to ``near``, or else the nearest to that inside low .. high if there is one."""
    nearest = near + wrapped(values - near)
    nearest = nearest - TURN * np.ceil(np.maximum(nearest - high, 0.0) / TURN)
    inside: NDArray[np.float64] = nearest + TURN * np.ceil(np.maximum(low - nearest, 0.0) / TURN)
    return inside


def _tips(robot: Robot, q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Columns x, y, z and position of the tip for q of shape (dof, b, m), shape (4, 3, b, m)."""
    rows = q.reshape(robot.dof, -1).T
    if len(rows) > FEW:
        return tip_columns(robot).poses(q)
    return robot.fk_batch(rows)[:, :3].T.reshape(4, 3, *q.shape[1:])


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
    off = tips - poses[:, :3].transpose(2, 1, 0)[:, :, None]
    off *= off
    residuals = np.zeros((2, *tips.shape[2:]))
    residuals[0] = np.sqrt(off[3].sum(axis=0))
    if oriented:  # |R1 - R2| = 2 sqrt(2) sin(angle / 2), accurate for small angles
        chord = np.sqrt(off[:3].sum(axis=(0, 1)) / 8.0)
        residuals[1] = 2.0 * np.arcsin(np.minimum(chord, 1.0))
    return residuals
