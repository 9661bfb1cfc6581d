"""The rules of C-RDT trees, for those that grow in kernels and those in Python."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Vector

KERNELS = "search.crdt.kernels"  # the library of these searches


@dataclass(frozen=True, slots=True, eq=False)
class CrdtRules:
    """How trees grow.

    Attributes:
        lower, upper: Samples are drawn between them, shapes (n,); a coordinate for which they are equal never moves.
        scale: Weight of each coordinate in the metric of the nearest neighbour, shape (n,).
        smallest_move: No edge is shorter, shape (n,) [rad or m].
        chance: How probably a coordinate takes part in the extension to a sample, shape (n,); otherwise it stays.
    """

    lower: Vector
    upper: Vector
    scale: Vector
    smallest_move: Vector
    chance: Vector

    @property
    def axes(self) -> NDArray[np.int32]:
        """The coordinates that may move."""
        return np.flatnonzero(self.lower < self.upper).astype(np.int32)
