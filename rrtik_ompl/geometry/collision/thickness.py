"""Measure how thin solids are: two in contact may not overlap so deeply that they could pass through each other.

Two solids that pass through each other have, at some moment, a penetration depth of at least half of both thicknesses
together. Half of that is kept in reserve for rotations and for the error of the measured penetration depth.
"""

from __future__ import annotations

import coal
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.geometry.collision.cloud_solid import CloudSolid
from rrtik_ompl.geometry.collision.shape_table import core_of
from rrtik_ompl.geometry.collision.solids import (
    convex_arrays,
    face_normals,
    is_closed,
    is_mesh,
    mesh_arrays,
    once_per_geometry,
)

SHARE = 0.25  # share of both thicknesses together to which two bodies in contact may overlap
MOST_RAYS = 256  # most rays by which the wall of a hollow mesh is measured
COMPARED = 2_000_000  # most pairs of a ray and a triangle that are compared
# [m^2] A ray counts as parallel to a triangle if the cosine of its angle to the normal, times twice the area, is less.
PARALLEL = 1e-12


@once_per_geometry
def least_width(geometry: coal.CollisionGeometry) -> float:
    """Return a lower bound of a geometry's width in any direction [m]; 0 for a surface without an inside.

    It is exact for boxes, cylinders, capsules and balls, and for the balls or cubes of a cloud. For other convex solids
    it is the diameter of a ball inside. For a hollow mesh it is half the thickness of the wall as measured along rays,
    so it is an estimate.
    """
    if isinstance(geometry, coal.Halfspace):
        return float("inf")
    if isinstance(geometry, CloudSolid):
        return 2.0 * float(geometry.cloud.radius + geometry.cloud.half)

    if is_mesh(geometry):
        wall = _thinnest_wall(*mesh_arrays(geometry)) if is_closed(geometry) else 0.0
        return 0.5 * wall if np.isfinite(wall) else 0.0  # If no ray hit anything, the wall is unknown.

    core = core_of(geometry)
    if core is not None:
        half = 0.0
        if core.half_sides is not None:
            half = float(core.half_sides.min())
        elif core.disc is not None:
            half = min(core.disc, core.half_length)
        return 2.0 * (half + core.radius + float(geometry.getSweptSphereRadius()))

    if isinstance(geometry, coal.Convex):
        points, triangles = convex_arrays(geometry)
        normals, _ = face_normals(points, triangles)
        centre = np.array(geometry.computeCOM())
        return 2.0 * max(float(((points @ normals.T).max(axis=0) - normals @ centre).min()), 0.0)
    return 0.0


def _thinnest_wall(vertices: Matrix, triangles: NDArray[np.int64]) -> float:
    """Return the least way through a closed mesh's wall [m], along rays from the middles of its largest triangles."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    areas = np.linalg.norm(normals, axis=1)

    rays = np.argsort(-areas, kind="stable")[: max(1, min(MOST_RAYS, COMPARED // len(triangles)))]
    rays = rays[areas[rays] > 0.0]
    if not len(rays):
        return 0.0
    return min(_way_through(k, (a, b, c), normals, areas) for k in rays.tolist())


def _way_through(number: int, corners: tuple[Matrix, Matrix, Matrix], normals: Matrix, areas: Vector) -> float:
    """Return the distance from a triangle's middle along its normal to the nearest other triangle [m], on either side.

    The intersection test is after Moeller and Trumbore.

    Args:
        number: Index of the triangle.
        corners: First, second and third corners of all triangles, shape (m, 3) each.
        normals: Normals of all triangles, of length twice the area, shape (m, 3).
        areas: Lengths of the normals, shape (m,).
    """
    a, b, c = corners
    origin = (a[number] + b[number] + c[number]) / 3.0
    direction = normals[number] / areas[number]

    cosines = normals @ direction
    crossing = np.abs(cosines) > PARALLEL
    crossing[number] = False

    a = a[crossing]
    b = b[crossing]
    c = c[crossing]
    distances = np.einsum("ij,ij->i", a - origin, normals[crossing]) / cosines[crossing]
    hit_points = origin + distances[:, None] * direction

    edge_sides = [
        np.einsum("ij,ij->i", np.cross(q - p, hit_points - p), normals[crossing]) for p, q in ((a, b), (b, c), (c, a))
    ]
    is_hit = (np.array(edge_sides) >= 0.0).all(axis=0)
    return float(np.abs(distances[is_hit]).min(initial=np.inf))
