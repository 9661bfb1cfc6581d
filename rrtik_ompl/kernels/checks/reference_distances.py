"""The reference implementation of the distances: the kernels' answers in plain numpy, ball by ball."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.kernels import layout
from rrtik_ompl.kernels.checks.reference import CHUNK, frames, heads, placed_balls, primitive_gap


def measure(
    arm: layout.ArmTable, balls: layout.BallTable, primitives: layout.PrimitiveTable, values: Matrix
) -> tuple[Vector, NDArray[np.int32]]:
    """See :func:`rrtik_ompl.kernels.checks.distance_kernels.measure`; +inf where there is nothing to measure."""
    distances = np.full(len(values), np.inf)
    pairs = np.full(len(values), -1, dtype=np.int32)
    for start in range(0, len(values), CHUNK):
        part = slice(start, start + CHUNK)
        gaps, numbers = _all_gaps(frames(arm, values[part]), balls, primitives)
        if len(numbers):
            nearest = gaps.argmin(axis=1)
            distances[part] = gaps[np.arange(len(gaps)), nearest]
            pairs[part] = np.where(np.isfinite(distances[part]), numbers[nearest], -1)

    return distances, pairs


def _all_gaps(
    poses: NDArray[np.float64], balls: layout.BallTable, primitives: layout.PrimitiveTable
) -> tuple[Matrix, NDArray[np.int32]]:
    """Distance of every pair of a body and a row or of two bodies, shape (m, k), and the numbers of the pairs."""
    body_count = balls.body_count
    standing = primitives.standing_count
    checked = primitives.checked.reshape(body_count, standing)
    points, radii = placed_balls(poses, balls)
    gaps: list[Vector] = []
    numbers: list[int] = []

    for number, stands in enumerate(heads(primitives)[:, layout.STANDING_BODY]):
        for body in np.flatnonzero(checked[:, stands]):
            if len(radii[body]):
                gaps.append((primitive_gap(primitives, number, points[body]) - radii[body]).min(axis=1))
                numbers.append(int(body) * standing + int(stands))

    pairs = balls.pairs.reshape(-1, layout.PAIR_INTS)
    for k, (i, j) in enumerate(zip(pairs[:, layout.PAIR_ONE], pairs[:, layout.PAIR_OTHER], strict=True)):
        apart = np.linalg.norm(points[i][:, :, None] - points[j][:, None], axis=3)
        reaches = radii[i][:, None] + radii[j] + balls.self_margin[0]
        gaps.append((apart - reaches).min(axis=(1, 2)))
        numbers.append(body_count * standing + k)

    return np.reshape(gaps, (-1, len(poses))).T, np.array(numbers, dtype=np.int32)
