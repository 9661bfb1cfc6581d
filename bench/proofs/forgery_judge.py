"""Says for certain that a forged certificate proves nothing: by Pinocchio and coal, apart from both checkers.

It does not verify. It finds a witness: a plane that does not separate its parts at an end of its interval, a time and
two parts that no entry, ball or box shows apart, or a configuration of the path in which coal measures too little.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache, cached_property
from itertools import chain, product
from math import factorial
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.geometry.collision.certificate import Certificate as ByCoal
from rrtik_ompl.geometry.collision.elements import NamedBody, named_bodies
from rrtik_ompl.model.certificate import Route
from rrtik_ompl.model.goal_kind import TaskRegion
from rrtik_ompl.model.scene import pose_at
from rrtik_ompl.world.world import World

CERTAIN = 1e-7  # [m] by which a witness has to be wrong
SAMPLES = 60  # configurations of a motion that coal looks at
SHORTEST_LEVEL = 10  # down to which intervals are tried
MOVING_STEP = 6  # of these samples one in so many where obstacles move
FREE_ANGLES = 721  # values of a free angle that are tried
TRIES = 4  # places and pairs of parts that are looked at for a witness
Document = dict[str, Any]


class Tree:
    """The parts of a body as a certificate's cuts make them: points of each node, and its way to the whole body."""

    def __init__(self, named: NamedBody, cuts: list[list[Any]]) -> None:
        elements = named.elements
        half = np.zeros((len(elements.points), 3)) if elements.half is None else elements.half
        signs = np.array(list(product((-1.0, 1.0), repeat=3)))
        corners = elements.points[:, :, None] + half[:, None, None] * signs
        self.corners = corners.reshape(len(half), -1, 3) if elements.half is not None else elements.points
        self.around = elements.radius * np.ones(3) + elements.disc * np.array([1.0, 1.0, 0.0])
        self.radius, self.disc = elements.radius, elements.disc
        self.box = cache(self._box)
        self.ball = cache(self._ball)
        self.members = [np.arange(len(self.corners))]
        self.parents = [-1]
        for node, axis, coordinate in cuts:
            own = self.members[node]
            values = self.corners[own][:, :, axis]
            below = 0.5 * (values.min(axis=1) + values.max(axis=1)) < coordinate
            self.members += [own[below], own[~below]]
            self.parents += [node, node]

    @cached_property
    def leaves(self) -> list[int]:
        """Return the nodes that are not divided and not empty."""
        return [k for k in range(len(self.members)) if k not in self.parents and len(self.members[k])]

    def way_up(self, node: int) -> list[int]:
        """Return a node and all those that it is a part of."""
        way = [node]
        while self.parents[way[-1]] >= 0:
            way.append(self.parents[way[-1]])
        return way

    def points(self, node: int) -> Matrix:
        """Return the points of a node's elements, shape (n, 3)."""
        return np.asarray(self.corners[self.members[node]].reshape(-1, 3))

    def _box(self, node: int) -> tuple[Vector, Vector]:
        points = self.points(node)
        return points.min(axis=0) - self.around, points.max(axis=0) + self.around

    def _ball(self, node: int) -> tuple[Vector, float]:
        low, high = self.box(node)
        centre = 0.5 * (low + high)
        return centre, float(np.linalg.norm(self.points(node) - centre, axis=1).max()) + self.radius + self.disc


class Place(NamedTuple):
    """A configuration, and the time at which it is there [s]."""

    q: Vector
    time: float


def between(route: Route, m: int, shares: Vector) -> Matrix:
    """Return configurations of a motion at shares of it, shape (n,): shape (n, dof)."""
    rows = route.waypoints
    if route.times is None or route.rates is None:
        following = rows[min(m + 1, len(rows) - 1)]
        return np.asarray(rows[m] + shares[:, None] * (following - rows[m]))
    tau = (shares * (route.times[m + 1] - route.times[m]))[:, None]
    terms = [rate * tau**order / factorial(order) for order, rate in enumerate(route.rates[m], 1)]
    return np.asarray(rows[m] + sum(terms))


