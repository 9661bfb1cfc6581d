"""Check timed motions in a world: proofs of their pieces, and the faults of each piece.

In proofs curved motions are replaced by straight ones (chords), over parts so short that nothing moves far from them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.model.proof import Proof
from rrtik_ompl.motion.trajectory.cubics import Cubics, even_parts
from rrtik_ompl.world.route_check import VERIFICATION_DENSITY, not_proven
from rrtik_ompl.world.world import World

# [m] Largest deviation of two bodies together from their places on the chords; tried in turn.
SLACKS = (1e-4, 1e-6, 1e-8)


def faults_of(motion: Cubics, world: World) -> list[tuple[float, str]]:
    """Return time [s] and reason of the first fault of each piece that has one; see :meth:`Trajectory.faults`."""
    clock = bad_moments(motion, world)
    rows = motion.states(clock).positions
    reasons = [world.explain(q) or not_proven(world.settings) for q in rows]
    return list(zip(clock.tolist(), reasons, strict=True))


def bad_moments(motion: Cubics, world: World) -> Vector:
    """Return the times [s] of the first fault of each piece that has one, in order; see :meth:`Trajectory.faults`.

    For a piece that is only unproven, the time is that of its beginning.
    """
    h = np.diff(motion.times)
    travel = h * (greatest_speeds(motion) @ world.weights)
    counts = np.ceil(travel * VERIFICATION_DENSITY / world.motion_resolution).astype(np.int64) + 1
    pieces, shares = even_parts(counts)
    clock = np.append(motion.times[pieces] + shares * h[pieces], motion.duration)

    bad_rows = np.flatnonzero(~world.checks.certified(motion.states(clock).positions))
    bad_pieces, first_rows = np.unique(np.append(pieces, len(h) - 1)[bad_rows], return_index=True)
    moments = np.asarray(clock[bad_rows[first_rows]])

    if world.settings.proving is None:
        return moments
    gaps = proof_of_motion(motion, world, world.settings.proving).unproven
    unproven = np.setdiff1d([gap.motion for gap in gaps], bad_pieces).astype(np.int64)
    return np.sort(np.concatenate([moments, motion.times[unproven]]))


def greatest_speeds(motion: Cubics) -> Matrix:
    """Return upper bounds of the joints' speeds on each piece, shape (m, n) [rad/s or m/s]."""
    h = np.diff(motion.times)[:, None]
    peak = np.abs(motion.velocities)
    speeds: Matrix = np.maximum(peak[1:], peak[:-1]) + h * np.abs(motion.jerks * h) / 8.0
    return speeds


def proof_of_motion(motion: Cubics, world: World, clearance: float | None = None) -> Proof:
    """Prove all pieces of a motion; see :meth:`Trajectory.prove`.

    Args:
        motion: The motion.
        world: The world.
        clearance: Distance to keep from obstacles [m]; None for what the world requires.
    """
    kept_clearance = world.settings.required_clearance if clearance is None else clearance
    return proof_of_pieces(motion, world, kept_clearance, 0, len(motion.times) - 1)


def proof_of_pieces(motion: Cubics, world: World, clearance: float, first: int, end: int) -> Proof:
    """Prove the pieces of a motion from number ``first`` to ``end - 1``; see :meth:`Trajectory.prove`."""
    pushes = np.maximum(np.abs(motion.accelerations[:-1]), np.abs(motion.last_accelerations))[first:end]
    times = motion.times[first : end + 1]
    return proof_by_chords(
        times, pushes @ world.weights, lambda clock: motion.states(clock).positions, world, clearance
    )


class Chords(NamedTuple):
    """The pieces of a motion, cut into equal parts.

    Attributes:
        counts: Number of parts of each piece, shape (m,).
        pieces: Index of the piece of each part, shape (k,).
        shares: Where on its piece each part begins, from 0 to below 1, shape (k,).
    """

    counts: NDArray[np.int64]
    pieces: NDArray[np.int64]
    shares: Vector

    def joined(self, proof: Proof) -> Proof:
        """Convert a proof of the parts to a proof of the pieces, with the first gap of each piece."""
        gaps = {int(self.pieces[gap.motion]): gap for gap in reversed(proof.unproven)}
        unproven = (
            replace(gap, motion=k, share=float(self.shares[gap.motion] + gap.share / self.counts[k]))
            for k, gap in sorted(gaps.items())
        )
        return replace(proof, motions=len(self.counts), unproven=tuple(unproven))


def chords_of(durations: Vector, pushes: Vector, slack: float) -> Chords:
    """Cut pieces of a motion so that two bodies together deviate by at most ``slack`` [m] from the chords.

    Over a part of duration h no coordinate deviates from its chord by more than h^2 / 8 times its largest acceleration.

    Args:
        durations: Durations of the pieces [s], shape (m,).
        pushes: Largest acceleration of any point of the arm during each piece [m/s^2], shape (m,).
        slack: Largest deviation of two bodies together [m].
    """
    counts = np.maximum(np.ceil(durations * np.sqrt(0.25 * pushes / slack)), 1.0).astype(np.int64)
    return Chords(counts, *even_parts(counts))


def proof_by_chords(
    times: Vector,
    pushes: Vector,
    places: Callable[[Vector], Matrix],
    world: World,
    clearance: float,
    finer: int = 0,
) -> Proof:
    """Prove the m pieces of a motion by chords; pieces that remain unproven are tried again with shorter chords.

    Shorter chords are only tried if the motion itself, at the place of the gap, is far enough from everything.

    Args:
        times: Times at the ends of the pieces [s], shape (m + 1,).
        pushes: Largest acceleration of any point of the arm during each piece [m/s^2], shape (m,).
        places: Function from times, shape (k,), to configurations, shape (k, dof).
        world: The world.
        clearance: Distance to keep from every obstacle [m].
        finer: Number of ``SLACKS`` that have been tried.
    """
    h = np.diff(times)
    slack = SLACKS[finer]
    chords = chords_of(h, pushes, slack)
    clock = times[chords.pieces] + chords.shares * h[chords.pieces]
    proof = chords.joined(world.prover.route(places(np.append(clock, times[-1])), clearance=clearance, slack=slack))
    if proof.proven or finer + 1 == len(SLACKS):
        return proof

    unproven = np.array([gap.motion for gap in proof.unproven])
    q = places(times[unproven] + np.nan_to_num([gap.share for gap in proof.unproven]) * h[unproven])
    # If the motion itself is too near to something, shorter chords cannot help.
    is_hopeful = world.prover.proven(q, q, clearance=clearance)
    gaps = [gap for gap, hope in zip(proof.unproven, is_hopeful, strict=True) if not hope]
    to_refine = unproven[is_hopeful]

    for stretch in np.split(to_refine, np.flatnonzero(np.diff(to_refine) > 1) + 1) if len(to_refine) else ():
        first = int(stretch[0])
        end = int(stretch[-1]) + 1
        finer_proof = proof_by_chords(times[first : end + 1], pushes[first:end], places, world, clearance, finer + 1)
        gaps += [replace(gap, motion=first + gap.motion) for gap in finer_proof.unproven]

    return replace(proof, unproven=tuple(sorted(gaps, key=lambda gap: gap.motion)))
