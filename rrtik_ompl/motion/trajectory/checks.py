"""What holds of a timed motion in a world: proofs of its pieces, and the faults of each.

In proofs straight motions stand for curved ones, over parts so short that nothing leaves them far.
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

SLACKS = (1e-4, 1e-6, 1e-8)  # [m] by which two bodies together may leave their places on the chords, tried in turn


def faults_of(motion: Cubics, world: World) -> list[tuple[float, str]]:
    """The first fault of every piece that has one, time [s] and reason; see :meth:`Trajectory.faults`."""
    clock = bad_moments(motion, world)
    rows = motion.states(clock).positions
    reasons = [world.explain(q) or not_proven(world.settings) for q in rows]
    return list(zip(clock.tolist(), reasons, strict=True))


def bad_moments(motion: Cubics, world: World) -> Vector:
    """Times of the first fault of every piece that has one; see :meth:`Trajectory.faults`."""
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
    """Bounds of the rates of all joints on each piece, shape (m, n) [rad/s or m/s]."""
    h = np.diff(motion.times)[:, None]
    peak = np.abs(motion.velocities)
    speeds: Matrix = np.maximum(peak[1:], peak[:-1]) + h * np.abs(motion.jerks * h) / 8.0
    return speeds


def proof_of_motion(motion: Cubics, world: World, clearance: float | None = None) -> Proof:
    """A proof of all pieces, of what the world keeps if no clearance [m] is given; see :meth:`Trajectory.prove`."""
    kept_clearance = world.settings.required_clearance if clearance is None else clearance
    return proof_of_pieces(motion, world, kept_clearance, 0, len(motion.times) - 1)


def proof_of_pieces(motion: Cubics, world: World, clearance: float, first: int, end: int) -> Proof:
    """A proof of the pieces from ``first`` up to ``end``; see :meth:`Trajectory.prove`."""
    pushes = np.maximum(np.abs(motion.accelerations[:-1]), np.abs(motion.last_accelerations))[first:end]
    times = motion.times[first : end + 1]
    return proof_by_chords(
        times, pushes @ world.weights, lambda clock: motion.states(clock).positions, world, clearance
    )


class Chords(NamedTuple):
    """Parts of the pieces of a motion.

    Attributes:
        counts: Into how many parts each piece is cut, shape (m,).
        pieces: Number of the piece of each part, shape (k,).
        shares: Where on the piece each part begins, from 0 to 1, shape (k,).
    """

    counts: NDArray[np.int64]
    pieces: NDArray[np.int64]
    shares: Vector

    def joined(self, proof: Proof) -> Proof:
        """A proof of the parts as one of the pieces."""
        gaps = {int(self.pieces[gap.motion]): gap for gap in reversed(proof.unproven)}
        unproven = (
            replace(gap, motion=k, share=float(self.shares[gap.motion] + gap.share / self.counts[k]))
            for k, gap in sorted(gaps.items())
        )
        return replace(proof, motions=len(self.counts), unproven=tuple(unproven))


def chords_of(durations: Vector, pushes: Vector, slack: float) -> Chords:
    """Cut pieces of a motion so that two bodies leave their places on the chords by at most ``slack`` [m] together.

    Over a part of duration h no coordinate leaves its chord by more than an eighth of h^2 times its acceleration.

    Args:
        durations: Of the pieces [s], shape (m,).
        pushes: Largest acceleration of any point of the arm during each of them [m/s^2], shape (m,).
        slack: See above.
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
    """Prove the pieces of a motion, m of them; those that are not proven by chords are tried again with finer ones.

    Args:
        times: Of their ends [s], shape (m + 1,).
        pushes: See :func:`chords_of`.
        places: Configurations at times, shape (k,) to (k, dof).
        world: The world.
        clearance: To be kept from every obstacle [m].
        finer: How many of ``SLACKS`` have been tried.
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
    is_hopeful = world.prover.proven(q, q, clearance=clearance)  # where the motion itself is as near, no chord helps
    gaps = [gap for gap, hope in zip(proof.unproven, is_hopeful, strict=True) if not hope]
    to_refine = unproven[is_hopeful]

    for stretch in np.split(to_refine, np.flatnonzero(np.diff(to_refine) > 1) + 1) if len(to_refine) else ():
        first = int(stretch[0])
        end = int(stretch[-1]) + 1
        finer_proof = proof_by_chords(times[first : end + 1], pushes[first:end], places, world, clearance, finer + 1)
        gaps += [replace(gap, motion=first + gap.motion) for gap in finer_proof.unproven]

    return replace(proof, unproven=tuple(sorted(gaps, key=lambda gap: gap.motion)))
