"""Goals as regions that have to be held at one configuration: what moves a configuration to them at once."""

from __future__ import annotations

from dataclasses import replace

from rrtik_ompl.base.errors import UnknownNameError
from rrtik_ompl.constraints.held_region import HeldRegion, held_region
from rrtik_ompl.model.goal import Goal
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Scene


def goal_regions(robot: Robot, scene: Scene, goal: Goal) -> tuple[HeldRegion, ...]:
    """The regions of all tips of a goal of several.

    Raises:
        UnknownNameError: If a tip is no link of the robot.
        InputError: If the ranges of angles of a region cannot be held.
    """
    regions = []
    for frame, part in zip(goal.frames, goal.parts, strict=True):
        if not robot.model.existFrame(frame):
            raise UnknownNameError(f"tip of robot '{robot.name}'", frame, robot.link_names)
        regions.append(held_region(robot, scene, replace(part.region(), frame=frame), f"the goal of '{frame}'"))
    return tuple(regions)
