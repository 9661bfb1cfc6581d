"""Check the assumptions of a plan's motions: contacts that exist, and things that stay where they were.

A plan may come from a file that was changed, so nothing it states is trusted: a contact may be no deeper than the
overlap of the two things where it begins, and at the beginning of a motion each thing must be the same, and in the same
place, as at the end of the motion before.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.geometry.collision.bodies import DISTANCE_TOLERANCE
from rrtik_ompl.model.judgement import Violation
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import AttachedObject, Obstacle, Scene, Touching
from rrtik_ompl.model.shapes.shape import same_shape
from rrtik_ompl.tasks.contact_life import EXTRA_DEPTH, SMALL_OVERLAP, MotionContact, contacts_from, touching_at
from rrtik_ompl.world.world import World

MOVED = 1e-6  # [m, rad] change of a thing's pose between two motions that counts as rounding


def standing_faults(
    paths: Sequence[JointPath],
    worlds: Sequence[World],
    contacts: Sequence[Sequence[MotionContact]],
    end: World | None,
) -> list[list[Violation]]:
    """Return the false statements about each motion: contacts that are too deep, unknown names, changed things.

    Args:
        paths: The motions.
        worlds: The world of each motion.
        contacts: The contacts on which each motion depends.
        end: The world after the last motion; changes there are faults of the last motion.
    """
    faults_of_motions: list[list[Violation]] = []
    before: tuple[Touching, ...] = ()

    for number, (path, world, stood_on) in enumerate(zip(paths, worlds, contacts, strict=True)):
        reasons = _false_names(world, stood_on)
        reasons += _too_deep(world, path.start, stood_on, before)
        if number:
            reasons += _changes(worlds[number - 1], world, paths[number - 1].end)
        faults_of_motions.append([Violation(0, path.start, f"motion {number + 1}: {reason}") for reason in reasons])

        known_contacts = {each.touching for each in stood_on}
        others = (contact for contact in world.scene.contacts if contact not in known_contacts)
        before = (*others, *contacts_from(stood_on, len(path.waypoints)))

    if end is not None and paths:
        changes = _changes(worlds[-1], end, paths[-1].end)
        last = max(len(paths[-1].waypoints) - 2, 0)
        faults_of_motions[-1] += [
            Violation(last, paths[-1].end, f"after motion {len(paths)}: {reason}") for reason in changes
        ]
    return faults_of_motions


def _false_names(world: World, stood_on: Sequence[MotionContact]) -> list[str]:
    """Return the faults of contacts that a motion is said to depend on but that its scene does not have."""
    names = {*world.scene.names, *world.robot.link_names}
    faults = []
    for each in stood_on:
        first, second = each.touching.names
        unknown = [name for name in (first, second) if name not in names]
        if unknown:
            faults.append(f"contact of '{first}' and '{second}': there is no link or object '{unknown[0]}'")
        elif each.touching not in world.scene.contacts:
            faults.append(f"contact of '{first}' and '{second}': the motion's scene has no such contact")
    return faults


def _too_deep(world: World, q: Vector, stood_on: Sequence[MotionContact], before: Sequence[Touching]) -> list[str]:
    """Return the faults of contacts that allow more overlap than there is where they begin.

    Args:
        world: The world of the motion.
        q: Configuration at which the motion begins, shape (dof,).
        stood_on: Contacts on which the motion depends.
        before: Contacts at the end of the motion before, which may continue.
    """
    distance_of_pair = {contact.pair: contact.distance for contact in before}
    named = {each.touching for each in stood_on if each.allowed}
    faults = []

    for contact in world.scene.contacts:
        is_deeper_than_before = contact.distance < distance_of_pair.get(contact.pair, 0.0)
        if is_deeper_than_before and contact.distance < -EXTRA_DEPTH - DISTANCE_TOLERANCE:
            depth = _depth(world, q, contact)
            deepest_allowed = (depth if contact in named else min(depth, SMALL_OVERLAP)) + EXTRA_DEPTH
            if contact.distance < -deepest_allowed - DISTANCE_TOLERANCE:
                faults.append(_deeper(contact.names, contact.distance, deepest_allowed, depth))

    for each in stood_on:
        if each.then is not None and each.then < -EXTRA_DEPTH - DISTANCE_TOLERANCE:
            faults.append(_deeper(each.touching.names, each.then, EXTRA_DEPTH, 0.0))
    return faults


def _deeper(names: tuple[str, str], distance: float, deepest_allowed: float, depth: float) -> str:
    """Return a message that a contact allows too much."""
    first, second = names
    fault = f"may overlap by {1e3 * deepest_allowed:.3g} mm at most, not by {-1e3 * distance:.4g} mm"
    return f"contact of '{first}' and '{second}': they {fault}; where it begins they overlap by {1e3 * depth:.3g} mm"


def _depth(world: World, q: Vector, contact: Touching) -> float:
    """Return the penetration depth of two things at q, shape (dof,), where their contact begins [m]."""
    if not set(contact.names) & set(world.scene.names):
        return 0.0
    name, other = contact.names if contact.first in world.scene.names else contact.names[::-1]
    distances = [each.distance for each in touching_at(world, q, name) if each.second == other]
    may_have_let_go = world.robot.gripper is not None and other in world.robot.link_names
    # The fingers may have moved away since they released it.
    least_depth = EXTRA_DEPTH if may_have_let_go else 0.0
    return max([least_depth, *(-distance for distance in distances)])


def _changes(before: World, after: World, q: Vector) -> list[str]:
    """Return what differs between a world and the one before it, at q, shape (dof,), between two motions.

    Between motions fingers move and things are taken and set down; everything else must stay as it is.
    """
    faults = []
    if _lasting(before.robot) != _lasting(after.robot):
        faults.append("the robot is not described as in the motion before")
    if set(before.scene.allowed_collisions) != set(after.scene.allowed_collisions):
        faults.append("the allowed collisions are not those of the motion before")

    old = _things(before.scene)
    new = _things(after.scene)
    faults += [f"'{name}' is in one of the scenes before and after, not in both" for name in sorted(old.keys() ^ new)]
    for name in sorted(old.keys() & new):
        faults += [f"'{name}' has not the {what} that it had before" for what in _altered(old[name], new[name])]
        shift, angle = _between(old[name], new[name], before, after, q)
        if max(shift, angle) > MOVED:
            faults.append(
                f"'{name}' is not where the motion before has left it: "
                f"{1e3 * shift:.3g} mm and {np.degrees(angle):.3g} deg away"
            )
    return faults


def _lasting(robot: Robot) -> dict[str, Any]:
    """Return the description of a robot without the positions of its fingers."""
    fingers = () if robot.gripper is None else robot.gripper.joints
    locked = {name: value for name, value in robot.source.get("locked", {}).items() if name not in fingers}
    return {**robot.source, "locked": locked}


def _altered(old: Obstacle | AttachedObject, new: Obstacle | AttachedObject) -> list[str]:
    """Return the names of the properties that a thing must keep from one motion to the next but has not kept."""
    altered = [] if same_shape(old.shape, new.shape) else ["shape"]
    altered += [] if old.margin == new.margin else ["margin"]
    if isinstance(old, AttachedObject) and isinstance(new, AttachedObject) and old.link == new.link:
        altered += [] if old.padding == new.padding else ["padding"]
        altered += [] if set(old.allow) == set(new.allow) else ["list of what it may touch"]
    return altered


def _things(scene: Scene) -> dict[str, Obstacle | AttachedObject]:
    standing: dict[str, Obstacle | AttachedObject] = {thing.name: thing for thing in scene.obstacles}
    return standing | {thing.name: thing for thing in scene.attached}


def _between(
    old: Obstacle | AttachedObject, new: Obstacle | AttachedObject, before: World, after: World, q: Vector
) -> tuple[float, float]:
    """Return how far a thing has moved [m] and turned [rad] from one world to the next.

    Fingers that move between the two worlds carry along what they hold, so the place of the link in either world is
    accepted, and the smallest difference counts.
    """
    both_stand = isinstance(old, Obstacle) and isinstance(new, Obstacle)
    if both_stand and np.array_equal(old.pose.homogeneous, new.pose.homogeneous):
        return 0.0, 0.0

    differences = []
    if isinstance(old, AttachedObject) and isinstance(new, AttachedObject) and old.link == new.link:
        differences.append(old.pose.actInv(new.pose))
    else:
        for robot_before in (before, after):
            for robot_after in (before, after):
                place = _place(old, robot_before, q)
                differences.append(place.actInv(_place(new, robot_after, q)))

    sizes = [
        (float(np.linalg.norm(each.translation)), float(np.linalg.norm(pin.log3(each.rotation))))
        for each in differences
    ]
    return min(sizes, key=max)


def _place(thing: Obstacle | AttachedObject, world: World, q: Vector) -> pin.SE3:
    return world.robot.fk(q, thing.link) * thing.pose if isinstance(thing, AttachedObject) else thing.pose
