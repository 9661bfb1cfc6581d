"""Paths as lists of single-joint moves: what counts as a move, how many there are, and the least possible number.

Source: the metric and the count of routes of [1, ch. 6.3].
"""

from __future__ import annotations

from itertools import pairwise
from math import radians
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import MOST_ROWS, Matrix, Vector, finite_array
from rrtik_ompl.base.errors import InputError, at_most

SAME = radians(1e-6)  # [rad] or [m] largest change of a joint that does not count as a move


class Move(NamedTuple):
    """A move of one joint, while all others rest.

    Attributes:
        joint: Name of the joint.
        start, end: Its values before and after.
        unit: Unit of the values, "rad" or "m".
        continuous: Whether the joint has no limits, so that values a whole turn apart are the same posture.
    """

    joint: str
    start: float
    end: float
    unit: str = "rad"
    continuous: bool = False

    @property
    def change(self) -> float:
        """Signed displacement of the joint [rad or m]."""
        return self.end - self.start


def moved(a: ArrayLike, b: ArrayLike, tolerance: float = SAME) -> NDArray[np.bool_]:
    """Return which joints differ between a and b by more than ``tolerance``: sigma of [1, ch. 6.3].

    The shape is that of a and b.
    """
    difference = np.abs(np.asarray(a, dtype=np.float64) - np.asarray(b, dtype=np.float64))
    mask: NDArray[np.bool_] = difference > tolerance
    return mask


def lower_bound(start: ArrayLike, goal: ArrayLike, tolerance: float = SAME) -> int:
    """Return the least number of single-joint moves from start to goal, shape (n,) each: c of [1, ch. 6.3].

    It is attained if nothing obstructs. If only one joint is obstructed, c + 2 is the natural optimum.
    """
    first = finite_array(start, (None,), "start")
    return int(np.count_nonzero(moved(first, finite_array(goal, (len(first),), "goal"), tolerance)))


def merge_moves(waypoints: ArrayLike, tolerance: float = SAME) -> Matrix:
    """Merge consecutive moves of the same joint and delete null moves.

    A merged move covers no new configuration, so a valid path stays valid. Start and end are kept exactly. With
    ``tolerance = 0`` every edge of a single-joint path still moves exactly one coordinate.

    Args:
        waypoints: The path, shape (k, n), k at least 1.
        tolerance: Largest change that does not count as a move [rad or m].

    Returns:
        Waypoints, shape (m, n), m <= k; a single row if nothing moves.
    """
    rows = _rows(waypoints)
    values = rows.tolist()  # most paths are short, for which lists are faster than numpy
    corners = [0]

    for i in range(1, len(rows)):
        while len(corners) > 1 and _same_joint(values[corners[-2]], values[corners[-1]], values[i], tolerance):
            corners.pop()
        if _moved_joints(values[corners[-1]], values[i], tolerance):
            corners.append(i)
        elif len(corners) > 1:  # a null move is replaced by its end, so that the last row is exact
            corners[-1] = i

    return rows[corners]


def without_repeats(route: Matrix) -> Matrix:
    """Return a path, shape (k, n), without waypoints that equal the one before; both ends stay."""
    distinct: Matrix = route[np.append(True, (np.diff(route, axis=0) != 0.0).any(axis=1))]
    return distinct


def transitions(waypoints: ArrayLike, tolerance: float = SAME) -> int:
    """Return the number of moves of a path, shape (k, n): its edges after :func:`merge_moves`.

    An edge that moves several joints at once counts as one; :func:`single_joint` tells whether there is such an edge.
    """
    return len(merge_moves(waypoints, tolerance)) - 1


def single_joint(waypoints: ArrayLike, tolerance: float = 0.0) -> bool:
    """Check whether every edge of a path, shape (k, n), moves exactly one joint."""
    rows = _rows(waypoints)
    return bool((moved(rows[:-1], rows[1:], tolerance).sum(axis=1) == 1).all())


def moves_several(rows: Matrix, tolerance: float = SAME) -> bool:
    """Check whether an edge of a path, shape (k, n), certainly moves several joints at once, merged or not.

    This is quick. Null moves shift a waypoint by at most ``tolerance`` each, so an edge may be so much shorter.
    """
    least = tolerance * (len(rows) + 2)
    return bool(((np.abs(rows[1:] - rows[:-1]) > least).sum(axis=1) > 1).any())


def route_length(waypoints: ArrayLike) -> float:
    """Return the sum of the Euclidean lengths of the edges of a path, shape (k, n) [rad, or m for prismatic joints]."""
    return length_of(_rows(waypoints))


def length_of(rows: Matrix) -> float:
    """Return the length of a path as :func:`route_length`, without validation of the waypoints."""
    edges = rows[1:] - rows[:-1]
    return float(np.sqrt((edges * edges).sum(axis=1)).sum())


def _same_joint(a: list[float], b: list[float], c: list[float], tolerance: float) -> bool:
    """Check whether a -> b and b -> c move the same single joint."""
    first = _moved_joints(a, b, tolerance)
    return len(first) == 1 and first == _moved_joints(b, c, tolerance)


def _moved_joints(a: list[float], b: list[float], tolerance: float) -> list[int]:
    """Return the indices of the joints that differ by more than the tolerance."""
    return [joint for joint, (x, y) in enumerate(zip(a, b, strict=True)) if abs(x - y) > tolerance]


def _rows(waypoints: ArrayLike) -> Matrix:
    """Convert waypoints to an array; they are not validated further."""
    rows = np.asarray(waypoints, dtype=np.float64)
    if len(rows) == 0:
        raise InputError("waypoints: a route needs at least one configuration")
    return rows


def edge_keys(route: Matrix) -> list[tuple[bytes, bytes]]:
    """Return hashable keys of the edges of a path, pairs of bytes."""
    return list(pairwise(row.tobytes() for row in route))


def part_counts(rows: Matrix, step: float) -> Vector:
    """Compute the number of parts for each edge of a polyline, shape (k, n), so that none is longer than ``step``.

    Parts may be longer by rounding errors. Edges of length 0 have no parts (-0.0). The result has shape (k - 1,).

    Raises:
        InputError: If there would be more parts than a path may have waypoints.
    """
    counts: Vector = np.ceil(np.linalg.norm(np.diff(rows, axis=0), axis=1) / step - 1e-9)
    at_most(float(counts.sum()), MOST_ROWS, "waypoints of a path in such small steps")
    return counts


def in_parts(counts: Vector, at_once: int) -> list[NDArray[np.int64]]:
    """Split edges into groups of about ``at_once`` checks, given the number of checks of each edge, shape (k,).

    Returns:
        The indices of the edges of each group.
    """
    edges = np.arange(len(counts), dtype=np.int64)
    return np.split(edges, np.flatnonzero(np.diff(counts.cumsum() // at_once)) + 1)


def subdivided(rows: Matrix, counts: Vector) -> tuple[Matrix, Vector]:
    """Divide edge i of a polyline, shape (k, n), into ``counts[i]`` equal parts.

    Returns:
        All points, shape (m, n), and the index of the edge that each is on, shape (m,). The first point counts to edge
        0, every other node to the edge that ends there.
    """
    points = [rows[:1]]
    edges = [np.zeros(1, dtype=np.int64)]

    for i, count in enumerate(np.maximum(counts, 1.0).astype(np.int64)):
        shares = (np.arange(1, count + 1) / count)[:, None]
        points.append((1.0 - shares) * rows[i] + shares * rows[i + 1])
        edges.append(np.full(count, i, dtype=np.int64))

    return np.vstack(points), np.concatenate(edges)
