"""Check the motion of a gripper's fingers while the arm stands still.

The positions of the fingers belong to the robot, so no joint of the robot moves them; opening the gripper gives another
robot. Between these two robots a finger on one joint moves along a screw. As in [16], two bodies are apart on a whole
interval if their distance at its middle exceeds what they can approach each other on half of it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeAlias

import coal
import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.kept import kept_with
from rrtik_ompl.description.catalog import robot_from_entry
from rrtik_ompl.geometry.collision.bodies import DISTANCE_TOLERANCE, Body, kept_apart
from rrtik_ompl.geometry.collision.body_arrays import body_arrays
from rrtik_ompl.geometry.collision.containment import Containment
from rrtik_ompl.geometry.collision.distances import signed_gap
from rrtik_ompl.geometry.collision.solids import Ends, around
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.tasks.contact_life import CONTACT_GAP, EXTRA_DEPTH, signed_distance
from rrtik_ompl.tasks.nearness import beyond, beyond_by_pieces
from rrtik_ompl.tasks.setting import Setting

MAX_LEVEL = 12  # deepest level of the bisection, with intervals of 1/4096 of the motion
SAME = 1e-7  # [m] or [rad] tolerance for a finger's pose at the middle of its motion to be on the screw
Check: TypeAlias = Callable[[Ends, float], bool]  # whether two placed geometries are farther apart than a distance [m]
REMEDY = "attach the object, move the gripper less, or allow the pair"


@dataclass(frozen=True, slots=True)
class FingerMotion:
    """The result of checking a motion of fingers.

    Attributes:
        fault: What is in their way; "" if nothing is.
        note: What is doubtful; "" if nothing is.
    """

    fault: str = ""
    note: str = ""


def finger_motion(before: Setting, after: Setting, q: Vector, things_taken: Sequence[str]) -> FingerMotion:
    """Check the motion of fingers against the scene and against what they carry.

    Args:
        before: The setting with the fingers where they are.
        after: The setting with the fingers where they are to be.
        q: Configuration of the arm, shape (dof,).
        things_taken: Names of things that are attached before the arm moves on: fingers may press on these.
    """
    bodies_before = before.world.bodies
    bodies_after = after.bare.bodies
    both = zip(bodies_before, bodies_after, strict=True)
    moving = {k for k, (a, b) in enumerate(both) if a.joint > 0 and not _same_pose(a.placement, b.placement)}
    if not moving:
        return FingerMotion()
    if not _on_screws(before.robot, after.robot):
        return FingerMotion(note="the way of the fingers is not checked: it is not about or along one axis")

    note = _pressed_in(before, after, q, moving, things_taken)
    frames = before.robot.joint_frames(q[None])[0]
    things = set(before.scene.names)
    pairs = []
    for i, j in before.world.pairs:
        if i in moving or j in moving:
            names = {bodies_before[i].name, bodies_before[j].name}
            if names & things and not names & set(things_taken):
                pairs.append((i, j))

    numbers = sorted({k for pair in pairs for k in pair})
    parts = {k: _Part.of(bodies_before[k], bodies_after[k], frames) for k in numbers}
    near = _not_far_apart(bodies_before, pairs, frames, parts)
    fault = _meeting(bodies_before, parts, near, frames)
    if fault is not None:
        first, second = (bodies_before[k].name for k in fault)
        return FingerMotion(fault=f"contact of the fingers on their way: '{first}' and '{second}'; {REMEDY}")
    return FingerMotion(note=note)


def _pressed_in(before: Setting, after: Setting, q: Vector, moving: set[int], things_taken: Sequence[str]) -> str:
    """Return a note on the finger that closes deepest into a thing that is held or taken next, or "".

    Fingers that open or rest are ignored.

    Args:
        before: The setting with the fingers where they are.
        after: The setting with the fingers where they are to be.
        q: Configuration of the arm, shape (dof,).
        moving: Numbers of the bodies that move.
        things_taken: Names of things that are attached next.
    """
    bodies_before = before.world.bodies
    bodies_after = after.bare.bodies
    names_held = {item.name for item in after.scene.attached} | set(things_taken)
    numbers_held = [k for k in range(len(bodies_after)) if bodies_after[k].name in names_held and k not in moving]
    frames = after.robot.joint_frames(q[None])[0]

    deepest = EXTRA_DEPTH + DISTANCE_TOLERANCE
    note = ""
    for finger in sorted(moving):
        for thing in numbers_held:
            depth = -signed_distance(after.robot, (bodies_after[finger], bodies_after[thing]), q, frames)
            if depth <= deepest:
                continue
            depth_before = -signed_distance(before.robot, (bodies_before[finger], bodies_before[thing]), q, frames)
            # The finger opens or rests.
            if depth_before >= depth:
                continue
            deepest = depth
            note = f"'{bodies_after[finger].name}' closes {1e3 * depth:.3g} mm deep into '{bodies_after[thing].name}'"

    return f"{note}; give a width that only touches it" if note else ""


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """A body that stands still or moves along a screw.

    Attributes:
        body: The body at the beginning.
        joint: Pose of its joint frame.
        twist: The screw from its beginning to its end, in its own frame, shape (6,).
        speed: How far any of its points moves at most from beginning to end [m].
    """

    body: Body
    joint: pin.SE3
    twist: Vector
    speed: float

    @classmethod
    def of(cls, first: Body, last: Body, frames: Matrix) -> _Part:
        """Return the part that moves from one place to another.

        Args:
            first: The body at the beginning.
            last: The body at the end, on the same joint.
            frames: Poses of all joint frames, shape (joints + 1, 4, 4).
        """
        twist = _twist(first, last)
        return cls(first, pin.SE3(frames[first.joint]), twist, _speed(first, twist))

    def at(self, share: float) -> coal.Transform3s:
        """Return the pose in the world at a share of the motion, from 0 to 1."""
        placement = self.body.placement
        if self.speed > 0.0 and share > 0.0:
            placement = placement * pin.exp6(share * self.twist)
        pose = self.joint * placement
        return coal.Transform3s(pose.rotation, pose.translation)


def _meeting(
    bodies: tuple[Body, ...], parts: Mapping[int, _Part], pairs: Sequence[tuple[int, int]], frames: Matrix
) -> tuple[int, int] | None:
    """Return the first pair of bodies that do not keep their required distance on the whole motion; None if all do.

    Args:
        bodies: All bodies, where they are before the motion.
        parts: Those of these pairs, by their numbers.
        pairs: Pairs of these numbers.
        frames: Poses of all joint frames, shape (joints + 1, 4, 4).
    """
    if not pairs:
        return None
    inside = Containment(bodies, tuple(pairs))
    for i, j in pairs:
        if inside.holds((i, j), frames) or not _apart(parts[i], parts[j]):
            return i, j
    return None


def _apart(first: _Part, second: _Part) -> bool:
    """Check whether two parts keep their distance on the whole motion.

    Their convex pieces are compared first. Meshes, which take much longer, are compared where these tell too little.
    """
    required = kept_apart(first.body, second.body)
    # A thing that the fingers release may continue to touch them, but hardly deeper.
    if not _beyond(first, second, 0.0, CONTACT_GAP):
        overlap_now = min(_depth_apart(first, second, 0.0), 0.0)
        required = min(required, overlap_now - EXTRA_DEPTH)

    least = required + DISTANCE_TOLERANCE
    return any(_always_beyond(first, second, least, check) for check in (beyond_by_pieces, beyond))


def _always_beyond(first: _Part, second: _Part, least: float, check: Check) -> bool:
    """Check whether two parts are always farther apart than a distance [m], with a bound on how fast they move [16]."""
    speed = first.speed + second.speed
    undecided = [(0, 0)]  # level and number of intervals
    while undecided:
        level, number = undecided.pop()
        width = 0.5**level
        middle = (number + 0.5) * width
        if _beyond(first, second, middle, least + 0.5 * width * speed, check):
            continue
        if level == MAX_LEVEL or not _beyond(first, second, middle, least, check):
            return False
        undecided += [(level + 1, 2 * number + 1), (level + 1, 2 * number)]
    return True


def _beyond(first: _Part, second: _Part, share: float, distance: float, check: Check = beyond) -> bool:
    """Check whether two parts are farther apart than a distance [m] at a share of their motion.

    A negative distance is compared with that of their convex hulls.
    """
    if distance < 0.0:
        return _depth_apart(first, second, share) > distance
    return check((first.body.geometry, first.at(share), second.body.geometry, second.at(share)), distance)


def _depth_apart(first: _Part, second: _Part, share: float) -> float:
    """Return the signed distance of two parts' convex hulls at a share of their motion [m]; coal knows their depth."""
    one, other = (around(part.body.geometry) for part in (first, second))
    return signed_gap((one, first.at(share), other, second.at(share)))


