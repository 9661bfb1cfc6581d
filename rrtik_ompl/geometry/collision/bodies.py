"""The solids of a world, links and obstacles alike; the pairs that must not touch, and how far those stay apart."""

from __future__ import annotations

import gc
import math
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache, wraps
from itertools import chain, combinations, compress
from operator import not_
from typing import Any, ParamSpec, TypeAlias, TypeVar

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.errors import DescriptionWarning, InputError, UnknownNameError, few
from rrtik_ompl.geometry.collision.shape_table import Piece, pieces
from rrtik_ompl.geometry.collision.solids import robot_solids
from rrtik_ompl.geometry.collision.thickness import SHARE, least_width
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import AttachedObject, Obstacle, Scene

ALWAYS_COLLIDING_SAMPLES = 64
DEPTH_TOLERANCE = 1e-9  # [m] of rounding, of depths that files hold
DISTANCE_TOLERANCE = 1e-5  # [m] for rounding, in our arithmetic and in coal's distances and depths
Pairs: TypeAlias = tuple[tuple[int, int], ...]
Given = ParamSpec("Given")
Made = TypeVar("Made")


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """One coal geometry that moves with a joint.

    Attributes:
        name: The link, obstacle or attached object that it belongs to; several bodies may share a name.
        joint: Pinocchio joint number; 0 stands still.
        placement: ``pinocchio.SE3`` in the joint's frame.
        geometry: The coal geometry.
        kind: "link", "attached" or "obstacle".
        margin: Of an obstacle how far what moves must stay from it, of a link or attached object how far other ones
            must [m].
        padding: How much thicker a link or attached object is than its geometry [m]; of the latter with its own margin.
        within: Of an obstacle or attached object of several pieces: where this one is in the frame of the whole
            (``pinocchio.SE3``). Whoever puts an obstacle elsewhere puts this piece at ``pose * within``.
        contacts: Names of what it is in contact with, and how near each other the two may come [m], in the place of
            margins and paddings; negative is a depth.
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


def collector_waits(work: Callable[Given, Made]) -> Callable[Given, Made]:
    """The same work, in which the collector does not look through all objects again and again."""

    @wraps(work)
    def undisturbed(*args: Given.args, **kwargs: Given.kwargs) -> Made:
        if not gc.isenabled():
            return work(*args, **kwargs)
        gc.disable()
        try:
            return work(*args, **kwargs)
        finally:
            gc.enable()

    return undisturbed


@lru_cache(maxsize=16)
def link_bodies(robot: Robot, margin: float = 0.0) -> tuple[Body, ...]:
    """The robot's own bodies, with a margin [m] and their paddings."""
    objects_and_links = [(item, robot.link_of(item)) for item in robot.collision.geometryObjects]
    return tuple(
        Body(link, item.parentJoint, item.placement, solid, "link", margin, robot.padding.get(link, 0.0))
        for (item, link), solid in zip(objects_and_links, robot_solids(robot), strict=True)
    )


