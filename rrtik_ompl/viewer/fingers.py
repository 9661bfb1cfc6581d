"""Bodies of the arm that are elsewhere on their joints from one motion of a task to the next: the gripper's fingers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.poses import pose_row
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.tasks import TaskPlan
from rrtik_ompl.viewer.drawing.robot_picture import joint_nodes, node_name

NO_SHIFT = 1e-9  # [m], and alike for a turn
DIGITS = 6


@dataclass(frozen=True, slots=True, eq=False)
class Fingers:
    """Where fingers are over time, seen from where they are drawn.

    Attributes:
        poses: For each body, by the nodes of its joint and its own, its pose on the joint in each motion times the
            inverse of the one that it is drawn at: x, y, z and quaternion x, y, z, w, shape (motions, 7).
        at: For each tick the number of the motion whose fingers are shown; in between while they move, shape (ticks,).
    """

    poses: Mapping[tuple[str, str], Matrix]
    at: Vector

    def story(self) -> dict[str, Any]:
        """For the page."""
        bodies = [
            {"joint": joint, "name": name, "poses": np.round(rows, DIGITS).tolist()}
            for (joint, name), rows in self.poses.items()
        ]
        return {"bodies": bodies, "at": np.round(self.at, DIGITS).tolist()}


def fingers_of(plan: TaskPlan, drawn: Robot, at: Vector) -> Fingers:
    """The fingers of a plan's motions, beside a robot that is drawn; ``at`` as in :class:`Fingers`."""
    nodes = joint_nodes(drawn)
    first = _placements(drawn)
    places = [_placements(world.robot) for world in plan.worlds]

    poses = {}
    for (joint, name), placement in first.items():
        moved = [found[joint, name] * placement.inverse() for found in places]
        if any(np.abs(pin.log6(shift).vector).max() > NO_SHIFT for shift in moved):
            rows = [pose_row(shift) for shift in moved]
            poses[nodes[joint], node_name(name)] = np.array(rows)

    return Fingers(poses, at)


def _placements(robot: Robot) -> dict[tuple[int, str], pin.SE3]:
    """Pose of every body that is drawn on its joint, by the joint's number and the body's name."""
    bodies = (robot.visual if robot.visual.ngeoms else robot.collision).geometryObjects
    return {(int(body.parentJoint), str(body.name)): body.placement for body in bodies}
