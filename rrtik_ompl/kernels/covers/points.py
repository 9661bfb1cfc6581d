"""Extreme points, and distances from triangles, by kernels where there are some."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector, bounds_of, box_of, products
from rrtik_ompl.geometry.collision.solids import farthest_along
from rrtik_ompl.kernels.covers.memory import called, room
from rrtik_ompl.kernels.covers.search_layout import BOX_POINTS
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.kernels.simd.processor import WIDTH
from rrtik_ompl.model.shapes.point_tree import curve_places

KERNELS = "covers.point_kernels"
MOST_POINTS = 1 << 24  # whose numbers float32 holds
RAY_TOLERANCE = 1e-9  # distance within which a ray that passes an edge is in doubt, as a share of the surface's size
IN_DOUBT = -1


def extreme_points(points: Matrix, directions: Matrix) -> Matrix:
    """Return the points, shape (n, 3), that lie farthest along one of the directions, each once."""
    if not len(points):
        return points
    kernels = library(KERNELS)
    if kernels is None or len(points) > MOST_POINTS:
        return np.asarray(points[np.unique(products(points, directions).argmax(axis=0))])

    lanes = in_lanes(directions)
    tops = room(len(lanes) * WIDTH)
    corners = np.ascontiguousarray(points)
    called(kernels.farthest_points, corners, len(points), corners[0].copy(), lanes, len(lanes), tops)
    return corners[np.unique(tops.astype(np.int64))]


def in_lanes(directions: Matrix) -> NDArray[np.float32]:
    """Return directions in blocks of ``WIDTH``, shape (blocks, 3, WIDTH); the last one fills up the last block."""
    blocks = -(-len(directions) // WIDTH)
    repeated = np.minimum(np.arange(blocks * WIDTH), len(directions) - 1)
    lanes: NDArray[np.float32] = room(3 * blocks * WIDTH).reshape(blocks, 3, WIDTH)
    lanes[:] = directions[repeated].reshape(blocks, WIDTH, 3).transpose(0, 2, 1)
    return lanes


def bounding_balls(triangles: NDArray[np.float64]) -> tuple[Matrix, Vector]:
    """Return a ball around each triangle, shape (m, 3, 3): centres, shape (m, 3), and radii, shape (m,)."""
    low, high = bounds_of(triangles)
    centres = 0.5 * (low + high)
    squares = [((triangles[:, k] - centres) ** 2).sum(axis=1) for k in range(3)]
    return centres, np.sqrt(np.maximum(np.maximum(squares[0], squares[1]), squares[2]))


def distances_to_nearest(points: Matrix, triangles: NDArray[np.float64], centres: Matrix, radii: Vector) -> Vector:
    """Return the distance of each point, shape (n, 3), from the nearest of some triangles, shape (m, 3, 3).

    Args:
        points: The points.
        triangles: The triangles.
        centres: Of balls around the triangles, shape (m, 3).
        radii: Of these balls, shape (m,).
    """
    kernels = library(KERNELS)
    if kernels is None:
        return np.array([_distance(point, triangles, centres, radii) for point in points])

    found = np.empty(len(points))
    balls = np.column_stack([centres, radii])
    surface = np.ascontiguousarray(triangles)
    called(kernels.distances, np.ascontiguousarray(points), len(points), surface, balls, len(surface), found)
    return found


def inside_by_rays(surface: NDArray[np.float64], points: Matrix) -> NDArray[np.int64]:
    """Check which points, shape (n, 3), are inside a closed surface of triangles, shape (m, 3, 3).

    A ray along x crosses the surface as often inwards as outwards if the point is outside.

    Returns:
        1 inside, 0 outside, ``IN_DOUBT`` where a ray comes close to an edge, or the point to the surface; shape (n,).
    """
    answers = np.full(len(points), IN_DOUBT)
    kernels = library(KERNELS)
    if kernels is not None:
        triangles = np.ascontiguousarray(surface)
        close = np.array([RAY_TOLERANCE * np.subtract(*box_of(triangles.reshape(-1, 3))[::-1]).max()])
        called(kernels.inside, np.ascontiguousarray(points), len(points), triangles, len(triangles), close, answers)
    return answers


def farthest_beyond(points: Matrix, normals: Matrix, offsets: Vector) -> float:
    """Return the largest distance of a point, shape (n, 3), beyond one of the planes; 0 if none is beyond any.

    Args:
        points: The points.
        normals: Unit normals of the planes, shape (k, 3).
        offsets: Of the planes, shape (k,).
    """
    kernels = library(KERNELS)
    if kernels is None:
        return max(float((farthest_along(points, normals) - offsets).max()), 0.0)

    ordered = points[np.argsort(curve_places(points.astype(np.float32)), kind="stable")]
    starts = np.arange(0, len(points), BOX_POINTS)
    low, high = np.minimum.reduceat(ordered, starts), np.maximum.reduceat(ordered, starts)
    boxes = np.column_stack([0.5 * (low + high), 0.5 * (high - low)])
    planes = np.column_stack([normals, offsets])
    farthest = np.zeros(1)
    called(kernels.farthest_beyond, ordered, len(points), boxes, BOX_POINTS, planes, len(planes), farthest)
    return float(farthest[0])


def chosen_balls(gaps: NDArray[np.float32], gap: NDArray[np.float32], count: int) -> NDArray[np.int64]:
    """Choose at most ``count`` balls, each time the one that reduces the samples' gaps to the nearest ball most.

    Args:
        gaps: Gap of each sample to each ball, shape (balls, samples).
        gap: Gap of each sample before any ball is chosen, shape (samples,).
        count: Largest number of balls.

    Returns:
        Indices of the balls in the order of the choice, shape (k,).
    """
    kernels = library(KERNELS)
    if kernels is not None:
        chosen = np.empty(count, dtype=np.int32)
        rows = np.ascontiguousarray(gaps)
        found = called(kernels.choose_balls, rows, *rows.shape, gap.copy(), np.empty(len(rows)), chosen, count)
        return chosen[:found].astype(np.int64)

    rows_chosen: list[int] = []
    while len(rows_chosen) < count:
        gain = np.maximum(gap - gaps, 0.0).sum(axis=1)
        best = int(gain.argmax())
        if gain[best] <= 0.0:
            break
        rows_chosen.append(best)
        gap = np.minimum(gap, gaps[best])
    return np.array(rows_chosen, dtype=np.int64)


def _distance(point: Vector, triangles: NDArray[np.float64], centres: Matrix, radii: Vector) -> float:
    to_centre = np.linalg.norm(centres - point, axis=1)
    may_be_nearest = to_centre - radii <= (to_centre + radii).min()
    rows = triangles[may_be_nearest]
    return float(distance_to_triangles(np.broadcast_to(point, (len(rows), 3)), rows).min())


def distance_to_triangles(points: Matrix, triangles: NDArray[np.float64]) -> Vector:
    """Return the distance of each point, shape (n, 3), to the triangle of the same index, shape (n, 3, 3).

    It is the distance to the plane if the point projects into the triangle, otherwise the distance to the nearest edge.
    Degenerate triangles are allowed.
    """
    a = triangles[:, 0]
    b = triangles[:, 1]
    c = triangles[:, 2]
    normal = np.cross(b - a, c - a)
    area = np.einsum("ij,ij->i", normal, normal)
    projects_inside = np.ones(len(points), dtype=bool)
    nearest = np.full(len(points), np.inf)

    for p, q in ((a, b), (b, c), (c, a)):
        side = q - p
        offset = points - p
        length = np.einsum("ij,ij->i", side, side)
        fraction = np.clip(np.einsum("ij,ij->i", offset, side) / np.maximum(length, 1e-300), 0.0, 1.0)
        to_nearest = offset - fraction[:, None] * side
        nearest = np.minimum(nearest, np.einsum("ij,ij->i", to_nearest, to_nearest))
        projects_inside &= np.einsum("ij,ij->i", np.cross(side, offset), normal) >= 0.0

    plane = np.einsum("ij,ij->i", points - a, normal) ** 2 / np.maximum(area, 1e-300)
    return np.asarray(np.sqrt(np.where(projects_inside & (area > 0.0), np.minimum(nearest, plane), nearest)))
