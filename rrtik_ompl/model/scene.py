"""What surrounds the arm: named obstacles with poses, moving ones, attached objects, allowed collisions. Frozen."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import LARGEST, Vector, bounded_array, finite_array, finite_number, frozen
from rrtik_ompl.base.copies import as_value, changed
from rrtik_ompl.base.errors import InputError, UnknownNameError, at_most, listed, name_of, require
from rrtik_ompl.base.poses import rigid
from rrtik_ompl.model.shapes import SHAPES, Shape

MOST_SOLIDS = 10_000  # of a scene, obstacles and attached objects together


@dataclass(frozen=True, slots=True, eq=False)
class ConstantVelocity:
    """A straight motion: position at time t is the obstacle's pose shifted by ``velocity * t`` [m/s, world axes]."""

    velocity: Vector

    __reduce__ = as_value

    def __init__(self, velocity: ArrayLike) -> None:
        object.__setattr__(self, "velocity", frozen(bounded_array(velocity, (3,), "motion velocity")))

    def pose_at(self, start: pin.SE3, time: float) -> pin.SE3:
        """Pose at ``time`` [s] of an obstacle that is at ``start`` at time 0.

        Raises:
            InputError: If it has left the world by then.
        """
        require(start, pin.SE3, "pose of an obstacle", "use rrtik_ompl.pose(xyz, quat_xyzw)")
        time = finite_number(time, "time of a motion")
        if abs(time) * float(np.abs(self.velocity).max()) <= LARGEST:
            position = start.translation + time * self.velocity
            if np.abs(position).max() <= LARGEST:
                return pin.SE3(start.rotation, position)
        raise InputError(f"motion: at {time:g} s an obstacle of velocity {self.velocity.tolist()} m/s is far away")

    def seen_from(self, time: float) -> ConstantVelocity:
        """Return the same motion with ``time`` [s] as its time 0."""
        del time
        return self


@dataclass(frozen=True, slots=True, eq=False)
class TimedPoses:
    """A motion through poses at given times: straight lines, shortest rotations, at rest before and after."""

    times: Vector
    poses: tuple[pin.SE3, ...]

    __reduce__ = as_value

    def __init__(self, times: ArrayLike, poses: Iterable[pin.SE3]) -> None:
        stamps = finite_array(times, (None,), "motion times")
        stations = tuple(
            rigid(pose, f"motion: pose {k}") for k, pose in enumerate(listed(poses, "poses of a motion"), start=1)
        )

        if len(stamps) == 0 or len(stamps) != len(stations):
            raise InputError(
                f"motion needs as many times as poses, at least one; got {len(stamps)} and {len(stations)}"
            )
        if (np.diff(stamps) <= 0.0).any():
            raise InputError(f"motion times must increase, got {stamps.tolist()}")

        object.__setattr__(self, "times", frozen(stamps))
        object.__setattr__(self, "poses", stations)

    def pose_at(self, start: pin.SE3, time: float) -> pin.SE3:
        """Pose at ``time`` [s]; ``start`` does not matter, the waypoints are in the world."""
        del start
        k = int(np.searchsorted(self.times, time, side="right"))
        if k == 0 or k == len(self.times):
            return self.poses[max(k - 1, 0)].copy()

        share = (time - self.times[k - 1]) / (self.times[k] - self.times[k - 1])
        a = self.poses[k - 1]
        b = self.poses[k]
        rotation = a.rotation @ pin.exp3(share * pin.log3(a.rotation.T @ b.rotation))
        return pin.SE3(rotation, (1.0 - share) * a.translation + share * b.translation)

    def seen_from(self, time: float) -> TimedPoses:
        """Return the same motion with ``time`` [s] as its time 0."""
        return changed(self, times=frozen(self.times - time))


Motion: TypeAlias = ConstantVelocity | TimedPoses


