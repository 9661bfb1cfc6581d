"""Winding numbers at the corners of a grid of cells: which corners and cells are inside a surface, surely or perhaps.

A closed surface has whole winding numbers, which change only where it is crossed. Everything here is counted in cells.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.geometry.covers.solids import CORNERS, Triangles

EDGE_TOLERANCE = 1e-9  # [cells] closer than this to an edge or a plane is doubtful, and doubtful counts as inside

Flags = NDArray[np.bool_]
Shape = tuple[int, int, int]


def winding(triangles: Triangles, shape: Shape) -> tuple[NDArray[np.int64], Flags]:
    """Winding number of a closed surface at every corner of the grid, and where it is doubtful.

    Counted along the lines of corners parallel to x, with sign; a line that comes close to an edge is doubtful.
    """
    corners = (shape[0] + 1, shape[1] + 1, shape[2] + 1)
    crossings = np.zeros(corners, dtype=np.int64)
    doubtful = np.zeros(corners, dtype=bool)

    triangle_of, y, z = _candidate_lines(triangles, corners)
    a, b, c = (triangles[triangle_of, k] for k in range(3))
    line = np.column_stack([y, z]).astype(np.float64)
    edge_distances = np.stack([_distance_from_edge(p, q, line) for p, q in ((a, b), (b, c), (c, a))])
    is_hit = (edge_distances > EDGE_TOLERANCE).all(axis=0) | (edge_distances < -EDGE_TOLERANCE).all(axis=0)
    is_near_edge = ~is_hit & (
        (edge_distances >= -EDGE_TOLERANCE).all(axis=0) | (edge_distances <= EDGE_TOLERANCE).all(axis=0)
    )
    doubtful[:, y[is_near_edge], z[is_near_edge]] = True

    a, b, c, line = (array[is_hit] for array in (a, b, c, line))
    y, z = (array[is_hit] for array in (y, z))
    if len(a):
        x, uncertainty = _line_crossings(a, b, c, line)
        sign = np.where(edge_distances[0, is_hit] > 0.0, 1, -1)
        # Corners with a smaller x see this crossing.
        corners_before = np.clip(np.ceil(x), 0, corners[0]).astype(np.int64)
        counts = corners_before > 0
        np.add.at(crossings, (corners_before[counts] - 1, y[counts], z[counts]), sign[counts])

        nearest_corner = np.round(x)
        is_at_corner = (
            (np.abs(x - nearest_corner) <= uncertainty) & (nearest_corner >= 0) & (nearest_corner < corners[0])
        )
        doubtful[nearest_corner[is_at_corner].astype(np.int64), y[is_at_corner], z[is_at_corner]] = True
        doubtful[:, y[uncertainty > 0.1], z[uncertainty > 0.1]] = True

    return np.asarray(crossings[::-1].cumsum(axis=0)[::-1]), doubtful


def _candidate_lines(triangles: Triangles, corners: Shape) -> tuple[NDArray[np.int64], ...]:
    """Pairs of a triangle and a line of corners that passes through the box around it, seen along x."""
    low = np.ceil(triangles[:, :, 1:].min(axis=1) - EDGE_TOLERANCE).astype(np.int64)
    high = np.floor(triangles[:, :, 1:].max(axis=1) + EDGE_TOLERANCE).astype(np.int64)
    low = np.maximum(low, 0)
    high = np.minimum(high, np.array(corners[1:]) - 1)

    line_counts = np.maximum(high - low + 1, 0)
    total = line_counts.prod(axis=1)

    triangle_of = np.repeat(np.arange(len(triangles)), total)
    position = np.arange(len(triangle_of)) - np.repeat(np.cumsum(total) - total, total)
    return (
        triangle_of,
        low[triangle_of, 0] + position // line_counts[triangle_of, 1],
        low[triangle_of, 1] + position % line_counts[triangle_of, 1],
    )


def _distance_from_edge(p: Matrix, q: Matrix, line: Matrix) -> Vector:
    """Signed distance of lines along x from the edge p q, seen along x."""
    side = q[:, 1:] - p[:, 1:]
    offset = line - p[:, 1:]
    length = np.linalg.norm(side, axis=1)
    cross = side[:, 0] * offset[:, 1] - side[:, 1] * offset[:, 0]
    return np.asarray(np.where(length > EDGE_TOLERANCE, cross / np.maximum(length, EDGE_TOLERANCE), 0.0))


def _line_crossings(a: Matrix, b: Matrix, c: Matrix, line: Matrix) -> tuple[Vector, Vector]:
    """Where lines along x pass through triangles, and how uncertain that is."""
    normal = np.cross(b - a, c - a)
    x = a[:, 0] - ((line - a[:, 1:]) * normal[:, 1:]).sum(axis=1) / normal[:, 0]
    slope = np.abs(normal[:, 0]) / np.linalg.norm(normal, axis=1)
    return x, EDGE_TOLERANCE / np.maximum(slope, 1e-12)


def all_corners(flag: Flags) -> Flags:
    """Cells of which all corners are flagged."""
    all_flagged = np.ones(tuple(n - 1 for n in flag.shape), dtype=bool)
    for x, y, z in CORNERS:
        all_flagged &= flag[x : flag.shape[0] - 1 + x, y : flag.shape[1] - 1 + y, z : flag.shape[2] - 1 + z]
    return all_flagged
