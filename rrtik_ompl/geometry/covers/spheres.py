"""Balls around a solid (outer cover, contains it) and balls inside it (inner spheres), for any coal geometry.

An outer cover is proven, not sampled: the solid is cut into convex elements without gaps
(``geometry/covers/cells.py``), and every element lies wholly inside one ball (``geometry/covers/search.py``); capsules,
cylinders and boxes have covers by formula too. Inner spheres leave little room between themselves and the surface:
whatever reaches deeper into the solid than that room meets a ball. Each is the one that narrows the room most, on
average over points of the surface.

Spheres are float64 arrays of shape (n, 4): centre x, y, z and radius [m], in the frame of the geometry. Containment
holds within 1e-9 of the size of the solid [m per m].
"""

from __future__ import annotations

import coal
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import QhullError, cKDTree

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.geometry.collision.enclosure import enclosure
from rrtik_ompl.geometry.collision.shape_table import Core, box_corners, core_of
from rrtik_ompl.geometry.collision.solids import is_closed, is_mesh, mesh_arrays, vertices_of
from rrtik_ompl.geometry.covers.cells import elements, lattice_inside
from rrtik_ompl.geometry.covers.search import random_subset, smallest_cover, surface_points
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
ROD_PROTRUSION = 0.06  # share of the radius
INNER_CENTRES = 300  # points inside from which inner balls start
FEWEST_INSIDE = 200
INNER_SAMPLES = 400  # points of the surface
CLIMBS = 4  # steps of the centre of an inner ball away from the surface


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


def rod_cover(radius: float, half_length: float, limit: int, protrusion: float | None) -> Matrix:
    """Equal balls in a row along z that hold a capsule, at most ``limit`` (but 2), shape (n, 4)."""
    count = balls_on_axis(radius, half_length, ROD_PROTRUSION * radius if protrusion is None else protrusion)
    count = max(min(count, max(limit, 2)), 1 if half_length <= 0.0 else 2)
    step = 2.0 * half_length / max(count - 1, 1)
    return row_on_z(spread(half_length, count), np.hypot(radius, 0.5 * step) * (1.0 + ROUNDING))


def balls_on_axis(radius: float, half_length: float, protrusion: float) -> int:
    """Number of balls along an axis of length ``2 half`` that hold the rod around it of the given radius."""
    if half_length <= 0.0:
        return 1
    step = 2.0 * np.sqrt(max(protrusion * (protrusion + 2.0 * radius), 0.0))
    return int(min(np.ceil(2.0 * half_length / step), 1e6)) + 1 if step > 0.0 else 10**6


def spread(half: float, count: int) -> Vector:
    """Numbers evenly from -half to half, shape (number,)."""
    return np.linspace(-half, half, count) if count > 1 else np.zeros(max(count, 0))


def row_on_z(heights: Vector, radius: float) -> Matrix:
    """Equal balls on the z axis, shape (n, 4)."""
    spheres = np.zeros((len(heights), 4))
    spheres[:, 2] = heights
    spheres[:, 3] = radius
    return spheres


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


