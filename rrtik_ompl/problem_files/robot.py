"""The ``robot:`` entry of a problem file and its keys. `catalog.robot_from_entry` turns it into a robot."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, TypeAlias

import pinocchio as pin
from pydantic import ConfigDict, Discriminator, Field, Tag

from rrtik_ompl.files.pose_entry import PoseEntry, pose_data
from rrtik_ompl.files.sections import (
    Length,
    Name,
    NotNegative,
    Number,
    Positive,
    Section,
    Vector2,
    tag,
    told_apart_by,
)
from rrtik_ompl.problem_files.shapes import relative_name

PATH_KEYS = ("urdf", "srdf", "joint_limits", "dh", "moveit", "mjcf", "packages")

GRIPPER = "values of its joints where it is open and closed [rad or m]: {open: {joint: ..}, closed: {joint: ..}}"

Padding: TypeAlias = Annotated[
    Annotated[NotNegative, Tag(tag("number"))] | Annotated[dict[Name, NotNegative], Tag(tag("links"))],
    Discriminator(lambda data: tag("links" if isinstance(data, dict) else "number")),
]


class _Mounted(Section):
    """Keys of every kind of robot."""

    base_pose: PoseEntry | None = Field(None, description="pose of the base in the world; identity if absent")
    tip: Name | None = Field(None, description="link or frame that goals refer to")
    padding: Padding | None = Field(
        None, description="how much thicker links are than their geometry [m]: by name, or one number for all"
    )
    scale: dict[Name, Positive] | None = Field(
        None, description="factors by which the solids of links are larger than their geometry, by name"
    )
    joint_ranges: dict[Name, Vector2] | None = Field(
        None, description="lowest and highest value of joints inside their limits, by name [rad or m]"
    )
    joint_weights: dict[Name, Positive] | None = Field(
        None, description="how much joints count in the length of a path, by name; 1 if absent"
    )


class NamedRobot(_Mounted):
    """A robot of the registry, by name (see ``rrtik list robots``); further keys are options of that robot."""

    model_config = ConfigDict(extra="allow")

    name: Name
    limits: Name | None = Field(None, description="name of one of the robot's sets of joint limits")
    locked: dict[Name, Number] | None = Field(None, description="values of joints that are held still [rad or m]")


class PlanarMeasures(Section):
    """Measures of an arm in the xy-plane."""

    lengths: Annotated[list[Length], Field(min_length=1)] = Field(description="of the links, base first [m]")
    limits_deg: list[Vector2] | None = Field(None, description="lower and upper limit per joint [deg]")
    radius: NotNegative = Field(0.0, description="of the links [m]; 0 means as thin as possible")


class PlanarRobot(_Mounted):
    """An arm of revolute joints in the xy-plane; its links do not collide with each other."""

    planar: PlanarMeasures


class Point2dMeasures(Section):
    """A disc that moves in the xy-plane."""

    radius: NotNegative = Field(0.0, description="[m]; 0 means as small as possible")
    bounds: Annotated[list[Vector2], Field(min_length=2, max_length=2)] | None = Field(
        None, description="lower and upper limit of x and of y [m]"
    )


class Point2dRobot(_Mounted):
    """A disc or point in the plane; its two joints slide, so its configurations are in metres."""

    point2d: Point2dMeasures


class _Described(_Mounted):
    """Keys of robots that are described by a URDF."""

    srdf: Name | None = Field(None, description="groups, named postures, allowed collisions, gripper")
    group: Name | None = Field(None, description="group of the SRDF whose joints move")
    joints: Annotated[list[Name], Field(min_length=1)] | None = Field(None, description="joints that move, in order")
    joint_limits: Name | None = Field(None, description="file in the format of joint_limits.yaml")
    packages: list[Name] | Name | None = Field(None, description="folders in which package:// names are sought")
    locked: dict[Name, Number] | None = Field(None, description="values of joints that are held still [rad or m]")
    gripper: dict[Name, dict[Name, Number]] | None = Field(None, description=GRIPPER)
    xacro_args: dict[Name, Name | Number] | None = Field(None, description="arguments of the macros of a .xacro file")
    strict: bool | None = Field(None, description="whether what is wrong in the description, or not read, is an error")


class UrdfRobot(_Described):
    """An arm described by a URDF file; file names are relative to the folder of the problem file."""

    urdf: Name


class MoveitRobot(_Described):
    """An arm described by a folder that MoveIt's setup assistant wrote, relative to the folder of the problem file."""

    moveit: Name
    urdf: Name | None = Field(None, description="a URDF in place of the one that the folder names")


class MjcfRobot(_Mounted):
    """An arm described by an MJCF file of MuJoCo."""

    mjcf: Name
    joints: Annotated[list[Name], Field(min_length=1)] | None = Field(None, description="joints that move, in order")
    joint_limits: Name | None = Field(None, description="file in the format of joint_limits.yaml")
    locked: dict[Name, Number] | None = Field(None, description="values of joints that are held still [rad or m]")
    gripper: dict[Name, dict[Name, Number]] | None = Field(None, description=GRIPPER)
    strict: bool | None = Field(None, description="whether what is wrong in the description, or not read, is an error")


class DhRobot(_Mounted):
    """An arm described by a file with a Denavit-Hartenberg table."""

    dh: Name


RobotEntry: TypeAlias = Annotated[
    Annotated[Name, Tag("<a name>")]
    | Annotated[NamedRobot, Tag(tag("name"))]
    | Annotated[PlanarRobot, Tag(tag("planar"))]
    | Annotated[Point2dRobot, Tag(tag("point2d"))]
    | Annotated[MoveitRobot, Tag(tag("moveit"))]
    | Annotated[MjcfRobot, Tag(tag("mjcf"))]
    | Annotated[UrdfRobot, Tag(tag("urdf"))]
    | Annotated[DhRobot, Tag(tag("dh"))],
    told_apart_by("name", "moveit", "mjcf", "planar", "point2d", "urdf", "dh", what="robot", text="a name"),
]


def robot_data(source: Mapping[str, Any], folder: Path) -> dict[str, Any] | str:
    """Return the ``robot:`` entry for a robot with this source, in a file in ``folder``; paths become relative."""
    data: dict[str, Any] = {}
    for key, value in source.items():
        if isinstance(value, pin.SE3):
            data[key] = pose_data(value)
        elif key in PATH_KEYS and isinstance(value, list):
            data[key] = [relative_name(each, folder) for each in value]
        elif key in PATH_KEYS:
            data[key] = relative_name(value, folder)
        else:
            data[key] = value
    return str(data["name"]) if set(data) == {"name"} else data
