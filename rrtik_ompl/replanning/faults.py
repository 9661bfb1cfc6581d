"""What may be wrong with a feed of scenes, and what a run answers: it is decided here and nowhere else.

The rule behind the answers: what a scene adds counts at once, and what it takes away is believed only after
``feed_patience``, since a sensor loses sight of things more often than things disappear.
"""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import travel_bound
from rrtik_ompl.model.scene import Obstacle, Scene, unnamed
from rrtik_ompl.model.shapes import HalfSpace, Shape, same_shape
from rrtik_ompl.model.shapes.shape import same_but_for_points

FaultKind: TypeAlias = Literal[
    "appears", "appears on the arm", "vanishes", "stays away", "changes size", "changes shape", "changes name",
    "doubled", "out of order",
]  # fmt: skip

ANSWERS: Mapping[FaultKind, str] = {
    "appears": "it counts at once; moves since the scene before are not called proven",
    "appears on the arm": "the arm moves away from it where a way leads out, and else waits",
    "vanishes": "it counts as out of view where it was seen last, and may have moved since",
    "stays away": "it was not seen for feed_patience, and no longer counts",
    "changes size": "the larger size counts; a smaller one once it was seen for feed_patience",
    "changes shape": "the new shape counts at once, and the old one as an obstacle that has vanished",
    "changes name": "it is the obstacle of the old name, as the shape is the same and the place within its reach",
    "doubled": "the scene is dropped; the first one of a time counts",
    "out of order": "the scene is dropped, since a later one is known",
}
UNFORESEEN: tuple[FaultKind, ...] = ("appears", "appears on the arm", "changes size", "changes shape")
MOST_DROPPED = 1000  # scenes in a row; a feed that goes on like that stands still
PLACE_NOISE = 1e-6  # [m]: what is nearer to its last place than that has not moved
TIME_RESOLUTION = 1e-6  # [s]: a double holds a time since 1970 to a quarter of this
BEFORE = " (before)"  # is added to the name of an obstacle whose shape has changed, for its old shape


class FeedWarning(UserWarning):
    """Something is wrong with the scenes of a feed; the run goes on."""


@dataclass(frozen=True, slots=True)
class Fault:
    """Something that was wrong with a feed of scenes.

    Attributes:
        time: Time of the scene that shows it [s].
        kind: One of the keys of ``ANSWERS``.
        obstacle: Name of the obstacle; "" if it concerns a whole scene.
        detail: More words, such as the old name of an obstacle; or "".
    """

    time: float
    kind: FaultKind
    obstacle: str = ""
    detail: str = ""

    def __str__(self) -> str:
        what = f"'{self.obstacle}' {self.kind}" if self.obstacle else f"a scene is {self.kind}"
        detail = f" ({self.detail})" if self.detail else ""
        return f"{what} at {self.time:.6g} s{detail}: {ANSWERS[self.kind]}"


def fault_of_time(time: float, before: float, patience: float, first: float = 0.0) -> FaultKind | None:
    """Return what is wrong with the time of a scene that comes after another one; None if it is later.

    Args:
        time: Time of the scene [s].
        before: Time of the last scene that counts [s].
        patience: How far out of order a scene may be [s]; beyond that, somebody has set back the clock.
        first: What was taken off both times [s], for the message.

    Raises:
        InputError: If it is farther back.
    """
    if time > before:
        return None
    if time == before:
        return "doubled"
    if time >= before - patience:
        return "out of order"
    times = f"{first + time:.16g} s comes after {first + before:.16g} s, and feed_patience is {patience:g} s"
    raise InputError(f"scene feed: times go backwards: {times}; sort the snapshots by time, or set no clock back")


