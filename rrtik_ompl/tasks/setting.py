"""What surrounds the arm and what it holds, at one place of a task; how stages change it."""

from __future__ import annotations

from functools import cached_property
from typing import Any

from rrtik_ompl.arrays import Vector
from rrtik_ompl.catalog import robot_from_entry
from rrtik_ompl.errors import InputError
from rrtik_ompl.path import JointPath
from rrtik_ompl.problem import Problem
from rrtik_ompl.robot import Robot
from rrtik_ompl.scene import Scene
from rrtik_ompl.tasks.stages import Attach, Detach, Gripper, MoveTo, Stage
from rrtik_ompl.world import World


class Setting:
    """A robot in a scene; its world is made when it is first needed, for several stages may change it in a row.

    Attributes:
        robot: With its fingers as they are held.
        scene: Obstacles, and what is held.
    """

    def __init__(self, like: World, robot: Robot, scene: Scene) -> None:
        self._like, self.robot, self.scene = like, robot, scene

    @classmethod
    def of(cls, world: World) -> Setting:
        """The setting of a world that there is."""
        setting = cls(world, world.robot, world.scene)
        setting.world = world
        return setting

    @cached_property
    def world(self) -> World:
        """The robot in the scene, with the other settings of the first world of the task."""
        return self._like.with_settings(robot=self.robot, scene=self.scene)

    def after(self, stage: Attach | Detach | Gripper, q: Vector) -> Setting:
        """The setting after a stage that the arm does at a configuration, shape (dof,).

        Raises:
            InputError: If the robot has no gripper joints, or does not open so far.
            UnknownNameError: If there is no object or link of a name.
        """
        if isinstance(stage, Gripper):
            return Setting(self._like, with_gripper(self.robot, stage), self.scene)
        if isinstance(stage, Attach):
            pose = self.robot.fk(q, stage.link).actInv(self.scene.obstacle(stage.object).pose)
            scene = self.scene.attaching(stage.object, stage.link, stage.allow, pose=pose, padding=stage.padding)
            return Setting(self._like, self.robot, scene)
        held = next(item for item in self.scene.attached if item.name == stage.object)
        pose = self.robot.fk(q, held.link) * held.pose
        return Setting(self._like, self.robot, self.scene.detaching(stage.object, pose))


def world_of_motion(path: JointPath, world: World, stage: Stage) -> World:
    """The world of a motion, with the path constraints of its stage if it has any."""
    if not isinstance(stage, MoveTo) or not stage.constraints:
        return world
    return Problem(world, path.start, path.end, constraints=stage.constraints).world


def with_gripper(robot: Robot, stage: Gripper) -> Robot:
    """The same arm with its fingers held elsewhere.

    Raises:
        InputError: If it has no gripper joints, or does not open so far.
    """
    joints = robot.gripper
    if joints is None:
        raise InputError(f"robot '{robot.name}' has no gripper joints: leave the stage Gripper out")
    values = joints.posture(stage.state) if stage.width is None else joints.close_on(stage.width)
    source: dict[str, Any] = dict(robot.source)
    source["locked"] = {**source.get("locked", {}), **values}
    return robot_from_entry(source)
