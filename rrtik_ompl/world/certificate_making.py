"""Certificates of motions: bodies are divided into parts until kernels find planes between all of them.

The parts are those of a certificate, not the convex pieces that searches and proofs use: they are sets of a mesh's
triangles, of a cloud's points, of a pile's boxes, divided by cuts along the axes, so that whoever verifies a
certificate has them from the cuts alone (``docs/science/certificate.md``). Most bodies have few parts; those that come
near each other on the way are divided further, clouds and piles near the arm alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from typing import TYPE_CHECKING, NamedTuple
from weakref import WeakKeyDictionary

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError, cKDTree

from rrtik_ompl.base.arrays import Mask, Matrix, Vector, distinct, frozen
from rrtik_ompl.base.poses import pose_from_xyzw
from rrtik_ompl.geometry.collision.bodies import DISTANCE_TOLERANCE, Body, keeps_clearance, kept_apart
from rrtik_ompl.geometry.collision.distances import measured
from rrtik_ompl.geometry.collision.elements import (
    Elements,
    NamedBody,
    compared_pairs,
    model_body,
    model_joints,
    unchecked_pairs,
)
from rrtik_ompl.kernels.proof.log import logged
from rrtik_ompl.kernels.proof.moving import MovedObstacles
from rrtik_ompl.kernels.proof.packing import ProofPairs, proof_pairs
from rrtik_ompl.kernels.proof.rows import proof_of_rows
from rrtik_ompl.kernels.tables.solid_tables import ConvexSolid, Solids, convex_solids
from rrtik_ompl.model.certificate import Certificate, MotionEntries, Route
from rrtik_ompl.model.robot import Chain, Robot
from rrtik_ompl.world.arm_cache import strokes
from rrtik_ompl.world.certificate_check import Motions, bodies_of_route
from rrtik_ompl.world.certificate_course import Course
from rrtik_ompl.world.certificate_held import MAKING, fault_of_constraints, model_constraints
from rrtik_ompl.world.certificate_parts import MOST_KNOWN, is_remembered, parts_of
from rrtik_ompl.world.coal_proof import PROVEN, CoalProof, suggest_planes

# [m] Certificates keep this distance beyond the rounding that proofs allow for: verifiers round elsewhere, and the
# normals of planes are written with few digits.
SPARE = 2e-6
DIGITS = 6  # decimals of a normal
# The same for bodies that come nearer to each other than SPARE allows, such as what is put down.
CLOSE_SPARE = 1e-9
CLOSE_DIGITS = 12
FIRST_PARTS = 4  # of a mesh
MOST_PARTS = 512  # of a mesh
MOST_PARTS_ON_CHORDS = 64  # of a mesh, where each pair of parts has an entry for each of many chords
FINER = 4  # factor on the number of parts of what is not proven apart
ROUNDS = 12  # in which bodies are divided further
FEW_CORNERS = 64  # up to which all points of a part are compared, and not those of its hull alone
PLACES = 12  # of each motion, around which clouds and piles are divided
FINEST = 0.05  # [m] size of parts of clouds and piles, unless smaller ones are needed
WIDE = 1.0  # largest size of such a part in units of its distance from the arm
MOST_LEAVES = 4000  # of a cloud or a pile
MOST_SLACK = 5e-4  # [m] by which a curved motion leaves its chords, at first
MOST_TRAVEL = 0.02  # [m] of an obstacle during a chord, at first
FINEST_CHORDS = 6  # level of chords at first
FINER_CHORDS = 4  # number of levels that are tried
CLOUDS = ("balls", "boxes")  # shapes of many elements that have nothing to do with each other

if TYPE_CHECKING:
    from rrtik_ompl.world.proof import Prover
    from rrtik_ompl.world.world import World

# Of each prover, which is one thread's alone, the pairs and the table of its bodies as they are divided at first.
_first_tables: WeakKeyDictionary[Prover, tuple[list[tuple[int, int]], ProofPairs]] = WeakKeyDictionary()


class Cover:
    """The parts of a body, and the cuts that divide it into them.

    Attributes:
        elements: The elements of the body's shape.
        cuts: See :attr:`rrtik_ompl.model.certificate.ModelBody.cuts`.
        leaves: Nodes that are not divided, and the numbers of their elements.
        solids: Convex solids around parts that were asked for.
        is_first: Whether it is divided as bodies are at first.
    """

    def __init__(self, elements: Elements) -> None:
        self.elements = elements
        self.cuts: list[tuple[int, int, float]] = []
        self.leaves: dict[int, NDArray[np.int64]] = {0: np.arange(len(elements.points))}
        self.solids: dict[int, ConvexSolid] = {}
        self.is_first = True
        self._low = elements.points.min(axis=1)
        self._high = elements.points.max(axis=1)
        self._middles = 0.5 * (self._low + self._high)
        if elements.half is not None:
            self._low = self._low - elements.half
            self._high = self._high + elements.half

    def copy(self) -> Cover:
        """Return another one with the same parts."""
        other = copy(self)
        other.cuts = list(self.cuts)
        other.leaves = dict(self.leaves)
        other.solids = dict(self.solids)
        return other

    def box(self, leaf: int) -> tuple[Vector, Vector]:
        """Return the lowest and highest coordinates of a part's elements, without its radius [m]."""
        own = self.leaves[leaf]
        return self._low[own].min(axis=0), self._high[own].max(axis=0)

    def size(self, leaf: int) -> float:
        """Return the diagonal of the box around a part [m]; 0 if it cannot be divided."""
        if len(self.leaves[leaf]) < 2:
            return 0.0
        low, high = self.box(leaf)
        return float(np.linalg.norm(high - low))

    def divide(self, leaf: int) -> bool:
        """Divide a part at the middle of its elements along their longest extent; return whether that is possible."""
        own = self.leaves[leaf]
        if len(own) < 2:
            return False
        middles = self._middles[own]
        low = middles.min(axis=0)
        high = middles.max(axis=0)
        axis = int((high - low).argmax())
        ordered = np.sort(middles[:, axis])

        # Cut where there is room between two elements, so that rounding does not matter: at the middle or beside it.
        gaps = np.diff(ordered)
        centre = 0.5 * (ordered[0] + ordered[-1])
        cuts = 0.5 * (ordered[1:] + ordered[:-1])
        width = ordered[-1] - ordered[0]
        roomy = gaps > 1e-3 * width / len(own)
        if width <= 0.0 or not roomy.any():
            return False
        best = int(np.where(roomy, np.abs(cuts - centre), np.inf).argmin())
        cut = float(f"{cuts[best]:.9g}")
        below = middles[:, axis] < cut
        if not 0 < below.sum() < len(own):
            cut = float(cuts[best])
            below = middles[:, axis] < cut

        number = len(self.cuts)
        self.is_first = False
        self.cuts.append((leaf, axis, cut))
        del self.leaves[leaf]
        self.leaves[2 * number + 1] = own[below]
        self.leaves[2 * number + 2] = own[~below]
        return True

    def divide_into(self, count: int) -> bool:
        """Divide the largest parts until there are a number of them; return whether anything was divided."""
        before = len(self.leaves)
        sizes = {leaf: self.size(leaf) for leaf in self.leaves}
        while sizes and len(self.leaves) < count:
            largest = max(sizes, key=sizes.__getitem__)
            if sizes.pop(largest) <= 0.0:
                break
            if self.divide(largest):
                new = 2 * len(self.cuts)
                sizes |= {leaf: self.size(leaf) for leaf in (new - 1, new)}
        return len(self.leaves) > before

    def solid(self, leaf: int) -> ConvexSolid:
        """Return a convex solid around a part, for the kernels."""
        if leaf not in self.solids:
            self.solids[leaf] = self._solid(leaf)
        return self.solids[leaf]

    def _solid(self, leaf: int) -> ConvexSolid:
        elements = self.elements
        if elements.half is not None or elements.key == "balls":
            low, high = self.box(leaf)
            corners = np.where(np.indices((2, 2, 2)).reshape(3, -1).T == 0, low, high)
            return ConvexSolid(corners[:1] if (low == high).all() else corners, radius=elements.radius)
        points = elements.points[self.leaves[leaf]].reshape(-1, 3)
        points = np.unique(points, axis=0)
        if len(points) > FEW_CORNERS:
            with suppress(QhullError, ValueError):  # flat ones have no hull
                points = points[ConvexHull(points).vertices]
        return ConvexSolid(points, radius=elements.radius, disc=elements.disc)


