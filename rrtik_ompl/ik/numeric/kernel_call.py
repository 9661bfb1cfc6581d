"""One call of the kernels of inverse kinematics, and the arrays that it works on."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.kernels.ik import ik_layout
from rrtik_ompl.kernels.tables.memory import WORD, PlannedTable, Table, TablePlan, table


class KernelCall:
    """What one call of a kernel works on.

    Args:
        limb: See `rrtik_ompl.ik.serial_chain`.
        aims: Goals, one for each row or one for all, see `rrtik_ompl.ik.goal_rows`; like all arrays it is copied.
        q: Where rows begin, shape (m, dof).
        steps: Of a start, at most.
        patience: See `rrtik_ompl.kernels.ik.ik_layout`.
        near: Postures to start from, shape (m, dof).
        following: Number of the next start of each row, shape (m,).

    Attributes:
        address: Where its fields are.
        aims: Its goals; they may be changed between calls.
        q: Where the rows have come to.
        next: Number of the next start of each row now.
    """

    def __init__(
        self,
        limb: Table,
        aims: Matrix,
        q: Matrix,
        steps: int,
        patience: int,
        near: Matrix | None = None,
        following: NDArray[np.int64] | None = None,
    ) -> None:
        given = near is not None, following is not None
        self._memory = memory = PlannedTable(_plan_of(limb, len(aims), len(q), *given, steps, patience))
        self.address = memory.address
        self.q: Matrix = memory[ik_layout.Q].reshape(q.shape)
        self.q[:] = q
        self.next: NDArray[np.int64] = memory[ik_layout.NEXT].view(np.int64)
        self.aims: Matrix = memory[ik_layout.AIMS].reshape(aims.shape)
        self.aims[:] = aims
        if near is not None:
            memory[ik_layout.NEAR].reshape(near.shape)[:] = near
        if following is not None:
            self.next[:] = following

    def begin(self, aim: Matrix, near: Vector) -> None:
        """Start anew, in a call for a single row: from a posture, shape (dof,), to a goal, shape (1, 18)."""
        self.aims[:] = aim
        self._memory[ik_layout.NEAR][:] = near
        self.next[:] = 0

    def intact(self) -> bool:
        """Whether no kernel has written beyond an array."""
        return self._memory.intact()

    @property
    def reached(self) -> Mask:
        """Which rows are at their goals, shape (m,)."""
        rows: Mask = self._memory[ik_layout.REACHED].view(np.int32)[: len(self.q)] != 0
        return rows

    @property
    def steps(self) -> int:
        """How many have been taken."""
        return int(self._memory.header[ik_layout.DONE])


@lru_cache(maxsize=64)
def spare_calls(limb: Table) -> list[KernelCall]:
    """Calls for a single row with all fields, that outlive a use: to make one takes longer than most of them run.

    Whoever uses one takes it out, so that threads do not meet, and puts it back; one that an exception has left is
    not put back.
    """
    del limb
    return []


@lru_cache(maxsize=64)
def _plan_of(limb: Table, aims: int, rows: int, near: bool, begun: bool, steps: int, patience: int) -> TablePlan:
    return TablePlan(*_fields_of(limb, aims, rows, near, begun, steps, patience))


def call_table(limb: Table, steps: int, patience: int) -> Table:
    """What a call for a single row works on, as a table that lives long; see :class:`KernelCall`."""
    arrays, numbers = _fields_of(limb, 1, 1, True, True, steps, patience)
    return table({place: np.zeros(words) for place, words in arrays.items()} | dict(numbers))


def _fields_of(
    limb: Table, aims: int, rows: int, near: bool, begun: bool, steps: int, patience: int
) -> tuple[dict[int, int], dict[int, int]]:
    """Words of the arrays of a call, and its other fields, by their places."""
    dof, joints = int(limb.header[ik_layout.DOF]), int(limb.header[ik_layout.JOINTS])
    arrays = {
        ik_layout.AIMS: ik_layout.AIM_FLOATS * aims,
        ik_layout.NEAR: dof * rows if near else 0,
        ik_layout.Q: dof * rows,
        ik_layout.REACHED: (rows + 1) // 2,
        ik_layout.NEXT: rows if begun else 0,
        ik_layout.FIRST: ik_layout.POSE_NUMBERS,
        ik_layout.FRAMES: ik_layout.POSE_NUMBERS * (joints + 1),
        ik_layout.COLUMNS: ik_layout.TWIST_NUMBERS * dof,
        ik_layout.ERROR: ik_layout.TWIST_NUMBERS,
        ik_layout.WEIGHTS: ik_layout.TWIST_NUMBERS,
        ik_layout.SQUARE: ik_layout.TWIST_NUMBERS**2,
        ik_layout.CHANGE: dof,
        ik_layout.FARNESS: int(limb.header[ik_layout.SEED_COUNT]),
    }
    numbers = {
        ik_layout.ROWS: rows,
        ik_layout.STEPS: steps,
        ik_layout.PATIENCE: patience,
        ik_layout.AIM_BYTES: WORD * ik_layout.AIM_FLOATS if aims > 1 else 0,
        ik_layout.NEAR_BYTES: WORD * dof,
        ik_layout.DONE: 0,
    }
    return arrays, numbers
