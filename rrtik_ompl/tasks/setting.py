"""Model the robot and the scene at one place of a task, and how stages change them."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.base.copies import changed
from rrtik_ompl.base.errors import InputError, listed
from rrtik_ompl.base.kept import kept_with
from rrtik_ompl.description.catalog import robot_from_entry
from rrtik_ompl.model.goal_kind import TaskRegion
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Scene, Touching
from rrtik_ompl.tasks.contact_life import EXTRA_DEPTH, SMALL_OVERLAP, allowed, left_inside, touching_at, with_contacts
from rrtik_ompl.tasks.stages import Attach, Detach, Gripper, MoveTo, Stage
from rrtik_ompl.tasks.worlds import Worlds
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

DIGITS = 9  # of poses of grasps and places [m], and of their axes; a thing may move by a thousand times as much


class Setting:
    """A robot in a scene. Its world is made when it is first needed, as several stages in a row may change the setting.

    Attributes:
        robot: The robot, with its fingers as they are held.
        scene: Obstacles, attached objects, and contacts.
        grasp_pairs: Pairs of names that an :class:`Attach` allows as long as it holds something.
        worlds: Makes the worlds of the task, or has them already.
    """

    def __init__(
        self, worlds: Worlds, robot: Robot, scene: Scene, grasp_pairs: frozenset[frozenset[str]] = frozenset()
    ) -> None:
        self.worlds = worlds
        self.robot = robot
        self.scene = scene
        self.grasp_pairs = grasp_pairs

    @classmethod
    def of(cls, world: World, worlds: Worlds | None = None) -> Setting:
        """Return the setting of an existing world; further ones are made from it, or by ``worlds``."""
        setting = cls(worlds or Worlds(world), world.robot, world.scene)
        setting.world = world
        return setting

    @classmethod
    def beginning(cls, world: World, q: Vector, worlds: Worlds | None = None) -> Setting:
        """Return the setting of a world at q, shape (dof,): held objects may continue to touch what they touch."""
        touching = [near for item in world.scene.attached for near in touching_at(world, q, item.name)]
        known_pairs = {contact.pair for contact in world.scene.contacts}
        contacts = [
            near.going_on() for near in touching if near.distance >= -SMALL_OVERLAP and near.pair not in known_pairs
        ]
        return cls.of(world, worlds).with_contacts(contacts)

    @cached_property
    def world(self) -> World:
        """Return the world of the robot in the scene, with the other settings of the first world of the task."""
        return self.worlds.of(self.robot, self.scene)

    @cached_property
    def bare(self) -> World:
        """Return the world without contacts, to ask where bodies are: those of the world are in the same places.

        Most settings are asked for no more, and worlds with contacts take time to make.
        """
        return self.worlds.bare(self.robot, self.scene) if self.scene.contacts else self.world

    def with_contacts(self, contacts: Iterable[Touching]) -> Setting:
        """Return the same setting with further contacts; a new contact replaces an old one of the same pair."""
        new = tuple(contacts)
        return self.with_scene(with_contacts(self.scene, new)) if new else self

    def arriving(self, contacts: Iterable[Touching]) -> Setting:
        """Return the same setting with contacts of things that are taken or set down next; deeper old ones remain."""
        distance_of_pair = {contact.pair: contact.distance for contact in self.scene.contacts}
        return self.with_contacts(each for each in contacts if each.distance < distance_of_pair.get(each.pair, np.inf))

    def with_scene(self, scene: Scene) -> Setting:
        """Return the same robot in another scene."""
        return Setting(self.worlds, self.robot, scene, self.grasp_pairs)

    def with_contacts_only(self, contacts: tuple[Touching, ...]) -> Setting:
        """Return the same setting with exactly these contacts."""
        return self if contacts == self.scene.contacts else self.with_scene(changed(self.scene, contacts=contacts))

    def after(self, stage: Attach | Detach | Gripper, q: Vector) -> Setting:
        """Return the setting after a stage that the arm does at a configuration.

        Args:
            stage: The stage.
            q: The configuration, shape (dof,).

        Raises:
            InputError: If the robot has no gripper joints or does not open so far, or if the thing that it releases
                would be left deep inside something.
            UnknownNameError: If an object or a link does not exist.
        """
        if isinstance(stage, Gripper):
            return Setting(self.worlds, with_gripper(self.robot, stage), self.scene, self.grasp_pairs)
        return self._attached(stage, q) if isinstance(stage, Attach) else self._detached(stage, q)

    def _attached(self, stage: Attach, q: Vector) -> Setting:
        """Return the setting after an obstacle is attached, with its contacts and permitted contacts."""
        pose = _settled(self.robot.fk(q, stage.link).actInv(self.scene.obstacle(stage.object).pose))
        links = tuple(name for name in stage.allow if name in self.robot.link_names)
        scene = self.scene.attaching(stage.object, stage.link, links, pose=pose, padding=stage.padding)

        others = frozenset(stage.allow) - frozenset(links)
        grasp_pairs = self.grasp_pairs | {frozenset((stage.object, other)) for other in others}
        setting = Setting(self.worlds, self.robot, scene, grasp_pairs)

        bodies = setting.bare.bodies
        contacts = {frozenset((stage.object, other)): allowed(bodies, stage.object, other) for other in sorted(others)}
        touching = touching_at(setting.bare, q, stage.object)
        contacts |= {
            each.pair: each.going_on()
            for each in touching
            if each.distance >= -SMALL_OVERLAP or each.pair in grasp_pairs
        }
        return setting.with_contacts(contacts.values())

    def _detached(self, stage: Detach, q: Vector) -> Setting:
        """Return the setting after an object is detached, with contacts for what it touches."""
        obstacle_names = frozenset(self.scene.names)
        for near in touching_at(self.bare, q, stage.object):
            if near.second in obstacle_names and near.too_deep:
                raise InputError(left_inside(near))

        attached = next(item for item in self.scene.attached if item.name == stage.object)
        pose = _settled(self.robot.fk(q, attached.link) * attached.pose)
        grasp_pairs = frozenset(pair for pair in self.grasp_pairs if stage.object not in pair)
        setting = Setting(self.worlds, self.robot, self.scene.detaching(stage.object, pose), grasp_pairs)
        touching = touching_at(setting.bare, q, stage.object)
        return setting.with_contacts(each.going_on() for each in touching if each.distance >= -EXTRA_DEPTH)


def _settled(pose: pin.SE3) -> pin.SE3:
    """Return a pose with its numbers rounded: the same for the same grasp, or place, in all branches and instances."""
    rounded = np.round(pose.homogeneous, DIGITS) + 0.0
    return pin.SE3(pin.Quaternion(rounded[:3, :3]).normalized().matrix(), rounded[:3, 3])


def placed_constraints(
    world: World, start: ArrayLike | str, constraints: Iterable[TaskRegion]
) -> tuple[TaskRegion, ...]:
    """Return path constraints with regions placed as seen from a start, for stages that begin elsewhere.

    Raises:
        ProblemError: If the start violates them, or cannot be used.
    """
    regions = listed(constraints, "path constraints")
    return Problem(world, start, start, constraints=regions).constraints if regions else ()


def world_of_motion(path: JointPath, world: World, stage: Stage) -> World:
    """Return the world of a motion, with the path constraints of its stage if there are any."""
    if not isinstance(stage, MoveTo) or not stage.constraints:
        return world
    return Problem(world, path.start, path.end, constraints=stage.constraints).world


def with_gripper(robot: Robot, stage: Gripper) -> Robot:
    """Return the same robot with its fingers held elsewhere.

    Raises:
        InputError: If the robot has no gripper joints, or does not open so far.
    """
    joints = robot.gripper
    if joints is None:
        raise InputError(f"robot '{robot.name}' has no gripper joints: leave the stage Gripper out")
    if stage.opening is not None:
        values = joints.at(stage.opening)
    else:
        values = joints.posture(stage.state) if stage.width is None else joints.close_on(stage.width)
    locked = robot.source.get("locked", {})
    return robot if values.items() <= locked.items() else _with_fingers(robot, tuple(values.items()))


@kept_with
def _with_fingers(robot: Robot, values: tuple[tuple[str, float], ...]) -> Robot:
    """Return the robot with some joints of its gripper elsewhere: pairs of name and value [rad or m]."""
    source: dict[str, Any] = dict(robot.source)
    source["locked"] = {**source.get("locked", {}), **dict(values)}
    return robot_from_entry(source)