def _not_far_apart(
    bodies: tuple[Body, ...], pairs: Sequence[tuple[int, int]], frames: Matrix, parts: Mapping[int, _Part]
) -> list[tuple[int, int]]:
    """Return the pairs of bodies that a motion may bring together, by the boxes around them.

    Args:
        bodies: All bodies, where they are before the motion.
        pairs: Pairs of their numbers.
        frames: Poses of all joint frames, shape (joints + 1, 4, 4).
        parts: The bodies of these pairs, by their numbers.
    """
    if not pairs:
        return []
    arrays = body_arrays(bodies)
    numbers = np.array(pairs)
    moved = np.array([parts[k].speed if k in parts else 0.0 for k in range(len(bodies))])
    required = np.maximum(arrays.kept_apart(numbers), CONTACT_GAP) + moved[numbers].sum(axis=1) + DISTANCE_TOLERANCE
    near = arrays.least_gaps(numbers, frames) <= required
    return [pair for pair, is_near in zip(pairs, near.tolist(), strict=True) if is_near]


def _twist(first: Body, last: Body) -> Vector:
    """Return the screw from the place of a body to another one, shape (6,)."""
    if first.placement == last.placement:
        return np.zeros(6)
    return np.asarray(pin.log6(first.placement.actInv(last.placement)).vector)


