"""The rules of C-RDT trees, for those that grow in kernels and those in Python."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.fast.simd.library import library

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


def runs_in_kernels(world: Any, *rows: Matrix) -> bool:
    """Whether a world has kernels that are certain about all configurations between ``rows``, shapes (m, n)."""
    fast = getattr(world, "fast", None)
    if fast is None:
        return False
    chain = world.robot.chain
    largest = np.abs(np.vstack(rows)).max(axis=0)
    within = bool((np.abs(chain.gain) @ largest + np.abs(chain.offset) <= fast.limits).all())
    return within and library(KERNELS) is not None
