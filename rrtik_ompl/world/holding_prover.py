"""Proofs that motions are free and also keep path constraints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rrtik_ompl.base.arrays import Mask, Matrix
from rrtik_ompl.constraints.held_regions import HeldRegions
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.kernels.proof.packing import ProofPairs
from rrtik_ompl.world.proof import Gap, Proof, Prover


class HoldingProver(Prover):
    """Proofs that motions are free and held; its proofs are not those of the prover that it is made of.

    Attributes:
        free: That prover.
    """

    def __init__(self, prover: Prover, constraints: HeldRegions) -> None:
        vars(self).update(vars(prover))
        self.free, self._constraints, self._kin = prover, constraints, object()

    def for_thread(self) -> HoldingProver:
        """The same prover for another thread."""
        other = HoldingProver(self.free.for_thread(), self._constraints)
        other._kin = self._kin
        return other

    def moved(self, bodies: Sequence[Body], numbers: tuple[int, ...], *, always_colliding: bool) -> HoldingProver:
        """The prover of a world in which some bodies stand elsewhere; see :meth:`Prover.moved`."""
        free = self.free.moved(bodies, numbers, always_colliding=always_colliding)
        return HoldingProver(free, self._constraints)

    def route(self, rows: Matrix, *, clearance: float = 0.0, slack: float = 0.0, seconds: float | None = None) -> Proof:
        """Prove the motions between waypoints, shape (k, dof), free and held; see :meth:`Prover.route`."""
        proof = super().route(rows, clearance=clearance, slack=slack, seconds=seconds)
        known = {gap.motion for gap in proof.unproven}
        left = np.flatnonzero(~self._constraints.route_held(rows))
        gaps = [Gap(k, float("nan"), self._constraints.why(rows[k], rows[k + 1]), "") for k in left.tolist()]
        fresh = (gap for gap in gaps if gap.motion not in known)
        return replace(proof, unproven=tuple(sorted((*proof.unproven, *fresh), key=lambda gap: gap.motion)))

    def proven(self, starts: Matrix, ends: Matrix, *, clearance: float = 0.0) -> Mask:
        """Which motions, shapes (m, dof), are proven free and held, shape (m,)."""
        mask = super().proven(starts, ends, clearance=clearance)
        mask[mask] = self._constraints.motions_held(starts[mask], ends[mask])
        return mask

    def _packed_for(self, clearance: float, slack: float) -> ProofPairs:
        return self.free._packed_for(clearance, slack)
