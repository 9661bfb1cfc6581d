"""Find the vertices between which a path is straight, and how widely each may be rounded."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector

COINCIDENCE = 1e-10  # [rad] or [m] Waypoints closer than this to the last one, or to a line, are left out.
# Smallest cosine between the directions before and after a corner that is rounded; a sharper corner is a stop.
MIN_CORNER_COSINE = -0.98
MERGED_SHARE = 0.02  # distance within which waypoints are merged, as a share of the blend
ROUNDED_SHARE = 0.14  # largest deviation by the rounding of a single corner, as a share of the blend
SEARCH_CHUNK = 64  # waypoints that are compared at once in the search for the next one to keep


class Polyline(NamedTuple):
    """A path as its vertices and the straight edges between them.

    Attributes:
        vertices: The vertices, shape (k, n).
        lengths: Lengths of the edges, shape (k - 1,) [rad or m].
        directions: Unit vectors along the edges, shape (k - 1, n).
        along: Distance of each vertex from the first one along the path, shape (k,) [rad or m].
    """

    vertices: Matrix
    lengths: Vector
    directions: Matrix
    along: Vector

    @classmethod
    def of(cls, vertices: Matrix) -> Polyline:
        """Return the path through vertices, shape (k, n), each of which differs from the one before."""
        edges = vertices[1:] - vertices[:-1]
        lengths = row_lengths(edges)
        return cls(vertices, lengths, edges / lengths[:, None], _summed(lengths))

    def part(self, first: int, last: int) -> Polyline:
        """Return the part from one vertex to another."""
        lengths = self.lengths[first:last]
        return Polyline(self.vertices[first : last + 1], lengths, self.directions[first:last], _summed(lengths))


def row_lengths(rows: Matrix) -> Vector:
    """Return the Euclidean norm of each row, shape (k, n) -> (k,): that of numpy.linalg, in a third of its time."""
    return np.asarray(np.sqrt(np.add.reduce(rows * rows, axis=1)))


def _summed(lengths: Vector) -> Vector:
    """Return 0, and the sums of the first ones of lengths."""
    sums = np.empty(len(lengths) + 1)
    sums[0] = 0.0
    np.add.accumulate(lengths, out=sums[1:])
    return sums


def vertices(waypoints: Matrix) -> Matrix:
    """Return the waypoints between which a path is straight to 1e-10, shape (k, n).

    Waypoints that coincide with the last one, or lie on a line between others, are left out.
    """
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
    """Choose rows that are farther than ``min_distance`` from the one chosen before; return their indices, shape (m,).

    The first row is chosen, and the last one too if there are at least two.
    """
    steps = row_lengths(rows[1:] - rows[:-1])
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
        if len(chosen) > 1 and chosen[-1] != last:  # This row is too near to the last one, which replaces it.
            chosen.pop()
        chosen.append(last)
    return np.unique(chosen)


def _between(a: Matrix, b: Matrix, c: Matrix) -> NDArray[np.bool_]:
    """Check whether each point b lies on the line from a to c, between them; shape (m, n) each."""
    chord = c - a
    offset = b - a
    length = row_lengths(chord)
    with np.errstate(divide="ignore", invalid="ignore"):
        fraction = (offset * chord).sum(axis=1) / length**2
        line_distance = row_lengths(offset - fraction[:, None] * chord)
    is_between: NDArray[np.bool_] = (
        (length > COINCIDENCE) & (line_distance <= COINCIDENCE) & (fraction > 0.0) & (fraction < 1.0)
    )
    return is_between


def _bends(rows: Matrix) -> NDArray[np.bool_]:
    """Find the inner rows that are vertices: split at the row farthest from the chord until all rows lie on lines.

    Args:
        rows: Points, shape (k, n).

    Returns:
        Mask of the vertices among the inner rows, shape (k - 2,).
    """
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


def first_radii(line: Polyline, blend: float) -> Vector:
    """Return the largest radius of each inner vertex's rounding, shape (k - 2,); 0 where the path must stop.

    A radius is at most ``blend``, and such that the rounding of the corner by itself leaves the path by at most
    ``ROUNDED_SHARE`` of the blend: a rounding of radius r leaves it by r / 6 times the change of direction.

    Args:
        line: The path.
        blend: Largest radius [rad or m].
    """
    before = line.directions[:-1]
    after = line.directions[1:]
    turns = row_lengths(after - before)
    cosines = np.add.reduce(after * before, axis=1)
    radii: Vector = np.minimum(blend, 6.0 * ROUNDED_SHARE * blend / np.maximum(turns, 1e-300))
    radii[cosines < MIN_CORNER_COSINE] = 0.0
    return radii
