"""Balls around a solid (outer cover, contains it) and balls inside it (inner spheres), for any coal geometry.

An outer cover is proven, not sampled: the solid is cut into convex elements without gaps (``cover_cells``) and every
element lies wholly inside one ball. Among the candidate centres, a ball may reach as far as its depth plus the
protrusion; greedy set cover (Chvatal 1979) picks few of them, and bisection finds the smallest protrusion for the
wanted number of balls.

Spheres are float64 arrays of shape (n, 4): centre x, y, z and radius [m], in the frame of the geometry. Containment
holds within 1e-9 of the size of the solid [m per m].
"""

from __future__ import annotations

import itertools
from typing import Any

import coal
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import QhullError

from rrtik_ompl.arrays import Mask, Matrix, Vector
from rrtik_ompl.collision.solids import is_mesh, mesh_arrays
from rrtik_ompl.fast.cover_cells import Elements, elements
from rrtik_ompl.fast.cover_solids import (
    ROUNDING,
    Frame,
    Solid,
    convex_solid,
    cylinder_solid,
    mesh_solid,
)

BALLS_PER_METRE, FEWEST, MOST = 70.0, 2, 32
MOST_ON_REQUEST = 512  # balls, where a protrusion is asked for
CAPSULE_PROTRUSION = 0.06  # share of the radius
CROSSED_CELLS = 1500
CANDIDATES = 1000
BISECTIONS = 8
THIN_CANDIDATES = 200  # for solids without lattice points inside
CHUNK = 128
OFFSETS = np.array([p for p in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(p)])


def outer_cover(geometry: Any, *, protrusion: float | None = None) -> Matrix:
    """Balls whose union contains a solid, shape (n, 4).

    Args:
        geometry: A coal geometry. A mesh is taken with its interior: every point whose winding number is above one
            half. A kind that is not known here gets one ball (of infinite radius if the kind has no bounds).
        protrusion: How far a ball may reach beyond the solid [m]; if that takes too many balls or too fine a cut, the
            cover reaches farther (``protrusion_bound`` tells). None: what a number of balls that suits the size of
            the solid allows.
    """
    swept = _swept_radius(geometry)
    if isinstance(geometry, coal.Sphere):
        return np.array([[0.0, 0.0, 0.0, geometry.radius + swept]])
    if isinstance(geometry, coal.Capsule):
        return _grown(_capsule_cover(geometry.radius, geometry.halfLength, protrusion), swept)
    if is_mesh(geometry) and geometry.num_tris == 0:
        return np.empty((0, 4))
    made = _solid(geometry)
    if made is None:
        return _bounding_ball(geometry, swept)
    solid, frame = made
    wanted = None if protrusion is None else max(protrusion, 0.0) / frame.scale
    limit = balls_for(frame.scale) if protrusion is None else MOST_ON_REQUEST
    found = _smallest_cover(solid, limit, wanted)
    regular = _regular_cover(geometry, limit, protrusion)
    cover = frame.spheres_out(found, solid.slack + ROUNDING)
    if regular is not None and _better(geometry, regular, cover, protrusion):
        cover = regular
    return _grown(cover, swept)


def inner_spheres(geometry: Any, *, count: int | None = None) -> Matrix:
    """Balls inside a solid, shape (n, 4), the most useful first; none for an open mesh or an unknown kind.

    Args:
        geometry: A coal geometry.
        count: At most so many; None: a number that suits the size.
    """
    if isinstance(geometry, coal.Sphere):
        return np.array([[0.0, 0.0, 0.0, geometry.radius]])[:count]
    if isinstance(geometry, coal.Capsule):
        radius, half = float(geometry.radius), float(geometry.halfLength)
        number = min(_on_axis(radius, half, CAPSULE_PROTRUSION * radius), balls_for(2.0 * (half + radius)))
        return _on_z(_spread(half, number if count is None else min(count, number)), radius)
    if is_mesh(geometry) and geometry.num_tris == 0:
        return np.empty((0, 4))
    made = _solid(geometry)
    if made is None or len(made[0].rim):
        return np.empty((0, 4))
    solid, frame = made
    found = _inscribed(solid, balls_for(frame.scale) if count is None else count)
    found = frame.spheres_out(found, -ROUNDING)
    return np.asarray(found[found[:, 3] > 0.0], dtype=np.float64)


