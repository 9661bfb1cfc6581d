"""Search for few balls that contain all elements of a solid and reach little beyond it.

A ball reaches beyond the solid by at most its radius minus the depth of its centre: its protrusion. First, greedy set
cover [41] with a bisection over the protrusion finds a set of balls. Then three steps alternate: each element is
assigned to the ball that needs the least protrusion for it; each ball is moved to where it protrudes least; and balls
that others can replace are moved to where the protrusion is largest (after [42]). All of this only searches for good
centres: whatever they are, each ball is finally made large enough for its elements, so that the cover contains the
solid.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from rrtik_ompl.base.arrays import QUIET_PRODUCT, Matrix, Vector
from rrtik_ompl.kernels.covers.cells import Elements
from rrtik_ompl.kernels.covers.solids import Triangles

CANDIDATES = 400
LEAST_ON_SURFACE = 80  # least number of candidates at the surface, for thin or open parts of the solid
BISECTIONS = 7
MATCHINGS = 7  # rounds of assigning elements to balls and moving the balls
RECENTRING_STEPS = 10  # steps by which each ball is moved in a round
MAX_RELOCATIONS = 4  # largest number of balls that are moved elsewhere in a round
# A ball is moved elsewhere if the protrusion that results without it is below this share of the largest one.
RELOCATION_GAIN = 0.95

CentreElementTable = NDArray[np.float32]  # shape (centres, elements)


@dataclass(slots=True, eq=False)
class Places:
    """Centres of balls, shape (n, 3), and their estimated depths inside the solid, shape (n,).

    A depth that is not positive marks a centre at or beyond the surface, which is not moved.
    """

    centres: Matrix
    depth: Vector

    def __getitem__(self, rows: NDArray[np.int64] | NDArray[np.bool_] | slice) -> Places:
        return Places(self.centres[rows], self.depth[rows])


def smallest_cover(
    elements: Elements, surface: cKDTree, limit: int, target: float | None, *, lenient: bool = False
) -> Matrix:
    """Find balls that contain all elements, shape (n, 4), at most ``limit`` of them.

    Args:
        elements: The elements to contain.
        surface: Points spread over the solid's surface (``surface_points``).
        limit: Largest number of balls, unless the ``target`` takes more.
        target: Protrusion that is good enough; None to look for the smallest.
        lenient: Whether to subtract from each element's protrusion the part that no candidate avoids. Otherwise a
            single element with a large protrusion, such as at the rim of an open mesh, would end the search with few
            balls that protrude as far everywhere.
    """
    candidate_places = candidates(elements, surface)
    protrusions = reaches(elements, candidate_places.centres) - candidate_places.depth[:, None].astype(np.float32)
    unavoidable = np.maximum(protrusions.min(axis=0), 0.0) if lenient else np.zeros_like(protrusions[0])
    protrusions -= unavoidable

    chosen = _cover_by_bisection(protrusions, limit, target)
    improved = _improved(
        elements,
        surface,
        candidate_places,
        protrusions,
        unavoidable,
        candidate_places[chosen],
        max(limit, len(chosen)),
        target,
    )
    return _fitted_to_elements(elements, improved)


def surface_points(triangles: Triangles, count: int) -> Matrix:
    """Return points spread evenly over triangles, always the same ones, and corners of the triangles.

    About ``count`` points are spread by area. All corners are added if there are at most ``count`` triangles, otherwise
    those of every k-th triangle.
    """
    a, b, c = (triangles[:, k] for k in range(3))
    sizes = np.cumsum(np.linalg.norm(np.cross(b - a, c - a), axis=1))
    which = np.searchsorted(sizes, (np.arange(count) + 0.5) / count * sizes[-1]).clip(0, len(triangles) - 1)

    u, v = ((np.arange(count) * step) % 1.0 for step in (0.7548776662466927, 0.5698402909980532))  # Roberts' sequence
    u, v = (np.where(u + v > 1.0, 1.0 - w, w)[:, None] for w in (u, v))

    spread = a[which] + u * (b - a)[which] + v * (c - a)[which]
    return np.concatenate([spread, triangles[:: -(-len(triangles) // count)].reshape(-1, 3)])


def candidates(elements: Elements, surface: cKDTree) -> Places:
    """Return candidate centres: lattice points inside, and points at the surface for thin or open parts.

    Their depths are distances to the nearest of the surface's points, negative for candidates at the surface.
    """
    inside = random_subset(elements.inside, CANDIDATES)
    near_surface = random_subset(elements.on_surface, max(CANDIDATES - len(inside), LEAST_ON_SURFACE))
    centres = np.concatenate([inside, near_surface])
    sign = np.where(np.arange(len(centres)) < len(inside), 1.0, -1.0)
    return Places(centres, sign * surface.query(centres)[0])


def random_subset(points: Matrix, count: int) -> Matrix:
    """Return at most ``count`` of the points, chosen at random with a fixed seed."""
    if len(points) <= count:
        return points
    return points[np.sort(np.random.default_rng(0).choice(len(points), count, replace=False))]


def reaches(elements: Elements, centres: Matrix) -> CentreElementTable:
    """Return the radius that a ball about each centre needs to contain each element, shape (centres, elements)."""
    points = elements.points.astype(np.float32).T
    squared_norms = (points**2).sum(axis=0)
    ball_radii = elements.radii.astype(np.float32)
    radii = np.empty((len(centres), len(elements.start)), dtype=np.float32)

    rows = max(QUIET_PRODUCT // points.size, 1)
    for k in range(0, len(centres), rows):
        chunk = centres[k : k + rows].astype(np.float32)
        # Compute |p - c|^2 = |p|^2 - 2 p c + |c|^2 in place, to save memory.
        distances = chunk @ points
        distances *= -2.0
        distances += squared_norms
        distances += (chunk**2).sum(axis=1)[:, None]
        np.maximum(distances, 0.0, out=distances)
        np.sqrt(distances, out=distances)
        distances += ball_radii
        np.maximum.reduceat(distances, elements.start, axis=1, out=radii[k : k + rows])

    return radii


def _cover_by_bisection(protrusions: CentreElementTable, limit: int, target: float | None) -> NDArray[np.int64]:
    """Find a cover of at most ``limit`` balls by a bisection over the largest protrusion.

    Args:
        protrusions: Protrusion of each centre's ball if it contains each element, shape (centres, elements).
        limit: Largest number of balls.
        target: Protrusion that is good enough; if it allows a cover of at most ``limit`` balls, that is returned.

    Returns:
        Indices of the chosen centres.
    """
    low = float(protrusions.min(axis=0).max())
    high = float(protrusions.max(axis=1).min())

    if target is not None:
        rows = _greedy_set_cover(protrusions <= max(low, target))
        if len(rows) <= limit:
            return rows

    best = np.array([int(protrusions.max(axis=1).argmin())])
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        rows = _greedy_set_cover(protrusions <= middle)
        if len(rows) <= limit:
            best = rows
            high = min(middle, float(protrusions[rows].min(axis=0).max()))
        else:
            low = middle

    return best


def _greedy_set_cover(holds: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return rows that together hold every column, by greedy set cover: the row that adds most columns comes next.

    Args:
        holds: Whether each row holds each column, shape (rows, columns).
    """
    not_held = np.ones(holds.shape[1], dtype=bool)
    chosen = []
    columns = np.array(holds.T, dtype=np.float32, order="C")
    # Gains are counts, so their float32 sums are exact.
    gains = columns.sum(axis=0)

    while not_held.any():
        row = int(gains.argmax())
        chosen.append(row)
        newly_held = np.flatnonzero(not_held & holds[row])
        not_held[newly_held] = False
        gains -= columns[newly_held].sum(axis=0)

    return np.array(chosen)


