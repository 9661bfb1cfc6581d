"""Numeric inverse kinematics of any arm: Levenberg-Marquardt from a posture and then from seeds near the goal."""

from __future__ import annotations

import time

import numpy as np

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.ik.goal_rows import goal_rows
from rrtik_ompl.ik.method_interface import IkRequest, IkResponse, mid_range_configuration
from rrtik_ompl.ik.numeric.descent import PATIENCE, STEPS, Search, SearchOfOne, walk
from rrtik_ompl.ik.numeric.restarts import MAX_ROUNDS, STARTS, aims_of, nearest_posture
from rrtik_ompl.ik.serial_chain import seeded_limb_of
from rrtik_ompl.kernels.ik.ik_layout import KERNELS
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.model.goal import TipGoal
from rrtik_ompl.model.robot import Robot

AT_ONCE = 32  # members of a goal, between two readings of the clock, when others have their turn


def numeric_ik(robot: Robot, goal: TipGoal, starts: Matrix, *, iterations: int = STEPS) -> Matrix:
    """Move configurations towards a goal, each from its own start, inside the joint limits.

    Args:
        robot: The arm.
        goal: A pose, a position with any orientation, or a region of these; its members take turns.
        starts: Shape (m, dof).
        iterations: Steps at most.

    Returns:
        The rows that satisfy the goal, in the order of their starts, shape (k, dof), k <= m.

    Raises:
        InputError: If the goal is a task-space region or has one: `rrtik_ompl.ik.numeric.projection` is for these.
    """
    aims = goal_rows(goal)
    if len(aims) > 1:
        aims = aims[np.arange(len(starts)) % len(aims)]
    Q, _, _ = walk(robot, aims, starts, steps=iterations, patience=PATIENCE)
    return Q[goal.satisfied(robot, Q)]


def numeric(request: IkRequest) -> IkResponse:
    """The method of `solve_ik`: solutions of many members of the goal side by side until one will do."""
    if request.all:
        return _many(request)
    aims = aims_of(request)
    kernels = library(KERNELS)
    limb = seeded_limb_of(request.robot)
    if len(aims) == 1 and kernels is not None and limb is not None:
        near = request.near
        if near is not mid_range_configuration(request.robot):  # the default, which needs no clamping
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
        timed_out = time.monotonic() > request.deadline
        if timed_out or request.accept(found[-1]).any():
            break
        waiting = np.concatenate([waiting, going])

    return _answered(request, np.concatenate(found), search.steps, timed_out)


def _alone(request: IkRequest, search: SearchOfOne) -> IkResponse:
    """The same for a goal of one member."""
    found = [search.advance()]
    timed_out = time.monotonic() > request.deadline
    while not timed_out and len(found[-1]) and not request.accept(found[-1])[0]:
        found.append(search.advance())
        timed_out = time.monotonic() > request.deadline
    search.close()
    return _answered(request, found[0] if len(found) == 1 else np.concatenate(found), search.steps, timed_out)


def _many(request: IkRequest) -> IkResponse:
    """Solutions from many random starts, as different as they come."""
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
        timed_out = time.monotonic() > request.deadline
        if timed_out:
            break

    return _answered(request, np.vstack(found), steps, timed_out)


def _answered(request: IkRequest, found: Matrix, steps: int, timed_out: bool) -> IkResponse:
    """The response with what was found, shape (k, dof), or else with the posture that comes nearest."""
    if len(found):
        return IkResponse(found, request.near, steps, timed_out)
    searched = not request.all and not timed_out
    return IkResponse(found, nearest_posture(request, searched=searched), steps, timed_out)
