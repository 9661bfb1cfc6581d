"""The distance kernels' answers in plain numpy, ball by ball: for computers without numba."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.fast.checks.reference import CHUNK, frames, placed_balls
from rrtik_ompl.fast.tables import layout
from rrtik_ompl.fast.tables.robot_tables import Table


def measure(arm: Table, balls: Table, primitives: Table, values: Matrix) -> tuple[Vector, NDArray[np.int32]]:
    """See :func:`rrtik_ompl.fast.checks.distance_kernels.measure`; +inf where there is nothing to measure."""
    distances, pairs = np.full(len(values), np.inf), np.full(len(values), -1, dtype=np.int32)
    for start in range(0, len(values), CHUNK):
        part = slice(start, start + CHUNK)
        gaps, numbers = _all_gaps(frames(arm, values[part]), balls, primitives)
        if len(numbers):
            nearest = gaps.argmin(axis=1)
            distances[part] = gaps[np.arange(len(gaps)), nearest]
            pairs[part] = np.where(np.isfinite(distances[part]), numbers[nearest], -1)
    return distances, pairs


def _all_gaps(poses: NDArray[np.float64], balls: Table, primitives: Table) -> tuple[Matrix, NDArray[np.int32]]:
    """Distance of every pair of a body and a row or of two bodies, shape (m, k), and the numbers of the pairs."""
    body_count, standing = int(balls.header[layout.BODY_COUNT]), int(primitives.header[layout.STANDING_COUNT])
    checked = primitives[layout.CHECKED].reshape(body_count, standing)
    points, radii = placed_balls(poses, balls)
    gaps: list[Vector] = []
    numbers: list[int] = []
    for number, (_, stands, _, _) in enumerate(primitives[layout.NUMBERS].reshape(-1, 4)):
        for body in np.flatnonzero(checked[:, stands]):
            if len(radii[body]):
                gaps.append((primitive_gap(primitives, number, points[body]) - radii[body]).min(axis=1))
                numbers.append(int(body) * standing + int(stands))
    for k, (i, j) in enumerate(balls[layout.PAIRS].reshape(-1, 2)):
        apart = np.linalg.norm(points[i][:, :, None] - points[j][:, None], axis=3)
        gaps.append((apart - radii[i][:, None] - radii[j]).min(axis=(1, 2)))
        numbers.append(body_count * standing + k)
    return np.reshape(gaps, (-1, len(poses))).T, np.array(numbers, dtype=np.int32)


def primitive_gap(primitives: Table, number: int, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Signed distance of points, shape (..., 3), from a row, negative inside. Shape (...)."""
    row = primitives[layout.PRIMITIVES].reshape(-1, layout.PRIMITIVE_FLOATS)[number].astype(np.float64)
    kind, _, start, end = primitives[layout.NUMBERS].reshape(-1, 4)[number]
    if kind == layout.HALF_SPACE:
        return np.asarray(points @ row[:3] - row[3])
    if kind == layout.CONVEX:
        planes = primitives[layout.PLANES].astype(np.float64).reshape(-1, 4)[start:end]
        height = (points @ planes[:, :3].T - planes[:, 3]).max(axis=-1)
        return np.asarray(height if row[0] else np.where(height < 0.0, height, np.inf))
    away = points - row[:3]
    if kind == layout.BALL:
        return np.asarray(np.linalg.norm(away, axis=-1) - row[3])
    if kind == layout.BOX:
        return _outside(np.abs(away @ row[3:12].reshape(3, 3).T) - row[12:15])
    along = away @ row[3:6]
    if kind == layout.CAPSULE:
        foot = np.clip(along * row[6], 0.0, 1.0)[..., None] * row[3:6]
        return np.asarray(np.linalg.norm(away - foot, axis=-1) - row[7])
    across = np.linalg.norm(away - along[..., None] * row[3:6], axis=-1)
    return _outside(np.stack([np.abs(along) - row[6], across - row[7]], axis=-1))


def _outside(beyond: NDArray[np.float64]) -> NDArray[np.float64]:
    """Signed distance from a set that is given by how far a point lies beyond each of its orthogonal faces."""
    inside = np.minimum(beyond.max(axis=-1), 0.0)
    return np.asarray(np.linalg.norm(np.maximum(beyond, 0.0), axis=-1) + inside)
