"""Local repair of paths: a motion, or a few, that cannot be proven free are replaced by a detour.

A detour passes through a point near by. In a path that moves one joint at a time, another joint moves out of the way
before the motion and back after it.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.kernels.search.motions.motion_table import MotionsFree
from rrtik_ompl.model.proof import Proof
from rrtik_ompl.model.transitions import length_of
from rrtik_ompl.world.motion_queries import has_kernels
from rrtik_ompl.world.proven_motions import KERNELS, ProvenMotions
from rrtik_ompl.world.world import World

SIZES = (0.01, 0.03, 0.1, 0.3)  # distances of a detour's point, as shares of the stretch's length
POINTS = 12  # number of random points for each size
# Motions before and after the unproven one that a stretch has too. Where a waypoint is too near to something, it is
# enough to move that waypoint.
STRETCHES = ((0, 0), (1, 0), (0, 1), (1, 1), (2, 2))
SIDESTEPS = tuple(0.005 * 2.0**k for k in range(8))  # [rad] or [m] by which another joint moves out of the way
MOST_REPAIRS = 24  # largest number of repairs of a path


def with_detours(
    world: World,
    rows: Matrix,
    *,
    clearance: float,
    rng: np.random.Generator,
    one_joint: bool = False,
    proof: Proof | None = None,
) -> Matrix | None:
    """Replace the unproven motions of a path, shape (k, dof), by detours; return None if one has no detour.

    Args:
        world: The world.
        rows: The waypoints.
        clearance: Distance kept from obstacles on top of their margins [m].
        rng: Source of the random points.
        one_joint: Whether each motion moves only one joint, and has to.
        proof: The proof of the path with this clearance, if known.

    Returns:
        Waypoints of proven motions with the same ends, shape (m, dof); ``rows`` if the path is proven already.
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

        # Renumber the remaining motions; the detour may have replaced some of them.
        added = len(repair.rows) - len(rows)
        rows = repair.rows
        unproven = [motion + added for motion in unproven if motion >= repair.last]
    return None


class Repair(NamedTuple):
    """A path with a detour.

    Attributes:
        rows: Waypoints with the detour, shape (m, dof).
        last: Index of the waypoint of the path without the detour at which the detour ends.
    """

    rows: Matrix
    last: int


def _repaired(world: World, rows: Matrix, motion: int, clearance: float, rng: np.random.Generator) -> Repair | None:
    """Replace a motion, or a longer stretch with it in the middle, by a detour; return None if none is found."""
    spans = [(max(motion - before, 0), min(motion + 1 + after, len(rows) - 1)) for before, after in STRETCHES]
    for (first, last), proven in zip(spans, _judges(world, rows, spans, clearance), strict=True):
        if proven is None:
            continue
        waypoints = _waypoints_around(world, rows[first : last + 1], proven, rng)
        if waypoints is not None:
            return Repair(np.vstack([rows[: first + 1], waypoints, rows[last:]]), last)
    return None


def _sidestepped(world: World, rows: Matrix, motion: int, clearance: float) -> Repair | None:
    """Make one single-joint move while another joint is displaced: it moves away before, and back afterwards.

    Args:
        world: The world.
        rows: Waypoints of a path of single-joint moves, shape (k, dof).
        motion: Index of the move.
        clearance: Distance kept from obstacles on top of their margins [m].

    Returns:
        The path with the nearest sidestep whose three moves are proven; None if there is none.
    """
    a = rows[motion]
    b = rows[motion + 1]
    others = np.flatnonzero(a == b)

    # One sidestep for each size, direction and other joint: from near to far.
    sizes = np.array([sign * size for size in SIDESTEPS for sign in (1.0, -1.0)])
    offsets = np.zeros((len(sizes), len(others), len(a)))
    offsets[:, np.arange(len(others)), others] = sizes[:, None]
    sidesteps: Matrix = offsets.reshape(-1, len(a))

    (proven,) = _judges(world, rows, [(motion, motion + 1)], clearance)
    if proven is None:
        return None
    sidesteps = sidesteps[proven(a + sidesteps, b + sidesteps)]  # the displaced move
    sidesteps = sidesteps[proven(a + 0.0 * sidesteps, a + sidesteps)]  # the way there
    sidesteps = sidesteps[proven(b + sidesteps, b + 0.0 * sidesteps)]  # the way back

    if len(sidesteps) == 0:
        return None
    return Repair(np.vstack([rows[: motion + 1], a + sidesteps[0], b + sidesteps[0], rows[motion + 1 :]]), motion + 1)


def _waypoints_around(world: World, stretch: Matrix, proven: MotionsFree, rng: np.random.Generator) -> Matrix | None:
    """Find what replaces the inner waypoints of a stretch so that its motions are proven; None if nothing is found.

    The straight motion between its ends is tried first, then random points from small to large distances. Of the points
    of the first distance that succeeds, the one with the shortest way is taken.

    Args:
        world: The world.
        stretch: Waypoints, shape (k, dof).
        proven: Proves motions.
        rng: Source of the random points.

    Returns:
        Inner waypoints, shape (0, dof) or (1, dof).
    """
    a = stretch[0]
    b = stretch[-1]
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


def _judges(
    world: World, rows: Matrix, spans: Sequence[tuple[int, int]], clearance: float
) -> Sequence[MotionsFree | None]:
    """Return what proves motions beside each stretch of a path; None where that does not even prove its ends.

    Kernels do that in microseconds. What they leave open takes coal milliseconds a motion, and of random motions beside
    an unproven one they leave most open: coal is only asked where kernels prove the ends of no stretch.

    Args:
        world: The world.
        rows: Waypoints of the path, shape (k, dof).
        spans: First and last waypoint of each stretch.
        clearance: Distance kept from obstacles on top of their margins [m].
    """

    def where_ends_are_proven(proven: MotionsFree) -> Sequence[MotionsFree | None]:
        ends = np.unique(spans)
        known = dict(zip(ends.tolist(), proven(rows[ends], rows[ends]).tolist(), strict=True))
        return [proven if known[first] and known[last] else None for first, last in spans]

    part = rows[min(first for first, _ in spans) : max(last for _, last in spans) + 1]
    room = max(SIZES) * length_of(part)
    box = np.clip(np.vstack([part - room, part + room]), world.robot.lower, world.robot.upper)
    known_world: object = world
    if world.prover.constraints is None and has_kernels(known_world, KERNELS, within=box):
        by_kernels = ProvenMotions(world, max(clearance, world.settings.clearance)).motion_valid_batch
        judges = where_ends_are_proven(by_kernels)
        if any(judges):
            return judges
    return where_ends_are_proven(partial(world.prover.proven, clearance=clearance))


def _points_near(world: World, stretch: Matrix, size: float, rng: np.random.Generator) -> Matrix:
    """Draw random points within the limits, about ``size`` away from random places on a stretch: (POINTS, dof)."""
    places = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(stretch, axis=0), axis=1)))
    lengths_along = places[-1] * rng.uniform(0.0, 1.0, POINTS)
    points_on = np.stack([np.interp(lengths_along, places, column) for column in stretch.T], axis=1)
    offsets = rng.normal(size=points_on.shape)
    offsets *= size / np.maximum(np.linalg.norm(offsets, axis=1, keepdims=True), 1e-300)
    points: Matrix = np.clip(points_on + offsets, world.robot.lower, world.robot.upper)
    return points
