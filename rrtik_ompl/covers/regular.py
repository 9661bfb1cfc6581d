"""Covers by formula: capsules and cylinders as rows of balls, boxes as grids of balls."""

from __future__ import annotations

import coal
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.covers.solids import ROUNDING

CAPSULE_PROTRUSION = 0.06  # share of the radius


def balls_on_axis(radius: float, half: float, protrusion: float) -> int:
    """Number of balls along an axis of length ``2 half`` that hold the rod around it of the given radius."""
    if half <= 0.0:
        return 1
    step = 2.0 * np.sqrt(max(protrusion * (protrusion + 2.0 * radius), 0.0))
    return int(min(np.ceil(2.0 * half / step), 1e6)) + 1 if step > 0.0 else 10**6


def capsule_cover(radius: float, half: float, limit: int, protrusion: float | None) -> Matrix:
    """Equal balls in a row along z that hold a capsule, at most ``limit`` (but 2), shape (n, 4)."""
    number = balls_on_axis(radius, half, CAPSULE_PROTRUSION * radius if protrusion is None else protrusion)
    number = max(min(number, max(limit, 2)), 1 if half <= 0.0 else 2)
    step = 2.0 * half / max(number - 1, 1)
    return row_on_z(spread(half, number), np.hypot(radius, 0.5 * step) * (1.0 + ROUNDING))


def spread(half: float, number: int) -> Vector:
    """Numbers evenly from -half to half, shape (number,)."""
    return np.linspace(-half, half, number) if number > 1 else np.zeros(max(number, 0))


def row_on_z(heights: Vector, radius: float) -> Matrix:
    """Equal balls on the z axis, shape (n, 4)."""
    spheres = np.zeros((len(heights), 4))
    spheres[:, 2], spheres[:, 3] = heights, radius
    return spheres


def regular_cover(geometry: coal.CollisionGeometry, limit: int, protrusion: float | None) -> Matrix | None:
    """Boxes as grids of balls, cylinders as rows of balls: the best one of at most ``limit`` balls."""
    if isinstance(geometry, coal.Box):
        half = np.array(geometry.halfSide)
        pairs = ((a, b) for a in range(1, limit + 1) for b in range(1, limit // a + 1))
        grids = np.array([(a, b, c) for a, b in pairs for c in range(1, limit // (a * b) + 1)])
        cells = half / grids
        sticks = np.linalg.norm(cells, axis=1) - cells.min(axis=1)
    elif isinstance(geometry, coal.Cylinder):
        grids = np.array([(1, 1, k) for k in range(1, limit + 1)])
        step = geometry.halfLength / grids[:, 2]
        radius = np.hypot(geometry.radius, step)
        sticks = radius - np.minimum(step, geometry.radius)
    else:
        return None
    return _regular(geometry, _chosen(grids, sticks, protrusion))


def _chosen(grids: NDArray[np.int64], sticks: Vector, protrusion: float | None) -> NDArray[np.int64]:
    enough = np.flatnonzero(sticks <= protrusion) if protrusion is not None else np.empty(0, dtype=np.int64)
    if len(enough):
        return np.asarray(grids[enough[grids[enough].prod(axis=1).argmin()]])
    return np.asarray(grids[sticks.argmin()])


def _regular(geometry: coal.CollisionGeometry, grid: NDArray[np.int64]) -> Matrix:
    if isinstance(geometry, coal.Cylinder):
        step = geometry.halfLength / grid[2]
        heights = spread(geometry.halfLength - step, int(grid[2]))
        return row_on_z(heights, np.hypot(geometry.radius, step) * (1.0 + ROUNDING))
    cell = np.array(geometry.halfSide) / grid
    axes = [spread(float(h - c), int(n)) for h, c, n in zip(geometry.halfSide, cell, grid, strict=True)]
    centres = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return np.column_stack([centres, np.full(len(centres), np.linalg.norm(cell) * (1.0 + ROUNDING))])
