"""The worlds of a task, with what another instance of it has left: tables are taken over, not made again.

A task needs ten worlds or more: the hand is open or closed, things stand, are held, and touch each other. From one
instance of a task to the next most of them are the same. In the others some things stand elsewhere, or are held
elsewhere, which :meth:`rrtik_ompl.World.moved` and :func:`~rrtik_ompl.world.world.held_elsewhere` do in place. What a
world has proven before is forgotten, so that answers do not depend on it.
"""

from __future__ import annotations

import threading
from collections.abc import Hashable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from rrtik_ompl.base.copies import changed
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import AttachedObject, Obstacle, Scene, Touching
from rrtik_ompl.world.world import World, form_of, held_elsewhere

MOST_KEPT = 64  # worlds without contacts that are left to the next task
MOST_HELD = 4  # ways to hold things for each of which worlds are left; another one takes the place of the oldest
MOST_MOVED = 4  # things that are moved in a world; if there are more, it is made anew


@dataclass(frozen=True, slots=True, eq=False)
class Known:
    """A world without contacts, and the worlds of the same scene with contacts, by these.

    The kind is what is equal for worlds that differ in poses alone; places are these poses, obstacles first.
    """

    kind: Hashable
    places: tuple[bytes, ...]
    world: World
    in_contact: dict[tuple[Touching, ...], World] = field(default_factory=dict)

    def with_contacts(self, contacts: tuple[Touching, ...]) -> World:
        """Return the world with some contacts."""
        if contacts and contacts not in self.in_contact:
            self.in_contact[contacts] = form_of(self.world, scene=changed(self.world.scene, contacts=contacts))
        return self.in_contact[contacts] if contacts else self.world


class Worlds:
    """The worlds of one task, by robot and scene.

    Args:
        first: The world at its beginning, whose other settings all of them have. If it has no tables yet, what is left
            takes its place.
        left: What earlier tasks with the same settings have left, the latest last; taken over from here.
    """

    def __init__(self, first: World, left: list[Known] | None = None) -> None:
        self._first = first
        self._left = [] if left is None else left
        self._made: dict[Hashable, Known] = {}
        if not first.scene.contacts and (not self._left or _used(first)):
            kind = _kind(first.robot, first.scene)
            places = _places(first.scene)
            self._made[kind, places] = Known(kind, places, first)

    def of(self, robot: Robot, scene: Scene) -> World:
        """Return the world of a robot in a scene."""
        return self._known(robot, scene).with_contacts(scene.contacts)

    def bare(self, robot: Robot, scene: Scene) -> World:
        """Return the world of a robot in a scene without its contacts."""
        return self._known(robot, scene).world

    def _known(self, robot: Robot, scene: Scene) -> Known:
        """Return the world without contacts; it is made, or taken over, if there is none yet."""
        kind = _kind(robot, scene)
        places = _places(scene)
        if (kind, places) not in self._made:
            bare = changed(scene, contacts=())
            known = self._taken_over(kind, places, bare)
            if known is None:
                made = form_of(self._first, robot=robot, scene=scene if not scene.contacts else bare)
                known = Known(kind, places, made)
            self._made[kind, places] = known
        return self._made[kind, places]

    def left(self) -> list[Known]:
        """Return what the next task may take over, the latest last: not the world that somebody has given."""
        return [*self._left, *(known for known in self._made.values() if known.world is not self._first)]

    def _taken_over(self, kind: Hashable, places: tuple[bytes, ...], scene: Scene) -> Known | None:
        """Return a world that an earlier task has left, with all things where they are now; None if there is none."""
        alike = [known for known in self._left if known.kind == kind]
        standing = len(scene.obstacles)
        held_alike = [known for known in alike if known.places[standing:] == places[standing:]]
        same = [known for known in held_alike if known.places == places]
        oldest = alike[:1] if len(alike) >= MOST_HELD else []
        found = same or held_alike or oldest
        if not found:
            return None
        known = found[-1]
        self._left.remove(known)

        both = zip(_things(scene), places, known.places, strict=True)
        moved = [thing for thing, new, old in both if new != old]
        if len(moved) > MOST_MOVED:
            return None
        world = known.world
        for thing in moved:
            if isinstance(thing, AttachedObject):
                world = held_elsewhere(world, thing)
            else:
                world = world.moved(thing.name, thing.pose)
        return Known(kind, places, world) if moved else known


class Left(threading.local):
    """The worlds that tasks with one robot have left, in each thread."""

    def __init__(self) -> None:
        self.worlds: list[Known] = []


@contextmanager
def worlds_from(first: World, left: Left) -> Iterator[Worlds]:
    """Yield the worlds for a task, with those that are left by earlier ones; the next one takes them over."""
    worlds = Worlds(first, left.worlds)
    yield worlds
    left.worlds = worlds.left()[-MOST_KEPT:]


def _used(world: World) -> bool:
    """Check whether a world has tables already."""
    return world.prover.tables.packed is not None or "checker" in vars(world.checks)


def _kind(robot: Robot, scene: Scene) -> Hashable:
    """Return what is equal for scenes that differ in poses alone."""
    obstacles = tuple((each.name, id(each.shape), each.margin, id(each.motion)) for each in scene.obstacles)
    held = tuple(
        (each.name, each.link, id(each.shape), each.allow, each.padding, each.margin) for each in scene.attached
    )
    return id(robot), obstacles, held, scene.allowed_collisions


def _places(scene: Scene) -> tuple[bytes, ...]:
    return tuple(map(_pose, _things(scene)))


def _things(scene: Scene) -> list[Obstacle | AttachedObject]:
    return [*scene.obstacles, *scene.attached]


def _pose(thing: Obstacle | AttachedObject) -> bytes:
    matrix: bytes = thing.pose.homogeneous.tobytes()
    return matrix
