"""Paths that go on getting shorter: plan again, shorten, keep the best, until the time is up or nothing is gained.

New seeds lead past obstacles on other sides, which shortening alone never does. Most of them are not worth much work:
each new path is shortened for a moment, and of a few such paths only the best one for as long as it takes.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.choices import ImproveStrategy, PathObjective
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.ompl_bridge.attempt import ITERATION_LIMIT
from rrtik_ompl.ompl_bridge.planner_options import planner_options
from rrtik_ompl.planning.attempts import Turn, walk
from rrtik_ompl.planning.outcome import NamedPlanner, Plan, Request
from rrtik_ompl.planning.path_costs import COSTS, least_cost
from rrtik_ompl.planning.shortening import Wishes, shortened
from rrtik_ompl.planning.shortening.restarts import BOUND, BOUNDED_SAMPLES, GAIN, PATIENCE, QUICK_CHECKS, SETTLED, WORTH
from rrtik_ompl.world.kept_clearance import possible_clearance
from rrtik_ompl.world.problem import Problem

LEAST_SECONDS = 1e-3  # for which another round is begun
PLANS = 4  # of which the best is shortened further, if it is worth it
BOUND_OPTION = "bound"  # of planners that can be told how long a path may be


@dataclass(frozen=True, slots=True)
class Improvement:
    """How a path is to be improved.

    Attributes:
        seconds: How much longer it may take [s].
        objective: What is to be made small.
        strategy: Whether further plans are made, or the first path alone is shortened.
    """

    seconds: float
    objective: PathObjective = "length"
    strategy: ImproveStrategy = "restart-shorten"


def improved(problem: Problem, first: Plan, planner: NamedPlanner, request: Request, how: Improvement) -> Plan:
    """The best of many plans, each shortened.

    Args:
        problem: What was planned.
        first: A plan that found a path.
        planner: Makes the further ones.
        request: That of the first plan; the work ends when its time is up.
        how: What is to be made small, for how long, and by what.

    Returns:
        The first plan with the best path, which is proven if the first one is. Its statistics have ``cost_over_time``,
        rows of seconds since the beginning and the cost then, ``improving_rounds``, and ``length_bound`` (of other
        objectives ``cost_bound``) where the goal is in joint values: no path costs less. Ctrl-C ends the work, not the
        plan.

    Raises:
        InputError: If the objective cannot be computed for the robot.
    """
    work = _Work(problem, first, planner, request, how)
    with suppress(KeyboardInterrupt):  # what was found by then is the answer
        work.run()

    name = "length_bound" if how.objective == "length" else "cost_bound"
    bound = {name: work.bound} if work.bound > 0.0 else {}
    course = {"improving_rounds": work.rounds, "cost_over_time": tuple(work.course)}
    statistics = MappingProxyType({**first.statistics, **bound, **course})
    path = work.best.with_waypoints(work.best.waypoints) if request.proof == "off" else work.best  # without its proof
    return replace(first, path=path, seconds=work.clock(), statistics=statistics)


class _Work:
    """The rounds of plans and shortenings; ``best`` and ``course`` hold at any moment."""

    def __init__(
        self, problem: Problem, first: Plan, planner: NamedPlanner, request: Request, how: Improvement
    ) -> None:
        assert first.path is not None
        self.best = first.path
        self.bound = least_cost(problem, how.objective)
        self.rounds = 0
        self._problem = problem
        self._first = first
        self._planner = planner
        self._request = request
        self._how = how
        self._one_joint = first.path.one_joint_at_a_time
        self._bounded = BOUND_OPTION in planner_options(planner.factory) and not self._one_joint

        seconds = min(how.seconds, request.budget.seconds - first.seconds)
        self._budget = replace(request.budget, seconds=seconds).begun_now()
        self._least = self._cost(first.path)
        self.course = [(first.seconds, self._least[1])]
        self._idle = 0  # rounds in a row that gained nothing
        self._shortenings = 0

    def clock(self) -> float:
        """Time since the first plan was begun [s]."""
        return self._first.seconds + self._budget.elapsed

    def run(self) -> None:
        """Go on until the time is up, nothing is gained any more, or the path costs as little as can be."""
        seeds = np.random.default_rng([self._request.budget.seed, 1])
        paths = [self._shortened(self.best, self._quick)]
        while self._how.strategy == "restart-shorten" and self._idle < PATIENCE:
            if self._done():
                return

            self.rounds += 1
            self._idle += 1  # until `_take` sees a gain
            (turn,) = walk([self._turn(int(seeds.integers(2**31)))])
            if turn.path is not None:
                paths.append(self._shortened(turn.path, self._quick))

            if len(paths) == PLANS or self._idle >= PATIENCE:
                self._settle(min(paths, key=self._cost, default=self.best))
                paths = []
        self._settle(self.best)

    @property
    def _quick(self) -> int | None:
        """Checks by which it is seen what a path is worth; ways to shorten single-joint moves know no such limit."""
        return None if self._one_joint else QUICK_CHECKS

    def _turn(self, seed: int) -> Turn:
        """Another plan; by a planner that takes a bound, one whose path is not much longer than the best."""
        request = self._request
        if self._bounded:
            bound = BOUND * COSTS["length"](self.best, self._problem)
            limits = {BOUND_OPTION: bound, ITERATION_LIMIT: BOUNDED_SAMPLES}
            request = replace(request, restarts=0, parameters={**limits, **request.parameters})
        budget = replace(request.budget, seconds=self._budget.left, seed=seed)
        return Turn(self._problem, self._planner, request, budget)

    def _settle(self, path: JointPath) -> None:
        """Shorten a path as long as that gains something, if it is worth it."""
        if self._one_joint or self._cost(path)[1] > WORTH * self._least[1]:
            return
        before = np.inf
        while self._cost(path)[1] < before * (1.0 - SETTLED) and not self._done():
            before = self._cost(path)[1]
            path = self._shortened(path, None)

    def _done(self) -> bool:
        return self._budget.left <= LEAST_SECONDS or self._least[1] <= self.bound * (1.0 + GAIN)

    def _shortened(self, path: JointPath, checks: int | None) -> JointPath:
        """A path after some work, kept if it is the best; as it was if there is no time, or it does not move."""
        if self._budget.left <= LEAST_SECONDS or len(path.waypoints) < 2:
            return path

        self._shortenings += 1  # each has random numbers of its own
        clearance = possible_clearance(self._problem.world, self._request.clearance, path.waypoints)
        budget = Budget(self._budget.seed + self._shortenings, iterations=checks, stop=self._budget.over)
        single = self._one_joint and path.one_joint_at_a_time
        found = shortened(path, self._problem, Wishes(budget, single, clearance=clearance))

        self._take(found)
        return found

    def _take(self, candidate: JointPath) -> None:
        """Keep a path if it is the best: proven and of single-joint moves if the first one is."""
        if self._one_joint and not candidate.one_joint_at_a_time:
            return
        if self._first.proven and not candidate.proven:
            return

        cost = self._cost(candidate)
        if cost >= self._least:
            return
        if cost < (self._least[0], self._least[1] * (1.0 - GAIN)):
            self._idle = 0

        self.best = candidate
        self._least = cost
        self.course.append((self.clock(), cost[1]))

    def _cost(self, path: JointPath) -> tuple[int, float]:
        """What is to be small; of single-joint moves their number first."""
        return (path.transitions if self._one_joint else 0), COSTS[self._how.objective](path, self._problem)
