"""A judge of motions of the tip by pinocchio's kinematics and coal's collisions alone; the pairs are the world's.

It also follows lines itself, by many small steps of Newton's method, to see how far one can come.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pinocchio as pin

from bench.shared.judge import Contacts
from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.world.world import World

SAMPLES = 50  # of each motion
POINTS = 1500  # of a line that is followed by brute force
NEWTON_STEPS = 30
ARRIVED = 1e-9  # [m], [rad]
JUMP = 0.1  # [rad] of a joint between two points of the line
EVERY = 5  # points of the line at which collisions are looked for
TOUCHES = 1e-6  # [m]
NEAR, TURNED = 1e-4, np.radians(0.1)  # [m], [rad]


class Judge:
    """One world, seen through pinocchio and coal."""

    def __init__(self, world: World) -> None:
        self.robot = world.robot
        self.model, self.data = world.robot.model, world.robot.model.createData()
        self.frame = self.model.getFrameId(world.robot.tip)
        self._contacts = Contacts(world)

    def tip(self, q: Vector) -> pin.SE3:
        """T_world_tip."""
        pin.framesForwardKinematics(self.model, self.data, self.robot.pinocchio_configuration(q)[0])
        return self.data.oMf[self.frame].copy()

    def depth(self, q: Vector) -> float:
        """How deep anything enters anything else [m]; 0 if nothing touches."""
        return max((max(depth, TOUCHES) for depth in self._contacts.depths(q)), default=0.0)

    def strays(self, rows: Matrix, begin: pin.SE3, end: pin.SE3, samples: int = SAMPLES) -> tuple[float, float]:
        """How far the tip leaves a line between two poses at some samples of each motion [m, rad].

        Each sample is compared with the point of the line that is nearest to its place, or with one so near to that
        that the orientation fits better and the place is still within 0.1 mm.
        """
        way = end.translation - begin.translation
        length, turn = float(np.linalg.norm(way)), pin.log3(begin.rotation.T @ end.rotation)
        off, twisted = 0.0, 0.0
        for a, b in pairwise(rows):
            for share in np.linspace(0.0, 1.0, samples + 1):
                tip = self.tip(a + share * (b - a))
                away = tip.translation - begin.translation
                along = float(away @ way) / length**2
                aside = float(np.linalg.norm(away - along * way))
                reach = np.sqrt(max(NEAR**2 - aside**2, 0.0)) / length

                def twist(s: float, tip: pin.SE3 = tip) -> float:
                    return float(np.linalg.norm(pin.log3((begin.rotation @ pin.exp3(s * turn)).T @ tip.rotation)))

                found = twist(along)
                if found > TURNED:
                    found, along_best = min((twist(along + d), d) for d in np.linspace(-reach, reach, 21))
                    aside = float(np.hypot(aside, along_best * length))
                off, twisted = max(off, aside), max(twisted, found)
        return off, twisted

    def cuts(self, rows: Matrix, every: int = 10) -> float:
        """How deep a path enters anything at every so many-th of those samples [m]."""
        deepest = 0.0
        for a, b in pairwise(rows):
            for share in np.linspace(0.0, 1.0, SAMPLES // every + 1):
                deepest = max(deepest, self.depth(a + share * (b - a)))
        return deepest

    def farthest(
        self, q: Vector, begin: pin.SE3, end: pin.SE3, pull: Callable[[Vector], Vector] | None = None
    ) -> float:
        """Share of the line that small steps cover from q; ``pull`` moves what the pose leaves free."""
        way, turn = end.translation - begin.translation, pin.log3(begin.rotation.T @ end.rotation)
        for k in range(1, POINTS + 1):
            share = k / POINTS
            goal = pin.SE3(begin.rotation @ pin.exp3(share * turn), begin.translation + share * way)
            after = self._newton(q if pull is None else q + pull(q) / POINTS, goal)
            if after is None or np.abs(after - q).max() > JUMP or not self._inside(after):
                return (k - 1) / POINTS
            if k % EVERY == 0 and self.depth(after) > 0.0:
                return (k - EVERY) / POINTS
            q = after
        return 1.0

    def _inside(self, q: Vector) -> bool:
        return bool((q >= self.robot.lower - 1e-9).all() and (q <= self.robot.upper + 1e-9).all())

    def _newton(self, q: Vector, goal: pin.SE3) -> Vector | None:
        for _ in range(NEWTON_STEPS):
            full = self.robot.pinocchio_configuration(q)[0]
            pin.computeJointJacobians(self.model, self.data, full)
            tip = pin.updateFramePlacement(self.model, self.data, self.frame)
            error = pin.log6(tip.actInv(goal)).vector
            if np.abs(error).max() <= ARRIVED:
                return q
            jacobian = pin.getFrameJacobian(self.model, self.data, self.frame, pin.LOCAL) @ self.robot.chain.gain
            q = q + np.linalg.pinv(jacobian, 1e-7) @ error
        return None
