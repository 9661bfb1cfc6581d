"""Save the plan of a task in one JSON file: every motion with its stage, its waypoints, its robot and its scene."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any, Literal

import numpy as np

from rrtik_ompl.base.arrays import finite_array
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.description.catalog import robot_from_entry
from rrtik_ompl.description.xacro_text import expanding
from rrtik_ompl.files.sections import (
    FLAG,
    NAME,
    NUMBER,
    NUMBERS,
    TEXT,
    VERSION,
    WHOLE,
    Choice,
    Listed,
    Number,
    Section,
    Whole,
    key,
    parse,
)
from rrtik_ompl.files.strict_yaml import YamlDocument, read_yaml
from rrtik_ompl.files.text import file_name, known_ending, write_text
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.world_settings import FINEST_RESOLUTION
from rrtik_ompl.problem_files.problem_values import WorldKeys, world_data
from rrtik_ompl.problem_files.robot import ROBOT, robot_data
from rrtik_ompl.problem_files.scene import ContactEntry, SceneEntry, scene_data
from rrtik_ompl.tasks import TaskPlan
from rrtik_ompl.tasks.contact_life import MotionContact
from rrtik_ompl.tasks.task_file import MOVING_STAGE, stage_data
from rrtik_ompl.world.world import World

KIND: Literal["task_plan"] = "task_plan"


class WorldEntry(Section):
    """A robot, its fingers as they are held, and what surrounds it."""

    robot = key(ROBOT)
    scene = key(SceneEntry, default=SceneEntry())


class StoodOnEntry(ContactEntry):
    """A contact that a motion stood on."""

    until = key(Whole(0), "number of the waypoint at which they have parted", default=None)
    then = key(NUMBER, "[m] that they must keep from there on; as others if left out", default=None)
    allowed = key(FLAG, "whether the grasp has named the pair: it may be deeper than 5 mm", default=False)

    def stood_on(self) -> MotionContact:
        """Return the contact."""
        return MotionContact(self.build(), self.until, self.then, self.allowed)


class MotionEntry(WorldEntry):
    """One motion: what it does, where it leads, the world that it is in, and the contacts that it stood on."""

    stage = key(MOVING_STAGE)
    waypoints = key(Listed(NUMBERS, 1))
    contacts = key(Listed(StoodOnEntry), "that the motion stood on", default=[])


class TaskPlanFile(WorldKeys):
    """The plan of a task."""

    version = key(VERSION)
    kind = key(Choice("task_plan"))
    joint_names = key(Listed(NAME))
    chosen = key(Listed(WHOLE), default=[])
    motion_resolution = key(Number(FINEST_RESOLUTION))
    motions = key(Listed(MotionEntry, 1))
    end = key(WorldEntry, "after the last stage; the last motion's if left out", default=None)
    notes = key(Listed(TEXT), default=[])


def write_task_plan(plan: TaskPlan, file: str | os.PathLike[str]) -> None:
    """Write the plan of a task; see :meth:`TaskPlan.save`.

    Raises:
        InputError: If the plan has no motion, the ending is not .json, or the file cannot be written.
    """
    known_ending(file, (".json",), "task plan")
    if not plan.paths:
        raise InputError("task plan: it has no motion to save" + (f": {plan.reason}" if plan.reason else ""))
    if plan.worlds[0].constraints is not None:
        raise InputError("task plan: its world has path constraints, which the file has no key for; give MoveTo them")

    folder = file_name(file).parent
    stood_on = plan.contacts or ((),) * len(plan.paths)
    motions = [
        {
            "stage": stage_data(stage),
            **_world_data(world, folder),
            "waypoints": path.document()["waypoints"],
            **_contact_data(contacts),
        }
        for path, world, stage, contacts in zip(plan.paths, plan.worlds, plan.stages, stood_on, strict=True)
    ]

    first = plan.worlds[0]
    document = {
        "version": 1,
        "kind": KIND,
        "joint_names": list(first.robot.joint_names),
        "chosen": list(plan.chosen),
        **world_data(first.settings),
        "motions": motions,
        "end": _world_data(plan.worlds[-1] if plan.end is None else plan.end, folder),
        "notes": list(plan.notes),
    }

    write_text(file, json.dumps(document, allow_nan=False))


def read_task_plan(file: str | os.PathLike[str], *, trust_xacro: bool = False) -> TaskPlan:
    """Read a plan; see :meth:`TaskPlan.load`.

    Raises:
        InputError: If the file is missing, malformed, or its parts do not fit each other.
    """
    with expanding(trusted=trust_xacro):
        return _task_plan(file)


def _task_plan(file: str | os.PathLike[str]) -> TaskPlan:
    """Read a plan as :func:`read_task_plan` does.

    Each motion must begin where the one before ends.
    """
    document = read_yaml(file_name(file))
    entry = parse(document, TaskPlanFile)

    worlds: list[World] = []
    paths: list[JointPath] = []
    for number in range(len(entry.motions)):
        world, path = _motion(document, entry, number)
        if paths and np.abs(paths[-1].end - path.start).max() > 1e-9:
            raise document.error(("motions", number), "begins elsewhere than the motion before ends")
        worlds.append(world)
        paths.append(path)

    stages = tuple(motion.stage.build(world) for motion, world in zip(entry.motions, worlds, strict=True))
    end = worlds[-1] if entry.end is None else _world(document, entry, entry.end, ("end",))
    contacts = tuple(tuple(each.stood_on() for each in motion.contacts) for motion in entry.motions)
    notes = tuple(entry.notes)
    return TaskPlan(True, tuple(paths), tuple(worlds), stages, tuple(entry.chosen), "", end, notes, contacts)


def _contact_data(contacts: tuple[MotionContact, ...]) -> dict[str, Any]:
    """Return the entries of a file for the contacts on which a motion depends."""
    entries = []
    for each in contacts:
        entry: dict[str, Any] = {"pair": list(each.touching.names), "distance": each.touching.distance}
        entry |= {} if each.until is None else {"until": each.until}
        entry |= {} if each.then is None else {"then": each.then}
        entries.append(entry | ({"allowed": True} if each.allowed else {}))
    return {"contacts": entries} if entries else {}


def _motion(document: YamlDocument, entry: TaskPlanFile, number: int) -> tuple[World, JointPath]:
    """Build the world and the path of the motion with this index."""
    motion = entry.motions[number]
    place = ("motions", number)
    world = _world(document, entry, motion, place)
    for index, contact in enumerate(motion.contacts):
        if contact.until is not None and contact.until >= len(motion.waypoints):
            what = f"there is no waypoint {contact.until}; the last one is {len(motion.waypoints) - 1}"
            raise document.error((*place, "contacts", index, "until"), what)

    with document.at((*place, "waypoints")):
        rows = finite_array(motion.waypoints, (None, world.robot.dof), "waypoints")
        return world, JointPath.of(world.robot, rows)


def _world(document: YamlDocument, entry: TaskPlanFile, part: WorldEntry, place: tuple[str | int, ...]) -> World:
    """Build the world of an entry; ``place`` is where the entry is in the document, for error messages."""
    data: Any = document.data
    for part_of in (*place, "robot"):
        data = data[part_of]

    with document.at((*place, "robot")):
        robot = robot_from_entry(data, document.path.parent)
        if robot.joint_names != tuple(entry.joint_names):
            raise InputError(f"robot '{robot.name}' has other joints than the plan's: {', '.join(entry.joint_names)}")

    scene = part.scene.build(document, (*place, "scene"))
    with document.at((*place, "scene")):
        return World.of(entry.settings(robot, scene))


def _world_data(world: World, folder: Path) -> dict[str, Any]:
    return {"robot": robot_data(world.robot.source, folder), "scene": scene_data(world.scene, folder)}
