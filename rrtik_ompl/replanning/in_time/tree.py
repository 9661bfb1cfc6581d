"""A tree in configuration and time: from the start onwards, or from goals back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector

GAP_WEIGHT = 0.2  # of a slot between two vertices, beside a slot that the motion needs at least
ROUNDING = 1e-9  # [slots]
NEVER = 1 << 40  # slots: more than any plan has, and still a number


@dataclass(frozen=True, slots=True, eq=False)
class Pace:
    """How far a robot goes in a slot.

    Attributes:
        change: Of each joint [rad or m], shape (n,).
        step: Of the configuration, joints counted alike [unit of the space]; inf for no bound.
    """

    change: Vector
    step: float

    def slots(self, moves: Matrix) -> Vector:
        """The least number of slots that moves, shape (m, n), take; fractions count. Shape (m,)."""
        joints = (np.abs(moves) / self.change).max(axis=1)
        slots: Vector = np.maximum(joints, np.linalg.norm(moves, axis=1) / self.step)
        return slots

    def whole_slots(self, moves: Matrix) -> NDArray[np.int64]:
        """The same in whole slots, ``NEVER`` at most, shape (m,)."""
        return np.minimum(np.ceil(self.slots(moves) - ROUNDING), NEVER).astype(np.int64)


class TimeTree:
    """Vertices are configurations at the begin of slots; an edge is a straight motion at constant speed.

    Attributes:
        q: Shape (k, n).
        slot: Shape (k,).
        size: Number of vertices.
        onward: 1 if children are later than their parents, -1 if they are earlier.

    Args:
        pace: How far the robot goes in a slot.
        onward: See above.
    """

    def __init__(self, pace: Pace, onward: int) -> None:
        self._pace = pace
        self.onward = onward
        self.size = 0
        self._q = np.zeros((64, len(pace.change)))
        self._slot = np.zeros(64, dtype=np.int64)
        self._parent = np.zeros(64, dtype=np.int64)

    @property
    def q(self) -> Matrix:
        """Configurations of the vertices, shape (k, n)."""
        return self._q[: self.size]

    @property
    def slot(self) -> NDArray[np.int64]:
        """Slots of the vertices, shape (k,)."""
        return self._slot[: self.size]

    def add(self, q: Vector, slot: int, parent: int) -> int:
        """A new vertex, a root if the parent is -1; its number."""
        if self.size == len(self._q):
            self._q = np.vstack([self._q, np.zeros_like(self._q)])
            self._slot = np.concatenate([self._slot, np.zeros_like(self._slot)])
            self._parent = np.concatenate([self._parent, np.zeros_like(self._parent)])

        self._q[self.size] = q
        self._slot[self.size] = slot
        self._parent[self.size] = parent
        self.size += 1
        return self.size - 1

    def nearest(self, q: Vector, slot: int) -> int | None:
        """The vertex from which a configuration is reached in a slot most easily; None if no speed suffices."""
        gap = self.onward * (slot - self.slot)
        needed = self._pace.slots(q - self.q)
        reachable = np.flatnonzero((gap > 0) & (needed <= gap + ROUNDING))
        if len(reachable) == 0:
            return None
        return int(reachable[(needed[reachable] + GAP_WEIGHT * gap[reachable]).argmin()])

    def rows_towards(self, vertex: int, q: Vector, slot: int, max_slots: int) -> tuple[Matrix, bool]:
        """Configurations slot by slot from a vertex towards q in a slot, at most so many slots; whether q is the last.

        Returns:
            Shape (k, n), the vertex first.
        """
        gap = abs(slot - int(self._slot[vertex]))
        shares = np.arange(min(gap, max_slots) + 1)[:, None] / gap
        rows: Matrix = self._q[vertex] + shares * (q - self._q[vertex])
        if gap <= max_slots:
            rows[-1] = q
        return rows, gap <= max_slots

    def branch(self, vertex: int) -> tuple[Matrix, NDArray[np.int64]]:
        """Vertices from the root to one of them: configurations, shape (k, n), and slots, shape (k,)."""
        numbers = [vertex]
        while self._parent[numbers[-1]] >= 0:
            numbers.append(int(self._parent[numbers[-1]]))
        return self._q[numbers[::-1]], self._slot[numbers[::-1]]
