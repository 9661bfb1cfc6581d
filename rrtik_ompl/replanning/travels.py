"""How far obstacles may have gone since they were seen, and where they will be: as they state, or as was measured.

What was seen has an age: an obstacle may have gone on since then, as far as its speed allows.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.geometry.collision.shape_table import farthest
from rrtik_ompl.model.scene import ConstantVelocity, Obstacle, Scene, TimedPoses
from rrtik_ompl.model.shapes import same_shape
from rrtik_ompl.replanning.feed import TIME_RESOLUTION, Snapshot

SPEED_WARNING_RATIO = 1.0 + 1e-6  # of a speed to the bound, above which a warning is given
ROUNDING = 1e-9  # [m]: of places that are computed from times
ROTATION_NOISE = 1e-9  # [rad] between two snapshots; less is rounding


class SpeedWarning(UserWarning):
    """An obstacle moves faster than was stated."""


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

        if name in self._reshaped:
            self._radii[name] = max(self._radii[name], farthest(obstacle.shape, pin.SE3.Identity()))
        travel = travel_bound(old_pose, obstacle.pose, self._radii[name])
        if not np.isfinite(travel):
            raise turns_without_end(name)

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
    return sum(travel_bound(a, b, radius) for a, b in pairwise(poses)) + ROUNDING


def travel_bound(a: pin.SE3, b: pin.SE3, radius: float) -> float:
    """How far a point of an obstacle goes at most from one pose to another [m].

    Args:
        a: Where it is at first.
        b: Where it is then.
        radius: How far its farthest point is from its origin [m]; inf for what has no end, whose turns no way bounds.
    """
    angle = float(np.linalg.norm(pin.log3(a.rotation.T @ b.rotation)))
    arc = radius * angle if angle > ROTATION_NOISE else 0.0
    return float(np.linalg.norm(b.translation - a.translation)) + arc


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
