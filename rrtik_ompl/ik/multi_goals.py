"""Goals of several tips: configurations with all of them in place, found tip by tip and put together."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Matrix
from rrtik_ompl.constraints.goal_regions import goal_regions
from rrtik_ompl.constraints.held_region import HeldRegion
from rrtik_ompl.constraints.held_regions import HeldRegions
from rrtik_ompl.goal import MultiGoal
from rrtik_ompl.ik.held_tables import projected_onto
from rrtik_ompl.problem import Problem
from rrtik_ompl.robot import Robot
from rrtik_ompl.world.holding_world import HoldingWorld

STARTS = 96  # random ones, for each tip


def at_all_tips(problem: Problem, goal: MultiGoal, rng: np.random.Generator) -> Matrix:
    """Configurations with all tips at their goals that keep the path constraints of a problem, shape (k, dof).

    First each tip alone is moved to its goal from many starts, then the joints of one tip's are put together with those
    of another's. Where tips share joints, or there are path constraints, that is but a start for all at once.
    """
    robot, world = problem.robot, problem.world
    regions = goal_regions(robot, world.scene, goal)
    starts = rng.uniform(*robot.finite_range(), (STARTS, robot.dof))
    starts[0] = problem.start
    joined = starts.copy()
    for region in regions:
        own = projected_onto(robot, HeldRegions((region,)), starts)
        if len(own) == 0:
            return own
        own = own[np.argsort(np.linalg.norm(own - problem.start, axis=1))]
        rows = np.append(0, rng.integers(len(own), size=STARTS - 1))  # the nearest ones of all tips first
        moved = _moving(robot, region)
        joined[:, moved] = own[rows][:, moved]
    kept = world.constraints.regions if isinstance(world, HoldingWorld) else ()
    found = projected_onto(robot, HeldRegions((*kept, *regions)), joined)
    there: Matrix = found[goal.satisfied(robot, found)] if len(found) else found
    return there


def _moving(robot: Robot, region: HeldRegion) -> NDArray[np.intp]:
    """Numbers of the joints of q that move the frame of a region."""
    return np.flatnonzero((robot.chain.gain[region.rows] != 0.0).any(axis=0))
