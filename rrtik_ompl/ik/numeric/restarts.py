"""Methods that walk from a start towards a goal, made into methods of `solve_ik`: many starts, round after round."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import TypeAlias

import numpy as np

from rrtik_ompl.base.arrays import TAU, Matrix, Vector
from rrtik_ompl.ik.goal_rows import goal_rows
from rrtik_ompl.ik.method_interface import IkRequest, IkResponse, Target
from rrtik_ompl.ik.numeric.descent import Search, walk
from rrtik_ompl.model.robot import Robot, inside_limits

STARTS = 32  # in one round
MAX_ROUNDS = 16  # after which it gives up
MEMBERS = 4  # of a region, that are searched once more to say why there is no solution

# From (robot, goal, starts of shape (m, dof)) to where each start has led to, shape (m, dof), and the steps taken.
Walk: TypeAlias = Callable[[Robot, Target, Matrix], tuple[Matrix, int]]


def restarted(method: Walk, request: IkRequest, *, starts: int = STARTS, rounds: int = MAX_ROUNDS) -> IkResponse:
    """Walk from the posture and from random ones, round after round until a solution will do.

    Args:
        method: What walks; what it leads to outside the joint limits is left out.
        request: The problem.
        starts: In one round.
        rounds: At most, but one for each target; these take turns.
    """
    robot = request.robot
    found = np.zeros((0, robot.dof))
    steps = 0

    for number in range(max(rounds, len(request.targets))):
        target = request.targets[number % len(request.targets)]
        Q = request.rng.uniform(*robot.finite_range(), (starts, robot.dof))
        if number < len(request.targets):
            Q[0] = request.near
        Q, taken = method(robot, target, Q)
        usable = target.satisfied(robot, Q) & inside_limits(robot, Q)
        found = np.vstack([found, Q[usable]])
        steps += taken
        if request.accept(found).any() and not request.all:
            break
        if time.monotonic() > request.deadline:
            return IkResponse(found, nearest_posture(request), steps, timed_out=True)

    return IkResponse(found, request.near if len(found) else nearest_posture(request), steps)


def nearest_posture(request: IkRequest, *, searched: bool = False) -> Vector:
    """The posture that comes nearest to the goal, for the reason of a failure, shape (dof,).

    It is one inside the limits if such a one reaches the goal; otherwise the joints may turn without limits.

    Args:
        request: The problem.
        searched: Whether `Search` is known to find nothing inside the limits.
    """
    robot = request.robot
    aims = aims_of(request)
    if not searched:
        search = Search(robot, aims[:MEMBERS], request.near)
        solutions = search.q[search.advance(np.arange(len(search.q)))]
        if len(solutions):
            first: Vector = solutions[0]
            return first

    starts = request.rng.uniform(*robot.finite_range(), (STARTS, robot.dof))
    anywhere, _, _ = walk(_turning_freely(robot), aims[np.arange(STARTS) % len(aims)], starts)
    nearest: Vector = anywhere[int(np.argmin(np.add(*request.goal.errors(robot, anywhere))))]
    return nearest


def aims_of(request: IkRequest) -> Matrix:
    """Rows of the goal, see `rrtik_ompl.ik.goal_rows`; of targets drawn from it if it has task-space regions."""
    if request.goal.has_regions:
        return np.vstack([goal_rows(target) for target in request.targets])
    return goal_rows(request.goal)


@lru_cache(maxsize=64)
def _turning_freely(robot: Robot) -> Robot:
    """The robot with a full turn to either side in place of its limits."""
    turning = ~robot.prismatic
    return replace(
        robot,
        lower=np.where(turning, -TAU, robot.lower),
        upper=np.where(turning, TAU, robot.upper),
    )
