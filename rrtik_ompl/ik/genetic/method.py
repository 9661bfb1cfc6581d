"""The genetic algorithm as a method of `solve_ik`: one point, in the whole range, near a posture."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.ik.genetic.options import REFINED
from rrtik_ompl.ik.genetic.search import follow_targets
from rrtik_ompl.ik.method_interface import IkRequest, IkResponse
from rrtik_ompl.ik.numeric.restarts import nearest_posture
from rrtik_ompl.model.robot import inside_limits

MAX_ROUNDS = 64  # populations, after which it gives up
GENERATIONS = 40  # of each; most that reach the goal do so in ten


def genetic(request: IkRequest) -> IkResponse:
    """One population after another, each until it reaches a target or stalls; the targets take turns."""
    options = replace(REFINED, generations=GENERATIONS, stall=None, start_over=None)
    found = np.zeros((0, request.robot.dof))
    generations = 0

    for number in range(MAX_ROUNDS):
        target = request.targets[number % len(request.targets)]
        run = follow_targets(
            request.robot,
            (target,),
            options,
            request.rng,
            accept=request.accept,
            near=request.near,
            deadline=request.deadline,
        )
        found = np.vstack([found, run.q])
        generations += run.generations
        if len(found) and not request.all:
            return IkResponse(found, request.near, generations)
        if run.timed_out or time.monotonic() > request.deadline:
            return _given_up(request, found, generations, timed_out=True)

    return _given_up(request, found, generations, timed_out=False)


def _given_up(request: IkRequest, found: Matrix, generations: int, *, timed_out: bool) -> IkResponse:
    """What there is, and a posture for the reason: if it is at the goal and will not do, that is the reason."""
    robot = request.robot
    nearest = nearest_posture(request)
    row = nearest[None]
    at_goal = row[request.goal.satisfied(robot, row) & inside_limits(robot, row)]
    return IkResponse(np.vstack([found, at_goal[~request.accept(at_goal)]]), nearest, generations, timed_out)
