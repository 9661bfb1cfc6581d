"""Random numbers from a seed, begun when the first one is asked for: to begin takes as long as some whole answers."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from rrtik_ompl.errors import InputError


def checked_seed(seed: int) -> int:
    """A seed given by a user.

    Raises:
        InputError: If it is no whole number of at least 0.
    """
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        raise InputError(f"seed must be a whole number of at least 0, got {seed!r}")
    return int(seed)


class RandomStream:
    """The same seed gives the same numbers.

    Args:
        seed: A whole number of at least 0.

    Raises:
        InputError: If it is none.
    """

    def __init__(self, seed: int) -> None:
        self._seed = checked_seed(seed)

    @cached_property
    def rng(self) -> np.random.Generator:
        """Where the numbers come from."""
        return np.random.default_rng(self._seed)
