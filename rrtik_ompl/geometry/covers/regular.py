"""Covers by formula: capsules and cylinders as rows of balls, boxes as grids of balls."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.geometry.collision.shape_table import Core
from rrtik_ompl.geometry.covers.solids import ROUNDING

ROD_PROTRUSION = 0.06  # share of the radius


def balls_on_axis(radius: float, half_length: float, protrusion: float) -> int:
    """Number of balls along an axis of length ``2 half`` that hold the rod around it of the given radius."""
    if half_length <= 0.0:
        return 1
    step = 2.0 * np.sqrt(max(protrusion * (protrusion + 2.0 * radius), 0.0))
    return int(min(np.ceil(2.0 * half_length / step), 1e6)) + 1 if step > 0.0 else 10**6


def rod_cover(radius: float, half_length: float, limit: int, protrusion: float | None) -> Matrix:
    """Equal balls in a row along z that hold a capsule, at most ``limit`` (but 2), shape (n, 4)."""
    count = balls_on_axis(radius, half_length, ROD_PROTRUSION * radius if protrusion is None else protrusion)
    count = max(min(count, max(limit, 2)), 1 if half_length <= 0.0 else 2)
    step = 2.0 * half_length / max(count - 1, 1)
    return row_on_z(spread(half_length, count), np.hypot(radius, 0.5 * step) * (1.0 + ROUNDING))


def spread(half: float, count: int) -> Vector:
    """Numbers evenly from -half to half, shape (number,)."""
    return np.linspace(-half, half, count) if count > 1 else np.zeros(max(count, 0))


def row_on_z(heights: Vector, radius: float) -> Matrix:
    """Equal balls on the z axis, shape (n, 4)."""
    spheres = np.zeros((len(heights), 4))
    spheres[:, 2] = heights
    spheres[:, 3] = radius
    return spheres


def regular_cover(core: Core, limit: int, protrusion: float | None) -> Matrix | None:
    """Boxes as grids of balls, cylinders as rows of balls: the best one of at most ``limit`` balls."""
    half = core.half_sides
    radius = core.disc
    if half is not None:
        counts_xy = ((a, b) for a in range(1, limit + 1) for b in range(1, limit // a + 1))
        grids = np.array([(a, b, c) for a, b in counts_xy for c in range(1, limit // (a * b) + 1)])
        cells = half / grids
        protrusions = np.linalg.norm(cells, axis=1) - cells.min(axis=1)
        return _grid(half, _chosen(grids, protrusions, protrusion))

    if radius is not None:
        grids = np.array([(1, 1, k) for k in range(1, limit + 1)])
        step = core.half_length / grids[:, 2]
        protrusions = np.hypot(radius, step) - np.minimum(step, radius)
        return _row(radius, core.half_length, int(_chosen(grids, protrusions, protrusion)[2]))

    return None


def _chosen(grids: NDArray[np.int64], protrusions: Vector, protrusion: float | None) -> NDArray[np.int64]:
    small_enough = np.flatnonzero(protrusions <= protrusion) if protrusion is not None else np.empty(0, dtype=np.int64)
    if len(small_enough):
        return np.asarray(grids[small_enough[grids[small_enough].prod(axis=1).argmin()]])
    return np.asarray(grids[protrusions.argmin()])


def _row(radius: float, half_length: float, count: int) -> Matrix:
    step = half_length / count
    return row_on_z(spread(half_length - step, count), np.hypot(radius, step) * (1.0 + ROUNDING))


def _grid(half_sides: Vector, grid: NDArray[np.int64]) -> Matrix:
    cell = half_sides / grid
    axes = [spread(float(h - c), int(n)) for h, c, n in zip(half_sides, cell, grid, strict=True)]
    centres = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return np.column_stack([centres, np.full(len(centres), np.linalg.norm(cell) * (1.0 + ROUNDING))])
