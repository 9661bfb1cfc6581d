"""Check clouds of points, or of equal cubes, exactly. Coal has no clouds, so it is asked about single balls or boxes.

Only points close to the other geometry's bounding box are asked about; the cloud's tree finds them.
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
from rrtik_ompl.model.shapes.point_cloud import Cloud

# [m] Points up to this much farther than required are measured; beyond that, a gap is only known to be at least this.
LOOK_AHEAD = 0.05


class CloudSolid(coal.Sphere):  # type: ignore[misc]
    """A cloud as a coal geometry; coal itself takes it for a ball around the cloud's origin that contains the cloud.

    Attributes:
        cloud: The cloud.
    """

    def __init__(self, cloud: Cloud) -> None:
        super().__init__(float(np.linalg.norm(np.maximum(*np.abs(cloud.bounds)))))
        self.cloud = cloud

    def computeLocalAABB(self) -> None:
        """Set the bounding box and sphere to those of the balls or cubes around the cloud's points."""
        super().computeLocalAABB()
        low, high = self.cloud.bounds
        self.aabb_local.min_ = low
        self.aabb_local.max_ = high
        self.aabb_center = 0.5 * (low + high)
        self.aabb_radius = float(np.linalg.norm(0.5 * (high - low)))


def cloud_solid(cloud: Cloud) -> CloudSolid:
    """Return the coal geometry of a cloud: the same object at each call, for as long as a world holds it.

    The cloud refers to it only weakly: Python's garbage collector cannot see the references of coal's objects, so a
    reference cycle between the two would never be freed.
    """
    solid = cloud.solid() if hasattr(cloud, "solid") else None
    if solid is None:
        solid = CloudSolid(cloud)
        solid.computeLocalAABB()
        object.__setattr__(cloud, "solid", weakref.ref(solid))
    return solid


def has_cloud(ends: Ends) -> bool:
    """Check whether one of two geometries is a cloud."""
    return isinstance(ends[0], CloudSolid) or isinstance(ends[2], CloudSolid)


def cloud_gap(ends: Ends, margin: float, look_ahead: float = LOOK_AHEAD) -> float | None:
    """Return a lower bound of the distance of a cloud and another geometry minus a margin [m]; None if it is not kept.

    A point that is wholly inside a hollow mesh counts as touching it.

    Args:
        ends: Two geometries with their poses, one of them a cloud.
        margin: Distance that must be kept [m].
        look_ahead: Largest bound that is of use [m]: points farther beyond the margin are not measured.
    """
    cloud, other, to_other, _ = _sides(ends)
    points, _ = _points_near_box(cloud, other, to_other, cloud.radius + margin + look_ahead)

    element = _element(cloud)
    identity = coal.Transform3s()
    point_pose = coal.Transform3s(to_other)
    collision_request = coal.CollisionRequest()
    collision_request.security_margin = margin

    gap = look_ahead
    for point in points:
        point_pose.setTranslation(point)
        result = coal.CollisionResult()
        if coal.collide(other, identity, element, point_pose, collision_request, result):
            return None
        gap = min(gap, float(result.distance_lower_bound))

    return None if is_mesh(other) and _any_inside(other, points) else gap


class Nearest(NamedTuple):
    """The signed distance of two geometries [m] and the nearest point on each in the world [m], shape (3,)."""

    distance: float
    first: Vector
    second: Vector


def nearest_of_cloud(ends: Ends) -> Nearest:
    """Return the signed distance and the nearest points of two geometries, one of which is a cloud.

    The search starts near the other's bounding box, and widens to the distance that it has found.
    """
    cloud, other, to_other, swapped = _sides(ends)

    reach = cloud.radius + LOOK_AHEAD
    nearest = _nearest_within(cloud, other, to_other, reach)
    while nearest is None:
        reach *= 4.0
        nearest = _nearest_within(cloud, other, to_other, reach)
    if nearest.min_distance > reach - cloud.radius:  # one that is farther from the box may be nearer to the solid
        nearest = _nearest_within(cloud, other, to_other, nearest.min_distance + cloud.radius) or nearest

    pose = ends[1] if swapped else ends[3]
    witness_points = [pose.transform(np.array(p)) for p in (nearest.getNearestPoint1(), nearest.getNearestPoint2())]
    return Nearest(float(nearest.min_distance), *(witness_points if swapped else witness_points[::-1]))


