"""How much each joint counts in the length of a path: a joint that is slow, or that moves much, is moved less."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector, frozen
from rrtik_ompl.model.goal import joint_difference
from rrtik_ompl.model.robot import Robot


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
