"""How far the bodies of a world are from touching, by an instrument that shares no kernel with what it judges.

Poses are Pinocchio's. Balls, clouds and half-spaces are measured here in plain arithmetic, against solids and against
every triangle of a mesh; all other pairs by coal's distances, which the checks of a world never ask for. Links are what
the robot's description says: a mesh is judged as its triangles, whatever the world takes it for.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from bench.robustness.solid_distance import distance_to, lowest
from rrtik_ompl import Obstacle, PointCloud, World
from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.geometry.collision.solids import bvh, is_mesh, mesh_arrays
from rrtik_ompl.model.scene import AttachedObject
from rrtik_ompl.model.shapes import Box, Capsule, Cylinder, HalfSpace, Mesh, Shape, Sphere

STEPS = np.array([0.5, 1.0, 2.0, 5.0, 10.0, 30.0, 100.0, 300.0, 1000.0]) * 1e-6  # [m] by which bodies are moved apart
WAYS = np.array([way for way in product((-1.0, 0.0, 1.0), repeat=3) if any(way)])
WAYS /= np.linalg.norm(WAYS, axis=1)[:, None]


@dataclass(frozen=True, eq=False)
class Part:
    """A body of the world as the judge sees it.

    Attributes:
        name: Of the link, obstacle or attached object.
        kind: "link", or the name of the shape's class.
        joint: Number of the joint that moves it; 0 stands still.
        placement: In the joint's frame.
        shape: What it is, in its own frame.
        margin: How far what moves must stay from it [m].
    """

    name: str
    kind: str
    joint: int
    placement: pin.SE3
    shape: Shape
    margin: float = 0.0

    @cached_property
    def box(self) -> tuple[Vector, Vector]:
        """Centre and half sides of a box around it in its own frame, shape (3,) each [m]."""
        if isinstance(self.shape, PointCloud):
            low, high = self.shape.points.min(axis=0), self.shape.points.max(axis=0)
            low, high = low.astype(np.float64) - self.shape.radius, high.astype(np.float64) + self.shape.radius
        else:
            points = np.vstack([np.eye(3), -np.eye(3)])
            ends = [lowest(self.shape, way) for way in points]
            low, high = np.array(ends[:3]), -np.array(ends[3:])
        return 0.5 * (low + high), 0.5 * (high - low)

    @cached_property
    def geometry(self) -> Any:
        """What coal measures."""
        return _coal(self.shape)


def _coal(shape: Shape) -> Any:
    match shape:
        case Box(size=size):
            return coal.Box(*size)
        case Sphere(radius=radius):
            return coal.Sphere(radius)
        case Capsule(radius=radius, length=length):
            return coal.Capsule(radius, length)
        case Cylinder(radius=radius, length=length):
            return coal.Cylinder(radius, length)
        case Mesh(vertices=vertices, triangles=triangles):
            found = bvh(vertices, triangles)
        case _:
            found = bvh(*shape.surface())
    found.computeLocalAABB()
    return found


def _link_shape(geometry: Any) -> Shape:
    if is_mesh(geometry):
        return Mesh(*mesh_arrays(geometry))
    match type(geometry).__name__:
        case "Box":
            return Box(2.0 * np.array(geometry.halfSide))
        case "Sphere":
            return Sphere(geometry.radius)
        case "Capsule":
            return Capsule(geometry.radius, 2.0 * geometry.halfLength)
        case "Cylinder":
            return Cylinder(geometry.radius, 2.0 * geometry.halfLength)
    raise TypeError(f"no judge for {type(geometry).__name__}")


def parts_of(world: World) -> list[Part]:
    """The robot's own bodies, then those of the scene."""
    robot = world.robot
    found = [
        Part(robot.link_of(item), "link", item.parentJoint, item.placement, _link_shape(item.geometry))
        for item in robot.collision.geometryObjects
    ]
    solids: list[Obstacle | AttachedObject] = [*world.scene.obstacles, *world.scene.attached]
    return found + [_scene_part(world, item) for item in solids]


def _scene_part(world: World, item: Obstacle | AttachedObject) -> Part:
    kind = type(item.shape).__name__
    if isinstance(item, Obstacle):
        return Part(item.name, kind, 0, item.pose, item.shape, item.margin)
    model = world.robot.model
    frame = model.frames[model.getFrameId(item.link, pin.FrameType.BODY)]
    return Part(item.name, kind, frame.parentJoint, frame.placement * item.pose, item.shape)


@dataclass(frozen=True)
class Nearest:
    """The pair that is nearest to contact, or deepest in it: what is left above its margin [m], and its kinds."""

    gap: float
    pair: str
    kinds: tuple[str, str]