@dataclass(frozen=True, slots=True, eq=False)
class Obstacle:
    """A named solid in the world.

    Attributes:
        name: Its name.
        shape: What it is.
        pose: T_world_obstacle.
        motion: Moves it over time, if given.
        margin: Distance that the moving parts of the arm must keep to it [m]; what no joint moves must only not touch.
    """

    name: str
    shape: Shape
    pose: pin.SE3 = field(default_factory=pin.SE3.Identity)
    motion: Motion | None = None
    margin: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "pose", _checked_solid(self.name, self.shape, self.pose))
        require(self.motion, Motion | None, f"motion of '{self.name}'")
        object.__setattr__(self, "margin", _room(self.margin, f"margin of '{self.name}'"))


@dataclass(frozen=True, slots=True, eq=False)
class AttachedObject:
    """A solid held by a link. ``pose`` is T_link_object; ``allow`` names what it may touch beside that link.

    Both lengths are what it keeps from all that it may not touch, on top of the margins of others: ``margin`` [m] is
    its own, as that of an obstacle is, and becomes it again when it is set down; ``padding`` [m] is that of the grasp,
    and that of the holding link (:func:`rrtik_ompl.padded`) if None.
    """

    name: str
    link: str
    shape: Shape
    pose: pin.SE3 = field(default_factory=pin.SE3.Identity)
    allow: tuple[str, ...] = ()
    padding: float | None = None
    margin: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "pose", _checked_solid(self.name, self.shape, self.pose))
        if self.padding is not None:
            object.__setattr__(self, "padding", _room(self.padding, f"padding of '{self.name}'"))
        object.__setattr__(self, "margin", _room(self.margin, f"margin of '{self.name}'"))
        name_of(self.link, f"the link of '{self.name}'")
        object.__setattr__(self, "allow", listed(self.allow, f"allow of '{self.name}'"))
        for name in self.allow:
            name_of(name, f"what '{self.name}' may touch")

        if not self.shape.movable:
            kind = re.sub("(?<=[a-z])(?=[A-Z])", "-", type(self.shape).__name__).lower()
            raise InputError(f"a {kind} cannot be attached to a link: '{self.name}'")


def _checked_solid(name: object, shape: object, pose: object) -> pin.SE3:
    """Return the pose of an obstacle or attached object, if all three are what they have to be.

    A pose that is not finite would compare as farther away than anything, and what is there would not be seen.
    """
    name_of(name, "an obstacle or attached object")
    if not isinstance(shape, Shape):
        kinds = " or ".join(kind.__name__ for kind in SHAPES.values())
        found = f"must be of type {kinds}, got {type(shape).__name__}"
        raise InputError(f"shape of '{name}' {found}; use rrtik_ompl.model.shapes")
    return rigid(pose, f"pose of '{name}'")


def _room(value: float, what: str) -> float:
    metres = float(bounded_array(value, (), what))
    if metres < 0.0:
        raise InputError(f"{what} must be 0 metres or more, got {metres:g}")
    return metres