def protrusion_bound(geometry: Any, spheres: Matrix) -> float:
    """How far balls, shape (n, 4), reach beyond a solid at most [m]; infinite for kinds that are not known here.

    An open mesh counts with the caps that close it.
    """
    if not len(spheres):
        return 0.0
    if isinstance(geometry, (coal.Sphere, coal.Capsule)):
        half = geometry.halfLength if isinstance(geometry, coal.Capsule) else 0.0
        beyond = np.maximum(np.abs(spheres[:, 2]) - half, 0.0)
        from_axis = np.linalg.norm(np.column_stack([spheres[:, :2], beyond]), axis=1)
        return max(float((spheres[:, 3] + from_axis).max()) - float(geometry.radius), 0.0)
    made = _solid(geometry)
    if made is None:
        return np.inf
    solid, frame = made
    depth = frame.scale * solid.exact_depth(frame.to_local(spheres[:, :3]))
    return max(float((spheres[:, 3] - depth).max()), 0.0)


def balls_for(extent: float) -> int:
    """Number of balls that suits a body of this extent (diagonal of its box) [m]."""
    return int(np.clip(round(BALLS_PER_METRE * extent), FEWEST, MOST))


def _swept_radius(geometry: Any) -> float:
    return float(geometry.getSweptSphereRadius()) if hasattr(geometry, "getSweptSphereRadius") else 0.0


def _grown(spheres: Matrix, by: float) -> Matrix:
    return np.asarray(spheres + np.array([0.0, 0.0, 0.0, by]))


def _solid(geometry: Any) -> tuple[Solid, Frame] | None:
    """The geometry as a solid of about unit size, or None if its kind is not known or it has no volume to speak of."""
    if isinstance(geometry, coal.Cylinder):
        sizes = geometry.radius, geometry.halfLength
        return cylinder_solid(*sizes) if min(sizes) > 0.0 and np.isfinite(sizes).all() else None
    if is_mesh(geometry):
        vertices, triangles = mesh_arrays(geometry)
        corners = vertices[triangles]
        return mesh_solid(corners) if np.isfinite(corners).all() else None
    if isinstance(geometry, coal.Box):
        points = _box_corners(np.array(geometry.halfSide))
    elif isinstance(geometry, coal.ConvexBase):
        points = np.array(geometry.points(), dtype=np.float64).reshape(-1, 3)
    else:
        return None
    if len(points) < 4 or not np.isfinite(points).all():
        return None
    try:
        return convex_solid(points)
    except (ValueError, QhullError):
        return None


def _box_corners(half: Vector) -> Matrix:
    return np.array(list(itertools.product((-1.0, 1.0), repeat=3))) * half


def _bounding_ball(geometry: Any, swept: float) -> Matrix:
    geometry.computeLocalAABB()
    centre, radius = np.array(geometry.aabb_center), float(geometry.aabb_radius)
    if not (_finite(geometry) and np.isfinite(centre).all() and np.isfinite(radius) and np.abs(centre).max() < 1e300):
        return np.array([[0.0, 0.0, 0.0, np.inf]])
    return np.array([[*centre, radius * (1.0 + 1e-12) + 1e-15 * float(np.abs(centre).max()) + swept]])


def _finite(geometry: Any) -> bool:
    """Whether all vertices are finite numbers; coal's box leaves out those that are not."""
    if is_mesh(geometry):
        return bool(np.isfinite(mesh_arrays(geometry)[0]).all())
    return not isinstance(geometry, coal.ConvexBase) or bool(np.isfinite(np.array(geometry.points())).all())


def _on_axis(radius: float, half: float, protrusion: float) -> int:
    """Number of balls along an axis of length ``2 half`` that hold the rod around it of the given radius."""
    if half <= 0.0:
        return 1
    step = 2.0 * np.sqrt(max(protrusion * (protrusion + 2.0 * radius), 0.0))
    return int(min(np.ceil(2.0 * half / step), 1e6)) + 1 if step > 0.0 else 10**6


def _capsule_cover(radius: float, half: float, protrusion: float | None) -> Matrix:
    limit = balls_for(2.0 * (half + radius)) if protrusion is None else MOST_ON_REQUEST
    number = _on_axis(radius, half, CAPSULE_PROTRUSION * radius if protrusion is None else protrusion)
    number = max(min(number, max(limit, 2)), 1 if half <= 0.0 else 2)
    step = 2.0 * half / max(number - 1, 1)
    return _on_z(_spread(half, number), np.hypot(radius, 0.5 * step) * (1.0 + ROUNDING))


def _spread(half: float, number: int) -> Vector:
    return np.linspace(-half, half, number) if number > 1 else np.zeros(max(number, 0))


