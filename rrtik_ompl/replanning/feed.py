"""The scene over time: from the motions that a scene states, from a function, or from a stream of snapshots.

What was seen has an age: an obstacle may have gone on since then, as far as its speed allows.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.errors import InputError, called, require
from rrtik_ompl.geometry.collision.shape_table import farthest
from rrtik_ompl.model.scene import ConstantVelocity, Obstacle, Scene, TimedPoses
from rrtik_ompl.model.shapes import same_shape

SILENCE_SECONDS = 2.0  # without a new scene, after which a run ends
TIME_RESOLUTION = 1e-6  # [s]: a double holds a time since 1970 to a quarter of it
LATEST = 1e11  # [s]: a clock in seconds is there in three thousand years
SPEED_WARNING_RATIO = 1.0 + 1e-6  # of a speed to the bound, above which a warning is given
ROUNDING = 1e-9  # [m]: of places that are computed from times
ROTATION_NOISE = 1e-9  # [rad] between two snapshots; less is rounding


class SpeedWarning(UserWarning):
    """An obstacle moves faster than was stated."""


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """A scene as it was seen, and when; it can be taken apart as a pair of a time and a scene.

    Attributes:
        time: When it was taken [s].
        scene: What was seen.
        unseen: For obstacles that were out of view then: how long before they had been seen last [s].
        stated: Whether the scene states how its obstacles move; those without a motion are at rest.

    Example:
        >>> from rrtik_ompl.replanning.feed import Snapshot
        >>> time, scene = Snapshot(0.1, rrtik.Scene())
        >>> time
        0.1
    """

    time: float
    scene: Scene
    unseen: Mapping[str, float] = field(default_factory=dict)
    stated: bool = False

    def __iter__(self) -> Iterator[Any]:
        return iter((self.time, self.scene))

    def __getitem__(self, place: int) -> Any:  # noqa: ANN401 - a time or a scene
        return (self.time, self.scene)[place]

    def __len__(self) -> int:
        return 2

    def seen_at(self, name: str) -> float:
        """When an obstacle was seen last [s]."""
        return self.time - self.unseen.get(name, 0.0)

    def ages(self, now: float) -> dict[str, float]:
        """How long ago each obstacle was seen [s]."""
        return {o.name: max(now - self.seen_at(o.name), 0.0) for o in self.scene.obstacles}


Feed: TypeAlias = Callable[[float], Scene]
Source: TypeAlias = Scene | Feed | Iterable[tuple[float, Scene] | Snapshot]
Watch: TypeAlias = Callable[[float], Snapshot]  # what was seen last at a time


def feed_of(source: Source, patience: float = SILENCE_SECONDS) -> Watch:
    """What was seen last at a time, from any kind of source.

    Args:
        source: A scene whose obstacles state their motion; a function from a time [s] to the scene at that time; or
            pairs of a time and a scene (or a :class:`Snapshot`) in the order of time, as a sensor gives them.
        patience: How far apart the first two of such pairs may be [s].

    Raises:
        InputError: If it is none of these; later, if its times cannot be.
    """
    if isinstance(source, Scene):
        return lambda time: Snapshot(time, source.at(time), stated=True)
    if callable(source):
        called(source, "scene feed", "time [s]")
        return _checked(source)
    if isinstance(source, Iterable) and getattr(source, "ndim", 1) > 0:
        return Stream(source, patience)
    raise InputError(f"scene feed: expected a scene, a function of time or pairs, got {type(source).__name__}")


def _checked(source: Feed) -> Watch:
    """A function of time whose results are checked."""

    def at(time: float) -> Snapshot:
        scene = source(time)
        require(scene, Scene, f"scene feed: what it returns at {time:g} s", "return the scene at that time")
        return Snapshot(time, scene)

    return at


class Stream:
    """Snapshots one after the other; called with a time, the last one that is not later.

    Their times are counted from the first one and read to a microsecond, so that any clock will do.
    """

    def __init__(self, snapshots: Iterable[tuple[float, Scene] | Snapshot], patience: float = SILENCE_SECONDS) -> None:
        self._remaining: Iterator[Snapshot] = map(_snapshot, snapshots)
        self._patience = patience

        first = next(self._remaining, None)
        if first is None:
            raise InputError("scene feed: it holds no snapshot; give at least one pair of a time and a scene")
        if abs(first.time) > LATEST:
            raise InputError(f"scene feed: its times begin at {first.time:.16g}; give seconds, not milliseconds")

        self._first_time = first.time
        self._latest = replace(first, time=0.0)
        self._next: Snapshot | None = None
        self._count = 1
        self._has_ended = False

    def __call__(self, time: float) -> Snapshot:
        """The last snapshot that is not later than ``time`` [s].

        Raises:
            InputError: If a snapshot is no pair of a time and a scene, or not later than the one before it; if the
                second one is so much later than the first that no run could wait for it.
        """
        while True:
            if self._next is None and not self._has_ended:
                self._next = self._read()
                self._has_ended = self._next is None
            if self._next is None or self._next.time > time + TIME_RESOLUTION:
                return self._latest
            self._latest = self._next
            self._next = None

    def _read(self) -> Snapshot | None:
        """The next snapshot, its time counted from the first one."""
        snapshot = next(self._remaining, None)
        if snapshot is None:
            return None

        time = round(snapshot.time - self._first_time, 6)
        before = self._latest.time
        if time < before:
            times = f"{snapshot.time:.16g} s comes after {self._first_time + before:.16g} s"
            raise InputError(f"scene feed: times go backwards: {times}; sort the snapshots by time")
        if time == before:
            repeated = f"{snapshot.time:.16g} s comes twice"
            raise InputError(f"scene feed: times stand still: {repeated}; give the time at which each scene was taken")
        if self._count == 1 and time > self._patience:
            delay = f"the second scene comes {time:.6g} s after the first, feed_patience is {self._patience:g} s"
            raise InputError(f"scene feed: {delay}; give times in seconds, not milliseconds, or raise feed_patience")

        self._count += 1
        return replace(snapshot, time=time)


def _snapshot(item: object) -> Snapshot:
    """A snapshot, or a pair of a time and a scene, checked."""
    pair = (item.time, item.scene) if isinstance(item, Snapshot) else item
    match pair:
        case (float() | int() | np.number() as time, Scene() as scene) if np.isfinite(time):
            unseen = dict(item.unseen) if isinstance(item, Snapshot) else {}
            return Snapshot(float(time), scene, unseen)
    raise InputError(f"scene feed: expected pairs of a time [s] and a scene, got {item!r:.80}")


class MotionTracker:
    """Measures how fast obstacles move between two sightings, and predicts where they will be.

    Attributes:
        speeds: Largest speed measured so far of each obstacle that has moved [m/s]: no point of it was faster.
        faster_since: Since when an obstacle was faster than the bound, as the last update has shown [s]; inf if none.
    """

    def __init__(self, scene: Scene, bound: float | None) -> None:
        # a point's distance from its obstacle's origin counts where the obstacle turns
        self._radii = {o.name: farthest(o.shape, pin.SE3.Identity()) for o in scene.obstacles}
        self._bound = bound
        self._warned = set[str]()
        self._sightings: dict[str, tuple[float, Obstacle]] = {}
        self._velocities: dict[str, tuple[Vector, Vector]] = {}
        self._reshaped = set[str]()
        self.speeds: dict[str, float] = {}
        self.faster_since = float("inf")

    def update(self, seen: Snapshot) -> bool:
        """Measure what was seen; whether anything about the obstacles is new (at the first call: True)."""
        changed = {o.name for o in seen.scene.obstacles} != self._sightings.keys()
        self.faster_since = float("inf")

        for obstacle in seen.scene.obstacles:
            name = obstacle.name
            time = seen.seen_at(obstacle.name)
            last_time, last_seen = self._sightings.get(name, (time, obstacle))
            reshaped = not same_shape(obstacle.shape, last_seen.shape)
            moved = not np.array_equal(last_seen.pose.homogeneous, obstacle.pose.homogeneous)
            changed |= reshaped or moved or obstacle.margin != last_seen.margin

            if reshaped:  # a cloud that was seen anew: its points may have moved
                self.speeds.setdefault(name, 0.0)
                self._reshaped.add(name)
            if time > last_time:
                self._velocities.pop(name, None)
                if moved:
                    self._measure(obstacle, last_seen.pose, last_time, time)
            self._sightings[name] = (time, obstacle)

        return changed

    def later(self, scene: Scene, seconds: float, ages: Mapping[str, float] | None = None) -> Scene:
        """Where the obstacles of the last scene will be: by the motion that they state, or else by their velocity.

        Args:
            scene: The last one.
            seconds: From now [s].
            ages: How long ago obstacles were seen [s]; now if it does not say.
        """
        age_of_obstacle = ages or {}
        return replace(
            scene,
            obstacles=tuple(self._predicted(o, seconds + age_of_obstacle.get(o.name, 0.0)) for o in scene.obstacles),
        )

    def _predicted(self, obstacle: Obstacle, seconds: float) -> Obstacle:
        """An obstacle where it will be, so long after it was seen [s]."""
        if obstacle.motion is not None:
            pose = obstacle.motion.pose_at(obstacle.pose, seconds)
            return replace(obstacle, pose=pose, motion=obstacle.motion.seen_from(seconds))
        if obstacle.name not in self._velocities:
            return obstacle
        return replace(obstacle, pose=pin.SE3(*_extrapolated(obstacle.pose, self._velocities[obstacle.name], seconds)))

    def unforeseen(self, seconds: float) -> dict[str, float]:
        """How far obstacles whose motion nobody can predict may go in a time [s]: clouds that are seen anew [m]."""
        return dict.fromkeys(self._reshaped, (self._bound or 0.0) * seconds)

    def _measure(self, obstacle: Obstacle, old_pose: pin.SE3, last_time: float, now: float) -> None:
        name = obstacle.name
        seconds = now - last_time
        shift = obstacle.pose.translation - old_pose.translation
        turn = pin.log3(old_pose.rotation.T @ obstacle.pose.rotation)
        angle = float(np.linalg.norm(turn))

        if name in self._reshaped:
            self._radii[name] = max(self._radii[name], farthest(obstacle.shape, pin.SE3.Identity()))
        # a half-space has no farthest point
        rotation_path = self._radii[name] * angle if angle > ROTATION_NOISE else 0.0
        if not np.isfinite(rotation_path):
            raise turns_without_end(name)

        travel = float(np.linalg.norm(shift)) + rotation_path
        speed = travel / seconds
        self._velocities[name] = (shift / seconds, turn / seconds)
        self.speeds[name] = max(speed, self.speeds.get(name, 0.0))

        if self._bound is None or travel <= SPEED_WARNING_RATIO * self._bound * (seconds + TIME_RESOLUTION):
            return
        self.faster_since = min(last_time, self.faster_since)
        if name not in self._warned:
            self._warned.add(name)
            warnings.warn(SpeedWarning(speed_warning(name, speed, now, self._bound)), stacklevel=4)


def turns_without_end(name: str) -> InputError:
    """The error that no speed bounds the points of an obstacle."""
    return InputError(f"obstacle '{name}' has no end and turns: no bound on its way; use a box in its place")


def refuse_endless_turns(scene: Scene) -> None:
    """Refuse a scene in which an obstacle without an end states a motion that turns it.

    Raises:
        InputError: It names the obstacle.
    """
    for obstacle in scene.obstacles:
        if obstacle.shape.bounded or not isinstance(obstacle.motion, TimedPoses):
            continue
        first_rotation = obstacle.motion.poses[0].rotation
        turns = (float(np.linalg.norm(pin.log3(first_rotation.T @ pose.rotation))) for pose in obstacle.motion.poses)
        if max(turns) > ROTATION_NOISE:
            raise turns_without_end(obstacle.name)


def speed_warning(name: str, speed: float, time: float, bound: float) -> str:
    """The warning that an obstacle is faster than the bound."""
    return (
        f"obstacle '{name}' moves at {speed:.3g} m/s at {time:.3g} s, faster than the stated speed_bound of "
        f"{bound:g} m/s: a contact cannot be ruled out; raise speed_bound"
    )


def required_distances(scene: Scene, margin: float, travels: Mapping[str, float]) -> dict[str, float]:
    """Distance that the arm keeps to each obstacle, beyond its own margin: the given one plus its travel [m]."""
    return {o.name: margin + travels[o.name] for o in scene.obstacles}


def stated_way(obstacle: Obstacle, seconds: float) -> float:
    """How far a point of an obstacle goes at most from time 0 on, by the motion that it states [m]."""
    motion = obstacle.motion
    if motion is None:
        return 0.0

    times = [0.0, seconds]
    if isinstance(motion, TimedPoses):  # it may turn at its own times
        times[1:1] = motion.times[(motion.times > 0.0) & (motion.times < seconds)].tolist()
    poses = [motion.pose_at(obstacle.pose, time) for time in times]
    radius = farthest(obstacle.shape, pin.SE3.Identity())
    travel = 0.0
    for a, b in pairwise(poses):
        angle = float(np.linalg.norm(pin.log3(a.rotation.T @ b.rotation)))
        arc = radius * angle if angle > ROTATION_NOISE else 0.0
        travel += float(np.linalg.norm(b.translation - a.translation)) + arc
    return travel + ROUNDING


class Travels:
    """How far obstacles may be from where they were seen, now and by the end of a tick.

    Args:
        seconds: Length of a tick [s].
        bound: Largest speed of what moves [m/s]; None if it is not stated.
        measured: Speeds that were measured of what was seen to move [m/s]; a larger one than the bound counts.
    """

    def __init__(self, seconds: float, bound: float | None, measured: Mapping[str, float]) -> None:
        self._seconds = seconds
        self._bound = bound
        self._measured = measured

    def since_seen(self, scene: Scene, ages: Mapping[str, float]) -> dict[str, float]:
        """How far each obstacle that moves may have gone since it was seen [m]; without a bound as fast as it was."""
        return {o.name: self._speed(o) * ages[o.name] for o in scene.obstacles}

    def in_tick(self, scene: Scene) -> dict[str, float]:
        """How far each obstacle that moves may go within a tick [m]; nothing where no bound is stated."""
        bound_is_stated = self._bound is not None
        return {o.name: self._speed(o) * self._seconds if bound_is_stated else 0.0 for o in scene.obstacles}

    def possible(self, seen: Snapshot, ages: Mapping[str, float]) -> dict[str, float] | None:
        """How far each obstacle may be by the end of the tick, even if it begins to move just now [m].

        Whatever is not stated to be at rest may begin to move. Without a bound what states its motion goes as it says.
        None if nothing bounds that.
        """
        travels = {}
        for obstacle in seen.scene.obstacles:
            if self._stays(obstacle) or (seen.stated and obstacle.motion is None):
                travels[obstacle.name] = 0.0
            elif self._bound is None and seen.stated:
                travels[obstacle.name] = stated_way(obstacle, self._seconds)
            elif self._bound is None:
                return None
            else:
                speed = max(self._bound, self._measured.get(obstacle.name, 0.0))
                travels[obstacle.name] = speed * (ages[obstacle.name] + self._seconds)
        return travels

    def _stays(self, obstacle: Obstacle) -> bool:
        """Whether an obstacle states that it does not move, and was not seen to."""
        stated = isinstance(obstacle.motion, ConstantVelocity) and not obstacle.motion.velocity.any()
        return stated and obstacle.name not in self._measured

    def _speed(self, obstacle: Obstacle) -> float:
        """Of an obstacle that states a motion or was seen to move [m/s]; else 0."""
        measured = self._measured.get(obstacle.name)
        if self._stays(obstacle) or (obstacle.motion is None and measured is None):
            return 0.0
        return max(self._bound or 0.0, measured or 0.0)


def _extrapolated(pose: pin.SE3, velocity: tuple[Vector, Vector], seconds: float) -> tuple[Matrix, Vector]:
    linear, angular = velocity
    return pose.rotation @ pin.exp3(seconds * angular), pose.translation + seconds * linear
