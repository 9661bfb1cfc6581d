"""Bodies of a world (links, attached objects, obstacles), the pairs of them that must not touch, and their margins."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, combinations, compress
from operator import not_
from random import Random
from typing import Any, TypeAlias

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.collector import collector_waits
from rrtik_ompl.base.errors import DescriptionWarning, InputError, UnknownNameError, few
from rrtik_ompl.base.kept import kept_with
from rrtik_ompl.geometry.collision.shape_table import Piece, pieces
from rrtik_ompl.geometry.collision.solids import robot_solids
from rrtik_ompl.geometry.collision.thickness import SHARE, least_width
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import AttachedObject, Obstacle, Scene

ALWAYS_COLLIDING_SAMPLES = 64
# [m] Rounding that is allowed in the contact depths that files hold.
DEPTH_TOLERANCE = 1e-9
# [m] Rounding error that is allowed for, both in our own arithmetic and in coal's distances and penetration depths.
DISTANCE_TOLERANCE = 1e-5
Pairs: TypeAlias = tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """One coal geometry that moves with a joint.

    Attributes:
        name: Name of the link, obstacle or attached object that the body belongs to; several bodies may share a name.
        joint: Pinocchio's number of the joint that carries the body; 0 is the world, so such a body stands still.
        placement: Pose of the body in the joint's frame, a ``pinocchio.SE3``.
        geometry: The coal geometry.
        kind: "link", "attached" or "obstacle".
        margin: For an obstacle, the distance that everything that moves must keep from it [m]. For a link or an
            attached object, the distance that other links and attached objects must keep from it [m].
        padding: Thickness that is added around a link or an attached object [m]. For an attached object this includes
            the object's own margin.
        within: Pose of this piece in the frame of the whole object (``pinocchio.SE3``), for an obstacle or attached
            object of several pieces. Code that moves the obstacle to ``pose`` must place this piece at ``pose *
            within``.
        contacts: Pairs of a name and a distance [m]: the objects that this body is in contact with, and how near they
            may come. The distance replaces margins and paddings; a negative one is an allowed penetration depth.
    """

    name: str
    joint: int
    placement: Any
    geometry: Any
    kind: str
    margin: float = 0.0
    padding: float = 0.0
    within: Any = field(default_factory=pin.SE3.Identity)
    contacts: tuple[tuple[str, float], ...] = ()


@kept_with
def link_bodies(robot: Robot, margin: float = 0.0) -> tuple[Body, ...]:
    """Return the bodies of the robot's links, in the order of its collision model.

    Args:
        robot: The robot. Its paddings become those of the bodies.
        margin: Distance that links must keep from one another [m].
    """
    objects_and_links = [(item, robot.link_of(item)) for item in robot.collision.geometryObjects]
    return tuple(
        Body(link, item.parentJoint, item.placement, solid, "link", margin, robot.padding.get(link, 0.0))
        for (item, link), solid in zip(objects_and_links, robot_solids(robot), strict=True)
    )


@collector_waits()
def scene_bodies(robot: Robot, scene: Scene, margin: float = 0.0) -> tuple[Body, ...]:
    """Return the bodies of all obstacles, then those of all attached objects.

    An object whose shape consists of several coal geometries gives several bodies.

    Args:
        robot: The robot that carries the attached objects.
        scene: The obstacles and attached objects.
        margin: Distance that attached objects must keep from links and from one another [m].

    Raises:
        UnknownNameError: If an attached object names a link that the robot does not have.
        InputError: If an obstacle has the name of a link.
    """
    links = robot.link_names
    for name in scene.names:
        if name in links:
            raise InputError(f"scene: '{name}' is also the name of a link of robot '{robot.name}'; rename the obstacle")

    bodies = []
    for obstacle in scene.obstacles:
        bodies += [
            Body(
                obstacle.name,
                joint=0,
                placement=obstacle.pose * piece.placement,
                geometry=piece.geometry,
                kind="obstacle",
                margin=obstacle.margin,
                within=piece.placement,
            )
            for piece in pieces_of(obstacle)
        ]

    for item in scene.attached:
        if item.link not in links:
            raise UnknownNameError(f"link of robot '{robot.name}'", item.link, links, where=f"attached '{item.name}'")
        for name in item.allow:
            if name not in links and name not in scene.names:
                known_names = (*links, *scene.names)
                raise UnknownNameError("link or obstacle", name, known_names, where=f"allow of attached '{item.name}'")

        joint, mount = mounted(robot, item)
        thickness = item.margin + (robot.padding.get(item.link, 0.0) if item.padding is None else item.padding)
        bodies += [
            Body(
                item.name,
                joint=joint,
                placement=mount * piece.placement,
                geometry=piece.geometry,
                kind="attached",
                margin=margin,
                padding=thickness,
                within=piece.placement,
            )
            for piece in pieces_of(item)
        ]

    return tuple(bodies)


def mounted(robot: Robot, item: AttachedObject) -> tuple[int, pin.SE3]:
    """Return the number of the joint that carries an attached object, and the object's pose in that joint's frame."""
    frame = robot.model.frames[robot.model.getFrameId(item.link, pin.FrameType.BODY)]
    return frame.parentJoint, frame.placement * item.pose


def pieces_of(item: Obstacle | AttachedObject) -> tuple[Piece, ...]:
    """Return the coal geometries of an object's shape; an error names the object."""
    try:
        return pieces(item.shape)
    except InputError as error:
        raise InputError(f"scene: '{item.name}': {error}") from None