def _on_z(heights: Vector, radius: float) -> Matrix:
    spheres = np.zeros((len(heights), 4))
    spheres[:, 2], spheres[:, 3] = heights, radius
    return spheres


def _regular_cover(geometry: Any, limit: int, protrusion: float | None) -> Matrix | None:
    """Boxes as grids of balls, cylinders as rows of balls: the best one of at most ``limit`` balls."""
    if isinstance(geometry, coal.Box):
        half = np.array(geometry.halfSide)
        pairs = ((a, b) for a in range(1, limit + 1) for b in range(1, limit // a + 1))
        grids = np.array([(a, b, c) for a, b in pairs for c in range(1, limit // (a * b) + 1)])
        cells = half / grids
        sticks = np.linalg.norm(cells, axis=1) - cells.min(axis=1)
    elif isinstance(geometry, coal.Cylinder):
        grids = np.array([(1, 1, k) for k in range(1, limit + 1)])
        step = geometry.halfLength / grids[:, 2]
        radius = np.hypot(geometry.radius, step)
        sticks = radius - np.minimum(step, geometry.radius)
    else:
        return None
    return _regular(geometry, _chosen(grids, sticks, protrusion))


def _chosen(grids: NDArray[np.int64], sticks: Vector, protrusion: float | None) -> NDArray[np.int64]:
    enough = np.flatnonzero(sticks <= protrusion) if protrusion is not None else np.empty(0, dtype=np.int64)
    if len(enough):
        return np.asarray(grids[enough[grids[enough].prod(axis=1).argmin()]])
    return np.asarray(grids[sticks.argmin()])


def _regular(geometry: Any, grid: NDArray[np.int64]) -> Matrix:
    if isinstance(geometry, coal.Cylinder):
        step = geometry.halfLength / grid[2]
        heights = _spread(geometry.halfLength - step, int(grid[2]))
        return _on_z(heights, np.hypot(geometry.radius, step) * (1.0 + ROUNDING))
    cell = np.array(geometry.halfSide) / grid
    axes = [_spread(float(h - c), int(n)) for h, c, n in zip(geometry.halfSide, cell, grid, strict=True)]
    centres = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return np.column_stack([centres, np.full(len(centres), np.linalg.norm(cell) * (1.0 + ROUNDING))])


def _better(geometry: Any, first: Matrix, second: Matrix, protrusion: float | None) -> bool:
    """Whether the first cover is better: it sticks out less or, if both stay within what is asked for, is smaller."""
    reach = [protrusion_bound(geometry, cover) for cover in (first, second)]
    if protrusion is not None and max(reach) <= protrusion * (1.0 + 1e-9):
        return len(first) <= len(second)
    return reach[0] <= reach[1]


def _smallest_cover(solid: Solid, limit: int, wanted: float | None) -> Matrix:
    """Greedy cover with at most ``limit`` balls, of the smallest protrusion or of the wanted one."""
    for crossed in (CROSSED_CELLS,) if wanted is None else (CROSSED_CELLS, 4 * CROSSED_CELLS):
        parts = elements(solid, crossed)
        centres, inside = _candidates(solid, parts)
        depth = solid.depth(centres, inside)
        reach = _reach(parts, centres)
        chosen = _cover(reach, depth, limit, wanted)
        near, near_depth = _around(solid, parts, centres[chosen], depth[chosen])
        centres, depth = np.concatenate([centres[chosen], near]), np.concatenate([depth[chosen], near_depth])
        reach = np.concatenate([reach[chosen], _reach(parts, near)])
        chosen = _cover(reach, depth, limit, wanted)
        need = reach[chosen] - depth[chosen, None]
        spheres = _shrunk(parts, centres[chosen], need)
        if wanted is None or need.min(axis=0).max() <= wanted or len(spheres) >= limit:
            break
    return spheres


def _candidates(solid: Solid, parts: Elements) -> tuple[Matrix, Mask]:
    """Places for centres: lattice points inside, and points at the surface for what is thin or open."""
    inside = _every(parts.inside, CANDIDATES)
    edge = _every(parts.on_surface, max(CANDIDATES - len(inside), CANDIDATES // 3))
    return np.concatenate([inside, edge]), np.arange(len(inside) + len(edge)) < len(inside)


def _every(points: Matrix, most: int) -> Matrix:
    """At most so many of the points, spread evenly by lot (the same every time)."""
    if len(points) <= most:
        return points
    return points[np.sort(np.random.default_rng(0).choice(len(points), most, replace=False))]


def _around(solid: Solid, parts: Elements, centres: Matrix, depth: Vector) -> tuple[Matrix, Vector]:
    """More candidates around chosen centres; a step shorter than the depth stays inside."""
    step = 0.5 * float(np.prod(np.ptp(parts.points, axis=0)) / CANDIDATES) ** (1.0 / 3.0)
    steps = [np.minimum(share * step, 0.55 * np.maximum(depth, 0.0)) for share in (1.0, 0.4)]
    points = np.concatenate([centres[:, None] + OFFSETS * s[:, None, None] for s in steps]).reshape(-1, 3)
    return points, solid.depth(points, np.repeat(np.tile(depth > 0.0, 2), len(OFFSETS)))


def _reach(parts: Elements, centres: Matrix) -> NDArray[np.float32]:
    """Radius that a ball around each centre needs to hold each element, shape (centres, elements)."""
    points = parts.points.astype(np.float32).T
    squares, radii = (points**2).sum(axis=0), parts.radii.astype(np.float32)
    found = np.empty((len(centres), len(parts.start)), dtype=np.float32)
    for k in range(0, len(centres), CHUNK):
        some = centres[k : k + CHUNK].astype(np.float32)
        square = squares - 2.0 * some @ points + (some**2).sum(axis=1)[:, None]
        np.maximum.reduceat(np.sqrt(np.maximum(square, 0.0)) + radii, parts.start, axis=1, out=found[k : k + CHUNK])
    return found


def _cover(reach: NDArray[np.float32], depth: Vector, limit: int, wanted: float | None) -> NDArray[np.int64]:
    """Numbers of the centres of a cover."""
    need = reach - depth[:, None].astype(np.float32)
    low, high = float(need.min(axis=0).max()), float(need.max(axis=1).min())
    if wanted is not None:
        found = _greedy(need <= max(low, wanted))
        if len(found) <= limit:
            return found
    best = np.array([int(need.max(axis=1).argmin())])
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        found = _greedy(need <= middle)
        if len(found) <= limit:
            best, high = found, min(middle, float(need[found].min(axis=0).max()))
        else:
            low = middle
    return best


def _greedy(holds: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Rows that together hold every column, the one that adds most first."""
    by_column = np.ascontiguousarray(holds.T)
    left = np.ones(len(by_column), dtype=bool)
    gain = holds.sum(axis=1)
    chosen = []
    while left.any():
        row = int(gain.argmax())
        new = holds[row] & left
        chosen.append(row)
        gain = gain - by_column[new].sum(axis=0)
        left &= ~new
    return np.array(chosen)


def _shrunk(parts: Elements, centres: Matrix, need: NDArray[np.floating[Any]]) -> Matrix:
    """Balls no larger than what they have to hold; each element goes to the ball that sticks out least for it."""
    element = np.repeat(np.arange(len(parts.start)), np.diff(np.r_[parts.start, len(parts.points)]))
    owner = need.argmin(axis=0)[element]
    away = np.linalg.norm(parts.points - centres[owner], axis=1) + parts.radii
    radius = np.zeros(len(centres))
    np.maximum.at(radius, owner, away)
    used = np.bincount(owner, minlength=len(centres)) > 0
    return np.column_stack([centres, radius])[used]


def _inscribed(solid: Solid, count: int) -> Matrix:
    """Greedy inscribed balls: each the one that holds most lattice points that no ball holds yet."""
    parts = elements(solid, CROSSED_CELLS)
    targets = _every(parts.inside, 2 * CANDIDATES)
    centres = _every(parts.inside, CANDIDATES)
    depth = solid.depth(centres, np.ones(len(centres), dtype=bool)) if len(centres) else np.empty(0)
    if len(centres) < count:  # thinner than a cell: the middles of the cells may be inside
        middles = _every(parts.on_surface, THIN_CANDIDATES)
        centres, depth = np.concatenate([centres, middles]), np.concatenate([depth, solid.exact_depth(middles)])
        targets = centres[depth > 0.0]
    away = ((centres**2).sum(axis=1)[:, None] + (targets**2).sum(axis=1)) - 2.0 * centres @ targets.T
    holds = (away <= np.maximum(depth, 0.0)[:, None] ** 2) & (depth > 0.0)[:, None]
    chosen: list[int] = []
    while len(chosen) < count:
        gain = holds.sum(axis=1)
        row = int(gain.argmax())
        if gain[row] == 0:
            break
        chosen.append(row)
        holds &= ~holds[row]
    places = centres[chosen]
    return np.column_stack([places, solid.exact_depth(places)])
