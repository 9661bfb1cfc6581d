"""What an individual is worth: distance and angle from the target, motion, singularity, collision, in one batch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.ik.genetic.options import GeneticOptions
from rrtik_ompl.ik.method_interface import Target
from rrtik_ompl.model.goal import joint_difference
from rrtik_ompl.model.robot import Robot, jacobians, poses
from rrtik_ompl.model.tip_distance import reach_of


@dataclass(frozen=True, slots=True, eq=False)
class Score:
    """Of every individual: its cost [m], distance [m] and angle [rad] from the target, whether it is there."""

    cost: Vector
    distance: Vector
    angle: Vector
    reached: Mask


def score(
    robot: Robot,
    target: Target,
    Q: Matrix,
    last: Vector | None,
    options: GeneticOptions,
    accept: Callable[[Matrix], Mask],
) -> Score:
    """Score configurations, shape (m, dof).

    The fitness in [2] is 100 inches less the distance; as a tournament only compares, the distance serves as well.

    Args:
        robot: The arm.
        target: A pose, or a position with any orientation.
        Q: The population.
        last: Configuration at the point before, shape (dof,), or None.
        options: The weights.
        accept: Which configurations will do; the others cost as much as the arm's reach more.
    """
    tips = poses(robot, Q)
    max_distance, max_angle = target.tolerances
    distance, angle = target.tip_errors(tips)
    reached = distance < max_distance
    if target.oriented:
        reached &= angle < max_angle

    cost = distance + options.orientation_weight * angle
    if options.motion_weight and last is not None:
        cost += options.motion_weight * np.linalg.norm(joint_difference(robot, Q, last), axis=1)
    if options.singularity_weight:
        cost -= options.singularity_weight * manipulability(robot, Q, not target.oriented)

    accepted = accept(Q)
    if not accepted.all():
        reached &= accepted
        cost += reach_of(robot) * ~accepted

    return Score(cost, distance, angle, reached)


def manipulability(robot: Robot, Q: Matrix, position_only: bool) -> Vector:
    """Product of the singular values of the Jacobian, sqrt(det(J J^T)) [31], lengths in units of the reach.

    Args:
        robot: The arm.
        Q: Shape (m, dof).
        position_only: Whether the task is the position of the tip, not its pose.

    Returns:
        Shape (m,).
    """
    J = jacobians(robot, Q)
    J[:, :3] /= reach_of(robot)
    if position_only:
        J = J[:, :3]
    values: Vector = np.linalg.svd(J, compute_uv=False).prod(axis=1)
    return values
