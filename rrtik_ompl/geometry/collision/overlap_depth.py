"""How far an arm in collision may move in any way and is surely still in collision."""

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
    """Depths of overlap between the solids of a world.

    The depth of two convex solids is the shortest translation that parts them, by their margin if they have one. A
    motion in which no point moves that far does not part them either: along no direction do their extents then cease to
    overlap. Pairs with a mesh or a cloud, for which coal knows no depth, are left out.

    Args:
        robot: The arm.
        bodies: Solids of the robot and the scene.
        pairs: Numbers of the bodies that must not touch.
    """

    def __init__(self, robot: Robot, bodies: Sequence[Body], pairs: Sequence[tuple[int, int]]) -> None:
        self._robot = robot
        self._bodies = bodies
        self._pairs = [pair for pair in pairs if not any(_hollow(bodies[k].geometry) for k in pair)]
        self._data = working_memory(robot.model)

    def travel(self, q: Vector) -> float:
        """Whatever moves each point of the arm by less than this [m] leaves a collision at q, shape (n,), standing.

        0 if there is no collision, or none whose depth is known.
        """
        pin.forwardKinematics(self._robot.model, self._data, self._robot.pinocchio_configuration(q[None])[0])
        return max((self._pair_travel(*pair) for pair in self._pairs), default=0.0)

    def _pair_travel(self, i: int, j: int) -> float:
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
