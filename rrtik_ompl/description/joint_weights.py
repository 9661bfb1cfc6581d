"""Weight joints in the length of a path: a joint with a larger weight is moved less."""

from __future__ import annotations

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector, frozen
from rrtik_ompl.base.kept import kept_with
from rrtik_ompl.model.goal import joint_difference
from rrtik_ompl.model.robot import Robot


def given_weights(robot: Robot) -> list[float]:
    """Return the weight of each joint as it was given; 1 for joints without one."""
    return [robot.joint_weights.get(joint, 1.0) for joint in robot.joint_names]


def weights_as_costs(robot: Robot) -> dict[str, list[float]]:
    """Return the option ``joint_costs`` that corresponds to a robot's joint weights; empty if it has none."""
    return {"joint_costs": given_weights(robot)} if robot.joint_weights else {}


def weighted_difference(robot: Robot, Q: Matrix, q: Vector) -> Matrix:
    """Return ``Q - q`` per joint, in the shorter direction, multiplied by the weights; shape of Q, (..., dof)."""
    difference = joint_difference(robot, Q, q)
    return difference * weights_of(robot) if robot.joint_weights else difference


@kept_with
def weights_of(robot: Robot) -> Vector:
    """Return the normalised joint weights, shape (dof,): the diagonal of the box of joint limits keeps its length.

    This is needed because steps of searches are shares of that diagonal.
    """
    given = np.array(given_weights(robot))
    lower, upper = robot.finite_range()
    return frozen(given * (np.linalg.norm(upper - lower) / np.linalg.norm(given * (upper - lower))))


@kept_with
def has_even_weights(robot: Robot) -> bool:
    """Check whether all joints weigh the same, so that weights make no difference."""
    weights = weights_of(robot)
    return bool((weights == weights[0]).all())
