"""Write and read the commands to a gripper: in our JSON files, and as goals of the two actions of ROS."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from typing import Any

from rrtik_ompl.base.errors import InputError, in_file
from rrtik_ompl.files.tables import json_value
from rrtik_ompl.files.text import known_ending, read_text, write_text
from rrtik_ompl.model.gripper import Events, GripperEvent, states_at
from rrtik_ompl.motion.trajectory.messages import duration, from_yaml, seconds, to_yaml

ROS_FORMATS = (".yaml", ".json")
ONE_JOINT = "GripperCommand"  # control_msgs/action/GripperCommand
JOINTS = "ParallelGripperCommand"  # control_msgs/action/ParallelGripperCommand


def gripper_document(events: Events) -> dict[str, Any]:
    """Return the commands as they stand in a JSON file, under "gripper"."""
    commands = []
    for event in events:
        command = {"time_from_start": event.time, "positions": list(event.positions), "seconds": event.seconds}
        known = {"width": event.width, "effort": event.effort}
        commands.append(command | {key: value for key, value in known.items() if value is not None})
    first = events[0]
    return {"name": first.gripper, "joint_names": list(first.joints), "units": list(first.units), "commands": commands}


def events_of_document(document: object) -> Events:
    """Return the commands that :func:`gripper_document` wrote.

    Raises:
        InputError: If they are malformed; the message names the command.
    """
    return _events(document, _plain_command)


def write_ros_commands(file: str | os.PathLike[str], events: Events) -> None:
    """Write the commands as goals for the controllers of ROS, each with the time at which it is to be sent.

    Each has the goal of ``control_msgs/action/ParallelGripperCommand``, and, for a gripper of one joint, also that of
    ``control_msgs/action/GripperCommand``, where an effort of 0 leaves it to the controller.

    Raises:
        InputError: If the ending is neither .yaml nor .json, or the file cannot be written.
    """
    ending = known_ending(file, ROS_FORMATS, "file of commands to a gripper")
    speeds = states_at(events, [event.time for event in events])[1]
    commands = []
    for event, speed in zip(events, speeds, strict=True):
        goal = {
            "name": list(event.joints),
            "position": list(event.positions),
            "velocity": abs(speed).tolist() if event.seconds else [],
            "effort": [] if event.effort is None else [event.effort] * len(event.joints),
        }
        command: dict[str, Any] = {"time_from_start": duration(event.time), JOINTS: {"command": goal}}
        if len(event.joints) == 1:
            goal_of_one = {"position": event.positions[0], "max_effort": event.effort or 0.0}
            command[ONE_JOINT] = {"command": goal_of_one}
        width = {} if event.width is None else {"width": event.width}
        commands.append(command | {"seconds": event.seconds} | width)

    document = gripper_document(events) | {"commands": commands}
    write_text(file, to_yaml(document) if ending == ".yaml" else json.dumps(document, indent=1) + "\n")


def read_ros_commands(file: str | os.PathLike[str]) -> Events:
    """Read what :func:`write_ros_commands` wrote.

    Raises:
        InputError: If the file is missing or malformed.
    """
    ending = known_ending(file, ROS_FORMATS, "file of commands to a gripper")
    text = read_text(file)
    try:
        return _events(json_value(text) if ending == ".json" else from_yaml(text, "commands"), _ros_command)
    except InputError as error:
        raise in_file(file, error) from None


def _events(document: object, command_of: Callable[[dict[str, Any]], dict[str, Any]]) -> Events:
    commands = document.get("commands") if isinstance(document, dict) else None
    if not isinstance(document, dict) or not isinstance(commands, list) or not commands:
        raise InputError("gripper: expected an object with name, joint_names and a list of commands")
    heads = {
        "joints": document.get("joint_names"),
        "gripper": document.get("name", ""),
        "units": document.get("units", ()),
    }

    events = []
    for number, command in enumerate(commands, start=1):
        try:
            events.append(GripperEvent(**heads, **command_of(command)))
        except (KeyError, TypeError, AttributeError):
            raise InputError(f"gripper: command {number}: expected an object with its time and positions") from None
        except InputError as error:
            raise InputError(f"gripper: command {number}: {error}") from None
    return tuple(events)


def _plain_command(command: dict[str, Any]) -> dict[str, Any]:
    return _head(command) | {"positions": command["positions"], "effort": command.get("effort")}


def _ros_command(command: dict[str, Any]) -> dict[str, Any]:
    goal = command[JOINTS]["command"]
    return _head(command) | {"positions": goal["position"], "effort": min(goal.get("effort") or (), default=None)}


def _head(command: dict[str, Any]) -> dict[str, Any]:
    time = seconds(command["time_from_start"])
    return {"time": time, "seconds": command.get("seconds", 0.0), "width": command.get("width")}
