"""Questions about many motions at once that can be broken off."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from typing import TypeAlias

import numpy as np

from rrtik_ompl.arrays import Mask, Matrix

MotionsFree: TypeAlias = Callable[[Matrix, Matrix], Mask]  # as World.motion_valid_batch
Stop: TypeAlias = Callable[[], object]  # true when it is time to stop

MOST_AT_ONCE = 1024  # motions
BLINK = 0.01  # [s] between two looks at the clock; fewer motions are asked about at once if it takes longer


def never() -> bool:
    """It is not time to stop."""
    return False


class OutOfTime(Exception):
    """Ends the work on a lattice."""


class Questions:
    """Asks about motions in parts, so that a search ends soon after it should.

    Attributes:
        asked: Motions so far.
        stop: True ends the search.
    """

    def __init__(self, motions_free: MotionsFree) -> None:
        self._motions_free = motions_free
        self._at_once = 64
        self.asked = 0
        self.stop: Stop = never

    def __call__(self, tails: Matrix, heads: Matrix) -> Mask:
        """Which motions are free, shapes (m, n) and (m,).

        Raises:
            OutOfTime: If it is time to stop.
        """
        parts, first = [np.zeros(0, dtype=bool)], 0
        while first < len(tails):
            if self.stop():
                raise OutOfTime
            begin, last = time.perf_counter(), first + self._at_once
            parts.append(self._motions_free(tails[first:last], heads[first:last]))
            first = last
            if time.perf_counter() - begin > BLINK:
                self._at_once = max(self._at_once // 2, 1)
            else:
                self._at_once = min(2 * self._at_once, MOST_AT_ONCE)
        self.asked += len(tails)
        return np.concatenate(parts)

    def in_time(self, tails: Matrix, heads: Matrix) -> Mask:
        """Which motions are free, shapes (m, n) and (m,); none when it is time to stop."""
        with suppress(OutOfTime):
            return self(tails, heads)
        return np.zeros(len(tails), dtype=bool)
