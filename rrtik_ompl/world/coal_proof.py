"""Two links whose convex pieces stick out of their meshes: proven apart by coal's distances where kernels cannot.

After Schwarzer, Saha and Latombe [16]: bodies whose distance at one place of a motion is larger than what they can
approach each other on an interval around it are apart in all of that interval. Coal knows surfaces alone: whether one
body is wholly inside another is asked once a motion, for a closed surface that is never met keeps what is inside.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Mask, Matrix, Vector
from rrtik_ompl.collision.bodies import Body
from rrtik_ompl.collision.contacts import measured
from rrtik_ompl.collision.containment import Containment
from rrtik_ompl.collision.margins import DISTANCE_TOLERANCE
from rrtik_ompl.collision.motion_bound import approach_weights
from rrtik_ompl.collision.solids import is_closed, is_mesh
from rrtik_ompl.fast.proof import layout
from rrtik_ompl.fast.proof.packing import ProofPairs
from rrtik_ompl.robot import Robot

MOST = 400  # distances for a pair in one motion: some tenths of a second
NARROWEST = 1.0 / 512.0  # of a motion
FAR = 1e6  # [m]; what may overlap by that is apart


class CoalProof:
    """What kernels leave open of motions, settled by coal where it is about two links, one of them a closed mesh.

    Attributes:
        links: Which pairs of the table are such, shape (pairs,).

    Args:
        robot: The arm.
        bodies: Its bodies and others.
        packed: The table that the kernels read.
    """

    def __init__(self, robot: Robot, bodies: Sequence[Body], packed: ProofPairs) -> None:
        self._robot, self._bodies, self._packed = robot, bodies, packed
        own = [body.kind != "obstacle" for body in bodies]
        meshes = np.array([mine and is_mesh(body.geometry) for mine, body in zip(own, bodies, strict=True)], dtype=bool)
        hollow = np.array([mesh and not is_closed(bodies[k].geometry) for k, mesh in enumerate(meshes)], dtype=bool)
        mixed = meshes[packed.bodies].any(axis=1) & ~hollow[packed.bodies].any(axis=1)
        self.links: Mask = mixed & ~packed.beside_obstacle & ~_groups(packed)

    def settle(self, motion: Matrix, pair: NDArray[np.int32], place: Vector, again: Callable[[], object]) -> None:
        """Compare links by coal until nothing is left open of a motion, shape (2, dof), or what it cannot settle.

        Args:
            motion: Its ends.
            pair: Number of the pair of links that is not proven apart, shape (1,); written, -1 for none.
            place: Where, shape (1,); written.
            again: Lets the kernels prove the motion once more, and write both.
        """
        margins, bodies = self._packed.table[layout.MARGINS], self._packed.bodies
        kept = margins.copy()
        try:
            while pair[0] >= 0 and self.links[pair[0]] and self._apart(motion, int(pair[0]), float(place[0])):
                margins[self.links & (bodies == bodies[pair[0]]).all(axis=1)] = -FAR
                again()
        finally:
            margins[:] = kept

    def _apart(self, motion: Matrix, row: int, place: float) -> bool:
        """Whether the two bodies of a pair are apart in all of a motion; looked at first where kernels gave up."""
        pair = [self._bodies[k] for k in self._packed.bodies[row].tolist()]
        kept = float(self._packed.table[layout.MARGINS][row]) + DISTANCE_TOLERANCE
        way = float(approach_weights(self._robot, pair, [(0, 1)])[0] @ np.abs(motion[1] - motion[0]))
        if kept <= 0.0 or Containment((*pair,), ((0, 1),)).holds((0, 1), self._robot.joint_frames(motion[:1])[0]):
            return False
        open_, looks = [(0.0, 1.0), (place, place)], 0
        while open_ and looks < MOST:
            low, high = open_.pop()
            middle, half, looks = 0.5 * (low + high), 0.5 * (high - low), looks + 1
            room = _gap(self._robot, pair, motion[0] + middle * (motion[1] - motion[0])) - kept
            if room <= 0.0 or (room <= way * half and half < NARROWEST):
                return False
            if room <= way * half:
                open_ += [(middle, high), (low, middle)]
        return not open_


def distance_between(robot: Robot, bodies: Sequence[Body], names: tuple[str, str], q: Vector) -> float:
    """The distance between bodies of two names at q, shape (dof,) [m]; nan if there are none."""
    one, other = ([body for body in bodies if body.name == name] for name in names)
    return min((_gap(robot, [a, b], q) for a in one for b in other), default=float("nan"))


def _gap(robot: Robot, pair: Sequence[Body], q: Vector) -> float:
    return next(measured(pair, [(0, 1)], robot.joint_frames(q[None])[0], near_only=False)).distance


def _groups(packed: ProofPairs) -> Mask:
    """Which rows of the table are groups of bodies: these are made of pairs that come before them."""
    firsts = packed.table[layout.PAIRS].reshape(-1, layout.PAIR_SIZE)[:, layout.PARTS_FIRST]
    groups: Mask = (packed.sides[:, [1, 3]] < 0).all(axis=1) & (firsts < np.arange(len(firsts)))
    return groups
