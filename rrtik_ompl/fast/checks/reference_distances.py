"""The distance kernels' answers in plain numpy, ball by ball: for computers without numba."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.fast.checks.reference import CHUNK, frames, placed_balls, row_gap
from rrtik_ompl.fast.tables import layout
from rrtik_ompl.fast.tables.robot_tables import Table


def measure(arm: Table, balls: Table, rows: Table, values: Matrix) -> tuple[Vector, NDArray[np.int32]]:
    """See :func:`rrtik_ompl.fast.checks.distance_kernels.measure`; +inf where there is nothing to measure."""
    distances, pairs = np.full(len(values), np.inf), np.full(len(values), -1, dtype=np.int32)
    for start in range(0, len(values), CHUNK):
        part = slice(start, start + CHUNK)
        gaps, numbers = _all_gaps(frames(arm, values[part]), balls, rows)
        if len(numbers):
            nearest = gaps.argmin(axis=1)
            distances[part] = gaps[np.arange(len(gaps)), nearest]
            pairs[part] = np.where(np.isfinite(distances[part]), numbers[nearest], -1)
    return distances, pairs


def _all_gaps(poses: NDArray[np.float64], balls: Table, rows: Table) -> tuple[Matrix, NDArray[np.int32]]:
    """Distance of every pair of a body and a row or of two bodies, shape (m, k), and the numbers of the pairs."""
    body_count, standing = int(balls.header[layout.BODY_COUNT]), int(rows.header[layout.STANDING_COUNT])
    checked = rows[layout.CHECKED].reshape(body_count, standing)
    points, radii = placed_balls(poses, balls)
    gaps: list[Vector] = []
    numbers: list[int] = []
    for number, (_, stands, _, _) in enumerate(rows[layout.NUMBERS].reshape(-1, 4)):
        for body in np.flatnonzero(checked[:, stands]):
            if len(radii[body]):
                gaps.append((row_gap(rows, number, points[body]) - radii[body]).min(axis=1))
                numbers.append(int(body) * standing + int(stands))
    for k, (i, j) in enumerate(balls[layout.PAIRS].reshape(-1, 2)):
        apart = np.linalg.norm(points[i][:, :, None] - points[j][:, None], axis=3)
        gaps.append((apart - radii[i][:, None] - radii[j]).min(axis=(1, 2)))
        numbers.append(body_count * standing + k)
    return np.reshape(gaps, (-1, len(poses))).T, np.array(numbers, dtype=np.int32)
