"""Compute balls whose union contains a solid (outer covers) and balls inside it (inner spheres), for any coal geometry.

An outer cover is guaranteed, not sampled: the solid is cut into convex elements without gaps
(``kernels/covers/cells.py``), and each element lies wholly inside one ball (``kernels/covers/search.py``). Capsules,
cylinders and boxes have covers by formula too. Inner spheres leave little room between themselves and the surface: a
body that reaches deeper into the solid than that room meets an inner sphere. They are chosen greedily, each as the one
that reduces that room most, averaged over points of the surface.

Spheres are float64 arrays of shape (n, 4): centre x, y, z and radius [m], in the frame of the geometry. Containment
holds within 1e-9 of the size of the solid [m per m].
"""

from __future__ import annotations

import weakref
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import coal
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import QhullError

from rrtik_ompl.base.arrays import Matrix, Vector, box_of, products
from rrtik_ompl.geometry.collision.enclosure import enclosure
from rrtik_ompl.geometry.collision.shape_table import Core, box_corners, core_of
from rrtik_ompl.geometry.collision.solids import is_closed, is_mesh, mesh_arrays, vertices_of
from rrtik_ompl.kernels.covers.cells import elements, lattice_inside
from rrtik_ompl.kernels.covers.points import chosen_balls
from rrtik_ompl.kernels.covers.search import random_subset, smallest_cover
from rrtik_ompl.kernels.covers.solids import (
    ROUNDING,
    Frame,
    MeshSolid,
    Solid,
    convex_solid,
    cylinder_solid,
    mesh_solid,
)
from rrtik_ompl.kernels.covers.surface import Surface, surface_points

BALLS_PER_METRE = 70.0
MIN_BALLS = 2
MAX_BALLS = 32  # This fills four clusters of the kernels; 36 balls would take eight.
BALLS_OF_OPEN = 3  # An open surface gets three times as many balls, as no part of a ball on it is inside.
INNER_SHARE = 1.5  # number of inner spheres per ball of the outer cover
MAX_BALLS_ON_REQUEST = 512  # limit on the number of balls if a protrusion is given
# A mesh with more triangles or open edges is replaced by its bounding box, and collisions with it are never proven.
MAX_TRIANGLES = 300_000
MAX_OPEN_EDGES = 4000
CROSSED_CELLS = 1500  # most cells that the surface may cross, in the first cut of a solid
CELLS_PER_BALL = 80
SURFACE_POINTS = 6000
SMALLEST = 1e-12  # [m] A mesh of smaller extent counts as a point.
ROD_PROTRUSION = 0.06  # usual protrusion of the balls of a capsule, as a share of its radius
INNER_CENTRES = 300  # points inside from which inner balls start
FEWEST_INSIDE = 200  # lattice points inside a solid that are asked for
INNER_SAMPLES = 400  # points of the surface by which inner balls are chosen
CLIMBS = 4  # steps by which the centre of an inner ball is moved away from the surface


