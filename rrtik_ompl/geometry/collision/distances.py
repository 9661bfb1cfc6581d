"""Measure distances between placed geometries, and find the pairs of bodies that touch or come too near.

Coal measures most of them. Our own code measures clouds of points, which coal does not have, and pairs of capsules:
coal takes their axes for parallel if the product of their squared lengths and of the squared sine of their angle is
below 2e-14 m^4, so that two capsules of a millimetre may overlap by a tenth of their length unnoticed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TypeAlias, cast

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.geometry.collision.bodies import Body, kept_apart, request
from rrtik_ompl.geometry.collision.cloud_solid import LOOK_AHEAD, Ends, Nearest, cloud_gap, has_cloud, nearest_of_cloud
from rrtik_ompl.geometry.collision.shape_table import Core, core_of
from rrtik_ompl.geometry.collision.solids import is_mesh, solids_of
from rrtik_ompl.model.judgement import Contact

Segment: TypeAlias = tuple[Vector, Vector]
MOST_CONTACTS = 1_000_000  # triangles of a mesh that may overlap a solid


def measured(
    bodies: Sequence[Body], pairs: Sequence[tuple[int, int]], frames: NDArray[np.float64], *, near_only: bool
) -> Iterator[Contact]:
    """Yield the contact of each pair of bodies: names, distance, nearest points and required distance.

    Args:
        bodies: The bodies of a world.
        pairs: Numbers of the bodies that must not touch.
        frames: Pose of every joint frame in the world, the world's own first, shape (joints + 1, 4, 4).
        near_only: Whether to leave out pairs that keep their required distance. If so, overlapping meshes are measured
            by their penetration depth too.
    """
    transforms = [transform_of(body, frames) for body in bodies]

    for i, j in pairs:
        margin = kept_apart(bodies[i], bodies[j])
        placed_geometries = (bodies[i].geometry, transforms[i], bodies[j].geometry, transforms[j])
        if near_only and gap_beyond(placed_geometries, margin) is not None:
            continue

        distance, first, second = _distance(placed_geometries, with_depth=near_only)
        distance = min(distance, margin) if near_only else distance
        yield Contact(bodies[i].name, bodies[j].name, distance, first, second, margin)


def transform_of(body: Body, frames: NDArray[np.float64]) -> coal.Transform3s:
    """Return where a body is in the world; ``frames`` as of :func:`measured`."""
    pose = pin.SE3(frames[body.joint]) * body.placement
    return coal.Transform3s(pose.rotation, pose.translation)


def gap_beyond(ends: Ends, margin: float, look_ahead: float = LOOK_AHEAD) -> float | None:
    """Return a lower bound of the distance of two placed geometries minus a margin [m]; None if the margin is not kept.

    Each call uses a new request and result, as reused ones may miss overlaps.

    Args:
        ends: Two geometries with their poses.
        margin: Distance that must be kept [m].
        look_ahead: Largest bound that is of use [m]: it saves work with clouds.
    """
    ends, margin = solids_of(ends, margin)
    if is_ours(ends):
        return own_gap(ends, margin, look_ahead)

    result = coal.CollisionResult()
    if coal.collide(*ends, request(margin), result):
        return None
    return float(result.distance_lower_bound)


def beyond(first: Body, second: Body, frames: NDArray[np.float64], distance: float) -> bool:
    """Check whether two bodies are farther apart than a distance [m], from 0; ``frames`` as of :func:`measured`."""
    ends = (first.geometry, transform_of(first, frames), second.geometry, transform_of(second, frames))
    return gap_beyond(ends, distance) is not None


def signed_gap(ends: Ends) -> float:
    """Return the signed distance of two placed geometries [m]; of overlapping meshes it is no depth.

    Where one is a mesh, this takes several times as long as :func:`gap_beyond`.
    """
    if is_ours(ends):
        return own_nearest(ends).distance
    return float(coal.distance(*ends, coal.DistanceRequest(), coal.DistanceResult()))


def _distance(ends: Ends, *, with_depth: bool) -> tuple[float, Vector, Vector]:
    """Return the signed distance of two placed geometries and their nearest points.

    Args:
        ends: Two geometries with their poses.
        with_depth: Whether to compute the penetration depth of two overlapping meshes, which takes longer.

    Returns:
        The distance [m], negative for a penetration depth (of a mesh, that of its deepest triangle), and the nearest
        (or deepest) point on each geometry in the world [m], shape (3,) each.
    """
    if is_ours(ends):
        return own_nearest(ends)

    result = coal.DistanceResult()
    distance = float(coal.distance(*ends, coal.DistanceRequest(), result))

    # Of two meshes that overlap coal.distance tells no depth, of one the depth of any triangle.
    meshes = is_mesh(ends[0]) + is_mesh(ends[2])
    if distance <= 0.0 and (meshes == 1 or (meshes == 2 and with_depth)):
        wanted = request(0.0)
        wanted.num_max_contacts = MOST_CONTACTS if meshes == 1 else 1
        collision = coal.CollisionResult()
        if coal.collide(*ends, wanted, collision):
            result = min(collision.getContacts(), key=lambda contact: float(contact.penetration_depth))
            distance = float(result.penetration_depth)
    return distance, np.array(result.getNearestPoint1()), np.array(result.getNearestPoint2())


def inside(first: str, second: str) -> Contact:
    """Return the contact of a body wholly inside another: its nearest points are NaN, and its distance is 0."""
    unknown_point = np.full(3, np.nan)
    return Contact(first, second, 0.0, unknown_point, unknown_point)


def is_ours(ends: Ends) -> bool:
    """Check whether the distance of two geometries is measured by our own code instead of coal."""
    return has_cloud(ends) or (_is_capsule(ends[0]) and _is_capsule(ends[2]))


def own_gap(ends: Ends, margin: float, look_ahead: float = LOOK_AHEAD) -> float | None:
    """Return a lower bound of the distance of two geometries minus a margin [m]; None if the margin is not kept.

    One of the geometries is a cloud, or both are capsules.
    """
    if has_cloud(ends):
        return cloud_gap(ends, margin, look_ahead)
    gap = own_nearest(ends).distance - margin
    return gap if gap > 0.0 else None


def own_nearest(ends: Ends) -> Nearest:
    """Return the signed distance and the nearest points of two geometries: one of them a cloud, or two capsules."""
    if has_cloud(ends):
        return nearest_of_cloud(ends)

    first_axis = _axis(ends[0], ends[1])
    second_axis = _axis(ends[2], ends[3])

    first_point, second_point = nearest_points(first_axis, second_axis)
    connection = second_point - first_point
    axis_distance = float(np.linalg.norm(connection))

    radii = [_core(capsule).radius + float(capsule.getSweptSphereRadius()) for capsule in (ends[0], ends[2])]
    direction = connection / axis_distance if axis_distance > 0.0 else _across(first_axis, second_axis)
    return Nearest(
        axis_distance - radii[0] - radii[1], first_point + radii[0] * direction, second_point - radii[1] * direction
    )


def nearest_points(first: Segment, second: Segment) -> tuple[Vector, Vector]:
    """Return the points of two segments that are nearest to each other, shape (3,) each.

    They are an end of one segment and the nearest point of the other, or the feet of the common perpendicular. Each
    candidate lies on its segment, so that no candidate pair is nearer than the segments are. The perpendicular is
    computed by cross products, which are accurate for all lengths and for nearly parallel segments too.
    """
    candidates = [(end, _foot(end, second)) for end in first]
    candidates += [(_foot(end, first), end) for end in second]

    u = first[1] - first[0]
    v = second[1] - second[0]
    normal = np.cross(u, v)
    squared_norm = float(normal @ normal)
    if squared_norm > 0.0:
        offset = second[0] - first[0]
        on_first = first[0] + np.clip(np.cross(offset, v) @ normal / squared_norm, 0.0, 1.0) * u
        on_second = second[0] + np.clip(np.cross(offset, u) @ normal / squared_norm, 0.0, 1.0) * v
        candidates.append((on_first, on_second))

    return min(candidates, key=lambda pair: float(np.linalg.norm(pair[1] - pair[0])))


def _foot(point: Vector, segment: Segment) -> Vector:
    """Return the point of a segment that is nearest to a given point."""
    direction = segment[1] - segment[0]
    squared_length = float(direction @ direction)
    if squared_length == 0.0:
        return segment[0]
    fraction = np.clip((point - segment[0]) @ direction / squared_length, 0.0, 1.0)
    return np.asarray(segment[0] + fraction * direction)


def _is_capsule(geometry: coal.CollisionGeometry) -> bool:
    """Check whether a geometry is a capsule: all points within a radius of a segment."""
    core = core_of(geometry)
    return core is not None and core.rounded and len(core.corners) == 2


def _core(capsule: coal.CollisionGeometry) -> Core:
    return cast(Core, core_of(capsule))


def _axis(capsule: coal.CollisionGeometry, pose: coal.Transform3s) -> Segment:
    """Return both ends of a capsule's axis in the world, shape (3,) each."""
    rotation = np.array(pose.getRotation())
    first, second = _core(capsule).corners @ rotation.T + np.array(pose.getTranslation())
    return first, second


def _across(first: Segment, second: Segment) -> Vector:
    """Return a unit vector perpendicular to two segments that intersect; any one if they are parallel."""
    normal = np.cross(first[1] - first[0], second[1] - second[0])
    length = float(np.linalg.norm(normal))
    return normal / length if length > 0.0 else np.array([1.0, 0.0, 0.0])
