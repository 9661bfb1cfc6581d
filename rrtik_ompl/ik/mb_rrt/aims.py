"""Free goal configurations for a planner, found by the tree in the workspace."""

from __future__ import annotations

import time

import numpy as np

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.ik.mb_rrt.search import search
from rrtik_ompl.ik.targets import targets
from rrtik_ompl.model.goal import TipGoal, joint_difference
from rrtik_ompl.world.world import World

DRAWS = 16  # targets of a goal that leaves freedom
MAX_CONFIGURATIONS = 16  # of one call


def tree_aims(
    world: World,
    goal: TipGoal,
    near: Vector,
    rng: np.random.Generator,
    *,
    seconds: float = 1.0,
    max_count: int = MAX_CONFIGURATIONS,
) -> Matrix:
    """Free configurations at a goal, nearest to a posture first.

    Args:
        world: The robot, which `rrtik_ompl.ik.mb_rrt.axes.misfit` accepts, and its scene.
        goal: A goal of the tip.
        near: Shape (dof,).
        rng: Random numbers.
        seconds: Time limit.
        max_count: Configurations at most.

    Returns:
        Shape (k, dof), k <= ``max_count``, none if none was found in time.
    """
    deadline = time.monotonic() + seconds
    robot = world.robot
    rows = np.zeros((0, robot.dof))

    def accept(Q: Matrix) -> Mask:
        return world.valid_batch(robot.clamp(Q))

    for target in targets(goal, DRAWS, rng):
        found = search(robot, target, near=near, accept=accept, rng=rng, deadline=deadline, world=world)
        rows = np.vstack([rows, robot.clamp(found.q)])
        rows = rows[goal.satisfied(robot, rows) & world.valid_batch(rows)] if len(rows) else rows
        if found.timed_out or len(rows) >= max_count:
            break

    differences = joint_difference(robot, rows, near)
    order = np.argsort(np.linalg.norm(differences, axis=1), kind="stable")[:max_count]
    nearest: Matrix = np.where(robot.continuous, near + differences[order], rows[order])
    return nearest
