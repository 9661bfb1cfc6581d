"""Derive a robot from another one: with larger or thicker links, narrower joint ranges or joint weights.

`rrtik_ompl.load_robot` takes these as options of any robot.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import TypeAlias

import coal
import pinocchio as pin

from rrtik_ompl.base.arrays import bounded_array, finite_array, frozen, not_negative, positive
from rrtik_ompl.base.errors import InputError, UnknownNameError, require
from rrtik_ompl.geometry.collision.shape_table import resized
from rrtik_ompl.geometry.collision.solids import bvh, hull, is_mesh, mesh_arrays
from rrtik_ompl.model.robot import Robot

Padding: TypeAlias = float | Mapping[str, float]
LIGHTEST = 1e-3  # least weight of a joint
HEAVIEST = 1e3


def scaled(robot: Robot, scale: Mapping[str, float]) -> Robot:
    """Return the robot with collision solids of another size, in checks against everything.

    Each solid of a link grows or shrinks about its own centre, a mesh about the mean of its vertices, as with MoveIt's
    ``link_scale``. The visual geometry stays as it is.

    Args:
        robot: The robot. Factors multiply with those that it already has.
        scale: Factors by name of link, greater than 0; links that are not named stay as they are.

    Raises:
        UnknownNameError: If the robot has no link of that name.
        InputError: If a factor is not greater than 0, or a link has a solid that cannot be scaled.

    Example:
        >>> import rrtik_ompl as rrtik
        >>> arm = rrtik.load_robot("panda", scale={"panda_hand": 1.1})
        >>> dict(arm.source["scale"])
        {'panda_hand': 1.1}
    """
    require(robot, Robot, "robot to scale", "use load_robot(name or file)")
    require(scale, Mapping, "scale of a robot", "give factors by name of link")
    factors = _by_name(robot, "scale", "link", robot.link_names, scale, positive)

    model = pin.GeometryModel()
    for item in robot.collision.geometryObjects:
        link = robot.link_of(item)
        geometry = item.geometry
        if factors.get(link, 1.0) != 1.0:
            geometry = _scaled(geometry, factors[link], f"scale of robot '{robot.name}': {link}")
        model.addGeometryObject(
            pin.GeometryObject(
                item.name,
                item.parentJoint,
                item.parentFrame,
                item.placement,
                geometry,
                item.meshPath,
                item.meshScale,
                item.overrideMaterial,
                item.meshColor,
            )
        )

    earlier = dict(robot.source.get("scale", {}))
    combined = earlier | {link: factor * earlier.get(link, 1.0) for link, factor in factors.items()}
    return replace(robot, collision=model, source=MappingProxyType(dict(robot.source) | {"scale": combined}))


def padded(robot: Robot, padding: Padding) -> Robot:
    """Return the robot with thicker links, in checks against obstacles and each other.

    All checks and proofs keep the padding in addition to the margins of obstacles and to the ``self_margin`` of
    :class:`rrtik_ompl.World`; between two links with paddings, the sum of both. Between two bodies that do not move,
    the required distance stays 0. MoveIt's ``link_padding``, in contrast, applies to obstacles only.

    Args:
        robot: The robot; padding that it already has is replaced.
        padding: Padding by name of link [m], at least 0; or one number for all links.

    Raises:
        UnknownNameError: If the robot has no link of that name.
        InputError: If a number is negative or not finite.

    Example:
        >>> import rrtik_ompl as rrtik
        >>> arm = rrtik.load_robot("panda", padding={"panda_hand": 0.01})
        >>> arm.padding["panda_hand"]
        0.01
    """
    require(robot, Robot, "robot to pad", "use load_robot(name or file)")

    padding_by_link = padding if isinstance(padding, Mapping) else dict.fromkeys(robot.link_names, padding)
    checked = _by_name(robot, "padding", "link", robot.link_names, padding_by_link, not_negative)
    source = dict(robot.source) | {"padding": dict(checked) if isinstance(padding, Mapping) else float(padding)}
    not_zero = {link: value for link, value in checked.items() if value > 0.0}
    return replace(robot, padding=MappingProxyType(not_zero), source=MappingProxyType(source))


def narrowed(robot: Robot, ranges: Mapping[str, Sequence[float]]) -> Robot:
    """Return the robot with joint ranges narrower than its limits, which hold on whole motions.

    Args:
        robot: The robot.
        ranges: Lowest and highest value by name of joint [rad or m]; parts outside the joint's limits are cut off.

    Raises:
        UnknownNameError: If the robot has no actuated joint of that name.
        InputError: If a range is reversed, empty within the limits, or for a joint that turns without limits.

    Example:
        >>> import rrtik_ompl as rrtik
        >>> arm = rrtik.load_robot("panda", joint_ranges={"panda_joint1": (-0.5, 0.5)})
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


