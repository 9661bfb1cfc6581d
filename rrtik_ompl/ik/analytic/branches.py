"""The branches of a closed form, placed in the world, turned into joint limits and checked: by a kernel or in numpy.

Both give the same answers, the kernel many times faster. Numpy is used without a kernel, and for singular poses.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import TAU, Matrix, Vector
from rrtik_ompl.base.kept import kept_with
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

UNBOUNDED_ANGLE = 1e300  # limits of continuous joints, since kernels know no infinity
AT_A_TIME = 2048  # number of targets whose arrays fit into the cache


def kernel_branches(
    robot: Robot, form: AnalyticSolver, poses: NDArray[np.float64], hints: Matrix | None, slack: float, check: bool
) -> list[NDArray[Any]] | None:
    """Return the same as `reference_branches`, by a kernel where poses are not singular; None if there is no kernel."""
    kernels = library(branch_layout.KERNELS) if form.kernel else None
    arm = None if kernels is None else _arm_of(robot, form)
    if kernels is None or arm is None:
        return None

    call = _Call(poses, hints, slack, check)
    getattr(kernels, form.kernel)(arm.table.address, call.address)
    answers = call.answers()

    # The kernel leaves singular poses out; they are solved in numpy and filled in.
    (odd,) = call.odd.nonzero()
    if len(odd):
        rest = _singular_branches(robot, form, poses[odd], None if hints is None else hints[odd], slack, check)
        for whole, part in zip(answers, rest, strict=True):
            whole[..., odd] = part
    return answers


def _singular_branches(
    robot: Robot, form: AnalyticSolver, poses: NDArray[np.float64], hints: Matrix | None, slack: float, check: bool
) -> list[NDArray[Any]]:
    """Return the same as `reference_branches`; results for a few poses are kept, since every plan to one repeats it."""
    if len(poses) > FEW:
        return reference_branches(robot, form, poses, hints, slack, check)
    return _remembered(robot, form, poses.tobytes(), None if hints is None else hints.tobytes(), slack, check)


@kept_with
def _remembered(
    robot: Robot, form: AnalyticSolver, poses: bytes, hints: bytes | None, slack: float, check: bool
) -> list[NDArray[Any]]:
    """Return the same for poses, shape (m, 4, 4), and hints, shape (m, dof), given as bytes, which can be hashed."""
    near = None if hints is None else np.frombuffer(hints).reshape(-1, robot.dof)
    return reference_branches(robot, form, np.frombuffer(poses).reshape(-1, 4, 4), near, slack, check)


def valid_branches(robot: Robot, form: AnalyticSolver, pose: Matrix, hint: Vector) -> Matrix | None:
    """Return the branches of one pose inside the joint limits, by the kernel.

    The kernel's call is kept between uses, since making one takes longer than running it.

    Args:
        robot: The arm.
        form: Its closed form.
        pose: T_world_tip, shape (4, 4).
        hint: Configuration near which full turns are chosen, shape (dof,).

    Returns:
        Configurations in the order of branches, shape (k, dof); None if the pose is singular or there is no kernel for
        the arm.
    """
    kernels = library(branch_layout.KERNELS) if form.kernel else None
    arm = None if kernels is None else _arm_of(robot, form)
    if kernels is None or arm is None:
        return None

    try:  # The call is taken out of the list while it is used, so that two threads never share it.
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
    """The table of an arm, and calls for one pose with a hint that are not in use."""

    table: ArmTable
    spare: list[_Call] = field(default_factory=list)


@kept_with
def _arm_of(robot: Robot, form: AnalyticSolver) -> _Arm | None:
    """Return the table of an arm, or None if the kernel cannot compute its forward kinematics."""
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
    """Arguments and results of one call of a kernel; arrays of results are padded to whole blocks of ``WIDTH``."""

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
        """Prepare a call for one pose to run again with another pose, shape (4, 4), and hint, shape (dof,)."""
        self._table.poses.reshape(pose.shape)[:] = pose
        self._table.near[:] = hint

    def valid_rows(self) -> Matrix | None:
        """Return the branches of the only pose inside the limits, shape (k, dof); None if the pose is singular."""
        if self.odd[0]:
            return None

        table = self._table
        q = table.q.reshape(DOF, *self._shape)[:, :, 0]
        real, fits = (flags.view(np.bool_)[::WIDTH] for flags in (table.real, table.fits))
        rows: Matrix = q.T[real & fits]
        return rows

    def intact(self) -> bool:
        """Check that no kernel has written beyond an array."""
        return self._table.intact()

    @property
    def odd(self) -> NDArray[np.bool_]:
        """Whether each target is left to numpy, as singular ones are, shape (m,)."""
        return self._table.odd.view(np.bool_)[: self._count]

    def answers(self) -> list[NDArray[Any]]:
        """Return the arrays of `reference_branches`, where those of odd targets are still to be filled in."""
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
    """Return the number of blocks of ``WIDTH`` targets, the last one padded."""
    return -(-count // WIDTH)


@kept_with
def tip_fault(robot: Robot, form: AnalyticSolver) -> str:
    """Return why the form does not fit the tip, which another joint carries than the form's frame; "" if it fits."""
    tip, solver_frame = (robot.model.frames[robot.model.getFrameId(name)] for name in (robot.tip, form.frame))
    if tip.parentJoint == solver_frame.parentJoint:
        return ""
    return f"its closed form places '{form.frame}', and the tip '{robot.tip}' does not move with that frame"


