"""Points and discs among polygons: exact checks, sampled routes, and the shortest route of the same class.

Two routes are of one class if one can be moved into the other without crossing an obstacle. The class is told by the
word of the upward rays that a route crosses, one ray from inside each obstacle, with neighbours that cancel removed.
The shortest route is a way through the corners of the grown obstacles; Dijkstra's search runs on corner and word.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.world.motion_queries import MotionQueries

Array: TypeAlias = NDArray[Any]
Word: TypeAlias = tuple[int, ...]
Roads: TypeAlias = list[list[tuple[int, float, Word]]]
Tree: TypeAlias = tuple[list[Array], list[int]]

TOUCH = 1e-7  # obstacles are closed: nearer than this is a collision
ARC = np.deg2rad(5.0)  # steps of the arcs around corners


@dataclass(eq=False)
class Plane(MotionQueries):
    """A disc (radius 0 for a point) in a box among polygons; straight motions are judged exactly and counted."""

    name: str
    polygons: list[Array]
    size: tuple[float, float]
    start: Array
    goal: Array
    radius: float = 0.0
    shortest: dict[Word, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.first = np.vstack(self.polygons)
        self.second = np.vstack([np.roll(p, -1, axis=0) for p in self.polygons])
        rng = np.random.default_rng(0)
        self.inside = np.array([_inner_point(p, rng) for p in self.polygons])

    def motion_valid_batch(self, A: Array, B: Array) -> Array:
        """Which straight motions are free, shapes (m, 2) and (m,)."""
        free = [self._free(A[k : k + 2000], B[k : k + 2000]) for k in range(0, len(A), 2000)]
        return np.concatenate([np.zeros(0, dtype=bool), *free])

    def _free(self, A: Array, B: Array) -> Array:
        within = np.all((np.minimum(A, B) >= 0.0) & (np.maximum(A, B) <= self.size), axis=1)
        a, b, c, d = A[:, None], B[:, None], self.first, self.second
        crossing = (_side(a, b, c) * _side(a, b, d) < 0.0) & (_side(c, d, a) * _side(c, d, b) < 0.0)
        ends = (_to_segment(a, c, d), _to_segment(b, c, d), _to_segment(c, a, b), _to_segment(d, a, b))
        near = np.minimum.reduce(ends)
        clear = ~(crossing | (near <= self.radius + TOUCH)).any(axis=1)
        return np.asarray(within & clear & ~np.any([_contains(p, A) for p in self.polygons], axis=0))

    def free(self, a: Array, b: Array) -> bool:
        """Whether one straight motion is free."""
        return bool(self._free(a[None], b[None])[0])

    def word(self, route: Array) -> Word:
        """The class of a route."""
        found: Word = ()
        for a, b in pairwise(route):
            found = _reduced(found, self._crossings(a, b))
        return found

    def _crossings(self, a: Array, b: Array) -> Word:
        x, y = self.inside[:, 0], self.inside[:, 1]
        if a[0] == b[0]:
            return ()
        share = (x - a[0]) / (b[0] - a[0])
        hit = np.flatnonzero(((a[0] < x) != (b[0] < x)) & (a[1] + share * (b[1] - a[1]) > y))
        sign = 1 if b[0] > a[0] else -1
        return tuple(sign * (int(k) + 1) for k in hit[np.argsort(share[hit])])

    def class_optimum(self, route: Array) -> float:
        """Length of the shortest route of the same class."""
        word = self.word(route)
        if word not in self.shortest:
            self.shortest[word] = self._search(word, float(np.linalg.norm(np.diff(route, axis=0), axis=1).sum()))
        return self.shortest[word]

    def _search(self, word: Word, longest: float) -> float:
        roads = self._roads()
        queue: list[tuple[float, int, Word]] = [(0.0, 0, ())]
        settled: set[tuple[int, Word]] = set()
        while queue:
            length, here, so_far = heapq.heappop(queue)
            if (here, so_far) in settled:
                continue
            settled.add((here, so_far))
            if here == 1 and so_far == word:
                return length
            for there, way, crossed in roads[here]:
                after = _reduced(so_far, crossed) if crossed else so_far
                if length + way <= longest + 1e-6 and len(after) <= len(word) + 2 and (there, after) not in settled:
                    heapq.heappush(queue, (length + way, there, after))
        raise RuntimeError(f"{self.name}: no route of the class {word}")

    def connected(self) -> bool:
        """Whether there is a route at all."""
        roads, reached, open_ = self._roads(), {0}, [0]
        while open_:
            for there, _, _ in roads[open_.pop()]:
                if there not in reached:
                    reached.add(there)
                    open_.append(there)
        return 1 in reached

    def _roads(self) -> Roads:
        """For the start, the goal and every corner: what it sees, how far it is, which rays the way crosses."""
        if not hasattr(self, "_known_roads"):
            corners = np.vstack([self.start, self.goal, *(_grown(p, self.radius + 2.0 * TOUCH) for p in self.polygons)])
            corners = corners[self.motion_valid_batch(corners, corners)]
            i, j = np.triu_indices(len(corners), 1)
            seen = self.motion_valid_batch(corners[i], corners[j])
            roads: Roads = [[] for _ in corners]
            for a, b in zip(i[seen].tolist(), j[seen].tolist(), strict=True):
                way = float(np.linalg.norm(corners[b] - corners[a]))
                roads[a].append((b, way, self._crossings(corners[a], corners[b])))
                roads[b].append((a, way, self._crossings(corners[b], corners[a])))
            self._known_roads = roads
        return self._known_roads


def _reduced(word: Word, more: Word) -> Word:
    letters = list(word)
    for letter in more:
        if letters and letters[-1] == -letter:
            letters.pop()
        else:
            letters.append(letter)
    return tuple(letters)


def _side(a: Array, b: Array, p: Array) -> Array:
    way, off = b - a, p - a
    return np.asarray(way[..., 0] * off[..., 1] - way[..., 1] * off[..., 0])


def _to_segment(p: Array, a: Array, b: Array) -> Array:
    way = b - a
    share = np.clip(((p - a) * way).sum(axis=-1) / np.maximum((way * way).sum(axis=-1), 1e-300), 0.0, 1.0)
    return np.asarray(np.linalg.norm(p - a - share[..., None] * way, axis=-1))


def _contains(polygon: Array, points: Array) -> Array:
    a, b = polygon, np.roll(polygon, -1, axis=0)
    x, y = points[:, None, 0], points[:, None, 1]
    spans = (a[:, 1] > y) != (b[:, 1] > y)
    height = np.where(b[:, 1] == a[:, 1], 1.0, b[:, 1] - a[:, 1])
    left = x < a[:, 0] + (y - a[:, 1]) / height * (b[:, 0] - a[:, 0])
    return np.asarray((spans & left).sum(axis=1) % 2 == 1)


def _inner_point(polygon: Array, rng: np.random.Generator) -> Array:
    points = rng.uniform(polygon.min(axis=0), polygon.max(axis=0), (1000, 2))
    return np.asarray(points[_contains(polygon, points)][0])


def _grown(polygon: Array, radius: float) -> Array:
    """Corners of a polygon around all points nearer than ``radius``; arcs become polylines outside them."""
    ways = np.roll(polygon, -1, axis=0) - polygon
    if _side(polygon, np.roll(polygon, -1, axis=0), np.roll(polygon, -2, axis=0)).sum() < 0.0:
        return _grown(polygon[::-1], radius)
    angles = np.arctan2(-ways[:, 0], ways[:, 1])  # of the outward normals
    found = []
    for k, corner in enumerate(polygon):
        turn = (angles[k] - angles[k - 1] + np.pi) % (2.0 * np.pi) - np.pi
        if turn <= 0.0:
            continue  # no shortest route bends there
        steps = max(1, int(np.ceil(turn / (ARC if radius > 0.01 else np.pi / 4))))
        middles = angles[k - 1] + turn * (np.arange(steps) + 0.5) / steps
        found += [corner + radius / np.cos(0.5 * turn / steps) * np.array([np.cos(m), np.sin(m)]) for m in middles]
    return np.array(found)


def sampled_route(plane: Plane, seed: int, step: float = 1.0) -> Array:
    """A route of RRT-Connect that goes on in steps of ``step``."""
    rng = np.random.default_rng(seed)
    trees = [([plane.start], [-1]), ([plane.goal], [-1])]
    for number in range(100_000):
        mine, other = trees[number % 2], trees[1 - number % 2]
        _, new = _grow(plane, mine, rng.uniform((0.0, 0.0), plane.size), step, once=True)
        if new < 0:
            continue
        met, last = _grow(plane, other, mine[0][new], step, once=False)
        if met:
            ends = _way_back(mine, new), _way_back(other, last)
            first, second = ends if number % 2 == 0 else ends[::-1]
            return np.array([*first[::-1], *second[1:]])
    raise RuntimeError(f"{plane.name}: no route")


def _grow(plane: Plane, tree: Tree, target: Array, step: float, *, once: bool) -> tuple[bool, int]:
    nodes, parents = tree
    here = int(np.argmin(np.linalg.norm(np.array(nodes) - target, axis=1)))
    newest = -1
    while True:
        way = target - nodes[here]
        distance = float(np.linalg.norm(way))
        point = target if distance <= step else nodes[here] + step / distance * way
        if distance == 0.0 or not plane.free(nodes[here], point):
            return distance == 0.0, newest
        nodes.append(point)
        parents.append(here)
        here = newest = len(nodes) - 1
        if once or distance <= step:
            return distance <= step, newest


def _way_back(tree: Tree, node: int) -> list[Array]:
    nodes, parents = tree
    found = []
    while node >= 0:
        found.append(nodes[node])
        node = parents[node]
    return found


def _plane(
    name: str, polygons: list[Any], size: tuple[float, float], start: Any, goal: Any, radius: float = 0.0
) -> Plane:
    shapes = [np.array(p, dtype=float) for p in polygons]
    return Plane(name, shapes, size, np.array(start, dtype=float), np.array(goal, dtype=float), radius)


WALLS = [[(6, 0), (8, 0), (8, 8), (6, 8)], [(6, 11), (8, 11), (8, 20), (6, 20)], [(13, 4), (17, 6), (15, 12), (12, 10)]]
WALLS.append([(19, 0), (21, 0), (21, 14), (19, 14)])
PUBLISHED: dict[str, Callable[[], Plane]] = {
    "three polygons": lambda: _plane(
        "three polygons",
        [[(6, -5), (9, -5), (9, 11), (6, 11)], [(13, 7), (16, 7), (16, 25), (13, 25)], [(18, 2), (22, 5), (19, 9)]],
        (26.0, 20.0),
        (2, 3),
        (24, 16),
    ),
    "two Ls": lambda: _plane(
        "two Ls",
        [
            [(5, 5), (7, 5), (7, 14), (14, 14), (14, 16), (5, 16)],
            [(11, 2), (20, 2), (20, 11), (18, 11), (18, 4), (11, 4)],
        ],
        (25.0, 20.0),
        (10, 10),
        (22, 3),
    ),
    "disc robot": lambda: _plane("disc robot", WALLS, (26.0, 20.0), (2, 2), (24, 3), 0.7),
}


def generated(seed: int) -> Plane:
    """A world of 5 to 8 convex polygons; every second one has a disc of radius 0.4 for a robot."""
    rng = np.random.default_rng(1000 + seed)
    start, goal, radius = np.array([1.5, 10.0]), np.array([24.5, 10.0]), 0.4 * (seed % 2)
    polygons: list[Array] = []
    while len(polygons) < 5 + seed % 4:
        angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, rng.integers(3, 7)))
        gaps = np.diff(np.append(angles, angles[0] + 2.0 * np.pi))
        centre, reach = rng.uniform((4.0, 2.0), (22.0, 18.0)), rng.uniform(1.5, 4.0)
        shape = centre + reach * np.column_stack([np.cos(angles), np.sin(angles)])
        alone = all(np.linalg.norm(centre - p.mean(axis=0)) > reach + 1.5 for p in polygons)
        alone &= bool(min(np.linalg.norm(centre - end) for end in (start, goal)) > reach + radius + 0.5)
        if gaps.max() < 2.5 and gaps.min() > 0.4 and alone:
            polygons.append(shape)
    plane = Plane(f"generated {seed}", polygons, (26.0, 20.0), start, goal, radius)
    return plane if plane.connected() else generated(seed + 1000)
