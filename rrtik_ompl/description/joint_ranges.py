"""Joints that may use a part of their limits alone: MoveIt's joint constraints of a path."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

from rrtik_ompl.base.arrays import finite_array, frozen
from rrtik_ompl.base.errors import InputError, UnknownNameError, require
from rrtik_ompl.model.robot import Robot


def narrowed(robot: Robot, ranges: Mapping[str, Sequence[float]]) -> Robot:
    """The robot whose joints keep to ranges inside their limits, on whole motions.

    Args:
        robot: The robot.
        ranges: Lowest and highest value by name of joint [rad or m]; what lies outside the limits of the joint is cut
            off.

    Raises:
        UnknownNameError: If the robot has no actuated joint of a name.
        InputError: If a range is upside down, empty within the limits, or of a joint that turns without limits.

    Example:
        >>> import rrtik_ompl as rrtik
        >>> arm = rrtik.narrowed(rrtik.load_robot("panda"), {"panda_joint1": (-0.5, 0.5)})
        >>> float(arm.upper[0])
        0.5
    """
    require(robot, Robot, "robot with narrower ranges", "use load_robot(name or file)")
    require(ranges, Mapping, "joint_ranges of a robot", "give two numbers by name of joint")

    lower = robot.lower.copy()
    upper = robot.upper.copy()
    applied: dict[str, list[float]] = {}
    for joint, bounds in ranges.items():
        if joint not in robot.joint_names:
            raise UnknownNameError(f"actuated joint of robot '{robot.name}'", joint, robot.joint_names)
        subject = f"joint_ranges of robot '{robot.name}': {joint}"
        wanted_low, wanted_high = finite_array(bounds, (2,), subject)
        k = robot.joint_names.index(joint)
        if robot.continuous[k]:
            raise InputError(f"{subject}: it turns without limits; give it limits in the robot's description")

        new_lower = max(wanted_low, lower[k])
        new_upper = min(wanted_high, upper[k])
        if not new_lower < new_upper:
            limits = f"its limits are {lower[k]:g} to {upper[k]:g}"
            raise InputError(f"{subject}: {wanted_low:g} to {wanted_high:g} leaves it no room, {limits}")

        lower[k] = new_lower
        upper[k] = new_upper
        applied[joint] = [float(wanted_low), float(wanted_high)]

    source = dict(robot.source) | {"joint_ranges": dict(robot.source.get("joint_ranges", {})) | applied}
    return replace(robot, lower=frozen(lower), upper=frozen(upper), source=MappingProxyType(source))
