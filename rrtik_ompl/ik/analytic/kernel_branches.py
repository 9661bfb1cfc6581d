"""The branches of a closed form by its kernel: the same answers as in numpy, many times faster."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.ik.analytic.analytic_solver import AnalyticSolver
from rrtik_ompl.ik.analytic.reference_branches import mountings, reference_branches
from rrtik_ompl.ik.serial_chain import limb_of, pose_numbers
from rrtik_ompl.kernels.ik import branch_layout
from rrtik_ompl.kernels.ik.branch_layout import BRANCHES, DOF, ArmTable, CallTable
from rrtik_ompl.kernels.record import WORD
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.kernels.simd.processor import WIDTH
from rrtik_ompl.kernels.tables.memory import PlannedTable, TablePlan, packed, sizes_of
from rrtik_ompl.model.robot import FEW, LIMIT_TOLERANCE, Robot

UNBOUNDED_ANGLE = 1e300  # limits of continuous joints: kernels know no infinity


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
