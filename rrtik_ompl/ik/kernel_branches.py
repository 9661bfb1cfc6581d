"""The branches of a closed form by its kernel: the same answers as in numpy, many times faster."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Matrix
from rrtik_ompl.fast import branch_layout as layout
from rrtik_ompl.fast import ik_layout
from rrtik_ompl.fast.branch_layout import BRANCHES, DOF
from rrtik_ompl.fast.layout import ALIGNMENT
from rrtik_ompl.fast.library import library
from rrtik_ompl.fast.processor import WIDTH
from rrtik_ompl.fast.robot_tables import Table, table
from rrtik_ompl.ik.form import ClosedFormSolver
from rrtik_ompl.ik.limb import limb_of
from rrtik_ompl.ik.plain_branches import mountings, plain_branches
from rrtik_ompl.robot import LIMIT_TOLERANCE, Robot

ENDLESS = 1e300  # limits of continuous joints: kernels know no infinity
NOTHING = np.zeros(1)


def kernel_branches(
    robot: Robot, form: ClosedFormSolver, poses: NDArray[np.float64], hints: Matrix | None, slack: float, check: bool
) -> list[NDArray[Any]] | None:
    """As `plain_branches`, which answers the poses that are singular; None if there is no kernel for the arm."""
    kernels = library(layout.KERNELS) if form.kernel else None
    arm = None if kernels is None else _arm_of(robot, form)
    if kernels is None or arm is None:
        return None
    call = _Call(poses, hints, slack, check)
    getattr(kernels, form.kernel)(arm.table.address, call.address)
    answers = call.answers()
    odd = np.flatnonzero(call.odd)
    if len(odd):
        rest = plain_branches(robot, form, poses[odd], None if hints is None else hints[odd], slack, check)
        for whole, part in zip(answers, rest, strict=True):
            whole[..., odd] = part
    return answers


@dataclass(frozen=True, slots=True, eq=False)
class _Arm:
    """Its table, and the table that this one points at."""

    table: Table
    limb: Table


@lru_cache(maxsize=64)
def _arm_of(robot: Robot, form: ClosedFormSolver) -> _Arm | None:
    """None if forward kinematics in kernels does not know such a limb."""
    limb = limb_of(robot)
    if limb is None or limb.header[ik_layout.JOINTS] != DOF or limb[ik_layout.SLIDING].any():
        return None
    from_world, to_frame = (_numbers(np.eye(4) if each is None else each) for each in mountings(robot, form))
    fields: dict[int, int | NDArray[Any]] = {
        layout.FROM_WORLD: from_world,
        layout.TO_FRAME: to_frame,
        layout.NUMBERS: np.array(form.numbers),
        layout.LOWEST: np.maximum(robot.lower - LIMIT_TOLERANCE, -ENDLESS),
        layout.HIGHEST: np.minimum(robot.upper + LIMIT_TOLERANCE, ENDLESS),
        layout.TURNING: ((robot.lower < -np.pi) | (robot.upper > np.pi)).astype(np.int32),
        layout.LIMB: limb.address,
    }
    return _Arm(table(fields), limb)


def _numbers(pose: Matrix) -> NDArray[np.float64]:
    return np.concatenate([pose[:3, :3].ravel(), pose[:3, 3]])


class _Call:
    """The table of one call, and its memory, so that threads do not meet. Answers are filled up to whole blocks."""

    def __init__(self, poses: NDArray[np.float64], hints: Matrix | None, slack: float, check: bool) -> None:
        self._count, blocks = len(poses), -(-len(poses) // WIDTH)
        shape = (DOF + 2 if check else DOF, BRANCHES, WIDTH * blocks)
        size = math.prod(shape)
        memory = _aligned(size + layout.WORK_LANES * WIDTH)
        self._numbers = memory[:size].reshape(shape)
        self._truths = np.empty((2 * BRANCHES + 1, shape[2]), dtype=np.bool_)
        self._given = [
            np.ascontiguousarray(each, np.float64) for each in (poses, NOTHING if hints is None else hints, slack)
        ]
        targets, near, near_singular = (array.ctypes.data for array in self._given)
        numbers, truths = memory.ctypes.data, self._truths.ctypes.data
        self._header = np.zeros(layout.CALL_FIELDS, dtype=np.int64)
        fields = {
            layout.ROWS: self._count,
            layout.BLOCKS: blocks,
            layout.POSES: targets,
            layout.NEAR: 0 if hints is None else near,
            layout.SLACK: near_singular,
            layout.Q: numbers,
            layout.REAL: truths,
            layout.FITS: truths + self._truths[:BRANCHES].nbytes,
            layout.ODD: truths + self._truths[:-1].nbytes,
            layout.RESIDUALS: numbers + self._numbers[:DOF].nbytes if check else 0,
            layout.WORK: numbers + self._numbers.nbytes,
        }
        for place, value in fields.items():
            self._header[place] = value

    @property
    def address(self) -> int:
        """Where the fields are."""
        return int(self._header.ctypes.data)

    @property
    def odd(self) -> NDArray[np.bool_]:
        """Which targets are to be answered otherwise, shape (m,)."""
        return self._truths[-1, : self._count]

    def answers(self) -> list[NDArray[Any]]:
        """As of `plain_branches`."""
        own = slice(self._count)
        real, fits = self._truths[:BRANCHES, own], self._truths[BRANCHES:-1, own]
        q, residuals = self._numbers[:DOF, :, own], self._numbers[DOF:, :, own]
        return [q, real, real & fits, np.zeros(self._count, dtype=np.uint8), residuals]


def _aligned(count: int) -> NDArray[np.float64]:
    """So many numbers, not set, that start on a multiple of ``ALIGNMENT`` bytes."""
    memory = np.empty(count + ALIGNMENT // 8)
    start = -memory.ctypes.data % ALIGNMENT // 8
    return memory[start : start + count]
