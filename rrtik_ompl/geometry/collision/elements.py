"""What certificates say of bodies: convex elements, the model of a robot and a scene, the pairs that must not touch.

An element is the convex hull of a few points: a triangle of a mesh, a point of a cloud, a box of a height field, or a
whole convex solid. `docs/science/certificate.md` describes the model, so that others can make it from the same files.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any

import coal
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.geometry.collision.bodies import Body, joined_links
from rrtik_ompl.geometry.collision.cloud_solid import CloudSolid
from rrtik_ompl.geometry.collision.shape_table import core_of, sizes_of
from rrtik_ompl.geometry.collision.solids import is_mesh, mesh_arrays, once_per_geometry, vertices_of
from rrtik_ompl.model.certificate import ModelBody, ModelJoint
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Scene, TimedPoses, pose_at

FEW_POINTS = 64  # up to which the points of a hull stand in a certificate
# Directions in which the extents of a shape are measured: along the axes, and along the diagonals of a cube.
_AXES = np.array([sign * axis for axis in np.eye(3) for sign in (1.0, -1.0)])
_DIAGONALS = np.array(list(np.ndindex(2, 2, 2))) * 2.0 - 1.0
DIRECTIONS = np.concatenate([_AXES, _DIAGONALS / np.sqrt(3.0)])
OPPOSITES = ((0, 1), (2, 3), (4, 5), (6, 13), (7, 12), (8, 11), (9, 10))  # rows of these


@dataclass(frozen=True, slots=True, eq=False)
class Elements:
    """The elements of a shape, in its own frame.

    Attributes:
        key: What the shape is called in a certificate: "box", "sphere", "capsule", "cylinder", "half_space", "hull",
            "mesh", "balls" or "boxes"; "unknown" if nothing can be shown of it.
        measures: The numbers that describe it in a certificate.
        points: Points of each element, shape (n, k, 3) [m].
        half: Half sides of a box around each point, along the axes, shape (n, 3) [m]; None if there are no boxes.
        radius: Radius of the ball around every point of an element [m].
        disc: Radius of the disc across the z axis around every point [m].
    """

    key: str
    measures: dict[str, Any]
    points: NDArray[np.float64]
    half: Matrix | None = None
    radius: float = 0.0
    disc: float = 0.0

    @property
    def known(self) -> bool:
        """Whether something can be shown of the shape."""
        return self.key != "unknown"


@dataclass(frozen=True, slots=True, eq=False)
class NamedBody:
    """A body of a certificate.

    Attributes:
        body: The body, or the first of the boxes that are one body together, with the pose of the whole shape.
        number: Which geometry of its object it is, from 0.
        members: Numbers of the bodies of the world that it consists of.
        elements: Its elements.
    """

    body: Body
    number: int
    members: tuple[int, ...]
    elements: Elements


def named_bodies(bodies: Sequence[Body]) -> list[NamedBody]:
    """Return the bodies of a certificate: those of a world, with the boxes of a height field or an octree as one."""
    named: list[NamedBody] = []
    for _, of_object in groupby(enumerate(bodies), key=lambda item: (item[1].kind, item[1].name)):
        numbers, own = zip(*of_object, strict=True)
        # Links of one name may stand apart in the list, with others in between.
        before = sum(other.body.name == own[0].name and other.body.kind == own[0].kind for other in named)
        if _is_pile(own):
            named.append(NamedBody(_whole_pile(own[0]), before, numbers, _pile_elements(own)))
        else:
            named += [
                NamedBody(body, before + k, (number,), elements_of(body.geometry))
                for k, (number, body) in enumerate(zip(numbers, own, strict=True))
            ]
    return named


def tracked_bodies(
    named: Sequence[NamedBody], scene: Scene, joints: int, times: Vector
) -> tuple[list[NamedBody], NDArray[np.float64]]:
    """Let tracks carry the bodies of obstacles that move: a track is numbered as if it were a further joint.

    Args:
        named: The bodies.
        scene: The scene, whose obstacles state their motions.
        joints: Number of the robot's joints.
        times: Times [s], shape (k,), at which the poses of each track are wanted.

    Returns:
        The bodies, and the poses of each track, shape (tracks, k, 4, 4).

    Raises:
        InputError: If an obstacle changes its way between two times.
    """
    moving = [each for each in scene.obstacles if each.motion is not None]
    for each in moving:
        turns = each.motion.times if isinstance(each.motion, TimedPoses) else times
        between = turns[(turns > times[0]) & (turns < times[-1]) & ~np.isin(turns, times)]
        if len(between):
            raise InputError(f"'{each.name}' changes its way at {between[0]:g} s, between two waypoints")

    tracks = [[pose_at(each, time).homogeneous for time in times.tolist()] for each in moving]
    numbers = {each.name: joints + 1 + k for k, each in enumerate(moving)}
    found = [
        replace(each, body=replace(each.body, joint=numbers[each.body.name], placement=each.body.within))
        if each.body.kind == "obstacle" and each.body.name in numbers
        else each
        for each in named
    ]
    return found, np.array(tracks).reshape(-1, len(times), 4, 4)


def _is_pile(bodies: Sequence[Body]) -> bool:
    """Check whether the bodies of an object are the boxes of a height field or an octree."""
    of_boxes = all(isinstance(body.geometry, coal.Box) or _has_cubes(body.geometry) for body in bodies)
    first = bodies[0]
    is_whole = len(bodies) == 1 and isinstance(first.geometry, coal.Box) and first.within.isIdentity(0.0)
    return first.kind == "obstacle" and of_boxes and not is_whole


def _has_cubes(geometry: coal.CollisionGeometry) -> bool:
    return isinstance(geometry, CloudSolid) and geometry.cloud.half > 0.0


def _whole_pile(first: Body) -> Body:
    """Return a box of a pile as the body of the whole pile, with the pose of its object."""
    return Body(
        first.name, first.joint, first.placement * first.within.inverse(), first.geometry, first.kind, first.margin,
        contacts=first.contacts,
    )  # fmt: skip


def _pile_elements(bodies: Sequence[Body]) -> Elements:
    """Return the boxes of a pile as elements."""
    centres = []
    halves = []
    boxes = [body for body in bodies if not isinstance(body.geometry, CloudSolid)]
    if boxes:
        centres.append(np.array([body.within.translation for body in boxes]))
        halves.append(np.array([body.geometry.halfSide for body in boxes]))
    for cloud in (body.geometry.cloud for body in bodies if isinstance(body.geometry, CloudSolid)):
        centres.append(cloud.points.astype(np.float64))
        halves.append(np.full((len(cloud.points), 3), cloud.half))

    points = np.concatenate(centres)
    half = np.concatenate(halves)
    measures = {"boxes": len(points), "moments": _moments(points), "extents": _extents(points, half)}
    return Elements("boxes", measures, points[:, None], half)


@once_per_geometry
def elements_of(geometry: coal.CollisionGeometry) -> Elements:
    """Return the elements of a coal geometry."""
    if isinstance(geometry, CloudSolid):
        points = geometry.cloud.points.astype(np.float64)
        radius = float(geometry.cloud.radius)
        measures = {"balls": len(points), "radius": radius, "moments": _moments(points), "extents": _extents(points)}
        return Elements("balls", measures, points[:, None], radius=radius)

    if isinstance(geometry, coal.Halfspace):
        plane = [*np.array(geometry.n).tolist(), float(geometry.d)]
        key = "half_space" if geometry.getSweptSphereRadius() == 0.0 else "unknown"
        return Elements(key, {key: plane}, np.zeros((1, 1, 3)))

    around = float(geometry.getSweptSphereRadius()) if hasattr(geometry, "getSweptSphereRadius") else 0.0
    core = core_of(geometry)
    if core is not None and around == 0.0:
        key = type(geometry).__name__.lower()
        sizes = np.asarray(sizes_of(geometry)).tolist()
        full = {"box": [2.0 * size for size in sizes], "sphere": sizes[0]}
        measures = {key: full.get(key, [sizes[0], 2.0 * sizes[-1]])}
        return Elements(key, measures, core.corners[None], None, core.radius, core.disc or 0.0)

    if is_mesh(geometry) and geometry.num_tris > 0:
        vertices, triangles = mesh_arrays(geometry)
        corners = vertices[triangles]
        return Elements("mesh", {"mesh": len(triangles), "extents": _extents(corners.reshape(-1, 3))}, corners)

    vertices_of_hull = None if is_mesh(geometry) else vertices_of(geometry)
    if vertices_of_hull is None:
        return Elements("unknown", {"unknown": type(geometry).__name__}, np.zeros((1, 1, 3)))
    return _hull(vertices_of_hull, around)


def _hull(points: Matrix, radius: float) -> Elements:
    """Return the element of a convex solid, all points within a radius [m] of the hull of points, shape (n, 3)."""
    measures = {"hull": len(points), "radius": radius, "extents": _extents(points)}
    if len(points) <= FEW_POINTS:
        measures["points"] = points.tolist()
    return Elements("hull", measures, points[None], radius=radius)


def _extents(points: Matrix, half: Matrix | None = None) -> list[float]:
    """Return the support function of points, shape (n, 3), or of boxes around them, in ``DIRECTIONS`` [m]."""
    wide = np.zeros((1, 3)) if half is None else half
    found = [0.0] * len(DIRECTIONS)
    for k, opposite in OPPOSITES:
        heights = points @ DIRECTIONS[k]
        reach = wide @ np.abs(DIRECTIONS[k])
        found[k] = round(float((reach + heights).max()), 9)
        found[opposite] = round(float((reach - heights).max()), 9)
    return found


def _moments(points: Matrix) -> list[float]:
    """Return the means of the first and second powers and products of coordinates, shape (n, 3)."""
    x, y, z = points.T
    columns: Iterable[Vector] = (x, y, z, x * x, y * y, z * z, x * y, y * z, z * x)
    return [round(float(column.mean()), 12) for column in columns]


# --- the model -------------------------------------------------------------------------------------------------------


def model_joints(robot: Robot) -> tuple[ModelJoint, ...]:
    """Return the joints of a robot as a certificate lists them."""
    chain = robot.chain
    names = list(robot.model.names)[1:]
    rows = zip(names, chain.parent, chain.placement, chain.axis, chain.prismatic, chain.gain, chain.offset, strict=True)
    return tuple(
        ModelJoint(name, int(parent) + 1, _pose(placement), axis.tolist(), bool(slides), gain.tolist(), float(offset))
        for name, parent, placement, axis, slides, gain, offset in rows
    )


def model_body(named: NamedBody, cuts: Sequence[tuple[int, int, float]] = ()) -> ModelBody:
    """Return a body as a certificate lists it, divided by cuts."""
    body = named.body
    return ModelBody(
        body.name,
        named.number,
        body.kind,
        body.joint,
        _pose(body.placement.homogeneous),
        named.elements.measures,
        body.margin if body.kind == "obstacle" else 0.0,
        body.padding,
        tuple(body.contacts),
        tuple(cuts),
    )


def _pose(matrix: Matrix) -> list[float]:
    return [round(float(number), 12) + 0.0 for number in matrix[:3].ravel()]


def compared_pairs(named: Sequence[NamedBody], pairs: Iterable[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return the pairs of a certificate's bodies that are compared, of those of a world's bodies that must not touch.

    Pairs of which neither body moves are left out.
    """
    owner = {member: k for k, each in enumerate(named) for member in each.members}
    joints = [each.body.joint for each in named]
    found = {(owner[i], owner[j]) for i, j in pairs}
    return sorted((min(i, j), max(i, j)) for i, j in found if joints[i] or joints[j])


