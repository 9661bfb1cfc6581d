"""Judges of collisions for reports: poses by Pinocchio, solids by coal, and nothing of the checks of a world."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.world.world import World


def placed(pose: pin.SE3) -> coal.Transform3s:
    """A pose as coal takes it."""
    return coal.Transform3s(pose.rotation, pose.translation)


def distance(first: Any, pose: pin.SE3, second: Any, place: pin.SE3) -> float:
    """Distance of two solids at their poses by coal [m], below 0 if they overlap."""
    ends = first, placed(pose), second, placed(place)
    return float(coal.distance(*ends, coal.DistanceRequest(), coal.DistanceResult()))


def overlap(first: Any, pose: pin.SE3, second: Any, place: pin.SE3) -> float | None:
    """How deep two solids are in each other by coal's contacts [m]; None if they do not touch."""
    result = coal.CollisionResult()
    if not coal.collide(first, placed(pose), second, placed(place), coal.CollisionRequest(), result):
        return None
    return max(float(abs(contact.penetration_depth)) for contact in result.getContacts())


class Contacts:
    """The bodies of a world, of which the pairs that must not touch are looked at.

    Args:
        world: Its bodies and pairs are read; no check of it is used.
    """

    def __init__(self, world: World) -> None:
        self._robot, self._bodies = world.robot, world.bodies
        self._model, self._data = world.robot.model, world.robot.model.createData()
        pairs = [pair for pair in world.pairs if any(self._bodies[k].joint for k in pair)]
        self._pairs = np.array(pairs, dtype=int).reshape(-1, 2)
        for body in self._bodies:
            body.geometry.computeLocalAABB()
        self._middles = [body.geometry.aabb_center for body in self._bodies]
        self._reach = np.array([body.geometry.aabb_radius for body in self._bodies])

    def depths(self, q: Vector) -> Iterator[float]:
        """Of each pair that touches at a configuration, shape (dof,), how deep it overlaps [m]."""
        pin.forwardKinematics(self._model, self._data, self._robot.pinocchio_configuration(q[None])[0])
        places = [self._data.oMi[body.joint] * body.placement for body in self._bodies]
        balls = np.array([place.act(middle) for place, middle in zip(places, self._middles, strict=True)])
        with np.errstate(over="ignore"):  # the ball of a half-space
            apart = np.linalg.norm(balls[self._pairs[:, 0]] - balls[self._pairs[:, 1]], axis=1)
        for i, j in self._pairs[apart <= self._reach[self._pairs].sum(axis=1)].tolist():
            depth = overlap(self._bodies[i].geometry, places[i], self._bodies[j].geometry, places[j])
            if depth is not None:
                yield depth