def outer_cover(geometry: coal.CollisionGeometry, *, protrusion: float | None = None) -> Matrix:
    """Compute balls whose union contains a solid, shape (n, 4).

    Args:
        geometry: A coal geometry. A mesh is taken with its interior: all points whose winding number is not 0 or, if it
            is open, all points that it encloses (:mod:`rrtik_ompl.geometry.collision.enclosure`). A geometry of an
            unknown kind gets one ball, of infinite radius if the kind has no bounds.
        protrusion: Largest distance that a ball may reach beyond the solid [m]. If that takes too many balls or too
            fine a cut, the cover reaches farther (see ``protrusion_bound``). With None, the cover has a number of balls
            that suits the size of the solid, and reaches as little beyond it as these allow.
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

    solid, frame = known_solid.solid, known_solid.frame
    target = None if protrusion is None else max(protrusion, 0.0) / frame.scale
    usual_count = balls_for(frame.scale) * (BALLS_OF_OPEN if len(solid.rim) else 1)
    limit = usual_count if protrusion is None else MAX_BALLS_ON_REQUEST

    searched = _searched_cover(solid, known_solid.surface, limit, target)
    regular = None if core is None else regular_cover(core, limit, protrusion)
    cover = frame.spheres_out(searched, solid.slack + ROUNDING)
    if regular is not None and _better(geometry, regular, cover, protrusion):
        cover = regular
    return _grown(cover, swept_radius)


def inner_spheres(geometry: coal.CollisionGeometry, *, count: int | None = None) -> Matrix:
    """Compute balls inside a solid, shape (n, 4), the most useful first; none for an open mesh or an unknown kind.

    Args:
        geometry: A coal geometry.
        count: Largest number of balls. With None it follows from the size of the solid.
    """
    core = core_of(geometry)
    if core is not None and core.rounded:
        return _round_inner(core, count)

    known_solid = _solid(geometry)
    if known_solid is None or not _closed(geometry, known_solid.solid):
        return np.empty((0, 4))

    solid, frame = known_solid.solid, known_solid.frame
    wanted_count = round(INNER_SHARE * balls_for(frame.scale)) if count is None else count
    spheres = frame.spheres_out(inscribed(solid, known_solid.surface, wanted_count), -ROUNDING)
    return np.asarray(spheres[spheres[:, 3] > 0.0], dtype=np.float64)


def protrusion_bound(geometry: coal.CollisionGeometry, spheres: Matrix) -> float:
    """Return an upper bound on how far balls reach beyond a solid [m]; infinite for unknown kinds of geometry.

    For an open mesh, the caps that close it count as part of its surface.

    Args:
        geometry: A coal geometry.
        spheres: Centres and radii of the balls in the geometry's frame [m], shape (n, 4).
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

    solid, frame = known_solid.solid, known_solid.frame
    depth = frame.scale * solid.depth(frame.to_local(spheres[:, :3]))
    return max(float((spheres[:, 3] - depth).max()), 0.0)


def balls_for(extent: float) -> int:
    """Return a number of balls that suits a body, from the diagonal of its bounding box [m]."""
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
    """Return equal balls in a row along z whose union contains a capsule, shape (n, 4).

    Args:
        radius: Radius of the capsule [m].
        half_length: Half the length of its axis [m].
        limit: Largest number of balls; a limit below 2 counts as 2.
        protrusion: Largest distance that the balls may reach beyond the capsule [m]; None for a usual share of the
            radius.
    """
    count = balls_on_axis(radius, half_length, ROD_PROTRUSION * radius if protrusion is None else protrusion)
    count = max(min(count, max(limit, 2)), 1 if half_length <= 0.0 else 2)
    step = 2.0 * half_length / max(count - 1, 1)
    return row_on_z(spread(half_length, count), np.hypot(radius, 0.5 * step) * (1.0 + ROUNDING))


def balls_on_axis(radius: float, half_length: float, protrusion: float) -> int:
    """Return the number of equal balls along an axis that are needed to contain the rod around it.

    Args:
        radius: Radius of the rod [m].
        half_length: Half the length of the axis [m].
        protrusion: Distance that the balls may reach beyond the rod [m].
    """
    if half_length <= 0.0:
        return 1
    step = 2.0 * np.sqrt(max(protrusion * (protrusion + 2.0 * radius), 0.0))
    return int(min(np.ceil(2.0 * half_length / step), 1e6)) + 1 if step > 0.0 else 10**6


def spread(half: float, count: int) -> Vector:
    """Return ``count`` evenly spaced numbers from -half to half; a single one is 0."""
    return np.linspace(-half, half, count) if count > 1 else np.zeros(max(count, 0))


def row_on_z(heights: Vector, radius: float) -> Matrix:
    """Return equal balls on the z axis at the given heights, shape (n, 4)."""
    spheres = np.zeros((len(heights), 4))
    spheres[:, 2] = heights
    spheres[:, 3] = radius
    return spheres