def _improved(
    elements: Elements,
    surface: cKDTree,
    candidate_places: Places,
    candidate_protrusions: CentreElementTable,
    unavoidable: NDArray[np.float32],
    places: Places,
    limit: int,
    target: float | None,
) -> Places:
    """Improve the places of a cover's balls in rounds of relocating, matching and recentring; return the best round's.

    Args:
        elements: The elements to contain.
        surface: Points spread over the solid's surface.
        candidate_places: All candidate centres.
        candidate_protrusions: Their protrusions for each element, shape (candidates, elements).
        unavoidable: Part of each element's protrusion that does not count, shape (elements,).
        places: Centres of the cover to improve.
        limit: Largest number of balls.
        target: Protrusion that is good enough, which ends the search; None for the smallest.
    """
    element_of_point = np.repeat(np.arange(len(elements.start)), np.diff(np.r_[elements.start, len(elements.points)]))
    best = places
    best_protrusion = np.inf

    for round_number in range(MATCHINGS + 1):
        protrusions = reaches(elements, places.centres) - places.depth[:, None].astype(np.float32) - unavoidable
        worst = float(protrusions.min(axis=0).max())
        if worst < best_protrusion:
            best = places
            best_protrusion = worst

        if round_number == MATCHINGS or (target is not None and best_protrusion <= target):
            break
        if round_number < MATCHINGS - 2:
            places, protrusions = _relocated(places, protrusions, candidate_places, candidate_protrusions, limit)

        owner = protrusions.argmin(axis=0)
        used, owner = np.unique(owner, return_inverse=True)
        places = _recentred(elements, surface, places[used], owner.ravel()[element_of_point])

    return best


