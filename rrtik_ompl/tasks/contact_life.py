"""The life of a contact: it begins where something is taken or set down, and ends where the two have parted.

What touches when it is attached may go on touching, a millimetre deeper than then at most, until the two are apart;
from there on the pair is checked as any other. Before something is taken or set down it may touch, a millimetre deep at
most, on the motion that leads there. Never may thin things be so deep in each other that they could pass through
(:mod:`rrtik_ompl.geometry.collision.thickness`). All of it is a distance that a pair of things must keep, negative for
a depth (:class:`rrtik_ompl.Touching`), so that proofs and certificates hold as they do for margins.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import coal
import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.geometry.collision.bodies import Body, deepest_contact
from rrtik_ompl.geometry.collision.contacts import measured
from rrtik_ompl.geometry.collision.margins import DISTANCE_TOLERANCE, usually_apart
from rrtik_ompl.geometry.collision.motion_bound import approach_weights
from rrtik_ompl.geometry.collision.solids import is_mesh
from rrtik_ompl.model.path import JointPath, path_through
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Scene, Touching
from rrtik_ompl.world.exact_checks import distance
from rrtik_ompl.world.kept_clearance import proved
from rrtik_ompl.world.proof import Prover
from rrtik_ompl.world.route_check import violations_of
from rrtik_ompl.world.world import World, form_of

NEAR = 1e-4  # [m] of a gap up to which two touch: straight lines deviate by as much
DEEPER = 1e-3  # [m] that two in contact may come nearer than they were
LITTLE = 5e-3  # [m] of overlap that needs no word
DEEPEST = 1.0  # [m] that is looked for
BISECTIONS = 24  # of a depth
STEP = 2.5e-4  # [m] that two come nearer at most between places of a motion at which parting is looked for
AT_ONCE = 256  # places


@dataclass(frozen=True, slots=True)
class MotionContact:
    """A contact that a motion stood on.

    Attributes:
        touching: The two, and how near they may come.
        until: Number of the waypoint at which they have parted; None if the contact lasts to the end of the motion.
        then: How near they may come from there on [m]; None if they are checked as others are.
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
        """The contact of the two once they have parted, if they may touch again."""
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
        """Both names, in no order."""
        return frozenset((self.first, self.second))

    @property
    def too_deep(self) -> bool:
        """Whether one is deeper inside the other than it may be left."""
        return self.distance < -DEEPER - DISTANCE_TOLERANCE

    def going_on(self) -> Touching:
        """The contact of two that touch now, until they part."""
        return Touching(self.first, self.second, max(min(self.distance, 0.0) - DEEPER, -self.deepest))

    def arriving(self) -> Touching:
        """The contact of two of which one is about to be taken or set down here."""
        return Touching(self.first, self.second, -min(DEEPER, self.deepest))


def allowed(bodies: Iterable[Body], first: str, second: str) -> Touching:
    """The contact of two things that may touch, whether or not they do."""
    return Touching(first, second, -min(DEEPER, deepest_contact(bodies, first, second)))


def left_inside(near: Nearness) -> str:
    """Says that a thing would be set down inside another, and how deep."""
    depth = f"more than {1e3 * DEEPEST:g}" if near.distance < -DEEPEST else f"{-1e3 * near.distance:.3g}"
    return f"'{near.first}' would be left {depth} mm inside '{near.second}'; {1e3 * DEEPER:g} mm at most"


def with_contacts(scene: Scene, contacts: Iterable[Touching]) -> Scene:
    """A scene with further contacts; of a pair that has one already the new one counts, of two new ones the last."""
    new = {contact.pair: contact for contact in contacts}
    return replace(scene, contacts=(*(old for old in scene.contacts if old.pair not in new), *new.values()))


def touching_at(world: World, q: Vector, name: str) -> list[Nearness]:
    """What touches or overlaps a thing at q, shape (dof,), the deepest first, of the pairs that are checked."""
    bodies = world.bodies
    frames = world.robot.joint_frames(q[None])[0]
    found: dict[tuple[str, str], Nearness] = {}

    for i, j in world.pairs:
        first = bodies[i]
        second = bodies[j]
        if name in (first.name, second.name):
            away = signed_distance(world.robot, (first, second), q, frames)
            other = second.name if first.name == name else first.name
            if away <= NEAR and ((name, other) not in found or away < found[name, other].distance):
                found[name, other] = Nearness(name, other, away, deepest_contact(bodies, name, other))

    return sorted(found.values(), key=lambda near: near.distance)


