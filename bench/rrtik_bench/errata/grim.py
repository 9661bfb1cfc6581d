"""The GRIM test [54]: a mean of whole numbers over n cases is a fraction of n, so that many means are impossible."""

from __future__ import annotations

import numpy as np


def off(mean: float, digits: int, count: int) -> float:
    """How far a printed mean is from the nearest fraction of ``count``, in halves of the unit of its last digit.

    Up to 1 the mean is possible, as rounding goes.

    Example:
        >>> round(off(5.19, 2, 28), 1)  # the nearest one, 145/28, is 5.18
        2.3
    """
    half = 0.5 * 10.0**-digits
    return float(abs(round(mean * count) / count - mean) / half)


def consistent(mean: float, digits: int, most: int) -> list[int]:
    """Numbers of cases, up to ``most``, over which a printed mean is possible."""
    return [count for count in np.arange(1, most + 1).tolist() if off(mean, digits, count) <= 1.0 + 1e-9]
