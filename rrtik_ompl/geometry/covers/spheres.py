"""Balls around a solid (outer cover, contains it) and balls inside it (inner spheres), for any coal geometry.

An outer cover is proven, not sampled: the solid is cut into convex elements without gaps
(``geometry/covers/cells.py``), and every element lies wholly inside one ball (``geometry/covers/search.py``).

Spheres are float64 arrays of shape (n, 4): centre x, y, z and radius [m], in the frame of the geometry. Containment
holds within 1e-9 of the size of the solid [m per m].
"""

from __future__ import annotations

import coal
import numpy as np
from scipy.spatial import QhullError, cKDTree

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.geometry.collision.enclosure import enclosure
from rrtik_ompl.geometry.collision.shape_table import Core, box_corners, core_of
from rrtik_ompl.geometry.collision.solids import is_closed, is_mesh, mesh_arrays, vertices_of
from rrtik_ompl.geometry.covers.cells import elements
from rrtik_ompl.geometry.covers.inner import inscribed
from rrtik_ompl.geometry.covers.regular import ROD_PROTRUSION, balls_on_axis, regular_cover, rod_cover, row_on_z, spread
from rrtik_ompl.geometry.covers.search import smallest_cover, surface_points
from rrtik_ompl.geometry.covers.solids import (
    ROUNDING,
    Frame,
    MeshSolid,
    Solid,
    convex_solid,
    cylinder_solid,
    mesh_solid,
)

BALLS_PER_METRE = 70.0
MIN_BALLS = 2
MAX_BALLS = 32  # four full clusters of the kernels; 36 make eight
BALLS_OF_OPEN = 3  # times as many for a mere surface: nothing of a ball on it is inside
INNER_SHARE = 1.5  # inner balls for each outer one
MAX_BALLS_ON_REQUEST = 512  # balls, where a protrusion is given
# A mesh of more triangles or open edges is taken as its bounding box, and nothing is proven to collide with it.
MAX_TRIANGLES = 300_000
MAX_OPEN_EDGES = 4000
CROSSED_CELLS = 1500  # at most
CELLS_PER_BALL = 80
SURFACE_POINTS = 6000
SMALLEST = 1e-12  # [m]; what is smaller counts as a point


def outer_cover(geometry: coal.CollisionGeometry, *, protrusion: float | None = None) -> Matrix:
    """Balls whose union contains a solid, shape (n, 4).

    Args:
        geometry: A coal geometry. A mesh is taken with its interior: every point whose winding number is not 0 or,
            if it is open, what it encloses (:mod:`rrtik_ompl.geometry.collision.enclosure`). A kind that is not known
            here gets one ball (of infinite radius if the kind has no bounds).
        protrusion: How far a ball may reach beyond the solid [m]; if that takes too many balls or too fine a cut, the
            cover reaches farther (see ``protrusion_bound``). None: what a number of balls that suits the size of
            the solid allows.
    """
    swept = _swept_radius(geometry)
    core = core_of(geometry)

    if core is not None and core.rounded:
        return _grown(_round_cover(core, protrusion), swept)
    if is_mesh(geometry) and geometry.num_tris == 0:
        return np.empty((0, 4))

    made = _solid(geometry)
    if made is None:
        return _bounding_ball(geometry, swept)

    solid, frame = made
    wanted = None if protrusion is None else max(protrusion, 0.0) / frame.scale
    usual = balls_for(frame.scale) * (BALLS_OF_OPEN if len(solid.rim) else 1)
    limit = usual if protrusion is None else MAX_BALLS_ON_REQUEST

    found = _searched_cover(solid, limit, wanted)
    regular = None if core is None else regular_cover(core, limit, protrusion)
    cover = frame.spheres_out(found, solid.slack + ROUNDING)
    if regular is not None and _better(geometry, regular, cover, protrusion):
        cover = regular
    return _grown(cover, swept)


def inner_spheres(geometry: coal.CollisionGeometry, *, count: int | None = None) -> Matrix:
    """Balls inside a solid, shape (n, 4), the most useful first; none for an open mesh or an unknown kind.

    Args:
        geometry: A coal geometry.
        count: At most so many; None: a number that suits the size.
    """
    core = core_of(geometry)
    if core is not None and core.rounded:
        return _round_inner(core, count)

    made = _solid(geometry)
    if made is None or not _closed(geometry, made[0]):
        return np.empty((0, 4))

    solid, frame = made
    wanted = round(INNER_SHARE * balls_for(frame.scale)) if count is None else count
    found = frame.spheres_out(
        inscribed(solid, cKDTree(surface_points(solid.triangles, SURFACE_POINTS)), wanted), -ROUNDING
    )
    return np.asarray(found[found[:, 3] > 0.0], dtype=np.float64)


def protrusion_bound(geometry: coal.CollisionGeometry, spheres: Matrix) -> float:
    """How far balls, shape (n, 4), reach beyond a solid at most [m]; infinite for kinds that are not known here.

    An open mesh counts with caps that close it.
    """
    if not len(spheres):
        return 0.0

    core = core_of(geometry)
    if core is not None and core.rounded:
        beyond = np.maximum(np.abs(spheres[:, 2]) - core.half_length, 0.0)
        from_axis = np.linalg.norm(np.column_stack([spheres[:, :2], beyond]), axis=1)
        return max(float((spheres[:, 3] + from_axis).max()) - core.radius, 0.0)

    made = _solid(geometry)
    if made is None:
        return np.inf

    solid, frame = made
    depth = frame.scale * solid.depth(frame.to_local(spheres[:, :3]))
    return max(float((spheres[:, 3] - depth).max()), 0.0)


def balls_for(extent: float) -> int:
    """Number of balls that suits a body of this extent (diagonal of its box) [m]."""
    return int(np.clip(round(BALLS_PER_METRE * extent), MIN_BALLS, MAX_BALLS))


