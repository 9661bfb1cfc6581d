"""What holds of a timed motion in a world: proofs of its pieces, and the faults of each."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.model.proof import Proof
from rrtik_ompl.motion.trajectory.chords import proof_by_chords
from rrtik_ompl.motion.trajectory.cubics import even_parts
from rrtik_ompl.world.route_check import VERIFICATION_DENSITY, not_proven
from rrtik_ompl.world.world import World

if TYPE_CHECKING:
    from rrtik_ompl.motion.trajectory.motion import Trajectory


def faults_of(motion: Trajectory, world: World) -> list[tuple[float, str]]:
    """The first fault of every piece that has one, time [s] and reason; see :meth:`Trajectory.faults`."""
    clock = bad_moments(motion, world)
    rows = motion(clock).positions
    return [(moment, world.explain(q) or not_proven(world)) for moment, q in zip(clock.tolist(), rows, strict=True)]


def bad_moments(motion: Trajectory, world: World) -> Vector:
    """Times of the first fault of every piece that has one; see :meth:`Trajectory.faults`."""
    h = np.diff(motion.times)
    travel = h * (greatest_speeds(motion) @ world.weights)
    counts = np.ceil(travel * VERIFICATION_DENSITY / world.motion_resolution).astype(np.int64) + 1
    pieces, shares = even_parts(counts)
    clock = np.append(motion.times[pieces] + shares * h[pieces], motion.duration)

    bad_rows = np.flatnonzero(~world.checks.certified(motion(clock).positions))
    bad_pieces, first_rows = np.unique(np.append(pieces, len(h) - 1)[bad_rows], return_index=True)
    moments = np.asarray(clock[bad_rows[first_rows]])

    if world.settings.proving is None:
        return moments
    gaps = proof_of_pieces(motion, world, world.settings.proving, 0, len(h)).unproven
    unproven = np.setdiff1d([gap.motion for gap in gaps], bad_pieces).astype(np.int64)
    return np.sort(np.concatenate([moments, motion.times[unproven]]))


def greatest_speeds(motion: Trajectory) -> Matrix:
    """Bounds of the rates of all joints on each piece, shape (m, n) [rad/s or m/s]."""
    h = np.diff(motion.times)[:, None]
    peak = np.abs(motion.velocities)
    speeds: Matrix = np.maximum(peak[1:], peak[:-1]) + h * np.abs(motion.jerks * h) / 8.0
    return speeds


def proof_of_pieces(motion: Trajectory, world: World, clearance: float, first: int, end: int) -> Proof:
    """A proof of the pieces from ``first`` up to ``end``; see :meth:`Trajectory.prove`."""
    h = np.diff(motion.times)[first:end]
    begin = motion.accelerations[first:end]
    pushes = np.maximum(np.abs(begin), np.abs(begin + h[:, None] * motion.jerks[first:end]))
    times = motion.times[first : end + 1]
    return proof_by_chords(times, pushes @ world.weights, lambda clock: motion(clock).positions, world, clearance)
