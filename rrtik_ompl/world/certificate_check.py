"""Verification of certificates: whether one proves a path free, computed anew in numpy from robot and scene alone.

All motions are seen from the frame of the last joint that carries both bodies of a pair. There a point of a body has at
most the acceleration C, so within an interval of width h it stays within the sagitta C h^2 / 8 of the chord between its
positions at the ends. Two solids are apart in the whole interval if, at both ends, a plane separates them by more than
the sum of both sagittas, or if balls that move along the chords are that far apart. Alternatively, the distance that
coal measures in the middle of an interval has to exceed the bound on the bodies' approach in half of it [16]. The
verifier searches for nothing: it only checks what the certificate states.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import groupby, product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.geometry.collision.bodies import DISTANCE_TOLERANCE, Body, keeps_clearance, kept_apart
from rrtik_ompl.geometry.collision.certificate import fixed_contact
from rrtik_ompl.geometry.collision.containment import Containment, filled
from rrtik_ompl.geometry.collision.digests import robot_digest, scene_digest
from rrtik_ompl.geometry.collision.distances import measured
from rrtik_ompl.kernels.layout import CONVEX_SOLID, HALF_SPACE_SOLID
from rrtik_ompl.kernels.reference.separation import (
    Bounds,
    Ends,
    Joints,
    Numbers,
    ball_gaps,
    places_of,
    rotated,
    seen_from_base,
)
from rrtik_ompl.kernels.tables.solid_tables import UNKNOWN, ConvexSolid, convex_solids, placed_solids
from rrtik_ompl.model.certificate import DEEPEST, VERSION, Certificate, MotionEntries
from rrtik_ompl.model.robot import Chain

if TYPE_CHECKING:
    from rrtik_ompl.world.world import World

ROUNDING = 1e-8  # [m] added to every required gap, to cover rounding errors
LARGEST_VALUE = 1e3  # [rad] or [m], joint values up to which ROUNDING is sufficient
UNIT = 1e-9  # tolerance of a normal's length, and of its deviation from the normal of a half-space
AT_ONCE = 20_000  # number of intervals that are computed together, to bound memory


class Entry(NamedTuple):
    """A claim that two solids, one of each body of a pair, are apart on an interval of a motion.

    Attributes:
        motion: Number of the motion, from 0.
        pair: Index of the pair in ``Motions.pairs``.
        first, second: Indices of the solids in ``Motions.solids``, in the order of the pair.
        begin: Start of the interval as a share of the motion, from 0 to 1.
        width: Width of the interval as a share of the motion.
    """

    motion: int
    pair: int
    first: int
    second: int
    begin: float
    width: float

    @property
    def solids_of_motion(self) -> tuple[int, int, int, int]:
        """Motion, pair, first and second: what all intervals of the same two solids in a motion share."""
        return self[:4]


def certificate_fault(certificate: Certificate, world: World, waypoints: ArrayLike, *, clearance: float = 0.0) -> str:
    """Verify a certificate, as :meth:`rrtik_ompl.World.verify` but without checking the types of arguments.

    Args:
        certificate: The certificate.
        world: The robot and the scene.
        waypoints: Waypoints of the path, shape (k, dof).
        clearance: Least distance that the path has to keep from obstacles on top of their margins [m].

    Returns:
        The first fault in one line; "" if the certificate proves the path free.
    """
    rows = np.ascontiguousarray(waypoints, dtype=np.float64)
    if fault := _fault_of_header(certificate, world, rows, clearance):
        return fault

    # A single waypoint counts as a motion that stands still.
    route = np.repeat(rows, 2, axis=0) if len(rows) == 1 else rows
    return Motions(world, route, certificate.clearance).fault(certificate.motions)


def _fault_of_header(certificate: Certificate, world: World, rows: Matrix, clearance: float) -> str:
    """Return the first mismatch between a certificate and a path that concerns no entry; "" if there is none.

    Checked are the version, robot, scene, clearance [m] and path, contacts between bodies that no joint moves (no entry
    covers these), the bounds of the waypoints, shape (k, dof), and the number of motions.
    """
    robot = world.robot
    if certificate.version != VERSION:
        return f"version {certificate.version} is not known here"
    if certificate.robot_digest != robot_digest(robot):
        return f"it is for another robot, '{certificate.robot}'"
    if certificate.self_margin != world.self_margin:
        return f"it is for another self margin, {certificate.self_margin:g} m"
    if certificate.scene_digest != scene_digest(world.bodies, world.pairs):
        return "it is for another scene"
    if not max(0.0, clearance) <= certificate.clearance < np.inf:
        return f"it is for a clearance of {certificate.clearance:g} m, not {clearance:g} m"

    # The waypoints have to agree to the bit, except that 0.0 equals -0.0.
    if not np.array_equal(rows, certificate.waypoints):
        return "it is for another path: waypoints differ"

    pairs_at_rest = tuple(pair for pair in world.pairs if all(world.bodies[k].joint == 0 for k in pair))
    touching = fixed_contact(robot, world.bodies, pairs_at_rest)
    if touching is not None:
        return f"{' and '.join(map(repr, touching))} touch and never move"

    inside_limits = len(rows) > 0 and rows.shape[1] == robot.dof and bool(robot.within_limits(rows).all())
    if not inside_limits or not (np.abs(robot.joint_values(rows)) <= LARGEST_VALUE).all():
        return f"waypoints are not inside the limits of robot '{robot.name}', or beyond {LARGEST_VALUE:g}"

    motion_count = max(1, len(rows) - 1)
    if len(certificate.motions) != motion_count:
        return f"it has {len(certificate.motions)} motions, not {motion_count}"
    return ""


class Solid:
    """A body, or a convex part of it, in the frame of its joint, with a bounding ball and a bounding box.

    Both are infinitely large if the solid is not convex.

    Attributes:
        parts: The convex parts.
        axes: The axes of the box as columns, shape (3, 3).
        convex: Whether all parts are convex and bounded.
        ball_centre, ball_radius: The ball, shape (3,) and [m].
        box_centre, box_half: Centre and half side lengths of the box along its axes, shape (3,) each [m].
    """

    def __init__(self, parts: tuple[ConvexSolid, ...], axes: Matrix) -> None:
        self.parts = parts
        self.axes = axes
        self.convex = all(part.kind == CONVEX_SOLID for part in parts)

        self.ball_centre = np.zeros(3)
        self.box_centre = np.zeros(3)
        self.box_half = np.full(3, np.inf)
        self.ball_radius = np.inf

        if self.convex:
            low = -self.support(-axes.T)
            high = self.support(axes.T)
            self.box_centre = 0.5 * (low + high)
            self.box_half = 0.5 * (high - low)
            self.ball_centre = axes @ (0.5 * (low + high))
            self.ball_radius = self.largest_length(lambda points: points - self.ball_centre)

    def largest_length(self, mapping: Callable[[Matrix], Matrix]) -> float:
        """Return the largest norm [m] that a non-expansive mapping, (n, 3) -> (n, 3), takes on the points of the solid.

        It is evaluated at the corners of each part; the disc and the radius around them are added.
        """
        lengths = [
            float(np.linalg.norm(mapping(part.corners), axis=1).max()) + part.disc + part.radius for part in self.parts
        ]
        return max(lengths)

    def support(self, directions: Matrix) -> Vector:
        """Return the support function [m] at unit vectors in the joint's frame, (n, 3) -> (n,)."""
        heights = []
        for part in self.parts:
            if part.kind == HALF_SPACE_SOLID:  # bounded along its normal only
                along_normal = np.abs(directions - part.axis).max(axis=1) <= UNIT
                height = np.where(along_normal, part.disc, np.inf)
            elif part.kind == CONVEX_SOLID:  # the hull of discs about an axis, inflated by a radius
                sines = np.linalg.norm(np.cross(directions, part.axis), axis=1)
                height = (directions @ part.corners.T).max(axis=1) + part.disc * sines + part.radius
            else:  # its extent is unknown
                height = np.full(len(directions), np.inf)
            heights.append(height)
        return np.asarray(np.max(heights, axis=0))


