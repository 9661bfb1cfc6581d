"""Balls inside a solid that leave little room between themselves and its surface.

Whatever reaches deeper into the solid than that room meets a ball. Each ball is the one that narrows the room most, on
average over points of the surface.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.geometry.covers.cells import lattice_inside
from rrtik_ompl.geometry.covers.search import random_subset
from rrtik_ompl.geometry.covers.solids import ROUNDING, Solid

CENTRES = 300
FEWEST = 200
SAMPLES = 400  # points of the surface
CLIMBS = 4  # steps of a centre away from the surface


def inscribed(solid: Solid, surface: cKDTree, count: int) -> Matrix:
    """At most ``count`` balls in a closed solid, the most useful first, shape (n, 4).

    A ball about a point that is known to be inside reaches at most to the surface. Centres are moved from such points;
    a move is trusted if the ball at its end holds the point where it began.
    """
    inside_points = random_subset(lattice_inside(solid, FEWEST), CENTRES)
    if not len(inside_points):
        return np.empty((0, 4))

    moved, start_depths, moved_depths = _moved_inwards(inside_points, surface)
    centres = np.concatenate([inside_points, moved])
    samples: Matrix = np.array(surface.data[:: -(-len(surface.data) // SAMPLES)])
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
