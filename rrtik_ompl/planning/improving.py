"""Paths that go on getting shorter: plan again, shorten, keep the best, until the time is up or nothing is gained.

New seeds lead past obstacles on other sides, which shortening alone never does.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
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
        ``length_bound`` where the goal is in joint values: no path is shorter. Ctrl-C ends the work, not the plan.
    """
    work = _Work(problem, first, again, request, min(seconds, request.seconds - first.seconds))
    with suppress(KeyboardInterrupt):  # what was found by then is the answer
        work.run()
    bound = {"length_bound": work.bound} if work.bound > 0.0 else {}
    course = {"improving_rounds": work.rounds, "cost_over_time": tuple(work.course)}
    path = work.best.with_waypoints(work.best.waypoints) if request.proof == "off" else work.best
    statistics = MappingProxyType({**first.statistics, **bound, **course})
    return replace(first, path=path, seconds=work.clock(), statistics=statistics)


class _Work:
    """The rounds of plans and shortenings; ``best`` and ``course`` hold at any moment."""

    def __init__(
        self, problem: Problem, first: Plan, again: Callable[[Request], Plan], request: Request, seconds: float
    ) -> None:
        assert first.path is not None
        self._problem, self._first, self._again, self._request = problem, first, again, request
        self._begin, self._seconds = time.perf_counter(), seconds
        self.best, self.bound, self.rounds = first.path, _bound(problem), 0
        self._one_joint, self._proven = first.path.one_joint_at_a_time, first.path.proven
        self.course = [(first.seconds, first.path.length)]
        self._idle = 0

    def clock(self) -> float:
        """Time since the first plan was begun [s]."""
        return self._first.seconds + time.perf_counter() - self._begin

    def run(self) -> None:
        """Go on until the time is up, nothing is gained any more, or the path is as short as can be."""
        seeds = np.random.default_rng([self._request.seed, 1])
        candidate: JointPath | None = self.best
        while (left := self._left()) > LEAST_SECONDS:
            if candidate is not None:
                self._take(self._shortened(candidate, left))
            left = self._left()
            if self._idle > PATIENCE or left <= LEAST_SECONDS or self.best.length <= self.bound * (1.0 + GAIN):
                return
            self.rounds, self._idle = self.rounds + 1, self._idle + 1
            candidate = _found(self._again, replace(self._request, seconds=left, seed=int(seeds.integers(2**31))))

    def _left(self) -> float:
        return self._seconds - (time.perf_counter() - self._begin)

    def _shortened(self, path: JointPath, seconds: float) -> JointPath:
        one_joint = None if self._one_joint else False
        limits: dict[str, Any] = {"seconds": seconds, "clearance": self._request.clearance}
        return shorten(path, self._problem, one_joint=one_joint, seed=self._request.seed + self.rounds, **limits)

    def _take(self, candidate: JointPath) -> None:
        """Keep a path if it is the best: proven and of single-joint moves if the first one is."""
        moves, length = self._cost(self.best)
        if self._one_joint and not candidate.one_joint_at_a_time:
            return
        if self._cost(candidate) >= (moves, length) or (self._proven and not candidate.proven):
            return
        if self._cost(candidate) < (moves, length * (1.0 - GAIN)):
            self._idle = 0
        self.best = candidate
        self.course.append((self.clock(), candidate.length))

    def _cost(self, path: JointPath) -> tuple[int, float]:
        """What is to be small: the length, of single-joint moves their number first."""
        return (path.transitions if self._one_joint else 0), path.length


def _bound(problem: Problem) -> float:
    """What no path can be shorter than: the straight motion to a goal in joint values; 0 for any other goal."""
    goal = problem.goal
    return float(np.linalg.norm(goal.q - problem.start)) if isinstance(goal, JointGoal) else 0.0


def _found(again: Callable[[Request], Plan], request: Request) -> JointPath | None:
    try:
        return again(request).path
    except PlannerError:  # the first plan stands
        return None