@collector_waits
def scene_bodies(robot: Robot, scene: Scene, margin: float = 0.0) -> tuple[Body, ...]:
    """Bodies of all obstacles and attached objects, these with a margin [m].

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
            for piece in _pieces(obstacle)
        ]

    for item in scene.attached:
        if item.link not in links:
            raise UnknownNameError(f"link of robot '{robot.name}'", item.link, links, where=f"attached '{item.name}'")
        for name in item.allow:
            if name not in links and name not in scene.names:
                known_names = (*links, *scene.names)
                raise UnknownNameError("link or obstacle", name, known_names, where=f"allow of attached '{item.name}'")

        frame = robot.model.frames[robot.model.getFrameId(item.link, pin.FrameType.BODY)]
        mount = frame.placement * item.pose
        thickness = item.margin + (robot.padding.get(item.link, 0.0) if item.padding is None else item.padding)
        bodies += [
            Body(
                item.name,
                joint=frame.parentJoint,
                placement=mount * piece.placement,
                geometry=piece.geometry,
                kind="attached",
                margin=margin,
                padding=thickness,
                within=piece.placement,
            )
            for piece in _pieces(item)
        ]

    return tuple(bodies)


def _pieces(item: Obstacle | AttachedObject) -> tuple[Piece, ...]:
    try:
        return pieces(item.shape)
    except InputError as error:
        raise InputError(f"scene: '{item.name}': {error}") from None


def in_contact(robot: Robot, scene: Scene, bodies: Sequence[Body]) -> tuple[Body, ...]:
    """The bodies of a world, with the contacts of its scene.

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
    """How deep two things in contact may overlap at most [m], by their names; infinite if one has no body.

    Args:
        bodies: All bodies of a world.
        first: Name of a link, obstacle or attached object.
        second: That of the other.
    """
    widths = {first: np.inf, second: np.inf}
    for body in bodies:
        if body.name in widths:
            widths[body.name] = min(widths[body.name], least_width(body.geometry))
    return SHARE * sum(widths.values())


@collector_waits
def colliding_pairs(robot: Robot, scene: Scene, bodies: tuple[Body, ...]) -> tuple[tuple[int, int], ...]:
    """Pairs of numbers of bodies that must not touch, sorted: all but what is rigidly joined or allowed, or adjacent.

    Links are adjacent if one joint of the description joins them (`joined_links`): they overlap at it by construction.
    What a link holds does not, so it is checked against all links but its own and those that it is allowed to touch.

    Args:
        robot: The robot.
        scene: What surrounds it, and what it holds.
        bodies: Those of `link_bodies`, then those of `scene_bodies`.

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
    known_names = {*robot.link_names, *scene.names}
    for pair in scene.allowed_collisions:
        for name in pair:
            if name not in known_names:
                raise UnknownNameError("link or obstacle", name, known_names, where="allowed_collisions")

    allowed = {frozenset(pair) for pair in scene.allowed_collisions}
    for item in scene.attached:
        allowed |= {frozenset((item.name, link)) for link in (item.link, *item.allow)}
    return allowed


@lru_cache(maxsize=16)
def _pairs_of_links(robot: Robot) -> frozenset[tuple[int, int]]:
    """Pairs of numbers of the bodies of links, the smaller one first, that must not touch.

    A description without a list of allowed pairs says nothing about solids that overlap by construction; two that
    touch in every one of many random postures can only be such ones. They are left out, and a warning names them. With
    a list that is done only for links between which other programs may not look: those joined by links without solids
    or by joints that are fixed or held, and those that are asked for although a joint joins them.
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
    """Pairs of names of links, with solids, that one joint joins which is not fixed in the description.

    A link without solids that is fixed to one with solids is a frame of that: what a joint joins to the frame is joined
    to the link. Where a frame has several such links, as a flange with a camera and a tool has, no one knows of which
    it is, and it is joined to none of them.

    Example:
        >>> sorted(map(sorted, joined_links(rrtik.load_robot("planar3", radius=0.02))))
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
    """A link as its description hangs it on another: by a fixed joint, or by one that moves (or is held)."""

    name: str
    parent: str
    fixed: bool


def _links(robot: Robot) -> list[_Link]:
    """All links but the base. The frames of a model tell how it was described: a link's hangs on that of its joint."""
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
    """The link if it has solids, else those that fixed joints lead to over links without any."""
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
    """Whether two bodies of the robot, or what it holds, are neither one thing nor rigidly joined."""
    return first.name != second.name and first.joint != second.joint


def _carrying_parents(robot: Robot, bodies: Iterable[Body]) -> dict[int, int]:
    """For each joint that carries a body: the nearest joint towards the base that also does."""
    carrying = {0} | {body.joint for body in bodies}
    parents = {0: 0}
    for joint in carrying - {0}:
        above = int(robot.model.parents[joint])
        while above not in carrying:
            above = int(robot.model.parents[above])
        parents[joint] = above
    return parents


