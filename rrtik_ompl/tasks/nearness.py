"""Check whether two geometries are farther apart than a distance: by convex pieces first where one is a mesh.

The pieces are those of proofs: their union contains the mesh. So where all of them are far enough away, the mesh is,
too, which takes ten calls of coal instead of a search among tens of thousands of triangles.
"""

from __future__ import annotations

from itertools import product

import coal

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.geometry.collision.solids import Ends, around, hull, is_mesh, once_per_geometry
from rrtik_ompl.kernels.tables.solid_tables import convex_solids
from rrtik_ompl.world.exact_checks import distance

MOST_PAIRS = 64  # pairs of convex pieces; to compare more of them takes as long as to compare meshes


def beyond(ends: Ends, least: float) -> bool:
    """Check whether two placed geometries are farther apart than a distance [m], from 0."""
    has_mesh = is_mesh(ends[0]) or is_mesh(ends[2])
    return (has_mesh and beyond_by_pieces(ends, least)) or distance(*ends, least) is not None


def beyond_by_pieces(ends: Ends, least: float) -> bool:
    """As :func:`beyond`; False may also mean that their convex pieces do not tell."""
    first, first_pose, second, second_pose = ends
    if distance(around(first), first_pose, around(second), second_pose, least) is not None:
        return True
    if not (is_mesh(first) or is_mesh(second)):
        return False

    pieces = [_pieces(geometry) if is_mesh(geometry) else (geometry,) for geometry in (first, second)]
    count = len(pieces[0]) * len(pieces[1])
    return 0 < count <= MOST_PAIRS and all(
        distance(one, first_pose, other, second_pose, least) is not None for one, other in product(*pieces)
    )


@once_per_geometry
def _pieces(mesh: coal.CollisionGeometry) -> tuple[coal.Convex, ...]:
    """Return convex solids whose union contains a mesh; none if one of them is too flat for coal."""
    try:
        pieces = tuple(hull(solid.corners) for solid in convex_solids(mesh).around)
    except InputError:
        return ()
    for piece in pieces:
        piece.computeLocalAABB()
    return pieces
