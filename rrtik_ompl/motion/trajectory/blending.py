"""Time a path with rounded corners: near the path, proven free, and faster than with a stop at each corner."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Vector
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.motion.trajectory.checks import bad_moments, proof_of_pieces
from rrtik_ompl.motion.trajectory.corners import MERGED_SHARE, Polyline, first_radii, spaced, vertices
from rrtik_ompl.motion.trajectory.cubics import Cubics
from rrtik_ompl.motion.trajectory.dynamics import DynamicLimits
from rrtik_ompl.motion.trajectory.limits import RateLimits, slowing_of
from rrtik_ompl.motion.trajectory.motion import Trajectory, motion_along
from rrtik_ompl.motion.trajectory.runs import Run, runs
from rrtik_ompl.world.clearances import provable_clearances
from rrtik_ompl.world.world import World

DEVIATION_SHARE = 0.22  # largest distance of a motion from its path, as a share of the blend
MAX_ROUNDS = 12  # most attempts, with smaller and smaller rounded corners
LEAST_RADIUS = 1.0 / 32.0  # least radius of a rounded corner, as a share of the blend; below it, the corner is a stop

# From a motion and the mask of its pieces off the path to the indices of those that are not known to be free.
Faults = Callable[[Trajectory, Mask], NDArray[np.int64]]


def blended(
    path: JointPath,
    line: Polyline,
    limits: RateLimits,
    blend: float,
    slowest: float,
    faults: Faults,
    more: DynamicLimits | None = None,
) -> Trajectory | None:
    """Return the motion along a path that rounds its corners, or None.

    All corners are rounded as widely as allowed. The radii of the corners near places where the motion deviates too
    far, or is not known to be free, are halved, until there are no such places.

    Args:
        path: The path.
        line: The same, as its vertices and edges.
        limits: Limits of the joints.
        blend: Largest distance of a corner from the beginning of its rounding [rad or m].
        slowest: Duration that the motion must be below [s].
        faults: Function that finds the pieces which are not known to be free.
        more: Limits of the tip or of torques; None if there are none.

    Returns:
        The motion; None if no such motion is faster than ``slowest``, or none is free.
    """
    chosen = spaced(line.vertices, MERGED_SHARE * blend)
    merged = len(chosen) < len(line.vertices)
    if merged:
        rows = vertices(line.vertices[chosen])
        if len(rows) < 2:  # The whole path is so short that its waypoints are merged.
            return None
        line = Polyline.of(rows)
    radii = first_radii(line, blend)
    max_deviation = (DEVIATION_SHARE - MERGED_SHARE) * blend

    for _ in range(MAX_ROUNDS):
        parts = runs(line, radii, limits, max_deviation=max_deviation, more=more)
        motion = joined(parts, path, limits)
        if motion.duration >= slowest:
            return None

        columns = zip(*((run.places, run.deviations, run.on_path) for run in parts), strict=True)
        places, deviations, on_path = (np.concatenate(column) for column in columns)
        bad_places = places[deviations > max_deviation]
        if len(bad_places) == 0:
            off_path = np.ones_like(on_path) if merged else ~on_path  # Only the path with all corners has been proven.
            bad_places = places[faults(motion, off_path)]

        if len(bad_places) == 0:
            return motion
        radii = _with_narrower_corners(radii, line.along[1:-1], bad_places, LEAST_RADIUS * blend)
    return None


def stops_at_corners(line: Polyline, limits: RateLimits, more: DynamicLimits | None) -> list[Run]:
    """Return the runs from each vertex to the next."""
    return runs(line, np.zeros(len(line.vertices) - 2), limits, more=more)


def joined(parts: Sequence[Run], path: JointPath, limits: RateLimits) -> Trajectory:
    """Join runs to one motion, slowed down if rounding errors let it exceed a limit.

    It ends where ``path`` ends, and takes the path's joint names and units.
    """
    pieces = [run.pieces for run in parts]
    last = pieces[-1]
    rest = np.zeros((1, path.waypoints.shape[1]))
    # Acceleration at the end of the last cubic, which comes to rest.
    braking = -2.0 * last.velocities[-1:] / last.durations[-1] - last.accelerations[-1:]
    motion = Cubics(
        np.concatenate([np.zeros(1), *(each.durations for each in pieces)]).cumsum(),
        np.concatenate([*(each.positions for each in pieces), path.waypoints[-1:]]),
        np.concatenate([*(each.velocities for each in pieces), rest]),
        np.concatenate([*(each.accelerations for each in pieces), braking]),
    )
    return motion_along(path, _within(motion, limits))


def _within(motion: Cubics, limits: RateLimits, rounds: int = 10) -> Cubics:
    """Slow a motion down if rounding errors let it exceed a limit."""
    for _ in range(rounds):
        factor = slowing_of(limits, *motion.peaks())
        if factor == 1.0:
            break
        motion = motion.slowed(factor)
    return motion


def _with_narrower_corners(radii: Vector, vertex_places: Vector, bad_places: Vector, min_radius: float) -> Vector:
    """Halve the radii of the corners near bad places.

    Args:
        radii: Radii of the inner vertices, shape (m,).
        vertex_places: Places of the inner vertices, shape (m,).
        bad_places: Places where the motion has faults, shape (k,).
        min_radius: A radius that becomes smaller than this is set to 0, which makes the corner a stop.

    Returns:
        The new radii, shape (m,). If no corner's rounding reaches a bad place, the nearest rounded corners are halved.
    """
    bad_places = np.unique(bad_places)
    is_blamed = (np.abs(vertex_places - bad_places[_nearest(bad_places, vertex_places)]) <= radii) & (radii > 0.0)
    rounded = np.flatnonzero(radii > 0.0)
    if not is_blamed.any() and len(rounded):
        is_blamed[rounded[_nearest(vertex_places[rounded], bad_places)]] = True

    halved: Vector = np.where(is_blamed, 0.5 * radii, radii)
    halved[halved < min_radius] = 0.0
    return halved


def _nearest(rows: Vector, places: Vector) -> NDArray[np.int64]:
    """Return the indices of the rows, which ascend, that are nearest to places; the first of two equally near ones."""
    after = np.minimum(np.searchsorted(rows, places), len(rows) - 1)
    before = np.maximum(after - 1, 0)
    return np.where(np.abs(places - rows[before]) <= np.abs(places - rows[after]), before, after)


def fault_finder(path: JointPath, world: World, clearance: float | None) -> Faults:
    """Return the function that finds the pieces of a motion that are not known to be free.

    If the path itself can be proven with some clearance, the pieces off the path must be proven with the same
    clearance; the others are proven with the path. Otherwise the whole motion is checked in steps.

    Args:
        path: The path.
        world: The world.
        clearance: Clearance to keep [m]; None for a default.
    """
    proven_clearance = next(provable_clearances(world, path, clearance), None)
    if proven_clearance is None:
        return lambda motion, _: np.searchsorted(motion.times, bad_moments(motion.cubics, world), side="right") - 1

    def unproven(motion: Trajectory, off_path: Mask) -> NDArray[np.int64]:
        pieces = np.flatnonzero(off_path)
        if len(pieces) == 0:
            return pieces
        gaps = proof_of_pieces(motion.cubics, world, proven_clearance, pieces).unproven
        return pieces[[gap.motion for gap in gaps]]

    return unproven