def _swept_radius(geometry: coal.CollisionGeometry) -> float:
    return float(geometry.getSweptSphereRadius()) if hasattr(geometry, "getSweptSphereRadius") else 0.0


def _grown(spheres: Matrix, by: float) -> Matrix:
    return np.asarray(spheres + np.array([0.0, 0.0, 0.0, by]))


def _round_cover(core: Core, protrusion: float | None) -> Matrix:
    radius = core.radius
    half = core.half_length
    if len(core.corners) == 1:
        return np.array([[0.0, 0.0, 0.0, radius]])
    limit = balls_for(2.0 * (half + radius)) if protrusion is None else MAX_BALLS_ON_REQUEST
    return rod_cover(radius, half, limit, protrusion)


def _solid(geometry: coal.CollisionGeometry) -> tuple[Solid, Frame] | None:
    """The geometry as a solid of about unit size, or None if its kind is not known or it has no volume to speak of."""
    core = core_of(geometry)
    if core is not None and core.disc is not None:
        sizes = core.disc, core.half_length
        return cylinder_solid(*sizes) if min(sizes) > 0.0 and np.isfinite(sizes).all() else None

    if is_mesh(geometry):
        return _mesh(geometry)

    points = vertices_of(geometry) if core is None else core.corners
    if points is None or len(points) < 4 or not np.isfinite(points).all():
        return None
    try:
        return convex_solid(points)
    except (ValueError, QhullError):
        return None


def _mesh(geometry: coal.CollisionGeometry) -> tuple[Solid, Frame] | None:
    vertices, triangles = mesh_arrays(geometry)
    used = vertices[np.unique(triangles)]
    if not len(used) or not np.isfinite(used).all() or not np.ptp(used, axis=0).max() > SMALLEST:
        return None

    if len(triangles) <= MAX_TRIANGLES:
        nothing = (np.empty((0, 3)), np.empty((0, 3)))
        made = mesh_solid(vertices, triangles, nothing if is_closed(geometry) else enclosure(geometry).boxes())
        if len(made[0].rim) <= MAX_OPEN_EDGES:
            return made

    low = used.min(axis=0)
    high = used.max(axis=0)
    thick = np.maximum(0.5 * (high - low), 1e-6 * float((high - low).max()))  # a box may be larger, never flat
    return convex_solid(box_corners(thick) + 0.5 * (low + high))


def _bounding_ball(geometry: coal.CollisionGeometry, swept: float) -> Matrix:
    geometry.computeLocalAABB()
    centre = np.array(geometry.aabb_center)
    radius = float(geometry.aabb_radius)
    if not (_finite(geometry) and np.isfinite(centre).all() and np.isfinite(radius) and np.abs(centre).max() < 1e300):
        return np.array([[0.0, 0.0, 0.0, np.inf]])
    return np.array([[*centre, radius * (1.0 + 1e-12) + 1e-15 * float(np.abs(centre).max()) + swept]])


def _finite(geometry: coal.CollisionGeometry) -> bool:
    """Whether all vertices are finite numbers; coal's box leaves out those that are not."""
    vertices = vertices_of(geometry)
    return vertices is None or bool(np.isfinite(vertices).all())


def _searched_cover(solid: Solid, limit: int, wanted: float | None) -> Matrix:
    """A cover found by search, at most ``limit`` balls unless ``wanted`` takes more; a finer cut if that helps."""
    surface = cKDTree(surface_points(solid.triangles, SURFACE_POINTS))
    aim = None if wanted is None else 0.9 * wanted  # depths are estimated in the search
    cuts = [CROSSED_CELLS, 4 * CROSSED_CELLS]
    if wanted is None:
        cuts = [min(CROSSED_CELLS, CELLS_PER_BALL * (limit + 4))]

    lenient = wanted is None and len(solid.rim) > 0
    for crossed in cuts:
        spheres = smallest_cover(elements(solid, crossed), surface, limit, aim, lenient=lenient)
        if wanted is None or len(spheres) >= limit:
            break
        if (spheres[:, 3] - solid.depth(spheres[:, :3])).max() <= wanted:
            break
    return spheres


def _better(geometry: coal.CollisionGeometry, first: Matrix, second: Matrix, protrusion: float | None) -> bool:
    """Whether the first cover is better: it sticks out less or, if both stay within what is required, is smaller."""
    reach = [protrusion_bound(geometry, cover) for cover in (first, second)]
    if protrusion is not None and max(reach) <= protrusion * (1.0 + 1e-9):
        return len(first) <= len(second)
    return reach[0] <= reach[1]


def _closed(geometry: coal.CollisionGeometry, solid: Solid) -> bool:
    """Whether a body that touches a ball inside the geometry surely collides with it.

    Coal's meshes are hollow: a body collides with one if it meets the surface, or if its reference point is inside. A
    body that meets an inner ball but not the surface lies in one piece of the space that the surface leaves. Without
    open edges the winding number is the same whole number all over that piece, so it is that of the ball, and the
    reference point is inside. Through an open edge a body may reach in and hold on to the ball: then nothing is proven.
    """
    return not len(solid.rim) and (not is_mesh(geometry) or isinstance(solid, MeshSolid))


def _round_inner(core: Core, count: int | None) -> Matrix:
    """Balls inside a ball or a capsule, as many as its cover has."""
    radius = core.radius
    half = core.half_length
    if len(core.corners) == 1:
        return np.array([[0.0, 0.0, 0.0, radius]])[:count]
    number = min(balls_on_axis(radius, half, ROD_PROTRUSION * radius), balls_for(2.0 * (half + radius)))
    return row_on_z(spread(half, number if count is None else min(count, number)), radius)
