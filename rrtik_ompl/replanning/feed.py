"""The scene over time: from the motions that a scene states, from a function, or from a stream of snapshots."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from typing import TypeAlias

import numpy as np
import pinocchio as pin

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.collision.extent import farthest
from rrtik_ompl.errors import InputError, called, require
from rrtik_ompl.scene import Obstacle, Scene
from rrtik_ompl.shapes import same_shape

Feed: TypeAlias = Callable[[float], Scene]
Source: TypeAlias = Scene | Feed | Iterable[tuple[float, Scene]]

SPEED_WARNING_RATIO = 1.0 + 1e-6  # of a speed to the bound, above which a warning is given
ROTATION_NOISE = 1e-9  # [rad] between two snapshots; less is rounding


class SpeedWarning(UserWarning):
    """An obstacle moves faster than was stated."""


def feed_of(source: Source) -> Feed:
    """The scene at a time, from any kind of source.

    Args:
        source: A scene whose obstacles state their motion; a function from a time [s] to a scene; or pairs of a time
            and a scene in the order of time, as a sensor gives them.

    Raises:
        InputError: If it is none of these; later, if its times go backwards.
    """
    if isinstance(source, Scene):
        return source.at
    if callable(source):
        called(source, "scene feed", "time [s]")
        return _checked(source)
    if isinstance(source, Iterable) and getattr(source, "ndim", 1) > 0:
        return Stream(source)
    raise InputError(f"scene feed: expected a scene, a function of time or pairs, got {type(source).__name__}")


def _checked(source: Feed) -> Feed:
    """A function of time whose results are checked."""

    def at(time: float) -> Scene:
        scene = source(time)
        require(scene, Scene, f"scene feed: what it returns at {time:g} s", "return the scene at that time")
        return scene

    return at


class Stream:
    """Snapshots one after the other; called with a time, the last one that is not later."""

    def __init__(self, snapshots: Iterable[tuple[float, Scene]]) -> None:
        self._left: Iterator[tuple[float, Scene]] = map(_snapshot, snapshots)
        self._next = next(self._left, None)
        if self._next is None:
            raise InputError("scene feed: it holds no snapshot; give at least one pair of a time and a scene")
        self._now = self._next

    def __call__(self, time: float) -> Scene:
        """The last scene that is not later than ``time`` [s].

        Raises:
            InputError: If a snapshot is older than the one before it, or is no pair of a time and a scene.
        """
        while self._next is not None and self._next[0] <= time:
            self._now = self._next
            self._next = next(self._left, None)
            if self._next is not None and self._next[0] < self._now[0]:
                stamps = f"{self._next[0]:g} s comes after {self._now[0]:g} s"
                raise InputError(f"scene feed: times go backwards: {stamps}; sort the snapshots by time")
        return self._now[1]


def _snapshot(given: object) -> tuple[float, Scene]:
    """A pair of a time and a scene, checked."""
    match given:
        case (float() | int() | np.number() as time, Scene() as scene) if np.isfinite(time):
            return float(time), scene
    raise InputError(f"scene feed: expected pairs of a time [s] and a scene, got {given!r:.80}")


class MotionTracker:
    """Measures how fast obstacles move between two snapshots, and predicts where they will be.

    Attributes:
        speeds: Largest speed measured so far of each obstacle that has moved [m/s]: no point of it was faster.
    """

    def __init__(self, scene: Scene, bound: float | None) -> None:
        # a point's distance from its obstacle's origin counts where the obstacle turns
        self._radii = {o.name: farthest(o.shape, pin.SE3.Identity()) for o in scene.obstacles}
        self._bound, self._warned = bound, set[str]()
        self._last: tuple[float, Scene] | None = None
        self._velocities: dict[str, tuple[Vector, Vector]] = {}
        self._reshaped = set[str]()
        self.speeds: dict[str, float] = {}

    def update(self, time: float, scene: Scene) -> bool:
        """Measure the scene at a time [s]; whether anything about the obstacles is new (at the first call: True)."""
        before, self._last = self._last, (time, scene)
        if before is None or time <= before[0]:
            return True
        old = {o.name: o for o in before[1].obstacles}
        changed = {o.name for o in scene.obstacles} != old.keys()
        self._velocities = {}
        for obstacle in scene.obstacles:
            last = old.get(obstacle.name, obstacle)
            if not same_shape(obstacle.shape, last.shape):  # a cloud that was seen anew: its points may have moved
                changed = True
                self.speeds.setdefault(obstacle.name, 0.0)
                self._reshaped.add(obstacle.name)
            if not np.array_equal(last.pose.homogeneous, obstacle.pose.homogeneous):
                changed = True
                self._measure(obstacle, last.pose, time - before[0], time)
            changed |= obstacle.margin != last.margin
        return changed

    def later(self, scene: Scene, seconds: float) -> Scene:
        """Where the obstacles of the last scene will be: by the motion that they state, or else by their velocity."""
        ahead = scene.at(seconds)
        guessed = {
            name: pin.SE3(*_extrapolated(scene.obstacle(name).pose, velocity, seconds))
            for name, velocity in self._velocities.items()
            if scene.obstacle(name).motion is None
        }
        if not guessed:
            return ahead
        moved = tuple(replace(o, pose=guessed.get(o.name, o.pose)) for o in ahead.obstacles)
        return replace(ahead, obstacles=moved)

    def unforeseen(self, seconds: float) -> dict[str, float]:
        """How far obstacles whose motion nobody can predict may go in a time [s]: clouds that are seen anew [m]."""
        return dict.fromkeys(self._reshaped, (self._bound or 0.0) * seconds)

    def _measure(self, obstacle: Obstacle, old: pin.SE3, seconds: float, time: float) -> None:
        name = obstacle.name
        shift, turn = obstacle.pose.translation - old.translation, pin.log3(old.rotation.T @ obstacle.pose.rotation)
        angle = float(np.linalg.norm(turn))
        if name in self._reshaped:
            self._radii[name] = max(self._radii[name], farthest(obstacle.shape, pin.SE3.Identity()))
        # a half-space has no farthest point
        rotation_path = self._radii[name] * angle if angle > ROTATION_NOISE else 0.0
        speed = (float(np.linalg.norm(shift)) + rotation_path) / seconds
        self._velocities[name] = (shift / seconds, turn / seconds)
        self.speeds[name] = max(speed, self.speeds.get(name, 0.0))
        if self._bound is not None and speed > SPEED_WARNING_RATIO * self._bound and name not in self._warned:
            self._warned.add(name)
            warnings.warn(SpeedWarning(speed_warning(name, speed, time, self._bound)), stacklevel=4)


def speed_warning(name: str, speed: float, time: float, bound: float) -> str:
    """The warning that an obstacle is faster than the bound."""
    return (
        f"obstacle '{name}' moves at {speed:.3g} m/s at {time:.3g} s, faster than the stated speed_bound of "
        f"{bound:g} m/s: a contact cannot be ruled out; raise speed_bound"
    )


def required_distances(
    scene: Scene, margin: float, seconds: float, bound: float | None, measured: Mapping[str, float]
) -> dict[str, float]:
    """Distance that the arm keeps to each obstacle, beyond its own margin: the given one plus its travel in a tick.

    Args:
        scene: The obstacles.
        margin: Distance that must be left to every obstacle [m].
        seconds: Length of a tick [s].
        bound: Largest speed of what moves [m/s]; a larger measured speed counts. None: nothing is added for travel.
        measured: Speeds that were measured [m/s].
    """
    found = {}
    for obstacle in scene.obstacles:
        moves = bound is not None and (obstacle.motion is not None or obstacle.name in measured)
        speed = max(bound or 0.0, measured.get(obstacle.name, 0.0)) if moves else 0.0
        found[obstacle.name] = margin + speed * seconds
    return found


def _extrapolated(pose: pin.SE3, velocity: tuple[Vector, Vector], seconds: float) -> tuple[Matrix, Vector]:
    linear, turn = velocity
    return pose.rotation @ pin.exp3(seconds * turn), pose.translation + seconds * linear