def reference_branches(
    robot: Robot, form: AnalyticSolver, poses: NDArray[np.float64], hints: Matrix | None, slack: float, check: bool
) -> list[NDArray[Any]]:
    """Compute the branches of poses in numpy.

    Args:
        robot: The arm.
        form: Its closed form.
        poses: T_world_tip, shape (m, 4, 4).
        hints: Configurations that solutions are wanted near to, shape (m, dof), or None.
        slack: See `AnalyticSolver`.
        check: Whether residuals are wanted; their array is empty if not.

    Returns:
        The arrays of `rrtik_ompl.ik.analytic.closed_form.ClosedForm` in its order, with the targets in the last axis:
        branches (dof, b, m), real (b, m), valid (b, m), singular (m,) and residuals (2, b, m).
    """
    parts = []
    for begin in range(0, max(len(poses), 1), AT_A_TIME):
        rows = slice(begin, begin + AT_A_TIME)
        parts.append(_block(robot, form, poses[rows], None if hints is None else hints[rows], slack, check))
    return parts[0] if len(parts) == 1 else [np.concatenate(each, axis=-1) for each in zip(*parts, strict=True)]


def _block(
    robot: Robot, form: AnalyticSolver, poses: NDArray[np.float64], hints: Matrix | None, slack: float, check: bool
) -> list[NDArray[Any]]:
    """Compute the branches as `reference_branches` does, for so few targets that their arrays fit into the cache."""
    found = form(_placed(robot, form, poses), hints, slack, (robot.lower, robot.upper))
    q = np.array(found.q.T, order="C")
    real = np.array(found.real.T)
    valid = real & _turn_inside(robot, q, hints)
    residuals = tip_residuals(robot, q, poses, form.kind == "pose") if check else np.zeros((0, *real.shape))
    return [q, real, valid, np.array(found.singular), residuals]


def _placed(robot: Robot, form: AnalyticSolver, poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return T_base_frame for T_world_tip, shape (m, 4, 4), by the placements of base and tip, see `mountings`."""
    T_base_world, T_tip_frame = mountings(robot, form)
    if T_base_world is not None:
        poses = T_base_world @ poses
    return poses if T_tip_frame is None else poses @ T_tip_frame


@kept_with
def mountings(robot: Robot, form: AnalyticSolver) -> tuple[Matrix | None, Matrix | None]:
    """Return T_base_world and T_tip_frame, shape (4, 4) each; None in place of an identity."""
    frames = robot.model.frames
    base, tip, solver_frame = (
        frames[robot.model.getFrameId(name)] for name in (robot.link_names[0], robot.tip, form.frame)
    )
    placements = (base.placement.inverse().homogeneous, (tip.placement.inverse() * solver_frame.placement).homogeneous)
    before, after = (None if np.array_equal(each, np.eye(4)) else each for each in placements)
    return before, after


def _turn_inside(robot: Robot, q: NDArray[np.float64], near: Matrix | None) -> NDArray[np.bool_]:
    """Move joints by full turns into their limits, as near to ``near`` as these allow, in place.

    Args:
        robot: The arm.
        q: Configurations, shape (dof, b, m), changed in place.
        near: Configurations to be near to, shape (m, dof), or None for 0.

    Returns:
        Whether each configuration is inside the limits, shape (b, m).
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
    """Return angles moved by full turns to lie as near to ``near`` as possible, inside low .. high where possible."""
    nearest = near + wrapped(values - near)
    nearest = nearest - TAU * np.ceil(np.maximum(nearest - high, 0.0) / TAU)
    turned: NDArray[np.float64] = nearest + TAU * np.ceil(np.maximum(low - nearest, 0.0) / TAU)
    return turned


def tip_residuals(
    robot: Robot, q: NDArray[np.float64], poses: NDArray[np.float64], oriented: bool = True
) -> NDArray[np.float64]:
    """Return how far configurations are from poses, by forward kinematics.

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
    """Return the columns x, y, z of the rotation and the position of the tip for q, shape (dof, b, m).

    Shape (4, 3, b, m).
    """
    rows = q.reshape(robot.dof, -1).T
    if len(rows) > FEW:
        return tip_columns(robot).poses(q)
    return poses(robot, rows)[:, :3].T.reshape(4, 3, *q.shape[1:])