@dataclass(frozen=True, slots=True, eq=False)
class Known:
    """What is known of the scene at a time.

    Attributes:
        scene: The scene with all obstacles that count.
        unseen: For each obstacle that was out of view, how long ago it was seen last [s].
        faults: What was wrong with the last scene.
    """

    scene: Scene
    unseen: Mapping[str, float]
    faults: tuple[Fault, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class _Sighting:
    """An obstacle as it was seen last.

    Attributes:
        time: When it was seen [s].
        obstacle: The obstacle, with the shape that counts.
        reported: The shape that the scene gave.
        since: Since when the scenes give this shape [s].
        scene: The scene, which says what may touch the obstacle.
        name: Its name there; an old shape counts under another one.
    """

    time: float
    obstacle: Obstacle
    reported: Shape
    since: float
    scene: Scene
    name: str


class SceneMemory:
    """Makes of the scenes of a feed what is known of the obstacles, by the rule of the module.

    Args:
        patience: How long what was seen counts although scenes no longer show it [s].
        speed_bound: Largest speed of any point of an obstacle [m/s]; None if it is not known.
    """

    def __init__(self, patience: float, speed_bound: float | None) -> None:
        self._patience = patience
        self._speed_bound = speed_bound or 0.0
        self._sightings: dict[str, _Sighting] = {}
        self._given: set[str] = set()  # names of the obstacles of the last scene
        self._ever: set[str] = set()  # names of all obstacles that have counted
        self._time = -np.inf
        self._known: Known | None = None

    def take(self, time: float, scene: Scene, unseen: Mapping[str, float]) -> Known:
        """Take in a scene and return what is known then; a scene that is no later than the last one changes nothing.

        Args:
            time: When the scene was taken [s].
            scene: The scene.
            unseen: For each obstacle of the scene that was out of view, how long ago it was seen last [s].
        """
        if self._known is not None and time <= self._time:
            return replace(self._known, faults=())

        is_first = self._known is None
        faults: list[Fault] = []
        before = self._sightings
        given = {o.name for o in scene.obstacles}
        missing = {name: each for name, each in before.items() if name not in given}
        now: dict[str, _Sighting] = {}

        for obstacle in scene.obstacles:
            name = obstacle.name
            seen_at = time - unseen.get(name, 0.0)
            sighting = _Sighting(seen_at, obstacle, obstacle.shape, seen_at, scene, name)
            if name in before:
                now |= self._seen_again(before[name], sighting, {*before, *given}, faults)
                continue

            now[name] = sighting
            old_name = self._old_name(obstacle, time, missing)
            if old_name is not None:
                del missing[old_name]
                faults.append(Fault(time, "changes name", name, f"before '{old_name}'"))
            elif not is_first:
                faults.append(Fault(time, "appears", name))

        for name, sighting in missing.items():
            if _is_back(sighting, name, now):
                continue
            if time - sighting.time > self._patience:
                faults.append(Fault(time, "stays away", name))
            else:
                faults += [Fault(time, "vanishes", name)] if name in self._given else []
                now.setdefault(name, sighting)

        self._sightings = now
        self._time = time
        self._given = given
        self._ever |= now.keys()
        known = unnamed(_scene_of(now, scene), self._ever - now.keys())
        ages = {name: time - each.time for name, each in now.items() if each.time < time}
        self._known = Known(known, ages, tuple(faults))
        return self._known

    def _seen_again(
        self, before: _Sighting, now: _Sighting, taken: Set[str], faults: list[Fault]
    ) -> dict[str, _Sighting]:
        """Return what counts of an obstacle that was known before, by name: it and, maybe, its old shape.

        Args:
            before: How it was seen last.
            now: How it is seen now.
            taken: Names that other obstacles may have.
            faults: Those that are found are added.
        """
        # An obstacle that is still out of view is where it was seen last, whatever pose a scene gives it.
        if now.time < before.time + 0.5 * TIME_RESOLUTION:
            there = replace(now.obstacle, pose=before.obstacle.pose)
            moved = not np.array_equal(there.pose.homogeneous, now.obstacle.pose.homogeneous)
            now = replace(now, time=before.time, obstacle=there if moved else now.obstacle)

        obstacle = now.obstacle
        name = obstacle.name
        shape = obstacle.shape

        if same_but_for_points(shape, before.reported):
            counts = before.obstacle.shape
            is_old = shape.sensed or same_shape(shape, counts) or now.time - before.since >= self._patience
            believed = obstacle if is_old else replace(obstacle, shape=counts)
            return {name: replace(now, obstacle=believed, since=before.since)}

        around = shape_around(before.obstacle.shape, shape)
        if around is not None:
            faults.append(Fault(now.time, "changes size", name))
            return {name: replace(now, obstacle=replace(obstacle, shape=around))}

        faults.append(Fault(now.time, "changes shape", name, f"from {before.reported.key} to {shape.key}"))
        ghost = name + BEFORE
        while ghost in taken:
            ghost += BEFORE
        return {name: now, ghost: replace(before, obstacle=replace(before.obstacle, name=ghost))}

    def _old_name(self, obstacle: Obstacle, time: float, missing: Mapping[str, _Sighting]) -> str | None:
        """Return the name of the missing obstacle that the given one is by its shape and place; None if none is."""
        for name, sighting in missing.items():
            reach = self._speed_bound * (time - sighting.time) + PLACE_NOISE
            there = sighting.obstacle
            way = travel_bound(there.pose, obstacle.pose, obstacle.shape.bounding_radius)
            if same_shape(obstacle.shape, there.shape) and way <= reach:
                return name
        return None


def shape_around(first: Shape, second: Shape) -> Shape | None:
    """Return a shape of the same kind that contains both shapes at one pose; None if that is not implemented.

    If the second one contains the first, it is returned itself.
    """
    kind = type(first)
    if kind is not type(second):
        return None
    if isinstance(first, HalfSpace) and isinstance(second, HalfSpace):
        alike = np.array_equal(first.normal, second.normal)
        return max(second, first, key=lambda each: each.offset) if alike else None
    lengths = [each.name for each in kind.measures if each.kind in ("length", "three lengths")]
    if not lengths or len(lengths) < len(kind.measures):
        return None

    around = kind(*(np.maximum(getattr(first, name), getattr(second, name)) for name in lengths))
    return second if same_shape(around, second) else around


def _is_back(sighting: _Sighting, name: str, now: Mapping[str, _Sighting]) -> bool:
    """Check whether a sighting is the old shape of an obstacle that has this shape again."""
    again = now.get(sighting.name)
    return name != sighting.name and again is not None and same_shape(again.reported, sighting.obstacle.shape)


def _scene_of(sightings: Mapping[str, _Sighting], given: Scene) -> Scene:
    """Return the scene of all sightings: the given one, if nothing else counts."""
    obstacles = tuple(each.obstacle for each in sightings.values())
    if len(obstacles) == len(given.obstacles) and all(a is b for a, b in zip(obstacles, given.obstacles, strict=True)):
        return given

    # What is no longer in the scene keeps its pairs of the last scene that had it.
    allowed = list(given.allowed_collisions)
    for name, each in sightings.items():
        if each.scene is given:
            continue
        held = ((item.name, other) for item in each.scene.attached for other in item.allow)
        for first, second in (*each.scene.allowed_collisions, *held):
            kept = (name if first == each.name else first, name if second == each.name else second)
            if each.name in (first, second) and kept not in allowed:
                allowed.append(kept)
    return replace(given, obstacles=obstacles, allowed_collisions=tuple(allowed))
