"""Routes as lists of single-joint moves: what counts as a move, how many a route has, how few it could have.

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

SAME = radians(1e-6)  # [rad] or [m]; a joint that changes by no more than this has not moved


class Move(NamedTuple):
    """One joint moves, all others rest.

    Attributes:
        joint: Its name.
        start, end: Its values before and after.
        unit: Of the values, "rad" or "m".
        continuous: Whether the joint has no limits, so that a whole turn more is the same posture.
    """

    joint: str
    start: float
    end: float
    unit: str = "rad"
    continuous: bool = False

    @property
    def change(self) -> float:
        """How far the joint moves, with its sign [rad or m]."""
        return self.end - self.start


def moved(a: ArrayLike, b: ArrayLike, tolerance: float = SAME) -> NDArray[np.bool_]:
    """Sigma of [1, ch. 6.3]: which joints differ between a and b by more than ``tolerance``. Shape of a and b."""
    difference = np.abs(np.asarray(a, dtype=np.float64) - np.asarray(b, dtype=np.float64))
    mask: NDArray[np.bool_] = difference > tolerance
    return mask


def lower_bound(start: ArrayLike, goal: ArrayLike, tolerance: float = SAME) -> int:
    """The number c of [1, ch. 6.3]: the fewest single-joint moves that lead from start to goal, each of shape (n,).

    It is reached when nothing obstructs. If one joint alone is obstructed, c + 2 is the natural optimum.
    """
    first = finite_array(start, (None,), "start")
    return int(np.count_nonzero(moved(first, finite_array(goal, (len(first),), "goal"), tolerance)))


def merge_moves(waypoints: ArrayLike, tolerance: float = SAME) -> Matrix:
    """Join consecutive moves of the same joint and delete null moves.

    The merged move covers no new configuration, so a valid route stays valid. Start and end are kept exactly. With
    ``tolerance = 0`` every edge of a single-joint route still moves exactly one coordinate.

    Args:
        waypoints: Shape (k, n), k at least 1.
        tolerance: Largest change that counts as none, rad or m.

    Returns:
        Shape (m, n), m <= k; a single row if nothing moves.
    """
    rows = _rows(waypoints)
    values = rows.tolist()  # lists: most routes are short, and numpy takes longer for a row
    corners = [0]

    for i in range(1, len(rows)):
        while len(corners) > 1 and _same_joint(values[corners[-2]], values[corners[-1]], values[i], tolerance):
            corners.pop()
        if _moved_joints(values[corners[-1]], values[i], tolerance):
            corners.append(i)
        elif len(corners) > 1:  # a null move: its end takes the place of its beginning, so that the last row is exact
            corners[-1] = i

    return rows[corners]


def without_repeats(route: Matrix) -> Matrix:
    """Return the route without waypoints that repeat the one before, shape (k, n); both ends stay."""
    distinct: Matrix = route[np.append(True, (np.diff(route, axis=0) != 0.0).any(axis=1))]
    return distinct


def transitions(waypoints: ArrayLike, tolerance: float = SAME) -> int:
    """Return the number of moves of a route, shape (k, n): its edges after :func:`merge_moves`.

    An edge that moves several joints at once counts as one; :func:`single_joint` tells whether there is such an edge.
    """
    return len(merge_moves(waypoints, tolerance)) - 1


def single_joint(waypoints: ArrayLike, tolerance: float = 0.0) -> bool:
    """Check whether every edge of the route, shape (k, n), moves exactly one joint."""
    rows = _rows(waypoints)
    return bool((moved(rows[:-1], rows[1:], tolerance).sum(axis=1) == 1).all())


def route_length(waypoints: ArrayLike) -> float:
    """Sum of the Euclidean lengths of the edges of a route, shape (k, n) [rad, or m for sliding joints]."""
    return length_of(_rows(waypoints))


def length_of(rows: Matrix) -> float:
    """As :func:`route_length`, of waypoints that are known to be numbers."""
    edges = rows[1:] - rows[:-1]
    return float(np.sqrt((edges * edges).sum(axis=1)).sum())


def _same_joint(a: list[float], b: list[float], c: list[float], tolerance: float) -> bool:
    """Check whether a -> b and b -> c move one and the same joint."""
    first = _moved_joints(a, b, tolerance)
    return len(first) == 1 and first == _moved_joints(b, c, tolerance)


def _moved_joints(a: list[float], b: list[float], tolerance: float) -> list[int]:
    """Return numbers of the joints that differ by more than the tolerance."""
    return [joint for joint, (x, y) in enumerate(zip(a, b, strict=True)) if abs(x - y) > tolerance]


def _rows(waypoints: ArrayLike) -> Matrix:
    """Waypoints, which are trusted to be numbers, as an array."""
    rows = np.asarray(waypoints, dtype=np.float64)
    if len(rows) == 0:
        raise InputError("waypoints: a route needs at least one configuration")
    return rows


def edge_keys(route: Matrix) -> list[tuple[bytes, bytes]]:
    """Return the edges of a route as keys."""
    return list(pairwise(row.tobytes() for row in route))


def part_counts(rows: Matrix, step: float) -> Vector:
    """Into how many parts to cut each edge of a polyline, shape (k, n), so that none is longer than ``step``.

    A part may be longer by rounding. An edge without length has none (-0.0). Shape (k - 1,).

    Raises:
        InputError: If there would be more parts than a path may have waypoints.
    """
    counts: Vector = np.ceil(np.linalg.norm(np.diff(rows, axis=0), axis=1) / step - 1e-9)
    at_most(float(counts.sum()), MOST_ROWS, "waypoints of a path in such small steps")
    return counts


def in_parts(counts: Vector, at_once: int) -> list[NDArray[np.int64]]:
    """Return numbers of the edges with so many checks each, shape (k,), in parts of about ``at_once`` checks."""
    edges = np.arange(len(counts), dtype=np.int64)
    return np.split(edges, np.flatnonzero(np.diff(counts.cumsum() // at_once)) + 1)


def subdivided(rows: Matrix, counts: Vector) -> tuple[Matrix, Vector]:
    """Cut edge i of a polyline, shape (k, n), into ``counts[i]`` equal parts; also the edge number of every point."""
    points = [rows[:1]]
    edges = [np.zeros(1, dtype=np.int64)]

    for i, count in enumerate(np.maximum(counts, 1.0).astype(np.int64)):
        shares = (np.arange(1, count + 1) / count)[:, None]
        points.append((1.0 - shares) * rows[i] + shares * rows[i + 1])
        edges.append(np.full(count, i, dtype=np.int64))

    return np.vstack(points), np.concatenate(edges)