def in_contact(robot: Robot, scene: Scene, bodies: Sequence[Body]) -> tuple[Body, ...]:
    """Return the bodies of a world with the contacts of its scene entered.

    Raises:
        UnknownNameError: If a contact names something that does not exist.
        InputError: If it is between two links, or lets two overlap so deep that they could pass through each other.
    """
    if not scene.contacts:
        return tuple(bodies)

    known_names = {*robot.link_names, *scene.names}
    contacts_of: dict[str, list[tuple[str, float]]] = {}
    for contact in scene.contacts:
        for name in contact.names:
            if name not in known_names:
                raise UnknownNameError("link or obstacle", name, known_names, where="contacts of a scene")

        if not contact.pair & set(scene.names):
            raise InputError(f"contacts of a scene: '{contact.first}' and '{contact.second}' are links; name an object")

        deepest = deepest_contact(bodies, *contact.names)
        if contact.distance < -deepest - DEPTH_TOLERANCE:
            raise InputError(
                f"contacts of a scene: {contact}, and could pass through each other: they are too thin for more than "
                f"{1e3 * deepest:.3g} mm"
            )

        for name, other in (contact.names, contact.names[::-1]):
            contacts_of.setdefault(name, []).append((other, contact.distance))

    return tuple(
        replace(body, contacts=tuple(contacts_of[body.name])) if body.name in contacts_of else body for body in bodies
    )


def deepest_contact(bodies: Iterable[Body], first: str, second: str) -> float:
    """Return the penetration depth that may at most be allowed between two objects in contact [m].

    It is a share of the sum of their least widths (see ``thickness.py``), so that the two cannot pass through each
    other. It is infinite if one of them has no body.

    Args:
        bodies: All bodies of a world.
        first: Name of a link, obstacle or attached object.
        second: Name of the other one.
    """
    widths = {first: np.inf, second: np.inf}
    for body in bodies:
        if body.name in widths:
            widths[body.name] = min(widths[body.name], least_width(body.geometry))
    return SHARE * sum(widths.values())


