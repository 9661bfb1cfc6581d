"""A form of a world whose configurations and motions must also keep path constraints."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.arrays import Mask, Matrix
from rrtik_ompl.constraints.held_regions import HeldRegions, held_regions
from rrtik_ompl.fast import FastWorld
from rrtik_ompl.fast.proof.packing import ProofPairs
from rrtik_ompl.fast.search.motions.motion_table import FastMotions, motions_of
from rrtik_ompl.scene import Scene
from rrtik_ompl.world import Gap, Proof, World
from rrtik_ompl.world.proof import Prover


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


class HoldingWorld(World):
    """A world with path constraints; it shares everything else with the world that it is made of.

    Free is what is free there and held (:class:`HeldRegions`): for checks, for the second check of a path and for
    proofs. Searches in kernels that know no constraints find no tables here; those that do read :attr:`free_motions`.

    Attributes:
        constraints: What is held.
    """

    def __init__(self, world: World, constraints: HeldRegions) -> None:
        vars(self).update(vars(world))
        self.constraints = constraints
        self.prover = HoldingProver(world.prover, constraints)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.unheld, self.constraints)

    @property
    def fast(self) -> FastWorld | None:
        """None: the kernels of other searches know nothing of constraints."""
        return None

    @property
    def motions(self) -> FastMotions | None:
        """None, as :attr:`fast`."""
        return None

    @property
    def unheld(self) -> World:
        """The same world without constraints."""
        other: World = object.__new__(World)
        vars(other).update({key: value for key, value in vars(self).items() if key != "constraints"})
        other.prover = cast(HoldingProver, self.prover).free
        return other

    @property
    def free_motions(self) -> FastMotions | None:
        """How kernels check motions for collisions alone; None where they cannot."""
        free = self.unheld
        free._proven_clearance = None  # what a search finds is proven afterwards
        return motions_of(free, self._motions)

    def with_scene(self, scene: Scene) -> HoldingWorld:
        """A world of the same robot in another scene, with the same constraints."""
        return self._holding(super().with_scene(scene))

    def moved(self, name: str, pose: ArrayLike | pin.SE3) -> HoldingWorld:
        """The world in which an obstacle stands elsewhere; see :meth:`World.moved`."""
        return self._holding(self.unheld.moved(name, pose))

    def _holding(self, world: World) -> HoldingWorld:
        regions = [each.region for each in self.constraints.regions]
        return HoldingWorld(world, held_regions(self.robot, world.scene, regions, None))

    def explain(self, q: ArrayLike) -> str:
        """A line that says why q is not valid: see :meth:`World.explain`; or the constraint that it breaks."""
        return super().explain(q) or self.constraints.explain(self._rows(q, 1)[0])

    def certify(self, Q: ArrayLike) -> Mask:
        """A second opinion on rows of Q, (m, dof) -> (m,); see :meth:`World.certify`."""
        mask: Mask = super().certify(Q) & self.constraints.held(self._rows(Q, 2))
        return mask

    def _free(self, rows: Matrix) -> Mask:
        mask = super()._free(rows)
        mask[mask] = self.constraints.held(rows[mask])
        return mask

    def _motions_free(self, starts: Matrix, ends: Matrix) -> Mask:
        mask = super()._motions_free(starts, ends)
        mask[mask] = self.constraints.motions_held(starts[mask], ends[mask])
        return mask
