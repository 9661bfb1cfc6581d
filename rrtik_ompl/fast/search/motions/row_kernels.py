"""Configurations in memory: where they are, how they are copied, how far they are from each other."""

from __future__ import annotations

from typing import Any, NewType

import numpy as np

from rrtik_ompl.fast.simd.compiled import inlined, kernel
from rrtik_ompl.fast.simd.lanes import double_at, set_double

Configuration = NewType("Configuration", int)  # address of a configuration, float64
JointValues = NewType("JointValues", int)  # address of the joint values of a configuration, float64
NUMBER_BYTES = 8  # of a float64


@inlined
def row_at(rows: int, length: int, number: int) -> Any:
    """Address of one of several rows of ``length`` numbers that follow each other in memory."""
    return rows + NUMBER_BYTES * length * number


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
