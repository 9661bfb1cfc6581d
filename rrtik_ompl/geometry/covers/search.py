"""Few balls that hold all elements of a solid and reach little beyond it.

A ball sticks out by at most its radius minus the depth of its centre. Greedy set cover [41] with a bisection
of the protrusion finds a first set of balls; then elements and balls are matched and every ball is moved to where it
sticks out least, in turns, and balls that others can replace are moved to where the protrusion is largest (after
[42]). All this only searches for good places: whatever they are, each ball is made large enough for its elements, so
the cover holds the solid.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.geometry.covers.cells import Elements
from rrtik_ompl.geometry.covers.solids import Triangles

CANDIDATES = 400
LEAST_ON_SURFACE = 80  # candidates for what is thin or open
BISECTIONS = 7
MATCHINGS = 7  # of matching elements with balls
STEPS = 10  # of every ball in a round
MOVES = 4  # balls moved elsewhere in a round, at most
WORTH = 0.95  # a ball is moved elsewhere if the protrusion it leaves behind is below this share of the worst
CHUNK = 64

Needs = NDArray[np.float32]  # shape (centres, elements)


@dataclass(slots=True, eq=False)
class Places:
    """Centres of balls, shape (n, 3), and their (estimated) depths, shape (n,), not above 0 where they cannot move."""

    centres: Matrix
    depth: Vector

    def __getitem__(self, rows: NDArray[np.int64] | NDArray[np.bool_] | slice) -> Places:
        return Places(self.centres[rows], self.depth[rows])


def smallest_cover(
    parts: Elements, surface: cKDTree, limit: int, wanted: float | None, *, lenient: bool = False
) -> Matrix:
    """Balls that hold all elements, at most ``limit``, shape (n, 4).

    Args:
        parts: The elements.
        surface: Points spread over the surface (``surface_points``).
        limit: Largest number of balls, unless the protrusion ``wanted`` takes more.
        wanted: Protrusion that is good enough; None for the smallest.
        lenient: Not to count a protrusion that no candidate can save an element: one such element, as an open mesh has
            at its rim, would end the search with few balls that stick out as far everywhere.
    """
    places = candidates(parts, surface)
    needs = reaches(parts, places.centres) - places.depth[:, None].astype(np.float32)
    spared = np.maximum(needs.min(axis=0), 0.0) if lenient else np.zeros_like(needs[0])
    needs -= spared

    chosen = _cover(needs, limit, wanted)
    found = _refined(parts, surface, places, needs, spared, places[chosen], max(limit, len(chosen)), wanted)
    return _shrunk(parts, found)


def surface_points(triangles: Triangles, count: int) -> Matrix:
    """Points spread evenly over triangles, the same every time, and all corners if they are few."""
    a, b, c = (triangles[:, k] for k in range(3))
    sizes = np.cumsum(np.linalg.norm(np.cross(b - a, c - a), axis=1))
    which = np.searchsorted(sizes, (np.arange(count) + 0.5) / count * sizes[-1]).clip(0, len(triangles) - 1)

    u, v = ((np.arange(count) * step) % 1.0 for step in (0.7548776662466927, 0.5698402909980532))  # Roberts' sequence
    u, v = (np.where(u + v > 1.0, 1.0 - w, w)[:, None] for w in (u, v))

    spread = a[which] + u * (b - a)[which] + v * (c - a)[which]
    return np.concatenate([spread, triangles[:: -(-len(triangles) // count)].reshape(-1, 3)])


def candidates(parts: Elements, surface: cKDTree) -> Places:
    """Places for centres: lattice points inside, and points at the surface for what is thin or open."""
    inside = every(parts.inside, CANDIDATES)
    edge = every(parts.on_surface, max(CANDIDATES - len(inside), LEAST_ON_SURFACE))
    centres = np.concatenate([inside, edge])
    side = np.where(np.arange(len(centres)) < len(inside), 1.0, -1.0)
    return Places(centres, side * surface.query(centres)[0])


def every(points: Matrix, most: int) -> Matrix:
    """At most so many of the points, spread evenly by lot (the same every time)."""
    if len(points) <= most:
        return points
    return points[np.sort(np.random.default_rng(0).choice(len(points), most, replace=False))]


def reaches(parts: Elements, centres: Matrix) -> Needs:
    """Radius that a ball around each centre needs to hold each element."""
    points = parts.points.astype(np.float32).T
    squares = (points**2).sum(axis=0)
    radii = parts.radii.astype(np.float32)
    found = np.empty((len(centres), len(parts.start)), dtype=np.float32)

    for k in range(0, len(centres), CHUNK):
        some = centres[k : k + CHUNK].astype(np.float32)
        # |p - c|^2 = |p|^2 - 2 p c + |c|^2, in one array.
        square = some @ points
        square *= -2.0
        square += squares
        square += (some**2).sum(axis=1)[:, None]
        np.maximum(square, 0.0, out=square)
        np.sqrt(square, out=square)
        square += radii
        np.maximum.reduceat(square, parts.start, axis=1, out=found[k : k + CHUNK])

    return found


def _cover(needs: Needs, limit: int, wanted: float | None) -> NDArray[np.int64]:
    """Numbers of the centres of a cover."""
    low = float(needs.min(axis=0).max())
    high = float(needs.max(axis=1).min())

    if wanted is not None:
        found = _greedy(needs <= max(low, wanted))
        if len(found) <= limit:
            return found

    best = np.array([int(needs.max(axis=1).argmin())])
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        found = _greedy(needs <= middle)
        if len(found) <= limit:
            best = found
            high = min(middle, float(needs[found].min(axis=0).max()))
        else:
            low = middle

    return best


def _greedy(holds: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Rows that together hold every column, the one that adds most first."""
    left = np.ones(holds.shape[1], dtype=bool)
    chosen = []
    columns = np.array(holds.T, dtype=np.float32, order="C")
    gains = columns.sum(axis=0)  # whole numbers, exact

    while left.any():
        row = int(gains.argmax())
        chosen.append(row)
        added = np.flatnonzero(left & holds[row])
        left[added] = False
        gains -= columns[added].sum(axis=0)

    return np.array(chosen)