def unchecked_pairs(
    robot: Robot, named: Sequence[NamedBody], compared: Iterable[tuple[int, int]]
) -> tuple[tuple[int, int, str], ...]:
    """Return the pairs of a certificate's bodies that could touch and are not compared, with the reason of each."""
    known = set(compared)
    bodies = [each.body for each in named]
    moving = [k for k, body in enumerate(bodies) if body.kind != "obstacle"]
    joined = joined_links(robot)
    found = []
    for i in moving:
        first = bodies[i]
        for j, second in enumerate(bodies):
            pair = (min(i, j), max(i, j))
            if first.joint == second.joint or first.name == second.name or pair in known:
                continue
            if second.kind == "obstacle" or i < j:
                found.append((*pair, _reason(robot, first, second, joined)))
    return tuple(sorted(found))


def _reason(robot: Robot, first: Body, second: Body, joined: frozenset[frozenset[str]]) -> str:
    names = frozenset((first.name, second.name))
    if "obstacle" not in (first.kind, second.kind) and not robot.self_collision:
        return "no self-collision"
    if not first.kind == second.kind == "link":
        return "allowed by the scene"
    if names in joined and names not in robot.checked_collisions:
        return "adjacent"
    if names in robot.allowed_collisions or robot.unchecked_solids:
        return "allowed by the robot"
    return "always touching"
