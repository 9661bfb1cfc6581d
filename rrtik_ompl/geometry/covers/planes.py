"""Planes that bound a convex solid, all of them or the most different ones."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

import numpy as np

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.geometry.collision.solids import convex_arrays, face_normals, once_per_geometry

if TYPE_CHECKING:
    import coal

MOST_PLANES = 64  # of the outer polyhedron of a convex solid: fewer planes make it larger, never smaller


def most_different(planes: Matrix, count: int) -> Matrix:
    """At most ``count`` of the planes, each time the one whose normal is farthest from those already taken."""
    if len(planes) <= count:
        return planes

    taken = [0]
    largest_cosine = planes[:, :3] @ planes[0, :3]
    while len(taken) < count:
        taken.append(int(np.argmin(largest_cosine)))
        largest_cosine = np.maximum(largest_cosine, planes[:, :3] @ planes[taken[-1], :3])
    return planes[taken]


@once_per_geometry
def known_planes(solid: coal.Convex) -> Matrix | None:
    """See :func:`outward_planes`; a solid that moves keeps them."""
    return outward_planes(solid)


@once_per_geometry
def outer_planes(solid: coal.Convex) -> Matrix:
    """The planes of the outer polyhedron of a convex solid."""
    return most_different(cast(Matrix, known_planes(solid)), MOST_PLANES)


def outward_planes(solid: coal.Convex) -> Matrix | None:
    """Outward unit normals and offsets of a coal convex solid's faces, shape (k, 4); None if it has no thickness.

    Each plane is moved to the outermost corner along its normal, so that the solid lies behind all of them whatever
    the faces' own precision; almost parallel faces share one plane.
    """
    points, triangles = convex_arrays(solid)
    if len(triangles) < 4:
        return None

    normals, areas = face_normals(points, triangles)
    if len(normals) < 4:
        return None

    normals = normals[np.argsort(-areas)]  # of almost parallel faces the largest stands for the others
    normals = normals[np.sort(np.unique(np.round(normals, 6), axis=0, return_index=True)[1])]
    return np.column_stack([normals, (points @ normals.T).max(axis=0)])