def regular_cover(core: Core, limit: int, protrusion: float | None) -> Matrix | None:
    """Boxes as grids of balls, cylinders as rows of balls: the best one of at most ``limit`` balls."""
    half = core.half_sides
    radius = core.disc
    if half is not None:
        counts_xy = ((a, b) for a in range(1, limit + 1) for b in range(1, limit // a + 1))
        grids = np.array([(a, b, c) for a, b in counts_xy for c in range(1, limit // (a * b) + 1)])
        cells = half / grids
        protrusions = np.linalg.norm(cells, axis=1) - cells.min(axis=1)
        return _grid(half, _chosen(grids, protrusions, protrusion))

    if radius is not None:
        grids = np.array([(1, 1, k) for k in range(1, limit + 1)])
        step = core.half_length / grids[:, 2]
        protrusions = np.hypot(radius, step) - np.minimum(step, radius)
        return _row(radius, core.half_length, int(_chosen(grids, protrusions, protrusion)[2]))

    return None


def _chosen(grids: NDArray[np.int64], protrusions: Vector, protrusion: float | None) -> NDArray[np.int64]:
    small_enough = np.flatnonzero(protrusions <= protrusion) if protrusion is not None else np.empty(0, dtype=np.int64)
    if len(small_enough):
        return np.asarray(grids[small_enough[grids[small_enough].prod(axis=1).argmin()]])
    return np.asarray(grids[protrusions.argmin()])


def _row(radius: float, half_length: float, count: int) -> Matrix:
    step = half_length / count
    return row_on_z(spread(half_length - step, count), np.hypot(radius, step) * (1.0 + ROUNDING))


def _grid(half_sides: Vector, grid: NDArray[np.int64]) -> Matrix:
    cell = half_sides / grid
    axes = [spread(float(h - c), int(n)) for h, c, n in zip(half_sides, cell, grid, strict=True)]
    centres = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return np.column_stack([centres, np.full(len(centres), np.linalg.norm(cell) * (1.0 + ROUNDING))])


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


def inscribed(solid: Solid, surface: cKDTree, count: int) -> Matrix:
    """At most ``count`` balls in a closed solid, the most useful first, shape (n, 4).

    A ball about a point that is known to be inside reaches at most to the surface. Centres are moved from such points;
    a move is trusted if the ball at its end holds the point where it began.
    """
    inside_points = random_subset(lattice_inside(solid, FEWEST_INSIDE), INNER_CENTRES)
    if not len(inside_points):
        return np.empty((0, 4))

    moved, start_depths, moved_depths = _moved_inwards(inside_points, surface)
    centres = np.concatenate([inside_points, moved])
    samples: Matrix = np.array(surface.data[:: -(-len(surface.data) // INNER_SAMPLES)])
    chosen = _greedy_choice(centres, np.concatenate([start_depths, moved_depths]), samples, count)

    radii = solid.distance(centres[chosen]) - ROUNDING
    start = np.concatenate([inside_points, inside_points])
    trusted = np.linalg.norm(centres[chosen] - start[chosen], axis=1) < radii
    return np.asarray(np.column_stack([centres[chosen], radii])[trusted])


def _moved_inwards(points: Matrix, surface: cKDTree) -> tuple[Matrix, Vector, Vector]:
    """Points moved away from the surface that is nearest, while that makes them deeper; depths before and after."""
    distance, nearest = surface.query(points)
    centres = points
    start_depth = distance
    depth = distance
    stride = 0.5 * distance

    for _ in range(CLIMBS):
        inward = (centres - surface.data[nearest]) / np.maximum(depth, 1e-300)[:, None]
        candidates = centres + stride[:, None] * inward
        distance, candidate_nearest = surface.query(candidates)
        deeper = distance > depth

        centres = np.where(deeper[:, None], candidates, centres)
        depth = np.where(deeper, distance, depth)
        nearest = np.where(deeper, candidate_nearest, nearest)
        stride = np.where(deeper, stride, 0.4 * stride)

    return centres, start_depth, depth


def _greedy_choice(centres: Matrix, radii: Vector, samples: Matrix, count: int) -> list[int]:
    """Numbers of the balls of a greedy choice: each time the one that brings the samples nearest to a ball."""
    gap_to_ball = np.linalg.norm(samples[:, None] - centres, axis=2).astype(np.float32) - radii.astype(np.float32)
    gap = np.full(len(samples), 2.0 * float(gap_to_ball.max()) + 1.0, dtype=np.float32)
    chosen: list[int] = []

    while len(chosen) < count:
        gain = np.maximum(gap[:, None] - gap_to_ball, 0.0).sum(axis=0)
        best = int(gain.argmax())
        if gain[best] <= 0.0:
            break
        chosen.append(best)
        gap = np.minimum(gap, gap_to_ball[:, best])

    return chosen
