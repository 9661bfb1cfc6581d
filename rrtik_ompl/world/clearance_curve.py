"""How far the arm stays from obstacles along a path, where that is least, and which motions are not proven free."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Matrix, Vector, frozen
from rrtik_ompl.world import World

PLACES = 240  # on a path, beside its waypoints
NEAREST, FARTHEST = 1e-5, 2.0  # [m] of clearances that are told apart
STEPS = 255  # between these two, in equal ratios: one is 5 % more than the one before


@dataclass(frozen=True, slots=True, eq=False)
class ClearanceCurve:
    """Distances from obstacles beyond their margins, at places along a path; proven, so the true ones are not smaller.

    Attributes:
        motions: Number of the motion that each place is on, shape (m,).
        shares: Where on it, from 0 to 1, shape (m,).
        distances: Shape (m,) [m]; ``FARTHEST`` if no obstacle is nearer, 0 if not even that is proven.
        pairs: Names of the two nearest bodies at each place; ("", "") if none is near.
        unproven: Numbers of the motions that are not proven free.
    """

    motions: NDArray[np.int64]
    shares: Vector
    distances: Vector
    pairs: tuple[tuple[str, str], ...]
    unproven: tuple[int, ...]

    @property
    def least(self) -> int:
        """Number of the place where the arm is nearest to an obstacle."""
        return int(self.distances.argmin())

    def __str__(self) -> str:
        k = self.least
        if self.distances[k] >= FARTHEST:
            return f"no obstacle within {FARTHEST:g} m"
        where = f"motion {self.motions[k] + 1} at {100.0 * self.shares[k]:.0f} % of it"
        return (
            f"least clearance {1e3 * self.distances[k]:.3g} mm, {where}: '{self.pairs[k][0]}' and '{self.pairs[k][1]}'"
        )


def clearance_along(world: World, waypoints: Matrix) -> ClearanceCurve:
    """The curve of a path, waypoints of shape (k, dof), at places spread evenly over how far the arm moves.

    Clearances between the places are not looked at; proofs of whole motions say what is kept there.
    """
    motions, shares, places = places_along(world, waypoints)
    distances, pairs = _distances(world, places)
    unproven = tuple(gap.motion for gap in world.prove(waypoints).unproven)
    return ClearanceCurve(motions, frozen(shares), frozen(distances), pairs, unproven)


def places_along(world: World, waypoints: Matrix) -> tuple[NDArray[np.int64], Vector, Matrix]:
    """Places on a path, waypoints of shape (k, dof), spread evenly over how far the arm moves; the last one its end.

    Returns:
        The motion that each is on, shape (m,); where on it, from 0 to 1, shape (m,); configurations, shape (m, dof).
    """
    rows = np.vstack([waypoints, waypoints]) if len(waypoints) == 1 else waypoints
    travel = np.abs(np.diff(rows, axis=0)) @ world.weights
    counts = np.maximum(np.ceil(PLACES * travel / max(float(travel.sum()), 1e-300)), 1.0).astype(np.int64)
    motions = np.append(np.repeat(np.arange(len(counts)), counts), len(counts) - 1)
    shares = np.append(np.concatenate([np.arange(n) / n for n in counts]), 1.0)
    return motions, shares, (1.0 - shares)[:, None] * rows[motions] + shares[:, None] * rows[motions + 1]


def _distances(world: World, places: Matrix) -> tuple[Vector, tuple[tuple[str, str], ...]]:
    """The largest of the distances told apart that each configuration, shape (m, dof), is proven to keep; the pair."""
    levels = np.append(0.0, np.geomspace(NEAREST, FARTHEST, STEPS))
    kept, refused = np.full(len(places), -1), np.full(len(places), len(levels))
    pairs = [("", "")] * len(places)
    while (open_ := np.flatnonzero(refused - kept > 1)).size:
        tried = (kept[open_] + refused[open_]) // 2
        for level in np.unique(tried).tolist():
            group = open_[tried == level]
            gaps = world.prover.still_gaps(places[group], clearance=float(levels[level]))
            far = np.ones(len(group), dtype=bool)
            for gap in gaps:
                far[gap.motion] = False
                pairs[group[gap.motion]] = (gap.first, gap.second)
            kept[group[far]], refused[group[~far]] = level, level
    return levels[np.maximum(kept, 0)], tuple(pairs)
