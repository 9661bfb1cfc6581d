"""The budget of a computation: one value in place of seconds, iterations, a stop function and a seed."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import ceil
from typing import TypeAlias

import numpy as np

from rrtik_ompl.base.errors import InputError

Stop: TypeAlias = Callable[[], object]  # returns a true value when the computation has to end


def no_stop() -> bool:
    """Return False always: the computation never has to end."""
    return False


@dataclass(frozen=True, slots=True)
class Budget:
    """The limits of a computation, and the seed of its random numbers.

    The time runs from the creation of the budget; :meth:`begun_now` restarts it.

    Attributes:
        seed: Seed of all random numbers.
        seconds: Limit of wall time [s]; +inf for none.
        iterations: Limit of the steps that the computation counts, so that the clock does not decide; None for none.
        stop: Called often; a true value ends the computation.
        begun: When the time began [s, as ``time.monotonic``].

    Example:
        >>> budget = Budget(seed=1, seconds=60.0)
        >>> budget.over(), budget.part(0.5).seconds < 30.1
        (False, True)
    """

    seed: int = 0
    seconds: float = np.inf
    iterations: int | None = None
    stop: Stop = no_stop
    # The lambda looks the clock up when it is called, so that tests can replace it.
    begun: float = field(default_factory=lambda: time.monotonic())

    @property
    def elapsed(self) -> float:
        """Time since the computation began [s]."""
        return time.monotonic() - self.begun

    @property
    def left(self) -> float:
        """Remaining time [s], independent of ``stop``; negative when it is over."""
        return self.begun + self.seconds - time.monotonic()

    @property
    def limited(self) -> bool:
        """Whether time or iterations are limited, independent of ``stop``."""
        return self.iterations is not None or bool(np.isfinite(self.seconds))

    def over(self) -> bool:
        """Check whether the computation has to end because of time or ``stop``. The bound method is a :data:`Stop`."""
        return time.monotonic() - self.begun >= self.seconds or bool(self.stop())

    def begun_now(self) -> Budget:
        """Return the same budget with its time starting now."""
        return replace(self, begun=time.monotonic())

    def part(self, share: float) -> Budget:
        """Return a budget with a share of the remaining time, starting now."""
        return replace(self, seconds=max(share * self.left, 0.0), begun=time.monotonic())

    def put_off(self, seconds: float) -> Budget:
        """Return the budget with its start shifted by some seconds, which then do not count."""
        return replace(self, begun=self.begun + seconds)


def iteration_limit(limit: int | None) -> int | None:
    """Validate the largest number of iterations of a planner and return it rounded up; None for no limit.

    Raises:
        InputError: If the limit is not a number of at least 1.
    """
    if limit is None or limit == np.inf:
        return None
    if isinstance(limit, bool) or not isinstance(limit, int | float) or not limit >= 1:
        raise InputError(f"max_iterations: expected at least 1, got {limit!r}")
    return ceil(limit)
