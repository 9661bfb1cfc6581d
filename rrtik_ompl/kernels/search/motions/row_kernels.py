"""Configurations in memory: where they are, how they are copied, how far they are from each other."""

from __future__ import annotations

from typing import Any

import numpy as np

from rrtik_ompl.kernels.search.motions.motion_layout import Configuration
from rrtik_ompl.kernels.simd.compiled import inlined, kernel
from rrtik_ompl.kernels.simd.records import row_at

__all__ = ["Configuration", "copy_row", "distance", "row_at"]


@inlined
def copy_row(length: int, source: Any, sink: Any) -> None:
    """Copy ``length`` numbers from one address to another."""
    for k in range(length):
        sink[k] = source[k]


@kernel
def distance(dof: int, one: Configuration, two: Configuration) -> float:
    """Euclidean distance of two configurations."""
    total = 0.0
    for k in range(dof):
        gap = two[k] - one[k]
        total += gap * gap
    return np.sqrt(total)  # type: ignore[no-any-return]