def signed_distance(robot: Robot, pair: tuple[Body, Body], q: Vector, frames: Matrix) -> float:
    """The signed distance of two bodies at q [m], of meshes that of their convex pieces; +inf if they do not touch."""
    poses = _transforms(pair, frames)
    if distance(pair[0].geometry, poses[0], pair[1].geometry, poses[1], NEAR) is not None:
        return np.inf

    (contact,) = measured(pair, [(0, 1)], frames, near_only=False)
    if contact.distance > NEAR:
        return np.inf
    if any(is_mesh(body.geometry) for body in pair):
        return min(contact.distance, -_depth_of_pieces(robot, pair, q))
    return contact.distance


def _depth_of_pieces(robot: Robot, pair: tuple[Body, Body], q: Vector) -> float:
    """How deep convex pieces of two bodies overlap at q [m], as proofs see it; endless if it is more than a metre."""
    others = zip(pair, pair[::-1], strict=True)
    bare = [replace(one, margin=0.0, padding=0.0, contacts=((other.name, 0.0),)) for one, other in others]
    prover = Prover(robot, bare, ((0, 1),))

    low = 0.0
    high = DEEPEST
    if prover.route(q[None], slack=-low).proven:
        return 0.0
    if not prover.route(q[None], slack=-high).proven:
        return np.inf

    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        apart = prover.route(q[None], slack=-middle).proven
        low, high = (low, middle) if apart else (middle, high)
    return high


@dataclass(frozen=True, slots=True, eq=False)
class Lived:
    """A motion and its contacts, once it is known where they end.

    Attributes:
        path: The motion, with a waypoint at each place where two have parted.
        contacts: What it stood on.
        lasting: The contacts that are left at its end.
        fault: "" if all that has parted stays apart, else what does not; the path then ends where the two have parted.
        world: Where the path ends, if there is a fault: the world without the contact that has ended there.
    """

    path: JointPath
    contacts: tuple[MotionContact, ...]
    lasting: tuple[Touching, ...]
    fault: str = ""
    world: World | None = None


def lived(path: JointPath, world: World, named: frozenset[frozenset[str]], arriving: Iterable[Touching] = ()) -> Lived:
    """See where the contacts of a motion end, and that what has parted stays apart.

    Args:
        path: The motion.
        world: Its world, with all contacts.
        named: Pairs that somebody allowed for a grasp: when they have parted, they may touch again.
        arriving: Contacts of what is taken or set down at its end.
    """
    at_end = {contact.pair: contact for contact in arriving}
    ends = {
        contact: parting(path.waypoints, world, contact)
        for contact in world.scene.contacts
        if at_end.get(contact.pair) != contact
    }

    places = sorted({place for place in ends.values() if place is not None})
    rows, numbers = _with_places(path.waypoints, places)

    contacts = []
    for contact in world.scene.contacts:
        place = ends.get(contact)
        then = at_end.get(contact.pair, again(contact) if contact.pair in named else None)
        if place is None or then == contact:
            contacts.append(MotionContact(contact, allowed=contact.pair in named))
        else:
            later = None if then is None else then.distance
            contacts.append(MotionContact(contact, numbers[place], later, contact.pair in named))

    for until in sorted(set(numbers.values())):
        strict = world_from(world, contacts, until)
        if wrong := violations_of(strict, rows[until:]):
            fault = f"what has parted touches again: {wrong[0].reason}"
            return Lived(path_through(path, rows[: until + 1]), (), (), fault, strict)

    made = path
    if len(rows) > len(path.waypoints):
        made = proved(path_through(path, rows), world, clearance=None if path.proof is None else path.proof.clearance)

    left = contacts_from(contacts, len(rows))
    lasting = tuple(contact for contact in left if at_end.get(contact.pair) != contact)
    return Lived(made, tuple(each for each in contacts if each.until != 0), lasting)