@dataclass(frozen=True, slots=True)
class Touching:
    """Two things that are in contact, and how near each other they may come; margins and paddings do not add to that.

    A task makes these for what touches when it is taken or set down, and they end when the two have parted.

    Attributes:
        first, second: Names; one of them at least is an obstacle or attached object.
        distance: The least distance that they must keep [m], not above 0; negative is the depth to which they may
            overlap.

    Example:
        >>> print(rrtik.Touching("cup", "table", -0.001))
        'cup' and 'table' may overlap by 1 mm
    """

    first: str
    second: str
    distance: float

    def __post_init__(self) -> None:
        for name in self.names:
            name_of(name, "a thing that touches another")
        if self.first == self.second:
            raise InputError(f"contacts of a scene: '{self.first}' stands twice in a pair; name two things")

        what = f"distance of '{self.first}' and '{self.second}'"
        object.__setattr__(self, "distance", float(bounded_array(self.distance, (), what)))
        if self.distance > 0.0:
            raise InputError(f"{what} must not be above 0, got {self.distance:g}; a margin keeps things apart")

    def __str__(self) -> str:
        pair = f"'{self.first}' and '{self.second}'"
        return f"{pair} may overlap by {-1e3 * self.distance:.3g} mm" if self.distance < 0.0 else f"{pair} may touch"

    @property
    def names(self) -> tuple[str, str]:
        """Both names."""
        return self.first, self.second

    @property
    def pair(self) -> frozenset[str]:
        """Both names, in no order."""
        return frozenset(self.names)


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Obstacles, attached objects, and the pairs of names that may touch. ``Scene()`` is the empty one.

    Attributes:
        obstacles: What stands or moves by itself.
        attached: What links hold.
        allowed_collisions: Pairs of names that are never checked.
        contacts: Pairs that are in contact, and how far they may overlap.
    """

    obstacles: tuple[Obstacle, ...] = ()
    attached: tuple[AttachedObject, ...] = ()
    allowed_collisions: tuple[tuple[str, str], ...] = ()
    contacts: tuple[Touching, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "obstacles", listed(self.obstacles, "obstacles of a scene"))
        object.__setattr__(self, "attached", listed(self.attached, "attached objects of a scene"))
        at_most(len(self.obstacles) + len(self.attached), MOST_SOLIDS, "obstacles of a scene", "join some in a mesh")

        for obstacle in self.obstacles:
            require(obstacle, Obstacle, "each obstacle of a scene")
        for held in self.attached:
            require(held, AttachedObject, "each attached object of a scene")

        pairs = tuple(
            tuple(map(str, pair)) for pair in listed(self.allowed_collisions, "allowed_collisions of a scene")
        )
        if any(len(pair) != 2 for pair in pairs):
            raise InputError(f"allowed_collisions of a scene must be pairs of names, got {list(pairs)}")
        object.__setattr__(self, "allowed_collisions", pairs)

        object.__setattr__(self, "contacts", listed(self.contacts, "contacts of a scene"))
        for contact in self.contacts:
            require(contact, Touching, "each contact of a scene")
        in_contact = Counter(contact.pair for contact in self.contacts)
        for contact in self.contacts:
            if in_contact[contact.pair] > 1:
                both = f"'{contact.first}' and '{contact.second}'"
                raise InputError(f"contacts of a scene: {both} stand there {in_contact[contact.pair]} times; keep one")

        names = self.names
        if len(set(names)) < len(names):
            name, times = Counter(names).most_common(1)[0]
            raise InputError(f"scene: the name '{name}' is used {times} times; names must differ")

    def __repr__(self) -> str:
        return f"Scene({', '.join(self.names) or 'empty'})"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all obstacles and attached objects."""
        return (*(o.name for o in self.obstacles), *(o.name for o in self.attached))

    def obstacle(self, name: str) -> Obstacle:
        """Return the obstacle of that name.

        Raises:
            UnknownNameError: If there is none.
        """
        require(name, str, "name of an obstacle")
        for obstacle in self.obstacles:
            if obstacle.name == name:
                return obstacle
        raise UnknownNameError("obstacle", name, (o.name for o in self.obstacles))

    def with_(self, *obstacles: Obstacle) -> Scene:
        """Return the scene with further obstacles.

        Raises:
            InputError: If one is none, or its name is used already.
        """
        return replace(self, obstacles=(*self.obstacles, *obstacles))

    def without(self, *names: str) -> Scene:
        """Return the scene without some of its obstacles and attached objects, and without the pairs that name them.

        Raises:
            UnknownNameError: If there is none of that name.
        """
        for name in names:
            require(name, str, "name of an obstacle or attached object")
            if name not in self.names:
                raise UnknownNameError("obstacle or attached object", name, self.names)
        return Scene(
            tuple(o for o in self.obstacles if o.name not in names),
            tuple(a for a in self.attached if a.name not in names),
            tuple(pair for pair in self.allowed_collisions if not set(pair) & set(names)),
            tuple(contact for contact in self.contacts if not contact.pair & set(names)),
        )

    def attaching(
        self,
        name: str,
        link: str,
        allow: Iterable[str] = (),
        *,
        pose: ArrayLike | pin.SE3 | None = None,
        padding: float | None = None,
    ) -> Scene:
        """Return the scene in which an obstacle has become an attached object; pairs that may touch still may.

        It keeps its margin; a motion that it had ends. What ``allow`` names may touch it until it is set down: a scene
        knows no posture of the arm, so that it cannot say how deep. :class:`rrtik_ompl.Task` can, and does.

        Args:
            name: Of the obstacle.
            link: That holds it from now on.
            allow: Links and obstacles that it may touch beside that link.
            pose: T_link_object, in any form of :func:`rrtik_ompl.base.poses.rigid`; the link's own frame if None.
            padding: What it keeps from all that it may not touch, beside its margin [m]; that of the link if None.

        Raises:
            UnknownNameError: If there is no obstacle of that name.
            InputError: If it has no end, or the pose is none.
        """
        taken = self.obstacle(name)
        rest = self.without(name)
        place = pin.SE3.Identity() if pose is None else pose
        held = AttachedObject(name, link, taken.shape, place, padding=padding, margin=taken.margin)

        names = listed(allow, f"allow of '{name}'")
        for other in names:
            require(other, str, f"each name of allow of '{name}'")

        attached = (*rest.attached, replace(held, allow=names))
        return Scene(rest.obstacles, attached, self.allowed_collisions, self.contacts)

    def detaching(self, name: str, pose: ArrayLike | pin.SE3) -> Scene:
        """Return the scene in which an attached object is an obstacle at T_world_object.

        Its margin is the obstacle's. What was for the grasp ends with it: padding, what it was allowed to touch, and
        contacts of what was held.

        Raises:
            UnknownNameError: If there is no attached object of that name.
            InputError: If the pose is none.
        """
        require(name, str, "name of an attached object")
        held = {a.name: a for a in self.attached}
        if name not in held:
            raise UnknownNameError("attached object", name, held)

        item = held.pop(name)
        free = Obstacle(name, item.shape, pose, margin=item.margin)
        contacts = tuple(contact for contact in self.contacts if name not in contact.pair)
        return Scene((*self.obstacles, free), tuple(held.values()), self.allowed_collisions, contacts)

    def at(self, time: float) -> Scene:
        """The scene with ``time`` [s] as its time 0: moving obstacles are where their motion puts them, and go on.

        Raises:
            InputError: If the time is not finite, or an obstacle has left the world by then.
        """
        time = finite_number(time, "time of a scene")
        if all(o.motion is None for o in self.obstacles):
            return self
        moved = tuple(
            o if o.motion is None else changed(o, pose=pose_at(o, time), motion=o.motion.seen_from(time))
            for o in self.obstacles
        )
        return changed(self, obstacles=moved)


def pose_at(obstacle: Obstacle, time: float) -> pin.SE3:
    """Return where an obstacle is at a time [s]: by the motion that it states, if it states one."""
    return obstacle.pose if obstacle.motion is None else obstacle.motion.pose_at(obstacle.pose, time)


def pairs_that_may_touch(scene: Scene) -> frozenset[tuple[frozenset[str], float | None]]:
    """Return the pairs of names that a scene allows to touch, and how near those in contact may come [m]."""
    allowed = ((frozenset(pair), None) for pair in scene.allowed_collisions)
    return frozenset([*allowed, *((each.pair, each.distance) for each in scene.contacts)])


def exchanged(scene: Scene, number: int, obstacle: Obstacle) -> Scene:
    """The scene with an obstacle in the place of one of the same name and shape; nothing else is checked again."""
    obstacles = list(scene.obstacles)
    obstacles[number] = obstacle
    return changed(scene, obstacles=tuple(obstacles))
