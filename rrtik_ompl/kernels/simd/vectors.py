"""Vectors of three numbers in kernels, each of them lanes."""

from __future__ import annotations

from typing import Any

from rrtik_ompl.kernels.simd.compiled import inlined


@inlined
def squared(x: Any, y: Any, z: Any) -> Any:
    """Squared length."""
    return x * x + y * y + z * z


@inlined
def along(vector: Any, x: Any, y: Any, z: Any) -> Any:
    """Dot product of lanes of points with three numbers."""
    return x * vector[0] + y * vector[1] + z * vector[2]