def _first_covers(named: Sequence[NamedBody], pairs: Sequence[tuple[int, int]]) -> list[Cover]:
    """Return the parts of all bodies that are tried first: meshes that are compared have several."""
    compared = {k for pair in pairs for k in pair}
    covers = []
    for k, each in enumerate(named):
        parted = k in compared and each.elements.key == "mesh" and not _may_overlap(each)
        find = _known_cover if is_remembered(each.elements) else _divided_cover
        covers.append(find(each.elements, FIRST_PARTS if parted else 1).copy())
    return covers


def _divided_cover(elements: Elements, count: int) -> Cover:
    """Return a body divided into a number of parts."""
    cover = Cover(elements)
    cover.divide_into(count)
    cover.is_first = True
    for leaf in cover.leaves if count > 1 else ():
        cover.solid(leaf)
    return cover


_known_cover = lru_cache(maxsize=MOST_KNOWN)(_divided_cover)


def _may_overlap(named: NamedBody) -> bool:
    """Check whether a body may overlap others, and therefore counts as its hull."""
    return any(distance < 0.0 for _, distance in named.body.contacts)


class Chord(NamedTuple):
    """A part of a motion that kernels prove as a straight motion among obstacles at rest.

    Attributes:
        motion: Number of the motion.
        level, number: The interval of the motion that it goes over.
        ends: Configurations at both ends, shape (2, dof).
        bodies: All bodies, obstacles where they are in the middle of it.
        room: For each body how far any point of an obstacle goes from there [m].
    """

    motion: int
    level: int
    number: int
    ends: Matrix
    bodies: Sequence[Body]
    room: Sequence[float]