@collector_waits()
def colliding_pairs(robot: Robot, scene: Scene, bodies: tuple[Body, ...]) -> tuple[tuple[int, int], ...]:
    """Return the pairs of bodies that must not touch, as pairs of their numbers, sorted.

    Left out are pairs that are joined rigidly, that the robot or the scene allows to touch, and pairs of adjacent
    links. Links are adjacent if one joint of the description joins them (`joined_links`): they overlap there by
    construction. An attached object does not, so it is checked against all links but the one that holds it and those
    that it may touch.

    Args:
        robot: The robot.
        scene: Its obstacles, attached objects and allowed collisions.
        bodies: The bodies from `link_bodies`, followed by those from `scene_bodies`.

    Returns:
        Pairs of indices into ``bodies``, the smaller index first.

    Raises:
        UnknownNameError: If an allowed collision names something that does not exist.
    """
    allowed = _allowed(robot, scene)
    link_pairs = _pairs_of_links(robot)
    robot_bodies = [k for k, body in enumerate(bodies) if body.kind != "obstacle"]
    pairs: list[tuple[int, int]] = []
    for i, j in combinations(robot_bodies, 2) if robot.self_collision else ():
        if frozenset((bodies[i].name, bodies[j].name)) in allowed:
            continue
        # Links come first, so that two of them are a pair of which the second is a link.
        between_links = bodies[j].kind == "link"
        if (i, j) in link_pairs if between_links else _may_meet(bodies[i], bodies[j]):
            pairs.append((i, j))

    obstacles = [(k, body.name) for k, body in enumerate(bodies) if body.kind == "obstacle"]
    for i in robot_bodies:
        allowed_with = {name for pair in allowed if bodies[i].name in pair for name in pair}
        pairs += [(i, j) if i < j else (j, i) for j, name in obstacles if name not in allowed_with]

    return tuple(sorted(pairs))


def _allowed(robot: Robot, scene: Scene) -> set[frozenset[str]]:
    """Return the pairs of names that the scene allows to touch, checked for unknown names.

    They include, for each attached object, the link that holds it and those of its ``allow``. Pairs that the robot
    itself allows are not included.
    """
    known_names = {*robot.link_names, *scene.names}
    for pair in scene.allowed_collisions:
        for name in pair:
            if name not in known_names:
                raise UnknownNameError("link or obstacle", name, known_names, where="allowed_collisions")

    allowed = {frozenset(pair) for pair in scene.allowed_collisions}
    for item in scene.attached:
        allowed |= {frozenset((item.name, link)) for link in (item.link, *item.allow)}
    return allowed


@kept_with
def _pairs_of_links(robot: Robot) -> frozenset[tuple[int, int]]:
    """Return the pairs of link bodies that must not touch, as pairs of their numbers, the smaller one first.

    Some descriptions have links that overlap by construction, without a list of allowed pairs that says so. A pair that
    touches in each of many random configurations must be of that kind: it is left out, and a warning names it. If the
    description has a list of allowed pairs, only those pairs are tested for this that other programs may never check:
    links joined by fixed or held joints or across links without solids, and pairs that are asked for although a joint
    joins them.
    """
    bodies = link_bodies(robot)
    solid_names = [item.name for item in robot.collision.geometryObjects]
    joined_pairs = joined_links(robot)
    carrying_parents = _carrying_parents(robot, bodies)
    pairs: list[tuple[int, int]] = []
    doubtful: list[tuple[int, int]] = []

    for i, j in combinations(range(len(bodies)), 2):
        first = bodies[i]
        second = bodies[j]
        names = frozenset((first.name, second.name))
        explicitly_checked = names in robot.checked_collisions
        if not _may_meet(first, second):
            continue
        if names in joined_pairs and not explicitly_checked:
            continue
        if names in robot.allowed_collisions:
            continue
        if frozenset((solid_names[i], solid_names[j])) in robot.unchecked_solids:
            continue

        pairs.append((i, j))
        if not robot.allowed_collisions or explicitly_checked or _adjacent(first.joint, second.joint, carrying_parents):
            doubtful.append((i, j))

    if not robot.self_collision:
        return frozenset(pairs)
    return frozenset(pairs) - _always_touching(robot, bodies, doubtful)