def _refined(
    parts: Elements,
    surface: cKDTree,
    spare: Places,
    spare_needs: Needs,
    spared: NDArray[np.float32],
    places: Places,
    limit: int,
    wanted: float | None,
) -> Places:
    """Better places for the balls of a cover: the best set of all rounds."""
    element = np.repeat(np.arange(len(parts.start)), np.diff(np.r_[parts.start, len(parts.points)]))
    best = places
    least = np.inf

    for turn in range(MATCHINGS + 1):
        needs = reaches(parts, places.centres) - places.depth[:, None].astype(np.float32) - spared
        worst = float(needs.min(axis=0).max())
        if worst < least:
            best = places
            least = worst

        if turn == MATCHINGS or (wanted is not None and least <= wanted):
            break
        if turn < MATCHINGS - 2:
            places, needs = _moved_elsewhere(places, needs, spare, spare_needs, limit)

        owner = needs.argmin(axis=0)
        kept, owner = np.unique(owner, return_inverse=True)
        places = _descended(parts, surface, places[kept], owner.ravel()[element])

    return best


def _moved_elsewhere(
    places: Places, needs: Needs, spare: Places, spare_needs: Needs, limit: int
) -> tuple[Places, Needs]:
    """Balls that others can replace moved (or, below the limit, new ones put) to where the protrusion is worst."""
    centres = places.centres.copy()
    depth = places.depth.copy()
    needs = needs.copy()

    for _ in range(MOVES):
        owner = needs.argmin(axis=0)
        least = needs.min(axis=0)
        if not least.max() > 0.0:
            break

        worst = int(owner[least.argmax()])
        bad = np.flatnonzero((owner == worst) & (least > 0.7 * least.max()))
        row = int(spare_needs[:, bad].max(axis=1).argmin())
        if spare_needs[row, bad].max() >= WORTH * least.max():
            break

        if len(centres) < limit:
            centres = np.concatenate([centres, spare.centres[[row]]])
            depth = np.r_[depth, spare.depth[row]]
            needs = np.concatenate([needs, spare_needs[[row]]])
            continue

        without = np.zeros(len(centres))
        np.maximum.at(without, owner, np.partition(needs, 1, axis=0)[1])
        without[worst] = np.inf
        poorest = int(without.argmin())
        if without[poorest] >= WORTH * least.max():
            break

        centres[poorest] = spare.centres[row]
        depth[poorest] = spare.depth[row]
        needs[poorest] = spare_needs[row]

    return Places(centres, depth), needs


def _descended(parts: Elements, surface: cKDTree, places: Places, owner: NDArray[np.int64]) -> Places:
    """Each ball moved to where it sticks out least while it holds its points.

    It goes away from the surface that is nearest and towards the point that is farthest, in ever shorter steps (after
    [43]). A step is shorter than the depth, so a centre stays inside.
    """
    order = np.argsort(owner, kind="stable")
    points = parts.points[order]
    radii = parts.radii[order]
    owner = owner[order]
    first = np.flatnonzero(np.r_[True, np.diff(owner) > 0])

    centres = places.centres
    best = places
    least = np.full(len(places.centres), np.inf)
    side = np.where(places.depth > 0.0, 1.0, -1.0)
    stride = 0.0

    for step in range(STEPS + 1):
        distance, nearest = surface.query(centres)
        away = points - centres[owner]
        reach = np.sqrt(np.einsum("ij,ij->i", away, away)) + radii
        radius = np.maximum.reduceat(reach, first)

        better = radius - side * distance < least
        least = np.where(better, radius - side * distance, least)
        best = Places(np.where(better[:, None], centres, best.centres), np.where(better, side * distance, best.depth))

        last = np.flatnonzero(reach >= radius[owner])
        farthest = np.empty(len(first), dtype=np.int64)
        farthest[owner[last]] = last
        if step == 0:
            stride = 0.5 * np.maximum(least, 0.0)

        out = points[farthest] - centres
        inward = centres - surface.data[nearest]
        way = _unit(out) + _unit(inward)
        length = np.minimum(stride / (step + 2.0), 0.25 * np.maximum(side * distance, 0.0))
        centres = centres + length[:, None] * way

    return best


def _unit(vectors: Matrix) -> Matrix:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1), 1e-300)[:, None])


def _shrunk(parts: Elements, places: Places) -> Matrix:
    """Balls no larger than what they have to hold; each element goes to the ball that sticks out least for it."""
    needs = reaches(parts, places.centres) - places.depth[:, None]
    element = np.repeat(np.arange(len(parts.start)), np.diff(np.r_[parts.start, len(parts.points)]))
    owner = needs.argmin(axis=0)[element]
    away = np.linalg.norm(parts.points - places.centres[owner], axis=1) + parts.radii

    radius = np.zeros(len(places.centres))
    np.maximum.at(radius, owner, away)
    used = np.bincount(owner, minlength=len(places.centres)) > 0
    return np.column_stack([places.centres, radius])[used]
