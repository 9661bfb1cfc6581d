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

        # what was asked
        self._problem = problem
        self._first = first
        self._planner = planner
        self._request = request
        self._how = how
        self._one_joint = first.path.one_joint_at_a_time
        self._takes_bound = BOUND_OPTION in planner_options(planner.factory) and not self._one_joint

        seconds = min(how.seconds, request.budget.seconds - first.seconds)
        self._budget = replace(request.budget, seconds=seconds).begun_now()

        # what has come of it so far
        self.best = first.path
        self.bound = least_cost(problem, how.objective)
        self.rounds = 0
        self._best_cost = self._cost(first.path)
        self.course = [(first.seconds, self._best_cost[1])]  # seconds and cost
        self._rounds_without_gain = 0  # in a row
        self._shortenings = 0

    def clock(self) -> float:
        """Time since the first plan was begun [s]."""
        return self._first.seconds + self._budget.elapsed

    def run(self) -> None:
        """Go on until the time is up, nothing is gained any more, or the path costs as little as can be."""
        seeds = np.random.default_rng([self._request.budget.seed, 1])
        paths = [self._shortened(self.best, self._quick_checks)]
        while self._how.strategy == "restart-shorten" and self._rounds_without_gain < PATIENCE:
            if self._is_done():
                return

            self.rounds += 1
            self._rounds_without_gain += 1  # `_keep_if_best` sets it back where it sees a gain
            (turn,) = walk([self._turn(int(seeds.integers(2**31)))])
            if turn.path is not None:
                paths.append(self._shortened(turn.path, self._quick_checks))

            if len(paths) == PLANS or self._rounds_without_gain >= PATIENCE:
                self._shorten_further(min(paths, key=self._cost, default=self.best))
                paths = []
        self._shorten_further(self.best)

    @property
    def _quick_checks(self) -> int | None:
        """Checks by which it is seen what a path is worth; ways to shorten single-joint moves know no such limit."""
        return None if self._one_joint else QUICK_CHECKS

    def _turn(self, seed: int) -> Turn:
        """Another plan; by a planner that takes a bound, one whose path is not much longer than the best."""
        request = self._request
        if self._takes_bound:
            bound = BOUND * COSTS["length"](self.best, self._problem)
            limits = {BOUND_OPTION: bound, ITERATION_LIMIT: BOUNDED_SAMPLES}
            request = replace(request, restarts=0, parameters={**limits, **request.parameters})
        budget = replace(request.budget, seconds=self._budget.left, seed=seed)
        return Turn(self._problem, self._planner, request, budget)

    def _shorten_further(self, path: JointPath) -> None:
        """Shorten a path as long as that gains something, if it is worth it."""
        if self._one_joint or self._cost(path)[1] > WORTH * self._best_cost[1]:
            return
        before = np.inf
        while self._cost(path)[1] < before * (1.0 - SETTLED) and not self._is_done():
            before = self._cost(path)[1]
            path = self._shortened(path, None)

    def _is_done(self) -> bool:
        """Whether the time is up, or the best path costs as little as can be."""
        is_optimal = self._best_cost[1] <= self.bound * (1.0 + GAIN)
        return self._budget.left <= LEAST_SECONDS or is_optimal

    def _shortened(self, path: JointPath, checks: int | None) -> JointPath:
        """A path after some work, kept if it is the best; as it was if there is no time, or it does not move."""
        if self._budget.left <= LEAST_SECONDS or len(path.waypoints) < 2:
            return path

        self._shortenings += 1  # each has random numbers of its own
        clearance = possible_clearance(self._problem.world, self._request.clearance, path.waypoints)
        budget = Budget(self._budget.seed + self._shortenings, iterations=checks, stop=self._budget.over)
        single = self._one_joint and path.one_joint_at_a_time
        found = shortened(path, self._problem, Wishes(budget, single, clearance=clearance))

        self._keep_if_best(found)
        return found

    def _keep_if_best(self, candidate: JointPath) -> None:
        """Keep a path if it is the best: proven and of single-joint moves if the first one is."""
        if self._one_joint and not candidate.one_joint_at_a_time:
            return
        if self._first.proven and not candidate.proven:
            return

        cost = self._cost(candidate)
        if cost >= self._best_cost:
            return
        if cost < (self._best_cost[0], self._best_cost[1] * (1.0 - GAIN)):
            self._rounds_without_gain = 0

        self.best = candidate
        self._best_cost = cost
        self.course.append((self.clock(), cost[1]))

    def _cost(self, path: JointPath) -> tuple[int, float]:
        """What is to be small: the number of moves, 0 unless they are single-joint moves, then the objective."""
        num_moves = path.transitions if self._one_joint else 0
        return num_moves, COSTS[self._how.objective](path, self._problem)
