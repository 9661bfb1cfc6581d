"""The surroundings of the arm: obstacles at rest or moving, attached objects and allowed collisions. Immutable."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Hashable, Iterable
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import LARGEST, Vector, bounded_array, finite_array, finite_number, frozen
from rrtik_ompl.base.colors import color_of
from rrtik_ompl.base.copies import as_value, changed, set_fields
from rrtik_ompl.base.errors import InputError, UnknownNameError, at_most, listed, name_of, require
from rrtik_ompl.base.poses import PoseLike, rigid
from rrtik_ompl.files.kinds import read, write
from rrtik_ompl.model.shapes import SHAPES, Shape

MOST_SOLIDS = 10_000  # largest number of obstacles and attached objects of a scene


@dataclass(frozen=True, slots=True, eq=False)
class ConstantVelocity:
    """A straight motion: at time t the obstacle is displaced by ``velocity * t`` [m/s, world axes] from its pose.

    Example:
        >>> motion = rrtik.replanning.ConstantVelocity([0.1, 0.0, 0.0])
        >>> ball = rrtik.Obstacle("ball", rrtik.Sphere(0.1), [1.0, 0.0, 0.0], motion=motion)
        >>> motion.pose_at(ball.pose, 5.0).translation
        array([1.5, 0. , 0. ])
    """

    velocity: Vector

    __reduce__ = as_value

    def __init__(self, velocity: ArrayLike) -> None:
        object.__setattr__(self, "velocity", frozen(bounded_array(velocity, (3,), "motion velocity")))

    def pose_at(self, start: pin.SE3, time: float) -> pin.SE3:
        """Return the pose at ``time`` [s] of an obstacle that is at ``start`` at time 0.

        Raises:
            InputError: If the obstacle is farther away than numbers are allowed to be.
        """
        require(start, pin.SE3, "pose of an obstacle", "use rrtik_ompl.pose(xyz, quat_xyzw)")
        time = finite_number(time, "time of a motion")
        if abs(time) * float(np.abs(self.velocity).max()) <= LARGEST:
            position = start.translation + time * self.velocity
            if np.abs(position).max() <= LARGEST:
                return pin.SE3(start.rotation, position)
        raise InputError(f"motion: at {time:g} s an obstacle of velocity {self.velocity.tolist()} m/s is far away")

    def seen_from(self, time: float) -> ConstantVelocity:
        """Return the motion with ``time`` [s] as its new time 0, which is the same motion."""
        del time
        return self


@dataclass(frozen=True, slots=True, eq=False)
class TimedPoses:
    """A motion through poses in the world at given times [s].

    In between the obstacle moves on straight lines with shortest rotations; before and after it is at rest.

    Example:
        >>> motion = rrtik.replanning.TimedPoses([0.0, 2.0], [rrtik.pose([0, 0, 0]), rrtik.pose([1, 0, 0])])
        >>> motion.pose_at(rrtik.pose(), 1.0).translation
        array([0.5, 0. , 0. ])
    """

    times: Vector
    poses: tuple[pin.SE3, ...]

    __reduce__ = as_value

    def __init__(self, times: ArrayLike, poses: Iterable[PoseLike]) -> None:
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
        """Return the pose at ``time`` [s]; ``start`` is ignored, as the poses of the motion are in the world."""
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
        """Return the motion with ``time`` [s] as its new time 0.

        Raises:
            InputError: If the time is not finite, or so large that the times of the motion are rounded to equal ones.
        """
        times = self.times - finite_number(time, "time of a motion")
        if not (np.diff(times) > 0.0).all():
            raise InputError(f"motion times must increase, got {times.tolist()} as seen from {time:g} s")
        return changed(self, times=frozen(times))


Motion: TypeAlias = ConstantVelocity | TimedPoses


@dataclass(frozen=True, slots=True, eq=False)
class Obstacle:
    """A named solid in the world.

    Attributes:
        name: Its name.
        shape: Its geometry.
        pose: T_world_obstacle.
        motion: Its motion over time; None if it is at rest.
        margin: Distance that the moving parts of the arm must keep from it [m]; the fixed parts must only not touch it.
        color: '#rrggbb' in which it is drawn, also given as red, green and blue from 0 to 1; None: pages choose one.

    Example:
        >>> post = rrtik.Obstacle("post", rrtik.Cylinder(0.05, 1.0), [0.4, 0.0, 0.5], margin=0.02, color="#c0392b")
        >>> post.pose.translation
        array([0.4, 0. , 0.5])
    """

    name: str
    shape: Shape
    pose: pin.SE3
    motion: Motion | None
    margin: float
    color: str | None

    def __init__(
        self,
        name: str,
        shape: Shape,
        pose: PoseLike = (0.0, 0.0, 0.0),
        motion: Motion | None = None,
        margin: float = 0.0,
        color: str | ArrayLike | None = None,
    ) -> None:
        placement = _checked_solid(name, shape, pose)
        require(motion, Motion | None, f"motion of '{name}'")
        room = _room(margin, f"margin of '{name}'")
        set_fields(self, name=name, shape=shape, pose=placement, motion=motion, margin=room)
        set_fields(self, color=color_of(color, f"color of '{name}'"))


@dataclass(frozen=True, slots=True, eq=False)
class AttachedObject:
    """A solid held by a link.

    Attributes:
        name: Its name.
        link: The link that holds it.
        shape: Its geometry.
        pose: T_link_object.
        allow: Names of links and obstacles that it may touch, in addition to ``link``.
        padding: Distance of the grasp [m]: kept from everything that it must not touch, in addition to margins. That of
            the holding link (``padding`` of :func:`rrtik_ompl.load_robot`) if None.
        margin: Its own margin [m], kept likewise; it becomes the margin of the obstacle again when it is detached.
        color: '#rrggbb' in which it is drawn, also given as red, green and blue from 0 to 1; None: pages choose one.

    Example:
        >>> rod = rrtik.AttachedObject("rod", "panda_hand", rrtik.Cylinder(0.01, 0.2), [0.0, 0.0, 0.15])
        >>> rrtik.Scene(attached=[rod]).names
        ('rod',)
    """

    name: str
    link: str
    shape: Shape
    pose: pin.SE3
    allow: tuple[str, ...]
    padding: float | None
    margin: float
    color: str | None

    def __init__(
        self,
        name: str,
        link: str,
        shape: Shape,
        pose: PoseLike = (0.0, 0.0, 0.0),
        allow: Iterable[str] = (),
        padding: float | None = None,
        margin: float = 0.0,
        color: str | ArrayLike | None = None,
    ) -> None:
        name_of(link, f"the link of '{name}'")
        placement = _checked_solid(name, shape, pose)
        touchable = tuple(name_of(each, f"what '{name}' may touch") for each in listed(allow, f"allow of '{name}'"))
        own_padding = None if padding is None else _room(padding, f"padding of '{name}'")
        room = _room(margin, f"margin of '{name}'")

        if not shape.movable:
            kind = re.sub("(?<=[a-z])(?=[A-Z])", "-", type(shape).__name__).lower()
            raise InputError(f"a {kind} cannot be attached to a link: '{name}'")

        set_fields(self, name=name, link=link, shape=shape, pose=placement)
        set_fields(self, allow=touchable, padding=own_padding, margin=room)
        set_fields(self, color=color_of(color, f"color of '{name}'"))


def _checked_solid(name: object, shape: object, pose: object) -> pin.SE3:
    """Validate name, shape and pose of an obstacle or attached object, and return the pose.

    A pose that is not finite would compare as farther away than anything, so the solid would be ignored.
    """
    name_of(name, "an obstacle or attached object")
    kinds = ", ".join(kind.__name__ for kind in SHAPES.values())
    require(shape, Shape, f"shape of '{name}'", f"use Box(x, y, z), Sphere(radius) or another of {kinds}")
    return rigid(pose, f"pose of '{name}'")


def _pairs(allowed: Iterable[Iterable[str]]) -> tuple[tuple[str, ...], ...]:
    """Validate the allowed collisions of a scene: pairs of names."""
    what = "allowed_collisions of a scene"
    pairs = tuple(tuple(map(str, listed(pair, f"each of the {what}"))) for pair in listed(allowed, what))
    for pair in pairs:
        if len(pair) != 2:
            raise InputError(f"{what} must be pairs of names, got {pair}")
    return pairs


def _room(value: float, what: str) -> float:
    metres = float(bounded_array(value, (), what))
    if metres < 0.0:
        raise InputError(f"{what} must be 0 metres or more, got {metres:g}")
    return metres


@dataclass(frozen=True, slots=True)
class Touching:
    """A pair that is in contact, with the least distance that it has to keep; margins and paddings do not apply to it.

    A task creates these for objects that are in contact when grasped or set down; they end when the two have parted.

    Attributes:
        first, second: The names; at least one of them is that of an obstacle or attached object.
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
        """Both names as an unordered pair."""
        return frozenset(self.names)


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Obstacles, attached objects, and pairs of names that may touch. ``Scene()`` is empty.

    Attributes:
        obstacles: Solids in the world, at rest or moving.
        attached: Solids held by links.
        allowed_collisions: Pairs of names that are never checked against each other.
        contacts: Pairs that are in contact, with the depth to which they may overlap.

    Example:
        >>> post = rrtik.Obstacle("post", rrtik.Cylinder(0.05, 1.0), [0.4, 0.0, 0.5])
        >>> scene = rrtik.Scene([post], allowed_collisions=[("panda_link0", "post")])
        >>> scene.without("post").names
        ()
    """

    obstacles: tuple[Obstacle, ...]
    attached: tuple[AttachedObject, ...]
    allowed_collisions: tuple[tuple[str, str], ...]
    contacts: tuple[Touching, ...]

    def __init__(
        self,
        obstacles: Iterable[Obstacle] = (),
        attached: Iterable[AttachedObject] = (),
        allowed_collisions: Iterable[Iterable[str]] = (),
        contacts: Iterable[Touching] = (),
    ) -> None:
        set_fields(
            self,
            obstacles=listed(obstacles, "obstacles of a scene"),
            attached=listed(attached, "attached objects of a scene"),
            allowed_collisions=_pairs(allowed_collisions),
            contacts=listed(contacts, "contacts of a scene"),
        )
        at_most(len(self.obstacles) + len(self.attached), MOST_SOLIDS, "obstacles of a scene", "join some in a mesh")

        for obstacle in self.obstacles:
            require(obstacle, Obstacle, "each obstacle of a scene")
        for held in self.attached:
            require(held, AttachedObject, "each attached object of a scene")

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
    def made_of(self) -> Hashable:
        """What is equal for scenes that have the same obstacles and objects, and equal contacts and allowed pairs.

        An empty scene has nothing in common with another one.
        """
        if not self.obstacles and not self.attached:
            return id(self)
        return id(self.obstacles), id(self.attached), self.allowed_collisions, self.contacts

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all obstacles and attached objects."""
        return (*(o.name for o in self.obstacles), *(o.name for o in self.attached))

    @staticmethod
    def load(file: str | os.PathLike[str]) -> Scene:
        """Read the scene of a YAML file, as `load_scene` does: ``version: 1`` and ``scene:``, or a whole problem file.

        Raises:
            InputError: If the file cannot be used; one line with file, line, key, what was found and the remedy.
        """
        return read(Scene, file)

    def save(self, file: str | os.PathLike[str]) -> None:
        """Write the scene as YAML; if writing fails, no incomplete file is left.

        Files of meshes and clouds are named relative to the new file's folder.

        Raises:
            InputError: If the file cannot be written, or a mesh or a cloud does not come from a file.

        Example:
            >>> rrtik.Scene().save("empty.yaml")
            >>> print(open("empty.yaml").read().splitlines()[0])
            version: 1
        """
        write(self, file)

    def obstacle(self, name: str) -> Obstacle:
        """Return the obstacle with a given name.

        Raises:
            UnknownNameError: If there is none.
        """
        require(name, str, "name of an obstacle")
        for obstacle in self.obstacles:
            if obstacle.name == name:
                return obstacle
        raise UnknownNameError("obstacle", name, (o.name for o in self.obstacles))

    def with_(self, *obstacles: Obstacle) -> Scene:
        """Return the scene with additional obstacles.

        Raises:
            InputError: If one is not an obstacle, or its name is used already.
        """
        return replace(self, obstacles=(*self.obstacles, *obstacles))

    def without(self, *names: str) -> Scene:
        """Return the scene without some obstacles and attached objects, and without all that names them.

        These are allowed pairs, contacts, and what the remaining attached objects may touch.

        Raises:
            UnknownNameError: If there is none of that name.
        """
        for name in names:
            require(name, str, "name of an obstacle or attached object")
            if name not in self.names:
                raise UnknownNameError("obstacle or attached object", name, self.names)
        gone = set(names)
        obstacles = tuple(o for o in self.obstacles if o.name not in gone)
        attached = tuple(a for a in self.attached if a.name not in gone)
        return unnamed(replace(self, obstacles=obstacles, attached=attached), gone)

    def attaching(
        self,
        name: str,
        link: str,
        allow: Iterable[str] = (),
        *,
        pose: PoseLike | None = None,
        padding: float | None = None,
    ) -> Scene:
        """Return the scene in which an obstacle has become an attached object; allowed pairs stay allowed.

        The object keeps its margin and colour, and loses its motion. It may touch the things named in ``allow`` until
        it is detached, to any depth, because a scene does not know the posture of the arm. :class:`rrtik_ompl.Task`
        limits the depth.

        Args:
            name: Name of the obstacle.
            link: The link that holds it from now on.
            allow: Links and obstacles that it may touch, in addition to that link.
            pose: T_link_object, in any form of :func:`rrtik_ompl.base.poses.rigid`; the identity if None.
            padding: Distance that it keeps from everything that it must not touch, on top of its margin [m]; that of
                the link if None.

        Raises:
            UnknownNameError: If there is no obstacle of that name.
            InputError: If the obstacle is unbounded, or ``pose`` is not a pose.
        """
        taken = self.obstacle(name)
        rest = self.without(name)
        place = pin.SE3.Identity() if pose is None else pose
        held = AttachedObject(name, link, taken.shape, place, padding=padding, margin=taken.margin, color=taken.color)

        names = listed(allow, f"allow of '{name}'")
        for other in names:
            require(other, str, f"each name of allow of '{name}'")

        attached = (*rest.attached, replace(held, allow=names))
        return Scene(rest.obstacles, attached, self.allowed_collisions, self.contacts)

    def detaching(self, name: str, pose: ArrayLike | pin.SE3) -> Scene:
        """Return the scene in which an attached object has become an obstacle at T_world_object.

        It keeps its margin and colour. The settings of the grasp end: its padding, what it was allowed to touch, and
        its contacts.

        Raises:
            UnknownNameError: If there is no attached object of that name.
            InputError: If ``pose`` is not a pose.
        """
        require(name, str, "name of an attached object")
        held = {a.name: a for a in self.attached}
        if name not in held:
            raise UnknownNameError("attached object", name, held)

        item = held.pop(name)
        free = Obstacle(name, item.shape, pose, margin=item.margin, color=item.color)
        contacts = tuple(contact for contact in self.contacts if name not in contact.pair)
        return Scene((*self.obstacles, free), tuple(held.values()), self.allowed_collisions, contacts)

    def at(self, time: float) -> Scene:
        """Return the scene with ``time`` [s] as its new time 0: moving obstacles are at their poses then, and go on.

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
    """Return the pose of an obstacle at a time [s], by its motion if it has one."""
    return obstacle.pose if obstacle.motion is None else obstacle.motion.pose_at(obstacle.pose, time)


def pairs_that_may_touch(scene: Scene) -> frozenset[tuple[frozenset[str], float | None]]:
    """Return the pairs of names that may touch, each with the least distance of a contact [m] or None."""
    held = ((item.name, name) for item in scene.attached for name in item.allow)
    allowed = ((frozenset(pair), None) for pair in (*scene.allowed_collisions, *held))
    return frozenset([*allowed, *((each.pair, each.distance) for each in scene.contacts)])


def unnamed(scene: Scene, gone: AbstractSet[str]) -> Scene:
    """Return a scene in which no pair, contact or grasp names what is gone; the same one if none does."""
    pairs = tuple(pair for pair in scene.allowed_collisions if not gone & set(pair))
    contacts = tuple(contact for contact in scene.contacts if not gone & contact.pair)
    attached = tuple(
        replace(item, allow=tuple(name for name in item.allow if name not in gone)) if gone & set(item.allow) else item
        for item in scene.attached
    )
    kept = len(pairs) == len(scene.allowed_collisions) and len(contacts) == len(scene.contacts)
    if kept and all(new is old for new, old in zip(attached, scene.attached, strict=True)):
        return scene
    return replace(scene, attached=attached, allowed_collisions=pairs, contacts=contacts)


def exchanged(scene: Scene, number: int, obstacle: Obstacle) -> Scene:
    """Return the scene with an obstacle replaced by one of the same name, without other checks."""
    obstacles = list(scene.obstacles)
    obstacles[number] = obstacle
    return changed(scene, obstacles=tuple(obstacles))
