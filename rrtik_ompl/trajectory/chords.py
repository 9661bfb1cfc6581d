"""Straight motions that stand for curved ones in a proof: parts so short that nothing leaves them far."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Vector
from rrtik_ompl.trajectory.cubics import even_parts
from rrtik_ompl.world import Proof

CHORD_SLACK = 1e-4  # [m] by which two bodies together may leave their places on the chords


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
        return Proof(len(self.counts), proof.clearance, tuple(unproven))


def chords_of(durations: Vector, pushes: Vector) -> Chords:
    """Cut pieces of a motion so that two bodies leave their places on the chords by at most ``CHORD_SLACK`` together.

    Over a part of duration h no coordinate leaves its chord by more than an eighth of h^2 times its acceleration.

    Args:
        durations: Of the pieces [s], shape (m,).
        pushes: Largest acceleration of any point of the arm during each of them [m/s^2], shape (m,).
    """
    counts = np.maximum(np.ceil(durations * np.sqrt(0.25 * pushes / CHORD_SLACK)), 1.0).astype(np.int64)
    return Chords(counts, *even_parts(counts))