def certificate_of(prover: Prover, route: Route, clearance: float, world: World | None = None) -> Certificate | None:
    """Return the certificate of a motion; None if no planes are found that prove it.

    Args:
        prover: Has the robot, the bodies, and the pairs of which a joint moves one.
        route: The motion.
        clearance: Distance to keep from obstacles [m].
        world: Has the motions of obstacles, and all pairs, of a timed motion.

    Raises:
        InputError: If an obstacle changes its way between two waypoints.
    """
    robot = prover.robot
    named, tracks = bodies_of_route(robot, prover.bodies, None if world is None else world.scene, route)
    compared = compared_pairs(named, prover.pairs if world is None else world.pairs)
    if any(not named[k].elements.known for pair in compared for k in pair):
        return None
    course = Course(robot.chain, route, tracks)
    constraints = model_constraints(prover.constraints)
    if course.fault or fault_of_constraints(constraints, course, rounding=MAKING):
        return None

    slacks = np.zeros(course.count)
    travels = np.zeros((len(named), course.count))
    if route.times is not None:
        whole = [parts_of(each.elements, ()) for each in named]
        slacks = Motions(robot.chain, named, whole, compared, course, clearance).pushes.max(axis=0, initial=0.0) / 8.0
        travels = course.travels(named, whole)
    levels = _levels(slacks, travels)
    finest = FINER_CHORDS if levels.any() else 1
    for spare, digits, finer in [(SPARE, DIGITS, k) for k in range(finest)] + [(CLOSE_SPARE, CLOSE_DIGITS, finest - 1)]:
        chords = list(_chords(named, course, levels + finer, travels))
        covers = _first_covers(named, compared)
        spare += float((slacks * 0.25 ** (levels + finer)).max())
        most_parts = MOST_PARTS if route.times is None else MOST_PARTS_ON_CHORDS
        table = _Table(prover, named, covers, compared, course, clearance, spare, digits, most_parts)
        motions = table.proven(chords)
        if table.too_near:
            return None
        if motions is not None:
            made = _model(prover, route, named, compared, covers, clearance, tracks)
            held = _holding(made, motions, robot.chain, named, compared, course)
            if held is not None:
                return held
    return None


def _levels(slacks: Vector, travels: Matrix) -> NDArray[np.int64]:
    """Return the level of the chords of each motion, at which they leave the motion by little, shape (motions,)."""
    bent = np.log2(np.maximum(slacks / MOST_SLACK, 1.0)) / 2.0
    passed = np.log2(np.maximum(travels.max(axis=0, initial=0.0) / MOST_TRAVEL, 1.0))
    return np.asarray(np.minimum(np.ceil(np.maximum(bent, passed)), FINEST_CHORDS), dtype=np.int64)


