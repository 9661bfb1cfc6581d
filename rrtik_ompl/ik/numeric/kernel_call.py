"""One call of the kernels of inverse kinematics, and the arrays that it works on."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.kernels.ik import ik_layout
from rrtik_ompl.kernels.ik.ik_layout import CallTable, LimbTable
from rrtik_ompl.kernels.tables.memory import PlannedTable, TablePlan, sizes_of


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
        limb: LimbTable,
        aims: Matrix,
        q: Matrix,
        steps: int,
        patience: int,
        near: Matrix | None = None,
        following: NDArray[np.int64] | None = None,
    ) -> None:
        plan = _plan_of(limb, len(aims), len(q), near is not None, following is not None, steps, patience)
        self._table = table = CallTable(PlannedTable(plan))
        self.address = table.address
        self.q: Matrix = table.q.reshape(q.shape)
        self.q[:] = q
        self.next: NDArray[np.int64] = table.next.view(np.int64)
        self.aims: Matrix = table.aims.reshape(aims.shape)
        self.aims[:] = aims

        if near is not None:
            table.near.reshape(near.shape)[:] = near
        if following is not None:
            self.next[:] = following

    def begin(self, aim: Matrix, near: Vector) -> None:
        """Start anew, in a call for a single row: from a posture, shape (dof,), to a goal, shape (1, 18)."""
        self.aims[:] = aim
        self._table.near[:] = near
        self.next[:] = 0

    def intact(self) -> bool:
        """Whether no kernel has written beyond an array."""
        return self._table.intact()

    @property
    def reached(self) -> Mask:
        """Which rows are at their goals, shape (m,)."""
        rows: Mask = self._table.reached.view(np.int32)[: len(self.q)] != 0
        return rows

    @property
    def steps(self) -> int:
        """How many have been taken."""
        return self._table.done


@lru_cache(maxsize=64)
def spare_calls(limb: LimbTable) -> list[KernelCall]:
    """Calls for a single row with all fields, that outlive a use: to make one takes longer than most of them run.

    Whoever uses one takes it out, so that threads do not meet, and puts it back; one that an exception has left is
    not put back.
    """
    del limb
    return []


@lru_cache(maxsize=64)
def _plan_of(limb: LimbTable, aims: int, rows: int, near: bool, begun: bool, steps: int, patience: int) -> TablePlan:
    """Where a call for so many goals and rows lies in memory."""
    return sizes_of(
        CallTable,
        aims=ik_layout.AIM_FLOATS * aims,
        near=limb.dof * rows if near else 0,
        q=limb.dof * rows,
        reached=(rows + 1) // 2,
        next=rows if begun else 0,
        first=ik_layout.POSE_NUMBERS,
        frames=ik_layout.POSE_NUMBERS * (limb.joints + 1),
        columns=ik_layout.TWIST_NUMBERS * limb.dof,
        error=ik_layout.TWIST_NUMBERS,
        weights=ik_layout.TWIST_NUMBERS,
        square=ik_layout.TWIST_NUMBERS**2,
        change=limb.dof,
        farness=limb.seed_count,
        rows=rows,
        steps=steps,
        patience=patience,
        aim_numbers=ik_layout.AIM_FLOATS if aims > 1 else 0,
        near_numbers=limb.dof,
    )


def call_table(limb: LimbTable, steps: int, patience: int) -> CallTable:
    """What a call for a single row works on; see :class:`KernelCall`."""
    table = CallTable(PlannedTable(_plan_of(limb, 1, 1, True, True, steps, patience)))
    for array in table.memory.arrays.values():
        array[:] = 0.0
    return table
