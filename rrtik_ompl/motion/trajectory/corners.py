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
LOOKED_AT = 64  # waypoints at once, for the next one that is kept


def vertices(waypoints: Matrix) -> Matrix:
    """The waypoints between which a path is straight, to 1e-10: those that coincide or lie on a line are left out."""
    rows = waypoints[spaced(waypoints, COINCIDENCE)]
    if len(rows) < 3:
        return rows

    kept = np.ones(len(rows), dtype=bool)
    kept[1:-1] = ~_between(rows[:-2], rows[1:-1], rows[2:])

    ends = np.flatnonzero(kept)
    for a, b in pairwise(ends):
        if b > a + 1:
            kept[a + 1 : b] = _bends(rows[a : b + 1])
    return rows[kept]


def spaced(rows: Matrix, apart: float) -> NDArray[np.int64]:
    """Numbers of the rows that are farther than ``apart`` from the last one kept; the last row always, shape (m,)."""
    steps = np.linalg.norm(rows[1:] - rows[:-1], axis=1)
    if (steps > apart).all():
        return np.arange(len(rows))

    kept = [0]
    at = 1
    while at < len(rows):
        ahead = np.linalg.norm(rows[at : at + LOOKED_AT] - rows[kept[-1]], axis=1) > apart
        if ahead.any():
            at += int(ahead.argmax())
            kept.append(at)
            at += 1
        else:
            at += LOOKED_AT

    last = len(rows) - 1
    if len(kept) > 1 or np.linalg.norm(rows[-1] - rows[0]) > apart:
        if len(kept) > 1 and kept[-1] != last:  # too near to the last row, which takes its place
            kept.pop()
        kept.append(last)
    return np.unique(kept)


def _between(a: Matrix, b: Matrix, c: Matrix) -> NDArray[np.bool_]:
    """Whether each point b lies on the line from a to c, between them; shape (m, n) each."""
    chord = c - a
    ahead = b - a
    length = np.linalg.norm(chord, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (ahead * chord).sum(axis=1) / length**2
        apart = np.linalg.norm(ahead - share[:, None] * chord, axis=1)
    found: NDArray[np.bool_] = (length > COINCIDENCE) & (apart <= COINCIDENCE) & (share > 0.0) & (share < 1.0)
    return found


def _bends(rows: Matrix) -> NDArray[np.bool_]:
    """Which inner rows are vertices, shape (k - 2,): halves at the farthest row until all lie on lines."""
    kept = np.zeros(len(rows), dtype=bool)
    open_parts = [(0, len(rows) - 1)]
    while open_parts:
        a, b = open_parts.pop()
        if b <= a + 1:
            continue

        chord = rows[b] - rows[a]
        ahead = rows[a + 1 : b] - rows[a]
        length = float(np.linalg.norm(chord))
        share = ahead @ chord / length**2
        apart = np.linalg.norm(ahead - share[:, None] * chord, axis=1)
        if apart.max() > COINCIDENCE or not (np.diff(share, prepend=0.0, append=1.0) > 0.0).all():
            middle = a + 1 + int(apart.argmax())
            kept[middle] = True
            open_parts += [(a, middle), (middle, b)]

    inner: NDArray[np.bool_] = kept[1:-1]
    return inner


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
