"""Straight motions that stand for curved ones in a proof: parts so short that nothing leaves them far."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.model.proof import Proof
from rrtik_ompl.motion.trajectory.cubics import even_parts
from rrtik_ompl.world.world import World

SLACKS = (1e-4, 1e-6, 1e-8)  # [m] by which two bodies together may leave their places on the chords, tried in turn


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
