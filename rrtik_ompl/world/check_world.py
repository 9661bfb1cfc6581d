"""Refuse what is no robot or no world, before it is used."""

from __future__ import annotations

from rrtik_ompl.base.errors import InputError, require
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.world.world import World


def check_world(world: World | None, robot: Robot) -> None:
    """Refuse what is no robot, no world, or the world of another robot.

    Raises:
        InputError: It says how to make what is needed.
    """
    require(robot, Robot, "robot", "use load_robot(name or file)")
    if world is None:
        return
    require(world, World, "world", "make it with World(robot, scene)")
    if world.robot is not robot:
        raise InputError(f"world: it holds another robot, '{world.robot.name}'; make it with World(robot, scene)")
