"""Goals of several tips: configurations with all tips at their goals, found tip by tip and then combined."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector, frozen
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.choices import IkMethod
from rrtik_ompl.constraints.held_region import HeldRegion
from rrtik_ompl.constraints.held_regions import HeldRegions, goal_regions
from rrtik_ompl.description.joint_weights import weighted_difference
from rrtik_ompl.ik.held_tables import projected_onto
from rrtik_ompl.ik.method_interface import IkResult, different_rows, nearest_first
from rrtik_ompl.model.goal import Goal, MultiGoal, joint_difference
from rrtik_ompl.model.robot import Robot, metres_per_radian
from rrtik_ompl.model.scene import Scene

PROJECTION: IkMethod = "projection"
STARTS = 96  # number of starts for each tip


def at_all_tips(
    robot: Robot,
    goal: Goal,
    near: Vector,
    rng: np.random.Generator,
    *,
    scene: Scene,
    path_regions: Iterable[HeldRegion],
) -> Matrix:
    """Return configurations with all tips at their goals that keep path constraints, shape (k, dof).

    First each tip alone is moved to its goal from many starts. Then configurations are combined: each joint is taken
    from a solution of the tip that it moves. Finally these are projected onto all goals and path constraints at once,
    since tips may share joints.

    Args:
        robot: The robot with all the tips.
        goal: A goal of several tips.
        near: The first of the starts, shape (dof,).
        rng: Draws the other starts and the combinations.
        scene: Its attached objects may have goals too.
        path_regions: Regions of path constraints.
    """
    regions = goal_regions(robot, scene, goal)
    starts = rng.uniform(*robot.finite_range(), (STARTS, robot.dof))
    starts[0] = near

    joined = starts.copy()
    for region in regions:
        of_this_tip = projected_onto(robot, HeldRegions((region,)), starts)
        if len(of_this_tip) == 0:
            return of_this_tip
        of_this_tip = of_this_tip[np.argsort(np.linalg.norm(weighted_difference(robot, of_this_tip, near), axis=1))]
        rows = np.append(0, rng.integers(len(of_this_tip), size=STARTS - 1))  # Row 0 combines the nearest solutions.
        moved = _moving(robot, region)
        joined[:, moved] = of_this_tip[rows][:, moved]

    found = projected_onto(robot, HeldRegions((*path_regions, *regions)), joined)
    at_goal: Matrix = found[goal.satisfied(robot, found)] if len(found) else found
    return at_goal


def _moving(robot: Robot, region: HeldRegion) -> NDArray[np.intp]:
    """Return the indices of the entries of q that move the frame of a region."""
    return np.flatnonzero((robot.chain.gain[region.rows] != 0.0).any(axis=0))


def solve_all_tips(
    robot: Robot,
    goal: MultiGoal,
    near: Vector,
    accept: Callable[[Matrix], Mask],
    budget: Budget,
    rng: np.random.Generator,
    *,
    scene: Scene,
) -> IkResult:
    """Solve inverse kinematics of several tips: all solutions of the first round that finds any, nearest first.

    Args:
        robot: The robot with all the tips.
        goal: A goal of several tips.
        near: Configuration near which solutions are wanted, shape (dof,).
        accept: Checks which configurations, shape (m, dof), are free; returns shape (m,).
        budget: Time limit, read between rounds; the first round is always done.
        rng: Source of random numbers.
        scene: Its attached objects may have goals too.
    """
    rounds = 0
    reason = "time"
    detail = ""

    while rounds == 0 or not budget.over():
        rounds += 1
        found = at_all_tips(robot, goal, near, rng, scene=scene, path_regions=())
        free = found[accept(found)]
        if len(free):
            turned = joint_difference(robot, free, near)
            chosen = different_rows(turned, nearest_first(robot, free, near))
            rows = np.where(robot.continuous, near + turned[chosen], free[chosen])
            return _result(rows, _residuals(robot, goal, rows), "", "", rounds, budget.elapsed)
        if len(found):
            reason = "collision"
            detail = f"{len(found)} configurations reach the goals, all in collision"

    tips = " and ".join(f"'{frame}'" for frame in goal.frames)
    detail = detail or f"goals out of reach: no configuration has {tips} at their goals"
    return _result(np.zeros((0, robot.dof)), np.zeros((0, 2)), reason, detail, rounds, budget.elapsed)


def _residuals(robot: Robot, goal: MultiGoal, rows: Matrix) -> Matrix:
    """Return the residuals of the tip that is farthest from its goal, for each row, shape (m, 2) [m, rad]."""
    each = np.array([part.errors(arm, rows) for arm, part in goal.each(robot)]).transpose(0, 2, 1)
    worst = np.argmax(each[..., 0] + metres_per_radian(robot) * each[..., 1], axis=0)
    farthest: Matrix = each[worst, np.arange(len(rows))]
    return farthest


def _result(rows: Matrix, residuals: Matrix, reason: str, detail: str, rounds: int, seconds: float) -> IkResult:
    return IkResult(frozen(rows), frozen(residuals), reason, detail, rounds, PROJECTION, seconds)
