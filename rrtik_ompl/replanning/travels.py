"""How far obstacles may have travelled since they were seen, and where they will be.

Both follow from the motion that an obstacle states, or else from the velocity that was measured between two sightings.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from itertools import pairwise

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.copies import changed
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import ROTATION_NOISE, travel_bound
from rrtik_ompl.geometry.collision.shape_table import farthest
from rrtik_ompl.model.scene import ConstantVelocity, Obstacle, Scene, TimedPoses
from rrtik_ompl.model.shapes import same_shape
from rrtik_ompl.replanning.faults import PLACE_NOISE, TIME_RESOLUTION
from rrtik_ompl.replanning.feed import Snapshot

SPEED_WARNING_RATIO = 1.0 + 1e-6  # ratio of a speed to the bound above which a warning is given
ROUNDING = 1e-9  # [m]: rounding of places that are computed from times


class SpeedWarning(UserWarning):
    """An obstacle moves faster than was stated."""


class MotionTracker:
    """Measures how fast obstacles move between two sightings, and predicts where they will be.

    Attributes:
        speeds: Largest speed measured so far of each obstacle that has moved [m/s]; a bound for all of its points.
        faster_since: Time since when an obstacle was faster than the bound, as the last update showed [s]; inf if none
            was.
        fault: A line that says which obstacle was faster and by how much, as the last update showed; "" if none was.

    Args:
        bound: Largest speed that was stated for obstacles [m/s]; None if none was.
    """

    def __init__(self, bound: float | None) -> None:
        # The largest distance of a point of each obstacle from its origin [m] bounds the way of its points in a turn.
        self._radii: dict[str, float] = {}
        self._bound = bound
        self._sightings: dict[str, tuple[float, Obstacle]] = {}
        self._velocities: dict[str, tuple[Vector, Vector]] = {}
        self._reshaped = set[str]()
        self.speeds: dict[str, float] = {}
        self.faster_since = float("inf")
        self.fault = ""

    def update(self, seen: Snapshot) -> bool:
        """Measure speeds from a new snapshot and return whether anything about the obstacles has changed.

        Names, shapes, poses and margins are compared with those of the last sighting; the first call returns True if
        there are obstacles. Gives a ``SpeedWarning`` for each obstacle that is faster than the bound.
        """
        given = {o.name for o in seen.scene.obstacles}
        changed = given != self._sightings.keys()
        self.faster_since = float("inf")
        self.fault = ""

        for obstacle in seen.scene.obstacles:
            name = obstacle.name
            time = seen.seen_at(obstacle.name)
            last_time, last_seen = self._sightings.get(name, (time, obstacle))
            reshaped = not same_shape(obstacle.shape, last_seen.shape)
            moved = not np.array_equal(last_seen.pose.homogeneous, obstacle.pose.homogeneous)
            changed |= reshaped or moved or obstacle.margin != last_seen.margin

            if name not in self._sightings:
                self._radii[name] = farthest(obstacle.shape, pin.SE3.Identity())

            # A cloud that was seen anew has new points, which may have moved; its speed cannot be measured.
            if reshaped:
                self.speeds.setdefault(name, 0.0)
                self._reshaped.add(name)
            if time > last_time:
                self._velocities.pop(name, None)
                if moved:
                    self._measure(obstacle, last_seen, last_time, time)
            self._sightings[name] = (time, obstacle)

        # What is gone is forgotten, but for its speed: should it come back, it may have been anywhere.
        for name in self._sightings.keys() - given:
            del self._sightings[name]
            self._velocities.pop(name, None)
            self._reshaped.discard(name)
        return changed

    def later(self, scene: Scene, seconds: float, ages: Mapping[str, float] | None = None) -> Scene:
        """Predict the scene at a later time, by the motion that each obstacle states or else by its velocity.

        Args:
            scene: The last scene.
            seconds: How far ahead to predict, from now [s].
            ages: How long ago obstacles were seen [s], by name; 0 for those that are not in it.

        Returns:
            The scene with obstacles at their predicted poses; those with neither motion nor velocity stay.
        """
        age_of_obstacle = ages or {}
        return changed(
            scene,
            obstacles=tuple(self._predicted(o, seconds + age_of_obstacle.get(o.name, 0.0)) for o in scene.obstacles),
        )

    def _predicted(self, obstacle: Obstacle, seconds: float) -> Obstacle:
        """Return an obstacle at its predicted pose, ``seconds`` after it was seen [s]."""
        if obstacle.motion is not None:
            pose = obstacle.motion.pose_at(obstacle.pose, seconds)
            return changed(obstacle, pose=pose, motion=obstacle.motion.seen_from(seconds))
        if obstacle.name not in self._velocities:
            return obstacle
        return changed(obstacle, pose=pin.SE3(*_extrapolated(obstacle.pose, self._velocities[obstacle.name], seconds)))

    def unforeseen(self, seconds: float) -> dict[str, float]:
        """Return how far clouds whose points have changed, which cannot be predicted, may go in a time [s] [m]."""
        return dict.fromkeys(self._reshaped, (self._bound or 0.0) * seconds)

    def _measure(self, obstacle: Obstacle, last_seen: Obstacle, last_time: float, now: float) -> None:
        # Store the velocity and the largest speed of an obstacle that moved between two sightings, and warn if it is
        # faster than the bound, or has said that it stays.
        name = obstacle.name
        old_pose = last_seen.pose
        seconds = now - last_time
        shift = obstacle.pose.translation - old_pose.translation
        turn = pin.log3(old_pose.rotation.T @ obstacle.pose.rotation)

        if name in self._reshaped:
            self._radii[name] = max(self._radii[name], farthest(obstacle.shape, pin.SE3.Identity()))
        travel = travel_bound(old_pose, obstacle.pose, self._radii[name])
        if not np.isfinite(travel):
            raise turns_without_end(name)

        speed = travel / seconds
        has_moved = name in self.speeds
        self._velocities[name] = (shift / seconds, turn / seconds)
        self.speeds[name] = max(speed, self.speeds.get(name, 0.0))

        if states_rest(last_seen) and not has_moved and travel > PLACE_NOISE:
            fault = rest_warning(name, speed, now)
        elif self._bound is not None and travel > SPEED_WARNING_RATIO * self._bound * (seconds + TIME_RESOLUTION):
            fault = speed_warning(name, speed, now, self._bound)
        else:
            return
        self.faster_since = min(last_time, self.faster_since)
        self.fault = self.fault or fault
        warnings.warn(SpeedWarning(fault), stacklevel=4)


def turns_without_end(name: str) -> InputError:
    """Return the error for an unbounded obstacle that turns, so that no speed bounds its points."""
    return InputError(f"obstacle '{name}' has no end and turns: no bound on its way; use a box in its place")


def refuse_endless_turns(scene: Scene) -> None:
    """Refuse a scene in which an unbounded obstacle, such as a half-space, states a motion that turns it.

    Raises:
        InputError: If there is one; the message names it.
    """
    for obstacle in scene.obstacles:
        if obstacle.shape.bounded or not isinstance(obstacle.motion, TimedPoses):
            continue
        first_rotation = obstacle.motion.poses[0].rotation
        turns = (float(np.linalg.norm(pin.log3(first_rotation.T @ pose.rotation))) for pose in obstacle.motion.poses)
        if max(turns) > ROTATION_NOISE:
            raise turns_without_end(obstacle.name)


def speed_warning(name: str, speed: float, time: float, bound: float) -> str:
    """Return the text of the warning that an obstacle is faster than the bound [m/s] at a time [s]."""
    return (
        f"obstacle '{name}' moves at {speed:.3g} m/s at {time:.3g} s, {speed - bound:.3g} m/s faster than the stated "
        f"speed_bound of {bound:g} m/s: a contact cannot be ruled out; raise speed_bound"
    )


def rest_warning(name: str, speed: float, time: float) -> str:
    """Return the text of the warning that an obstacle moves [m/s] at a time [s] that has said that it is at rest."""
    return (
        f"obstacle '{name}' moves at {speed:.3g} m/s at {time:.3g} s, and its motion says that it stays: a contact "
        "cannot be ruled out; leave out the motion with velocity zero"
    )


def states_rest(obstacle: Obstacle) -> bool:
    """Check whether an obstacle states that it is at rest for good."""
    return isinstance(obstacle.motion, ConstantVelocity) and not obstacle.motion.velocity.any()


def required_distances(scene: Scene, margin: float, travels: Mapping[str, float]) -> dict[str, float]:
    """Return the distance to keep from each obstacle beyond its own margin [m]: ``margin`` plus its travel."""
    return {o.name: margin + travels[o.name] for o in scene.obstacles}


def stated_way(obstacle: Obstacle, seconds: float) -> float:
    """Return an upper bound on the way of any point of an obstacle until a time [s], by its stated motion [m]."""
    motion = obstacle.motion
    if motion is None:
        return 0.0

    times = [0.0, seconds]
    if isinstance(motion, TimedPoses):  # The motion may change its direction at its own times.
        times[1:1] = motion.times[(motion.times > 0.0) & (motion.times < seconds)].tolist()
    poses = [motion.pose_at(obstacle.pose, time) for time in times]
    radius = farthest(obstacle.shape, pin.SE3.Identity())
    return sum(travel_bound(a, b, radius) for a, b in pairwise(poses)) + ROUNDING


class Travels:
    """Bounds how far obstacles may be from where they were seen, now and by the end of a tick.

    All methods return a distance for each obstacle by name.

    Args:
        seconds: Length of a tick [s].
        bound: Largest speed of obstacles that move [m/s]; None if it is not stated.
        measured: Measured speeds of obstacles that were seen to move, by name [m/s]; one that exceeds the bound takes
            its place. It may be updated after the call.
    """

    def __init__(self, seconds: float, bound: float | None, measured: Mapping[str, float]) -> None:
        self._seconds = seconds
        self._bound = bound
        self._measured = measured

    def since_seen(self, scene: Scene, ages: Mapping[str, float]) -> dict[str, float]:
        """Return how far each moving obstacle may have gone since it was seen [m]; others count as at rest.

        Without a bound on speeds, the largest measured speed is assumed.

        Args:
            scene: The last scene.
            ages: How long ago each obstacle was seen [s], by name.
        """
        return {o.name: self._speed(o) * ages[o.name] for o in scene.obstacles}

    def in_tick(self, scene: Scene) -> dict[str, float]:
        """Return how far each moving obstacle may go within a tick [m]; 0 for all if no bound is stated."""
        bound_is_stated = self._bound is not None
        return {o.name: self._speed(o) * self._seconds if bound_is_stated else 0.0 for o in scene.obstacles}

    def possible(self, seen: Snapshot, ages: Mapping[str, float]) -> dict[str, float] | None:
        """Return how far each obstacle may be from where it was seen by the end of the tick [m].

        Obstacles that are not stated to be at rest may begin to move just now. Without a bound on speeds, obstacles
        that state their motion follow it.

        Args:
            seen: The last snapshot.
            ages: How long ago each obstacle was seen [s], by name.

        Returns:
            Distances by name [m]; None if nothing bounds the motion of some obstacle.
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
        """Check whether an obstacle states that it is at rest and was not seen to move."""
        return states_rest(obstacle) and obstacle.name not in self._measured

    def _speed(self, obstacle: Obstacle) -> float:
        """Return the assumed speed of an obstacle that states a motion or was seen to move [m/s]; else 0."""
        measured = self._measured.get(obstacle.name)
        if self._stays(obstacle) or (obstacle.motion is None and measured is None):
            return 0.0
        return max(self._bound or 0.0, measured or 0.0)


def _extrapolated(pose: pin.SE3, velocity: tuple[Vector, Vector], seconds: float) -> tuple[Matrix, Vector]:
    linear, angular = velocity
    return pose.rotation @ pin.exp3(seconds * angular), pose.translation + seconds * linear
