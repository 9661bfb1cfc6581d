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
        """Whether any sample has these statistics, as far as `possible_deviations` tell (like [54])."""
        return self.deviation <= self.largest_possible_deviation

    @property
    def largest_possible_deviation(self) -> float:
        """The least of `possible_deviations`."""
        return min(self.possible_deviations.values())

    @property
    def possible_deviations(self) -> dict[str, float]:
        """What a sample can deviate at most, by what is known of it.

        With its range alone: half of the values lie at each end. With its mean, too: all at the ends, as many at each
        as the mean asks for [81]. With its quartiles: a quarter of the values lies between each two neighbours of
        smallest, quartiles and largest, each value at the end that is farther from the mean. That holds for every
        quartile between the values of rank N / 4 and N / 4 + 1, so for all usual ones if N is a multiple of 4.
        """
        above, below = self.largest - self.mean, self.mean - self.smallest
        variances = {"range": 0.25 * (self.largest - self.smallest) ** 2, "mean": above * below}

        if self.quartiles is not None and self.count % 4 == 0:
            marks = np.array([self.smallest, *self.quartiles, self.largest])
            away = (marks - self.mean) ** 2
            variances["quartiles"] = float(np.maximum(away[1:], away[:-1]).mean())

        scale = self.count / (self.count - 1)
        return {known: float(np.sqrt(scale * variance)) for known, variance in variances.items()}

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
