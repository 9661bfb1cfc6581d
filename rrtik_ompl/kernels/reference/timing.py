"""The kernels for timing again, slow and obvious, in numpy: for tests, and where there is no compiler."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.kernels.timing.layout import FLAT, ROUNDS


def sample_curve(vertices: Matrix, along: Vector, directions: Matrix, radii: Vector, at: Vector) -> Matrix:
    """Position and its first and second derivative, shape (m, 3 n); see :mod:`rrtik_ompl.kernels.timing.layout`."""
    edge = np.clip(np.searchsorted(along, at, side="right") - 1, 0, len(along) - 2)
    q = vertices[edge] + (at - along[edge])[:, None] * directions[edge]
    slope = directions[edge].copy()
    bend = np.zeros_like(q)
    for corner in range(1, len(along) - 1):
        gap = at - along[corner]
        turn = directions[corner] - directions[corner - 1]
        near = np.abs(gap) < radii[corner]
        inside = (radii[corner] - np.abs(gap[near]))[:, None]
        sign = np.where(gap[near] >= 0.0, -1.0, 1.0)[:, None]
        q[near] += inside**3 / (6.0 * radii[corner] ** 2) * turn
        slope[near] += sign * inside**2 / (2.0 * radii[corner] ** 2) * turn
        bend[near] += inside / radii[corner] ** 2 * turn
    return np.hstack([q, slope, bend])


class Rows(NamedTuple):
    """Row r at point i says low <= first u + second x <= high, shape (m, r) each."""

    first: Matrix
    second: Matrix
    low: Matrix
    high: Matrix


def all_rows(shape: Matrix, velocity: Vector, acceleration: Vector, rows: Rows, cap: Vector) -> tuple[Rows, Vector]:
    """The rows with those of the acceleration limits, and the cap lowered by the velocity limits."""
    n = len(velocity)
    slopes = shape[:, n : 2 * n]
    bends = shape[:, 2 * n :]
    most = np.broadcast_to(acceleration, slopes.shape)
    with np.errstate(divide="ignore"):
        by_speed = ((velocity / np.abs(slopes)) ** 2).min(axis=1)
        still = np.where(np.abs(slopes) < FLAT, acceleration / np.abs(bends), np.inf).min(axis=1)
    columns = zip((slopes, bends, -most, most), rows, strict=True)
    return Rows(*(np.hstack(pair) for pair in columns)), np.minimum(cap, np.minimum(by_speed, still))


def find_squares(rows: Rows, cap: Vector, grid: Vector) -> Vector:
    """Path speed squared at the points of the grid; see :mod:`rrtik_ompl.kernels.timing.layout`."""
    first, second, low, high = rows
    steps = 2.0 * np.diff(grid)

    def lines(i: int) -> tuple[Matrix, Matrix]:
        """Lower and upper bounds of u, each a value and a slope over x, shape (k, 2)."""
        a = np.concatenate([first[i], first[i + 1] + steps[i] * second[i + 1]])
        b = np.concatenate([second[i], second[i + 1]])
        ends = np.stack([np.concatenate([row[i], row[i + 1]]) for row in (low, high)])
        used = np.abs(a) >= FLAT
        a, b, ends = a[used], b[used], np.sort(ends[:, used] / a[used], axis=0)
        slope = -b / a
        below = np.vstack([np.stack([ends[0], slope], axis=1), [[0.0, -1.0 / steps[i]]]])
        above = np.vstack([np.stack([ends[1], slope], axis=1), [[reached[i + 1] / steps[i], -1.0 / steps[i]]]])
        return below, above

    reached = np.zeros(len(grid))
    for i in range(len(grid) - 2, -1, -1):
        below, above = lines(i)
        x = cap[i]
        for _ in range(ROUNDS):
            lower = below[(below @ [1.0, x]).argmax()]
            upper = above[(above @ [1.0, x]).argmin()]
            if upper @ [1.0, x] >= lower @ [1.0, x]:
                break
            fall = lower[1] - upper[1]
            nearer = (upper[0] - lower[0]) / fall if fall > 0.0 else 0.0
            x = max(nearer if nearer < x else x * (1.0 - 1e-9), 0.0)
        reached[i] = x
    squares = np.zeros(len(grid))
    for i in range(len(grid) - 1):
        u = (lines(i)[1] @ [1.0, squares[i]]).min()
        squares[i + 1] = min(max(squares[i] + steps[i] * u, 0.0), reached[i + 1])
    return squares
