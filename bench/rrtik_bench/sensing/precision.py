"""Statistics of repeated measurements, as the precision and accuracy tests of [1, ch. 4] print them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import finite_array
from rrtik_ompl.base.errors import InputError

NORMAL_QUARTILES = 1.349  # standard deviations between them


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """Summary of a series of measurements of one quantity, in its own unit.

    Attributes:
        count: Number of measurements.
        largest: The largest of them.
        smallest: The smallest.
        mean: Their mean.
        deviation: Sample standard deviation.
        quartiles: First quartile, median, third quartile.
    """

    count: int
    largest: float
    smallest: float
    mean: float
    deviation: float
    quartiles: tuple[float, float, float] | None = None

    @property
    def mean_deviation(self) -> float:
        """Standard deviation of the mean: s / sqrt(N)."""
        return self.deviation / float(np.sqrt(self.count))

    @property
    def largest_deviation(self) -> float:
        """Of a single measurement from the mean."""
        return max(self.largest - self.mean, self.mean - self.smallest)

    @property
    def robust_deviation(self) -> float:
        """Standard deviation of the normal distribution that has these quartiles."""
        if self.quartiles is None:
            raise InputError("this series has no quartiles; use deviation")
        return (self.quartiles[2] - self.quartiles[0]) / NORMAL_QUARTILES

    @property
    def possible(self) -> bool:
        """No sample in [smallest, largest] deviates by more than half the range times sqrt(N / (N - 1)) (like [54])."""
        return self.deviation <= self.largest_possible_deviation

    @property
    def largest_possible_deviation(self) -> float:
        """What a sample of this range and size can deviate at most."""
        return 0.5 * (self.largest - self.smallest) * float(np.sqrt(self.count / (self.count - 1)))

    def error_percent(self, truth: float) -> float:
        """Of the mean, in percent of the true value: ``(mean - truth) / truth * 100``."""
        return 100.0 * (self.mean - truth) / truth


def series_of(values: ArrayLike) -> Series:
    """Summary of at least two measurements. Shape (m,).

    Raises:
        InputError: If there are fewer than two, or one is not finite.
    """
    rows = finite_array(values, (None,), "measurements")
    if len(rows) < 2:
        raise InputError(f"a series needs at least two measurements, got {len(rows)}")

    low, middle, high = np.quantile(rows, [0.25, 0.5, 0.75]).tolist()
    mean = float(rows.mean())
    deviation = float(rows.std(ddof=1))
    return Series(len(rows), float(rows.max()), float(rows.min()), mean, deviation, (low, middle, high))
