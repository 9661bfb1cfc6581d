"""The random stream of axis trees in Python: number for number that of the kernels, so that both find the same path."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from rrtik_ompl.base.arrays import Vector

WORD = 2**64 - 1
# Source: splitmix64 [46].
GOLDEN, FIRST_FACTOR, SECOND_FACTOR = 0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB


class Random(Protocol):
    """What a tree needs of a random generator; numpy's will do too."""

    def random(self) -> float:
        """A number from 0 to 1, less than 1."""

    def permutation(self, axes: Sequence[int]) -> Sequence[int]:
        """The axes in random order."""


class CrdtStream:
    """Random configurations and orders of axes.

    Args:
        seed: 0 to 2^64 - 1.
    """

    def __init__(self, seed: int) -> None:
        self._state = seed

    def random(self) -> float:
        """A number from 0 to 1, less than 1."""
        self._state = (self._state + GOLDEN) & WORD
        z = ((self._state ^ (self._state >> 30)) * FIRST_FACTOR) & WORD
        z = ((z ^ (z >> 27)) * SECOND_FACTOR) & WORD
        return ((z ^ (z >> 31)) >> 11) * 2.0**-53

    def uniform(self, lower: Vector, upper: Vector) -> Vector:
        """A configuration between the bounds, shapes (n,)."""
        shares = np.array([self.random() for _ in range(len(lower))])
        q: Vector = np.minimum(lower + shares * (upper - lower), upper)
        return q

    def permutation(self, axes: Sequence[int]) -> list[int]:
        """The axes in random order (Fisher and Yates)."""
        order = [int(axis) for axis in axes]
        for k in range(len(order) - 1, 0, -1):
            other = int(self.random() * (k + 1))
            order[k], order[other] = order[other], order[k]
        return order
