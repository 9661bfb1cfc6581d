"""One call of the kernels of inverse kinematics, and the arrays that it works on."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Mask, Matrix
from rrtik_ompl.fast.ik import ik_layout as layout
from rrtik_ompl.fast.tables.robot_tables import Table
from rrtik_ompl.ik.call_memory import WORD, CallLayout, CallMemory


class KernelCall:
    """What one call of a kernel works on.

    Args:
        limb: See `rrtik_ompl.ik.serial_chain`.
        aims: Goals, one for each row or one for all, see `rrtik_ompl.ik.goal_rows`; like all arrays it is copied.
        q: Where rows begin, shape (m, dof).
        steps: Of a start, at most.
        patience: See `rrtik_ompl.fast.ik.ik_layout`.
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
        self._memory = memory = CallMemory(_layout_of(limb, len(aims), len(q), *given, steps, patience))
        self.address = memory.address
        self.q: Matrix = memory[layout.Q].reshape(q.shape)
        self.q[:] = q
        self.next: NDArray[np.int64] = memory[layout.NEXT].view(np.int64)
        self.aims: Matrix = memory[layout.AIMS].reshape(aims.shape)
        self.aims[:] = aims
        if near is not None:
            memory[layout.NEAR].reshape(near.shape)[:] = near
        if following is not None:
            self.next[:] = following

    @property
    def reached(self) -> Mask:
        """Which rows are at their goals, shape (m,)."""
        rows: Mask = self._memory[layout.REACHED].view(np.int32)[: len(self.q)] != 0
        return rows

    @property
    def steps(self) -> int:
        """How many have been taken."""
        return int(self._memory.fields[layout.DONE])


@lru_cache(maxsize=64)
def _layout_of(limb: Table, aims: int, rows: int, near: bool, begun: bool, steps: int, patience: int) -> CallLayout:
    dof, joints = int(limb.header[layout.DOF]), int(limb.header[layout.JOINTS])
    arrays = {
        layout.AIMS: layout.AIM_FLOATS * aims,
        layout.NEAR: dof * rows if near else 0,
        layout.Q: dof * rows,
        layout.REACHED: (rows + 1) // 2,
        layout.NEXT: rows if begun else 0,
        layout.FIRST: 12,
        layout.FRAMES: 12 * (joints + 1),
        layout.COLUMNS: 6 * dof,
        layout.ERROR: 6,
        layout.WEIGHTS: 6,
        layout.SQUARE: 36,
        layout.CHANGE: dof,
        layout.FARNESS: int(limb.header[layout.SEED_COUNT]),
    }
    numbers = {
        layout.ROWS: rows,
        layout.STEPS: steps,
        layout.PATIENCE: patience,
        layout.AIM_BYTES: WORD * layout.AIM_FLOATS if aims > 1 else 0,
        layout.NEAR_BYTES: WORD * dof,
        layout.DONE: 0,
    }
    return CallLayout(arrays, numbers)
