"""What the kernels of the search for a cover compute, in plain numpy, for where there are no kernels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import QUIET_PRODUCT, Matrix
from rrtik_ompl.kernels.covers.cells import Elements
from rrtik_ompl.kernels.covers.surface import Places, Surface

CentreElementTable = NDArray[np.float32]  # shape (centres, elements)


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


def greedy_set_cover(holds: NDArray[np.bool_]) -> NDArray[np.int64]:
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


def recentred(elements: Elements, surface: Surface, places: Places, owner: NDArray[np.int64], steps: int) -> Places:
    """Move each ball to where it protrudes least while it contains its points.

    A centre moves away from the nearest surface point and towards its farthest point, in ever shorter steps
    (after [43]). A step is shorter than the depth, so a centre stays inside.

    Args:
        elements: The elements to contain.
        surface: Points spread over the solid's surface.
        places: Centres of the balls and their depths.
        owner: Index of the ball that must contain each point of the elements, shape (p,).
        steps: Number of times that each ball is moved.
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

    for step in range(steps + 1):
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
