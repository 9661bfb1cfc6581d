"""Where a path bends: the vertices between which it is straight, and how widely each may be rounded."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector

COINCIDENCE = 1e-10  # [rad] or [m]; waypoints closer to the last one, or to a straight line, are left out
MIN_CORNER_COSINE = -0.98  # between the directions before and after; a corner with a smaller one is a stop
MERGED_SHARE = 0.02  # of the blend: waypoints nearer to the last one are merged with it
ROUNDED_SHARE = 0.14  # of the blend: by which the rounding of a corner alone may leave the path
SEARCH_CHUNK = 64  # waypoints at once, for the next one that is kept


def vertices(waypoints: Matrix) -> Matrix:
    """The waypoints between which a path is straight, to 1e-10: those that coincide or lie on a line are left out."""
    rows = waypoints[spaced(waypoints, COINCIDENCE)]
    if len(rows) < 3:
        return rows

    is_vertex = np.ones(len(rows), dtype=bool)
    is_vertex[1:-1] = ~_between(rows[:-2], rows[1:-1], rows[2:])

    first_vertices = np.flatnonzero(is_vertex)
    for a, b in pairwise(first_vertices):
        if b > a + 1:
            is_vertex[a + 1 : b] = _bends(rows[a : b + 1])
    return rows[is_vertex]


def spaced(rows: Matrix, min_distance: float) -> NDArray[np.int64]:
    """Numbers of the rows that are farther than ``min_distance`` from the last one chosen, and of the last row.

    Shape (m,).
    """
    steps = np.linalg.norm(rows[1:] - rows[:-1], axis=1)
    if (steps > min_distance).all():
        return np.arange(len(rows))

    chosen = [0]
    row = 1
    while row < len(rows):
        is_far_enough = np.linalg.norm(rows[row : row + SEARCH_CHUNK] - rows[chosen[-1]], axis=1) > min_distance
        if is_far_enough.any():
            row += int(is_far_enough.argmax())
            chosen.append(row)
            row += 1
        else:
            row += SEARCH_CHUNK

    last = len(rows) - 1
    if len(chosen) > 1 or np.linalg.norm(rows[-1] - rows[0]) > min_distance:
        if len(chosen) > 1 and chosen[-1] != last:  # too near to the last row, which takes its place
            chosen.pop()
        chosen.append(last)
    return np.unique(chosen)


def _between(a: Matrix, b: Matrix, c: Matrix) -> NDArray[np.bool_]:
    """Whether each point b lies on the line from a to c, between them; shape (m, n) each."""
    chord = c - a
    offset = b - a
    length = np.linalg.norm(chord, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        fraction = (offset * chord).sum(axis=1) / length**2
        line_distance = np.linalg.norm(offset - fraction[:, None] * chord, axis=1)
    is_between: NDArray[np.bool_] = (
        (length > COINCIDENCE) & (line_distance <= COINCIDENCE) & (fraction > 0.0) & (fraction < 1.0)
    )
    return is_between


def _bends(rows: Matrix) -> NDArray[np.bool_]:
    """Which inner rows are vertices, shape (k - 2,): halves at the farthest row until all lie on lines."""
    is_vertex = np.zeros(len(rows), dtype=bool)
    unfinished = [(0, len(rows) - 1)]
    while unfinished:
        a, b = unfinished.pop()
        if b <= a + 1:
            continue

        chord = rows[b] - rows[a]
        offsets = rows[a + 1 : b] - rows[a]
        length = float(np.linalg.norm(chord))
        fractions = offsets @ chord / length**2
        line_distances = np.linalg.norm(offsets - fractions[:, None] * chord, axis=1)
        if line_distances.max() > COINCIDENCE or not (np.diff(fractions, prepend=0.0, append=1.0) > 0.0).all():
            middle = a + 1 + int(line_distances.argmax())
            is_vertex[middle] = True
            unfinished += [(a, middle), (middle, b)]

    inner_vertices: NDArray[np.bool_] = is_vertex[1:-1]
    return inner_vertices


def first_radii(corners: Matrix, blend: float) -> Vector:
    """How far from each inner vertex its rounding may begin, shape (k - 2,); 0 where the path must stop.

    At most as far as ``blend`` and the nearest end of the path, and so that the corner by itself leaves the path by at
    most ``ROUNDED_SHARE`` of the blend: the rounding of radius r leaves it by r / 6 of the change of direction.
    """
    edges = corners[1:] - corners[:-1]
    directions = edges / np.linalg.norm(edges, axis=1)[:, None]
    turns = np.linalg.norm(directions[1:] - directions[:-1], axis=1)
    cosines = (directions[1:] * directions[:-1]).sum(axis=1)
    radii: Vector = np.minimum(blend, 6.0 * ROUNDED_SHARE * blend / np.maximum(turns, 1e-300))
    radii[cosines < MIN_CORNER_COSINE] = 0.0
    return radii