def weighted(robot: Robot, weights: Mapping[str, float]) -> Robot:
    """Return the robot with joints that count more or less than others in the length of a path.

    A joint of weight w counts w times as much as one without. :func:`rrtik_ompl.plan`, ``plan(improve=)``,
    :func:`rrtik_ompl.shorten` and :class:`rrtik_ompl.Task` minimise the length in which each joint's motion is
    multiplied by its weight, also under path constraints, and planners measure distances in this way. Of several
    solutions of inverse kinematics, the nearest is the one with the least weighted distance. For paths of single-joint
    moves the weights are the ``joint_costs``, unless these are given. Only the proportions of weights matter.
    ``JointPath.length`` is without weights.

    Args:
        robot: The robot; weights that it already has are replaced.
        weights: Weights by name of joint, from 0.001 to 1000; a joint without one counts 1.

    Raises:
        UnknownNameError: If no actuated joint has that name.
        InputError: If a weight is out of range.

    Example:
        >>> import rrtik_ompl as rrtik
        >>> arm = rrtik.load_robot("ur5", joint_weights={"shoulder_pan_joint": 5.0})
        >>> arm.joint_weights["shoulder_pan_joint"]
        5.0
    """
    require(robot, Robot, "robot to weight", "use load_robot(name or file)")
    require(weights, Mapping, f"joint weights of robot '{robot.name}'", "use {name of a joint: weight}")

    weight_of_joint = _by_name(robot, "joint_weights", "joint", robot.joint_names, weights, _in_range)
    source = dict(robot.source) | {"joint_weights": dict(weight_of_joint)}
    not_one = {joint: weight for joint, weight in weight_of_joint.items() if weight != 1.0}
    return replace(robot, joint_weights=MappingProxyType(not_one), source=MappingProxyType(source))


def _by_name(
    robot: Robot,
    option: str,
    kind: str,
    names: Iterable[str],
    given: Mapping[str, float],
    checked: Callable[[float, str], float],
) -> dict[str, float]:
    """Check the numbers of an option that are given by name, and return them.

    Args:
        robot: The robot.
        option: Name of the option, for messages.
        kind: What the names refer to: "link" or "joint".
        names: All known names.
        given: The numbers by name.
        checked: Function of a number and its description that returns the number, or raises an error.

    Raises:
        UnknownNameError: If a name is not known.
        InputError: If a value is not a number, or ``checked`` raises it.
    """
    known = tuple(names)
    found = {}
    for name, value in given.items():
        if name not in known:
            raise UnknownNameError(f"{kind} of robot '{robot.name}'", name, known, where=option)
        what = f"{option} of robot '{robot.name}': {name}"
        found[name] = checked(float(bounded_array(value, (), what)), what)
    return found


def _scaled(geometry: coal.CollisionGeometry, factor: float, what: str) -> coal.CollisionGeometry:
    """Return a coal solid of another size, in the same place."""
    simple_solid = resized(geometry, factor)
    if simple_solid is not None:
        return simple_solid
    if is_mesh(geometry):
        vertices, triangles = mesh_arrays(geometry)
        middle = vertices.mean(axis=0)
        return bvh(middle + factor * (vertices - middle), triangles)
    if isinstance(geometry, coal.ConvexBase):
        points = geometry.points()
        middle = points.mean(axis=0)
        return hull(middle + factor * (points - middle))
    raise InputError(f"{what}: a solid of type {type(geometry).__name__} cannot be scaled")


def _in_range(weight: float, what: str) -> float:
    weight = positive(weight, what)
    if not LIGHTEST <= weight <= HEAVIEST:
        raise InputError(f"{what}: must be from {LIGHTEST:g} to {HEAVIEST:g}, got {weight:g}")
    return weight
