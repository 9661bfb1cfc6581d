"""Proofs that whole motions are free: every configuration between two waypoints, not a sample of them.

The kernels (:mod:`rrtik_ompl.kernels.proof.proof_kernels`) share the description of the bodies with the checks that
planners use, and nothing else: their forward kinematics are their own, in float64, and so are their distances.

Between bodies in contact, which overlap, there is no plane that a search for their distance would find, but a proof
needs none that parts them: one beyond which neither reaches deeper than it may. Coal knows that one, by the normal of
the contact, and :func:`suggest_planes` lets the kernels try it first.

Two links whose convex pieces stick out of their meshes are proven apart by coal's distances where kernels cannot
(:class:`CoalProof`), after Schwarzer, Saha and Latombe [16]: bodies whose distance at one place of a motion is larger
than what they can approach each other on an interval around it are apart in all of that interval. Coal knows surfaces
alone: whether one body is wholly inside another is asked once a motion, for a closed surface that is never met keeps
what is inside.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, partial
from typing import ClassVar, TypeAlias

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector, frozen, in_blocks
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.constraints.held_regions import HeldRegions
from rrtik_ompl.geometry.collision.bodies import DISTANCE_TOLERANCE, Body
from rrtik_ompl.geometry.collision.cloud_solid import CloudSolid
from rrtik_ompl.geometry.collision.containment import Containment
from rrtik_ompl.geometry.collision.digests import robot_digest, scene_digest, world_digest
from rrtik_ompl.geometry.collision.distances import measured
from rrtik_ompl.geometry.collision.motion_bound import approach_weights
from rrtik_ompl.geometry.collision.solids import around, is_closed, is_mesh, of_each
from rrtik_ompl.kernels.proof import layout
from rrtik_ompl.kernels.proof.layout import ProofTable
from rrtik_ompl.kernels.proof.log import logged
from rrtik_ompl.kernels.proof.packing import ProofPairs, proof_pairs
from rrtik_ompl.kernels.proof.taken_proof import TakenProof
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.kernels.tables.solid_tables import convex_solids
from rrtik_ompl.model.certificate import Certificate, MotionEntries
from rrtik_ompl.model.proof import Gap, Proof
from rrtik_ompl.model.robot import Robot, inside_limits
from rrtik_ompl.world.arm_cache import MAX_ROBOTS, Pairs, strokes

LARGEST_VALUE = 1e3  # [rad] or [m] of a joint, up to which rounding is bounded
PROOF_KERNELS = "proof.proof_kernels"
SPARE = 1e-10  # [m] that a proof which is written down keeps beyond ROOM: who verifies it rounds in other places
MOTIONS_AT_ONCE = 64  # in one call of the kernel, between two looks at the clock; Ctrl-C waits no longer
FEW = 200  # configurations
PROVEN, NOT_LOOKED_AT = -1, -2  # in the place of a pair's number
MOST_DISTANCES = 400  # distances for a pair in one motion: some tenths of a second
DEEPEST_LEVEL = 9  # level of an interval: 1/512 of a motion
APPROACH_SPARE = 1.01  # of the way that bodies come nearer: who verifies it may bound that by other balls
FAR_APART = 1e6  # [m]; what may overlap by that is apart
DOUBLE, INT = 8, 4  # bytes of a number
Numbers: TypeAlias = NDArray[np.int32]
Told: TypeAlias = tuple[MotionEntries, NDArray[np.int64]]  # by kernels; links and intervals that coal measured
Ends: TypeAlias = tuple[Matrix, Matrix]  # where motions begin, and where they end


@dataclass(eq=False)
class Prover:
    """Proofs of motions of an arm among bodies; without kernels, or where bodies always touch, it proves nothing.

    Attributes:
        robot, bodies, pairs: What the proofs are about.
        self_margin: What links, and what they hold, keep from each other [m].
        always_colliding: Whether two bodies touch that never move.
        constraints: What a motion must keep too; None if nothing.
        tables: What the kernels read, once something is to be proven.
        kin: The same object for all provers that take each other's proofs for their own.
    """

    robot: Robot
    bodies: Sequence[Body]
    pairs: Pairs
    self_margin: float = 0.0
    always_colliding: bool = False
    constraints: HeldRegions | None = None
    tables: TakenProof = field(default_factory=TakenProof)
    kin: object = field(default_factory=object)
    _coal: CoalProof | None = None

    _fixed: ClassVar[bool] = True  # whether obstacles stay where they are

    def for_thread(self) -> Prover:
        """Return the same prover for another thread."""
        return replace(self, tables=self.tables.for_thread(self.bodies), _coal=None)

    def holding(self, constraints: HeldRegions) -> Prover:
        """Return the prover of the same bodies for motions that keep path constraints; its proofs are others."""
        return replace(self, constraints=constraints, kin=object())

    def moved(self, bodies: Sequence[Body], numbers: tuple[int, ...], *, always_colliding: bool) -> Prover:
        """Return the prover of a world in which some bodies stand elsewhere; it takes over this one's table.

        Args:
            bodies: All of them, where they stand now.
            numbers: Of those that stand elsewhere.
            always_colliding: Whether two that never move touch.
        """
        tables = self.tables.take(numbers)
        return replace(self, bodies=bodies, always_colliding=always_colliding, tables=tables, kin=object())

    @property
    def digest(self) -> str:
        """Of the geometry that its proofs are about, see :attr:`rrtik_ompl.model.proof.Proof.digest`."""
        return world_digest(self.robot, tuple(self.bodies), self.pairs)

    @cached_property
    def margin(self) -> float:
        """The least margin of the obstacles [m]; 0 without obstacles."""
        return min((body.margin for body in self.bodies if body.kind == "obstacle"), default=0.0)

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
        """Return the gaps of a route, and a gap for each other motion of it that is not held."""
        motions_with_gap = {gap.motion for gap in gaps}
        not_held = np.flatnonzero(~constraints.route_held(rows)).tolist()
        breaches = [
            Gap(k, float("nan"), constraints.why(rows[k], rows[k + 1]), "")
            for k in not_held
            if k not in motions_with_gap
        ]
        return sorted(gaps + breaches, key=lambda gap: gap.motion)

    def certificate(self, rows: Matrix, clearance: float) -> Certificate | None:
        """Return the certificate of a path, waypoints of shape (k, dof), for a clearance [m].

        Returns:
            None if not every motion is proven.

        Raises:
            InputError: If the scene has a cloud.
        """
        if clouds := [body.name for body in self.bodies if isinstance(body.geometry, CloudSolid)]:
            raise InputError(
                f"a certificate names planes of solids, and '{clouds[0]}' is a cloud; plan.proven says as much"
            )

        logs = self.logged(np.vstack([rows, rows]) if len(rows) == 1 else rows, clearance=clearance)
        if logs is None:
            return None

        digests = robot_digest(self.robot), scene_digest(tuple(self.bodies), self.pairs)
        motions = tuple(_entries(*each) for each in logs)
        return Certificate(self.robot.name, *digests, clearance, self.self_margin, frozen(rows), motions)

    def logged(self, rows: Matrix, *, clearance: float = 0.0) -> list[Told] | None:
        """By what each motion between waypoints, shape (k, dof), is proven; None if one of them is not."""
        values = self._joint_values(rows)
        kernels = library(PROOF_KERNELS)
        if kernels is None or not self.route(rows, clearance=clearance).proven:
            return None

        packed = self._packed_for(clearance, SPARE)
        by_coal = CoalProof(self.robot, self.bodies, packed)
        logs = list[Told]()
        pair = np.zeros(1, dtype=np.int32)
        place = np.zeros(1)

        for k in range(len(rows) - 1):
            arguments = (values[k].ctypes.data, values[k + 1].ctypes.data, 1, pair.ctypes.data, place.ctypes.data)
            run = partial(kernels.prove, packed.table.address, *arguments)
            if packed.touching:
                suggest_planes(self.robot, self.bodies, packed, rows[k : k + 2])
            logs.append(by_coal.logged(rows[k : k + 2], pair, place, run))
            if pair[0] != PROVEN:
                return None
        return logs

    def proven(self, starts: Matrix, ends: Matrix, *, clearance: float = 0.0) -> Mask:
        """Return which of the motions starts[k] -> ends[k], shapes (m, dof), are proven free. Shape (m,)."""
        return in_blocks(partial(self._proven, clearance), starts, ends)

    def _proven(self, clearance: float, starts: Matrix, ends: Matrix) -> Mask:
        if len(mask := np.ones(len(starts), dtype=bool)) == 0:
            return mask

        rows = np.concatenate([starts, ends])
        values = self._joint_values(rows)
        sound = self._sound(rows, values)
        ends_sound = None if sound is None else sound[: len(starts)] & sound[len(starts) :]

        gaps = self._gaps((starts, ends), (values, values[len(starts) :]), ends_sound, (clearance, 0.0), None)
        mask[[gap.motion for gap in gaps]] = False
        if self.constraints is not None:
            mask[mask] = self.constraints.motions_held(starts[mask], ends[mask])
        return mask

    def table(self, clearance: float) -> ProofTable:
        """Return the table for kernels that prove motions of their own, with a clearance [m] until the next proof.

        They keep a little more, so that a proof from the other end of a motion agrees, and forget earlier planes.
        """
        packed = self._packed_for(clearance, SPARE)
        packed.table.ways[:] = 0.0
        return packed.table

    def made(self, proof: Proof) -> bool:
        """Check whether a proof is one of these bodies, by this object or its like for another thread."""
        return isinstance(proof.maker, Prover) and proof.maker.kin is self.kin

    def still_proven(self, rows: Matrix, *, clearance: float) -> Mask:
        """Return which configurations, shape (m, dof), are proven free, with a clearance [m]. Shape (m,).

        Of a few none is, as long as the table is not made: that takes longer than coal needs for them.
        """
        mask = np.full(len(rows), self.tables.packed is not None or len(rows) > FEW)
        if mask.any():
            mask[[gap.motion for gap in self.still_gaps(rows, clearance=clearance)]] = False
        return mask

    def still_gaps(self, rows: Matrix, *, clearance: float) -> list[Gap]:
        """The configurations, shape (m, dof), that are not proven free; each counts as a motion that stands still."""
        values = self._joint_values(rows)
        return self._gaps((rows, rows), (values, values), self._sound(rows, values), (clearance, 0.0), None)

    def _distance(self, rows: Matrix, gap: Gap) -> float:
        """How far the two bodies of a gap in the route through waypoints, shape (k, dof), are apart there [m]."""
        q = rows[gap.motion] + np.nan_to_num(gap.share) * (rows[gap.motion + 1] - rows[gap.motion])
        return distance_between(self.robot, self.bodies, gap.pair, q)

    def _joint_values(self, rows: Matrix) -> Matrix:
        """Return values of every joint of the chain, shape (m, joints), row after row in memory."""
        gain, offset, _ = _joints(self.robot)
        return np.asarray(rows @ gain + offset)

    def _sound(self, rows: Matrix, values: Matrix) -> Mask | None:
        """Which configurations are inside the limits and not too large for the bound on rounding; None for all."""
        within_limits = inside_limits(self.robot, rows)
        if within_limits.all() and (_joints(self.robot)[2] or np.abs(values).max(initial=0.0) <= LARGEST_VALUE):
            return None
        return np.asarray(within_limits & (np.abs(values) <= LARGEST_VALUE).all(axis=1))

    def _gaps(
        self, rows: Ends, values: Ends, sound: Mask | None, distances: tuple[float, float], seconds: float | None
    ) -> list[Gap]:
        """Return the motions that are not proven.

        Args:
            rows: Where they begin and where they end, shapes (m or more, dof) and (m, dof).
            values: Of all joints there, shapes (m or more, joints) and (m, joints).
            sound: For which motions the bound on rounding holds at both ends, shape (m,); None for all.
            distances: To be kept [m]: the clearance, and the slack between all bodies.
            seconds: When to stop; None for never. What was not looked at by then is not proven.
        """
        tails, heads = values
        count, joints = heads.shape
        begin = time.monotonic()
        kernels = library(PROOF_KERNELS)
        if kernels is None or self.always_colliding:
            return [Gap(k, float("nan"), "", "") for k in range(count)]

        packed = self._packed_for(*distances)
        by_coal = self._coal_proof(packed)
        address = packed.table.address
        pairs = np.full(count, NOT_LOOKED_AT, dtype=np.int32)
        places = np.full(count, np.nan)
        read = tails.ctypes.data, heads.ctypes.data
        written = pairs.ctypes.data, places.ctypes.data

        def prove(first: int, number: int) -> int:
            """Let the kernels prove so many of the motions, and write the pairs and places; how many stay open."""
            skipped = DOUBLE * joints * first
            sinks = written[0] + INT * first, written[1] + DOUBLE * first
            return int(kernels.prove(address, read[0] + skipped, read[1] + skipped, number, *sinks))

        looked_at = 0
        open_count = 0
        batch = 1 if packed.touching else MOTIONS_AT_ONCE  # planes of contacts are suggested for one motion
        for first in range(0, count, batch):
            if first > 0 and seconds is not None and time.monotonic() - begin > seconds:
                break
            if packed.touching:
                suggest_planes(self.robot, self.bodies, packed, np.stack([rows[0][first], rows[1][first]]))
            number = min(batch, count - first)
            open_count += prove(first, number)
            looked_at += number

        if sound is not None:
            pairs[~sound] = NOT_LOOKED_AT
            places[~sound] = np.nan
        elif open_count == 0 and looked_at == count:
            return []

        for k in (k for k in np.flatnonzero(pairs >= 0).tolist() if by_coal.links[pairs[k]]):
            motion = np.stack([rows[0][k], rows[1][k]])
            by_coal.settle(motion, pairs[k : k + 1], places[k : k + 1], partial(prove, k, 1))
        return [self._gap(packed, k, int(pairs[k]), float(places[k])) for k in np.flatnonzero(pairs != PROVEN).tolist()]

    def _packed_for(self, clearance: float, slack: float) -> ProofPairs:
        """Return the table, with a clearance and a slack to keep."""
        packed = self.tables.get(self.bodies, self._new_table)
        packed.keep(clearance, slack)
        return packed

    def _coal_proof(self, packed: ProofPairs) -> CoalProof:
        """What coal settles of a table: it is about links alone, wherever obstacles are."""
        if self._coal is None or self._coal.packed is not packed:
            self._coal = CoalProof(self.robot, self.bodies, packed)
        return self._coal

    def _new_table(self) -> ProofPairs:
        bodies = tuple(self.bodies)
        solids = of_each((body.geometry for body in bodies), convex_solids)
        return proof_pairs(self.robot.chain, bodies, self.pairs, solids, strokes(self.robot), fixed=self._fixed)

    def _gap(self, packed: ProofPairs, motion: int, pair: int, place: float) -> Gap:
        if pair < 0:
            return Gap(motion, float("nan"), "", "")
        return Gap(motion, place, *(self.bodies[k].name for k in packed.bodies[pair].tolist()))


@lru_cache(maxsize=MAX_ROBOTS)
def _joints(robot: Robot) -> tuple[Matrix, Vector, bool]:
    """How joint values follow from configurations, and whether the limits keep them below half the largest value."""
    gain = np.ascontiguousarray(robot.chain.gain.T)
    limits = np.stack([robot.lower, robot.upper])
    bounded = bool(np.isfinite(limits).all() and np.abs(robot.chain.joint_values(limits)).max() < 0.5 * LARGEST_VALUE)
    return gain, robot.chain.offset, bounded


def _entries(log: MotionEntries, measured_intervals: NDArray[np.int64]) -> MotionEntries:
    """What a verifier does not find by itself; a motion that stands still is one interval of level 0."""
    intervals = log.intervals.copy()
    if len(intervals) and (intervals == intervals[0]).all():  # one interval alone is all of the motion
        intervals[:] = 0

    settled_by_coal = (log.solids[:, None, ::2] == measured_intervals[None, :, :2]).all(axis=2).any(axis=1)
    needed = ((intervals[:, 0] > 0) | log.normals.any(axis=1)) & ~settled_by_coal

    whole_links = np.insert(measured_intervals[:, :2], [1, 2], -1, axis=1)
    solids = np.vstack([log.solids[needed], whole_links])
    intervals = np.vstack([intervals[needed], measured_intervals[:, 2:]])
    normals = np.vstack([log.normals[needed], np.zeros((len(measured_intervals), 3))])
    return MotionEntries(frozen(solids, np.int64), frozen(intervals, np.int64), frozen(normals))


class CoalProof:
    """What kernels leave open of motions, settled by coal where it is about two links, one of them a closed mesh.

    Attributes:
        packed: The table that the kernels read.
        links: Which pairs of it are such, shape (pairs,).

    Args:
        robot: The arm.
        bodies: Its bodies and others.
        packed: See above.
    """

    def __init__(self, robot: Robot, bodies: Sequence[Body], packed: ProofPairs) -> None:
        self._robot = robot
        self._bodies = bodies
        self.packed = packed
        is_of_arm = [body.kind != "obstacle" for body in bodies]
        is_mesh_of_arm = np.array(
            [of_arm and is_mesh(body.geometry) for of_arm, body in zip(is_of_arm, bodies, strict=True)], dtype=bool
        )
        is_open_mesh = np.array(
            [mesh and not is_closed(bodies[k].geometry) for k, mesh in enumerate(is_mesh_of_arm)], dtype=bool
        )
        has_closed_mesh = is_mesh_of_arm[packed.bodies].any(axis=1) & ~is_open_mesh[packed.bodies].any(axis=1)
        self.links: Mask = has_closed_mesh & ~packed.beside_obstacle & ~_groups(packed)

    def settle(self, motion: Matrix, pair: Numbers, place: Vector, again: Callable[[], object]) -> NDArray[np.int64]:
        """Compare links by coal until nothing is left open of a motion, shape (2, dof), or what it cannot settle.

        Args:
            motion: Its ends.
            pair: Number of the pair of links that is not proven apart, shape (1,); written, -1 for none.
            place: Where, shape (1,); written.
            again: Lets the kernels prove the motion once more, and write both.

        Returns:
            The numbers of two links, level and number of an interval in whose middle they are measured, shape (n, 4).
        """
        margins = self.packed.table.margins
        bodies = self.packed.bodies
        solids = self.packed.sides

        original_margins = margins.copy()
        intervals_of_links = list[list[int]]()
        try:
            while pair[0] >= 0 and self.links[pair[0]]:
                intervals = self._intervals(motion, int(pair[0]), float(place[0]))
                if not intervals:
                    break
                intervals_of_links += [[*solids[pair[0], ::2].tolist(), *interval] for interval in intervals]
                margins[self.links & (bodies == bodies[pair[0]]).all(axis=1)] = -FAR_APART
                again()
        finally:
            margins[:] = original_margins

        return np.array(intervals_of_links, dtype=np.int64).reshape(-1, 4)

    def logged(self, motion: Matrix, pair: Numbers, place: Vector, run: Callable[[], object]) -> Told:
        """What kernels tell while they prove a motion, and :meth:`settle` of it; arguments as there."""
        logs = [logged(self.packed, run)]
        intervals_of_links = self.settle(motion, pair, place, lambda: logs.append(logged(self.packed, run)))
        return logs[-1], intervals_of_links

    def _intervals(self, motion: Matrix, row: int, place: float) -> list[tuple[int, int]]:
        """Intervals that cover a motion, on each of which the bodies of a pair are apart, found by bisection.

        Args:
            motion: Its ends, shape (2, dof).
            row: Of the pair in the table.
            place: The share of the motion where kernels gave up, which is looked at first.

        Returns:
            Level and number of each interval; no interval if the two are not shown apart in all of the motion.
        """
        pair = [self._bodies[k] for k in self.packed.bodies[row].tolist()]
        required_gap = float(self.packed.table.margins[row]) + DISTANCE_TOLERANCE
        approach = APPROACH_SPARE * float(
            approach_weights(self._robot, pair, [(0, 1)])[0] @ np.abs(motion[1] - motion[0])
        )
        if required_gap <= 0.0:  # they may overlap, and coal measures surfaces alone
            return []
        if Containment((*pair,), ((0, 1),)).holds((0, 1), self._robot.chain.joint_frames(motion[:1])[0]):
            return []

        def spare_at(share: float) -> float:
            """Return how much more than they must the two are apart at a share of the motion [m]."""
            return _gap_at(self._robot, pair, motion[0] + share * (motion[1] - motion[0])) - required_gap

        if spare_at(place) <= 0.0:
            return []

        intervals = list[tuple[int, int]]()
        undecided = [(0, 0)]
        measured_count = 0
        while undecided and measured_count < MOST_DISTANCES:
            level, number = undecided.pop()
            measured_count += 1
            width = 0.5**level
            spare = spare_at((number + 0.5) * width)
            apart_on_interval = spare > 0.5 * approach * width
            if spare <= 0.0 or (not apart_on_interval and level == DEEPEST_LEVEL):
                return []
            if apart_on_interval:
                intervals.append((level, number))
            else:
                undecided += [(level + 1, 2 * number + 1), (level + 1, 2 * number)]

        return [] if undecided else intervals


def distance_between(robot: Robot, bodies: Sequence[Body], names: tuple[str, str], q: Vector) -> float:
    """Return the distance between bodies of two names at q, shape (dof,) [m]; nan if there are none."""
    first, second = ([body for body in bodies if body.name == name] for name in names)
    return min((_gap_at(robot, [a, b], q) for a in first for b in second), default=float("nan"))


def _gap_at(robot: Robot, pair: Sequence[Body], q: Vector) -> float:
    return next(measured(pair, [(0, 1)], robot.chain.joint_frames(q[None])[0], near_only=False)).distance


def _groups(packed: ProofPairs) -> Mask:
    """Return which rows of the table are groups of bodies: these are made of pairs that come before them."""
    firsts = packed.table.pairs.reshape(-1, layout.PAIR_SIZE)[:, layout.PARTS_FIRST]
    groups: Mask = (packed.sides[:, [1, 3]] < 0).all(axis=1) & (firsts < np.arange(len(firsts)))
    return groups


def suggest_planes(robot: Robot, bodies: Sequence[Body], packed: ProofPairs, ends: Matrix) -> None:
    """Let the kernels try the planes of contacts first, where a motion begins or ends, shape (2, dof)."""
    frames = robot.chain.joint_frames(ends)
    normals_of_rows = packed.table.ways.reshape(-1, 3)
    bases = packed.table.pairs.reshape(-1, layout.PAIR_SIZE)[:, layout.PAIR_BASE]
    normal_of_solids: dict[tuple[int, int], tuple[int, Vector]] = {}

    for row in packed.touching:
        first, second = packed.sides[row, ::2].tolist()
        if (first, second) not in normal_of_solids:
            normal_of_solids[first, second] = _normal((bodies[second], bodies[first]), frames)
        end, normal = normal_of_solids[first, second]
        normals_of_rows[row] = frames[end, bases[row], :3, :3].T @ normal


def _normal(pair: tuple[Body, Body], frames: Matrix) -> tuple[int, Vector]:
    """Where two bodies are nearer to each other, 0 or 1, and there the unit vector from the first to the second."""
    if any(isinstance(body.geometry, CloudSolid) for body in pair):
        return 0, np.zeros(3)  # kernels look for their own

    least_distance = np.inf
    nearest_end = 0
    normal = np.zeros(3)

    for end in range(len(frames)):
        poses = (pin.SE3(frames[end, body.joint]) * body.placement for body in pair)
        first, second = (coal.Transform3s(pose.rotation, pose.translation) for pose in poses)
        solids = around(pair[0].geometry), first, around(pair[1].geometry), second

        result = coal.DistanceResult()
        if coal.distance(*solids, coal.DistanceRequest(), result) < least_distance:
            least_distance = result.min_distance
            nearest_end = end
            normal = np.array(result.normal)

    return nearest_end, normal
