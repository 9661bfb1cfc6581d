"""The shape that a coal geometry was made from: the way back of `solids`, for whoever draws."""

from __future__ import annotations

from typing import Any

import coal
import numpy as np

from rrtik_ompl.collision.solids import is_mesh, mesh_arrays
from rrtik_ompl.shapes import Box, Capsule, Cylinder, Mesh, Shape, Sphere


def shape_of(geometry: Any) -> Shape | None:
    """The shape of a coal geometry, None if we have no such shape (a plane, a cone).

    Raises:
        InputError: If it is a mesh without area.
    """
    if isinstance(geometry, coal.Box):
        return Box(2.0 * geometry.halfSide)
    if isinstance(geometry, coal.Sphere):
        return Sphere(geometry.radius)
    if isinstance(geometry, coal.Cylinder):
        return Cylinder(geometry.radius, 2.0 * geometry.halfLength)
    if isinstance(geometry, coal.Capsule):
        return Capsule(geometry.radius, 2.0 * geometry.halfLength)
    if is_mesh(geometry):
        return Mesh(*mesh_arrays(geometry))
    if isinstance(geometry, coal.Convex):
        corners = np.array(geometry.points(), dtype=np.float64).reshape(-1, 3)
        faces = [geometry.polygons(k) for k in range(geometry.num_polygons)]
        return Mesh(corners, np.array([[f[0], f[1], f[2]] for f in faces], dtype=np.int64))
    return None