class Judge:
    """Looks for witnesses against documents that are about one world, and motions with the times of one.

    Args:
        world: The world.
        route: A motion with these times.
        obstacles_alone: Whether coal compares pairs with an obstacle alone.
    """

    def __init__(self, world: World, route: Route, *, obstacles_alone: bool = False) -> None:
        self.world = world
        kinds = [body.kind for body in world.bodies]
        chosen = [pair for pair in world.pairs if not obstacles_alone or "obstacle" in (kinds[pair[0]], kinds[pair[1]])]
        self._pairs = tuple(chosen)
        self.named = named_bodies(world.bodies)
        moving = [each for each in world.scene.obstacles if route.moving and each.motion is not None]
        self._moving = {each.name: each for each in moving}
        self._times = route.times
        self.joints = [each.body.joint for each in self.named]
        self._data = world.robot.model.createData()
        self._trees: dict[str, Tree] = {}

    @cached_property
    def _coal(self) -> ByCoal:
        return ByCoal(self.world.robot, self.world.bodies, self._pairs)

    def touches(self, route: Route) -> bool:
        """Return whether coal finds less than the required distance somewhere along a motion."""
        count = max(1, len(route.waypoints) - 1)
        shares = np.linspace(0.0, 1.0, SAMPLES)
        if not self._moving:
            some = (row[None] for row in route.waypoints)  # what touches much does so at a waypoint
            rows = chain(some, (between(route, m, shares) for m in range(count)))
            return any(not self._coal.free(each).all() for each in rows)
        return any(self._touches_at(route, m, share) for m in range(count) for share in shares[::MOVING_STEP])

    def _touches_at(self, route: Route, m: int, share: float) -> bool:
        time = self._time(m, share)
        bodies = tuple(self._carried(body, time) for body in self.world.bodies)
        return not ByCoal(self.world.robot, bodies, self._pairs).free(between(route, m, np.array([share]))).all()

    def _carried(self, body: Body, time: float) -> Body:
        """Return a body where it is at a time, if it is of an obstacle that moves."""
        if body.kind != "obstacle" or body.name not in self._moving:
            return body
        return replace(body, placement=pose_at(self._moving[body.name], time) * body.within)

    def _time(self, m: int, share: float) -> float:
        return 0.0 if self._times is None else float(self._times[m] + share * (self._times[m + 1] - self._times[m]))

    def _pose(self, k: int, base: int, place: Place) -> pin.SE3:
        """Return the pose of a body in the frame of a joint, by Pinocchio."""
        robot = self.world.robot
        pin.forwardKinematics(robot.model, self._data, robot.pinocchio_configuration(place.q[None])[0])
        body = self._carried(self.named[k].body, place.time)
        return self._data.oMi[base].actInv(self._data.oMi[self.joints[k]]) * body.placement

    def _base(self, i: int, j: int) -> int:
        parents = self.world.robot.model.parents
        a, b = self.joints[i], self.joints[j]
        while a != b:
            a, b = (int(parents[a]), b) if a > b else (a, int(parents[b]))
        return int(a)

    def trees(self, document: Document) -> list[Tree]:
        """Return the parts of all bodies; those of cuts that were seen before are kept."""
        found = []
        for k, body in enumerate(document["bodies"]):
            key = f"{k} {body.get('cuts')}"
            if key not in self._trees:
                self._trees[key] = Tree(self.named[k], body.get("cuts", []))
            found.append(self._trees[key])
        return found

    # --- witnesses against entries ---

    def wrong_plane(self, document: Document, m: int, entry: list[Any]) -> bool:
        """Return whether the plane of an entry does not separate its parts at an end of its interval."""
        i, a, j, b, level, number = entry[:6]
        trees = self.trees(document)
        normal = np.array(entry[6:9]) / np.linalg.norm(entry[6:9])
        base = self._base(i, j)
        low, high = np.inf, -np.inf
        for share in (number * 0.5**level, (number + 1) * 0.5**level):
            q = self._at(document, m, share)
            low = min(low, -self._reach(trees[i], a, self._pose(i, base, q), -normal))
            high = max(high, self._reach(trees[j], b, self._pose(j, base, q), normal))
        return bool(low - high < -CERTAIN)

    def _at(self, document: Document, m: int, share: float) -> Place:
        times, rates = (np.array(document[name]) if name in document else None for name in ("times", "rates"))
        route = Route(np.array(document["waypoints"]), times, rates)
        return Place(between(route, m, np.array([share]))[0], self._time(m, share))

    @staticmethod
    def _reach(tree: Tree, node: int, pose: pin.SE3, direction: Vector) -> float:
        own = pose.rotation.T @ direction
        sine = float(np.hypot(own[0], own[1]))
        height = float((tree.points(node) @ own).max()) + float(direction @ pose.translation)
        return height + tree.radius + tree.disc * sine

    def incomplete(self, document: Document, m: int, i: int, j: int, rng: np.random.Generator) -> bool:
        """Return whether two parts of a pair, at some time of a motion, are shown apart by nothing at all."""
        if "half_space" in (self.named[i].elements.key, self.named[j].elements.key):
            return False
        trees = self.trees(document)
        rows = [row for row in document["motions"][m] if (row[0], row[2 if len(row) > 4 else 1]) == (i, j)]
        for _ in range(TRIES):
            time = (2 * int(rng.integers(1 << 20)) + 1) / (1 << 21)
            open_pairs = self._unshown(trees, rows, i, j, time)
            if len(open_pairs) == 0:
                continue
            a, b = open_pairs[int(rng.integers(len(open_pairs)))]
            pairs = [(x, y) for x in trees[i].way_up(a) for y in trees[j].way_up(b)]
            intervals = [(level, int(time * 2**level)) for level in range(SHORTEST_LEVEL + 1)]
            tests = product(pairs, intervals)
            if not any(self._by_balls(document, m, (i, j), nodes, interval) for nodes, interval in tests):
                return True
        return False

    def _unshown(self, trees: list[Tree], rows: list[list[Any]], i: int, j: int, time: float) -> list[tuple[int, int]]:
        """Return the pairs of leaves that no entry is about at a time."""
        if any(len(row) == 4 and row[3] <= time * 2 ** row[2] <= row[3] + 1 for row in rows):
            return []
        there = {(row[1], row[3]) for row in rows if len(row) > 4 and row[5] <= time * 2 ** row[4] <= row[5] + 1}
        return [
            (a, b)
            for a, b in product(trees[i].leaves, trees[j].leaves)
            if not there & set(product(trees[i].way_up(a), trees[j].way_up(b)))
        ]

    def _by_balls(
        self, document: Document, m: int, bodies: tuple[int, int], nodes: tuple[int, int], interval: tuple[int, int]
    ) -> bool:
        """Return whether balls or boxes may show two parts apart on an interval: their gap is greater than 0."""
        (i, j), (a, b), (level, number) = bodies, nodes, interval
        trees = self.trees(document)
        base = self._base(i, j)
        ends = [self._at(document, m, (number + k) * 0.5**level) for k in (0, 1)]
        (one, radius), (other, other_radius) = trees[i].ball(a), trees[j].ball(b)
        p, q = (self._pose(i, base, end).act(one) for end in ends)
        places = [self._pose(j, base, end) for end in ends]
        c, d = (place.act(other) for place in places)
        if self.joints[j] != base or self.named[j].body.name in self._moving:
            half_chords = 0.5 * (np.linalg.norm(q - p) + np.linalg.norm(d - c))
            return bool(0.5 * np.linalg.norm(p + q - c - d) - half_chords > radius + other_radius)
        chord = q - p
        share = np.clip((c - p) @ chord / max(1e-30, float(chord @ chord)), 0.0, 1.0)
        low, high = trees[j].box(b)
        p, q = places[0].actInv(p), places[0].actInv(q)
        beyond = np.maximum(0.0, np.minimum(p, q) - high) + np.maximum(0.0, low - np.maximum(p, q))
        start = places[0].act(p)
        by_ball = float(np.linalg.norm(start + share * chord - c)) - other_radius
        return max(by_ball, float(np.linalg.norm(beyond))) > radius


