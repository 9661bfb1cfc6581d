"""Splits a path into stops and blended segments for time parameterisation.

The idea of rounding corners is that of [20]; the curves here are quintics.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.world import World

COINCIDENCE = 1e-10  # [rad] or [m]; waypoints closer to the last one, or to a straight line, are left out
CURVE_LENGTH_RATIO = 2.5  # length of a rounded corner's parameter over its distance to the corner, see _corner
MIN_CORNER_COSINE = -0.98  # between the directions before and after; a corner with a smaller one is not rounded
MAX_HALVINGS = 7  # of a rounded corner that touches something, before it is left sharp


class Curve(NamedTuple):
    """A smooth run through rounded corners: quintics by their control points.

    Attributes:
        lengths: Length of the parameter of each piece, shape (m,); the speed is 1 at the ends of every piece.
        points: Control points of each piece, shape (m, 6, n).
    """

    lengths: Vector
    points: NDArray[np.float64]


def vertices(waypoints: Matrix) -> Matrix:
    """The waypoints between which a path is straight, to 1e-10: those that coincide or lie on a line are left out."""
    distinct = [0]
    for k in range(1, len(waypoints)):
        if np.linalg.norm(waypoints[k] - waypoints[distinct[-1]]) > COINCIDENCE:
            distinct.append(k)
    if len(distinct) > 1:
        distinct[-1] = len(waypoints) - 1
    rows, kept = waypoints[distinct], [0]
    for k in range(1, len(rows) - 1):
        if not _on_line(rows[kept[-1] : k + 2]):
            kept.append(k)
    return rows[[*kept, len(rows) - 1]] if len(rows) > 1 else rows


def rounding(corners: Matrix, reach: float, world: World) -> Vector:
    """How far from each inner vertex its corner may be rounded, shape (k - 2,); 0 where the path must stop.

    Args:
        corners: The vertices, shape (k, n).
        reach: Largest distance [rad or m] between a corner and the beginning of its curve.
        world: Checks the curves, by its second check.
    """
    edges = np.diff(corners, axis=0)
    lengths = np.linalg.norm(edges, axis=1)
    along = edges / lengths[:, None]
    cosines = (along[1:] * along[:-1]).sum(axis=1)
    found: Vector = np.minimum(reach, 0.5 * np.minimum(lengths[1:], lengths[:-1]))
    found[cosines < MIN_CORNER_COSINE] = 0.0
    for k in np.flatnonzero(found):
        for _ in range(MAX_HALVINGS):
            if _free(_corner(corners[k : k + 3], found[k]), world):
                break
            found[k] *= 0.5
        else:
            found[k] = 0.0
    return found


def runs(corners: Matrix, rounded: Vector) -> list[Matrix | Curve]:
    """The runs from stop to stop: the two ends of a straight one, shape (2, n), or a curve.

    Args:
        corners: The vertices, shape (k, n).
        rounded: Distance at which each inner one is rounded, shape (k - 2,); 0 for a stop.
    """
    stops = [0, *(np.flatnonzero(rounded == 0.0) + 1).tolist(), len(corners) - 1]
    return [
        corners[[first, last]] if last == first + 1 else _curve(corners[first : last + 1], rounded[first : last - 1])
        for first, last in pairwise(stops)
    ]


def _curve(corners: Matrix, rounded: Vector) -> Curve:
    lengths, points = [], []
    at = corners[0]
    for k, reach in enumerate(rounded):
        corner = _corner(corners[k : k + 3], reach)
        if (gap := float(np.linalg.norm(corner[0] - at))) > COINCIDENCE:
            lengths.append(gap)
            points.append(np.linspace(at, corner[0], 6))
        lengths.append(CURVE_LENGTH_RATIO * float(reach))
        points.append(corner)
        at = corner[-1]
    lengths.append(float(np.linalg.norm(corners[-1] - at)))
    points.append(np.linspace(at, corners[-1], 6))
    return Curve(np.array(lengths), np.array(points))


def _corner(three: Matrix, reach: float) -> Matrix:
    """Control points, shape (6, n), of the quintic that rounds the middle one of three vertices.

    It leaves one edge and meets the other with speed 1 and without curvature; the two middle control points are the
    vertex itself, so the curve lies in the triangle, at most 0.22 of ``reach`` from the path.
    """
    middle = three[1]
    before, after = three[0] - middle, three[2] - middle
    begin, end = (reach * edge / np.linalg.norm(edge) for edge in (before, after))
    return np.array([middle + begin, middle + 0.5 * begin, middle, middle, middle + 0.5 * end, middle + end])


def _free(control: Matrix, world: World) -> bool:
    """Whether the curve of these control points passes the second check."""
    travel = float(np.abs(np.diff(control, axis=0)).sum(axis=0) @ world.weights)
    x = np.linspace(0.0, 1.0, 2 + int(np.ceil(2.0 * travel / world.motion_resolution)))[:, None]
    weights = np.array([1.0, 5.0, 10.0, 10.0, 5.0, 1.0]) * x ** np.arange(6) * (1.0 - x) ** np.arange(5, -1, -1)
    return bool(world.certify(weights @ control).all())


def _on_line(rows: Matrix) -> bool:
    """Whether all points lie between the first and the last, on their line and in this order."""
    chord = rows[-1] - rows[0]
    length = float(np.linalg.norm(chord))
    if length <= COINCIDENCE:
        return False
    shares = (rows - rows[0]) @ chord / length**2
    apart = np.linalg.norm(rows - rows[0] - shares[:, None] * chord, axis=1)
    return bool(apart.max() <= COINCIDENCE and (np.diff(shares) > 0.0).all())
