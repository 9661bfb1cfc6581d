"""Proofs by coal's distances, for pairs of bodies that kernels leave unproven, and planes for bodies in contact.

Bodies in contact overlap, so no plane separates them, and a search for their distance may find none. Their proof needs
a plane beyond which neither body reaches deeper than it may. The contact normal that coal reports gives such a plane,
and :func:`suggest_planes` lets the kernels begin with it where their own search has failed.

The kernels represent a link by convex pieces around its mesh. Where the pieces of two links are too close to be proven
apart, coal's distances between the meshes are used instead (:class:`CoalProof`), after Schwarzer, Saha and Latombe
[16]: if the distance of two bodies at one configuration of a motion exceeds a bound on their approach within an
interval around it, they are apart in the whole interval. Coal measures distances between surfaces, so one body could be
wholly inside the other. This is checked once per motion, which suffices: a body cannot leave a closed surface without
touching it. Parts of a motion that kernels prove for themselves need neither distances nor that check. An open mesh
of a link is measured with the faces of the boxes that it encloses.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import TypeAlias

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.geometry.collision.bodies import DISTANCE_TOLERANCE, Body
from rrtik_ompl.geometry.collision.cloud_solid import CloudSolid
from rrtik_ompl.geometry.collision.containment import Containment, filled, has_inside
from rrtik_ompl.geometry.collision.distances import measured
from rrtik_ompl.geometry.collision.motion_bound import approach_weights
from rrtik_ompl.geometry.collision.solids import around, is_mesh
from rrtik_ompl.kernels.proof import layout
from rrtik_ompl.kernels.proof.log import logged
from rrtik_ompl.kernels.proof.packing import ProofPairs
from rrtik_ompl.model.certificate import MotionEntries
from rrtik_ompl.model.robot import Robot

PROVEN, NOT_LOOKED_AT = -1, -2  # written in place of the index of an unproven pair
MOST_DISTANCES = 400  # largest number of coal distances for a pair in one motion, which take some tenths of a second
DEEPEST_LEVEL = 9  # largest level of an interval in a bisection, 2^-9 of a motion
# Factor on the bound of the approach of two bodies, because a verifier may bound it by other balls.
APPROACH_SPARE = 1.01
FAR_APART = 1e6  # [m]; a pair with the margin -FAR_APART is always proven apart
HOPEFUL = 4.0  # factor on the width of an interval around a place that its distance makes sure of
SLOWEST = 1e-9  # [m] least approach of two bodies over a motion that is divided by
Numbers: TypeAlias = NDArray[np.int32]
FramesAt: TypeAlias = Callable[[float], Matrix]
PartProven: TypeAlias = Callable[[float, float], bool]  # of shares of a motion, its begin and its end
Told: TypeAlias = tuple[MotionEntries, NDArray[np.int64]]  # the kernels' log of a motion; see CoalProof.settle


class CoalProof:
    """Proofs by coal's distances, for pairs of links that kernels leave unproven and of which one is a mesh.

    Attributes:
        packed: The table that the kernels read.
        links: Which pairs of the table can be proven this way, shape (pairs,).

    Args:
        robot: The arm.
        bodies: All bodies of the world.
        packed: See above.
    """

    def __init__(self, robot: Robot, bodies: Sequence[Body], packed: ProofPairs) -> None:
        self._robot = robot
        self._bodies = bodies
        self.packed = packed
        # Select the pairs with a mesh of the arm that has an inside: an open one has it if it is of a link.
        is_mesh_of_arm = [body.kind != "obstacle" and is_mesh(body.geometry) for body in bodies]
        has_insides = [mesh and has_inside(body) for mesh, body in zip(is_mesh_of_arm, bodies, strict=True)]
        is_solid = np.array(has_insides, dtype=bool)  # a world may have no bodies
        is_hollow = np.array(is_mesh_of_arm, dtype=bool) & ~is_solid
        has_mesh = is_solid[packed.bodies].any(axis=1) & ~is_hollow[packed.bodies].any(axis=1)
        self.links: Mask = has_mesh & ~packed.beside_obstacle & ~_groups(packed)

    def settle(
        self,
        motion: Matrix,
        pair: Numbers,
        place: Vector,
        again: Callable[[], object],
        part_proven: PartProven = lambda begin, end: False,
    ) -> NDArray[np.int64]:
        """Prove pairs of links apart by coal, until a motion has no unproven pair or one that coal cannot settle.

        Each pair that coal proves apart is excluded from the table, and the kernels prove the motion again. The table
        is restored at the end.

        Args:
            motion: Start and end configuration, shape (2, dof).
            pair: Index of the pair of the table that is not proven apart, shape (1,). Written in place; -1 for none.
            place: Share of the motion where its proof failed, shape (1,). Written in place.
            again: Lets the kernels prove the motion once more, and write ``pair`` and ``place``.
            part_proven: Whether kernels prove a part of the motion, given as two shares; nothing is measured on it.

        Returns:
            Intervals on which coal proves two links apart, shape (n, 4): the numbers of the links, and the level and
                number of the interval, in whose middle their distance is measured.
        """
        margins = self.packed.table.margins
        bodies = self.packed.bodies
        solids = self.packed.sides

        @cache
        def frames_at(share: float) -> Matrix:
            row = motion[0] + share * (motion[1] - motion[0])
            return np.asarray(self._robot.chain.joint_frames(row[None])[0])

        original_margins = margins.copy()
        intervals_of_links = list[list[int]]()
        try:
            while pair[0] >= 0 and self.links[pair[0]]:
                intervals = self._intervals(motion, int(pair[0]), float(place[0]), part_proven, frames_at)
                if intervals is None:
                    break
                intervals_of_links += [[*solids[pair[0], ::2].tolist(), *interval] for interval in intervals]
                margins[np.flatnonzero(self.links & (bodies == bodies[pair[0]]).all(axis=1))] = -FAR_APART
                again()
        finally:
            margins[:] = original_margins

        return np.array(intervals_of_links, dtype=np.int64).reshape(-1, 4)

    def logged(self, motion: Matrix, pair: Numbers, place: Vector, run: Callable[[], object]) -> Told:
        """Prove a motion by the kernels and :meth:`settle`; return the kernels' log and the intervals of coal.

        Args:
            motion: As of :meth:`settle`.
            pair: As of :meth:`settle`.
            place: As of :meth:`settle`.
            run: Lets the kernels prove the motion, and write ``pair`` and ``place``.
        """
        logs = [logged(self.packed, run)]
        intervals_of_links = self.settle(motion, pair, place, lambda: logs.append(logged(self.packed, run)))
        return logs[-1], intervals_of_links

    def _intervals(
        self, motion: Matrix, row: int, place: float, part_proven: PartProven, frames_at: FramesAt
    ) -> list[tuple[int, int]] | None:
        """Cover what kernels do not prove of a motion by intervals on each of which two bodies are apart, by bisection.

        The distance in the middle of an interval is compared with a bound on how far the bodies approach each other in
        half of it. Where it is too small the interval is halved.

        Args:
            motion: Start and end configuration, shape (2, dof).
            row: Index of the pair in the table.
            place: Share of the motion where the kernels failed; it is measured first.
            part_proven: As of :meth:`settle`.
            frames_at: The pose of every joint frame at a share of the motion.

        Returns:
            Level and number of each interval; number k of level n is [k, k + 1] / 2^n of the motion. None if the
            bodies are not proven apart on the whole motion.
        """
        pair = [self._bodies[k] for k in self.packed.bodies[row].tolist()]
        solid = [filled(body) for body in pair]
        required_gap = float(self.packed.table.margins[row]) + DISTANCE_TOLERANCE
        approach = APPROACH_SPARE * float(
            approach_weights(self._robot, pair, [(0, 1)])[0] @ np.abs(motion[1] - motion[0])
        )
        # Bodies that may overlap cannot be settled, for coal measures the distance of surfaces alone.
        if required_gap <= 0.0:
            return None

        def spare_at(share: float) -> float:
            """Return the distance of the bodies at a share of the motion minus the required gap [m]."""
            return _gap(solid, frames_at(share)) - required_gap

        spare_at_place = spare_at(place)
        if spare_at_place <= 0.0:
            return None

        # Around the place nothing is measured on intervals that are much too wide for its distance.
        widest = HOPEFUL * spare_at_place / max(approach, SLOWEST)
        intervals = list[tuple[int, int]]()
        undecided = [(0, 0)]
        some_by_kernels = False
        measured_count = 0
        while undecided and measured_count < MOST_DISTANCES:
            level, number = undecided.pop()
            width = 0.5**level
            begin = number * width
            if level > 0 and part_proven(begin, begin + width):
                some_by_kernels = True
                continue
            if width > widest and begin <= place <= begin + width and level < DEEPEST_LEVEL:
                undecided += [(level + 1, 2 * number + 1), (level + 1, 2 * number)]
                continue

            measured_count += 1
            # From the middle to either end of the interval the bodies approach by at most 0.5 * approach * width.
            spare = spare_at((number + 0.5) * width)
            apart_on_interval = spare > 0.5 * approach * width
            if spare <= 0.0 or (not apart_on_interval and level == DEEPEST_LEVEL):
                return None
            if apart_on_interval:
                intervals.append((level, number))
            else:
                undecided += [(level + 1, 2 * number + 1), (level + 1, 2 * number)]

        # Where kernels prove something, neither body is inside the other.
        if undecided:
            return None
        if not some_by_kernels and Containment((*pair,), ((0, 1),)).holds((0, 1), frames_at(0.0)):
            return None
        return intervals


def distance_between(robot: Robot, bodies: Sequence[Body], names: tuple[str, str], q: Vector) -> float:
    """Return the least distance [m] between bodies with two names at q, shape (dof,); NaN if there are none."""
    first, second = ([body for body in bodies if body.name == name] for name in names)
    frames = robot.chain.joint_frames(q[None])[0]
    return min((_gap([a, b], frames) for a in first for b in second), default=float("nan"))


def _gap(pair: Sequence[Body], frames: Matrix) -> float:
    return next(measured(pair, [(0, 1)], frames, near_only=False)).distance


def _groups(packed: ProofPairs) -> Mask:
    """Return which rows of the table are groups of bodies, whose parts are pairs in earlier rows, shape (pairs,)."""
    firsts = packed.table.pairs.reshape(-1, layout.PAIR_SIZE)[:, layout.PARTS_FIRST]
    groups: Mask = (packed.sides[:, [1, 3]] < 0).all(axis=1) & (firsts < np.arange(len(firsts)))
    return groups


def suggest_planes(robot: Robot, bodies: Sequence[Body], packed: ProofPairs, ends: Matrix) -> None:
    """Let the kernels try the contact normals at the ends of a motion as first planes.

    Args:
        robot: The arm.
        bodies: All bodies of the world.
        packed: The table. The normals are written into ``packed.table.ways``, in the frame of each pair.
        ends: Start and end configuration, shape (2, dof).
    """
    frames = robot.joint_frames(ends)
    normals_of_rows = packed.table.ways.reshape(-1, 3)
    bases = packed.table.pairs.reshape(-1, layout.PAIR_SIZE)[:, layout.PAIR_BASE]
    normal_of_solids: dict[tuple[int, int], tuple[int, Vector]] = {}

    for row in packed.touching:
        first, second = packed.sides[row, ::2].tolist()
        if (first, second) not in normal_of_solids:
            normal_of_solids[first, second] = _normal((bodies[second], bodies[first]), frames)
        end, normal = normal_of_solids[first, second]
        normals_of_rows[row] = frames[end, bases[row], :3, :3].T @ normal
        packed.table.way_stamps[row] = layout.SUGGESTED


def _normal(pair: tuple[Body, Body], frames: Matrix) -> tuple[int, Vector]:
    """Return the contact normal of two bodies at that end of a motion where they are nearer to each other.

    Args:
        pair: The bodies.
        frames: Joint frames at both ends of the motion, shape (2, joints + 1, 4, 4).

    Returns:
        Index of that end, 0 or 1, and the unit vector from the first body to the second, shape (3,); zero for clouds.
    """
    if any(isinstance(body.geometry, CloudSolid) for body in pair):
        return 0, np.zeros(3)  # no suggestion: the kernels search for a plane themselves

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
