"""A judge of runs: what touches in a record, at every time of it, by coal and a bound on the motion.

It takes solids and pairs as a new :class:`rrtik_ompl.World` does, puts each where the record has it, and knows nothing
of the worlds in which obstacles are moved while the arm is on its way.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TypeAlias

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.copies import as_value
from rrtik_ompl.base.poses import pose
from rrtik_ompl.geometry.collision.bodies import Body, Pairs, colliding_pairs, in_contact, link_bodies, scene_bodies
from rrtik_ompl.geometry.collision.certificate import distance
from rrtik_ompl.geometry.collision.extent import farthest
from rrtik_ompl.geometry.collision.margins import contact_distance, keeps_clearance, kept_apart
from rrtik_ompl.geometry.collision.motion_bound import approach_weights
from rrtik_ompl.geometry.collision.own_distances import is_ours, own_nearest
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Motion, Obstacle, Scene, TimedPoses, pairs_that_may_touch
from rrtik_ompl.model.shapes import same_shape
from rrtik_ompl.replanning.feed import ROTATION_NOISE, Feed, Snapshot
from rrtik_ompl.replanning.tick import Tick
from rrtik_ompl.world.problem import Problem

FINEST = 2e-5  # [m]: of the motion of a pair, below which its middle stands for it
COARSEST = 2e-3  # [m]: the same where too little is kept there, of which the least is not sought any closer
RELATIVE = 0.1  # of what is lacking: no closer either
ROUNDING = 2e-6  # [m]: of distances and of poses that are computed from times
PARTS = 4  # of a tick, at whose ends a function of time is asked for the truth

Frames: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class RunViolation:
    """Two bodies that are nearer to each other in a run than they may be.

    Attributes:
        time: When most is lacking in the tick [s].
        tick: Number of the tick.
        event: Of the tick.
        first, second: Names of the two.
        distance: Between them [m]; below 0 how deep they overlap, as far as that is known of their shapes.
        kept: What had to be kept [m]: 0 (below it for a contact that the scene names), or margins and clearance where
            the move is called proven.
        proven: Whether the record calls the move proven.
    """

    time: float
    tick: int
    event: str
    first: str
    second: str
    distance: float
    kept: float
    proven: bool

    __reduce__ = as_value

    @property
    def touches(self) -> bool:
        """Whether the two touch; if not, they are nearer than what had to be kept."""
        return self.distance <= 0.0

    def __str__(self) -> str:
        where = f"tick {self.tick} at {self.time:.3f} s ({self.event}{', proven' * self.proven})"
        pair = f"'{self.first}' and '{self.second}'"
        if self.touches:
            deep = f" by {-1e3 * self.distance:.3g} mm" if self.distance < 0.0 else ""
            return f"{where}: {pair} {'overlap' if deep else 'touch'}{deep}"
        return f"{where}: {pair} are {1e3 * self.distance:.3g} mm apart, less than {1e3 * self.kept:.3g} mm"


def run_violations(
    ticks: Sequence[Tick],
    scenes: Sequence[Snapshot],
    problem: Problem,
    *,
    beside: float,
    truth: Scene | Feed | None = None,
) -> tuple[RunViolation, ...]:
    """See :meth:`rrtik_ompl.replanning.record.ReplanRun.violations`.

    Args:
        ticks: Of the run.
        scenes: That were seen; none in an old record.
        problem: That was run.
        beside: What moves that are called proven keep from obstacles beside their margins [m].
        truth: See there.
    """
    if not ticks:
        return ()

    snapshots = _snapshots(ticks, scenes, problem.world.scene, truth)
    margin = float(problem.world.self_margin)
    found = dict[tuple[int, str, str], RunViolation]()

    for era in _eras(snapshots, ticks[-1].time):
        for each in _EraJudge(problem.robot, ticks, era, margin, beside).violations():
            key = each.tick, each.first, each.second
            if key not in found or each.distance - each.kept < found[key].distance - found[key].kept:
                found[key] = each

    return tuple(sorted(found.values(), key=lambda each: (each.time, each.first, each.second)))


def _snapshots(
    ticks: Sequence[Tick], scenes: Sequence[Snapshot], scene: Scene, truth: Scene | Feed | None
) -> Sequence[Snapshot]:
    """Where obstacles were: the truth if it is given, what was seen, or what an old record says of poses."""
    if isinstance(truth, Scene):
        return [Snapshot(0.0, truth.at(0.0), stated=True)]
    if truth is not None:
        times = [tick.time for tick in ticks]
        looks = np.interp(np.arange(PARTS * (len(times) - 1) + 1) / PARTS, np.arange(len(times)), times)
        return [Snapshot(time, truth(time)) for time in looks.tolist()]
    if scenes:
        return scenes
    first = scene.at(0.0)
    return [Snapshot(tick.time, _placed(first, tick)) for tick in ticks]


def _placed(scene: Scene, tick: Tick) -> Scene:
    """A scene at a tick, as its poses say."""
    poses = {name: pose(row[:3], row[3:]) for name, row in tick.poses.items()}
    still = (replace(o, motion=None, pose=poses.get(o.name, o.pose)) for o in scene.obstacles)
    return replace(scene, obstacles=tuple(still))


@dataclass(frozen=True, slots=True, eq=False)
class _Era:
    """A time in which shapes, margins and allowed pairs stay the same; obstacles state how they move in it."""

    begin: float
    end: float
    last: bool
    scene: Scene
    knots: Vector


def _eras(snapshots: Sequence[Snapshot], end: float) -> Iterator[_Era]:
    """The times of a run in which only poses change."""
    courses = {o.name: _course(snapshots, o) for o in snapshots[0].scene.obstacles}
    knots = np.unique([time for course in courses.values() if course is not None for time in _times(course)])
    begins = [0, *(k for k, (a, b) in enumerate(pairwise(snapshots), start=1) if not _alike(a.scene, b.scene))]

    for first, after in pairwise([*begins, len(snapshots)]):
        scene = snapshots[first].scene
        until = snapshots[after].time if after < len(snapshots) else end
        moving = tuple(replace(o, motion=courses[o.name]) for o in scene.obstacles)
        begin = snapshots[first].time if first else 0.0
        yield _Era(begin, min(until, end), after == len(snapshots), replace(scene, obstacles=moving), knots)


def _course(snapshots: Sequence[Snapshot], obstacle: Obstacle) -> Motion | None:
    """How an obstacle moved: as stated, or straight from where it was seen to where it was seen next."""
    name = obstacle.name
    if snapshots[0].stated:
        return obstacle.motion

    seen = {each.seen_at(name): each.scene.obstacle(name).pose for each in snapshots}
    times = sorted(seen)
    places = [seen[time] for time in times]
    if all(np.array_equal(place.homogeneous, places[0].homogeneous) for place in places):
        return TimedPoses(times[:1], places[:1])
    return TimedPoses(times, places)


def _times(motion: Motion) -> Vector:
    """When a motion turns [s]."""
    return motion.times if isinstance(motion, TimedPoses) else np.zeros(1)


def _alike(first: Scene, second: Scene) -> bool:
    """Whether two scenes differ in poses alone."""
    if first is second:
        return True
    matched = ((each, second.obstacle(each.name)) for each in first.obstacles)
    same = all(same_shape(a.shape, b.shape) and a.margin == b.margin for a, b in matched)
    return same and pairs_that_may_touch(first) == pairs_that_may_touch(second)


class _EraJudge:
    """Says what touches in an era of a run."""

    def __init__(self, robot: Robot, ticks: Sequence[Tick], era: _Era, self_margin: float, beside: float) -> None:
        self._robot = robot
        self._ticks = ticks
        self._era = era

        scene = era.scene
        bodies = (*link_bodies(robot, self_margin), *scene_bodies(robot, scene, self_margin))
        self._bodies = in_contact(robot, scene, bodies)
        self._pairs: Pairs = colliding_pairs(robot, scene, self._bodies)
        self._approach = approach_weights(robot, self._bodies, self._pairs)
        self._sides: NDArray[np.int64] = np.array(self._pairs, dtype=np.int64).reshape(-1, 2)

        self._obstacles = {o.name: o for o in scene.obstacles}
        own = {name: o.pose.inverse() for name, o in self._obstacles.items()}
        self._within = [  # where each solid is in its joint's frame, or in that of its obstacle
            (own[body.name] * body.placement if body.kind == "obstacle" else body.placement).homogeneous
            for body in self._bodies
        ]

        self._names = list(self._obstacles)
        places = {name: k for k, name in enumerate(self._names)}
        self._carrier = np.array([places[b.name] if b.kind == "obstacle" else -1 for b in self._bodies])

        self._radii = np.array([farthest(o.shape, pin.SE3.Identity()) for o in self._obstacles.values()])
        self._balls = np.array([_ball(body) for body in self._bodies]).reshape(-1, 4)

        sides = [(self._bodies[i], self._bodies[j]) for i, j in self._pairs]
        self._least = np.array([min(contact_distance(*pair) or 0.0, 0.0) for pair in sides])
        self._kept = np.array([kept_apart(*pair) + (beside if _promised(*pair) else 0.0) for pair in sides])

    def violations(self) -> Iterator[RunViolation]:
        """Who is too near to whom, tick after tick; a pair may come several times in a tick."""
        ticks = self._ticks
        era = self._era
        if len(self._pairs) == 0:
            return

        for number, tick in enumerate(ticks):
            stands = number + 1 == len(ticks)  # the last one is a moment
            end = tick.time if stands else ticks[number + 1].time
            begin = max(tick.time, era.begin)
            last = min(end, era.end)
            if begin >= last and not (stands and era.last):
                continue

            inside = era.knots[(era.knots > begin) & (era.knots < last)]
            times = [begin, *inside.tolist(), last]
            for a, b in pairwise(times):
                yield from self._between(number, a, b)

    def _between(self, number: int, begin: float, end: float) -> Iterator[RunViolation]:
        """What is too near in a part of a tick in which all moves straight."""
        kept = self._kept if self._ticks[number].proven else self._least
        most = self._most_approach(number, begin, end)

        placed = self._placed(number, 0.5 * (begin + end))
        centres = np.einsum("kij,kj->ki", placed[:, :3, :3], self._balls[:, :3]) + placed[:, :3, 3]
        first, second = self._sides.T
        gaps = np.linalg.norm(centres[first] - centres[second], axis=1) - self._balls[first, 3] - self._balls[second, 3]
        near = ~(gaps > kept + 0.5 * most)  # NaN, of what has no end, is near

        for pair in np.flatnonzero(near).tolist():
            found = self._worst(number, pair, begin, end, float(kept[pair]), float(most[pair]))
            if found is not None:
                time, apart = found
                one, other = (self._bodies[k].name for k in self._pairs[pair])
                tick = self._ticks[number]
                yield RunViolation(time, number, tick.event, one, other, apart, float(kept[pair]), bool(tick.proven))

    def _worst(
        self, number: int, pair: int, begin: float, end: float, kept: float, most: float
    ) -> tuple[float, float] | None:
        """When a pair is nearest of the times that are looked at, and how near [m]; None if it keeps enough."""
        middle = 0.5 * (begin + end)
        room = kept + 0.5 * most if most > FINEST else kept
        ends = self._ends(number, pair, middle)
        if distance(*ends, margin=_less_rounding(room)) is not None:
            return None

        here = _signed(*ends)
        lacking = here <= _less_rounding(kept) or (kept < 0.0 and distance(*ends, margin=_less_rounding(kept)) is None)
        if most <= FINEST and not lacking:
            return None

        if lacking and most <= max(COARSEST, RELATIVE * (kept - here)):
            looks = [(time, _signed(*self._ends(number, pair, time))) for time in (begin, end)]
            return min((middle, here), *looks, key=lambda each: each[1])

        halves = ((begin, middle), (middle, end))
        found = [each for a, b in halves if (each := self._worst(number, pair, a, b, kept, 0.5 * most)) is not None]
        if lacking:
            found.append((middle, here))
        return min(found, key=lambda each: each[1], default=None)

    def _most_approach(self, number: int, begin: float, end: float) -> Vector:
        """How much nearer each pair can come in a part of a tick [m]."""
        change = np.abs(self._q(number, end) - self._q(number, begin))
        ways = [
            _way(self._pose(name, begin), self._pose(name, end), radius)
            for name, radius in zip(self._names, self._radii.tolist(), strict=True)
        ]
        of_bodies = np.array([0.0, *ways])[self._carrier + 1]
        return np.asarray(self._approach @ change + of_bodies[self._sides].sum(axis=1))

    def _placed(self, number: int, time: float) -> Frames:
        """Where all bodies are, shape (bodies, 4, 4)."""
        frames = self._robot.joint_frames(self._q(number, time)[None])[0]
        places = [self._pose(name, time).homogeneous for name in self._names]
        return np.array(
            [
                (frames[body.joint] if carrier < 0 else places[carrier]) @ within
                for body, carrier, within in zip(self._bodies, self._carrier, self._within, strict=True)
            ]
        )

    def _ends(
        self, number: int, pair: int, time: float
    ) -> tuple[coal.CollisionGeometry, Matrix, coal.CollisionGeometry, Matrix]:
        """The two solids of a pair, and where they are."""
        frames = self._robot.joint_frames(self._q(number, time)[None])[0]
        first, second = self._pairs[pair]
        poses = []
        for k in (first, second):
            carrier = self._carrier[k]
            base = frames[self._bodies[k].joint] if carrier < 0 else self._pose(self._names[carrier], time).homogeneous
            poses.append(base @ self._within[k])
        return self._bodies[first].geometry, poses[0], self._bodies[second].geometry, poses[1]

    def _q(self, number: int, time: float) -> Vector:
        """The arm in a tick."""
        ticks = self._ticks
        here = ticks[number]
        if number + 1 == len(ticks):
            return here.q
        after = ticks[number + 1]
        return here.q + (time - here.time) / (after.time - here.time) * (after.q - here.q)

    def _pose(self, name: str, time: float) -> pin.SE3:
        obstacle = self._obstacles[name]
        return obstacle.pose if obstacle.motion is None else obstacle.motion.pose_at(obstacle.pose, time)


def _promised(first: Body, second: Body) -> bool:
    """Whether margin and clearance of a run are promised between two bodies: an obstacle and what moves."""
    return keeps_clearance(first, second) and max(first.joint, second.joint) > 0


def _less_rounding(kept: float) -> float:
    """What must be kept, rounding allowed for [m]; what must not touch must not touch."""
    return kept - ROUNDING if kept < 0.0 else max(kept - ROUNDING, 0.0)


def _ball(body: Body) -> tuple[float, float, float, float]:
    """Centre and radius of a ball around a solid, in its own frame."""
    if isinstance(body.geometry, coal.Halfspace):
        return 0.0, 0.0, 0.0, float("inf")
    x, y, z = np.asarray(body.geometry.aabb_center).tolist()
    return x, y, z, float(body.geometry.aabb_radius)


def _way(a: pin.SE3, b: pin.SE3, radius: float) -> float:
    """How far a point of an obstacle goes at most from one pose to another [m]."""
    angle = float(np.linalg.norm(pin.log3(a.rotation.T @ b.rotation)))
    turned = radius * angle if angle > ROTATION_NOISE else 0.0
    return float(np.linalg.norm(b.translation - a.translation)) + turned


def _signed(
    first: coal.CollisionGeometry, first_pose: Matrix, second: coal.CollisionGeometry, second_pose: Matrix
) -> float:
    """The distance of two solids [m], below 0 how deep they overlap; 0 where that is not known."""
    transforms = [coal.Transform3s(place[:3, :3], place[:3, 3]) for place in (first_pose, second_pose)]
    ends = (first, transforms[0], second, transforms[1])
    if is_ours(ends):
        return float(own_nearest(ends).distance)
    if not coal.collide(*ends, coal.CollisionRequest(), coal.CollisionResult()):
        return max(float(coal.distance(*ends, coal.DistanceRequest(), coal.DistanceResult())), ROUNDING)
    return min(float(coal.distance(*ends, coal.DistanceRequest(), coal.DistanceResult())), 0.0)