def _speed(body: Body, twist: Vector) -> float:
    """Return an upper bound on how far any point of a body moves along a screw from beginning to end [m]."""
    if not twist.any():
        return 0.0  # also of a half-space, which has no reach
    x, y, z, *turn = twist.tolist()
    reach = math.hypot(*body.geometry.aabb_center) + float(body.geometry.aabb_radius)
    return math.hypot(x, y, z) + math.hypot(*turn) * reach


def _same_pose(first: pin.SE3, second: pin.SE3) -> bool:
    return first == second or bool(np.abs(first.homogeneous - second.homogeneous).max() <= SAME)


@kept_with
def _on_screws(before: Robot, after: Robot) -> bool:
    """Check whether every finger is, at the middle of its motion, where a single screw would take it."""
    middle = _robot_of_entry(_entry_of_middle(before, after))
    placements = [
        {(str(item.name), int(item.parentJoint)): item.placement for item in robot.collision.geometryObjects}
        for robot in (before, middle, after)
    ]

    return all(
        name in placements[1]
        and name in placements[2]
        and _same_pose(placements[1][name], _middle_of_screw(placement, placements[2][name]))
        for name, placement in placements[0].items()
    )


def _middle_of_screw(first: pin.SE3, last: pin.SE3) -> pin.SE3:
    """Return the pose half-way along the screw from one pose to another."""
    return first * pin.exp6(0.5 * pin.log6(first.actInv(last)).vector)


def _entry_of_middle(before: Robot, after: Robot) -> str:
    """Return the entry, as JSON, of the robot with its fingers at the middle of their motion."""
    values_before = before.source.get("locked", {})
    values_after = after.source.get("locked", {})
    middle_values = {name: 0.5 * (values_before.get(name, 0.0) + value) for name, value in values_after.items()}
    return json.dumps({**before.source, "locked": middle_values}, sort_keys=True)


@lru_cache(maxsize=32)
def _robot_of_entry(entry: str) -> Robot:
    return robot_from_entry(json.loads(entry))
