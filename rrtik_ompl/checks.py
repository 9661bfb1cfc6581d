"""Which configurations and motions are free of collision: kernels judge, coal settles what they leave undecided.

The kernels' "free" and "colliding" are certain (:mod:`rrtik_ompl.fast`), so every answer is coal's own, and coal is
asked about few configurations and, of these, about few pairs. It is asked with fresh requests: reused collision data
start from the last support points and have been seen to miss overlaps.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.arrays import Mask, Matrix, Vector
from rrtik_ompl.collision.bodies import Body, link_bodies
from rrtik_ompl.collision.containment import Containment
from rrtik_ompl.fast import FREE, UNDECIDED, FastWorld, needs_covers
from rrtik_ompl.fast.cover_cache import cached_inner_spheres, cached_outer_cover
from rrtik_ompl.robot import Robot

STROKE_ROOM = 1e-3  # [m] beyond the limits of sliding joints
NO_SPHERES = np.empty((0, 4))

Pairs = tuple[tuple[int, int], ...]
Spheres = tuple[Matrix, Matrix]  # around and inside a body


class CollisionChecks:
    """Collision checks of configurations within the robot's limits and of straight motions between them.

    Attributes:
        fast: The same pairs for the kernels.
        conservative: Whether what the kernels leave undecided counts as colliding.
    """

    def __init__(self, robot: Robot, bodies: tuple[Body, ...], pairs: Pairs, *, conservative: bool = False) -> None:
        self.conservative = conservative
        self.fast = _packed(robot, bodies, pairs)
        self._robot, self._bodies = robot, bodies
        self._data = robot.model.createData()
        self._containment = Containment(bodies, pairs)

    def as_conservative(self, conservative: bool) -> CollisionChecks:
        """The same checks, conservative or not; shares the tables."""
        other = copy.copy(self)
        other.conservative = conservative
        return other

    def free(self, rows: Matrix) -> Mask:
        """Which rows, shape (m, dof), are free of collision. Shape (m,)."""
        answers = self.fast.classify(self.values(rows), prove=not self.conservative)
        free: Mask = answers == FREE
        if not self.conservative:
            for k in np.flatnonzero(answers == UNDECIDED):
                free[k] = self._settled(rows[k])
        return free

    def motions_free(self, starts: Matrix, ends: Matrix, steps: NDArray[np.int64]) -> Mask:
        """Which straight motions, shape (m, dof), are free at all k / steps, k = 0..steps. Shape (m,)."""
        sides = self.values(starts), self.values(ends)
        answers = self.fast.classify_edges(*sides, steps, prove=not self.conservative)
        free: Mask = answers == FREE
        if not self.conservative:
            for k in np.flatnonzero(answers == UNDECIDED):
                free[k] = self._motion_settled(starts[k], ends[k], int(steps[k]))
        return free

    def values(self, rows: Matrix) -> Matrix:
        """Joint values of configurations, mimic joints resolved, shape (m, joints)."""
        chain = self._robot.chain
        return rows @ chain.gain.T + chain.offset

    def _motion_settled(self, start: Vector, end: Vector, steps: int) -> bool:
        shares = (spread_order(steps) / steps)[:, None]
        rows = (1.0 - shares) * start + shares * end
        open_rows = rows[self.fast.classify(self.values(rows), prove=False) != FREE]
        return all(self._settled(row) for row in open_rows)

    def _settled(self, row: Vector) -> bool:
        """Whether a configuration is free, by coal."""
        pairs = self.fast.undecided_pairs(self.values(row[None])[0])
        pin.forwardKinematics(self._robot.model, self._data, self._robot.lift(row[None])[0])
        transforms: dict[int, Any] = {}
        for pair in pairs:
            for k in pair:
                if k not in transforms:
                    body = self._bodies[k]
                    pose = self._data.oMi[body.joint] * body.placement
                    transforms[k] = coal.Transform3s(pose.rotation, pose.translation)
            first, second = (self._bodies[k].geometry for k in pair)
            ends = (first, transforms[pair[0]], second, transforms[pair[1]])
            if coal.collide(*ends, coal.CollisionRequest(), coal.CollisionResult()):
                return False
        if not self._containment.pairs:
            return True
        return not self._containment.first(np.array([placement.homogeneous for placement in self._data.oMi]))


def spread_order(count: int) -> NDArray[np.float64]:
    """0..count with both ends first, then middles of ever finer halves, so that a collision shows early."""
    levels = [np.array([0, count])]
    step = 1 << max(count - 1, 1).bit_length()
    while step > 1:
        levels.append(np.arange(step // 2, count, step))
        step //= 2
    return np.concatenate(levels).astype(np.float64)


@dataclass(slots=True, eq=False)
class _Arm:
    """What all worlds of a robot share: the spheres of its links, and the tables that the last world packed."""

    spheres: tuple[Spheres, ...]
    latest: FastWorld | None = field(default=None)


@lru_cache(maxsize=16)
def _arm(robot: Robot) -> _Arm:
    return _Arm(tuple(_spheres(body) for body in link_bodies(robot)))


def _packed(robot: Robot, bodies: Sequence[Body], pairs: Pairs) -> FastWorld:
    """The tables of a world; those of the arm are taken over from the robot's last world where they fit."""
    arm = _arm(robot)
    spheres = (*arm.spheres, *(_spheres(body) for body in bodies[len(arm.spheres) :]))
    outer, inner = ([both[k] for both in spheres] for k in (0, 1))
    packed = FastWorld(robot.chain, bodies, pairs, outer=outer, inner=inner, strokes=_strokes(robot), like=arm.latest)
    arm.latest = packed
    return packed


def _spheres(body: Body) -> Spheres:
    outer, inner = needs_covers(body)
    return (
        cached_outer_cover(body.geometry) if outer else NO_SPHERES,
        cached_inner_spheres(body.geometry) if inner else NO_SPHERES,
    )


def _strokes(robot: Robot) -> Vector:
    """How far the limits let each joint of the chain go from its zero, shape (joints,); 0 for what turns for ever."""
    ends = np.maximum(np.abs(robot.lower), np.abs(robot.upper))
    ends = np.where(np.isfinite(ends), ends, 0.0)
    reached: Vector = np.abs(robot.chain.gain) @ ends + np.abs(robot.chain.offset) + STROKE_ROOM
    return reached
