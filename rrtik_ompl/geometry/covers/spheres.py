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
    swept_radius = _swept_radius(geometry)
    core = core_of(geometry)

    if core is not None and core.rounded:
        return _grown(_round_cover(core, protrusion), swept_radius)
    if is_mesh(geometry) and geometry.num_tris == 0:
        return np.empty((0, 4))

    known_solid = _solid(geometry)
    if known_solid is None:
        return _bounding_ball(geometry, swept_radius)

    solid, frame = known_solid
    target = None if protrusion is None else max(protrusion, 0.0) / frame.scale
    usual_count = balls_for(frame.scale) * (BALLS_OF_OPEN if len(solid.rim) else 1)
    limit = usual_count if protrusion is None else MAX_BALLS_ON_REQUEST

    searched = _searched_cover(solid, limit, target)
    regular = None if core is None else regular_cover(core, limit, protrusion)
    cover = frame.spheres_out(searched, solid.slack + ROUNDING)
    if regular is not None and _better(geometry, regular, cover, protrusion):
        cover = regular
    return _grown(cover, swept_radius)


def inner_spheres(geometry: coal.CollisionGeometry, *, count: int | None = None) -> Matrix:
    """Balls inside a solid, shape (n, 4), the most useful first; none for an open mesh or an unknown kind.

    Args:
        geometry: A coal geometry.
        count: At most so many; None: a number that suits the size.
    """
    core = core_of(geometry)
    if core is not None and core.rounded:
        return _round_inner(core, count)

    known_solid = _solid(geometry)
    if known_solid is None or not _closed(geometry, known_solid[0]):
        return np.empty((0, 4))

    solid, frame = known_solid
    wanted_count = round(INNER_SHARE * balls_for(frame.scale)) if count is None else count
    spheres = frame.spheres_out(
        inscribed(solid, cKDTree(surface_points(solid.triangles, SURFACE_POINTS)), wanted_count), -ROUNDING
    )
    return np.asarray(spheres[spheres[:, 3] > 0.0], dtype=np.float64)


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

    known_solid = _solid(geometry)
    if known_solid is None:
        return np.inf

    solid, frame = known_solid
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
    half_length = core.half_length
    if len(core.corners) == 1:
        return np.array([[0.0, 0.0, 0.0, radius]])
    limit = balls_for(2.0 * (half_length + radius)) if protrusion is None else MAX_BALLS_ON_REQUEST
    return rod_cover(radius, half_length, limit, protrusion)


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
    used_vertices = vertices[np.unique(triangles)]
    if (
        not len(used_vertices)
        or not np.isfinite(used_vertices).all()
        or not np.ptp(used_vertices, axis=0).max() > SMALLEST
    ):
        return None

    if len(triangles) <= MAX_TRIANGLES:
        no_boxes = (np.empty((0, 3)), np.empty((0, 3)))
        solid_and_frame = mesh_solid(
            vertices, triangles, no_boxes if is_closed(geometry) else enclosure(geometry).boxes()
        )
        if len(solid_and_frame[0].rim) <= MAX_OPEN_EDGES:
            return solid_and_frame

    low = used_vertices.min(axis=0)
    high = used_vertices.max(axis=0)
    half_sides = np.maximum(0.5 * (high - low), 1e-6 * float((high - low).max()))  # a box may be larger, never flat
    return convex_solid(box_corners(half_sides) + 0.5 * (low + high))


def _bounding_ball(geometry: coal.CollisionGeometry, swept_radius: float) -> Matrix:
    geometry.computeLocalAABB()
    centre = np.array(geometry.aabb_center)
    radius = float(geometry.aabb_radius)
    if not (_finite(geometry) and np.isfinite(centre).all() and np.isfinite(radius) and np.abs(centre).max() < 1e300):
        return np.array([[0.0, 0.0, 0.0, np.inf]])
    return np.array([[*centre, radius * (1.0 + 1e-12) + 1e-15 * float(np.abs(centre).max()) + swept_radius]])


def _finite(geometry: coal.CollisionGeometry) -> bool:
    """Whether all vertices are finite numbers; coal's box leaves out those that are not."""
    vertices = vertices_of(geometry)
    return vertices is None or bool(np.isfinite(vertices).all())


def _searched_cover(solid: Solid, limit: int, target: float | None) -> Matrix:
    """A cover found by search, at most ``limit`` balls unless ``target`` takes more; a finer cut if that helps."""
    surface = cKDTree(surface_points(solid.triangles, SURFACE_POINTS))
    search_target = None if target is None else 0.9 * target  # depths are estimated in the search
    cuts = [CROSSED_CELLS, 4 * CROSSED_CELLS]
    if target is None:
        cuts = [min(CROSSED_CELLS, CELLS_PER_BALL * (limit + 4))]

    lenient = target is None and len(solid.rim) > 0
    for crossed in cuts:
        spheres = smallest_cover(elements(solid, crossed), surface, limit, search_target, lenient=lenient)
        if target is None or len(spheres) >= limit:
            break
        if (spheres[:, 3] - solid.depth(spheres[:, :3])).max() <= target:
            break
    return spheres


def _better(geometry: coal.CollisionGeometry, first: Matrix, second: Matrix, protrusion: float | None) -> bool:
    """Whether the first cover is better: it sticks out less or, if both stay within what is required, is smaller."""
    protrusions = [protrusion_bound(geometry, cover) for cover in (first, second)]
    if protrusion is not None and max(protrusions) <= protrusion * (1.0 + 1e-9):
        return len(first) <= len(second)
    return protrusions[0] <= protrusions[1]


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
    half_length = core.half_length
    if len(core.corners) == 1:
        return np.array([[0.0, 0.0, 0.0, radius]])[:count]
    number = min(balls_on_axis(radius, half_length, ROD_PROTRUSION * radius), balls_for(2.0 * (half_length + radius)))
    return row_on_z(spread(half_length, number if count is None else min(count, number)), radius)
