"""The world of a session: the problem's scene with the objects that the camera sees; made anew only when they move."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import apart
from rrtik_ompl.geometry.collision.bodies import deepest_contact
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import AttachedObject, Obstacle, Scene, Touching
from rrtik_ompl.sensing.scene_from_view import SeenObject, scene_with
from rrtik_ompl.tasks.contact_life import (
    EXTRA_DEPTH,
    Nearness,
    allowed,
    left_inside,
    parted,
    touching_at,
    with_contacts,
)
from rrtik_ompl.world.world import World

MAX_SHIFT = 5e-3  # [m]; a target that has moved farther is not where a route ends
MAX_TURN = np.deg2rad(1.0)  # nor one that has turned by more
MIN_SHIFT = 1e-3  # [m]; smaller changes are noise
MIN_ROTATION = np.deg2rad(0.2)


class Structure(NamedTuple):
    """What the problem's obstacles are fixed to, where the vehicle may move.

    Attributes:
        name: Of an object of the marker map.
        T_base_object: Its pose when the obstacles are where the problem says.
    """

    name: str
    T_base_object: pin.SE3


class HeldObject(NamedTuple):
    """What the gripper holds: as it was seen last, its place in the gripper, and what it has not parted from."""

    seen: SeenObject
    T_tip_object: pin.SE3
    rests: tuple[Touching, ...]


class MayTouch(NamedTuple):
    """What the gripper, with what it holds, may touch of an object.

    Attributes:
        contacts: How far each part of it and each solid of the object may overlap.
        buried: Pairs that overlap so deep at a grasp that no depth keeps them from passing through: not compared.
    """

    contacts: tuple[Touching, ...]
    buried: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """Worlds with the objects as they were seen last, as a value: what changes them gives another one.

    Attributes:
        given: The problem's world.
        structure: To what its obstacles are fixed; None if they move with the arm's base.
        held: What the gripper holds, as part of the arm; None if nothing.
        version: Counts how often the world became another one.
    """

    given: World
    structure: Structure | None = None
    held: HeldObject | None = None
    version: int = 0
    _seen_objects: Mapping[str, SeenObject] = field(default_factory=dict)
    # T_object_tip of what was put down: where the tip was in it.
    _tip_at_release: Mapping[str, pin.SE3] = field(default_factory=dict)
    # Of what was seen and is held; None before there was anything.
    _world_with_objects: World | None = None
    # Results by name of the object that may be touched: of these surroundings, and as long as the same thing is held.
    _worlds_touching: dict[str, World] = field(default_factory=dict)
    _allowed_contacts: dict[str, MayTouch] = field(default_factory=dict)

    @property
    def world(self) -> World:
        """The world in which nothing may be touched."""
        return self.given if self._world_with_objects is None else self._world_with_objects

    @property
    def seen(self) -> tuple[SeenObject, ...]:
        """The objects seen now or earlier."""
        return tuple(self._seen_objects.values())

    @property
    def basis(self) -> tuple[str, ...]:
        """Names of the objects by whose places the world is made: the structure, and all that was seen."""
        fixed = () if self.structure is None else (self.structure.name,)
        return tuple(dict.fromkeys((*fixed, *self._seen_objects)))

    def named(self, name: str) -> SeenObject | None:
        """An object as it was seen last, None if it was never seen."""
        return self._seen_objects.get(name)

    def check_grasp(self, name: str | None, type: str, level: int) -> None:
        """Check that an object was seen and has a grasp.

        Raises:
            InputError: If it was not, or it has no such type or level.
        """
        if name is None:
            raise InputError("no object is chosen; choose one that is in view")

        seen = self.named(name)
        if seen is None:
            raise InputError(f"{name} was not seen yet")

        count = len(seen.object.grasp(type).levels)
        if not 0 <= level < count:
            raise InputError(f"level must be 1 to {count}, got {level + 1}")

    def places(self) -> list[dict[str, Any]]:
        """The objects seen now or earlier as plain values, for a record.

        Matrices and not quaternions: a replay has to find the same routes, to the last bit.
        """
        return [_plain(object_seen) for object_seen in self.seen]

    def see(self, objects: Sequence[SeenObject]) -> Surroundings:
        """With the objects that the camera sees; these surroundings themselves if none of them is new or has moved."""
        held_name = "" if self.held is None else self.held.seen.object.name
        candidates = [object_seen for object_seen in objects if object_seen.object.name != held_name]
        changed = [object_seen for object_seen in candidates if self._has_moved(object_seen)]
        if not changed:
            return self

        seen = {**self._seen_objects, **{object_seen.object.name: object_seen for object_seen in changed}}
        return self._renewed(_seen_objects=seen)

    def hold(self, seen: SeenObject, T_tip_object: pin.SE3, q: Vector) -> Surroundings:
        """With an object in the gripper; what it touches at q, shape (dof,), it may until the two have parted.

        How far they may overlap says `held`: a millimetre more than now.
        """
        other_objects = {name: other for name, other in self._seen_objects.items() if name != seen.object.name}
        held_object = HeldObject(seen, T_tip_object, ())
        world = replace(self, held=held_object, _seen_objects=other_objects, _allowed_contacts={}).world_with(())

        own_solids = seen.object.solid_names
        touching_pairs = [frozenset((contact.first, contact.second)) for contact in world.contacts(q)]
        rests = {pair: allowed(world.bodies, *sorted(pair)) for pair in touching_pairs if pair & set(own_solids)}
        rests |= {touching.pair: touching.going_on() for name in own_solids for touching in touching_at(world, q, name)}

        held_object = held_object._replace(rests=tuple(rests.values()))
        return self._renewed(held=held_object, _seen_objects=other_objects, _allowed_contacts={})

    def release(self, T_base_tip: pin.SE3) -> Surroundings:
        """With what is held where it is for a pose of the tip."""
        held = self.held
        if held is None:
            return self
        name = held.seen.object.name
        placed = replace(held.seen, T_base_object=T_base_tip * held.T_tip_object, sighting=None)

        return self._renewed(
            held=None,
            _seen_objects={**self._seen_objects, name: placed},
            _tip_at_release={**self._tip_at_release, name: held.T_tip_object.inverse()},
            _allowed_contacts={},
        )

    def settle(self, q: Vector) -> Surroundings:
        """What is held may not touch again what it has parted from with an arm at q, shape (dof,)."""
        held = self.held
        if held is None or not held.rests:
            return self

        still_touching = tuple(contact for contact in held.rests if not parted(self.world, q, contact))
        return self if still_touching == held.rests else self._renewed(held=held._replace(rests=still_touching))

    def left_inside(self, q: Vector) -> str:
        """What is held would be left deep inside something by an arm at q, shape (dof,), in words; "" if not."""
        names = () if self.held is None else self.held.seen.object.solid_names
        obstacle_names = {obstacle.name for obstacle in self.world.scene.obstacles}

        touched = [touch for name in names for touch in touching_at(self.world, q, name)]
        touched_obstacles = [touch for touch in touched if touch.second in obstacle_names]
        deepest = min(touched_obstacles, key=lambda touch: touch.distance, default=None)
        return left_inside(deepest) if deepest is not None and deepest.too_deep else ""

    def held_solids(self, T_base_tip: pin.SE3) -> tuple[Obstacle, ...]:
        """The solids of what is held, for a pose of the tip."""
        held = self.held
        return () if held is None else replace(held.seen, T_base_object=T_base_tip * held.T_tip_object).solids()

    def holding(self, name: str) -> World:
        """The world in which the gripper may touch an object."""
        if name not in self._worlds_touching:
            grip = self._contacts_allowed(name)
            self._worlds_touching[name] = self.world_with((*grip.contacts, *self.rests), grip.buried)
        return self._worlds_touching[name]

    def not_compared(self, name: str) -> str:
        """Which solids of an object are so deep in the gripper at a grasp that they are not compared; "" if none."""
        solids = sorted({solid for _, solid in self._contacts_allowed(name).buried})
        return f" (the gripper is not compared with {', '.join(solids)})" if solids else ""

    def _contacts_allowed(self, name: str) -> MayTouch:
        """What the gripper may touch of an object, and what it holds: no deeper than at one of the object's grasps.

        What it holds may come a millimetre nearer than there. The gripper itself may be as far off as an object may
        have moved before a route to it is withdrawn.
        """
        if name in self._allowed_contacts:
            return self._allowed_contacts[name]

        nearness = self._nearness_at_grasps(name)

        links = gripper_links(self.given.robot)
        contacts = []
        buried = []

        for pair, reach in nearness.items():
            part, solid = pair
            leeway = EXTRA_DEPTH + MAX_SHIFT if part in links else EXTRA_DEPTH
            if reach.distance < -reach.deepest and part in links:
                buried.append(pair)
            else:
                contacts.append(Touching(part, solid, max(min(reach.distance, 0.0) - leeway, -reach.deepest)))

        self._allowed_contacts[name] = MayTouch(tuple(contacts), tuple(buried))
        return self._allowed_contacts[name]

    def _nearness_at_grasps(self, name: str) -> dict[tuple[str, str], Nearness]:
        """How near each part of the gripper, and of what it holds, comes to each solid of an object at its grasps."""
        seen = self._seen_objects[name]
        robot = self.given.robot
        attached = tuple(self._attached())
        marked_object = seen.object
        parts = (*gripper_links(robot), *(item.name for item in attached))

        q = robot.clamp(np.zeros((1, robot.dof)))[0]
        tip = robot.fk(q)

        tips = [level for grasp in marked_object.grasps for level in grasp.levels]
        if name in self._tip_at_release:
            tips.append(self._tip_at_release[name])

        nearest: dict[tuple[str, str], Nearness] = {}
        for T_object_tip in tips:
            placed = replace(seen, T_base_object=tip * T_object_tip.inverse())
            world = self.given.with_scene(Scene(placed.solids(), attached))
            for part, solid in product(parts, marked_object.solid_names):
                not_touching = Nearness(part, solid, np.inf, deepest_contact(world.bodies, part, solid))
                nearest.setdefault((part, solid), not_touching)

            for touch in (touch for solid in marked_object.solid_names for touch in touching_at(world, q, solid)):
                pair = touch.second, touch.first
                if pair in nearest and touch.distance < nearest[pair].distance:
                    nearest[pair] = touch
        return nearest

    def world_at(self, q: Vector, target: str | None) -> World:
        """The world for an arm at q, shape (dof,): its gripper may touch the target if that alone is what it touches.

        It got there by a route to a grasp, for no other motion may end in contact.
        """
        if target is None or target not in self._seen_objects or self.world.valid(q):
            return self.world

        holding = self.holding(target)
        return holding if holding.valid(q) else self.world

    def _has_moved(self, new: SeenObject) -> bool:
        old = self._seen_objects.get(new.object.name)
        if old is None:
            return True

        shift, turn = apart(old.T_base_object, new.T_base_object)
        margin_change = max(_margins(new), default=0.0) - max(_margins(old), default=0.0)
        return shift > MIN_SHIFT or turn > MIN_ROTATION or abs(margin_change) > MIN_SHIFT

    def world_with(self, contacts: Sequence[Touching], buried: Sequence[tuple[str, str]] = ()) -> World:
        """The world of what is given, seen and held.

        Args:
            contacts: Pairs that may overlap, and how far.
            buried: Pairs that are not compared.
        """
        given = self._fixed_scene()
        scene = scene_with(given, [solid for each in self._seen_objects.values() for solid in each.solids()])
        attached = (*given.attached, *self._attached())
        changed = replace(scene, attached=attached, allowed_collisions=(*given.allowed_collisions, *buried))
        return self.given.with_accuracy("exact").with_scene(with_contacts(changed, contacts))

    def _renewed(self, **changes: Any) -> Surroundings:
        """With changes, the world made of them, and none of those kept."""
        changed = replace(self, version=self.version + 1, _worlds_touching={}, **changes)
        return replace(changed, _world_with_objects=changed.world_with(changed.rests))

    @property
    def rests(self) -> tuple[Touching, ...]:
        """How far what is held and what it has not parted from may overlap."""
        return () if self.held is None else self.held.rests

    def _attached(self) -> list[AttachedObject]:
        """What is held, as part of the arm; how far its place is uncertain adds to its margin."""
        held = self.held
        robot = self.given.robot
        if held is None:
            return []

        gripper = gripper_links(robot)
        marked_object = held.seen.object
        return [
            AttachedObject(
                name,
                robot.tip,
                solid.shape,
                held.T_tip_object * solid.pose,
                gripper,
                margin=solid.margin + held.seen.margin(solid),
            )
            for name, solid in zip(marked_object.solid_names, marked_object.solids, strict=True)
        ]

    def _fixed_scene(self) -> Scene:
        """The problem's scene where the structure is seen; how far that is uncertain is the margin of its obstacles."""
        given = self.given.scene
        structure = self.structure

        structure_seen = None if structure is None else self._seen_objects.get(structure.name)
        if structure is None or structure_seen is None:
            return given

        from_object = structure.T_base_object.inverse()
        in_structure = [replace(obstacle, pose=from_object * obstacle.pose) for obstacle in given.obstacles]
        in_base = [
            replace(
                obstacle,
                pose=structure_seen.T_base_object * obstacle.pose,
                margin=obstacle.margin + structure_seen.margin(obstacle),
            )
            for obstacle in in_structure
        ]
        return replace(given, obstacles=tuple(in_base))


def _plain(seen: SeenObject) -> dict[str, Any]:
    T = seen.T_base_object
    place = {"name": seen.object.name, "xyz": T.translation.tolist(), "rotation": T.rotation.tolist()}
    return place | {"covariance": seen.covariance.tolist(), "sigmas": seen.sigmas}


def _margins(seen: SeenObject) -> list[float]:
    return [solid.margin for solid in seen.solids()]


def gripper_links(robot: Robot) -> tuple[str, ...]:
    """The links that the last joint before the tip carries, with all that hangs on them."""
    model: Any = robot.model
    last = model.frames[model.getFrameId(robot.tip)].parentJoint

    below = set(model.subtrees[last])
    bodies = (frame for frame in model.frames if frame.type == pin.FrameType.BODY)
    return tuple(frame.name for frame in bodies if frame.parentJoint in below)
