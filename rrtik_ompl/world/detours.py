"""Detours around what is not proven: two motions in the place of one, or of a few, through a point near by.

In a path that moves one joint at a time another joint moves out of the way before, and back afterwards.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.model.proof import Proof
from rrtik_ompl.model.transitions import length_of
from rrtik_ompl.world.world import World

SIZES = (0.01, 0.03, 0.1, 0.3)  # of a detour, shares of the stretch's length
POINTS = 12  # of each size
WIDER = 3  # stretches that are tried, each with a motion more at both ends
SIDESTEPS = tuple(0.005 * 2.0**k for k in range(8))  # [rad] or [m] by which another joint moves out of the way
MOST_REPAIRS = 24  # of a route


def with_detours(
    world: World,
    rows: Matrix,
    *,
    clearance: float,
    rng: np.random.Generator,
    one_joint: bool = False,
    proof: Proof | None = None,
) -> Matrix | None:
    """A route, shape (k, dof), with detours in the place of what is not proven; None if one of them is not found.

    Args:
        world: The world.
        rows: The route.
        clearance: To be kept from obstacles beside their margins [m].
        rng: Of the points that are tried.
        one_joint: Whether each motion moves one joint alone, and has to.
        proof: What is proven of the route with this clearance, if that is known.

    Returns:
        A route of proven motions with the same ends, shape (m, dof); the given one if it is proven.
    """
    given_proof = world.prover.route(rows, clearance=clearance) if proof is None else proof
    unproven = [gap.motion for gap in given_proof.unproven]

    for _ in range(MOST_REPAIRS):
        if not unproven:
            return rows
        if one_joint:
            repair = _sidestepped(world, rows, unproven[0], clearance)
        else:
            repair = _repaired(world, rows, unproven[0], clearance, rng)
        if repair is None:
            return None

        added = len(repair.rows) - len(rows)
        rows = repair.rows
        unproven = [motion + added for motion in unproven if motion >= repair.last]
    return None


class Repair(NamedTuple):
    """A route with a detour in it, and which waypoint of the one before it leads back to."""

    rows: Matrix
    last: int


def _repaired(world: World, rows: Matrix, motion: int, clearance: float, rng: np.random.Generator) -> Repair | None:
    """Return the route with a detour around one of its motions, or around a stretch with that in the middle."""
    for more in range(WIDER):
        first = max(motion - more, 0)
        last = min(motion + 1 + more, len(rows) - 1)
        waypoints = _waypoints_around(world, rows[first : last + 1], clearance, rng)
        if waypoints is not None:
            return Repair(np.vstack([rows[: first + 1], waypoints, rows[last:]]), last)
    return None


def _sidestepped(world: World, rows: Matrix, motion: int, clearance: float) -> Repair | None:
    """The route with one of its moves made beside its place: another joint moves away before and back afterwards."""
    a = rows[motion]
    b = rows[motion + 1]
    others = np.flatnonzero(a == b)

    sizes = np.array([sign * size for size in SIDESTEPS for sign in (1.0, -1.0)])
    offsets = np.zeros((len(sizes), len(others), len(a)))
    offsets[:, np.arange(len(others)), others] = sizes[:, None]
    sidesteps: Matrix = offsets.reshape(-1, len(a))

    proven = partial(world.prover.proven, clearance=clearance)
    sidesteps = sidesteps[proven(a + sidesteps, b + sidesteps)]  # beside the move
    sidesteps = sidesteps[proven(a + 0.0 * sidesteps, a + sidesteps)]  # out of its way
    sidesteps = sidesteps[proven(b + sidesteps, b + 0.0 * sidesteps)]  # and back to it

    if len(sidesteps) == 0:
        return None
    return Repair(np.vstack([rows[: motion + 1], a + sidesteps[0], b + sidesteps[0], rows[motion + 1 :]]), motion + 1)


def _waypoints_around(world: World, stretch: Matrix, clearance: float, rng: np.random.Generator) -> Matrix | None:
    """What to pass between the ends of a stretch, shape (0 or 1, dof), on proven motions; None if nothing is found."""
    a = stretch[0]
    b = stretch[-1]
    proven = partial(world.prover.proven, clearance=clearance)
    if len(stretch) > 2 and proven(a[None], b[None])[0]:
        return stretch[:0]

    length = length_of(stretch)
    for size in SIZES:
        points = _points_near(world, stretch, size * length, rng)
        points = points[proven(points, points)]
        points = points[proven(a + 0.0 * points, points)]
        points = points[proven(points, b + 0.0 * points)]
        if len(points):
            lengths = np.linalg.norm(points - a, axis=1) + np.linalg.norm(points - b, axis=1)
            best: Matrix = points[[lengths.argmin()]]
            return best
    return None


def _points_near(world: World, stretch: Matrix, size: float, rng: np.random.Generator) -> Matrix:
    """Return random points within the limits, about ``size`` from places spread over a stretch, shape (POINTS, dof)."""
    places = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(stretch, axis=0), axis=1)))
    lengths_along = places[-1] * rng.uniform(0.0, 1.0, POINTS)
    points_on = np.stack([np.interp(lengths_along, places, column) for column in stretch.T], axis=1)
    offsets = rng.normal(size=points_on.shape)
    offsets *= size / np.maximum(np.linalg.norm(offsets, axis=1, keepdims=True), 1e-300)
    points: Matrix = np.clip(points_on + offsets, world.robot.lower, world.robot.upper)
    return points
