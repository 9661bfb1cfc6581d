"""Random numbers from a seed, begun when the first one is drawn: to begin takes as long as some whole solutions."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from rrtik_ompl.base.arrays import whole_number


class RandomStream:
    """The same seed gives the same numbers.

    Args:
        seed: A whole number of at least 0.

    Raises:
        InputError: If it is none.
    """

    def __init__(self, seed: int) -> None:
        self._seed = whole_number(seed, "seed")

    @cached_property
    def rng(self) -> np.random.Generator:
        """Where the numbers come from."""
        return np.random.default_rng(self._seed)
