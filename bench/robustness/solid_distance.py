"""Distances of points to solids, and where solids end in a direction, in plain arithmetic. Lengths are metres."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.shapes import Box, Capsule, Cylinder, Mesh, Prism, Shape, Sphere


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
        case Mesh(vertices=vertices, triangles=triangles):
            return float((vertices[np.unique(triangles)] @ way).min())
    raise TypeError(f"no end of {type(shape).__name__}")


def distance_to(shape: Shape, points: Matrix) -> Vector:
    """Signed distances of points, shape (m, 3), to a solid: less than 0 inside. Shape (m,)."""
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
            return np.array([_to_mesh(shape, point) for point in points])
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


def _to_mesh(mesh: Mesh, point: Vector) -> float:
    """Distance of a point to the triangles of a mesh; less than 0 inside a closed one."""
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    least = np.linalg.norm(np.maximum(np.maximum(low - point, point - high), 0.0), axis=1)
    most = float(np.linalg.norm(a - point, axis=1).min())
    near = least <= most
    away = float(_to_triangles(point, a[near], b[near], c[near]).min())
    inside = mesh.closed and bool(((point >= low.min(axis=0)) & (point <= high.max(axis=0))).all())
    return -away if inside and _winding(point, a, b, c) > 0.5 else away


def _to_triangles(point: Vector, a: Matrix, b: Matrix, c: Matrix) -> Vector:
    """Distances of a point to triangles: to the plane where it lies above the inside, else to the nearest edge."""
    normal = np.cross(b - a, c - a)
    size = np.linalg.norm(normal, axis=1)
    above = np.ones(len(a), dtype=bool)
    edges = np.full(len(a), np.inf)
    for start, end in ((a, b), (b, c), (c, a)):
        along, to = end - start, point - start
        above &= np.einsum("ij,ij->i", np.cross(normal, along), to) >= 0.0
        share = np.clip(np.einsum("ij,ij->i", to, along) / np.einsum("ij,ij->i", along, along), 0.0, 1.0)
        edges = np.minimum(edges, np.linalg.norm(to - share[:, None] * along, axis=1))
    above &= size > 0.0
    plane = np.abs(np.einsum("ij,ij->i", normal, point - a)) / np.where(size > 0.0, size, 1.0)
    return np.where(above, plane, edges)


def _winding(point: Vector, a: Matrix, b: Matrix, c: Matrix) -> float:
    """How often a surface goes round a point, by solid angles [37]; the amount, whatever the sense of its triangles."""
    a, b, c = a - point, b - point, c - point
    la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    pairs = (np.einsum("ij,ij->i", *sides) for sides in ((a, b), (a, c), (b, c)))
    ab, ac, bc = pairs
    angles: NDArray[np.float64] = np.arctan2(volume, la * lb * lc + ab * lc + ac * lb + bc * la)
    return abs(float(angles.sum())) / (2.0 * np.pi)
