"""The table of one call of the kernels of inverse kinematics, and the arrays that it points at."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Matrix
from rrtik_ompl.fast import ik_layout as layout
from rrtik_ompl.fast.robot_tables import Table


class KernelCall:
    """What one call of a kernel works on: its own memory, so that threads do not meet.

    Args:
        limb: See `rrtik_ompl.ik.limb`.
        aims: Goals, one for each row or one for all, see `rrtik_ompl.ik.goal_rows`.
        q: Where rows begin, shape (m, dof); a copy is made.
        steps: Of a start, at most.
        patience: See `rrtik_ompl.fast.ik_layout`.
        near: Postures to start from, shape (m, dof).
        following: Number of the next start of each row, shape (m,), changed in place.

    Attributes:
        aims: As given, in the memory that the kernel reads.
        q: Where the rows have come to.
        reached: Whether that is at their goals, shape (m,).
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
        count, dof, joints = len(q), int(limb.header[layout.DOF]), int(limb.header[layout.JOINTS])
        self.q = np.array(q, dtype=np.float64, order="C")
        self.reached = np.zeros(count, dtype=np.int32)
        self.next = np.zeros(0, dtype=np.int64) if following is None else following
        self.header = header = np.zeros(layout.CALL_FIELDS, dtype=np.int64)
        aims = np.ascontiguousarray(aims, dtype=np.float64)
        near = self.q if near is None else np.ascontiguousarray(near)
        sizes = {
            layout.FIRST: 12,
            layout.FRAMES: 12 * (joints + 1),
            layout.COLUMNS: 6 * dof,
            layout.ERROR: 6,
            layout.WEIGHTS: 6,
            layout.SQUARE: 36,
            layout.CHANGE: dof,
            layout.FARNESS: int(limb.header[layout.SEED_COUNT]),
        }
        memory = np.empty(sum(sizes.values()))
        self.aims = aims
        self._kept: tuple[Any, ...] = (near, memory)
        header[layout.ROWS], header[layout.STEPS], header[layout.PATIENCE] = count, steps, patience
        header[layout.AIM_BYTES] = 8 * layout.AIM_FLOATS if len(aims) > 1 else 0
        header[layout.NEAR_BYTES] = 8 * dof
        header[layout.AIMS], header[layout.NEAR] = aims.ctypes.data, near.ctypes.data
        header[layout.Q], header[layout.REACHED] = self.q.ctypes.data, self.reached.ctypes.data
        header[layout.NEXT] = self.next.ctypes.data
        place = memory.ctypes.data
        for name, size in sizes.items():
            header[name] = place
            place += 8 * size

    @property
    def address(self) -> int:
        """Where the fields are."""
        return int(self.header.ctypes.data)
