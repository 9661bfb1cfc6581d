"""Search for few balls that contain all elements of a solid and reach little beyond it.

A ball reaches beyond the solid by at most its radius minus the depth of its centre: its protrusion. First, greedy set
cover [41] with a bisection over the protrusion finds a set of balls. Then three steps alternate: each element is
assigned to the ball that needs the least protrusion for it; each ball is moved to where it protrudes least; and balls
that others can replace are moved to where the protrusion is largest (after [42]). All of this only searches for good
centres: whatever they are, each ball is finally made large enough for its elements, so that the cover contains the
solid.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.kernels.covers import search_in_numpy
from rrtik_ompl.kernels.covers.cells import Elements
from rrtik_ompl.kernels.covers.memory import called, room
from rrtik_ompl.kernels.covers.search_in_numpy import CentreElementTable
from rrtik_ompl.kernels.covers.search_layout import CENTRE, DEPTH, KERNELS, MOVED
from rrtik_ompl.kernels.covers.surface import Places, Surface
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.kernels.simd.processor import WIDTH

CANDIDATES = 400
LEAST_ON_SURFACE = 80  # least number of candidates at the surface, for thin or open parts of the solid
BISECTIONS = 7
MATCHINGS = 7  # rounds of assigning elements to balls and moving the balls
RECENTRING_STEPS = 10  # steps by which each ball is moved in a round
MAX_RELOCATIONS = 4  # largest number of balls that are moved elsewhere in a round
# A ball is moved elsewhere if the protrusion that results without it is below this share of the largest one.
RELOCATION_GAIN = 0.95


def smallest_cover(
    elements: Elements, surface: Surface, limit: int, target: float | None, *, lenient: bool = False
) -> Matrix:
    """Find balls that contain all elements, shape (n, 4), at most ``limit`` of them.

    Args:
        elements: The elements to contain.
        surface: Points spread over the solid's surface .
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


def candidates(elements: Elements, surface: Surface) -> Places:
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
    kernels = library(KERNELS)
    if kernels is None:
        return search_in_numpy.reaches(elements, centres)

    blocks = -(-len(centres) // WIDTH)
    lanes = room(3 * blocks * WIDTH).reshape(3, -1)
    lanes[:, len(centres) :] = 0.0
    lanes[:, : len(centres)] = centres.T

    count = len(elements.start)
    balls = np.column_stack([elements.points, elements.radii]).astype(np.float32)
    ends = np.r_[elements.start, len(elements.points)]
    table = room(count * blocks * WIDTH)
    called(kernels.reach_table, balls, ends, count, lanes, blocks, table)
    return np.asarray(table.reshape(count, -1)[:, : len(centres)].T)


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
        rows = _greedy_set_cover(protrusions, max(low, target), limit)
        if rows is not None:
            return rows

    best = np.array([int(protrusions.max(axis=1).argmin())])
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        rows = _greedy_set_cover(protrusions, middle, limit)
        if rows is not None:
            best = rows
            high = min(middle, float(protrusions[rows].min(axis=0).max()))
        else:
            low = middle

    return best


def _greedy_set_cover(protrusions: CentreElementTable, allowed: float, limit: int) -> NDArray[np.int64] | None:
    """Return at most ``limit`` centres whose balls together hold every element and protrude little enough.

    By greedy set cover: the centre whose ball adds most elements comes next. None if it takes more of them.
    """
    kernels = library(KERNELS)
    if kernels is None:
        rows = search_in_numpy.greedy_set_cover(protrusions <= allowed)
        return rows if len(rows) <= limit else None

    of_elements = np.ascontiguousarray(protrusions.T)
    count, width = of_elements.shape
    gains, held, chosen = (np.empty(n, dtype=np.int32) for n in (width, count, limit))
    most = np.array([allowed], dtype=np.float32)
    found = called(kernels.greedy_cover, of_elements, count, width, most, gains, held, chosen, limit)
    return chosen[:found].astype(np.int64) if found <= limit else None


def _improved(
    elements: Elements,
    surface: Surface,
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


def _recentred(elements: Elements, surface: Surface, places: Places, owner: NDArray[np.int64]) -> Places:
    """Move each ball to where it protrudes least while it contains its points.

    A centre moves away from the nearest surface point and towards its farthest point, in ever shorter steps
    (after [43]). A step is shorter than the depth, so a centre stays inside.

    Args:
        elements: The elements to contain.
        surface: Points spread over the solid's surface.
        places: Centres of the balls and their depths.
        owner: Index of the ball that must contain each point of the elements, shape (p,).
    """
    kernels = library(KERNELS)
    if kernels is None:
        return search_in_numpy.recentred(elements, surface, places, owner, RECENTRING_STEPS)

    count = len(places.centres)
    points, first = _in_lanes(elements, owner, count)
    balls = np.empty((count, MOVED))
    balls[:, CENTRE : CENTRE + 3] = places.centres
    balls[:, DEPTH] = places.depth
    reach = room(int(np.diff(first).max()) * WIDTH)
    called(kernels.recentre, balls, count, first, points, reach, *surface.arrays, RECENTRING_STEPS)
    return Places(balls[:, CENTRE : CENTRE + 3].copy(), balls[:, DEPTH].copy())


def _in_lanes(
    elements: Elements, owner: NDArray[np.int64], count: int
) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Return the points of each ball in blocks, and the first block of each ball.

    A block has the x, y, z and radii of ``WIDTH`` points. The last point of a ball fills up its last block.

    Returns:
        The blocks, shape (b, 4, WIDTH), and the number of the first block of each ball, with b at the end, shape
        (count + 1,).
    """
    order = np.argsort(owner, kind="stable")
    points_of = np.bincount(owner, minlength=count)
    ends = np.cumsum(points_of)
    first = np.r_[0, np.cumsum(-(-points_of // WIDTH))]

    ball_of_block = np.repeat(np.arange(count), np.diff(first))
    block = np.arange(first[-1]) - first[ball_of_block]
    begin = (ends - points_of)[ball_of_block] + block * WIDTH
    rows = order[np.minimum(begin[:, None] + np.arange(WIDTH), ends[ball_of_block, None] - 1)]

    blocks = room(4 * rows.size).reshape(-1, 4, WIDTH)
    for axis in range(3):
        blocks[:, axis] = elements.points[rows, axis]
    blocks[:, 3] = elements.radii[rows]
    return blocks, first


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
