"""Goals of the tip under path constraints: configurations that are at the goal and in all regions."""

from __future__ import annotations

import numpy as np

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.constraints.held_region import held_region
from rrtik_ompl.constraints.held_regions import HeldRegions
from rrtik_ompl.ik.held_tables import projected_onto
from rrtik_ompl.model.goal import GoalPart, TipGoal
from rrtik_ompl.world.problem import Problem

STARTS = 48  # random ones beside what inverse kinematics found
PARTS = 6  # of a grasp set, to which rows are moved at a time


def held_at_goal(problem: Problem, goal: TipGoal, found: Matrix, rng: np.random.Generator) -> Matrix:
    """Configurations at the goal of a problem that keep its path constraints.

    Args:
        problem: With path constraints.
        goal: Its goal.
        found: Configurations at the goal, shape (m, dof). Those that are outside a region are moved into all, along
            what the goal leaves free.
        rng: Draws further starts.

    Returns:
        Shape (k, dof).
    """
    constraints = problem.world.constraints
    if constraints is None:
        return found
    held = constraints.held(found)
    starts = np.vstack([found[~held], rng.uniform(*problem.robot.finite_range(), (STARTS, problem.robot.dof))])
    rows = [found[held]]
    if not held.all() or len(found) == 0:
        parts = goal.parts
        chosen = rng.permutation(len(parts))[:PARTS]
        rows += [_moved(problem, constraints, parts[k], starts) for k in chosen]
    joined: Matrix = np.vstack(rows)
    return joined[goal.satisfied(problem.robot, joined)] if len(joined) else joined


def _moved(problem: Problem, constraints: HeldRegions, part: GoalPart, starts: Matrix) -> Matrix:
    """Configurations moved into all regions and to one part of the goal; those that get there."""
    try:
        aim = held_region(problem.robot, problem.world.scene, part.region(), "the goal")
    except InputError:  # ranges of angles that cannot be held; inverse kinematics alone must do
        return starts[:0]
    return projected_onto(problem.robot, HeldRegions((*constraints.regions, aim)), starts)