def _relocated(
    places: Places,
    protrusions: CentreElementTable,
    candidate_places: Places,
    candidate_protrusions: CentreElementTable,
    limit: int,
) -> tuple[Places, CentreElementTable]:
    """Add balls where the protrusion is largest, or move balls there that others can replace.

    As long as there are fewer than ``limit`` balls, the candidate that is best for the worst elements is added as a new
    ball. Then, the ball whose removal costs least is moved there. Both end when the gain is too small.

    Returns:
        The new places and their protrusions for each element, shape (balls, elements); the inputs are not changed.
    """
    centres = places.centres.copy()
    depth = places.depth.copy()
    protrusions = protrusions.copy()

    for _ in range(MAX_RELOCATIONS):
        owner = protrusions.argmin(axis=0)
        element_protrusion = protrusions.min(axis=0)
        if not element_protrusion.max() > 0.0:
            break

        worst_ball = int(owner[element_protrusion.argmax()])
        worst_elements = np.flatnonzero((owner == worst_ball) & (element_protrusion > 0.7 * element_protrusion.max()))
        row = int(candidate_protrusions[:, worst_elements].max(axis=1).argmin())
        if candidate_protrusions[row, worst_elements].max() >= RELOCATION_GAIN * element_protrusion.max():
            break

        if len(centres) < limit:
            centres = np.concatenate([centres, candidate_places.centres[[row]]])
            depth = np.r_[depth, candidate_places.depth[row]]
            protrusions = np.concatenate([protrusions, candidate_protrusions[[row]]])
            continue

        protrusion_without = np.zeros(len(centres))
        np.maximum.at(protrusion_without, owner, np.partition(protrusions, 1, axis=0)[1])
        protrusion_without[worst_ball] = np.inf
        most_replaceable = int(protrusion_without.argmin())
        if protrusion_without[most_replaceable] >= RELOCATION_GAIN * element_protrusion.max():
            break

        centres[most_replaceable] = candidate_places.centres[row]
        depth[most_replaceable] = candidate_places.depth[row]
        protrusions[most_replaceable] = candidate_protrusions[row]

    return Places(centres, depth), protrusions


def _recentred(elements: Elements, surface: cKDTree, places: Places, owner: NDArray[np.int64]) -> Places:
    """Move each ball to where it protrudes least while it contains its points.

    A centre moves away from the nearest surface point and towards its farthest point, in ever shorter steps
    (after [43]). A step is shorter than the depth, so a centre stays inside.

    Args:
        elements: The elements to contain.
        surface: Points spread over the solid's surface.
        places: Centres of the balls and their depths.
        owner: Index of the ball that must contain each point of the elements, shape (p,).
    """
    order = np.argsort(owner, kind="stable")
    points = elements.points[order]
    radii = elements.radii[order]
    owner = owner[order]
    first = np.flatnonzero(np.r_[True, np.diff(owner) > 0])

    centres = places.centres
    best = places
    best_protrusion = np.full(len(places.centres), np.inf)
    sign = np.where(places.depth > 0.0, 1.0, -1.0)
    stride = 0.0

    for step in range(RECENTRING_STEPS + 1):
        distance, nearest = surface.query(centres)
        offsets = points - centres[owner]
        reach = np.sqrt(np.einsum("ij,ij->i", offsets, offsets)) + radii
        radius = np.maximum.reduceat(reach, first)

        is_better = radius - sign * distance < best_protrusion
        best_protrusion = np.where(is_better, radius - sign * distance, best_protrusion)
        best = Places(
            np.where(is_better[:, None], centres, best.centres), np.where(is_better, sign * distance, best.depth)
        )

        outermost = np.flatnonzero(reach >= radius[owner])
        farthest = np.empty(len(first), dtype=np.int64)
        farthest[owner[outermost]] = outermost
        if step == 0:
            stride = 0.5 * np.maximum(best_protrusion, 0.0)

        outward = points[farthest] - centres
        inward = centres - surface.data[nearest]
        direction = _unit(outward) + _unit(inward)
        length = np.minimum(stride / (step + 2.0), 0.25 * np.maximum(sign * distance, 0.0))
        centres = centres + length[:, None] * direction

    return best


def _unit(vectors: Matrix) -> Matrix:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1), 1e-300)[:, None])


def _fitted_to_elements(elements: Elements, places: Places) -> Matrix:
    """Return balls with the smallest radii that contain their elements, shape (n, 4); unused balls are dropped.

    Each element belongs to the ball that needs the least protrusion for it.
    """
    protrusions = reaches(elements, places.centres) - places.depth[:, None]
    element_of_point = np.repeat(np.arange(len(elements.start)), np.diff(np.r_[elements.start, len(elements.points)]))
    owner = protrusions.argmin(axis=0)[element_of_point]
    needed_radii = np.linalg.norm(elements.points - places.centres[owner], axis=1) + elements.radii

    radius = np.zeros(len(places.centres))
    np.maximum.at(radius, owner, needed_radii)
    used = np.bincount(owner, minlength=len(places.centres)) > 0
    return np.column_stack([places.centres, radius])[used]
