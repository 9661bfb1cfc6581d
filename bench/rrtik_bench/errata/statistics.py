"""What printed statistics say of each other: tests between two printed means, and counts that a printed ratio needs."""

from __future__ import annotations

from math import ceil

from scipy.stats import ttest_ind_from_stats


def welch(first: tuple[float, float], second: tuple[float, float], count: int) -> tuple[float, float]:
    """Welch's test [82] of two means, from printed numbers alone.

    Args:
        first: Mean and standard deviation of the first sample.
        second: Of the second one.
        count: Size of each sample.

    Returns:
        Statistic t, positive where the first mean is larger, and its two-sided p.

    Example:
        >>> t, p = welch((604.40, 303.79), (232.47, 233.76), 1000)
        >>> round(t, 1), p < 1e-150
        (30.7, True)
    """
    test = ttest_ind_from_stats(*first, count, *second, count, equal_var=False)
    return float(test.statistic), float(test.pvalue)


def points_of(share: float, points: int) -> list[int]:
    """Numbers of points whose share of all points [%], rounded or cut off after one digit, is as printed.

    Example:
        >>> points_of(18.7, 251)
        [47]
    """
    return [number for number in range(points + 1) if share - 0.05 <= 100.0 * number / points < share + 0.1]


def left_out(limit: int, reached: int, per_point: int) -> tuple[int, int]:
    """Least and most generations that are not counted, if so many a point, cut off, are counted for those reached.

    Negative where even all of ``limit`` are too few.

    Example:
        >>> left_out(10_000, 47, 210)
        (84, 130)
    """
    return limit - ceil((per_point + 1) * reached) + 1, limit - per_point * reached
