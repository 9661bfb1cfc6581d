"""Distances of the geometries that coal has none for, or not the right one: clouds of points, two capsules.

Coal takes the axes of two capsules for parallel where the product of their squared lengths and of the squared sine of
their angle is below 2e-14 m^4: two of a millimetre may overlap by a tenth of their length unseen.
"""

from __future__ import annotations

from typing import TypeAlias, cast

import coal
import numpy as np

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.geometry.collision.cloud_solid import Ends, Nearest, cloud_gap, has_cloud, nearest_of_cloud
from rrtik_ompl.geometry.collision.shape_table import Core, core_of

Segment: TypeAlias = tuple[Vector, Vector]


def is_ours(ends: Ends) -> bool:
    """Whether the distance of two geometries is measured here, and not by coal."""
    return has_cloud(ends) or (_is_capsule(ends[0]) and _is_capsule(ends[2]))


def own_gap(ends: Ends, margin: float) -> float | None:
    """A lower bound of the distance of two geometries less a margin [m]; None if it is not kept."""
    if has_cloud(ends):
        return cloud_gap(ends, margin)
    gap = own_nearest(ends).distance - margin
    return gap if gap > 0.0 else None


def own_nearest(ends: Ends) -> Nearest:
    """The signed distance of two geometries and the points that it is between."""
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
    """The points of two segments that are nearest to each other, shape (3,) each.

    They are ends of one of them, or the feet of the common perpendicular. Each candidate lies on its segment, so that
    none is nearer than the segments are; the perpendicular is found by cross products, which hold for all lengths and
    nearly parallel segments too.
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
    """The point of a segment that is nearest to a point."""
    direction = segment[1] - segment[0]
    squared_length = float(direction @ direction)
    if squared_length == 0.0:
        return segment[0]
    fraction = np.clip((point - segment[0]) @ direction / squared_length, 0.0, 1.0)
    return np.asarray(segment[0] + fraction * direction)


def _is_capsule(geometry: coal.CollisionGeometry) -> bool:
    """Whether a geometry is all that is no farther than a radius from a segment."""
    core = core_of(geometry)
    return core is not None and core.rounded and len(core.corners) == 2


def _core(capsule: coal.CollisionGeometry) -> Core:
    return cast(Core, core_of(capsule))


def _axis(capsule: coal.CollisionGeometry, pose: coal.Transform3s) -> Segment:
    """Ends of a capsule's axis in the world."""
    rotation = np.array(pose.getRotation())
    first, second = _core(capsule).corners @ rotation.T + np.array(pose.getTranslation())
    return first, second


def _across(first: Segment, second: Segment) -> Vector:
    """A unit vector across two segments that meet."""
    normal = np.cross(first[1] - first[0], second[1] - second[0])
    length = float(np.linalg.norm(normal))
    return normal / length if length > 0.0 else np.array([1.0, 0.0, 0.0])
