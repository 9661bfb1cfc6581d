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
    passed = np.zeros(corners, dtype=np.int64)
    doubtful = np.zeros(corners, dtype=bool)

    which, y, z = _lines_near(triangles, corners)
    a, b, c = (triangles[which, k] for k in range(3))
    line = np.column_stack([y, z]).astype(np.float64)
    off = np.stack([_off_edge(p, q, line) for p, q in ((a, b), (b, c), (c, a))])
    hit = (off > EDGE_TOLERANCE).all(axis=0) | (off < -EDGE_TOLERANCE).all(axis=0)
    near = ~hit & ((off >= -EDGE_TOLERANCE).all(axis=0) | (off <= EDGE_TOLERANCE).all(axis=0))
    doubtful[:, y[near], z[near]] = True

    a, b, c, line = (each[hit] for each in (a, b, c, line))
    y, z = (each[hit] for each in (y, z))
    if len(a):
        x, blur = _crossing(a, b, c, line)
        sign = np.where(off[0, hit] > 0.0, 1, -1)
        before = np.clip(np.ceil(x), 0, corners[0]).astype(np.int64)  # corners with a smaller x see this crossing
        some = before > 0
        np.add.at(passed, (before[some] - 1, y[some], z[some]), sign[some])

        close = np.round(x)
        at = (np.abs(x - close) <= blur) & (close >= 0) & (close < corners[0])
        doubtful[close[at].astype(np.int64), y[at], z[at]] = True
        doubtful[:, y[blur > 0.1], z[blur > 0.1]] = True

    return np.asarray(passed[::-1].cumsum(axis=0)[::-1]), doubtful


def _lines_near(triangles: Triangles, corners: Shape) -> tuple[NDArray[np.int64], ...]:
    """Pairs of a triangle and a line of corners that passes through the box around it, seen along x."""
    low = np.ceil(triangles[:, :, 1:].min(axis=1) - EDGE_TOLERANCE).astype(np.int64)
    high = np.floor(triangles[:, :, 1:].max(axis=1) + EDGE_TOLERANCE).astype(np.int64)
    low = np.maximum(low, 0)
    high = np.minimum(high, np.array(corners[1:]) - 1)

    count = np.maximum(high - low + 1, 0)
    total = count.prod(axis=1)

    which = np.repeat(np.arange(len(triangles)), total)
    place = np.arange(len(which)) - np.repeat(np.cumsum(total) - total, total)
    return which, low[which, 0] + place // count[which, 1], low[which, 1] + place % count[which, 1]


def _off_edge(p: Matrix, q: Matrix, line: Matrix) -> Vector:
    """Signed distance of lines along x from the edge p q, seen along x."""
    side = q[:, 1:] - p[:, 1:]
    away = line - p[:, 1:]
    length = np.linalg.norm(side, axis=1)
    cross = side[:, 0] * away[:, 1] - side[:, 1] * away[:, 0]
    return np.asarray(np.where(length > EDGE_TOLERANCE, cross / np.maximum(length, EDGE_TOLERANCE), 0.0))


def _crossing(a: Matrix, b: Matrix, c: Matrix, line: Matrix) -> tuple[Vector, Vector]:
    """Where lines along x pass through triangles, and how uncertain that is."""
    normal = np.cross(b - a, c - a)
    x = a[:, 0] - ((line - a[:, 1:]) * normal[:, 1:]).sum(axis=1) / normal[:, 0]
    steep = np.abs(normal[:, 0]) / np.linalg.norm(normal, axis=1)
    return x, EDGE_TOLERANCE / np.maximum(steep, 1e-12)


def all_corners(flag: Flags) -> Flags:
    """Cells of which all corners are flagged."""
    found = np.ones(tuple(n - 1 for n in flag.shape), dtype=bool)
    for x, y, z in CORNERS:
        found &= flag[x : flag.shape[0] - 1 + x, y : flag.shape[1] - 1 + y, z : flag.shape[2] - 1 + z]
    return found