class Judge:
    """Measures configurations of a world.

    Args:
        world: Which pairs must not touch, and their margins, are read from it; no check of it is used.
    """

    def __init__(self, world: World) -> None:
        self._model, self._data = world.robot.model, world.robot.model.createData()
        self._robot, self._parts = world.robot, parts_of(world)
        links = len(world.robot.collision.geometryObjects)
        places = {part.name: k for k, part in enumerate(self._parts) if k >= links}
        numbers = [k if k < links else places[body.name] for k, body in enumerate(world.bodies)]
        pairs = {(numbers[i], numbers[j]) for i, j in world.pairs}
        moving = [(i, j) for i, j in sorted(pairs) if self._parts[i].joint or self._parts[j].joint]
        self._pairs = np.array(moving)
        self._kept = np.array([self._margin(i, j, world.self_margin) for i, j in moving])
        self._planes = np.array([any(isinstance(self._parts[k].shape, HalfSpace) for k in pair) for pair in moving])

    def _margin(self, i: int, j: int, own: float) -> float:
        obstacles = [
            self._parts[k].margin for k in (i, j) if self._parts[k].joint == 0 and self._parts[k].kind != "link"
        ]
        return obstacles[0] if obstacles else own

    def nearest(self, q: Vector) -> Nearest:
        """The pair that is nearest to contact at a configuration, shape (dof,)."""
        pin.forwardKinematics(self._model, self._data, self._robot.pinocchio_configuration(q[None])[0])
        poses = [self._data.oMi[part.joint] * part.placement for part in self._parts]
        best: Nearest | None = None
        bounds = self._bounds(poses)
        for k in np.argsort(bounds):
            if best is not None and bounds[k] >= best.gap:
                break
            i, j = self._pairs[k]
            most = np.inf if best is None else best.gap
            gap = _gap(self._parts[i], poses[i], self._parts[j], poses[j], self._kept[k], most)
            if best is None or gap < best.gap:
                pair = f"{self._parts[i].name} / {self._parts[j].name}"
                best = Nearest(gap, pair, (self._parts[i].kind, self._parts[j].kind))
        assert best is not None
        return best

    def _bounds(self, poses: list[pin.SE3]) -> Vector:
        """A lower bound of what is left of each pair, from boxes around its bodies; shape (pairs,) [m]."""
        turns = np.array([pose.rotation for pose in poses])
        boxes = [(np.zeros(3), np.zeros(3)) if isinstance(p.shape, HalfSpace) else p.box for p in self._parts]
        centres, halves = np.array([box[0] for box in boxes]), np.array([box[1] for box in boxes])
        places = np.einsum("kij,kj->ki", turns, centres) + np.array([pose.translation for pose in poses])
        halves = np.einsum("kij,kj->ki", np.abs(turns), halves)
        i, j = self._pairs.T
        apart = np.maximum(np.abs(places[i] - places[j]) - halves[i] - halves[j], 0.0)
        bounds = np.linalg.norm(apart, axis=1) - self._kept
        bounds[self._planes] = -np.inf
        return np.asarray(bounds)


def _gap(first: Part, first_pose: pin.SE3, second: Part, second_pose: pin.SE3, kept: float, most: float) -> float:
    """What is left of the distance of two bodies above what must be kept [m]; less than 0 if that is not kept.

    Where it is more than ``most``, ``most`` or more comes back.
    """
    ends = (first, first_pose, second, second_pose)
    for a, a_pose, b, b_pose in sorted((ends, ends[2:] + ends[:2]), key=_order):
        between = b_pose.inverse() * a_pose  # a's frame in b's
        match a.shape:
            case HalfSpace(normal=normal, offset=offset):
                normal = between.rotation @ normal
                return lowest(b.shape, normal) - (offset + float(normal @ between.translation)) - kept
            case Sphere(radius=radius):
                return float(distance_to(b.shape, between.translation[None], most + kept + radius)[0]) - radius - kept
            case PointCloud():
                return _cloud_gap(a.shape, between, b, most + kept) - kept
    return _by_coal(first, first_pose, second, second_pose, kept, most)


def _order(ends: tuple[Part, pin.SE3, Part, pin.SE3]) -> int:
    """Half-spaces come first, then clouds: nothing here measures how far a point is from them."""
    return next((k for k, kind in enumerate((HalfSpace, PointCloud)) if isinstance(ends[0].shape, kind)), 2)


def _cloud_gap(cloud: PointCloud, between: pin.SE3, other: Part, most: float) -> float:
    """The distance of the ball that is nearest; balls are looked at in the order of their distance from a box.

    Where it is more than ``most``, ``most`` comes back.
    """
    points: Matrix = cloud.points.astype(np.float64) @ between.rotation.T + between.translation
    centre, half = other.box
    away = np.linalg.norm(np.maximum(np.abs(points - centre) - half, 0.0), axis=1)
    best = most
    for rows in np.array_split(np.argsort(away), max(len(points) // 16, 1)):
        if away[rows[0]] - cloud.radius >= best:
            break
        away_of_rows = distance_to(other.shape, points[rows], best + cloud.radius)
        best = min(best, float(away_of_rows.min()) - cloud.radius)
    return best


def _by_coal(first: Part, first_pose: pin.SE3, second: Part, second_pose: pin.SE3, kept: float, most: float) -> float:
    """By coal; of bodies that overlap, how far they have to be moved for the distance that they must keep.

    That is an upper bound of how deep they overlap, for some other way may be shorter.
    """
    found = _coal_distance(first, first_pose, second, second_pose, np.zeros(3), most + kept)
    left = float(found.min_distance) - kept
    if left >= 0.0:
        return left
    normal = np.array(found.normal)
    ways = WAYS if not np.isfinite(normal).all() else np.vstack([normal, -normal, WAYS])
    for step in STEPS:
        for way in ways:
            moved = _coal_distance(first, first_pose, second, second_pose, step * way, 2.0 * kept + step)
            if moved.min_distance > kept:
                return -float(step)
    return -2.0 * float(STEPS[-1])


def _coal_distance(
    first: Part, first_pose: pin.SE3, second: Part, second_pose: pin.SE3, shift: Vector, most: float
) -> Any:
    """The distance by coal, or ``most`` where it is more: pairs of triangles farther apart are then passed over."""
    asked, found = coal.DistanceRequest(), coal.DistanceResult()
    if np.isfinite(most):
        found.min_distance = most
    asked.gjk_tolerance = asked.epa_tolerance = 1e-9
    ends = (
        coal.Transform3s(first_pose.rotation, first_pose.translation),
        coal.Transform3s(second_pose.rotation, second_pose.translation + shift),
    )
    coal.distance(first.geometry, ends[0], second.geometry, ends[1], asked, found)
    return found
