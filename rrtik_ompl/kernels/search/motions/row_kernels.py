"""Configurations in memory: where they are, how they are copied, how far they are from each other."""

from __future__ import annotations

from collections.abc import Callable
from typing import NewType

import numpy as np

from rrtik_ompl.kernels.simd.access import double_row
from rrtik_ompl.kernels.simd.compiled import inlined, kernel
from rrtik_ompl.kernels.simd.lanes import double_at, set_double

Configuration = NewType("Configuration", int)  # rows of float64, one number for each coordinate

row_at: Callable[[Configuration, int, int], Configuration] = double_row  # array, numbers in a row, number of the row


@inlined
def copy_row(length: int, source: int, sink: int) -> None:
    """Copy ``length`` numbers from one address to another."""
    for k in range(length):
        set_double(sink, k, double_at(source, k))


@kernel
def distance(dof: int, one: Configuration, two: Configuration) -> float:
    """Euclidean distance of two configurations."""
    total = 0.0
    for k in range(dof):
        gap = double_at(two, k) - double_at(one, k)
        total += gap * gap
    return np.sqrt(total)  # type: ignore[no-any-return]
