"""The branches of a closed form placed in the world, held to the joint limits and checked: by its kernel, or in numpy.

Both give the same answers, the kernel many times faster; where there is none, and of singular poses, numpy answers.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import TAU, Matrix, Vector
from rrtik_ompl.ik.analytic.analytic_solver import AnalyticSolver, wrapped
from rrtik_ompl.ik.kernel_tables import limb_of, pose_numbers
from rrtik_ompl.ik.tip_columns import tip_columns
from rrtik_ompl.kernels.ik import branch_layout
from rrtik_ompl.kernels.ik.branch_layout import BRANCHES, DOF, ArmTable, CallTable
from rrtik_ompl.kernels.record import WORD
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.kernels.simd.processor import WIDTH
from rrtik_ompl.kernels.tables.memory import PlannedTable, TablePlan, packed, sizes_of
from rrtik_ompl.model.robot import FEW, LIMIT_TOLERANCE, Robot, poses

UNBOUNDED_ANGLE = 1e300  # limits of continuous joints: kernels know no infinity
AT_A_TIME = 2048  # targets at a time: their arrays stay in the cache


def kernel_branches(
    robot: Robot, form: AnalyticSolver, poses: NDArray[np.float64], hints: Matrix | None, slack: float, check: bool
) -> list[NDArray[Any]] | None:
    """As `reference_branches`, which answers the poses that are singular; None if there is no kernel for the arm."""
    kernels = library(branch_layout.KERNELS) if form.kernel else None
    arm = None if kernels is None else _arm_of(robot, form)
    if kernels is None or arm is None:
        return None

    call = _Call(poses, hints, slack, check)
    getattr(kernels, form.kernel)(arm.table.address, call.address)
    answers = call.answers()

    (odd,) = call.odd.nonzero()
    if len(odd):
        rest = _singular_branches(robot, form, poses[odd], None if hints is None else hints[odd], slack, check)
        for whole, part in zip(answers, rest, strict=True):
            whole[..., odd] = part
    return answers


def _singular_branches(
    robot: Robot, form: AnalyticSolver, poses: NDArray[np.float64], hints: Matrix | None, slack: float, check: bool
) -> list[NDArray[Any]]:
    """As `reference_branches`; of few poses remembered, for every plan to one of them asks again."""
    if len(poses) > FEW:
        return reference_branches(robot, form, poses, hints, slack, check)
    return _remembered(robot, form, poses.tobytes(), None if hints is None else hints.tobytes(), slack, check)


@lru_cache(maxsize=256)
def _remembered(
    robot: Robot, form: AnalyticSolver, poses: bytes, hints: bytes | None, slack: float, check: bool
) -> list[NDArray[Any]]:
    """The same, of the bytes of poses and hints."""
    near = None if hints is None else np.frombuffer(hints).reshape(-1, robot.dof)
    return reference_branches(robot, form, np.frombuffer(poses).reshape(-1, 4, 4), near, slack, check)


def valid_branches(robot: Robot, form: AnalyticSolver, pose: Matrix, hint: Vector) -> Matrix | None:
    """The branches of one pose, shape (4, 4), inside the joint limits, shape (k, dof), in their order.

    The call of the kernel is kept from one use to the next: to make it takes longer than it runs.

    Returns:
        None if the pose is singular, or there is no kernel for the arm.
    """
    kernels = library(branch_layout.KERNELS) if form.kernel else None
    arm = None if kernels is None else _arm_of(robot, form)
    if kernels is None or arm is None:
        return None

    try:  # taken out while it is used, so that threads do not meet
        call = arm.spare.pop()
    except IndexError:
        call = _Call(pose[None], hint[None], 0.0, False)
    else:
        call.begin(pose, hint)

    getattr(kernels, form.kernel)(arm.table.address, call.address)
    rows = call.valid_rows()
    arm.spare.append(call)
    return rows


@dataclass(frozen=True, slots=True, eq=False)
class _Arm:
    """Its table, and calls for one pose with a hint that nobody uses now."""

    table: ArmTable
    spare: list[_Call] = field(default_factory=list)


@lru_cache(maxsize=64)
def _arm_of(robot: Robot, form: AnalyticSolver) -> _Arm | None:
    """None if forward kinematics in kernels does not know such a limb."""
    limb = limb_of(robot)
    if limb is None or limb.joints != DOF or limb.sliding.any():
        return None

    placements = np.array([np.eye(4) if each is None else each for each in mountings(robot, form)])
    from_world, to_frame = pose_numbers(placements)

    table = packed(
        ArmTable,
        from_world=from_world,
        to_frame=to_frame,
        numbers=np.array(form.numbers),
        lowest=np.maximum(robot.lower - LIMIT_TOLERANCE, -UNBOUNDED_ANGLE),
        highest=np.minimum(robot.upper + LIMIT_TOLERANCE, UNBOUNDED_ANGLE),
        turning=((robot.lower < -np.pi) | (robot.upper > np.pi)).astype(np.int32),
        limb=limb,
    )
    return _Arm(table)


class _Call:
    """One call of a kernel. Answers are filled up to whole blocks."""

    def __init__(self, poses: NDArray[np.float64], hints: Matrix | None, slack: float, check: bool) -> None:
        self._count = len(poses)
        self._shape = (BRANCHES, WIDTH * _blocks(len(poses)))
        self._checked = int(check)
        self._table = table = CallTable(PlannedTable(_plan_of(len(poses), hints is not None, check)))
        self.address = table.address

        table.poses.reshape(poses.shape)[:] = poses
        table.slack = slack
        if hints is not None:
            table.near.reshape(hints.shape)[:] = hints

    def begin(self, pose: Matrix, hint: Vector) -> None:
        """Put another pose and hint in place of the only ones."""
        self._table.poses.reshape(pose.shape)[:] = pose
        self._table.near[:] = hint

    def valid_rows(self) -> Matrix | None:
        """Of the only pose the branches inside the limits, shape (k, dof); None if it is to be answered otherwise."""
        if self.odd[0]:
            return None

        table = self._table
        q = table.q.reshape(DOF, *self._shape)[:, :, 0]
        real, fits = (flags.view(np.bool_)[::WIDTH] for flags in (table.real, table.fits))
        rows: Matrix = q.T[real & fits]
        return rows

    def intact(self) -> bool:
        """Whether no kernel has written beyond an array."""
        return self._table.intact()

    @property
    def odd(self) -> NDArray[np.bool_]:
        """Which targets are to be answered otherwise, shape (m,)."""
        return self._table.odd.view(np.bool_)[: self._count]

    def answers(self) -> list[NDArray[Any]]:
        """As `reference_branches` gives them; those of the odd targets are to be filled in."""
        table = self._table
        asked = slice(self._count)
        q = table.q.reshape(DOF, *self._shape)[:, :, asked]
        residuals = table.residuals.reshape(2 * self._checked, *self._shape)[:, :, asked]
        real, fits = (flags.view(np.bool_).reshape(self._shape)[:, asked] for flags in (table.real, table.fits))
        return [q, real, real & fits, np.zeros(self._count, dtype=np.uint8), residuals]


@lru_cache(maxsize=64)
def _plan_of(count: int, hinted: bool, check: bool) -> TablePlan:
    blocks = _blocks(count)
    lanes = WIDTH * blocks
    return sizes_of(
        CallTable,
        q=DOF * BRANCHES * lanes,
        residuals=2 * BRANCHES * lanes if check else 0,
        scratch=branch_layout.SCRATCH_LANES * WIDTH,
        poses=branch_layout.MATRIX_NUMBERS * count,
        near=DOF * count if hinted else 0,
        real=BRANCHES * lanes // WORD,
        fits=BRANCHES * lanes // WORD,
        odd=-(-lanes // WORD),
        rows=count,
        blocks=blocks,
    )


def _blocks(count: int) -> int:
    """Of ``WIDTH`` targets, the last one filled up."""
    return -(-count // WIDTH)


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
    for begin in range(0, max(len(poses), 1), AT_A_TIME):
        rows = slice(begin, begin + AT_A_TIME)
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
