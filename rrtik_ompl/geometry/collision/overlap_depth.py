"""Bound how far an arm in collision may move in any way and surely stay in collision."""

from __future__ import annotations

from collections.abc import Sequence

import coal
import pinocchio as pin

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.base.poses import working_memory
from rrtik_ompl.geometry.collision.bodies import DISTANCE_TOLERANCE, Body, kept_apart, request
from rrtik_ompl.geometry.collision.cloud_solid import CloudSolid
from rrtik_ompl.geometry.collision.solids import is_mesh
from rrtik_ompl.model.robot import Robot


class OverlapDepth:
    """Penetration depths between the bodies of a world.

    The penetration depth of two convex solids is the length of the shortest translation that separates them (by their
    margin, if they have one). A motion in which no point moves that far does not separate them either, as their extents
    still overlap along every direction. Pairs with a mesh or a cloud, for which coal has no penetration depth, are left
    out.

    Args:
        robot: The arm.
        bodies: Bodies of the robot and the scene.
        pairs: Numbers of the bodies that must not touch.
    """

    def __init__(self, robot: Robot, bodies: Sequence[Body], pairs: Sequence[tuple[int, int]]) -> None:
        self._robot = robot
        self._bodies = bodies
        self._pairs = [pair for pair in pairs if not any(_hollow(bodies[k].geometry) for k in pair)]
        self._data = working_memory(robot.model)

    def travel(self, q: Vector) -> float:
        """Return a distance [m]: a motion that moves each point of the arm by less keeps a configuration in collision.

        Args:
            q: The configuration, shape (dof,).

        Returns:
            The distance [m]; 0 if there is no collision, or none whose penetration depth is known.
        """
        pin.forwardKinematics(self._robot.model, self._data, self._robot.pinocchio_configuration(q[None])[0])
        return max((self._pair_travel(*pair) for pair in self._pairs), default=0.0)

    def _pair_travel(self, i: int, j: int) -> float:
        """Return the distance that each point of two bodies may move while they surely stay in collision [m].

        If both bodies move, each may cover half of the penetration depth.
        """
        first = self._bodies[i]
        second = self._bodies[j]
        ends = (first.geometry, self._transform(first), second.geometry, self._transform(second))
        margin = kept_apart(first, second)
        if not coal.collide(*ends, request(margin), coal.CollisionResult()):
            return 0.0

        depth = margin - float(coal.distance(*ends, coal.DistanceRequest(), coal.DistanceResult())) - DISTANCE_TOLERANCE
        both_move = first.joint > 0 and second.joint > 0
        return max(0.5 * depth if both_move else depth, 0.0)

    def _transform(self, body: Body) -> coal.Transform3s:
        pose = self._data.oMi[body.joint] * body.placement
        return coal.Transform3s(pose.rotation, pose.translation)


def _hollow(geometry: object) -> bool:
    return is_mesh(geometry) or isinstance(geometry, CloudSolid)
