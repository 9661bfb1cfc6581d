"""Which configurations and motions are free of collision: kernels check, coal decides what they leave undecided.

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
from rrtik_ompl.collision.margins import kept_apart, request
from rrtik_ompl.collision.motion_bound import approach_weights
from rrtik_ompl.collision.solids import around
from rrtik_ompl.covers.cache import cached_inner_spheres, cached_outer_cover
from rrtik_ompl.fast import FREE, UNDECIDED, FastWorld, needs_covers
from rrtik_ompl.fast.tables.solid_tables import convex_solids
from rrtik_ompl.robot import Robot

STROKE_ROOM = 1e-3  # [m] beyond the limits of sliding joints
ROOM = 1e-5  # [m] taken off coal's distances
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
        spheres, arm = _all_spheres(robot, bodies), _arm(robot)
        self.fast = arm.latest = _packed(robot, bodies, pairs, spheres, arm.latest)
        self._robot, self._bodies = robot, bodies
        self._data = robot.model.createData()
        self._standing = {k: self._transform(k) for k, body in enumerate(bodies) if body.joint == 0}
        self._approaches = dict(zip(pairs, approach_weights(robot, bodies, pairs), strict=True))
        self._containment = Containment(bodies, pairs, [outer for outer, _ in spheres])

    def as_conservative(self, conservative: bool) -> CollisionChecks:
        """The same checks, conservative or not; shares the tables."""
        other = copy.copy(self)
        other.conservative = conservative
        return other

    def free(self, rows: Matrix) -> Mask:
        """Which rows, shape (m, dof), are free of collision. Shape (m,)."""
        answers = self.fast.classify(self._robot.joint_values(rows), narrow_phase=not self.conservative)
        free: Mask = answers == FREE
        if not self.conservative:
            open_ = rows[answers == UNDECIDED]
            marked = self.fast.undecided_pairs(self._robot.joint_values(open_))
            configurations = self._robot.pinocchio_configuration(open_)
            apart = [self._gaps(full, pairs) is not None for full, pairs in zip(configurations, marked, strict=True)]
            free[answers == UNDECIDED] = apart
        return free

    def motions_free(self, starts: Matrix, ends: Matrix, steps: NDArray[np.int64]) -> Mask:
        """Which straight motions, shape (m, dof), are free at all k / steps, k = 0..steps. Shape (m,)."""
        sides = self._robot.joint_values(starts), self._robot.joint_values(ends)
        answers = self.fast.classify_edges(*sides, steps, narrow_phase=not self.conservative)
        free: Mask = answers == FREE
        if not self.conservative:
            for k in np.flatnonzero(answers == UNDECIDED):
                free[k] = self._motion_settled(starts[k], ends[k], int(steps[k]))
        return free

    def _motion_settled(self, start: Vector, end: Vector, steps: int) -> bool:
        """Whether a motion is free, by coal.

        Two bodies that are some distance apart at one of the motion's configurations are so far from touching that
        its neighbours need no question about this pair.
        """
        order = spread_order(steps)
        rows = (1.0 - order / steps)[:, None] * start + (order / steps)[:, None] * end
        open_ = self.fast.classify(self._robot.joint_values(rows)) != FREE
        rows, order = rows[open_], order[open_]
        marked = self.fast.undecided_pairs(self._robot.joint_values(rows))
        travel = np.abs(end - start)
        cleared: dict[tuple[int, int], Mask] = {}
        for place, full, pairs in zip(
            order.astype(int).tolist(), self._robot.pinocchio_configuration(rows), marked, strict=True
        ):
            left = [pair for pair in pairs if pair not in cleared or not cleared[pair][place]]
            gaps = self._gaps(full, left) if left else []
            if gaps is None:
                return False
            for pair, gap in zip(left, gaps, strict=True):
                approach = float(self._approaches[pair] @ travel)  # [m] along the whole motion
                reach = int(min(steps * max(gap - ROOM, 0.0) / approach, steps)) if approach > 0.0 else steps
                mask = cleared.setdefault(pair, np.zeros(steps + 1, dtype=bool))
                mask[max(place - reach, 0) : place + reach + 1] = True
        return True

    def _gaps(self, full: Vector, pairs: list[tuple[int, int]]) -> list[float] | None:
        """Lower bounds of how far pairs of bodies are from touching [m], or None if two of them touch, by coal.

        Bodies touch that do not keep their margin.

        Args:
            full: Pinocchio's configuration vector.
            pairs: Numbers of the bodies.
        """
        pin.forwardKinematics(self._robot.model, self._data, full)
        transforms: dict[int, Any] = {}
        gaps = []
        for i, j in pairs:
            for k in (i, j):
                if k not in transforms:
                    transforms[k] = self._standing.get(k) or self._transform(k)
            ends = (self._bodies[i].geometry, transforms[i], self._bodies[j].geometry, transforms[j])
            gap = distance(*ends, kept_apart(self._bodies[i], self._bodies[j]))
            if gap is None:
                return None
            gaps.append(gap)
        return None if self._containment.between(pairs, self._data.oMi) else gaps

    def _transform(self, number: int) -> Any:
        """Coal's pose of a body in the world."""
        body = self._bodies[number]
        pose = self._data.oMi[body.joint] * body.placement
        return coal.Transform3s(pose.rotation, pose.translation)


def distance(first: Any, first_pose: Any, second: Any, second_pose: Any, margin: float = 0.0) -> float | None:
    """A lower bound of the distance of two coal geometries at coal's poses less a margin [m], None if it is not kept.

    For solids coal's answer to "do they touch" comes with the distance. Meshes take much longer, so their hulls are
    asked first: where those are apart, the meshes are.
    """
    result = coal.CollisionResult()
    hulls = around(first), around(second)
    if not coal.collide(hulls[0], first_pose, hulls[1], second_pose, request(margin), result):
        return float(result.distance_lower_bound)
    if hulls[0] is first and hulls[1] is second:
        return None
    result = coal.CollisionResult()
    if coal.collide(first, first_pose, second, second_pose, request(margin), result):
        return None
    return float(result.distance_lower_bound)


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


def fast_world(robot: Robot, bodies: Sequence[Body], pairs: Pairs, *, share: bool = True) -> FastWorld:
    """Tables of bodies, those of the robot's links first; with ``share`` the arm's are those of its last world."""
    arm = _arm(robot)
    packed = _packed(robot, bodies, pairs, _all_spheres(robot, bodies), arm.latest if share else None)
    arm.latest = packed if share else arm.latest
    return packed


def _packed(
    robot: Robot, bodies: Sequence[Body], pairs: Pairs, spheres: Sequence[Spheres], like: FastWorld | None
) -> FastWorld:
    """The tables of a world; those of the arm are taken over from another one where they fit."""
    outer, inner = ([both[k] for both in spheres] for k in (0, 1))
    solids = [convex_solids(body.geometry) for body in bodies]
    covers: dict[str, Any] = {"outer": outer, "inner": inner, "solids": solids}
    return FastWorld(robot.chain, bodies, pairs, **covers, strokes=_strokes(robot), like=like)


def _all_spheres(robot: Robot, bodies: Sequence[Body]) -> tuple[Spheres, ...]:
    """Spheres of all bodies, those of the robot's links first."""
    links = _arm(robot).spheres
    return (*links, *(_spheres(body) for body in bodies[len(links) :]))


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
