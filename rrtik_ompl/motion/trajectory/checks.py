"""Check timed motions in a world: proofs of their pieces, and the faults of each piece.

In proofs curved motions are replaced by straight ones (chords), over parts so short that nothing moves far from them.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.model.proof import Gap, Proof
from rrtik_ompl.model.robot import all_inside_limits
from rrtik_ompl.motion.trajectory.cubics import State, even_parts
from rrtik_ompl.world.route_check import VERIFICATION_DENSITY, not_proven
from rrtik_ompl.world.world import World

# [m] Largest deviation of two bodies together from their places on the chords; tried in turn.
SLACKS = (3e-4, 1e-4, 1e-6, 1e-8)
MOST_TOGETHER = 64  # pieces of a motion that one chord stands for


class Curve(Protocol):
    """A motion in pieces between points in time: :class:`.cubics.Cubics` or :class:`.splines.Splines`."""

    @property
    def times(self) -> Vector:
        """Return the times of the points [s], shape (m,), increasing from 0."""

    @property
    def duration(self) -> float:
        """Return the time from the first to the last point [s]."""

    @property
    def positions(self) -> Matrix:
        """Return the positions at the points, shape (m, n) [rad or m]."""

    @property
    def smooth(self) -> bool:
        """Return whether its velocities do not jump between pieces."""

    def states(self, clock: Vector) -> State:
        """Return positions, velocities and accelerations at times [s], shape (k, n) each."""

    def greatest_speeds(self) -> Matrix:
        """Return upper bounds of the joints' speeds on each piece, shape (m - 1, n) [rad/s or m/s]."""

    def greatest_pushes(self, weights: Vector) -> Vector:
        """Return upper bounds of a weighted sum of the joints' accelerations on each piece, shape (n,) -> (m - 1,)."""


def faults_of(motion: Curve, world: World) -> list[tuple[float, str]]:
    """Return time [s] and reason of the first fault of each piece that has one; see :meth:`Trajectory.faults`."""
    clock = bad_moments(motion, world)
    rows = motion.states(clock).positions
    reasons = [world.explain(q) or not_proven(world.settings) for q in rows]
    return list(zip(clock.tolist(), reasons, strict=True))


def bad_moments(motion: Curve, world: World) -> Vector:
    """Return the times [s] of the first fault of each piece that has one, in order; see :meth:`Trajectory.faults`.

    For a piece that is only unproven, the time is that of its beginning.
    """
    h = np.diff(motion.times)
    travel = h * (motion.greatest_speeds() @ world.weights)
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


def proof_of_motion(motion: Curve, world: World, clearance: float | None = None) -> Proof:
    """Prove all pieces of a motion; see :meth:`Trajectory.prove`.

    Args:
        motion: The motion.
        world: The world.
        clearance: Distance to keep from obstacles [m]; None for what the world requires.
    """
    kept_clearance = world.settings.required_clearance if clearance is None else clearance
    return proof_of_pieces(motion, world, kept_clearance, np.arange(len(motion.times) - 1))


def proof_of_pieces(motion: Curve, world: World, clearance: float, pieces: NDArray[np.int64]) -> Proof:
    """Prove pieces of a motion by chords; those that remain unproven are tried again with shorter chords.

    Shorter chords are only tried if the motion itself, at the place of the gap, is far enough from everything.

    Args:
        motion: The motion.
        world: The world.
        clearance: Distance to keep from every obstacle [m].
        pieces: Numbers of the pieces, ascending, shape (m,).

    Returns:
        The proof; its motions are these pieces, numbered from 0.
    """
    begins = motion.times[pieces]
    durations = motion.times[pieces + 1] - begins
    pushes = motion.greatest_pushes(world.weights)[pieces]
    gaps: list[Gap] = []
    left = _not_proven_together(motion, world, clearance, pieces, pushes)
    if len(left) == 0:
        return Proof(len(pieces), clearance, (), world.prover.margin, maker=world.prover)

    for slack in SLACKS:
        chords = chords_of(durations[left], pushes[left], slack)
        proof = _proof_of_chords(motion, world, clearance, slack, chords, pieces[left])
        found = [replace(gap, motion=int(left[gap.motion])) for gap in proof.unproven]
        left = np.array([gap.motion for gap in found], dtype=np.int64)
        if len(found) == 0 or slack == SLACKS[-1]:
            gaps += found
            break
        # If the motion itself is too near to something, shorter chords cannot help.
        shares = np.nan_to_num([gap.share for gap in found])
        rows = motion.states(begins[left] + shares * durations[left]).positions
        is_hopeful = world.prover.proven(rows, rows, clearance=clearance)
        gaps += [gap for gap, hope in zip(found, is_hopeful, strict=True) if not hope]
        left = left[is_hopeful]
        if len(left) == 0:
            break

    return replace(proof, motions=len(pieces), unproven=tuple(sorted(gaps, key=lambda gap: gap.motion)))