def _chords(named: Sequence[NamedBody], course: Course, levels: NDArray[np.int64], travels: Matrix) -> Iterator[Chord]:
    """Yield the chords of all motions, one after the other.

    Args:
        named: The bodies.
        course: The motions.
        levels: Of the chords of each motion.
        travels: How far each body goes at most in each motion, shape (bodies, motions) [m].
    """
    moving = [k for k, each in enumerate(named) if each.body.joint > course.joints]
    for motion, level in enumerate(levels.tolist()):
        shares = np.linspace(0.0, 1.0, (1 << level) + 1)
        rows = course.positions(np.full(len(shares), motion), shares)
        middles = shares[:-1] + 0.5 ** (level + 1) if moving else shares[:0]
        frames = course.frames(np.full(len(middles), motion), middles)
        for number in range(1 << level):
            bodies = [each.body for each in named]
            for k in moving:
                pose = pin.SE3(frames[number, bodies[k].joint]) * bodies[k].placement
                bodies[k] = replace(bodies[k], joint=0, placement=pose)
            room = 0.5 ** (level + 1) * travels[:, motion]
            yield Chord(motion, level, number, rows[number : number + 2], bodies, room.tolist())


def _model(
    prover: Prover,
    route: Route,
    named: Sequence[NamedBody],
    pairs: Sequence[tuple[int, int]],
    covers: Sequence[Cover],
    clearance: float,
    tracks: NDArray[np.float64] | None,
) -> Certificate:
    """Return a certificate without entries."""
    robot = prover.robot
    listed = tuple(model_body(each, cover.cuts) for each, cover in zip(named, covers, strict=True))
    unchecked = unchecked_pairs(robot, named, pairs)
    model = robot.name, model_joints(robot), listed, unchecked
    moved = None if tracks is None else frozen(tracks[:, :, :3].reshape(*tracks.shape[:2], -1))
    return Certificate(
        *model, clearance, prover.self_margin, frozen(route.waypoints), (), route.times, route.rates, moved,
        *_description(robot), model_constraints(prover.constraints),
    )  # fmt: skip


def _description(robot: Robot) -> tuple[tuple[tuple[str, float], ...], tuple[float, ...] | None]:
    """Return the joints that are held, by name, and the pose of the base, as a robot's source states them."""
    held = tuple((name, float(value)) for name, value in (robot.source.get("locked") or {}).items())
    stated = robot.source.get("base_pose")
    if stated is None:
        return held, None
    base = pose_from_xyzw(stated["xyz"], stated["quat_xyzw"])
    return held, tuple(base.homogeneous[:3].ravel().tolist())


def _holding(
    certificate: Certificate,
    motions: Sequence[MotionEntries],
    chain: Chain,
    named: Sequence[NamedBody],
    pairs: Sequence[tuple[int, int]],
    course: Course,
) -> Certificate | None:
    """Return a certificate with entries, without those that balls and boxes make needless; None if it does not hold."""
    trees = [parts_of(each.elements, body.cuts) for each, body in zip(named, certificate.bodies, strict=True)]
    verifier = Motions(chain, named, trees, pairs, course, certificate.clearance)
    ordered = [verifier.with_passing(verifier.in_order(motion)) for motion in motions]
    fitting = ordered if certificate.times is None else verifier.fitted(ordered)
    needed = verifier.needed(fitting)
    if needed is None:
        return None
    ends = np.cumsum([len(motion.solids) for motion in fitting])
    kept = tuple(
        MotionEntries(
            frozen(motion.solids[own], np.int64), frozen(motion.intervals[own], np.int64), frozen(motion.normals[own])
        )
        for motion, own in zip(fitting, np.split(needed, ends[:-1]), strict=True)
    )
    return None if verifier.fault(kept, sufficient=True) else replace(certificate, motions=kept)


