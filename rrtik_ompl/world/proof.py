"""Proofs that whole motions are free: every configuration between two waypoints, not only samples of them.

The kernels (:mod:`rrtik_ompl.kernels.proof.proof_kernels`) share the description of the bodies with the checks that
planners use, and nothing else: they have forward kinematics and distances of their own, in float64.

Where the pieces of two links are too close to be proven apart, distances between their meshes are measured
(:mod:`rrtik_ompl.world.coal_proof`). Certificates of proven paths are made by
:mod:`rrtik_ompl.world.certificate_making`.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import ClassVar, TypeAlias

import numpy as np

from rrtik_ompl.base.arrays import Mask, Matrix, Vector, in_blocks
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.kept import kept_with
from rrtik_ompl.constraints.held_regions import HeldRegions
from rrtik_ompl.files import notice
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.geometry.collision.digests import world_digest
from rrtik_ompl.geometry.collision.solids import of_each
from rrtik_ompl.kernels.proof.layout import ProofTable
from rrtik_ompl.kernels.proof.packing import ProofPairs, proof_pairs
from rrtik_ompl.kernels.proof.rows import PROOF_KERNELS, proof_of_rows
from rrtik_ompl.kernels.proof.taken_proof import TakenProof
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.kernels.tables.solid_tables import convex_solids
from rrtik_ompl.model.certificate import Certificate, Route
from rrtik_ompl.model.proof import Gap, Proof
from rrtik_ompl.model.robot import Robot, all_inside_limits, inside_limits
from rrtik_ompl.world.arm_cache import Pairs, arm_cache, strokes
from rrtik_ompl.world.coal_proof import NOT_LOOKED_AT, PROVEN, CoalProof, distance_between, suggest_planes

LARGEST_VALUE = 1e3  # [rad] or [m], joint values up to which the rounding errors are bounded
# [m] Kernels that prove motions themselves keep this distance beyond ROOM, because others round in other places.
SPARE = 1e-10
MOTIONS_AT_ONCE = 64  # motions per kernel call; the clock and Ctrl-C are only looked at between calls
FEW_AT_ONCE = 4  # the same in numpy where the time is limited
MANY_PAIRS = 1000  # of convex pieces, whose motions take some hundredths of a second each to prove in numpy
FEW = 200  # number of configurations for which no proof table is made
Ends: TypeAlias = tuple[Matrix, Matrix]  # start and end configurations of motions, or joint values there


@dataclass(eq=False)
class Prover:
    """Prover of motions of an arm among bodies. It proves nothing where two fixed bodies touch.

    Attributes:
        robot, bodies, pairs: The geometry that the proofs refer to; ``pairs`` holds indices into ``bodies``.
        self_margin: Distance that links and attached objects keep from each other [m].
        always_colliding: Whether two bodies that never move touch.
        constraints: Path constraints that a motion must keep as well; None if there are none.
        tables: The kernels' tables, made when they are first needed.
        kin: An object shared by all provers that accept each other's proofs.
        bare: The prover of the same bodies without contacts, whose tables are the same but for a few numbers; None if
            there are no contacts, or if it is not known.
    """

    robot: Robot
    bodies: Sequence[Body]
    pairs: Pairs
    self_margin: float = 0.0
    always_colliding: bool = False
    constraints: HeldRegions | None = None
    tables: TakenProof = field(default_factory=TakenProof)
    kin: object = field(default_factory=object)
    bare: Prover | None = None
    _coal: CoalProof | None = None

    _fixed: ClassVar[bool] = True  # whether obstacles stay at their poses

    def for_thread(self) -> Prover:
        """Return the same prover for another thread."""
        bare = None if self.bare is None else self.bare.for_thread()
        return replace(self, tables=self.tables.for_thread(self.bodies), bare=bare, _coal=None)

    def holding(self, constraints: HeldRegions) -> Prover:
        """Return a prover of the same bodies that also requires path constraints; it does not accept earlier proofs."""
        return replace(self, constraints=constraints, kin=object())

    def exchanged(self, bodies: Sequence[Body], numbers: tuple[int, ...], *, always_colliding: bool) -> Prover:
        """Return the prover of a world in which some bodies are others; it takes over the table of this prover.

        Args:
            bodies: All bodies as they are now, as many as before.
            numbers: Indices of those that stand elsewhere or have another shape.
            always_colliding: Whether two bodies that never move touch.
        """
        # Tables that are shared with those without contacts are not changed.
        tables = self.tables.take(numbers) if self.bare is None else TakenProof()
        # Coal compares links and what they hold, wherever obstacles are.
        coal = self._coal if all(bodies[k].kind == "obstacle" for k in numbers) else None
        return replace(
            self, bodies=bodies, always_colliding=always_colliding, tables=tables, kin=object(), bare=None, _coal=coal
        )

    @property
    def digest(self) -> str:
        """Digest of the geometry that the proofs refer to, see :attr:`rrtik_ompl.model.proof.Proof.digest`."""
        return world_digest(self.robot, tuple(self.bodies), self.pairs)

    @cached_property
    def margin(self) -> float:
        """The least margin of the obstacles [m]; 0 without obstacles."""
        return min((body.margin for body in self.bodies if body.kind == "obstacle"), default=0.0)

    def route(self, rows: Matrix, *, clearance: float = 0.0, slack: float = 0.0, seconds: float | None = None) -> Proof:
        """Prove the motions between waypoints, shape (k, dof), free.

        Args:
            rows: The waypoints; a single one counts as a motion that stands still.
            clearance: Distance kept from obstacles on top of their margins [m].
            slack: Distance kept between all bodies in addition [m].
            seconds: Time limit [s]; None for none. Motions that were not examined by then count as not proven.

        Raises:
            InputError: If there are no waypoints.
        """
        if len(rows) == 0:
            raise InputError("waypoints of a proof: expected one configuration or more")
        rows = np.vstack([rows, rows]) if len(rows) == 1 else rows

        values = self._joint_values(rows)
        count = len(rows) - 1
        sound = self._sound(rows, values)
        ends_sound = None if sound is None else sound[:-1] & sound[1:]

        gaps = self._gaps((rows, rows[1:]), (values, values[1:]), ends_sound, (clearance, slack), seconds)
        measured_gaps = [replace(gap, _measure=partial(self._distance, rows, gap)) for gap in gaps]
        if self.constraints is not None:
            measured_gaps = self._with_breaches(self.constraints, rows, measured_gaps)
        return Proof(count, clearance, tuple(measured_gaps), self.margin, maker=self)

    def _with_breaches(self, constraints: HeldRegions, rows: Matrix, gaps: list[Gap]) -> list[Gap]:
        """Add a gap for each motion of a route that violates a path constraint and has no gap yet."""
        motions_with_gap = {gap.motion for gap in gaps}
        not_held = np.flatnonzero(~constraints.route_held(rows)).tolist()
        breaches = [
            Gap(k, float("nan"), constraints.why(rows[k], rows[k + 1]), "")
            for k in not_held
            if k not in motions_with_gap
        ]
        return sorted(gaps + breaches, key=lambda gap: gap.motion)

    def certificate(self, rows: Matrix, clearance: float) -> Certificate | None:
        """Return the certificate of a path, waypoints of shape (k, dof), for a clearance [m]; None if not proven."""
        if not self.route(rows, clearance=clearance).proven:
            return None
        from rrtik_ompl.world.certificate_making import certificate_of  # few need it, and it loads scipy

        return certificate_of(self, Route(rows), clearance)

    def proven(self, starts: Matrix, ends: Matrix, *, clearance: float = 0.0, slack: float = 0.0) -> Mask:
        """Return which motions starts[k] -> ends[k], shapes (m, dof), are proven free, shape (m,).

        ``clearance`` and ``slack`` [m] are as of :meth:`route`.
        """
        return in_blocks(partial(self._proven, (clearance, slack)), starts, ends)

    def _proven(self, distances: tuple[float, float], starts: Matrix, ends: Matrix) -> Mask:
        """As proven, for one block of motions."""
        if len(mask := np.ones(len(starts), dtype=bool)) == 0:
            return mask

        rows = np.concatenate([starts, ends])
        values = self._joint_values(rows)
        sound = self._sound(rows, values)
        ends_sound = None if sound is None else sound[: len(starts)] & sound[len(starts) :]

        gaps = self._gaps((starts, ends), (values, values[len(starts) :]), ends_sound, distances, None)
        if gaps:
            mask[[gap.motion for gap in gaps]] = False
        if self.constraints is not None:
            mask[mask] = self.constraints.motions_held(starts[mask], ends[mask])
        return mask

    def table(self, clearance: float) -> ProofTable:
        """Return the table for kernels that prove motions themselves, set to a clearance [m] until the next proof.

        The table keeps ``SPARE`` in addition, so that a proof of the reversed motion agrees. Separating planes that
        earlier proofs stored in it are cleared.
        """
        packed = self._packed_for(clearance, SPARE)
        packed.forget_planes()
        return packed.table

    def made(self, proof: Proof) -> bool:
        """Check whether a proof was made for these bodies, by this prover or its copy for another thread."""
        return isinstance(proof.maker, Prover) and proof.maker.kin is self.kin

    def settles(self, pair: int) -> bool:
        """Check whether coal may prove a pair of the table apart where the kernels do not."""
        return bool(self._coal_proof(self.packed()).links[pair])

    def prepare(self) -> None:
        """Make the tables, for a caller that has few configurations now and motions to prove later."""
        if not self.always_colliding:
            self.packed()

    def still_proven(self, rows: Matrix, *, clearance: float) -> Mask:
        """Return which configurations, shape (m, dof), are proven free with a clearance [m], shape (m,).

        As long as the proof table does not exist, no proof is tried for a few configurations (up to ``FEW``): making
        the table takes longer than checking them by coal.
        """
        mask = np.full(len(rows), self.tables.packed is not None or len(rows) > FEW)
        if mask.any():
            mask[[gap.motion for gap in self.still_gaps(rows, clearance=clearance)]] = False
        return mask

    def still_gaps(self, rows: Matrix, *, clearance: float) -> list[Gap]:
        """Return a gap for each configuration of rows, shape (m, dof), that is not proven free.

        Each configuration is treated as a motion that stands still; ``Gap.motion`` is its index.
        """
        values = self._joint_values(rows)
        return self._gaps((rows, rows), (values, values), self._sound(rows, values), (clearance, 0.0), None)

    def _distance(self, rows: Matrix, gap: Gap) -> float:
        """Return the distance [m] of the two bodies of a gap in a path, waypoints of shape (k, dof), at the gap."""
        q = rows[gap.motion] + np.nan_to_num(gap.share) * (rows[gap.motion + 1] - rows[gap.motion])
        return distance_between(self.robot, self.bodies, gap.pair, q)

    def _joint_values(self, rows: Matrix) -> Matrix:
        """Return the values of all joints of the chain, shape (m, joints), in C order as the kernels read them."""
        gain, offset, _ = _joints(self.robot)
        return np.asarray(rows @ gain + offset)

    def _sound(self, rows: Matrix, values: Matrix) -> Mask | None:
        """Return which configurations allow a sound proof, shape (m,); None if all do.

        They have to be inside the limits, and joint values must not exceed ``LARGEST_VALUE``, up to which rounding is
        bounded.
        """
        bounded = _joints(self.robot)[2] or np.abs(values).max(initial=0.0) <= LARGEST_VALUE
        if bounded and all_inside_limits(self.robot, rows):
            return None
        return np.asarray(inside_limits(self.robot, rows) & (np.abs(values) <= LARGEST_VALUE).all(axis=1))

    def _gaps(
        self, rows: Ends, values: Ends, sound: Mask | None, distances: tuple[float, float], seconds: float | None
    ) -> list[Gap]:
        """Return the motions that are not proven, each with the pair of bodies and the place where its proof failed.

        The kernels try all motions first, in batches. Motions that fail at two links of which one is a mesh are then
        tried again with coal's distances (:class:`CoalProof`).

        Args:
            rows: Start and end configurations, shapes (m or more, dof) and (m, dof).
            values: Values of all joints there, shapes (m or more, joints) and (m, joints).
            sound: Which motions allow a sound proof at both ends, shape (m,); None for all. See :meth:`_sound`.
            distances: Distances to keep [m]: the clearance from obstacles, and the slack between all bodies.
            seconds: Time limit [s]; None for none. Motions that were not examined by then count as not proven.
        """
        tails, heads = values
        count = len(heads)
        begin = time.monotonic()
        if self.always_colliding:
            return [Gap(k, float("nan"), "", "") for k in range(count)]

        packed = self._packed_for(*distances)
        pairs = np.full(count, NOT_LOOKED_AT, dtype=np.int32)
        places = np.full(count, np.nan)
        prove = proof_of_rows(packed, tails, heads, pairs, places)

        # Let the kernels prove all motions in batches, as long as there is time.
        if packed.touching:
            packed.forget_planes()
        left = count
        at_once = MOTIONS_AT_ONCE if seconds is None or library(PROOF_KERNELS) is not None else FEW_AT_ONCE
        for first in range(0, count, at_once):
            if first > 0 and seconds is not None and time.monotonic() - begin > seconds:
                break
            number = min(at_once, count - first)
            left -= number - prove(first, number)
        if left == 0 and sound is None:
            return []

        # A proof outside the bound on rounding errors does not count.
        if sound is not None:
            pairs[~sound] = NOT_LOOKED_AT
            places[~sound] = np.nan
        elif (pairs == PROVEN).all():
            return []

        # Try the motions that failed again: at bodies in contact with the normals there, at a pair of links with coal's
        # distances. No motion begins with planes of another one, so that its proof does not depend on these.
        by_coal = self._coal_proof(packed)
        again = by_coal.links.copy()
        again[packed.touching] = True
        for k in (k for k in np.flatnonzero(pairs >= 0).tolist() if again[pairs[k]]):
            motion = np.stack([rows[0][k], rows[1][k]])
            packed.forget_planes()
            if pairs[k] in packed.touching:
                suggest_planes(self.robot, self.bodies, packed, motion)
                prove(k, 1)
            if pairs[k] >= 0 and by_coal.links[pairs[k]]:
                part_proven = partial(_part_proven, packed, tails[k], heads[k])
                by_coal.settle(motion, pairs[k : k + 1], places[k : k + 1], partial(prove, k, 1), part_proven)
        return [self._gap(packed, k, int(pairs[k]), float(places[k])) for k in np.flatnonzero(pairs != PROVEN).tolist()]

    def _packed_for(self, clearance: float, slack: float) -> ProofPairs:
        """Return the table, set to the clearance and the slack that proofs have to keep [m]."""
        packed = self.packed()
        packed.keep(clearance, slack)
        return packed

    def packed(self) -> ProofPairs:
        """Return the table; that of bodies in contact stands in the memory of the one without contacts."""
        if self.bare is None:
            return self.tables.get(self.bodies, self._new_table)
        return self.tables.beside(self.bare.packed(), self.bodies)

    def _coal_proof(self, packed: ProofPairs) -> CoalProof:
        """Return the prover by coal for a table. It compares links alone, so it is kept wherever obstacles move."""
        if self._coal is None or self._coal.packed is not packed:
            self._coal = CoalProof(self.robot, self.bodies, packed)
        return self._coal

    def _new_table(self) -> ProofPairs:
        bodies = tuple(self.bodies)
        known = arm_cache(self.robot)
        of_same_kind = known.proof_table(bodies, self.pairs) if self._fixed else None
        if of_same_kind is not None:
            return of_same_kind

        solids = of_each((body.geometry for body in bodies), convex_solids)
        table = proof_pairs(
            self.robot.chain,
            bodies,
            self.pairs,
            solids,
            strokes(self.robot),
            fixed=self._fixed,
            cells=known.cells(bodies, self.pairs),
            links=known.links_of(bodies),
        )
        if self._fixed:
            known.keep_proof(bodies, self.pairs, table)
        if len(table.bodies) > MANY_PAIRS and library(PROOF_KERNELS) is None:
            notice.warn_of_minutes("proofs for an arm of so many pieces")
        return table

    def _gap(self, packed: ProofPairs, motion: int, pair: int, place: float) -> Gap:
        if pair < 0:
            return Gap(motion, float("nan"), "", "")
        return Gap(motion, place, *(self.bodies[k].name for k in packed.bodies[pair].tolist()))


def _part_proven(packed: ProofPairs, tail: Vector, head: Vector, begin: float, end: float) -> bool:
    """Check whether kernels prove the part of a motion, joint values of shape (joints,), between two shares of it."""
    starts = (tail + begin * (head - tail))[None]
    ends = (tail + end * (head - tail))[None]
    pair = np.zeros(1, dtype=np.int32)  # a name keeps it alive: the kernel only knows where it is
    place = np.zeros(1)
    return proof_of_rows(packed, starts, ends, pair, place)(0, 1) == 0


@kept_with
def _joints(robot: Robot) -> tuple[Matrix, Vector, bool]:
    """Return the affine map from configurations to joint values, and whether the limits bound these.

    Returns:
        Gain, shape (dof, joints), and offset, shape (joints,), with ``values = q @ gain + offset``; whether the limits
        keep all joint values below half of ``LARGEST_VALUE``.
    """
    gain = np.ascontiguousarray(robot.chain.gain.T)
    limits = np.stack([robot.lower, robot.upper])
    bounded = bool(np.isfinite(limits).all() and np.abs(robot.chain.joint_values(limits)).max() < 0.5 * LARGEST_VALUE)
    return gain, robot.chain.offset, bounded