def outside(region: TaskRegion, poses: Sequence[pin.SE3]) -> tuple[float, float]:
    """Return how far a frame is outside of the bounds of a region at most, without its tolerances [m; rad].

    Args:
        region: The region, placed in the world.
        poses: Poses of the frame in the world.
    """
    seen = [region.T_world_w.actInv(pose) * region.T_w_tip.inverse() for pose in poses]
    points = np.array([pose.translation for pose in seen])
    low, high = region.bounds[:3].T
    metres = float(np.linalg.norm(points - np.clip(points, low, high), axis=1).max())

    ranges = region.bounds[3:]
    full = ranges[:, 1] - ranges[:, 0] >= 2.0 * np.pi - 1e-9
    turns = Rotation.from_matrix(np.array([pose.rotation for pose in seen]))
    if full.all():
        return metres, 0.0
    wanted = Rotation.from_euler("xyz", np.where(full, 0.0, ranges[:, 0]))
    if (ranges[:, 0] == ranges[:, 1]).all():
        return metres, float((wanted.inv() * turns).magnitude().max())
    if full.sum() == 1 and ((ranges[:, 0] == ranges[:, 1]) | full).all():
        # The nearest of the orientations that the free angle gives, of many.
        free = np.linspace(-np.pi, np.pi, FREE_ANGLES)
        angles = np.where(full, free[:, None], ranges[:, 0])
        way = [(Rotation.from_euler("xyz", angles).inv() * turn).magnitude().min() for turn in turns]
        return metres, float(max(way))
    angles = turns.as_euler("xyz")
    middle = ranges.mean(axis=1)
    away = np.abs((angles - middle + np.pi) % (2.0 * np.pi) - np.pi) - 0.5 * (ranges[:, 1] - ranges[:, 0])
    return metres, float(np.maximum(away, 0.0).sum(axis=1).max())


def entries_of(document: Document) -> Iterator[tuple[int, int]]:
    """Yield motion and number of each entry of a document."""
    for m, rows in enumerate(document["motions"]):
        yield from ((m, k) for k in range(len(rows)))
