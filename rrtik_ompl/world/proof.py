"""Proofs that whole motions are free: every configuration between two waypoints, not a sample of them.

The kernels (:mod:`rrtik_ompl.fast.proof.proof_kernels`) share the description of the bodies with the checks that
planners use, and nothing else: their forward kinematics are their own, in float64, and so are their distances.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from rrtik_ompl.arrays import Mask, Matrix
from rrtik_ompl.collision.bodies import Body
from rrtik_ompl.collision.digests import world_digest
from rrtik_ompl.errors import InputError
from rrtik_ompl.fast.proof.layout import WAYS, ProofTable
from rrtik_ompl.fast.proof.log import ProofLog, logged
from rrtik_ompl.fast.proof.packing import ProofPairs, proof_pairs
from rrtik_ompl.fast.simd.library import library
from rrtik_ompl.fast.tables.solid_tables import convex_solids
from rrtik_ompl.robot import Robot
from rrtik_ompl.world.arm_cache import Pairs, strokes

LARGEST_VALUE = 1e3  # [rad] or [m] of a joint, up to which rounding is bounded
PROOF_KERNELS = "proof.proof_kernels"
SPARE = 1e-10  # [m] that a proof which is written down keeps beyond ROOM: who verifies it rounds in other places
MOTIONS_AT_ONCE = 64  # in one call of the kernel, between two looks at the clock; Ctrl-C waits no longer
FEW = 200  # configurations
PROVEN, NOT_LOOKED_AT = -1, -2  # in the place of a pair's number
DOUBLE, INT = 8, 4  # bytes of a number


@dataclass(frozen=True, slots=True)
class Gap:
    """A place on a motion that is not proven free.

    Attributes:
        motion: Number of the motion.
        share: Where on it, from 0 at its start to 1 at its end; nan if the whole motion was not looked at.
        first, second: Names of the two bodies that are not proven apart. Without a second one, the first says what else
            is wrong; both are "" if there was no time to look.
    """

    motion: int
    share: float
    first: str
    second: str

    def __str__(self) -> str:
        if not self.second:
            return f"motion {self.motion}: {self.first or 'not looked at'}"
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
    _digest: Callable[[], str] = field(default=str, repr=False, compare=False)

    def __reduce__(self) -> tuple[Any, ...]:
        return Proof, (self.motions, self.clearance, self.unproven, partial(str, self.digest))

    @property
    def digest(self) -> str:
        """Of the robot's and the scene's geometry that the motions are proven for: 32 digits in hexadecimal."""
        return self._digest()

    @property
    def proven(self) -> bool:
        """Whether every motion is proven free."""
        return not self.unproven


class Prover:
    """Proofs of motions of an arm among bodies; without kernels, or where bodies always touch, it proves nothing."""

    def __init__(self, robot: Robot, bodies: tuple[Body, ...], pairs: Pairs, *, always_colliding: bool = False) -> None:
        self._robot, self._bodies, self._pairs = robot, bodies, pairs
        self._always_colliding = always_colliding
        self._gain, self._offset = np.ascontiguousarray(robot.chain.gain.T), robot.chain.offset
        ends = np.stack([robot.lower, robot.upper])
        finite = bool(np.isfinite(ends).all())
        self._bounded = finite and bool((np.abs(robot.joint_values(ends)) < 0.5 * LARGEST_VALUE).all())
        self._packed: ProofPairs | None = None
        self._digest = partial(world_digest, robot, bodies, pairs)

    def route(self, rows: Matrix, *, clearance: float = 0.0, slack: float = 0.0, seconds: float | None = None) -> Proof:
        """Prove the motions between waypoints, shape (k, dof).

        Args:
            rows: The waypoints; a single one counts as a motion that stands still.
            clearance: To be kept from obstacles beside their margins [m].
            slack: To be kept between all bodies beside that [m].
            seconds: When to stop; None for never. What was not looked at by then is not proven.

        Raises:
            InputError: If there are no waypoints.
        """
        if len(rows) == 0:
            raise InputError("waypoints of a proof: expected one configuration or more")
        rows = np.vstack([rows, rows]) if len(rows) == 1 else rows
        values, count = self._joint_values(rows), len(rows) - 1
        sound = self._sound(rows, values)
        between = None if sound is None else sound[:-1] & sound[1:]
        gaps = self._gaps(values, values[1:], between, (clearance, slack), seconds)
        return Proof(count, clearance, tuple(gaps), self._digest)

    def logged(self, rows: Matrix, *, clearance: float = 0.0) -> list[ProofLog] | None:
        """By what each motion between waypoints, shape (k, dof), is proven; None if one of them is not."""
        values, kernels = self._joint_values(rows), library(PROOF_KERNELS)
        if kernels is None or not self.route(rows, clearance=clearance).proven:
            return None
        packed, told = self._packed_for(clearance, SPARE), []
        pair, place = np.zeros(1, dtype=np.int32), np.zeros(1)
        for k in range(len(rows) - 1):
            at = (values[k].ctypes.data, values[k + 1].ctypes.data, 1, pair.ctypes.data, place.ctypes.data)
            told.append(logged(packed, partial(kernels.prove, ProofTable(packed.table.address), *at)))
            if pair[0] != PROVEN:
                return None
        return told

    def proven(self, starts: Matrix, ends: Matrix, *, clearance: float = 0.0) -> Mask:
        """Which of the motions starts[k] -> ends[k], shapes (m, dof), are proven free. Shape (m,)."""
        mask = np.ones(len(starts), dtype=bool)
        if len(starts) == 0:
            return mask
        rows = np.concatenate([starts, ends])
        values = self._joint_values(rows)
        sound = self._sound(rows, values)
        both = None if sound is None else sound[: len(starts)] & sound[len(starts) :]
        mask[[gap.motion for gap in self._gaps(values, values[len(starts) :], both, (clearance, 0.0), None)]] = False
        return mask

    def table(self, clearance: float) -> int:
        """Where the table is for kernels that prove motions of their own, with a clearance [m] until the next proof.

        They keep a little more than what is asked for, so that a proof from the other end of a motion agrees. Planes
        are forgotten, so that nothing depends on what was proven before.
        """
        packed = self._packed_for(clearance, SPARE)
        packed.table[WAYS][:] = 0.0
        return packed.table.address

    def made(self, proof: Proof) -> bool:
        """Whether a proof is one of these bodies, by this object."""
        return proof._digest is self._digest

    def still_proven(self, rows: Matrix) -> Mask:
        """Which configurations, shape (m, dof), are proven free. Shape (m,).

        Of a few none is, as long as the table is not made: that takes longer than coal needs for them.
        """
        mask = np.full(len(rows), self._packed is not None or len(rows) > FEW)
        if mask.any():
            mask[[gap.motion for gap in self.still_gaps(rows, clearance=0.0)]] = False
        return mask

    def still_gaps(self, rows: Matrix, *, clearance: float) -> list[Gap]:
        """The configurations, shape (m, dof), that are not proven free; each counts as a motion that stands still."""
        values = self._joint_values(rows)
        return self._gaps(values, values, self._sound(rows, values), (clearance, 0.0), None)

    def _joint_values(self, rows: Matrix) -> Matrix:
        """Values of every joint of the chain, shape (m, joints), row after row in memory."""
        values: Matrix = rows @ self._gain + self._offset
        return values

    def _sound(self, rows: Matrix, values: Matrix) -> Mask | None:
        """Which configurations are inside the limits and not too large for the bound on rounding; None for all."""
        inside = self._robot.within_limits(rows)
        if inside.all() and (self._bounded or np.abs(values).max(initial=0.0) <= LARGEST_VALUE):
            return None
        sound: Mask = inside & (np.abs(values) <= LARGEST_VALUE).all(axis=1)
        return sound

    def _gaps(
        self, tails: Matrix, heads: Matrix, sound: Mask | None, kept: tuple[float, float], seconds: float | None
    ) -> list[Gap]:
        """The motions from the first rows of joint values to as many others that are not proven.

        ``kept``: clearance and slack [m].
        """
        count, joints = heads.shape
        begin, kernels = time.monotonic(), library(PROOF_KERNELS)
        if kernels is None or self._always_colliding:
            return [Gap(k, float("nan"), "", "") for k in range(count)]
        packed = self._packed_for(*kept)
        pairs, places = np.full(count, NOT_LOOKED_AT, dtype=np.int32), np.full(count, np.nan)
        table = ProofTable(packed.table.address)
        at, found, where = (tails.ctypes.data, heads.ctypes.data), pairs.ctypes.data, places.ctypes.data
        looked, open_ = 0, 0
        for first in range(0, count, MOTIONS_AT_ONCE):
            if first > 0 and seconds is not None and time.monotonic() - begin > seconds:
                break
            skipped = DOUBLE * joints * first
            number = min(MOTIONS_AT_ONCE, count - first)
            sinks = (found + INT * first, where + DOUBLE * first)
            open_ += kernels.prove(table, at[0] + skipped, at[1] + skipped, number, *sinks)
            looked += number
        if sound is not None:
            pairs[~sound], places[~sound] = NOT_LOOKED_AT, np.nan
        elif open_ == 0 and looked == count:
            return []
        return [self._gap(packed, k, int(pairs[k]), float(places[k])) for k in np.flatnonzero(pairs != PROVEN).tolist()]

    def _packed_for(self, clearance: float, slack: float) -> ProofPairs:
        """The table, with a clearance and a slack to keep."""
        if self._packed is None:
            solids = [convex_solids(body.geometry) for body in self._bodies]
            self._packed = proof_pairs(self._robot.chain, self._bodies, self._pairs, solids, strokes(self._robot))
        self._packed.keep(clearance, slack)
        return self._packed

    def _gap(self, packed: ProofPairs, motion: int, pair: int, place: float) -> Gap:
        if pair < 0:
            return Gap(motion, float("nan"), "", "")
        i, j = packed.bodies[pair].tolist()
        return Gap(motion, place, self._bodies[i].name, self._bodies[j].name)