def contacts_from(contacts: Iterable[MotionContact], number: int) -> tuple[Touching, ...]:
    """The contacts of a motion that are left from a waypoint on, by its number."""
    left: list[Touching] = []
    for each in contacts:
        left += [each.touching] if each.until is None or each.until > number else each.following
    return tuple(left)


def world_from(world: World, contacts: Iterable[MotionContact], number: int) -> World:
    """The world of a motion from a waypoint on, by its number: without the contacts that have ended there."""
    stood_on = tuple(contacts)
    own = {each.touching.pair for each in stood_on}
    others = tuple(contact for contact in world.scene.contacts if contact.pair not in own)
    return form_of(world, scene=replace(world.scene, contacts=(*others, *contacts_from(stood_on, number))))


def again(contact: Touching) -> Touching:
    """The contact of a pair that was allowed for a grasp, once the two have parted: it may touch again, no deeper."""
    return replace(contact, distance=max(contact.distance, -DEEPER))


def parted(world: World, q: Vector, contact: Touching) -> bool:
    """Whether two that are in contact in a world have parted at q, shape (dof,)."""
    return parting(q[None], world, contact) is not None


def parting(rows: Matrix, world: World, contact: Touching) -> tuple[int, float] | None:
    """Where two that are in contact have parted: a motion between waypoints, shape (k, dof), and a share of it.

    None if they have not at any place that was looked at, of which one follows the other by a quarter of a millimetre.
    """
    bodies = world.bodies
    pairs = [pair for pair in world.pairs if {bodies[k].name for k in pair} == contact.pair]
    if not pairs:
        return 0, 0.0

    weights = approach_weights(world.robot, bodies, pairs).max(axis=0)
    for number, share, frames in _places(rows, world.robot, weights):
        if all(_apart((bodies[i], bodies[j]), frames) for i, j in pairs):
            return number, share
    return None


def _places(rows: Matrix, robot: Robot, weights: Vector) -> Iterator[tuple[int, float, Matrix]]:
    """Places of a route between which bodies come nearer by a step at most, and the frames of all joints there."""
    ends = [(rows[0], rows[0])] if len(rows) == 1 else pairwise(rows)
    for number, (a, b) in enumerate(ends):
        count = max(1, int(np.ceil(float(weights @ np.abs(b - a)) / STEP)))
        shares = np.arange(count + 1) / count
        for part in np.array_split(shares, 1 + len(shares) // AT_ONCE):
            frames = robot.joint_frames(a + part[:, None] * (b - a))
            for share, frame in zip(part.tolist(), frames, strict=True):
                yield number, share, frame


def _apart(pair: tuple[Body, Body], frames: Matrix) -> bool:
    """Whether two bodies keep what they must where they are not in contact, and do not touch."""
    poses = _transforms(pair, frames)
    limit = usually_apart(*pair) + NEAR
    return distance(pair[0].geometry, poses[0], pair[1].geometry, poses[1], limit) is not None


def _transforms(pair: tuple[Body, Body], frames: Matrix) -> list[coal.Transform3s]:
    """Coal's poses of two bodies."""
    poses = (pin.SE3(frames[body.joint]) * body.placement for body in pair)
    return [coal.Transform3s(pose.rotation, pose.translation) for pose in poses]


def _with_places(rows: Matrix, places: Iterable[tuple[int, float]]) -> tuple[Matrix, dict[tuple[int, float], int]]:
    """Waypoints with further ones at places between them, and the number of the waypoint at each place."""
    made = list(rows)
    numbers = {}
    added = 0

    for number, share in places:
        if share in (0.0, 1.0):
            numbers[number, share] = number + added + int(share)
            continue

        added += 1
        made.insert(number + added, rows[number] + share * (rows[number + 1] - rows[number]))
        numbers[number, share] = number + added

    return np.array(made), numbers


def joined_with(robot: Robot, link: str) -> frozenset[str]:
    """The links that are rigidly joined with a link, itself among them."""
    model = robot.model
    joint = {name: model.frames[model.getFrameId(name)].parentJoint for name in robot.link_names}
    return frozenset(name for name, own in joint.items() if own == joint[link])
