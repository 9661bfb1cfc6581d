"""The kernels' answers in plain numpy, ball by ball: for computers without numba, and some thousand times slower."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Mask, Matrix
from rrtik_ompl.fast.tables import layout
from rrtik_ompl.fast.tables.robot_tables import Table

CHUNK = 64  # configurations at a time, to bound memory


def frames(arm: Table, values: Matrix) -> NDArray[np.float64]:
    """Joint frames as rotation and origin, world first, shape (m, joints + 1, 3, 4)."""
    fixed = arm[layout.PLACEMENTS].astype(np.float64).reshape(-1, 12)
    found = np.zeros((len(values), len(fixed) + 1, 3, 4))
    found[:, 0, :, :3] = np.eye(3)
    for joint, (parent, sliding) in enumerate(zip(arm[layout.PARENTS], arm[layout.SLIDING], strict=True)):
        above = found[:, parent]
        rotation = above[:, :, :3] @ fixed[joint, :9].reshape(3, 3)
        origin = above[:, :, 3] + above[:, :, :3] @ fixed[joint, 9:]
        value = values[:, joint, None]
        x, y, z = rotation[:, :, 0], rotation[:, :, 1], rotation[:, :, 2]
        sine, cosine = np.sin(value), np.cos(value)
        turned = (x, y) if sliding else (x * cosine + y * sine, y * cosine - x * sine)
        found[:, joint + 1] = np.stack([*turned, z, origin + (z * value if sliding else 0.0)], axis=2)
    return found


def meets_row(rows: Table, number: int, points: NDArray[np.float64], radii: NDArray[np.float64]) -> Mask:
    """Which balls, centres of shape (..., 3), meet a row. Shape (...)."""
    row = rows[layout.ROWS].reshape(-1, layout.ROW_FLOATS)[number].astype(np.float64)
    kind, _, start, end = rows[layout.NUMBERS].reshape(-1, 4)[number]
    if kind == layout.HALF_SPACE:
        return np.asarray(points @ row[:3] - row[3] < radii)
    if kind == layout.CONVEX:
        planes = rows[layout.PLANES].astype(np.float64).reshape(-1, 4)[start:end]
        return np.asarray((points @ planes[:, :3].T - planes[:, 3]).max(axis=-1) < row[0] * radii)
    away = points - row[:3]
    if kind == layout.BOX:
        outside = np.maximum(np.abs(away @ row[3:12].reshape(3, 3).T) - row[12:15], 0.0)
        return np.asarray(np.linalg.norm(outside, axis=-1) < radii)
    if kind == layout.BALL:
        return np.asarray(np.linalg.norm(away, axis=-1) < radii + row[3])
    along = away @ row[3:6]
    if kind == layout.CAPSULE:
        foot = np.clip(along * row[6], 0.0, 1.0)[..., None] * row[3:6]
        return np.asarray(np.linalg.norm(away - foot, axis=-1) < radii + row[7])
    across = np.linalg.norm(away - along[..., None] * row[3:6], axis=-1)
    return np.asarray(np.hypot(np.maximum(np.abs(along) - row[6], 0.0), np.maximum(across - row[7], 0.0)) < radii)


def row_gap(rows: Table, number: int, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Signed distance of points, shape (..., 3), from a row, negative inside. Shape (...)."""
    row = rows[layout.ROWS].reshape(-1, layout.ROW_FLOATS)[number].astype(np.float64)
    kind, _, start, end = rows[layout.NUMBERS].reshape(-1, 4)[number]
    if kind == layout.HALF_SPACE:
        return np.asarray(points @ row[:3] - row[3])
    if kind == layout.CONVEX:
        planes = rows[layout.PLANES].astype(np.float64).reshape(-1, 4)[start:end]
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


class PlainChecks:
    """The three-valued checks on the tables of a world."""

    def __init__(self, arm: Table, balls: tuple[Table, Table], rows: tuple[Table, Table]) -> None:
        self._arm, self._balls, self._rows = arm, balls, rows

    def classify(self, values: Matrix, *, prove: bool) -> NDArray[np.int8]:
        """See :meth:`rrtik_ompl.fast.FastWorld.classify`."""
        answers = np.zeros(len(values), dtype=np.int8)
        for start in range(0, len(values), CHUNK):
            part = slice(start, start + CHUNK)
            poses = frames(self._arm, values[part])
            answers[part] = self._meeting(poses, 0).any(axis=1)
            open_ = np.flatnonzero(answers[part])
            if prove and len(open_):
                answers[start + open_] += self._meeting(poses[open_], 1).any(axis=1)
        return answers

    def classify_edges(
        self, starts: Matrix, ends: Matrix, steps: NDArray[np.int32], *, prove: bool
    ) -> NDArray[np.int8]:
        """See :meth:`rrtik_ompl.fast.FastWorld.classify_edges`."""
        answers = np.zeros(len(starts), dtype=np.int8)
        for edge, count in enumerate(steps):
            share = (np.arange(count + 1) / count)[:, None]
            answers[edge] = self.classify((1.0 - share) * starts[edge] + share * ends[edge], prove=prove).max()
        return answers

    def marks(self, values: Matrix) -> Mask:
        """Flags of the pairs that the outer balls cannot prove free, shape (m, flags)."""
        return np.asarray(self._meeting(frames(self._arm, values), 0))

    def _meeting(self, poses: NDArray[np.float64], level: int) -> NDArray[np.bool_]:
        """Which bodies meet, shape (m, moving * standing + pairs of moving bodies)."""
        table, rows = self._balls[level], self._rows[level]
        body_count, standing = int(table.header[layout.BODY_COUNT]), int(rows.header[layout.STANDING_COUNT])
        pairs = table[layout.PAIRS].reshape(-1, 2)
        found = np.zeros((len(poses), body_count * standing + len(pairs)), dtype=bool)
        points, radii = placed_balls(poses, table)
        checked = rows[layout.CHECKED].reshape(body_count, standing)
        for number, (_, stands, _, _) in enumerate(rows[layout.NUMBERS].reshape(-1, 4)):
            for body in np.flatnonzero(checked[:, stands]):
                found[:, body * standing + stands] |= meets_row(rows, number, points[body], radii[body]).any(axis=1)
        for k, (i, j) in enumerate(pairs):
            gaps = np.linalg.norm(points[i][:, :, None] - points[j][:, None], axis=3)
            found[:, body_count * standing + k] = (gaps < radii[i][:, None] + radii[j]).any(axis=(1, 2))
        return found


def placed_balls(
    poses: NDArray[np.float64], table: Table
) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
    """Centres in the world, shape (m, n, 3), and radii, shape (n,), of each body's balls."""
    balls, clusters = table[layout.BALLS].astype(np.float64).reshape(-1, 4), table[layout.CLUSTERS].reshape(-1, 4)
    points, radii = [], []
    for frame, first, end in table[layout.BODIES].reshape(-1, 3):
        span = slice(clusters[first, 2], clusters[end - 1, 3]) if end > first else slice(0, 0)
        pose = poses[:, frame]
        points.append(np.einsum("mij,nj->mni", pose[:, :, :3], balls[span, :3]) + pose[:, None, :, 3])
        radii.append(balls[span, 3])
    return points, radii
