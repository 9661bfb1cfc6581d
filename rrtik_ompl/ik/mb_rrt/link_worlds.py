"""Whether the first links of an arm are free of collision before the rest of it has a place: worlds of fewer bodies."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import Any

import pinocchio as pin

from rrtik_ompl.base.arrays import Mask, Matrix
from rrtik_ompl.base.errors import DescriptionWarning
from rrtik_ompl.ik.mb_rrt.axes import Axes
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Scene
from rrtik_ompl.world.world import World


class LinkWorlds:
    """Checks by World the links up to one joint, with all that they hold.

    Args:
        world: The whole arm and its scene.
        axes: Its joints, base first.
    """

    def __init__(self, world: World, axes: Axes) -> None:
        self._world = world
        order = _joint_order(world.robot, axes)
        self._worlds = [_first_links(world, set(order[level + 1 :])) for level in range(len(order) - 1)] + [world]

    def free(self, level: int, q: Matrix) -> Mask:
        """Which rows, shape (m, dof), are free as far as the link of a level."""
        return self._worlds[level].valid_batch(self._world.robot.clamp(q))


def _joint_order(robot: Robot, axes: Axes) -> list[int]:
    """Pinocchio's numbers of the joints that move the tip, base first."""
    number = int(robot.model.frames[robot.model.getFrameId(robot.tip)].parentJoint)
    numbers: list[int] = []
    while number > 0:
        numbers.insert(0, number)
        number = int(robot.model.parents[number])
    return numbers[-axes.count :]


def _first_links(world: World, later: set[int]) -> World:
    """The world without the bodies that one of the ``later`` joints moves."""
    robot = world.robot
    scene = world.scene
    early_geometry: Any = pin.GeometryModel()
    for item in robot.collision.geometryObjects:
        if not _moves(robot, item.parentJoint, later):
            early_geometry.addGeometryObject(item)

    early_attached = tuple(item for item in scene.attached if not _moves(robot, _joint(robot, item.link), later))
    names = {*(each.name for each in scene.obstacles), *(each.name for each in early_attached), *robot.link_names}
    allowed = tuple(pair for pair in scene.allowed_collisions if set(pair) <= names)
    early_scene = Scene(scene.obstacles, attached=early_attached, allowed_collisions=allowed)

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DescriptionWarning)  # said where the whole world was made
        return world.unheld.with_settings(robot=replace(robot, collision=early_geometry), scene=early_scene)


def _moves(robot: Robot, joint: int, later: set[int]) -> bool:
    """Whether a joint is one of the ``later`` ones, by Pinocchio's numbers, or hangs on one of them."""
    while joint > 0:
        if joint in later:
            return True
        joint = int(robot.model.parents[joint])
    return False


def _joint(robot: Robot, link: str) -> int:
    return int(robot.model.frames[robot.model.getFrameId(link, pin.FrameType.BODY)].parentJoint)