def joined_links(robot: Robot) -> frozenset[frozenset[str]]:
    """Return the pairs of names of links with solids that are joined by one joint that is not fixed in the description.

    A link without solids that is fixed to one with solids is treated as a frame of that link: a joint at the frame
    joins the link itself. If such a frame is fixed to several links with solids, as a flange with a camera and a tool
    is, the joint cannot be attributed to one of them, and the frame counts as joined to none.

    Example:
        >>> sorted(map(sorted, joined_links(rrtik.load_robot("planar3", parameters={"radius": 0.02}))))
        [['base', 'link1'], ['link1', 'link2'], ['link2', 'link3']]
    """
    links = _links(robot)
    solid_links = {robot.link_of(item) for item in robot.collision.geometryObjects}
    fixed_neighbours: dict[str, list[str]] = {}
    for link in links:
        if link.fixed:
            fixed_neighbours.setdefault(link.name, []).append(link.parent)
            fixed_neighbours.setdefault(link.parent, []).append(link.name)

    pairs = set()
    for link in links:
        if link.fixed:
            continue

        lower_links = _nearest(link.name, fixed_neighbours, solid_links)
        upper_links = _nearest(link.parent, fixed_neighbours, solid_links)
        if len(lower_links) == 1 and len(upper_links) == 1:
            pairs.add(lower_links | upper_links)

    return frozenset(pairs)


@dataclass(frozen=True, slots=True)
class _Link:
    """A link and its parent link in the description, joined by a fixed joint or by one that moves or is held."""

    name: str
    parent: str
    fixed: bool


def _links(robot: Robot) -> list[_Link]:
    """Return all links but the base, each with its parent.

    The frames of Pinocchio's model still show how the robot was described: the frame of a link is a child of the frame
    of its joint, which is a child of the parent link's frame.
    """
    frames = robot.model.frames
    links = []
    for frame in frames:
        if frame.type != pin.FrameType.BODY:
            continue

        parent = frames[frame.parentFrame]
        is_held = False
        if parent.type != pin.FrameType.BODY:
            is_held = parent.name in robot.movable
            parent = frames[parent.parentFrame]

        if parent.type == pin.FrameType.BODY:
            moves = frame.parentJoint != parent.parentJoint
            links.append(_Link(frame.name, parent.name, not (moves or is_held)))
    return links


def _nearest(link: str, fixed_neighbours: Mapping[str, Iterable[str]], solid_links: set[str]) -> frozenset[str]:
    """Return the links with solids that belong to a link: itself, or else the nearest ones that fixed joints lead to.

    Args:
        link: Name of the link to start from.
        fixed_neighbours: For each link the names of those that a fixed joint joins to it.
        solid_links: Names of the links with solids.
    """
    nearest = set()
    visited = {link}
    to_visit = [link]

    while to_visit:
        visited_link = to_visit.pop()
        if visited_link in solid_links:
            nearest.add(visited_link)
            continue
        for other in fixed_neighbours.get(visited_link, ()):
            if other not in visited:
                visited.add(other)
                to_visit.append(other)

    return frozenset(nearest)


def _may_meet(first: Body, second: Body) -> bool:
    """Check whether two bodies of the robot belong to different objects and to different joints."""
    return first.name != second.name and first.joint != second.joint


def _carrying_parents(robot: Robot, bodies: Iterable[Body]) -> dict[int, int]:
    """Return, for each joint that carries a body, the nearest joint towards the base that carries one too."""
    carrying = {0} | {body.joint for body in bodies}
    parents = {0: 0}
    for joint in carrying - {0}:
        above = int(robot.model.parents[joint])
        while above not in carrying:
            above = int(robot.model.parents[above])
        parents[joint] = above
    return parents


def _adjacent(first: int, second: int, parents: Mapping[int, int]) -> bool:
    """Check whether one of two joints is the parent of the other; ``parents`` has the parent of each."""
    return bool(parents[first] == second or parents[second] == first)


def _always_touching(robot: Robot, bodies: tuple[Body, ...], pairs: Sequence[tuple[int, int]]) -> set[tuple[int, int]]:
    """Return the given pairs that touch in each of a sample of random configurations, and warn about them."""
    rng = Random(0)  # of Python, as numpy's takes 20 ms to load
    ranges = list(zip(*robot.finite_range(), strict=True))
    rows = [[rng.uniform(low, high) for low, high in ranges] for _ in range(ALWAYS_COLLIDING_SAMPLES)]
    sampled_frames = robot.joint_frames(np.array(rows).reshape(-1, robot.dof))
    suspects = set(pairs)
    for frames in sampled_frames:
        suspects = {p for p in suspects if _touch(bodies[p[0]], bodies[p[1]], frames)}

    if suspects:
        names = [" and ".join(_solid_name(bodies, k) for k in pair) for pair in sorted(suspects)]
        message = (
            f"robot '{robot.name}': not checked, as they touch in each of {ALWAYS_COLLIDING_SAMPLES} random postures: "
            f"{few(names)}; correct them, or let them touch: <disable_collisions> of an SRDF, <exclude> of an MJCF"
        )
        warnings.warn(DescriptionWarning(message), stacklevel=2)
    return suspects


