"""Planar arms among discs and rectangles: exact turns of one joint, and the fewest of them on a fine grid.

Everything is plane geometry of its own, apart from the checks of a world. A link is a segment with a radius. When one
joint turns, the links after it turn about its place as one piece, so a collision begins or ends where a point that
moves on a circle comes as near to a segment as a radius: such angles are the roots of quadratic equations.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[Any]

ROUNDING = 1e-9  # [m] of a distance


@dataclass(frozen=True, eq=False)
class PlaneArm:
    """An arm of revolute joints, each from -pi to pi, among closed obstacles.

    Attributes:
        lengths: Of the links, base first [m], shape (n,).
        radius: Of the links [m].
        discs: Rows of x, y, radius [m], shape (d, 3).
        polygons: Convex ones, shape (p, corners, 2) [m], counterclockwise.
    """

    lengths: Array
    radius: float
    discs: Array
    polygons: Array

    def places(self, rows: Array) -> Array:
        """Where the joints and the tip are at configurations, shape (m, n) or of the first joints."""
        angles = np.cumsum(rows, axis=1)
        ways = self.lengths[: rows.shape[1], None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        return np.concatenate([np.zeros((len(rows), 1, 2)), np.cumsum(ways, axis=1)], axis=1)

    def room(self, rows: Array) -> Array:
        """How far the links stay from the obstacles at configurations, shape (m, n): at most 0 in a collision [m]."""
        places = self.places(rows)
        links = [self.link_room(places[:, k], places[:, k + 1]) for k in range(len(self.lengths))]
        return np.asarray(np.minimum.reduce(links))

    def link_room(self, a: Array, b: Array) -> Array:
        """How far links stay from the obstacles, their ends of shape (m, 2) [m]."""
        least = np.full(len(a), np.inf)
        for x, y, r in self.discs:
            least = np.minimum(least, to_segment(np.array([x, y]), a, b) - r - self.radius)
        for polygon in self.polygons:
            least = np.minimum(least, _to_polygon(a, b, polygon) - self.radius)
        return least

    def turns(self, base: Array, joint: int) -> tuple[Array, Array]:
        """At which values of a joint something begins or ceases to collide, the other joints as in rows, shape (m, n).

        Returns:
            Numbers of the rows and values of the joint from -pi to pi, shapes (k,).
        """
        straight = base.copy()
        straight[:, joint] = 0.0
        places = self.places(straight)
        hub = places[:, joint]
        found: list[tuple[Array, Array]] = []
        for k in range(joint, len(self.lengths)):
            a, b = places[:, k] - hub, places[:, k + 1] - hub
            for x, y, r in self.discs:  # as seen from the arm, the obstacle turns the other way
                found.append(_meetings(np.array([x, y]) - hub, a, b, r + self.radius, -1.0))
            for polygon in self.polygons:
                for c, d in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
                    found.append(_meetings(c - hub, a, b, self.radius, -1.0))
                    found.append(_meetings(b, c - hub, d - hub, self.radius, 1.0))
        return np.concatenate([n for n, _ in found]), np.concatenate([v for _, v in found])

    def free(self, route: Array) -> bool:
        """Whether a route of single-joint moves, shape (k, n), is free."""
        if (self.room(route) <= 0.0).any():
            return False
        for a, b in pairwise(route):
            for joint in np.flatnonzero(a != b):
                _, values = self.turns(a[None], int(joint))
                low, high = sorted((a[joint], b[joint]))
                if ((values >= low) & (values <= high)).any():
                    return False
        return True


class PlaneGrid:
    """All configurations of a fine grid, and how many turns of one joint they are from one of them.

    Args:
        arm: The arm.
        values: For each joint, ascending.
    """

    def __init__(self, arm: PlaneArm, values: list[Array]) -> None:
        self.values = values
        shape = tuple(len(v) for v in values)
        self.room = np.full(shape, np.inf)
        for k in range(len(values)):  # a link knows nothing of the joints after it
            places = arm.places(_all_of(values[: k + 1]))
            room = arm.link_room(places[:, k], places[:, k + 1]).reshape(shape[: k + 1])
            self.room = np.minimum(self.room, room[(..., *(None,) * (len(values) - 1 - k))])
        self._runs = [self._runs_of(arm, joint) for joint in range(len(values))]

    def _runs_of(self, arm: PlaneArm, joint: int) -> Array:
        """The number of the free run along a joint that each configuration is in; each colliding one is alone."""
        own, others = self.values[joint], [v for k, v in enumerate(self.values) if k != joint]
        lines = _all_of(others)
        numbers, turns = arm.turns(np.insert(lines, joint, 0.0, axis=1), joint)
        cut = np.zeros((len(lines), len(own) + 1), dtype=bool)  # before each value, and after the last
        cut[numbers, np.searchsorted(own, turns)] = True
        cut[:, 0] = True
        hit = np.moveaxis(self.room <= 0.0, joint, -1).reshape(len(lines), len(own))
        cut[:, :-1] |= hit
        cut[:, 1:] |= hit
        runs = np.cumsum(cut[:, :-1].ravel()).reshape([len(v) for v in others] + [len(own)])
        return np.moveaxis(runs, -1, joint)

    def index(self, q: Array) -> tuple[int, ...]:
        """The place of a configuration of the grid, shape (n,)."""
        return tuple(int(np.searchsorted(v, x)) for v, x in zip(self.values, q, strict=True))

    def moves_from(self, q: Array) -> Array:
        """How many moves each configuration is from one of them, shape (n,); -1 where there is no way."""
        moves = np.full(self.room.shape, -1, dtype=np.int16)
        moves[self.index(q)] = 0
        level, fresh = 0, moves == 0
        while fresh.any():
            level += 1
            reached = np.zeros(self.room.shape, dtype=bool)
            for runs in self._runs:
                met = np.zeros(self.room.size + 2, dtype=bool)
                met[runs[fresh]] = True
                reached |= met[runs]
            fresh = reached & (moves < 0)
            moves[fresh] = level
        return moves


def _all_of(values: list[Array]) -> Array:
    """All rows that take one of the values in each column."""
    return np.stack([axis.ravel() for axis in np.meshgrid(*values, indexing="ij")], axis=1)


def to_segment(p: Array, a: Array, b: Array) -> Array:
    """Distances of points from segments, shapes that broadcast to (m, 2): shape (m,)."""
    x, y = (b - a)[..., 0], (b - a)[..., 1]  # sums over an axis of two are slow
    u, v = (p - a)[..., 0], (p - a)[..., 1]
    share = np.clip((u * x + v * y) / np.maximum(x * x + y * y, 1e-300), 0.0, 1.0)
    return np.asarray(np.hypot(u - share * x, v - share * y))


def _to_polygon(a: Array, b: Array, polygon: Array) -> Array:
    """Distances of segments from a convex polygon, shape (m,); 0 where they meet."""
    least, inside = np.full(len(a), np.inf), np.ones(len(a), dtype=bool)
    for c, d in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        ends = to_segment(a, c, d), to_segment(b, c, d), to_segment(c, a, b), to_segment(d, a, b)
        crossing = (_side(a, b, c) * _side(a, b, d) < 0.0) & (_side(c, d, a) * _side(c, d, b) < 0.0)
        least = np.where(crossing, 0.0, np.minimum.reduce([least, *ends]))
        inside &= _side(c, d, a) >= 0.0
    return np.where(inside, 0.0, least)


def _side(a: Array, b: Array, p: Array) -> Array:
    way, off = b - a, p - a
    return np.asarray(way[..., 0] * off[..., 1] - way[..., 1] * off[..., 0])


def _meetings(p: Array, a: Array, b: Array, reach: float, sense: float) -> tuple[Array, Array]:
    """Turns of points about the origin after which they are as far from segments as a reach.

    Args:
        p: Points, shape (m, 2).
        a: Beginnings of the segments, of a shape that broadcasts to (m, 2).
        b: Their ends, likewise.
        reach: The distance wanted [m].
        sense: 1 if the points turn by the angle, -1 if by its opposite.

    Returns:
        Numbers of the points and angles, shapes (k,).
    """
    a, b = np.broadcast_to(a, p.shape), np.broadcast_to(b, p.shape)
    far = np.linalg.norm(p, axis=1)
    way = (b - a) / np.linalg.norm(b - a, axis=1)[:, None]
    normal = np.stack([-way[:, 1], way[:, 0]], axis=1)
    height = (a * normal).sum(axis=1)
    points = []
    for side in (-reach, reach):  # where the circle crosses the lines beside the segment
        off = height + side
        along = np.sqrt(np.maximum(far**2 - off**2, 0.0))
        points += [off[:, None] * normal + s * along[:, None] * way for s in (-1.0, 1.0)]
    for end in (a, b):  # where it crosses the circles around the ends
        distance = np.maximum(np.linalg.norm(end, axis=1), ROUNDING)
        towards = end / distance[:, None]
        off = (far**2 + distance**2 - reach**2) / (2.0 * distance)
        along = np.sqrt(np.maximum(far**2 - off**2, 0.0))
        aside = np.stack([-towards[:, 1], towards[:, 0]], axis=1)
        points += [off[:, None] * towards + s * along[:, None] * aside for s in (-1.0, 1.0)]
    spots = np.stack(points)  # (8, m, 2)
    true = np.abs(to_segment(spots, a, b) - reach) <= ROUNDING
    true &= np.abs(np.linalg.norm(spots, axis=-1) - far) <= ROUNDING
    _, numbers = np.nonzero(true)
    turned = np.arctan2(spots[..., 1], spots[..., 0])[true] - np.arctan2(p[:, 1], p[:, 0])[numbers]
    return numbers, (sense * turned + np.pi) % (2.0 * np.pi) - np.pi