@dataclass(eq=False)
class _Table:
    """Bodies and their parts as the kernels compare them; the parts become finer as far as that is needed.

    Attributes:
        most_parts: Largest number of parts of a mesh.
        too_near: Whether two bodies were found nearer to each other than they may be, so that no parts are fine enough.
    """

    prover: Prover
    named: Sequence[NamedBody]
    covers: Sequence[Cover]
    pairs: Sequence[tuple[int, int]]
    course: Course
    clearance: float
    spare: float
    digits: int
    most_parts: int
    too_near: bool = False

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.prover.robot

    def proven(self, chords: Sequence[Chord]) -> list[MotionEntries] | None:
        """Return the entries of each motion, from the chords of all of them; None if one is not proven."""
        route = np.stack([chord.ends for chord in chords])
        scale = 1.0
        self._divide_clouds(route, scale)

        for _ in range(ROUNDS):
            packed, nodes = self._packed(chords[0].bodies)
            entries: list[MotionEntries] = []
            stuck = self._run(packed, nodes, chords, entries)
            if stuck is None:
                return _joined(chords, entries)
            divided = [self._divide(body, node) for body, node in stuck]
            if self.too_near or not any(divided):
                return None
            if any(self.covers[body].elements.key in CLOUDS for body, _ in stuck):
                scale /= FINER
                self._divide_clouds(route, scale)
        return None

    @cached_property
    def _endless(self) -> Mask:
        """Which bodies are half-spaces, shape (bodies,)."""
        return np.array([cover.elements.key == "half_space" for cover in self.covers], dtype=bool)

    def _divide(self, body: int, node: int) -> bool:
        """Divide a body further of which a part is not proven apart from another; return whether that is possible."""
        if not self._can_be_finer(body):
            return False
        cover = self.covers[body]
        if cover.elements.key in CLOUDS:
            return node in cover.leaves and cover.divide(node)
        return cover.divide_into(min(self.most_parts, FINER * len(cover.leaves)))

    def _packed(self, bodies: Sequence[Body]) -> tuple[ProofPairs, list[list[int]]]:
        """Return the table of the kernels, and for each body the nodes of its parts."""
        nodes = [list(cover.leaves) for cover in self.covers]
        moving = [each for each, body in zip(self.named, bodies, strict=True) if each.body is not body]
        is_first = not moving and all(cover.is_first for cover in self.covers)
        pairs, packed = _first_tables.get(self.prover, (None, None)) if is_first else (None, None)
        if packed is None or pairs != self._arm_pairs:
            packed = self._new_table(bodies, fixed=not moving)
            if is_first:
                _first_tables[self.prover] = self._arm_pairs, packed
        packed.forget_planes()  # the same whatever was proven before
        packed.keep(self.clearance, self.spare)
        return packed, nodes

    def _new_table(self, bodies: Sequence[Body], *, fixed: bool) -> ProofPairs:
        solids = []
        for each, cover in zip(self.named, self.covers, strict=True):
            geometry = each.body.geometry
            if cover.elements.key in ("mesh", *CLOUDS):
                solids.append(Solids(tuple(map(cover.solid, cover.leaves))))
            else:
                solids.append(convex_solids(geometry))
        plain = self._plain(bodies)
        return proof_pairs(self.robot.chain, plain, self._arm_pairs, solids, strokes(self.robot), fixed=fixed)

    @cached_property
    def _arm_pairs(self) -> list[tuple[int, int]]:
        """The pairs of which a joint moves a body: those that kernels compare."""
        joints = len(self.robot.chain.parent)
        return [pair for pair in self.pairs if any(0 < self.named[k].body.joint <= joints for k in pair)]

    def _plain(self, bodies: Sequence[Body]) -> list[Body]:
        """Return bodies with boxes in place of clouds: kernels take a cloud for one by its geometry."""
        return [
            replace(body, geometry=_box_around(each.elements)) if each.elements.key in CLOUDS else body
            for each, body in zip(self.named, bodies, strict=True)
        ]

    def _run(
        self,
        packed: ProofPairs,
        nodes: Sequence[Sequence[int]],
        chords: Sequence[Chord],
        entries: list[MotionEntries],
    ) -> list[tuple[int, int]] | None:
        """Prove the chords and append their entries.

        Returns:
            Two bodies that are not proven apart, each with the node of the part; None if all are.
        """
        ends = np.stack([chord.ends for chord in chords])
        values = self.robot.chain.joint_values(ends.reshape(-1, ends.shape[-1])).reshape(*ends.shape[:2], -1)
        values = np.ascontiguousarray(values.transpose(1, 0, 2))
        pair = np.zeros(1, dtype=np.int32)
        place = np.zeros(1)
        first = chords[0].bodies
        numbers = _Numbers(nodes)
        moves = any(each.body is not body for each, body in zip(self.named, first, strict=True))
        moved = MovedObstacles(packed, self._plain(first)) if moves else None
        coal_proof = CoalProof(self.robot, first, packed)
        for k, chord in enumerate(chords):
            if moved is not None:
                moved.put(self._plain(chord.bodies), chord.room)
                packed.keep(self.clearance, self.spare)
            run = partial(proof_of_rows(packed, values[0, k : k + 1], values[1, k : k + 1], pair, place), 0, 1)
            if packed.touching:
                suggest_planes(self.robot, chord.bodies, packed, chord.ends)
            log = logged(packed, run)
            measured = np.zeros((0, 4), dtype=np.int64)
            if pair[0] != PROVEN:
                stuck = self._parts_of(packed, int(pair[0]), nodes)
                self.too_near = self._are_too_near([body for body, _ in stuck], chord, float(place[0]))
                if self.too_near or any(self._can_be_finer(body) for body, _ in stuck):
                    return stuck
                log, measured = coal_proof.logged(chord.ends, pair, place, run)
                if pair[0] != PROVEN:
                    return self._parts_of(packed, int(pair[0]), nodes)
            entries.append(self._entries(log, measured, numbers, whole_log=chord.level > 0))
        return None

    def _parts_of(self, packed: ProofPairs, pair: int, nodes: Sequence[Sequence[int]]) -> list[tuple[int, int]]:
        """Return both bodies of a pair of the table, each with the node of its part."""
        first, one, second, other = packed.sides[pair].tolist()
        return [(body, nodes[body][max(part, 0)]) for body, part in ((first, one), (second, other))]

    def _are_too_near(self, numbers: Sequence[int], chord: Chord, place: float) -> bool:
        """Check whether coal finds less between two bodies than they have to keep, at a share of a chord."""
        pair = [self.named[k].body for k in numbers]
        kept = kept_apart(*pair) + (self.clearance if keeps_clearance(*pair) else 0.0)
        if kept < 0.0:  # coal does not measure how deep meshes overlap
            return False
        share = (chord.number + place) * 0.5**chord.level
        frames = self.course.frames(np.array([chord.motion]), np.array([share]))[0]
        found = next(measured(pair, ((0, 1),), frames, near_only=False))
        return bool(found.distance < kept - DISTANCE_TOLERANCE)

    def _can_be_finer(self, number: int) -> bool:
        cover = self.covers[number]
        most = {"mesh": self.most_parts, "balls": MOST_LEAVES, "boxes": MOST_LEAVES}.get(cover.elements.key, 1)
        return not _may_overlap(self.named[number]) and len(cover.leaves) < min(most, len(cover.elements.points))

    def _entries(
        self, log: MotionEntries, measured: NDArray[np.int64], numbers: _Numbers, *, whole_log: bool
    ) -> MotionEntries:
        """Return the entries of a chord.

        Entries of bodies whose distances are measured are dropped; they get the intervals of these measurements.

        Args:
            log: The kernels' log of the motion.
            measured: Numbers of two bodies, and level and number of an interval, shape (n, 4).
            numbers: The nodes of parts.
            whole_log: Whether entries without a plane are kept. A verifier finds those of a whole motion by balls and
                boxes.
        """
        normals = np.where(self._endless[log.solids[:, 2]][:, None], 0.0, np.round(log.normals, self.digits))
        intervals = log.intervals.copy()
        # A motion that stands still is logged as one interval, and covers all of it.
        if len(intervals) and (intervals == intervals[0]).all():
            intervals[:] = 0

        settled = (log.solids[:, None, ::2] == measured[None, :, :2]).all(axis=2).any(axis=1)
        needed = (normals.any(axis=1) | whole_log) & ~settled
        solids = log.solids[needed]
        for side in (0, 2):
            solids[:, side + 1] = numbers.of(solids[:, side], solids[:, side + 1])

        whole = np.insert(measured[:, :2], [1, 2], -1, axis=1)
        return MotionEntries(
            frozen(np.vstack([solids, whole]), np.int64),
            frozen(np.vstack([intervals[needed], measured[:, 2:]]), np.int64),
            frozen(np.vstack([normals[needed], np.zeros((len(measured), 3))])),
        )

    def _divide_clouds(self, route: Matrix, scale: float) -> None:
        """Divide clouds and piles: their parts are small near the arm on its way, and large far away.

        Args:
            route: Both ends of each chord, shape (chords, 2, dof).
            scale: Factor on the size of the parts.
        """
        wide = [k for k in sorted({k for pair in self.pairs for k in pair}) if len(self.covers[k].elements.points) > 1]
        wide = [k for k in wide if self.covers[k].elements.key in CLOUDS]
        if not wide:
            return

        # Balls around the parts of the arm at some places of each motion.
        shares = np.linspace(0.0, 1.0, PLACES)[:, None]
        rows = (route[:, :1] + shares * (route[:, 1:] - route[:, :1])).reshape(-1, route.shape[2])
        frames = self.robot.chain.joint_frames(distinct_rows(rows))
        centres = []
        radii = []
        for each, cover in zip(self.named, self.covers, strict=True):
            if each.body.joint == 0 or each.body.kind == "obstacle":
                continue
            for leaf in cover.leaves:
                low, high = cover.box(leaf)
                pose = frames[:, each.body.joint] @ each.body.placement.homogeneous
                centres.append(pose[:, :3, :3] @ (0.5 * (low + high)) + pose[:, :3, 3])
                radius = 0.5 * np.linalg.norm(high - low) + cover.elements.radius + cover.elements.disc
                radii.append(np.full(len(pose), radius))
        balls = np.concatenate(centres)
        sizes = np.concatenate(radii)

        for number in wide:
            cover = self.covers[number]
            pose = self.named[number].body.placement.homogeneous
            nearest = _Nearest((balls - pose[:3, 3]) @ pose[:3, :3], sizes)
            candidates = list(cover.leaves)
            while candidates and len(cover.leaves) + len(candidates) < MOST_LEAVES:
                boxes = np.array([cover.box(leaf) for leaf in candidates])
                half = 0.5 * np.linalg.norm(boxes[:, 1] - boxes[:, 0], axis=1)
                away = nearest.distances(0.5 * (boxes[:, 0] + boxes[:, 1])) - half - cover.elements.radius
                coarse = 2.0 * half > scale * np.maximum(WIDE * away, FINEST)
                chosen = [leaf for leaf, is_coarse in zip(candidates, coarse.tolist(), strict=True) if is_coarse]
                candidates = []
                for leaf in chosen:
                    if cover.divide(leaf):
                        candidates += [2 * len(cover.cuts) - 1, 2 * len(cover.cuts)]


