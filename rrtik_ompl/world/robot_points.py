"""Removal of the arm's own body from sensor data: points on the arm are not obstacles."""

from __future__ import annotations

from collections.abc import Sequence

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector, bounded_array, not_negative
from rrtik_ompl.base.errors import require
from rrtik_ompl.base.poses import rigid
from rrtik_ompl.geometry.collision.bodies import Body, link_bodies, scene_bodies
from rrtik_ompl.geometry.collision.enclosure import enclosure
from rrtik_ompl.geometry.collision.solids import inside_mesh, is_closed, is_mesh, mesh_arrays, once_per_geometry
from rrtik_ompl.kernels.covers.points import IN_DOUBT, bounding_balls, distances_to_nearest, inside_by_rays
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Scene
from rrtik_ompl.model.shapes import PointCloud
from rrtik_ompl.world.arm_cache import arm_cache

ROUNDING = 1e-6  # [m] more than double precision errs within the room of an arm


def without_robot(
    cloud: PointCloud,
    robot: Robot,
    q: ArrayLike,
    margin: float = 0.02,
    *,
    pose: ArrayLike | pin.SE3 | None = None,
    scene: Scene | None = None,
) -> PointCloud:
    """Remove from a cloud the points that are on the arm or on an attached object, and return the rest.

    Args:
        cloud: The point cloud of the sensor.
        robot: The arm.
        q: Configuration of the arm when the cloud was recorded, shape (dof,).
        margin: Points whose balls are not farther from a link than this are removed [m]. It covers the errors of the
            sensor, its pose and the joint values.
        pose: T_world_cloud; the identity if None.
        scene: Scene whose attached objects are part of the arm; None for none.

    Raises:
        InputError: If q is no configuration of the robot, the margin is negative, or no point is left.

    Example:
        >>> import rrtik_ompl as rrtik
        >>> robot = rrtik.load_robot("titan4")
        >>> q = [0.1] * 6
        >>> seen = rrtik.PointCloud([robot.fk(q).translation, [9.0, 0.0, 0.0]], radius=0.01)
        >>> rrtik.sensing.without_robot(seen, robot, q)
        PointCloud(1 points, radius=0.01 m)
    """
    require(cloud, PointCloud, "cloud")
    require(robot, Robot, "robot", "use load_robot(name or file)")
    require(scene, Scene | None, "scene", "use Scene(obstacles, attached)")
    distance = not_negative(bounded_array(margin, (), "margin"), "margin")

    cloud_pose = pin.SE3.Identity() if pose is None else rigid(pose, "pose of a cloud")
    frames = robot.joint_frames(robot.configuration(q)[None])[0]

    attached = [] if scene is None else [body for body in scene_bodies(robot, scene) if body.kind == "attached"]
    bodies = (*link_bodies(robot), *attached)

    outside = np.ones(len(cloud.points), dtype=bool)
    covers = arm_cache(robot).covers_of(bodies)
    from_bodies = [(pin.SE3(frames[body.joint]) * body.placement).actInv(cloud_pose) for body in bodies]
    places = _around(cloud, bodies, from_bodies, distance)
    for body, (outer, inner), from_body, around in zip(bodies, covers, from_bodies, places, strict=True):
        numbers = around[outside[around]]  # those on a body before this one are removed already
        if not len(numbers):
            continue
        points = cloud.points[numbers] @ from_body.rotation.T + from_body.translation
        reach = distance + body.padding
        chosen = np.flatnonzero(_in_reach(points, body, outer, reach + cloud.radius + ROUNDING))
        near = _near(points[chosen], body.geometry, inner, cloud.radius, reach)
        outside[numbers[chosen[near]]] = False
    return cloud.only(outside, "without_robot")


def _around(
    cloud: PointCloud, bodies: Sequence[Body], from_bodies: Sequence[pin.SE3], margin: float
) -> list[NDArray[np.int64]]:
    """Return for each body the numbers of the points whose balls may be within a margin of it.

    Args:
        cloud: The cloud.
        bodies: The bodies.
        from_bodies: Pose of the cloud in the frame of each.
        margin: Distance beside the padding of each body [m].
    """
    boxes = [body.geometry.aabb_local for body in bodies]
    middles = [0.5 * (np.array(box.min_) + np.array(box.max_)) for box in boxes]
    centres = np.array([pose.actInv(middle) for pose, middle in zip(from_bodies, middles, strict=True)])
    halves = np.array([0.5 * np.linalg.norm(np.array(box.max_) - np.array(box.min_)) for box in boxes])
    radii = halves + [margin + cloud.radius + body.padding + ROUNDING for body in bodies]

    # Squares of distances of all points from all centres, seen from the arm, where they are small.
    middle = centres.mean(axis=0)
    return [np.flatnonzero(row) for row in _within(cloud.points - middle, centres - middle, radii)]


