"""Read MoveIt's ``joint_limits.yaml``: velocity, acceleration, jerk and position limits by joint."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rrtik_ompl.base.errors import UnknownNameError, few
from rrtik_ompl.description.faults import nearest_name, not_read
from rrtik_ompl.description.robot_build import RATES, JointLimits
from rrtik_ompl.files.strict_yaml import Location, YamlDocument, describe, read_yaml

_FLAGS = ("position", "velocity", "acceleration", "deceleration", "jerk", "effort", "soft")
_NUMBERS = ("min_position", "max_position", "max_velocity", "max_acceleration", "max_jerk")
_UNUSED = ("max_deceleration", "min_jerk", "max_effort", "angle_wraparound", "k_position", "k_velocity")
_SOFT = ("soft_lower_limit", "soft_upper_limit")
_NARROWING = {"max_deceleration": "deceleration", "min_jerk": "jerk", **dict.fromkeys(_SOFT, "soft")}  # of _UNUSED
_KEYS = (*(f"has_{flag}_limits" for flag in _FLAGS), *_NUMBERS, *_UNUSED, *_SOFT)
ROS = ("/**", "ros__parameters")  # keys that enclose the parameters of a node in ROS 2


@dataclass(frozen=True, slots=True)
class LimitsFile:
    """What a file says of the joints of a robot.

    Attributes:
        limits: The limits by joint.
        faults: A line for each joint in it that the robot does not have, and one about limits in it that are not used.
    """

    limits: Mapping[str, JointLimits] = field(default_factory=dict)
    faults: tuple[str, ...] = ()


def read_joint_limits(path: str | os.PathLike[str], joints: Iterable[str]) -> LimitsFile:
    """Read the limits of a robot's joints.

    A limit counts unless its ``has_..._limits`` is false; ``has_velocity_limits: false`` removes the URDF's own limit.

    Args:
        path: The file.
        joints: Names of the robot's joints; others are not read, as the file may be for several robots.

    Raises:
        InputError: If the file cannot be read, or a key or value in it is not valid; with its line.
    """
    document = read_yaml(path, ros=True)
    joint_names = tuple(joints)
    top, section = parameters(document, "robot_description_planning")
    table = section.get("joint_limits")
    if not isinstance(table, Mapping):
        raise document.error((*top, "joint_limits"), "expected 'joint_limits:' with one group of keys per joint")

    limits = {}
    unknown = []
    for joint, values in table.items():
        location: Location = (*top, "joint_limits", joint)
        if joint not in joint_names:
            unknown.append(f"{document.place(location)}: no joint '{joint}'{nearest_name(joint, joint_names)}")
            continue
        if not isinstance(values, Mapping):
            raise document.error(location, f"expected keys such as max_velocity, found {describe(values)}")
        limits[joint] = _joint(document, location, values)

    unread = _unread({joint: table[joint] for joint in limits})
    return LimitsFile(limits, (*unknown, *not_read(str(path), unread)))


def _joint(document: YamlDocument, location: Location, values: Mapping[str, Any]) -> JointLimits:
    """Check the keys of one joint and return its limits."""
    for key, value in values.items():
        if key not in _KEYS:
            raise UnknownNameError("key", key, _KEYS, where=document.place((*location, key)))
        if key.startswith("has_") and not isinstance(value, bool):
            raise document.error((*location, key), f"expected true or false, found {describe(value)}")
        # Limits that do not apply are skipped, as MoveIt writes 0 for them.
        if key in _NUMBERS and values.get(f"has_{key.partition('_')[2]}_limits") is not False:
            _number(document, (*location, key), value, positive=not key.endswith("position"))

    limits: dict[str, float | None] = {}
    for rate in RATES:
        flag = values.get(f"has_{rate}_limits")
        limits[rate] = np.inf if flag is False else values.get(f"max_{rate}")
    if values.get("has_position_limits") is not False:
        limits |= {"lower": values.get("min_position"), "upper": values.get("max_position")}

    lower = limits.get("lower")
    upper = limits.get("upper")
    if lower is not None and upper is not None and lower >= upper:
        raise document.error((*location, "min_position"), f"{lower:g} is not below max_position {upper:g}; swap them")

    return JointLimits(**{key: None if value is None else float(value) for key, value in limits.items()})


def _number(document: YamlDocument, location: Location, value: object, *, positive: bool) -> None:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not np.isfinite(value):
        raise document.error(location, f"expected a finite number, found {describe(value)}")
    if positive and value <= 0:
        raise document.error(location, f"must be greater than 0, got {value:g}")


def _unread(table: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return the limits of joints that are not used."""
    joints_of_key: dict[str, list[str]] = {}
    for joint, values in table.items():
        for key, flag in _NARROWING.items():
            if values.get(key) is not None and values.get(f"has_{flag}_limits") is not False:
                joints_of_key.setdefault(key, []).append(f"'{joint}'")
    return [f"{key} of {few(joints, 3)}" for key, joints in joints_of_key.items()]


def parameters(document: YamlDocument, name: str) -> tuple[Location, Mapping[str, Any]]:
    """Return where the parameters are in a file, and the parameters.

    Args:
        document: The file.
        name: Their name on ROS's parameter server, such as "robot_description_planning".
    """
    location: Location = ()
    found: Mapping[str, Any] = document.data
    for key in (*ROS, name):
        below = found.get(key)
        if isinstance(below, Mapping):
            location = (*location, key)
            found = below
    return location, found
