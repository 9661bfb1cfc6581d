"""Distances of points to solids, and where solids end in a direction, in plain arithmetic. Lengths are metres."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.model.shapes import Box, Capsule, Cylinder, Mesh, Prism, Shape, Sphere

BLOCK = 64  # triangles whose box is looked at first


def lowest(shape: Shape, way: Vector) -> float:
    """The least of ``way . x`` over all points x of a solid; ``way`` has unit length."""
    match shape:
        case Sphere(radius=radius):
            return -radius
        case Box(size=size):
            return -0.5 * float(np.abs(way) @ size)
        case Capsule(radius=radius, length=length):
            return -0.5 * length * abs(float(way[2])) - radius
        case Cylinder(radius=radius, length=length):
            return -0.5 * length * abs(float(way[2])) - radius * float(np.hypot(way[0], way[1]))
        case Prism(polygon=polygon, height=height):
            return float((polygon @ way[:2]).min()) - 0.5 * height * abs(float(way[2]))
        case Mesh():
            return float((_surface(shape).vertices @ way).min())
    raise TypeError(f"no end of {type(shape).__name__}")


def distance_to(shape: Shape, points: Matrix, most: float = np.inf) -> Vector:
    """Signed distances of points, shape (m, 3), to a solid: less than 0 inside. Shape (m,).

    Of points that are farther from a mesh than ``most`` [m] it says ``most`` or more.
    """
    match shape:
        case Sphere(radius=radius):
            return np.asarray(np.linalg.norm(points, axis=1) - radius)
        case Capsule(radius=radius, length=length):
            half = 0.5 * length
            off = points - np.clip(points[:, 2], -half, half)[:, None] * [0.0, 0.0, 1.0]
            return np.asarray(np.linalg.norm(off, axis=1) - radius)
        case Box(size=size):
            return _outside(np.abs(points) - 0.5 * size)
        case Cylinder(radius=radius, length=length):
            return _outside(
                np.column_stack([np.hypot(points[:, 0], points[:, 1]) - radius, np.abs(points[:, 2]) - 0.5 * length])
            )
        case Prism(polygon=polygon, height=height):
            across = np.array([_to_polygon(polygon, point[:2]) for point in points])
            return _outside(np.column_stack([across, np.abs(points[:, 2]) - 0.5 * height]))
        case Mesh():
            return np.array([_to_mesh(shape, point, most) for point in points])
    raise TypeError(f"no distance to {type(shape).__name__}")


def _outside(over: Matrix) -> Vector:
    """Signed distance from how far points are beyond pairs of parallel sides, shape (m, k)."""
    found: Vector = np.linalg.norm(np.maximum(over, 0.0), axis=1) + np.minimum(over.max(axis=1), 0.0)
    return found


def _to_polygon(polygon: Matrix, point: Vector) -> float:
    """Signed distance of a point to a simple polygon, shape (k, 2)."""
    along = np.roll(polygon, -1, axis=0) - polygon
    to = point - polygon
    share = np.clip(np.einsum("ij,ij->i", to, along) / np.einsum("ij,ij->i", along, along), 0.0, 1.0)
    away = float(np.linalg.norm(to - share[:, None] * along, axis=1).min())
    ahead = np.roll(polygon, -1, axis=0)
    crossed = (polygon[:, 1] > point[1]) != (ahead[:, 1] > point[1])
    with np.errstate(divide="ignore", invalid="ignore"):
        x = polygon[:, 0] + (point[1] - polygon[:, 1]) / along[:, 1] * along[:, 0]
    inside = np.count_nonzero(crossed & (point[0] < x)) % 2 == 1
    return -away if inside else away


@dataclass(frozen=True)
class _Surface:
    """A mesh made ready.

    Attributes:
        vertices: Those that triangles have, shape (n, 3) [m].
        corners: Of the triangles, shape (m, 3) each [m].
        blocks: Numbers of triangles that lie near each other.
        low, high: Ends of the boxes around the blocks, shape (k, 3) [m].
    """

    vertices: Matrix
    corners: tuple[Matrix, Matrix, Matrix]
    blocks: list[NDArray[np.int64]]
    low: Matrix
    high: Matrix

    def nearest(self, point: Vector, most: float) -> float:
        """Distance of a point to the triangles; ``most`` where it is more."""
        least = np.linalg.norm(np.maximum(np.maximum(self.low - point, point - self.high), 0.0), axis=1)
        first = int(least.argmin())
        if least[first] >= most:
            return most
        away = min(most, self._away(point, [first]))
        others = [k for k in np.flatnonzero(least < away).tolist() if k != first]
        return min(away, self._away(point, others))

    def _away(self, point: Vector, blocks: list[int]) -> float:
        if not blocks:
            return np.inf
        rows = np.concatenate([self.blocks[k] for k in blocks])
        return float(_to_triangles(point, *(corner[rows] for corner in self.corners)).min())


@lru_cache(maxsize=256)
def _surface(mesh: Mesh) -> _Surface:
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    blocks = _halved(np.arange(len(mesh.triangles)), a + b + c)
    low = np.array([np.minimum(np.minimum(a[k], b[k]), c[k]).min(axis=0) for k in blocks])
    high = np.array([np.maximum(np.maximum(a[k], b[k]), c[k]).max(axis=0) for k in blocks])
    return _Surface(mesh.vertices[np.unique(mesh.triangles)], (a, b, c), blocks, low, high)


def _halved(rows: NDArray[np.int64], middles: Matrix) -> list[NDArray[np.int64]]:
    """Rows in blocks that lie near each other."""
    if len(rows) <= BLOCK:
        return [rows]
    axis = int(np.ptp(middles[rows], axis=0).argmax())
    ordered = rows[np.argsort(middles[rows, axis])]
    return _halved(ordered[: len(rows) // 2], middles) + _halved(ordered[len(rows) // 2 :], middles)


def _to_mesh(mesh: Mesh, point: Vector, most: float) -> float:
    """Distance of a point to the triangles of a mesh; less than 0 inside a closed one."""
    surface = _surface(mesh)
    away = surface.nearest(point, max(most, 0.0))
    low, high = surface.low.min(axis=0), surface.high.max(axis=0)
    inside = mesh.closed and bool(((point >= low) & (point <= high)).all())
    return -away if inside and _winding(point, *surface.corners) > 0.5 else away


def _to_triangles(point: Vector, a: Matrix, b: Matrix, c: Matrix) -> Vector:
    """Distances of a point to triangles: to the plane where it lies above the inside, else to the nearest edge."""
    normal = _cross(b - a, c - a)
    size = np.linalg.norm(normal, axis=1)
    above = np.ones(len(a), dtype=bool)
    edges = np.full(len(a), np.inf)
    for start, end in ((a, b), (b, c), (c, a)):
        along, to = end - start, point - start
        above &= np.einsum("ij,ij->i", _cross(normal, along), to) >= 0.0
        share = np.clip(np.einsum("ij,ij->i", to, along) / np.einsum("ij,ij->i", along, along), 0.0, 1.0)
        edges = np.minimum(edges, np.linalg.norm(to - share[:, None] * along, axis=1))
    above &= size > 0.0
    plane = np.abs(np.einsum("ij,ij->i", normal, point - a)) / np.where(size > 0.0, size, 1.0)
    return np.where(above, plane, edges)


def _cross(a: Matrix, b: Matrix) -> Matrix:
    """Cross products, shape (m, 3); `numpy.cross` takes four times as long for few."""
    return np.asarray(a[:, [1, 2, 0]] * b[:, [2, 0, 1]] - a[:, [2, 0, 1]] * b[:, [1, 2, 0]])


def _winding(point: Vector, a: Matrix, b: Matrix, c: Matrix) -> float:
    """How often a surface goes round a point, by solid angles [37]; the amount, whatever the sense of its triangles."""
    a, b, c = a - point, b - point, c - point
    la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    pairs = (np.einsum("ij,ij->i", *sides) for sides in ((a, b), (a, c), (b, c)))
    ab, ac, bc = pairs
    angles: NDArray[np.float64] = np.arctan2(volume, la * lb * lc + ab * lc + ac * lb + bc * la)
    return abs(float(angles.sum())) / (2.0 * np.pi)
