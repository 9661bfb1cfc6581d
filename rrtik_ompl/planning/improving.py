"""Paths that go on getting shorter: plan again, shorten, keep the best, until the time is up or nothing is gained.

New seeds lead past obstacles on other sides, which shortening alone never does.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np

from rrtik_ompl.errors import PlannerError
from rrtik_ompl.goal import JointGoal
from rrtik_ompl.path import JointPath
from rrtik_ompl.planning.outcome import Plan, Request
from rrtik_ompl.problem import Problem
from rrtik_ompl.shortening import shorten

PATIENCE = 60  # rounds in which nothing is gained, after which the search has converged
GAIN = 1e-4  # of the length, below which nothing is gained
LEAST_SECONDS = 1e-3  # for which another round is begun


def improved(problem: Problem, first: Plan, again: Callable[[Request], Plan], request: Request, seconds: float) -> Plan:
    """The best of many plans, each shortened.

    Args:
        problem: What was planned.
        first: A plan that found a path.
        again: Plans with another request.
        request: That of the first plan.
        seconds: How much longer it may take [s]; never beyond ``request.seconds`` in all.

    Returns:
        The first plan with the shortest path, which is proven if the first one is. Its statistics have
        ``cost_over_time``, rows of seconds since the beginning and the length then [rad; m], ``improving_rounds``, and
        ``length_bound`` where the goal is in joint values: no path is shorter.
    """
    assert first.path is not None
    begin = time.perf_counter()
    end = min(seconds, request.seconds - first.seconds)
    one_joint = None if first.path.one_joint_at_a_time else False
    best, bound = first.path, _bound(problem)
    course, rounds, idle = [(first.seconds, best.length)], 0, 0
    seeds = np.random.default_rng([request.seed, 1])
    candidate: JointPath | None = best
    while True:
        left = end - (time.perf_counter() - begin)
        if left < LEAST_SECONDS:
            break
        if candidate is not None:
            limits: dict[str, Any] = {"seconds": left, "clearance": request.clearance}
            candidate = shorten(candidate, problem, one_joint=one_joint, seed=request.seed + rounds, **limits)
            if _better(candidate, best, first.path):
                fewer = first.path.one_joint_at_a_time and candidate.transitions < best.transitions
                idle = 0 if fewer or candidate.length < best.length * (1.0 - GAIN) else idle
                best = candidate
                course.append((first.seconds + time.perf_counter() - begin, best.length))
        if idle > PATIENCE or best.length <= bound * (1.0 + GAIN):
            break
        left = end - (time.perf_counter() - begin)
        if left < LEAST_SECONDS:
            break
        rounds, idle = rounds + 1, idle + 1
        candidate = _found(again, replace(request, seconds=left, seed=int(seeds.integers(2**31))))
    spent = first.seconds + time.perf_counter() - begin
    known = {"length_bound": bound} if bound > 0.0 else {}
    statistics = {**first.statistics, **known, "improving_rounds": rounds, "cost_over_time": tuple(course)}
    path = best.with_waypoints(best.waypoints) if request.proof == "off" else best
    return replace(first, path=path, seconds=spent, statistics=MappingProxyType(statistics))


def _bound(problem: Problem) -> float:
    """What no path can be shorter than: the straight motion to a goal in joint values; 0 for any other goal."""
    goal = problem.goal
    return float(np.linalg.norm(goal.q - problem.start)) if isinstance(goal, JointGoal) else 0.0


def _better(candidate: JointPath, best: JointPath, first: JointPath) -> bool:
    """Whether a path is shorter, and proven if the first one is; of single-joint moves fewer count first."""
    if first.one_joint_at_a_time:
        if not candidate.one_joint_at_a_time or candidate.transitions > best.transitions:
            return False
        if candidate.transitions == best.transitions and candidate.length >= best.length:
            return False
    elif candidate.length >= best.length:
        return False
    proven = first.proof is not None and first.proof.proven
    return not proven or (candidate.proof is not None and candidate.proof.proven)


def _found(again: Callable[[Request], Plan], request: Request) -> JointPath | None:
    try:
        return again(request).path
    except PlannerError:  # the first plan stands
        return None
