"""Cubics between knots: what follows from times, positions, velocities and accelerations; pieces in even parts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Matrix, Vector


def jerks_of(
    times: Vector, velocities: Matrix, accelerations: Matrix, pieces: NDArray[np.int64] | None = None
) -> Matrix:
    """The jerk with which each piece, or some of them, comes to the velocity of the next knot, shape (m - 1, n)."""
    first, last = (slice(None, -1), slice(1, None)) if pieces is None else (pieces, pieces + 1)
    h = (times[last] - times[first])[:, None]
    jerks: Matrix = 2.0 * (velocities[last] - velocities[first] - h * accelerations[first]) / h**2
    return jerks


def ends_of(times: Vector, positions: Matrix, velocities: Matrix, accelerations: Matrix) -> Matrix:
    """Where the cubic of each piece ends, shape (m - 1, n)."""
    h = (times[1:] - times[:-1])[:, None]
    v, a, j = velocities[:-1], accelerations[:-1], jerks_of(times, velocities, accelerations)
    ends: Matrix = positions[:-1] + h * (v + h * (a / 2.0 + h * j / 6.0))
    return ends


def hermite_accelerations(times: Vector, positions: Matrix, velocities: Matrix) -> Matrix:
    """Accelerations at the beginning of the cubics through positions and velocities, and at the end of the last one."""
    h = np.diff(times)[:, None]
    mean, first, last = np.diff(positions, axis=0) / h, velocities[:-1], velocities[1:]
    begin, end = (6.0 * mean - 4.0 * first - 2.0 * last) / h, (2.0 * first + 4.0 * last - 6.0 * mean) / h
    return np.vstack([begin, end[-1:]])


def even_parts(counts: NDArray[np.int64]) -> tuple[NDArray[np.int64], Vector]:
    """Pieces cut into so many parts each: of each part its piece, and the share of that where it begins, shape (k,)."""
    pieces = np.repeat(np.arange(len(counts)), counts)
    first = np.cumsum(counts) - counts
    return pieces, (np.arange(len(pieces)) - first[pieces]) / counts[pieces]