class _Numbers:
    """The nodes of parts, by the numbers of bodies and parts in a table of the kernels.

    Args:
        nodes: For each body the nodes of its parts.
    """

    def __init__(self, nodes: Sequence[Sequence[int]]) -> None:
        self._firsts = np.cumsum([0, *map(len, nodes)])
        self._nodes = np.array([node for own in nodes for node in own], dtype=np.int64)

    def of(self, bodies: NDArray[np.int64], parts: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the nodes of parts, 0 for the whole body where the part is -1; all of shape (n,)."""
        return np.where(parts < 0, 0, self._nodes[self._firsts[bodies] + np.maximum(parts, 0)])


def _joined(chords: Sequence[Chord], entries: Sequence[MotionEntries]) -> list[MotionEntries]:
    """Return the entries of each motion, of those of its chords, with intervals of the motion."""
    parts: dict[int, list[MotionEntries]] = {chord.motion: [] for chord in chords}
    for chord, own in zip(chords, entries, strict=True):
        level, number = own.intervals.T
        intervals = np.column_stack([chord.level + level, (chord.number << level) + number])
        parts[chord.motion].append(replace(own, intervals=intervals))
    return [
        MotionEntries(
            np.concatenate([each.solids for each in own]),
            np.concatenate([each.intervals for each in own]),
            np.concatenate([each.normals for each in own]),
        )
        for own in parts.values()
    ]


class _Nearest:
    """Distances of points from the nearest of many balls, about."""

    def __init__(self, centres: Matrix, radii: Vector) -> None:
        classes = np.ceil(np.log2(np.maximum(radii, 1e-3)) * 2.0)
        self._trees = [
            (cKDTree(centres[classes == kind]), float(radii[classes == kind].max())) for kind in distinct(classes)
        ]

    def distances(self, points: Matrix) -> Vector:
        """Return the distances from the balls' surfaces, shape (n,) [m]."""
        return np.asarray(np.min([tree.query(points)[0] - radius for tree, radius in self._trees], axis=0))


def distinct_rows(rows: Matrix) -> Matrix:
    """Return rows, each once."""
    return np.asarray(np.unique(rows, axis=0))


def _box_around(elements: Elements) -> coal.CollisionGeometry:
    """Return a box about the origin that contains the elements."""
    half = 0.0 if elements.half is None else elements.half[:, None]
    far = (np.abs(elements.points) + half).reshape(-1, 3).max(axis=0) + elements.radius
    box = coal.Box(*(2.0 * far))
    box.computeLocalAABB()
    return box
