"""Clouds of points for exact checks: coal has no such kind, so it is asked for a ball at each point that is near.

Near is what lies close to the other body's bounding box; the cloud's tree finds it. The answers are coal's own.
"""

from __future__ import annotations

import weakref
from typing import NamedTuple

import coal
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.geometry.collision.enclosure import enclosure
from rrtik_ompl.geometry.collision.solids import Ends as Ends
from rrtik_ompl.geometry.collision.solids import inside_mesh, is_closed, is_mesh, mesh_arrays
from rrtik_ompl.model.shapes import PointCloud

LOOK = 0.05  # [m] beyond what was asked for; what is farther away than this is not measured further


class CloudSolid(coal.Sphere):  # type: ignore[misc]
    """A cloud where a coal geometry is expected; to coal itself it is the ball around its frame that holds it.

    Attributes:
        cloud: The cloud.
    """

    def __init__(self, cloud: PointCloud) -> None:
        super().__init__(float(np.linalg.norm(np.maximum(*np.abs(cloud.bounds)))))
        self.cloud = cloud

    def computeLocalAABB(self) -> None:
        """Set the bounding box and sphere to those of the points' balls."""
        super().computeLocalAABB()
        low, high = self.cloud.bounds
        self.aabb_local.min_ = low
        self.aabb_local.max_ = high
        self.aabb_center = 0.5 * (low + high)
        self.aabb_radius = float(np.linalg.norm(0.5 * (high - low)))


def cloud_solid(cloud: PointCloud) -> CloudSolid:
    """What collision checks take a cloud for: the same object each time, for as long as a world holds it.

    The cloud does not hold it: Python cannot see what an object of coal's refers to, so that a circle of the two would
    never be freed.
    """
    solid = cloud.solid() if hasattr(cloud, "solid") else None
    if solid is None:
        solid = CloudSolid(cloud)
        solid.computeLocalAABB()
        object.__setattr__(cloud, "solid", weakref.ref(solid))
    return solid


def has_cloud(ends: Ends) -> bool:
    """Whether one of two geometries is a cloud."""
    return isinstance(ends[0], CloudSolid) or isinstance(ends[2], CloudSolid)


def cloud_gap(ends: Ends, margin: float) -> float | None:
    """A lower bound of the distance of two geometries, one of them a cloud, less a margin [m]; None if it is not kept.

    What lies wholly inside a hollow mesh touches it.
    """
    cloud, other, to_other, _ = _sides(ends)
    points, _ = _near(cloud, other, to_other, cloud.radius + margin + LOOK)

    ball = coal.Sphere(cloud.radius)
    here = coal.Transform3s()
    there = coal.Transform3s()
    asked = coal.CollisionRequest()
    asked.security_margin = margin

    gap = LOOK
    for point in points:
        there.setTranslation(point)
        result = coal.CollisionResult()
        if coal.collide(other, here, ball, there, asked, result):
            return None
        gap = min(gap, float(result.distance_lower_bound))

    return None if is_mesh(other) and _one_inside(other, points) else gap


class Nearest(NamedTuple):
    """Signed distance of two geometries [m], and the points in the world that it is between, shape (3,) each."""

    distance: float
    first: Vector
    second: Vector


def nearest_of_cloud(ends: Ends) -> Nearest:
    """The distance of two geometries, one of them a cloud."""
    cloud, other, to_other, swapped = _sides(ends)

    reach = cloud.radius + LOOK
    points = np.zeros((0, 3))
    bounds = np.zeros(0)
    while not len(points):
        points, bounds = _near(cloud, other, to_other, reach)
        reach *= 4.0

    ball = coal.Sphere(cloud.radius)
    here = coal.Transform3s()
    best = None
    for point, bound in zip(points, bounds, strict=True):
        # The points come nearest to the box first: none that follows can be nearer than the best one.
        if best is not None and bound - cloud.radius >= best.min_distance:
            break
        result = coal.DistanceResult()
        coal.distance(other, here, ball, coal.Transform3s(np.eye(3), point), coal.DistanceRequest(), result)
        best = result if best is None or result.min_distance < best.min_distance else best
    assert best is not None

    pose = ends[1] if swapped else ends[3]
    found = [pose.transform(np.array(p)) for p in (best.getNearestPoint1(), best.getNearestPoint2())]
    return Nearest(float(best.min_distance), *(found if swapped else found[::-1]))


def _sides(ends: Ends) -> tuple[PointCloud, coal.CollisionGeometry, coal.Transform3s, bool]:
    """The cloud, the other geometry, the cloud's pose in the other's frame, and whether the cloud is the second one."""
    first, first_pose, second, second_pose = ends
    if isinstance(first, CloudSolid):
        return first.cloud, second, second_pose.inverseTimes(first_pose), False
    return second.cloud, first, first_pose.inverseTimes(second_pose), True


def _near(
    cloud: PointCloud, other: coal.CollisionGeometry, to_other: coal.Transform3s, reach: float
) -> tuple[Matrix, Vector]:
    """Points of a cloud within a reach [m] of the other's bounding box, deepest inside it first, in the other's frame.

    Also their distances from that box.
    """
    turn = np.array(to_other.getRotation())
    shift = np.array(to_other.getTranslation())
    low = np.array(other.aabb_local.min_)
    high = np.array(other.aabb_local.max_)

    centre = turn.T @ (0.5 * (low + high) - shift)
    half = np.abs(turn.T) @ (0.5 * (high - low)) + reach
    points = cloud.tree.within(centre - half, centre + half).astype(np.float64) @ turn.T + shift

    beyond = np.maximum(low - points, points - high)
    away: NDArray[np.float64] = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
    kept = np.flatnonzero(away <= reach)
    kept = kept[np.argsort(away[kept] + np.minimum(beyond[kept].max(axis=1), 0.0))]
    return points[kept], away[kept]


def _one_inside(mesh: coal.BVHModelBase, points: Matrix) -> bool:
    """Whether one of some points is inside a hollow mesh, whose surface they do not touch."""
    box = mesh.aabb_local
    points = points[((points >= np.array(box.min_)) & (points <= np.array(box.max_))).all(axis=1)]
    if not len(points):
        return False
    if is_closed(mesh):
        return any(inside_mesh(*mesh_arrays(mesh), point) for point in points)
    return enclosure(mesh).holds(points)