def _within(points: Matrix, centres: Matrix, radii: Vector) -> NDArray[np.bool_]:
    """Return which points, shape (n, 3), are within radii of centres, shapes (k,) and (k, 3), shape (k, n)."""
    limits = radii**2 - np.einsum("ij,ij->i", centres, centres)
    squares = (-2.0 * centres) @ points.T
    squares += np.einsum("ij,ij->i", points, points)
    return np.asarray(squares <= limits[:, None])


def _in_reach(points: Matrix, body: Body, balls: Matrix, reach: float) -> Mask:
    """Return which points are within reach of a body's outer cover, or of its box if it has none, shape (n,).

    Args:
        points: In the body's frame, shape (n, 3) [m].
        body: The body.
        balls: Its outer cover, shape (k, 4) [m]; empty for a fixed body of a simple shape.
        reach: Distance that is looked at [m].
    """
    if len(balls):
        return _by_balls(points, balls, reach)
    box = body.geometry.aabb_local
    in_box = (points >= np.array(box.min_) - reach) & (points <= np.array(box.max_) + reach)
    return np.asarray(in_box.all(axis=1))


def _by_balls(points: Matrix, balls: Matrix, reach: float) -> Mask:
    """Return which points, shape (n, 3), are within reach [m] of one of some balls, shape (k, 4), shape (n,)."""
    return np.asarray(_within(points, balls[:, :3], np.maximum(balls[:, 3] + reach, 0.0)).any(axis=0))


def _near(points: Matrix, geometry: coal.CollisionGeometry, inner: Matrix, radius: float, margin: float) -> Mask:
    """Return which balls around points, shape (n, 3), are within a margin of a geometry, or inside of it, shape (n,).

    What is near to a ball inside of the geometry is near to it. The others are compared with a mesh triangle by
    triangle, with a box in closed form, with all other geometries by coal.

    Args:
        points: The centres in the geometry's frame [m].
        geometry: The geometry.
        inner: Balls inside of it, shape (k, 4) [m].
        radius: Of the balls around points [m].
        margin: The margin [m].
    """
    near = _by_balls(points, inner, radius + margin - ROUNDING)
    open_ = np.flatnonzero(~near)
    if len(open_):
        near[open_] = _near_solid(points[open_], geometry, radius, margin)
    return near


def _near_solid(points: Matrix, geometry: coal.CollisionGeometry, radius: float, margin: float) -> Mask:
    """As :func:`_near`, without balls inside of the geometry."""
    if isinstance(geometry, coal.Box):
        beyond = np.maximum(np.abs(points) - geometry.halfSide, 0.0)
        reach = radius + margin + geometry.getSweptSphereRadius()
        return np.asarray(np.einsum("ij,ij->i", beyond, beyond) <= reach**2)
    if not is_mesh(geometry):
        return np.array([_touches(point, geometry, radius, margin) for point in points], dtype=bool)

    near: Mask = distances_to_nearest(points, *_triangles(geometry)) <= radius + margin
    others = ~near
    near[others] = _inside(geometry, points[others])
    return near


def _touches(point: Vector, geometry: coal.CollisionGeometry, radius: float, margin: float) -> bool:
    """Check by coal whether a ball around a point is within a margin of a solid."""
    there = coal.Transform3s(np.eye(3), point)
    asked = coal.CollisionRequest()
    asked.security_margin = margin
    ends = geometry, coal.Transform3s(), coal.Sphere(radius), there
    return bool(coal.collide(*ends, asked, coal.CollisionResult()))


def _inside(mesh: coal.BVHModelBase, points: Matrix) -> Mask:
    """Return which points, shape (n, 3), that are apart from a mesh are inside of it, shape (n,)."""
    if not is_closed(mesh):
        hollow = enclosure(mesh)
        return np.array([hollow.holds(point[None]) for point in points], dtype=bool)

    answers = inside_by_rays(_triangles(mesh)[0], points)
    for k in np.flatnonzero(answers == IN_DOUBT):
        answers[k] = inside_mesh(*mesh_arrays(mesh), points[k])
    return np.asarray(answers == 1)


@once_per_geometry
def _triangles(mesh: coal.BVHModelBase) -> tuple[NDArray[np.float64], Matrix, Vector]:
    """Return the triangles of a mesh, shape (m, 3, 3), and centres and radii of balls around them."""
    corners, faces = mesh_arrays(mesh)
    surface = np.ascontiguousarray(corners[faces], dtype=np.float64)
    centres, radii = bounding_balls(surface)
    return surface, centres, radii
