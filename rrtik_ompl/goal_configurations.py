"""Which configurations a planner may aim at: the goal's own, or free ones that inverse kinematics finds for it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.goal import GoalRegion, JointGoal, PoseGoal, PositionGoal, joint_difference
from rrtik_ompl.ik.face import solve_ik
from rrtik_ompl.ik.methods import METHODS
from rrtik_ompl.ik.numeric import numeric_ik, targets
from rrtik_ompl.problem import TURN, Problem

STARTS = 48  # of inverse kinematics in one round
ROUNDS = 4  # at most, until one free configuration is found
MOST = 16  # configurations handed to a planner
SAME_POSTURE = 1e-3  # [rad] or [m]


@dataclass(frozen=True, slots=True, eq=False)
class GoalConfigurations:
    """Free configurations at the goal, nearest to the start first, shape (k, dof); if there is none, the reason."""

    rows: Matrix
    reason: str = ""


def goal_configurations(problem: Problem, rng: np.random.Generator, *, all_turns: bool = True) -> GoalConfigurations:
    """Free configurations that satisfy the goal of a problem.

    Args:
        problem: The problem.
        rng: Random numbers for the starts of inverse kinematics.
        all_turns: For a goal in joint values: whether continuous joints may also reach it the long way round.
    """
    if isinstance(problem.goal, JointGoal):
        return GoalConfigurations(_turns(problem, problem.goal.q) if all_turns else problem.goal.q[None])
    reached = 0
    reason = f"inverse kinematics found no configuration at the goal from {STARTS * ROUNDS} starts; is it in reach?"
    for _ in range(ROUNDS):
        found = _solved(problem, problem.goal, rng)
        free = found[problem.world.valid_batch(found)]
        free = free[problem.world.certify(free)]
        if len(free):
            return GoalConfigurations(_nearest_first(problem, free))
        reached += len(found)
        if len(found):
            why = problem.world.explain(found[0])
            reason = f"{reached} configurations reach the goal, all in collision: for instance {why}"
    return GoalConfigurations(np.zeros((0, problem.world.robot.dof)), reason)


def _turns(problem: Problem, q: Vector) -> Matrix:
    """The configuration and, for each continuous joint, the same posture reached the other way round."""
    rows = [np.array(q)]
    for joint in np.flatnonzero(problem.world.robot.continuous):
        other = np.array(q)
        other[joint] += -TURN if other[joint] > problem.start[joint] else TURN
        rows.append(other)
    return np.array(rows)


def _solved(problem: Problem, goal: PoseGoal | PositionGoal | GoalRegion, rng: np.random.Generator) -> Matrix:
    """Configurations at the goal: all there are where the robot has a closed form, else from many starts."""
    robot = problem.world.robot
    drawn = targets(goal, STARTS, rng)
    if not any(METHODS["closed-form"].misfit(robot, target) for target in drawn):
        seed = int(rng.integers(2**31))
        return solve_ik(robot, goal, method="closed-form", near=problem.start, all=True, seed=seed).solutions
    starts = rng.uniform(*robot.finite_range(), (STARTS, robot.dof))
    starts[0] = problem.start
    return numeric_ik(robot, goal, starts)


def _nearest_first(problem: Problem, rows: Matrix) -> Matrix:
    """At most ``MOST`` different rows, turned to lie near the start, in the order of their distance from it."""
    difference = joint_difference(problem.world.robot, rows, problem.start)
    order = np.argsort(np.linalg.norm(difference, axis=1), kind="stable")
    kept: list[int] = []
    for k in order:
        if len(kept) < MOST and all(np.abs(difference[k] - difference[j]).max() > SAME_POSTURE for j in kept):
            kept.append(int(k))
    return np.where(problem.world.robot.continuous, problem.start + difference[kept], rows[kept])