class Motions:
    """The motions of a world's robot between waypoints, shape (k, dof), with the pairs of solids that must stay apart.

    Attributes:
        values: Values of all joints at the waypoints, shape (k, joints).
        joints: The joints of the robot.
        solids: The bodies and their convex parts.
        bounds: Balls and boxes around them.
        solid_numbers: Index of each solid in ``solids``, by body and part; part -1 is the whole body.
        parts: For each body the range of its part numbers.
        joint_of_solid: The joint that carries each solid, 0 for the world.
        pairs: Pairs of indices of bodies of which at least one moves. A body that rests in the frame of the pair is
            second.
        base_of_pair: The joint in whose frame each pair is seen: the last one that carries both bodies.
        required_gaps: Distance that each pair has to keep [m], including ``ROUNDING``.
        approaches, accelerations: Bounds of the sums of both bodies' speeds and accelerations for each pair and
            motion, if a motion takes time 1, shape (pairs, motions) [m].
    """

    def __init__(self, world: World, rows: Matrix, clearance: float) -> None:
        self.chain = world.robot.chain
        self.joints = Joints(self.chain.parent + 1, self.chain.placement, self.chain.axis, self.chain.prismatic)
        self.bodies = world.bodies
        self.values: Matrix = rows @ self.chain.gain.T + self.chain.offset

        self.solids = list[Solid]()
        self.solid_numbers: dict[tuple[int, int], int] = {}
        self.parts = [self._describe(number, body) for number, body in enumerate(self.bodies)]

        joints = [body.joint for body in self.bodies]
        self.joint_of_solid = np.array([joints[k] for k, _ in self.solid_numbers], dtype=np.int64)

        self.bounds = Bounds(
            np.array([solid.ball_centre for solid in self.solids]).reshape(-1, 3),
            np.array([solid.ball_radius for solid in self.solids]),
            np.array([solid.axes for solid in self.solids]).reshape(-1, 3, 3),
            np.array([solid.box_centre for solid in self.solids]).reshape(-1, 3),
            np.array([solid.box_half for solid in self.solids]).reshape(-1, 3),
        )

        # Only pairs of which a body moves are checked here; the header covers the others.
        moving = [
            (i, j, _common_joint(self.chain, joints[i], joints[j])) for i, j in world.pairs if joints[i] or joints[j]
        ]
        self.pairs = [(i, j) if joints[j] == base else (j, i) for i, j, base in moving]
        self.base_of_pair = np.array([base for _, _, base in moving], dtype=np.int64)

        bodies_of_pairs = [(self.bodies[i], self.bodies[j]) for i, j in self.pairs]
        clearances = [kept_apart(a, b) + (clearance if keeps_clearance(a, b) else 0.0) for a, b in bodies_of_pairs]
        self.required_gaps = np.array(clearances) + ROUNDING

        bounds = np.array([self._bounds(i, base) + self._bounds(j, base) for i, j, base in moving])
        self.approaches, self.accelerations = bounds.reshape(-1, 2, len(rows) - 1).transpose(1, 0, 2)

    def _describe(self, number: int, body: Body) -> range:
        """Append the solids of a body to ``solids`` and return the range of its part numbers."""
        convex_parts = convex_solids(body.geometry).around
        pose = body.placement.homogeneous
        parts = tuple(placed_solids(convex_parts, np.array([pose] * len(convex_parts)))) or (UNKNOWN,)
        rotation = pose[:3, :3]
        for part_number in range(-1, len(parts)):
            self.solid_numbers[number, part_number] = len(self.solids)
            self.solids.append(Solid(parts if part_number < 0 else (parts[part_number],), rotation))
        return range(len(parts))

    def _bounds(self, number: int, base: int) -> Matrix:
        """Bound speed and acceleration of all points of a body as seen from a frame, from the body's joint inwards.

        Args:
            number: Index of the body.
            base: The joint whose frame it is; it has to carry the body.

        Returns:
            Bounds of speed and acceleration in each motion, which takes time 1, shape (2, k - 1) [m].
        """
        rates = np.abs(np.diff(self.values, axis=0))
        chain = self.chain
        body = self.solids[self.solid_numbers[number, -1]]
        velocity, acceleration = np.zeros((2, len(rates)))
        joint = self.bodies[number].joint
        if joint == base:
            return np.zeros((2, len(rates)))
        if not body.convex:
            return np.full((2, len(rates)), np.inf)

        distance_to_origin = body.largest_length(lambda points: points)
        distance_to_axis = body.largest_length(lambda points: np.cross(points, chain.axis[joint - 1]))

        # A revolute joint adds centripetal and Coriolis terms, a prismatic joint adds velocity only.
        while joint != base:
            k = joint - 1
            rate = rates[:, k]
            slides = bool(chain.prismatic[k])
            if slides:
                velocity = velocity + rate
            else:
                acceleration = acceleration + rate * (2.0 * velocity + rate * distance_to_axis)
                velocity = velocity + rate * distance_to_axis

            # Bound the distances of the body's points from the origin and the axis of the next joint inwards.
            joint = int(chain.parent[k]) + 1
            origin = chain.placement[k][:3, 3]
            stroke = float(np.abs(self.values[:, k]).max()) if slides else 0.0
            origin_to_axis = float(np.linalg.norm(np.cross(origin, chain.axis[joint - 1])))
            distance_to_axis = origin_to_axis + stroke + distance_to_origin
            distance_to_origin += float(np.linalg.norm(origin)) + stroke

        return np.array([velocity, acceleration])

    def _frames(self, motion: Numbers, share: Vector) -> NDArray[np.float64]:
        """Compute the frames of all joints, the world first, at given places of motions.

        Args:
            motion: Number of the motion of each place, shape (n,).
            share: Share of that motion, from 0 to 1, shape (n,).

        Returns:
            Shape (n, joints + 1, 4, 4).
        """
        begin = self.values[motion]
        return self.joints.frames(begin + share[:, None] * (self.values[motion + 1] - begin))

    def _plane_gaps(self, first_numbers: Numbers, second_numbers: Numbers, ends: Ends, normals: Matrix) -> Vector:
        """Compute lower bounds of the gaps between solids on intervals, along given normals.

        The gap is the least height of the first solid above the highest point of the second one, each taken at the end
        of the interval where it is worst.

        Args:
            first_numbers: Indices of the first solids, shape (n,).
            second_numbers: Indices of the second solids, shape (n,).
            ends: Poses of both in the pair's frame, at begin and end.
            normals: Unit normals in the pair's frame, pointing from the second solid to the first, shape (n, 3).

        Returns:
            The gaps [m], shape (n,); -inf where a normal does not have unit length.
        """
        # Extents along the normal: of the first solid against it, of the second one along it, at both ends.
        lengths = np.linalg.norm(normals, axis=1)
        heights = []
        numbers = (first_numbers, first_numbers, second_numbers, second_numbers)
        for solids, (rotations, origins), sign in zip(numbers, ends, (-1.0, -1.0, 1.0, 1.0), strict=True):
            directions = sign * normals / np.maximum(lengths, 0.5)[:, None]
            local_directions = rotated(rotations.transpose(0, 2, 1), directions)
            height = (origins * directions).sum(axis=1)
            for number in np.unique(solids).tolist():
                height[solids == number] += self.solids[number].support(local_directions[solids == number])
            heights.append(height)

        gaps = -np.maximum(*heights[:2]) - np.maximum(*heights[2:])
        return np.where(np.abs(lengths - 1.0) <= UNIT, gaps, -np.inf)

    def _not_shown_apart(self, entries: list[Entry], normals: Matrix | None = None) -> list[int]:
        """Return the indices of the entries whose solids are not shown apart.

        Entries with a plane are checked by that plane, all others by balls and boxes.

        Args:
            entries: The entries.
            normals: Normals of the planes, shape (entries, 3), 0 where an entry has none; None if there are no planes
                at all.
        """
        not_apart: list[int] = []
        for first in range(0, len(entries), AT_ONCE):
            columns = zip(*entries[first : first + AT_ONCE], strict=True)
            motion, pair, first_numbers, second_numbers, begins, widths = map(np.array, columns)

            shares = np.concatenate([begins, begins + widths])
            motions, places, where = places_of(np.concatenate([motion, motion]), shares)
            begin, end = where.reshape(2, -1)

            base = self.base_of_pair[pair]
            joints = self.joint_of_solid[first_numbers], self.joint_of_solid[second_numbers]
            ends = seen_from_base(self._frames(motions, places), (begin, end), joints, base)

            around = self.bounds.of(first_numbers), self.bounds.of(second_numbers)
            gaps, _ = ball_gaps(*around, ends, joints[1] == base)
            if normals is not None:
                plane_normals = normals[first : first + AT_ONCE]
                plane_gaps = self._plane_gaps(first_numbers, second_numbers, ends, plane_normals)
                gaps = np.where(plane_normals.any(axis=1), plane_gaps, gaps)

            # Both solids deviate from their chords by at most the sum of their sagittas.
            sagittas = 0.125 * self.accelerations[pair, motion] * widths**2
            apart = gaps > self.required_gaps[pair] + sagittas  # False for NaN
            not_apart += (first + np.flatnonzero(~apart)).tolist()
        return not_apart

    def _measured_apart(self, entry: Entry) -> bool:
        """Check whether coal's distance in the middle of an entry's interval proves two whole bodies apart on it.

        The distance has to exceed the required gap by the bodies' approach in half of the interval, and neither body
        may contain the other.
        """
        frames = self._frames(np.array([entry.motion]), np.array([entry.begin + 0.5 * entry.width]))[0]
        bodies = tuple(self.bodies[k] for k in self.pairs[entry.pair])
        approach = 0.5 * entry.width * self.approaches[entry.pair, entry.motion]
        required = self.required_gaps[entry.pair] + DISTANCE_TOLERANCE + approach
        solid = tuple(filled(body) for body in bodies)
        apart = next(measured(solid, ((0, 1),), frames, near_only=False)).distance > required
        whole_bodies = entry.solids_of_motion == self._on_all_of(entry.motion, entry.pair).solids_of_motion
        return bool(whole_bodies and apart and not Containment(bodies, ((0, 1),)).holds((0, 1), frames))

    def _on_all_of(self, motion: int, pair: int, a: int = -1, b: int = -1) -> Entry:
        """Return the entry for parts ``a`` and ``b`` of a pair, -1 for a whole body, on the whole of a motion."""
        i, j = self.pairs[pair]
        return Entry(motion, pair, self.solid_numbers[i, a], self.solid_numbers[j, b], 0.0, 1.0)

    def _fault_of(self, entry: Entry, what: str) -> str:
        pair = " and ".join(f"'{self.bodies[k].name}'" for k in self.pairs[entry.pair])
        return f"motion {entry.motion + 1}: {pair} {what} {entry.begin:g} to {entry.begin + entry.width:g} of it"

    def fault(self, motions: tuple[MotionEntries, ...]) -> str:
        """Return the first fault of the entries of a certificate; "" if they prove all pairs apart in all motions.

        First all given entries are checked: they have to name known parts, cover a motion without a gap, and be apart.
        All other pairs have to be apart by the balls and boxes of their bodies, or of all their parts.
        """
        # Convert the entries, which have to name known pairs, parts and levels.
        pair_numbers = {pair: k for k, pair in enumerate(self.pairs)}
        entries = list[Entry]()
        for number, motion in enumerate(motions):
            for (i, a, j, b), (level, k) in zip(motion.solids.tolist(), motion.intervals.tolist(), strict=True):
                if (i, j) not in pair_numbers or not {(i, a), (j, b)} <= self.solid_numbers.keys() or level > DEEPEST:
                    return f"motion {number + 1}: no parts {a} and {b} of a pair {i} and {j}, or no level {level}"
                width = 0.5**level
                solids = self.solid_numbers[i, a], self.solid_numbers[j, b]
                entries.append(Entry(number, pair_numbers[i, j], *solids, k * width, width))

        # The intervals of two solids in a motion have to cover it without a gap or an overlap.
        groups = groupby(sorted(entries), lambda entry: entry.solids_of_motion)
        covered = {key: list(intervals) for key, intervals in groups}
        for intervals in covered.values():
            ends = [entry.begin + entry.width for entry in intervals]
            if [0.0, *ends] != [*(entry.begin for entry in intervals), 1.0]:
                return self._fault_of(intervals[0], "have entries with a gap or an overlap, the first of them from")

        # All solids of entries have to be apart on their intervals.
        for k in self._not_shown_apart(entries, np.concatenate([motion.normals for motion in motions])):
            if not self._measured_apart(entries[k]):
                return self._fault_of(entries[k], "are not shown apart from")

        # Pairs without an entry have to be apart by balls and boxes: as whole bodies, or else all their parts.
        every_pair = (self._on_all_of(*both) for both in product(range(len(motions)), range(len(self.pairs))))
        of_bodies = [entry for entry in every_pair if entry.solids_of_motion not in covered]
        split = [of_bodies[k] for k in self._not_shown_apart(of_bodies)]
        of_parts = [part for entry in split for part in self._parts_of(entry) if part.solids_of_motion not in covered]

        open_parts = self._not_shown_apart(of_parts)
        return self._fault_of(of_parts[open_parts[0]], "are not shown apart from") if open_parts else ""

    def _parts_of(self, entry: Entry) -> list[Entry]:
        """Return entries for all pairs of parts of the two bodies of an entry, on the whole motion."""
        i, j = self.pairs[entry.pair]
        return [self._on_all_of(entry.motion, entry.pair, a, b) for a, b in product(self.parts[i], self.parts[j])]


def _common_joint(chain: Chain, first: int, second: int) -> int:
    """Return the last joint whose frame carries the frames of both joints, 0 for the world."""
    while first != second:  # parents have smaller numbers
        first, second = min(first, second), int(chain.parent[max(first, second) - 1]) + 1
    return first