def _adjacent(first: int, second: int, parents: Mapping[int, int]) -> bool:
    """Whether one of two joints is the parent of the other."""
    return bool(parents[first] == second or parents[second] == first)


def _always_touching(robot: Robot, bodies: tuple[Body, ...], pairs: Sequence[tuple[int, int]]) -> set[tuple[int, int]]:
    """Those of the pairs that touch in every posture of a sample; a warning names them."""
    rng = np.random.default_rng(0)
    sampled_frames = robot.joint_frames(rng.uniform(*robot.finite_range(), (ALWAYS_COLLIDING_SAMPLES, robot.dof)))
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
    """The link of a body; with its number in the link, counted from 1, if that has several."""
    link = bodies[number].name
    solids_of_link = [k for k, body in enumerate(bodies) if body.name == link]
    return f"'{link}'" if len(solids_of_link) == 1 else f"'{link}' (solid {solids_of_link.index(number) + 1})"


def by_motion(bodies: Sequence[Body], pairs: Pairs) -> tuple[Pairs, Pairs]:
    """The pairs of which at least one body moves, and the pairs of two that stand still."""
    moves = np.array([body.joint > 0 for body in bodies], dtype=bool)
    either_moves: list[bool] = np.logical_or(*moves[pair_array(pairs).T]).tolist()
    return tuple(compress(pairs, either_moves)), tuple(compress(pairs, map(not_, either_moves)))


def pair_array(pairs: Sequence[tuple[int, int]]) -> NDArray[np.int64]:
    """Pairs as an array, shape (n, 2); made of many tuples it takes numpy itself five times as long."""
    return np.fromiter(chain.from_iterable(pairs), np.int64, 2 * len(pairs)).reshape(-1, 2)


def far_apart(first: Body, second: Body, distance: float) -> bool:
    """Whether the bounding balls of two bodies that stand still are farther apart than a distance [m]."""
    first_centre, second_centre = (body.placement.act(body.geometry.aabb_center).tolist() for body in (first, second))
    centre_distance_limit = first.geometry.aabb_radius + second.geometry.aabb_radius + distance
    return bool(
        math.dist(first_centre, second_centre) > centre_distance_limit
    )  # no number where one of them has no end


def kept_apart(first: Body, second: Body) -> float:
    """How far two bodies must stay apart [m]: the margin of an obstacle, or that of the arm's own bodies, and paddings.

    Negative is the depth to which two that are in contact may overlap. No margin between bodies of which neither moves,
    for no posture of the arm would give what is missing: they must only not touch.
    """
    contact = contact_distance(first, second)
    without_contact = usually_apart(first, second)
    return without_contact if contact is None else min(without_contact, contact)


def usually_apart(first: Body, second: Body) -> float:
    """How far two bodies must stay apart where they are not in contact [m]."""
    if first.joint == second.joint == 0:
        return 0.0
    return (second.margin if second.kind == "obstacle" else first.margin) + first.padding + second.padding


def keeps_clearance(first: Body, second: Body) -> bool:
    """Whether a clearance from obstacles is kept between two bodies too: one is an obstacle, and they do not touch."""
    return "obstacle" in (first.kind, second.kind) and contact_distance(first, second) is None


def contact_distance(first: Body, second: Body) -> float | None:
    """How near each other two bodies may come that are in contact [m], negative for a depth; None if they are not."""
    if not first.contacts or not second.contacts:
        return None
    return min((distance for name, distance in first.contacts if name == second.name), default=None)


def request(margin: float) -> coal.DistanceRequest:
    """A fresh request to coal: do two geometries touch, or stay no farther than ``margin`` [m] apart."""
    collision_request = coal.CollisionRequest()
    collision_request.security_margin = margin
    return collision_request
