"""Pairs of bodies that touch or come too near, measured by coal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.geometry.collision.cloud_solid import Ends
from rrtik_ompl.geometry.collision.margins import kept_apart, request
from rrtik_ompl.geometry.collision.own_distances import is_ours, own_gap, own_nearest
from rrtik_ompl.geometry.collision.solids import is_mesh, solids_of
from rrtik_ompl.model.judgement import Contact


def measured(
    bodies: Sequence[Body], pairs: Sequence[tuple[int, int]], frames: NDArray[np.float64], *, near_only: bool
) -> Iterator[Contact]:
    """The pairs of bodies and their distances [m]; with ``near_only`` only those that touch or come too near.

    Args:
        bodies: The solids.
        pairs: Numbers of those that must not touch.
        frames: Pose of every joint frame in the world, world first, shape (joints + 1, 4, 4).
        near_only: Leave out what keeps its margin.
    """
    poses = [pin.SE3(frames[b.joint]) * b.placement for b in bodies]
    transforms = [coal.Transform3s(p.rotation, p.translation) for p in poses]

    for i, j in pairs:
        margin = kept_apart(bodies[i], bodies[j])
        placed_geometries = (bodies[i].geometry, transforms[i], bodies[j].geometry, transforms[j])
        if near_only and not _touch_or_near(placed_geometries, margin):
            continue

        distance, first, second = _distance(placed_geometries, with_depth=near_only)
        distance = min(distance, margin) if near_only else distance
        yield Contact(bodies[i].name, bodies[j].name, distance, first, second, margin)


def _touch_or_near(ends: Ends, margin: float) -> bool:
    """Whether two geometries touch or come nearer than a margin [m]."""
    ends, margin = solids_of(ends, margin)
    if is_ours(ends):
        return own_gap(ends, margin) is None
    return bool(coal.collide(*ends, request(margin), coal.CollisionResult()))


def inside(first: str, second: str) -> Contact:
    """A body wholly inside another: there are no witness points and no meaningful depth."""
    unknown_point = np.full(3, np.nan)
    return Contact(first, second, 0.0, unknown_point, unknown_point)


def _distance(ends: Ends, *, with_depth: bool) -> tuple[float, Vector, Vector]:
    """Signed distance of two placed geometries [m], and the points in the world that it is between, shape (3,) each.

    ``with_depth`` asks for the depth of two meshes that overlap, which takes longer.
    """
    if is_ours(ends):
        return own_nearest(ends)

    collision = coal.CollisionResult()
    result = coal.DistanceResult()
    distance = float(coal.distance(*ends, coal.DistanceRequest(), result))

    # Between two meshes that overlap coal knows no distance, but a depth of collision.
    meshes_overlap = distance <= 0.0 and is_mesh(ends[0]) and is_mesh(ends[2])
    if with_depth and meshes_overlap and coal.collide(*ends, request(0.0), collision):
        result = collision.getContact(0)
        distance = float(result.penetration_depth)
    return distance, np.array(result.getNearestPoint1()), np.array(result.getNearestPoint2())
