"""The world of a session: the problem's scene with the objects seen by the camera; rebuilt only when they move."""

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

MAX_SHIFT = 5e-3  # [m]; a route is withdrawn if its target has moved farther
MAX_TURN = np.deg2rad(1.0)  # the same for a rotation of the target
MIN_SHIFT = 1e-3  # [m]; smaller changes are noise
MIN_ROTATION = np.deg2rad(0.2)


class Structure(NamedTuple):
    """The object to which the problem's obstacles are fixed if the vehicle moves.

    Attributes:
        name: Name of an object of the marker map.
        T_base_object: Its pose when the obstacles are at their poses in the problem.
    """

    name: str
    T_base_object: pin.SE3


class HeldObject(NamedTuple):
    """The object in the gripper.

    Attributes:
        seen: The object as it was seen last.
        T_tip_object: Its pose in the frame of the tip.
        rests: Contacts with bodies from which it has not yet been separated.
    """

    seen: SeenObject
    T_tip_object: pin.SE3
    rests: tuple[Touching, ...]


class MayTouch(NamedTuple):
    """Permitted contacts of the gripper, and of what it holds, with one object.

    Attributes:
        contacts: How far each part and each solid of the object may overlap.
        buried: Pairs that overlap too deeply at a grasp for a penetration limit to prevent passing through. These pairs
            are not checked.
    """

    contacts: tuple[Touching, ...]
    buried: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """The world with the objects as they were seen last. Immutable: every change returns a new value.

    Attributes:
        given: The problem's world.
        structure: The object to which its obstacles are fixed; None if they move with the arm's base.
        held: The object in the gripper, as part of the arm; None if there is none.
        version: Counts the changes of the world.
    """

    given: World
    structure: Structure | None = None
    held: HeldObject | None = None
    version: int = 0
    _seen_objects: Mapping[str, SeenObject] = field(default_factory=dict)
    # T_object_tip at the moment of release, by name of the object that was put down.
    _tip_at_release: Mapping[str, pin.SE3] = field(default_factory=dict)
    # The world with seen and held objects; None as long as there are none.
    _world_with_objects: World | None = None
    # Caches by name of the object that may be touched. The first is valid for these surroundings only, the second as
    # long as the same object is held.
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
        """Names of the objects whose poses determine the world: the structure, and all that were seen."""
        fixed = () if self.structure is None else (self.structure.name,)
        return tuple(dict.fromkeys((*fixed, *self._seen_objects)))

    def named(self, name: str) -> SeenObject | None:
        """Return an object as it was seen last; None if it was never seen."""
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
        """Return the objects seen now or earlier as plain values, for a record.

        Rotations are stored as matrices, not quaternions: a replay must find the same routes, to the last bit.
        """
        return [_plain(object_seen) for object_seen in self.seen]

    def see(self, objects: Sequence[SeenObject]) -> Surroundings:
        """Return the surroundings after a picture; they are the same object if nothing is new or has moved."""
        held_name = "" if self.held is None else self.held.seen.object.name
        candidates = [object_seen for object_seen in objects if object_seen.object.name != held_name]
        changed = [object_seen for object_seen in candidates if self._has_moved(object_seen)]
        if not changed:
            return self

        seen = {**self._seen_objects, **{object_seen.object.name: object_seen for object_seen in changed}}
        return self._renewed(_seen_objects=seen)

    def hold(self, seen: SeenObject, T_tip_object: pin.SE3, q: Vector) -> Surroundings:
        """Return the surroundings with an object in the gripper.

        Contacts of the object at q, shape (dof,), stay permitted until both bodies have separated, with at most a
        millimetre more overlap than now; see `held`.
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
        """Return the surroundings with the held object put down where it is at a pose of the tip."""
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
        """Return the surroundings after a reading of the arm at q, shape (dof,).

        Bodies from which the held object has separated may not be touched again.
        """
        held = self.held
        if held is None or not held.rests:
            return self

        still_touching = tuple(contact for contact in held.rests if not parted(self.world, q, contact))
        return self if still_touching == held.rests else self._renewed(held=held._replace(rests=still_touching))

    def left_inside(self, q: Vector) -> str:
        """Return, in words, inside which obstacle an arm at q, shape (dof,), leaves the held object; "" if none."""
        names = () if self.held is None else self.held.seen.object.solid_names
        obstacle_names = {obstacle.name for obstacle in self.world.scene.obstacles}

        touched = [touch for name in names for touch in touching_at(self.world, q, name)]
        touched_obstacles = [touch for touch in touched if touch.second in obstacle_names]
        deepest = min(touched_obstacles, key=lambda touch: touch.distance, default=None)
        return left_inside(deepest) if deepest is not None and deepest.too_deep else ""

    def held_solids(self, T_base_tip: pin.SE3) -> tuple[Obstacle, ...]:
        """Return the solids of the held object at a pose of the tip."""
        held = self.held
        return () if held is None else replace(held.seen, T_base_object=T_base_tip * held.T_tip_object).solids()

    def holding(self, name: str) -> World:
        """Return the world in which the gripper may touch an object."""
        if name not in self._worlds_touching:
            grip = self._contacts_allowed(name)
            self._worlds_touching[name] = self.world_with((*grip.contacts, *self.rests), grip.buried)
        return self._worlds_touching[name]

    def not_compared(self, name: str) -> str:
        """Return a note on the solids of an object that are not checked against the gripper; "" if all are."""
        solids = sorted({solid for _, solid in self._contacts_allowed(name).buried})
        return f" (the gripper is not compared with {', '.join(solids)})" if solids else ""

    def _contacts_allowed(self, name: str) -> MayTouch:
        """Return the permitted contacts with an object: no deeper than at one of its grasps, plus a tolerance.

        A held object may overlap a millimetre more. The gripper itself may in addition overlap by as much as an object
        may have moved before a route to it is withdrawn. Pairs that exceed the deepest detectable contact are not
        checked.
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
        """Return the least distance of each part of the gripper to each solid of an object over all its grasps.

        The gripper includes what it holds. The object is placed at the tip once for each grasp, and once at the
        relative pose at which it was released last.

        Returns:
            By pair of part and solid; negative distances are penetration depths [m].
        """
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
        """Return the world for an arm at q, shape (dof,).

        If the arm is in contact with the target alone, this is the world in which the gripper may touch it: the arm
        came there by a route to a grasp, because no other motion may end in contact.
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
        """Return the world of the problem with seen and held objects.

        Args:
            contacts: Pairs that may overlap, and how far.
            buried: Pairs that are not checked.
        """
        given = self._fixed_scene()
        scene = scene_with(given, [solid for each in self._seen_objects.values() for solid in each.solids()])
        attached = (*given.attached, *self._attached())
        changed = replace(scene, attached=attached, allowed_collisions=(*given.allowed_collisions, *buried))
        return self.given.with_accuracy("exact").with_scene(with_contacts(changed, contacts))

    def _renewed(self, **changes: Any) -> Surroundings:
        """Return changed surroundings with a new world, and without results cached for the old one."""
        changed = replace(self, version=self.version + 1, _worlds_touching={}, **changes)
        return replace(changed, _world_with_objects=changed.world_with(changed.rests))

    @property
    def rests(self) -> tuple[Touching, ...]:
        """How far the held object may overlap with bodies from which it has not yet been separated."""
        return () if self.held is None else self.held.rests

    def _attached(self) -> list[AttachedObject]:
        """Return the held object as a part of the arm; the uncertainty of its pose adds to its margin."""
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
                color=solid.color,
            )
            for name, solid in zip(marked_object.solid_names, marked_object.solids, strict=True)
        ]

    def _fixed_scene(self) -> Scene:
        """Return the problem's scene at the pose of the structure; the uncertainty of this pose adds to the margins."""
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
    """Return the names of the links carried by the last joint before the tip, including links of joints beyond it."""
    model: Any = robot.model
    last = model.frames[model.getFrameId(robot.tip)].parentJoint

    below = set(model.subtrees[last])
    bodies = (frame for frame in model.frames if frame.type == pin.FrameType.BODY)
    return tuple(frame.name for frame in bodies if frame.parentJoint in below)
