"""Two links whose convex pieces stick out of their meshes: proven apart by coal's distances where kernels cannot.

After Schwarzer, Saha and Latombe [16]: bodies whose distance at one place of a motion is larger than what they can
approach each other on an interval around it are apart in all of that interval. Coal knows surfaces alone: whether one
body is wholly inside another is asked once a motion, for a closed surface that is never met keeps what is inside.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.geometry.collision.bodies import DISTANCE_TOLERANCE, Body
from rrtik_ompl.geometry.collision.containment import Containment
from rrtik_ompl.geometry.collision.distances import measured
from rrtik_ompl.geometry.collision.motion_bound import approach_weights
from rrtik_ompl.geometry.collision.solids import is_closed, is_mesh
from rrtik_ompl.kernels.proof import layout
from rrtik_ompl.kernels.proof.log import logged
from rrtik_ompl.kernels.proof.packing import ProofPairs
from rrtik_ompl.model.certificate import MotionEntries
from rrtik_ompl.model.robot import Robot

MOST = 400  # distances for a pair in one motion: some tenths of a second
DEEPEST = 9  # level of an interval: 1/512 of a motion
SPARE = 1.01  # of the way that bodies come nearer: who verifies it may bound that by other balls
FAR = 1e6  # [m]; what may overlap by that is apart

Numbers: TypeAlias = NDArray[np.int32]
Told: TypeAlias = tuple[MotionEntries, NDArray[np.int64]]  # by kernels; links and intervals that coal measured


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
                margins[self.links & (bodies == bodies[pair[0]]).all(axis=1)] = -FAR
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
        approach = SPARE * float(approach_weights(self._robot, pair, [(0, 1)])[0] @ np.abs(motion[1] - motion[0]))
        if required_gap <= 0.0:  # they may overlap, and coal measures surfaces alone
            return []
        if Containment((*pair,), ((0, 1),)).holds((0, 1), self._robot.chain.joint_frames(motion[:1])[0]):
            return []

        def spare_at(share: float) -> float:
            """How much more than they must the two are apart at a share of the motion [m]."""
            return _gap(self._robot, pair, motion[0] + share * (motion[1] - motion[0])) - required_gap

        if spare_at(place) <= 0.0:
            return []

        intervals = list[tuple[int, int]]()
        undecided = [(0, 0)]
        measured_count = 0
        while undecided and measured_count < MOST:
            level, number = undecided.pop()
            measured_count += 1
            width = 0.5**level
            spare = spare_at((number + 0.5) * width)
            apart_on_interval = spare > 0.5 * approach * width
            if spare <= 0.0 or (not apart_on_interval and level == DEEPEST):
                return []
            if apart_on_interval:
                intervals.append((level, number))
            else:
                undecided += [(level + 1, 2 * number + 1), (level + 1, 2 * number)]

        return [] if undecided else intervals


def distance_between(robot: Robot, bodies: Sequence[Body], names: tuple[str, str], q: Vector) -> float:
    """The distance between bodies of two names at q, shape (dof,) [m]; nan if there are none."""
    first, second = ([body for body in bodies if body.name == name] for name in names)
    return min((_gap(robot, [a, b], q) for a in first for b in second), default=float("nan"))


def _gap(robot: Robot, pair: Sequence[Body], q: Vector) -> float:
    return next(measured(pair, [(0, 1)], robot.chain.joint_frames(q[None])[0], near_only=False)).distance


def _groups(packed: ProofPairs) -> Mask:
    """Which rows of the table are groups of bodies: these are made of pairs that come before them."""
    firsts = packed.table.pairs.reshape(-1, layout.PAIR_SIZE)[:, layout.PARTS_FIRST]
    groups: Mask = (packed.sides[:, [1, 3]] < 0).all(axis=1) & (firsts < np.arange(len(firsts)))
    return groups