def _touch(first: Body, second: Body, frames: Sequence[pin.SE3]) -> bool:
    poses = [pin.SE3(frames[b.joint]) * b.placement for b in (first, second)]
    transforms = [coal.Transform3s(p.rotation, p.translation) for p in poses]
    ends = (first.geometry, transforms[0], second.geometry, transforms[1])
    return bool(coal.collide(*ends, request(0.0), coal.CollisionResult()))


def _solid_name(bodies: tuple[Body, ...], number: int) -> str:
    """Return the name of a body's link, with the body's number in the link, counted from 1, if the link has several."""
    link = bodies[number].name
    solids_of_link = [k for k, body in enumerate(bodies) if body.name == link]
    return f"'{link}'" if len(solids_of_link) == 1 else f"'{link}' (solid {solids_of_link.index(number) + 1})"


def by_motion(bodies: Sequence[Body], pairs: Pairs) -> tuple[Pairs, Pairs]:
    """Split pairs into those of which at least one body moves, and those of two bodies that stand still."""
    moves = np.array([body.joint > 0 for body in bodies], dtype=bool)
    either_moves: list[bool] = np.logical_or(*moves[pair_array(pairs).T]).tolist()
    return tuple(compress(pairs, either_moves)), tuple(compress(pairs, map(not_, either_moves)))


def pair_array(pairs: Sequence[tuple[int, int]]) -> NDArray[np.int64]:
    """Return pairs as an integer array of shape (n, 2).

    For many pairs this takes a fifth of the time of ``np.array``.
    """
    return np.fromiter(chain.from_iterable(pairs), np.int64, 2 * len(pairs)).reshape(-1, 2)


def far_apart(first: Body, second: Body, distance: float) -> bool:
    """Check whether the bounding balls of two bodies that stand still are farther apart than a distance [m]."""
    first_centre, second_centre = (body.placement.act(body.geometry.aabb_center).tolist() for body in (first, second))
    centre_distance_limit = first.geometry.aabb_radius + second.geometry.aabb_radius + distance
    # An unbounded body makes these NaN or infinite, and then the answer is False.
    return bool(math.dist(first_centre, second_centre) > centre_distance_limit)


def kept_apart(first: Body, second: Body) -> float:
    """Return the distance that two bodies must keep [m]: the applicable margin plus both paddings.

    The margin is that of the obstacle or, between bodies of the robot, that of the first. A negative result is the
    penetration depth that two bodies in contact are allowed. Between two bodies that stand still the margin is 0, as no
    configuration of the arm could restore a margin that is missing: they only must not touch.
    """
    contact = contact_distance(first, second)
    without_contact = usually_apart(first, second)
    return without_contact if contact is None else min(without_contact, contact)


def usually_apart(first: Body, second: Body) -> float:
    """Return the distance that two bodies must keep if they are not in contact [m]."""
    if first.joint == second.joint == 0:
        return 0.0
    return (second.margin if second.kind == "obstacle" else first.margin) + first.padding + second.padding


def keeps_clearance(first: Body, second: Body) -> bool:
    """Check whether a required clearance applies to two bodies: one is an obstacle, and they are not in contact."""
    return "obstacle" in (first.kind, second.kind) and contact_distance(first, second) is None


def contact_distance(first: Body, second: Body) -> float | None:
    """Return how near two bodies in contact may come [m], negative for a depth; None if they are not in contact."""
    if not first.contacts or not second.contacts:
        return None
    return min((distance for name, distance in first.contacts if name == second.name), default=None)


def request(margin: float) -> coal.CollisionRequest:
    """Return a new coal request that reports two geometries as colliding if they are at most ``margin`` [m] apart."""
    collision_request = coal.CollisionRequest()
    collision_request.security_margin = margin
    return collision_request
