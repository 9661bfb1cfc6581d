"""Follow contacts from where they begin, as something is taken or set down, to where the two things have parted.

Things that touch when one is attached may continue to touch, at most a millimetre deeper than then, until they have
parted; from there on the pair is checked like any other. A thing that is about to be taken or set down may touch, at
most a millimetre deep, on the motion that leads there. Thin things may never overlap so deeply that they could pass
through each other (:mod:`rrtik_ompl.geometry.collision.thickness`). Each contact is expressed as a distance that a pair
of things must keep, negative for a penetration depth (:class:`rrtik_ompl.Touching`), so that proofs and certificates
work as they do for margins.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import compress, pairwise

import coal
import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.copies import changed
from rrtik_ompl.geometry.collision.bodies import DISTANCE_TOLERANCE, Body, deepest_contact, usually_apart
from rrtik_ompl.geometry.collision.body_arrays import body_arrays
from rrtik_ompl.geometry.collision.distances import signed_gap
from rrtik_ompl.geometry.collision.motion_bound import approach_weights
from rrtik_ompl.geometry.collision.solids import is_mesh
from rrtik_ompl.model.path import JointPath, path_through
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Scene, Touching
from rrtik_ompl.tasks.nearness import beyond
from rrtik_ompl.tasks.worlds import Worlds
from rrtik_ompl.world.clearances import proved
from rrtik_ompl.world.proof import Prover
from rrtik_ompl.world.route_check import violations_of
from rrtik_ompl.world.world import World, form_of

CONTACT_GAP = 1e-4  # [m] largest gap at which two things count as touching; straight lines deviate by as much
EXTRA_DEPTH = 1e-3  # [m] how much nearer two things in contact may come than they were
SMALL_OVERLAP = 5e-3  # [m] largest overlap that is accepted although no grasp names the pair
MAX_MEASURED_DEPTH = 1.0  # [m] largest penetration depth that is measured
BISECTIONS = 24  # bisections of a penetration depth
# [m] Largest approach of two things between successive places of a motion at which their parting is checked.
PARTING_STEP = 2.5e-4
PLACES_AT_ONCE = 256  # places whose joint frames are computed in one call


@dataclass(frozen=True, slots=True)
class MotionContact:
    """A contact on which a motion depends.

    Attributes:
        touching: The two things, and how near they may come.
        until: Index of the waypoint at which they have parted; None if the contact lasts to the end of the motion.
        then: Distance that they must keep from there on [m]; None if the pair is then checked like any other.
        allowed: Whether a grasp has named the pair, see :class:`rrtik_ompl.Attach`.

    Example:
        >>> from rrtik_ompl.tasks.contact_life import MotionContact
        >>> print(MotionContact(rrtik.Touching("cup", "table", -0.001), 2))
        'cup' and 'table' may overlap by 1 mm, up to waypoint 3
    """

    touching: Touching
    until: int | None = None
    then: float | None = None
    allowed: bool = False

    def __str__(self) -> str:
        if self.until is None:
            return str(self.touching)
        then = "".join(f", and then {each}" for each in self.following)
        return f"{self.touching}, up to waypoint {self.until + 1}{then}"

    @property
    def following(self) -> tuple[Touching, ...]:
        """Return the contact of the pair after it has parted, if it may touch again."""
        return () if self.then is None else (replace(self.touching, distance=self.then),)


@dataclass(frozen=True, slots=True)
class Nearness:
    """Two things that touch: their names, their signed distance [m], and how deep they may overlap at most [m]."""

    first: str
    second: str
    distance: float
    deepest: float

    @property
    def pair(self) -> frozenset[str]:
        """Return both names, without order."""
        return frozenset((self.first, self.second))

    @property
    def too_deep(self) -> bool:
        """Return whether the overlap is deeper than a thing may be left at."""
        return self.distance < -EXTRA_DEPTH - DISTANCE_TOLERANCE

    def going_on(self) -> Touching:
        """Return the contact for two things that touch now, to hold until they part."""
        return Touching(self.first, self.second, max(min(self.distance, 0.0) - EXTRA_DEPTH, -self.deepest))

    def arriving(self) -> Touching:
        """Return the contact for two things of which one is about to be taken or set down here."""
        return Touching(self.first, self.second, -min(EXTRA_DEPTH, self.deepest))


def allowed(bodies: Iterable[Body], first: str, second: str) -> Touching:
    """Return the contact for two things that may touch, whether or not they do."""
    return Touching(first, second, -min(EXTRA_DEPTH, deepest_contact(bodies, first, second)))


def left_inside(near: Nearness) -> str:
    """Return a message that a thing would be set down inside another, and how deep."""
    depth = f"{-1e3 * near.distance:.3g}"
    if near.distance < -MAX_MEASURED_DEPTH:
        depth = f"more than {1e3 * MAX_MEASURED_DEPTH:g}"
    return f"'{near.first}' would be left {depth} mm inside '{near.second}'; {1e3 * EXTRA_DEPTH:g} mm at most"


def with_contacts(scene: Scene, contacts: Iterable[Touching]) -> Scene:
    """Return a scene with further contacts; of several contacts of one pair the last new one counts."""
    contact_of_pair = {contact.pair: contact for contact in contacts}
    unchanged = tuple(old for old in scene.contacts if old.pair not in contact_of_pair)
    return changed(scene, contacts=(*unchanged, *contact_of_pair.values()))


def touching_at(world: World, q: Vector, name: str) -> list[Nearness]:
    """Return the things that touch or overlap a given one at a configuration, the deepest first.

    Only pairs that the world checks are considered.

    Args:
        world: The world.
        q: The configuration, shape (dof,).
        name: Name of the thing.

    Returns:
        One entry for each other thing, with the given one as ``first``.
    """
    bodies = world.bodies
    frames = world.robot.joint_frames(q[None])[0]
    pairs = [(i, j) for i, j in world.pairs if name in (bodies[i].name, bodies[j].name)]
    if not pairs:
        return []
    near = body_arrays(tuple(bodies)).least_gaps(np.array(pairs), frames) <= CONTACT_GAP
    nearest_of_pair: dict[tuple[str, str], Nearness] = {}

    for i, j in compress(pairs, near.tolist()):
        first = bodies[i]
        second = bodies[j]
        gap = signed_distance(world.robot, (first, second), q, frames)
        other = second.name if first.name == name else first.name
        is_nearest = (name, other) not in nearest_of_pair or gap < nearest_of_pair[name, other].distance
        if gap <= CONTACT_GAP and is_nearest:
            nearest_of_pair[name, other] = Nearness(name, other, gap, deepest_contact(bodies, name, other))

    return sorted(nearest_of_pair.values(), key=lambda near: near.distance)


def signed_distance(robot: Robot, pair: tuple[Body, Body], q: Vector, frames: Matrix) -> float:
    """Return the signed distance of two bodies at q [m]; inf if they do not touch.

    For meshes the penetration depth is that of their convex pieces.

    Args:
        robot: The robot.
        pair: The bodies.
        q: The configuration, shape (dof,).
        frames: Poses of all joint frames at q, shape (joints + 1, 4, 4).
    """
    poses = _transforms(pair, frames)
    ends = (pair[0].geometry, poses[0], pair[1].geometry, poses[1])
    if beyond(ends, CONTACT_GAP):
        return np.inf

    gap = signed_gap(ends)
    if gap > CONTACT_GAP:
        return np.inf
    if any(is_mesh(body.geometry) for body in pair):
        return min(gap, -_depth_of_pieces(robot, pair, q))
    return gap


def _depth_of_pieces(robot: Robot, pair: tuple[Body, Body], q: Vector) -> float:
    """Return the penetration depth of two bodies' convex pieces at q [m], as proofs see it; inf if it exceeds a metre.

    It is found by bisection, as the smallest allowed overlap with which the prover can prove the pair.
    """
    others = zip(pair, pair[::-1], strict=True)
    bodies = [replace(one, margin=0.0, padding=0.0, contacts=((other.name, 0.0),)) for one, other in others]
    prover = Prover(robot, bodies, ((0, 1),))

    low = 0.0
    high = MAX_MEASURED_DEPTH
    if prover.route(q[None], slack=-low).proven:
        return 0.0
    if not prover.route(q[None], slack=-high).proven:
        return np.inf

    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        is_proven = prover.route(q[None], slack=-middle).proven
        low, high = (low, middle) if is_proven else (middle, high)
    return high


@dataclass(frozen=True, slots=True, eq=False)
class FollowedContacts:
    """A motion and its contacts, after it was determined where they end.

    Attributes:
        path: The motion, with a waypoint at each place where two things have parted.
        contacts: The contacts on which it depends.
        lasting: The contacts that remain at its end.
        fault: "" if all things that parted stay apart, otherwise what touches again; the path then ends where the two
            have parted.
        world: If there is a fault, the world at the end of the path, without the contact that has ended there.
    """

    path: JointPath
    contacts: tuple[MotionContact, ...]
    lasting: tuple[Touching, ...]
    fault: str = ""
    world: World | None = None


def follow_contacts(
    path: JointPath,
    world: World,
    grasp_pairs: frozenset[frozenset[str]],
    contacts_at_end: Iterable[Touching],
    worlds: Worlds,
) -> FollowedContacts:
    """Find where the contacts of a motion end, and check that things stay apart after they have parted.

    Each contact ends at the first place where its two things have parted; a waypoint is inserted there. From that
    waypoint on, the path is checked in a world without the contact. A motion with new waypoints is proved again.

    Args:
        path: The motion.
        world: The world of the motion, with all contacts.
        grasp_pairs: Pairs that a grasp allows: after they have parted, they may touch again.
        contacts_at_end: Contacts of things that are taken or set down at the end of the motion.
        worlds: The worlds of the task.
    """
    end_contact_of_pair = {contact.pair: contact for contact in contacts_at_end}
    parting_of_contact = {
        contact: place_of_parting(path.waypoints, world, contact)
        for contact in world.scene.contacts
        if end_contact_of_pair.get(contact.pair) != contact
    }

    places = sorted({place for place in parting_of_contact.values() if place is not None})
    rows, waypoint_of_place = _with_waypoints_at(path.waypoints, places)

    contacts = []
    for contact in world.scene.contacts:
        of_grasp = contact.pair in grasp_pairs
        place = parting_of_contact.get(contact)
        following = touching_again(contact) if of_grasp else None
        following = end_contact_of_pair.get(contact.pair, following)
        if place is None or following == contact:
            contacts.append(MotionContact(contact, allowed=of_grasp))
        else:
            later_distance = None if following is None else following.distance
            contacts.append(MotionContact(contact, waypoint_of_place[place], later_distance, of_grasp))

    for until in sorted(set(waypoint_of_place.values())):
        world_after = world_from(world, contacts, until, worlds)
        if violations := violations_of(world_after.checks, rows[until:]):
            fault = f"what has parted touches again: {violations[0].reason}"
            return FollowedContacts(path_through(path, rows[: until + 1]), (), (), fault, world_after)

    new_path = path
    if len(rows) > len(path.waypoints):
        clearance = None if path.proof is None else path.proof.clearance
        new_path = proved(path_through(path, rows), world, clearance=clearance)

    contacts_left = contacts_from(contacts, len(rows))
    lasting = tuple(contact for contact in contacts_left if end_contact_of_pair.get(contact.pair) != contact)
    stood_on = tuple(motion_contact for motion_contact in contacts if motion_contact.until != 0)
    return FollowedContacts(new_path, stood_on, lasting)


def contacts_from(contacts: Iterable[MotionContact], number: int) -> tuple[Touching, ...]:
    """Return the contacts of a motion that hold from the waypoint with this index on."""
    contacts_left: list[Touching] = []
    for each in contacts:
        contacts_left += [each.touching] if each.until is None or each.until > number else each.following
    return tuple(contacts_left)


def world_from(world: World, contacts: Iterable[MotionContact], number: int, worlds: Worlds | None = None) -> World:
    """Return the world of a motion from the waypoint with this index on, without the contacts that have ended there.

    It may be known among the ``worlds`` of the task, which have no path constraints of a stage.
    """
    stood_on = tuple(contacts)
    known_pairs = {each.touching.pair for each in stood_on}
    others = tuple(contact for contact in world.scene.contacts if contact.pair not in known_pairs)
    scene = changed(world.scene, contacts=(*others, *contacts_from(stood_on, number)))
    if worlds is None:
        return form_of(world, scene=scene)
    return form_of(worlds.of(world.robot, scene), constraints=world.settings.constraints)


def touching_again(contact: Touching) -> Touching:
    """Return the contact of a pair of a grasp after it has parted: the two may touch again, but no deeper than 1 mm."""
    return replace(contact, distance=max(contact.distance, -EXTRA_DEPTH))


def parted(world: World, q: Vector, contact: Touching) -> bool:
    """Check whether two things that are in contact in a world have parted at q, shape (dof,)."""
    return place_of_parting(q[None], world, contact) is not None


def place_of_parting(rows: Matrix, world: World, contact: Touching) -> tuple[int, float] | None:
    """Find the first place on a route at which two things in contact have parted.

    Places are checked between which the two can approach each other by at most a quarter of a millimetre.

    Args:
        rows: Waypoints of the route, shape (k, dof).
        world: The world, in which the two are in contact.
        contact: Their contact.

    Returns:
        Index of the motion between two waypoints, and the share of it, from 0 to 1; None if they part nowhere.
    """
    bodies = world.bodies
    numbers = {k for k, body in enumerate(bodies) if body.name in contact.pair}
    pairs = [(i, j) for i, j in world.pairs if i in numbers and j in numbers and bodies[i].name != bodies[j].name]
    if not pairs:
        return 0, 0.0

    for number, share, frames in _places_along(rows, world, pairs):
        if all(_keep_apart((bodies[i], bodies[j]), frames) for i, j in pairs):
            return number, share
    return None


def _places_along(rows: Matrix, world: World, pairs: Sequence[tuple[int, int]]) -> Iterator[tuple[int, float, Matrix]]:
    """Yield places of a route between which bodies approach each other by at most ``PARTING_STEP``.

    Args:
        rows: Waypoints of the route, shape (k, dof).
        world: The world.
        pairs: Pairs of numbers of its bodies.

    Yields:
        Index of the motion between two waypoints, the share of it, and the joint frames there,
        shape (joints + 1, 4, 4).
    """
    robot = world.robot
    yield 0, 0.0, robot.joint_frames(rows[:1])[0]
    if len(rows) == 1:
        return

    weights = approach_weights(robot, world.bodies, pairs).max(axis=0)
    for number, (a, b) in enumerate(pairwise(rows)):
        steps = max(1, int(np.ceil(float(weights @ np.abs(b - a)) / PARTING_STEP)))
        shares = np.arange(int(number == 0), steps + 1) / steps
        for part in np.array_split(shares, 1 + len(shares) // PLACES_AT_ONCE):
            frames = robot.joint_frames(a + part[:, None] * (b - a))
            for share, frame in zip(part.tolist(), frames, strict=True):
                yield number, share, frame


def _keep_apart(pair: tuple[Body, Body], frames: Matrix) -> bool:
    """Check whether two bodies do not touch and keep the distance that is required without a contact."""
    poses = _transforms(pair, frames)
    limit = usually_apart(*pair) + CONTACT_GAP
    return beyond((pair[0].geometry, poses[0], pair[1].geometry, poses[1]), limit)


def _transforms(pair: tuple[Body, Body], frames: Matrix) -> list[coal.Transform3s]:
    """Return the poses of two bodies as coal's transforms."""
    poses = (pin.SE3(frames[body.joint]) * body.placement for body in pair)
    return [coal.Transform3s(pose.rotation, pose.translation) for pose in poses]


def _with_waypoints_at(
    rows: Matrix, places: Iterable[tuple[int, float]]
) -> tuple[Matrix, dict[tuple[int, float], int]]:
    """Insert waypoints at places between others.

    Args:
        rows: Waypoints, shape (k, dof).
        places: Index of a motion between two waypoints and the share of it, in ascending order.

    Returns:
        All waypoints, shape (m, dof), and for each place the index of its waypoint.
    """
    waypoints = list(rows)
    waypoint_of_place = {}
    added_count = 0

    for number, share in places:
        if share in (0.0, 1.0):
            waypoint_of_place[number, share] = number + added_count + int(share)
            continue

        added_count += 1
        waypoints.insert(number + added_count, rows[number] + share * (rows[number + 1] - rows[number]))
        waypoint_of_place[number, share] = number + added_count

    return np.array(waypoints), waypoint_of_place


def joined_with(robot: Robot, link: str) -> frozenset[str]:
    """Return the links that are rigidly joined to a link, including that link."""
    model = robot.model
    joint_of_link = {name: model.frames[model.getFrameId(name)].parentJoint for name in robot.link_names}
    return frozenset(name for name, its_joint in joint_of_link.items() if its_joint == joint_of_link[link])
