"""Read timed motions from files: those that `Trajectory.save` wrote, and messages of ROS."""

from __future__ import annotations

import os
from dataclasses import replace
from typing import Any

import numpy as np

from rrtik_ompl.base.arrays import finite_array
from rrtik_ompl.base.copies import changed
from rrtik_ompl.base.errors import InputError, in_file, require
from rrtik_ompl.files.kinds import kind_of
from rrtik_ompl.files.tables import FORMATS as PATH_FORMATS
from rrtik_ompl.files.text import known_ending, read_text
from rrtik_ompl.model.gripper import Events, checked_events
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.robot import Robot, joint_order
from rrtik_ompl.motion.trajectory.cubics import Cubics
from rrtik_ompl.motion.trajectory.gripper_text import read_ros_commands
from rrtik_ompl.motion.trajectory.motion import Trajectory
from rrtik_ompl.motion.trajectory.text import FIELDS, FORMATS, loads, read_mcap


def read_trajectory(
    file: str | os.PathLike[str], robot: Robot | None = None, *, gripper: str | os.PathLike[str] | None = None
) -> Trajectory:
    """Read a motion; see :meth:`Trajectory.load`.

    Raises:
        InputError: If the file is missing, malformed, or does not fit the robot; the message names file and line.
    """
    require(robot, Robot | None, "robot of a trajectory", "use load_robot(name)")
    ending = known_ending(file, (*FORMATS, ".mcap"), "trajectory")
    try:
        document = read_mcap(file) if ending == ".mcap" else loads(read_text(file), ending)
        if robot is not None and document["joint_names"] is not None:
            document = _sorted(document, robot)
        document["gripper"] = _of_gripper(robot, document["gripper"])
        motion = _from_document(document, robot)
    except InputError as error:
        raise in_file(file, error) from None
    if gripper is None:
        return motion
    try:
        events = checked_events(_of_gripper(robot, read_ros_commands(gripper)), motion.duration)
    except InputError as error:
        raise in_file(gripper, error) from None
    return changed(motion, gripper=events)


def load_motion_or_path(file: str | os.PathLike[str], robot: Robot) -> Trajectory | JointPath:
    """Read a timed motion or a path, whichever the file holds.

    Raises:
        InputError: If the file holds neither, or does not fit the robot.
    """
    known_ending(file, (*PATH_FORMATS, ".yaml"), "path or trajectory")
    return Trajectory.load(file, robot) if kind_of(file) == "Trajectory" else JointPath.load(file, robot)


def _of_gripper(robot: Robot | None, events: Events) -> Events:
    """Return commands with the name and units of a robot's gripper, if they are for its joints.

    Raises:
        InputError: If they are for other joints.
    """
    if robot is None or not events:
        return events
    own = robot.gripper
    if own is None or own.joints != events[0].joints:
        joints = "no gripper" if own is None else f"a gripper with {', '.join(own.joints)}"
        raise InputError(
            f"commands to a gripper with {', '.join(events[0].joints)}, but robot '{robot.name}' has {joints}"
        )
    return tuple(replace(event, gripper=own.name, units=own.units) for event in events)


def _sorted(document: dict[str, Any], robot: Robot) -> dict[str, Any]:
    """Return the columns of a file in the order of a robot's joints.

    Raises:
        InputError: If they are other joints.
    """
    order = joint_order(robot, document["joint_names"], "trajectory")
    named: dict[str, Any] = {"joint_names": list(robot.joint_names)}
    if document["units"] is not None and len(document["units"]) == robot.dof:
        named["units"] = [document["units"][k] for k in order]
    for field in FIELDS:
        if document[field] is not None:
            named[field] = finite_array(document[field], (None, robot.dof), f"trajectory {field}")[:, order]
    return document | named


def _from_document(document: dict[str, Any], robot: Robot | None) -> Trajectory:
    """Make a trajectory of the columns of a file; see :func:`.text.loads`.

    Accelerations are used if they lead to the next point; otherwise three cubics per interval are. Points at a
    control rate become set points of the motion.
    """
    units = document["units"]
    sliding = None if units is None else [unit == "m" for unit in units]
    if sliding is None and robot is not None and document["joint_names"] == list(robot.joint_names):
        sliding = robot.prismatic.tolist()
    names = {"joint_names": document["joint_names"], "prismatic": sliding, "robot_name": document["robot"]}
    names["gripper"] = document["gripper"]

    plain = Trajectory(document["times"], document["positions"], document["velocities"], **names)
    if document["accelerations"] is None:
        return plain

    bends = finite_array(document["accelerations"], plain.positions.shape, "trajectory accelerations")
    points = Cubics(plain.times, plain.positions, plain.velocities, bends)
    dense = points.are_set_points()
    if not dense:
        try:
            return Trajectory(points.times, points.positions, points.velocities, bends, **names)
        except InputError:  # The accelerations do not lead to the next point.
            pass

    thirds = points.in_thirds()
    try:
        smooth = Trajectory(thirds.times, thirds.positions, thirds.velocities, thirds.accelerations, **names)
    except InputError:  # The cubics cannot be computed accurately enough.
        return plain
    return smooth.at_set_points(np.arange(0, len(thirds.times), 3)) if dense else smooth
