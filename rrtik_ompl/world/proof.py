"""Proofs that whole motions are free: every configuration between two waypoints, not a sample of them.

The kernels (:mod:`rrtik_ompl.fast.proof.proof_kernels`) share the description of the bodies with the checks that
planners use, and nothing else: their forward kinematics are their own, in float64, and so are their distances.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Mask, Matrix
from rrtik_ompl.collision.bodies import Body
from rrtik_ompl.fast.proof.layout import ProofTable
from rrtik_ompl.fast.proof.packing import ProofPairs, proof_pairs
from rrtik_ompl.fast.simd.library import Library, library
from rrtik_ompl.fast.tables.solid_tables import convex_solids
from rrtik_ompl.robot import Robot
from rrtik_ompl.world.arm_cache import Pairs, strokes

LARGEST_VALUE = 1e3  # [rad] or [m] of a joint, up to which rounding is bounded
PROOF_KERNELS = "proof.proof_kernels"
MOTIONS_AT_ONCE = 64  # between two looks at the clock


@dataclass(frozen=True, slots=True)
class Gap:
    """A place on a motion that is not proven free.

    Attributes:
        motion: Number of the motion.
        share: Where on it, from 0 at its start to 1 at its end; nan if the whole motion was not looked at.
        first, second: Names of the two bodies that are not proven apart; "" if there was no time to look.
    """

    motion: int
    share: float
    first: str
    second: str

    def __str__(self) -> str:
        if not self.first:
            return f"motion {self.motion}: not looked at"
        return f"motion {self.motion} at {self.share:.4f} of it: '{self.first}' and '{self.second}'"


@dataclass(frozen=True, slots=True)
class Proof:
    """What is proven of the motions between waypoints.

    Attributes:
        motions: How many there are.
        clearance: What each keeps from every obstacle beside its margin [m].
        unproven: The places that are not proven, at most one of each motion.
    """

    motions: int
    clearance: float
    unproven: tuple[Gap, ...]

    @property
    def proven(self) -> bool:
        """Whether every motion is proven free."""
        return not self.unproven


class Prover:
    """Proofs of motions of an arm among bodies; without kernels it proves nothing."""

    def __init__(self, robot: Robot, bodies: tuple[Body, ...], pairs: Pairs) -> None:
        self._robot, self._bodies, self._pairs = robot, bodies, pairs
        self._packed: ProofPairs | None = None

    def gaps(
        self, starts: Matrix, ends: Matrix, *, clearance: float = 0.0, seconds: float | None = None
    ) -> dict[int, Gap]:
        """The motions starts[k] -> ends[k], shapes (m, dof), that are not proven, by their numbers.

        Args:
            starts: Inside the limits.
            ends: As many.
            clearance: To be kept from obstacles beside their margins [m].
            seconds: When to stop; None for never. What was not looked at by then is not proven.
        """
        begin = time.monotonic()
        kernels = library(PROOF_KERNELS)
        if kernels is None:
            return {k: Gap(k, float("nan"), "", "") for k in range(len(starts))}
        if self._packed is None:
            solids = [convex_solids(body.geometry) for body in self._bodies]
            self._packed = proof_pairs(self._robot.chain, self._bodies, self._pairs, solids, strokes(self._robot))
        self._packed.keep(clearance)
        tails, heads = (np.ascontiguousarray(self._robot.joint_values(rows)) for rows in (starts, ends))
        bounded = (np.abs(tails) <= LARGEST_VALUE).all(axis=1) & (np.abs(heads) <= LARGEST_VALUE).all(axis=1)
        pairs, places = np.full(len(tails), -2, dtype=np.int32), np.full(len(tails), np.nan)
        for first in range(0, len(tails), MOTIONS_AT_ONCE):
            if seconds is not None and first > 0 and time.monotonic() - begin > seconds:
                break
            part = slice(first, first + MOTIONS_AT_ONCE)
            self._prove(kernels, self._packed, tails[part], heads[part], pairs[part], places[part])
        open_ = np.flatnonzero((pairs != -1) | ~bounded)
        return {k: self._gap(k, int(pairs[k]), float(places[k])) for k in open_.tolist()}

    def _prove(
        self,
        kernels: Library,
        packed: ProofPairs,
        tails: Matrix,
        heads: Matrix,
        pairs: NDArray[np.int32],
        places: NDArray[np.float64],
    ) -> None:
        table = ProofTable(packed.table.address)
        starts, ends = tails.ctypes.data, heads.ctypes.data
        kernels.prove(table, starts, ends, len(tails), pairs.ctypes.data, places.ctypes.data)

    def _gap(self, motion: int, pair: int, place: float) -> Gap:
        if pair < 0 or self._packed is None:
            return Gap(motion, float("nan"), "", "")
        i, j = self._packed.bodies[pair].tolist()
        return Gap(motion, place, self._bodies[i].name, self._bodies[j].name)

    def proven(self, starts: Matrix, ends: Matrix, *, clearance: float = 0.0) -> Mask:
        """Which motions are proven free. Shape (m,)."""
        mask = np.ones(len(starts), dtype=bool)
        mask[list(self.gaps(starts, ends, clearance=clearance))] = False
        return mask
