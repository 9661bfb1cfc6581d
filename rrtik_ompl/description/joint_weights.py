"""How much each joint counts in the length of a path: a joint that is slow, or that moves much, is moved less."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from types import MappingProxyType

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector, frozen, positive
from rrtik_ompl.base.errors import InputError, require
from rrtik_ompl.description.named_numbers import by_name
from rrtik_ompl.model.goal import joint_difference
from rrtik_ompl.model.robot import Robot

LIGHTEST = 1e-3
HEAVIEST = 1e3


def given_weights(robot: Robot) -> list[float]:
    """The weight of each joint as it was given, 1 for those without."""
    return [robot.joint_weights.get(joint, 1.0) for joint in robot.joint_names]


def weights_as_costs(robot: Robot) -> dict[str, list[float]]:
    """The option ``joint_costs`` that the weights of a robot's joints make; nothing if it has none."""
    return {"joint_costs": given_weights(robot)} if robot.joint_weights else {}


def weighted_difference(robot: Robot, Q: Matrix, q: Vector) -> Matrix:
    """``Q - q`` per joint, the short way round, multiplied by the weights. Shape of Q, (..., dof)."""
    difference = joint_difference(robot, Q, q)
    return difference * weights_of(robot) if robot.joint_weights else difference


@lru_cache(maxsize=64)
def weights_of(robot: Robot) -> Vector:
    """How much each joint counts, shape (dof,): such that the box of the limits is as long as without weights.

    Steps of searches are shares of that box.
    """
    given = np.array(given_weights(robot))
    lower, upper = robot.finite_range()
    return frozen(given * (np.linalg.norm(upper - lower) / np.linalg.norm(given * (upper - lower))))


def weighted(robot: Robot, weights: Mapping[str, float]) -> Robot:
    """The robot with joints that count more or less than others in the length of a path.

    A joint of weight w counts w times as much as one without: :func:`rrtik_ompl.plan`, ``plan(improve=)``,
    :func:`rrtik_ompl.shorten` and :class:`rrtik_ompl.Task` make the length small in which each joint's way is
    multiplied by its weight, also under path constraints, and planners measure distances so. Of several solutions
    of inverse kinematics the nearest is the one whose weighted way is shortest. For paths of single-joint moves the
    weights are the ``joint_costs``, unless these are given. Only proportions matter. ``JointPath.length`` is without.

    Args:
        robot: The robot; weights that it has already are replaced.
        weights: By name of joint, from 0.001 to 1000; a joint without one counts 1.

    Raises:
        UnknownNameError: If no actuated joint has a name.
        InputError: If a weight is out of range.

    Example:
        >>> import rrtik_ompl as rrtik
        >>> arm = rrtik.weighted(rrtik.load_robot("ur5"), {"shoulder_pan_joint": 5.0})
        >>> arm.joint_weights["shoulder_pan_joint"]
        5.0
    """
    require(robot, Robot, "robot to weight", "use load_robot(name or file)")
    require(weights, Mapping, f"joint weights of robot '{robot.name}'", "use {name of a joint: weight}")

    weight_of_joint = by_name(robot, "joint_weights", "joint", robot.joint_names, weights, _in_range)
    source = dict(robot.source) | {"joint_weights": dict(weight_of_joint)}
    not_one = {joint: weight for joint, weight in weight_of_joint.items() if weight != 1.0}
    return replace(robot, joint_weights=MappingProxyType(not_one), source=MappingProxyType(source))


def _in_range(weight: float, what: str) -> float:
    weight = positive(weight, what)
    if not LIGHTEST <= weight <= HEAVIEST:
        raise InputError(f"{what}: must be from {LIGHTEST:g} to {HEAVIEST:g}, got {weight:g}")
    return weight
