"""What a work may cost: one value that goes through in place of seconds, iterations, a stop and a seed."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import ceil
from typing import TypeAlias

import numpy as np

from rrtik_ompl.base.errors import InputError

Stop: TypeAlias = Callable[[], object]  # true when it is time to stop


def no_stop() -> bool:
    """It is never time to stop."""
    return False


@dataclass(frozen=True, slots=True)
class Budget:
    """What a work may cost, and the seed of all that is random in it.

    Its time runs from the moment it is made; :meth:`begun_now` sets the clock back.

    Attributes:
        seed: Of everything random.
        seconds: Limit of wall time [s]; +inf for none.
        iterations: Limit of whatever the work counts, so that the clock does not decide; None for none.
        stop: Called often; true ends the work.
        begun: When the time began [s, of ``time.monotonic``].

    Example:
        >>> budget = Budget(seed=1, seconds=60.0)
        >>> budget.over(), budget.part(0.5).seconds < 30.1
        (False, True)
    """

    seed: int = 0
    seconds: float = np.inf
    iterations: int | None = None
    stop: Stop = no_stop
    begun: float = field(default_factory=lambda: time.monotonic())  # looked up then: another clock may be in its place

    @property
    def elapsed(self) -> float:
        """Time since the work began [s]."""
        return time.monotonic() - self.begun

    @property
    def left(self) -> float:
        """Time that is left [s], whatever ``stop`` says; negative when it is over."""
        return self.begun + self.seconds - time.monotonic()

    @property
    def limited(self) -> bool:
        """Whether time or iterations end at some point, whatever ``stop`` says."""
        return self.iterations is not None or bool(np.isfinite(self.seconds))

    def over(self) -> bool:
        """Check whether it is time to stop: a :data:`Stop` for searches that are given nothing else."""
        return time.monotonic() - self.begun >= self.seconds or bool(self.stop())

    def begun_now(self) -> Budget:
        """Return the same budget, whose time begins now."""
        return replace(self, begun=time.monotonic())

    def part(self, share: float) -> Budget:
        """Return a share of the time that is left, from now on."""
        return replace(self, seconds=max(share * self.left, 0.0), begun=time.monotonic())

    def put_off(self, seconds: float) -> Budget:
        """Return the budget after some seconds that do not count."""
        return replace(self, begun=self.begun + seconds)


def iteration_limit(limit: int | None) -> int | None:
    """Return the largest number of iterations that a planner may do, a whole number; None for no limit.

    Raises:
        InputError: If the limit is no number of at least 1.
    """
    if limit is None or limit == np.inf:
        return None
    if isinstance(limit, bool) or not isinstance(limit, int | float) or not limit >= 1:
        raise InputError(f"max_iterations: expected at least 1, got {limit!r}")
    return ceil(limit)