@dataclass(frozen=True, eq=False)
class _KnownSolid:
    """A geometry as a solid scaled to unit size, and the frame that leads back to the geometry's own."""

    solid: Solid
    frame: Frame

    @cached_property
    def surface(self) -> Surface:
        """Return points spread over the solid's surface."""
        return Surface(surface_points(self.solid.triangles, SURFACE_POINTS))


# The geometry that was asked for last, and its solid: both covers of a geometry need it, one after the other.
_latest: list[tuple[weakref.ref[Any], _KnownSolid | None]] = []


def _solid(geometry: coal.CollisionGeometry) -> _KnownSolid | None:
    """Return a geometry as a solid; None if the kind is unknown or the geometry has no volume worth mentioning."""
    for reference, known in tuple(_latest):
        if reference() is geometry:
            return known
    made = _made_solid(geometry)
    known = None if made is None else _KnownSolid(*made)
    _latest[:] = [(weakref.ref(geometry), known)]
    return known


def _made_solid(geometry: coal.CollisionGeometry) -> tuple[Solid, Frame] | None:
    """Make a solid and its frame of a geometry; None as for `_solid`."""
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
    """Return a mesh as a solid and its frame, or its bounding box if it has too many triangles or open edges.

    The answer is None for a mesh without triangles, with vertices that are not finite, or of no extent.
    """
    vertices, triangles = mesh_arrays(geometry)
    used_vertices = vertices[np.unique(triangles)]
    if (
        not len(used_vertices)
        or not np.isfinite(used_vertices).all()
        or not np.subtract(*box_of(used_vertices)[::-1]).max() > SMALLEST
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
    # A flat mesh gets a box of some thickness: the box may be larger than the mesh, but must not be flat.
    half_sides = np.maximum(0.5 * (high - low), 1e-6 * float((high - low).max()))
    return convex_solid(box_corners(half_sides) + 0.5 * (low + high))


def _bounding_ball(geometry: coal.CollisionGeometry, swept_radius: float) -> Matrix:
    """Return one ball around a geometry of any kind, shape (1, 4); of infinite radius if it has no finite bounds."""
    geometry.computeLocalAABB()
    centre = np.array(geometry.aabb_center)
    radius = float(geometry.aabb_radius)
    if not (_finite(geometry) and np.isfinite(centre).all() and np.isfinite(radius) and np.abs(centre).max() < 1e300):
        return np.array([[0.0, 0.0, 0.0, np.inf]])
    return np.array([[*centre, radius * (1.0 + 1e-12) + 1e-15 * float(np.abs(centre).max()) + swept_radius]])


def _finite(geometry: coal.CollisionGeometry) -> bool:
    """Check whether all vertices of a geometry are finite numbers.

    Coal's bounding box ignores vertices that are not finite, so it cannot tell.
    """
    vertices = vertices_of(geometry)
    return vertices is None or bool(np.isfinite(vertices).all())


def _searched_cover(solid: Solid, surface: Surface, limit: int, target: float | None) -> Matrix:
    """Compute the cover of a solid by search.

    If a target is given and the first cut of the solid into cells does not reach it, a finer cut is tried.

    Args:
        solid: The solid, of unit size.
        surface: Points spread over its surface.
        limit: Largest number of balls, unless the target takes more.
        target: Protrusion that is good enough, in units of the solid's frame; None to look for the smallest.
    """
    # The search works with estimated depths, so it aims a little below the target.
    search_target = None if target is None else 0.9 * target
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
    """Return the best regular cover of a box (a grid of balls) or a cylinder (a row of balls); None for other solids.

    Args:
        core: The box or cylinder.
        limit: Largest number of balls.
        protrusion: Distance that the balls may reach beyond the solid [m]: the smallest cover within it is taken. With
            None, or if none is within it, the cover that reaches least beyond the solid is.
    """
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
    """Return the smallest grid whose protrusion is small enough or, if there is none, the grid of least protrusion.

    ``grids``, shape (k, 3), has the numbers of balls along each axis; ``protrusions``, shape (k,), how far the balls
    of each grid reach beyond the solid [m]; ``protrusion`` is what is small enough, or None.
    """
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
    """Check whether the first cover is at least as good as the second.

    If both stay within the required protrusion, the one with fewer balls is better, otherwise the one that reaches less
    far beyond the solid.
    """
    protrusions = [protrusion_bound(geometry, cover) for cover in (first, second)]
    if protrusion is not None and max(protrusions) <= protrusion * (1.0 + 1e-9):
        return len(first) <= len(second)
    return protrusions[0] <= protrusions[1]


def _closed(geometry: coal.CollisionGeometry, solid: Solid) -> bool:
    """Check whether every body that touches a ball inside the geometry surely collides with the geometry.

    Coal's meshes are hollow: a body collides with one if it meets the surface, or if its reference point is inside. A
    body that meets an inner sphere but not the surface lies wholly in one of the regions into which the surface divides
    space. Without open edges the winding number is constant on that region, so it is that of the sphere, and the
    reference point is inside. Through an open edge, however, a body could reach in and touch the sphere without
    crossing the surface; then nothing is proven.
    """
    return not len(solid.rim) and (not is_mesh(geometry) or isinstance(solid, MeshSolid))


def _round_inner(core: Core, count: int | None) -> Matrix:
    """Return balls inside a ball or a capsule, as many as its usual cover has, at most ``count``."""
    radius = core.radius
    half_length = core.half_length
    if len(core.corners) == 1:
        return np.array([[0.0, 0.0, 0.0, radius]])[:count]
    number = min(balls_on_axis(radius, half_length, ROD_PROTRUSION * radius), balls_for(2.0 * (half_length + radius)))
    return row_on_z(spread(half_length, number if count is None else min(count, number)), radius)


def inscribed(solid: Solid, surface: Surface, count: int) -> Matrix:
    """Compute at most ``count`` balls inside a closed solid, the most useful first, shape (n, 4).

    The largest ball about a point that is known to be inside reaches to the surface. Starting from such points, centres
    are moved away from the surface. A moved centre is only used if the ball about it contains the point where it
    started: then the segment between them does not cross the surface, so the centre is inside too.

    Args:
        solid: The solid, of unit size.
        surface: Points spread over its surface.
        count: Largest number of balls.
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


def _moved_inwards(points: Matrix, surface: Surface) -> tuple[Matrix, Vector, Vector]:
    """Move points away from the nearest surface point for as long as that makes them deeper.

    Args:
        points: Points inside a solid, shape (n, 3).
        surface: Points spread over its surface.

    Returns:
        The moved points, shape (n, 3); the depths of the given points, shape (n,); and those of the moved points,
        shape (n,). Depths are distances from the nearest of the surface's points.
    """
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


def _greedy_choice(centres: Matrix, radii: Vector, samples: Matrix, count: int) -> NDArray[np.int64]:
    """Choose balls greedily: each time the one that reduces the samples' distances to the nearest ball most.

    Args:
        centres: Centres of the candidates, shape (n, 3).
        radii: Their radii, shape (n,).
        samples: Points of the surface, shape (k, 3).
        count: Largest number of balls.

    Returns:
        Indices of the chosen balls, in the order of the choice, shape (k,).
    """
    squared = (samples**2).sum(axis=1)[:, None] - 2.0 * products(samples, centres) + (centres**2).sum(axis=1)
    gap_to_ball = np.sqrt(np.maximum(squared, 0.0)).T.astype(np.float32) - radii.astype(np.float32)[:, None]
    # Distances are negative inside a ball. The first value exceeds all of them, so that some ball is an improvement.
    farthest = float(gap_to_ball.max())
    gap = np.full(len(samples), farthest + abs(farthest) + 1.0, dtype=np.float32)
    return chosen_balls(gap_to_ball, gap, count)
