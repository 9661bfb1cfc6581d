"""Methods of `solve_ik` that descend from many starts: Levenberg-Marquardt, and any other descent, round by round."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from rrtik_ompl.base.arrays import TAU, Matrix, Vector
from rrtik_ompl.base.kept import kept_with
from rrtik_ompl.ik.kernel_tables import seeded_limb_of
from rrtik_ompl.ik.method_interface import IkRequest, IkResponse, mid_range_configuration
from rrtik_ompl.ik.numeric.descent import PATIENCE, STEPS, Search, SearchOfOne, walk
from rrtik_ompl.ik.targets import goal_rows
from rrtik_ompl.kernels.ik.ik_layout import KERNELS
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.model.goal import Target, TipGoal
from rrtik_ompl.model.robot import Robot, inside_limits

AT_ONCE = 32  # members of a goal that are advanced between two readings of the clock
STARTS = 32  # starts in one round
MAX_ROUNDS = 16  # number of rounds after which a method gives up
MEMBERS = 4  # members of a region that are searched once more to explain why there is no solution

# A function of (robot, goal, starts of shape (m, dof)) that returns the last configuration of each start, shape
# (m, dof), and the number of steps taken.
Walk: TypeAlias = Callable[[Robot, Target, Matrix], tuple[Matrix, int]]


def numeric(request: IkRequest) -> IkResponse:
    """Solve a request by Levenberg-Marquardt: members of the goal are solved in groups until a solution is accepted.

    Members whose solution was rejected go to the end of the queue and are continued from their next start.
    """
    if request.all:
        return _many(request)
    aims = aims_of(request)
    kernels = library(KERNELS)
    limb = seeded_limb_of(request.robot)
    if len(aims) == 1 and kernels is not None and limb is not None:
        near = request.near
        if near is not mid_range_configuration(request.robot):  # The default is inside the limits.
            near = request.robot.clamp(near)
        return _alone(request, SearchOfOne(kernels, limb, aims, near))

    search = Search(request.robot, aims, request.near)
    waiting = np.arange(len(aims))
    found = []
    timed_out = False
    while len(waiting):
        going = waiting[:AT_ONCE]
        waiting = waiting[AT_ONCE:]
        going = going[search.advance(going)]
        found.append(search.q[going])
        timed_out = request.budget.over()
        if timed_out or request.accept(found[-1]).any():
            break
        waiting = np.concatenate([waiting, going])

    return _answered(request, np.concatenate(found), search.steps, timed_out)


def _alone(request: IkRequest, search: SearchOfOne) -> IkResponse:
    """Solve for a goal of one member: one solution after the other until one is accepted."""
    found = [search.advance()]
    timed_out = request.budget.over()
    while not timed_out and len(found[-1]) and not request.accept(found[-1])[0]:
        found.append(search.advance())
        timed_out = request.budget.over()
    search.close()
    return _answered(request, found[0] if len(found) == 1 else np.concatenate(found), search.steps, timed_out)


def _many(request: IkRequest) -> IkResponse:
    """Collect solutions from `MAX_ROUNDS` rounds of random starts; the members of the goal take turns."""
    robot = request.robot
    steps = 0
    timed_out = False
    found = [np.zeros((0, robot.dof))]
    aims = aims_of(request)

    for number in range(MAX_ROUNDS):
        Q = request.rng.uniform(*robot.finite_range(), (STARTS, robot.dof))
        if number == 0:
            Q[0] = request.near
        Q, reached, taken = walk(robot, aims[(number * STARTS + np.arange(STARTS)) % len(aims)], Q, patience=PATIENCE)
        found.append(Q[reached])
        steps += taken
        timed_out = request.budget.over()
        if timed_out:
            break

    return _answered(request, np.vstack(found), steps, timed_out)


def _answered(request: IkRequest, found: Matrix, steps: int, timed_out: bool) -> IkResponse:
    """Return the response with the configurations found, shape (k, dof), or else with the nearest configuration."""
    if len(found):
        return IkResponse(found, request.near, steps, timed_out)
    searched = not request.all and not timed_out
    return IkResponse(found, nearest_posture(request, searched=searched), steps, timed_out)


def restarted(method: Walk, request: IkRequest, *, starts: int = STARTS, rounds: int = MAX_ROUNDS) -> IkResponse:
    """Solve a request by a method that descends from given starts, round by round until a solution is accepted.

    The first start is the wanted configuration, the others are random; the targets take turns.

    Args:
        method: The method; results outside the joint limits are left out.
        request: The problem.
        starts: Number of starts in one round.
        rounds: Largest number of rounds, but at least one for each target.
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
        if request.budget.over():
            return IkResponse(found, nearest_posture(request), steps, timed_out=True)

    return IkResponse(found, request.near if len(found) else nearest_posture(request), steps)


def nearest_posture(request: IkRequest, *, searched: bool = False) -> Vector:
    """Return the configuration that comes nearest to the goal, to explain a failure, shape (dof,).

    It is one inside the limits if one of these reaches the goal; otherwise joints may turn beyond their limits.

    Args:
        request: The problem.
        searched: Whether it is known that `Search` finds nothing inside the limits.
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


@kept_with
def _turning_freely(robot: Robot) -> Robot:
    """Return the robot with limits of a full turn to either side for all joints that turn."""
    turning = ~robot.prismatic
    return replace(
        robot,
        lower=np.where(turning, -TAU, robot.lower),
        upper=np.where(turning, TAU, robot.upper),
    )


def aims_of(request: IkRequest) -> Matrix:
    """Return the goal as rows, shape (k, 18), see `goal_rows`; for task-space regions those of the drawn targets."""
    if request.goal.has_regions:
        return np.vstack([goal_rows(target) for target in request.targets])
    return goal_rows(request.goal)


def numeric_ik(robot: Robot, goal: TipGoal, starts: Matrix, *, iterations: int = STEPS) -> Matrix:
    """Move configurations towards a goal, each from its own start, inside the joint limits.

    Args:
        robot: The arm.
        goal: A pose, a position with any orientation, or a set of these, whose members take turns.
        starts: Configurations to start from, shape (m, dof).
        iterations: Largest number of steps.

    Returns:
        The rows that satisfy the goal, in the order of their starts, shape (k, dof), k <= m.

    Raises:
        InputError: If the goal is a task-space region or has one, for which `rrtik_ompl.ik.numeric.projection` is.
    """
    aims = goal_rows(goal)
    if len(aims) > 1:
        aims = aims[np.arange(len(starts)) % len(aims)]
    Q, reached, _ = walk(robot, aims, starts, steps=iterations, patience=PATIENCE)
    # What has not arrived may still be within the tolerances, which are wider than where a walk ends.
    return Q[reached] if reached.any() else Q[goal.satisfied(robot, Q)]
