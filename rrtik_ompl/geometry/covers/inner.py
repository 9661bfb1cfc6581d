"""Balls inside a solid that leave little room between themselves and its surface.

Whatever reaches deeper into the solid than that room meets a ball. Each ball is the one that narrows the room most, on
average over points of the surface.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.geometry.covers.cells import lattice_inside
from rrtik_ompl.geometry.covers.search import every
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
    sure = every(lattice_inside(solid, FEWEST), CENTRES)
    if not len(sure):
        return np.empty((0, 4))

    climbed, shallow, deep = _climbed(sure, surface)
    centres = np.concatenate([sure, climbed])
    samples: Matrix = np.array(surface.data[:: -(-len(surface.data) // SAMPLES)])
    chosen = _narrowing(centres, np.concatenate([shallow, deep]), samples, count)

    radii = solid.distance(centres[chosen]) - ROUNDING
    start = np.concatenate([sure, sure])
    trusted = np.linalg.norm(centres[chosen] - start[chosen], axis=1) < radii
    return np.asarray(np.column_stack([centres[chosen], radii])[trusted])


def _climbed(points: Matrix, surface: cKDTree) -> tuple[Matrix, Vector, Vector]:
    """Points moved away from the surface that is nearest, while that makes them deeper; depths before and after."""
    distance, nearest = surface.query(points)
    best = points
    start = distance
    depth = distance
    stride = 0.5 * distance

    for _ in range(CLIMBS):
        way = (best - surface.data[nearest]) / np.maximum(depth, 1e-300)[:, None]
        moved = best + stride[:, None] * way
        distance, reached = surface.query(moved)
        deeper = distance > depth

        best = np.where(deeper[:, None], moved, best)
        depth = np.where(deeper, distance, depth)
        nearest = np.where(deeper, reached, nearest)
        stride = np.where(deeper, stride, 0.4 * stride)

    return best, start, depth


def _narrowing(centres: Matrix, radii: Vector, samples: Matrix, count: int) -> list[int]:
    """Numbers of the balls of a greedy choice: each time the one that brings the samples nearest to a ball."""
    room = np.linalg.norm(samples[:, None] - centres, axis=2).astype(np.float32) - radii.astype(np.float32)
    left = np.full(len(samples), 2.0 * float(room.max()) + 1.0, dtype=np.float32)
    chosen: list[int] = []

    while len(chosen) < count:
        gain = np.maximum(left[:, None] - room, 0.0).sum(axis=0)
        best = int(gain.argmax())
        if gain[best] <= 0.0:
            break
        chosen.append(best)
        left = np.minimum(left, room[:, best])

    return chosen