def _not_proven_together(
    motion: Curve, world: World, clearance: float, pieces: NDArray[np.int64], pushes: Vector
) -> NDArray[np.int64]:
    """Prove neighbouring pieces by one chord for many of them, and return the ascending indices of those left open.

    A curve has a piece each millisecond, of which some dozens together hardly leave a chord.

    Args:
        motion: The motion.
        world: The world.
        clearance: Distance to keep from every obstacle [m].
        pieces: Numbers of the pieces, ascending, shape (m,).
        pushes: Largest acceleration of any point of the arm during each piece [m/s^2], shape (m,).
    """
    number = np.arange(len(pieces))
    times = motion.times
    longest = float((times[1:] - times[:-1])[pieces].max(initial=0.0))
    strongest = float(pushes.max(initial=0.0))
    together = int(min(MOST_TOGETHER, 2.0 * np.sqrt(SLACKS[0] / max(strongest, 1e-12)) / max(longest, 1e-12)))
    if together < 2 or not motion.smooth or world.constraints is not None:
        return number

    # Only the ends of chords are compared with limits and constraints, so the knots between them are looked at here.
    knots = motion.positions
    if not all_inside_limits(world.robot, knots):
        return number

    begins_stretch = np.ones(len(pieces), dtype=bool)
    begins_stretch[1:] = pieces[1:] - pieces[:-1] > 1
    place = number - np.maximum.accumulate(np.where(begins_stretch, number, 0))
    begins = place % together == 0
    ends = np.ones(len(pieces), dtype=bool)
    ends[:-1] = begins[1:]
    is_end = np.zeros(len(times), dtype=bool)
    is_end[pieces[begins]] = True
    is_end[pieces[ends] + 1] = True

    rows = np.flatnonzero(is_end)
    proof = world.prover.route(knots[rows], clearance=clearance, slack=SLACKS[0])
    if proof.proven:
        return np.empty(0, dtype=np.int64)
    is_open = np.isin(rows.searchsorted(pieces[begins]), [gap.motion for gap in proof.unproven])
    return np.flatnonzero(is_open[np.cumsum(begins) - 1])


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


def _proof_of_chords(
    motion: Curve, world: World, clearance: float, slack: float, chords: Chords, pieces: NDArray[np.int64]
) -> Proof:
    """Prove the chords of pieces, shape (m,), with a slack; one call for all of them.

    Where a piece does not follow the one before it, the chord that leads there is none of the motion's and not counted.
    """
    own = pieces[chords.pieces]
    ends_stretch = np.append(own[1:] > own[:-1] + 1, True)
    row_of = np.arange(len(own))
    row_of[1:] += ends_stretch[:-1].cumsum()  # behind each stretch there is a row for its end
    clock = np.empty(row_of[-1] + 2)
    begins = motion.times[own]
    clock[row_of] = begins + chords.shares * (motion.times[own + 1] - begins)
    clock[row_of[ends_stretch] + 1] = motion.times[own[ends_stretch] + 1]
    part_of = np.full(len(clock), -1)
    part_of[row_of] = np.arange(len(own))

    proof = world.prover.route(motion.states(clock).positions, clearance=clearance, slack=slack)
    unproven = (replace(gap, motion=int(part_of[gap.motion])) for gap in proof.unproven if part_of[gap.motion] >= 0)
    return chords.joined(replace(proof, unproven=tuple(unproven)))