def _nearest_within(
    cloud: Cloud, other: coal.CollisionGeometry, to_other: coal.Transform3s, reach: float
) -> coal.DistanceResult | None:
    """Return coal's answer for the nearest of the points within a distance of the other's bounding box.

    The answer, None if there are none, is that of the whole cloud if it is at most ``reach - cloud.radius``.
    """
    points, box_distances = _points_near_box(cloud, other, to_other, reach)

    element = _element(cloud)
    identity = coal.Transform3s()
    point_pose = coal.Transform3s(to_other)
    nearest = None
    for point, box_distance in zip(points, box_distances, strict=True):
        # Points are sorted by their distance from the box, so no later one can be nearer than the best so far.
        if nearest is not None and box_distance - cloud.radius >= nearest.min_distance:
            break
        result = coal.DistanceResult()
        point_pose.setTranslation(point)
        coal.distance(other, identity, element, point_pose, coal.DistanceRequest(), result)
        nearest = result if nearest is None or result.min_distance < nearest.min_distance else nearest

    return nearest


def _element(cloud: Cloud) -> coal.CollisionGeometry:
    """Return what stands around each point of a cloud, as a coal geometry."""
    return coal.Box(*[2.0 * cloud.half] * 3) if cloud.half > 0.0 else coal.Sphere(cloud.radius)


def _sides(ends: Ends) -> tuple[Cloud, coal.CollisionGeometry, coal.Transform3s, bool]:
    """Return the parts of a pair with a cloud.

    Returns:
        The cloud, the other geometry, the cloud's pose in the other's frame, and whether the cloud is the second of the
        two.
    """
    first, first_pose, second, second_pose = ends
    if isinstance(first, CloudSolid):
        return first.cloud, second, second_pose.inverseTimes(first_pose), False
    return second.cloud, first, first_pose.inverseTimes(second_pose), True


def _points_near_box(
    cloud: Cloud, other: coal.CollisionGeometry, to_other: coal.Transform3s, reach: float
) -> tuple[Matrix, Vector]:
    """Return the points of a cloud, or centres of its cubes, within a distance of another geometry's bounding box.

    Args:
        cloud: The cloud.
        other: The other geometry.
        to_other: Pose of the cloud in the other's frame.
        reach: Largest distance of a point, or of a cube, from the box [m].

    Returns:
        The points in the other's frame [m], shape (n, 3), those deepest inside the box first, and their distances from
        the box [m], 0 inside, shape (n,).
    """
    rotation = np.array(to_other.getRotation())
    translation = np.array(to_other.getTranslation())
    low = np.array(other.aabb_local.min_)
    high = np.array(other.aabb_local.max_)

    centre = rotation.T @ (0.5 * (low + high) - translation)
    half_extents = np.abs(rotation.T) @ (0.5 * (high - low)) + reach
    points = (
        cloud.tree.within(centre - half_extents, centre + half_extents).astype(np.float64) @ rotation.T + translation
    )

    beyond = np.maximum(low - points, points - high) - cloud.half * np.abs(rotation).sum(axis=1)
    box_distances: NDArray[np.float64] = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
    near_rows = np.flatnonzero(box_distances <= reach)
    near_rows = near_rows[np.argsort(box_distances[near_rows] + np.minimum(beyond[near_rows].max(axis=1), 0.0))]
    return points[near_rows], box_distances[near_rows]


def _any_inside(mesh: coal.BVHModelBase, points: Matrix) -> bool:
    """Check whether any of the points is inside a hollow mesh; none of them touches its surface."""
    box = mesh.aabb_local
    points = points[((points >= np.array(box.min_)) & (points <= np.array(box.max_))).all(axis=1)]
    if not len(points):
        return False
    if is_closed(mesh):
        return any(inside_mesh(*mesh_arrays(mesh), point) for point in points)
    return enclosure(mesh).holds(points)
