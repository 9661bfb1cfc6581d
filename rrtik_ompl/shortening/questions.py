"""Questions about many motions at once that can be broken off."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from rrtik_ompl.arrays import Mask, Matrix

MotionsFree: TypeAlias = Callable[[Matrix, Matrix], Mask]  # as World.motion_valid_batch
Stop: TypeAlias = Callable[[], object]  # true when it is time to stop

CHUNK = 256  # motions asked about between two looks at the clock


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
        self.asked = 0
        self.stop: Stop = never

    def __call__(self, tails: Matrix, heads: Matrix) -> Mask:
        """Which motions are free, shapes (m, n) and (m,).

        Raises:
            OutOfTime: If it is time to stop.
        """
        parts = [np.zeros(0, dtype=bool)]
        for k in range(0, len(tails), CHUNK):
            if self.stop():
                raise OutOfTime
            parts.append(self._motions_free(tails[k : k + CHUNK], heads[k : k + CHUNK]))
            self.asked += len(parts[-1])
        return np.concatenate(parts)
