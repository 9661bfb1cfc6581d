"""Paths that go on getting shorter: plan again, shorten, keep the best, until the time is up or nothing is gained.

New seeds lead past obstacles on other sides, which shortening alone never does. Most of them are not worth much work:
each new path is shortened for a moment, and of a few such paths only the best one for as long as it takes.

What is made small is a cost of a path (`COSTS`), of which :func:`least_cost` says what no path of a problem costs less.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from types import MappingProxyType
from typing import TypeAlias

import numpy as np

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.choices import PathObjective
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.description.joint_weights import weights_of
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.transitions import route_length
from rrtik_ompl.ompl_bridge.attempt import ITERATION_LIMIT
from rrtik_ompl.ompl_bridge.planner_options import planner_options
from rrtik_ompl.ompl_bridge.weighted import has_weights
from rrtik_ompl.planning.attempts import Turn, walk
from rrtik_ompl.planning.outcome import Improvement, NamedPlanner, Plan, Request
from rrtik_ompl.planning.shortening import Wishes, shortened
from rrtik_ompl.world.clearance_curve import distances_at, places_along
from rrtik_ompl.world.clearances import possible_clearance
from rrtik_ompl.world.problem import Problem

LEAST_SECONDS = 1e-3  # for which another round is begun
PLANS = 4  # of which the best is shortened further, if it is worth it
BOUND_OPTION = "bound"  # of planners that can be told how long a path may be
PATIENCE = 60  # plans of which nothing is gained, after which the search has converged
GAIN = 1e-4  # of the cost, below which nothing is gained
QUICK_CHECKS = 120  # motions that are checked to see what a path is worth; some 3 ms
WORTH = 1.2  # times the cost of the best path, above which one is not shortened further
SETTLED = 1e-2  # of the cost, gained less than which a path is not shortened again
BOUND = 1.5  # times the length of the best path are further ones to stay below, before they are shortened
BOUNDED_SAMPLES = 3000  # that are drawn to find one

NEAREST = 1e-3  # [m] clearances below this cost no more
DOUBLE = 0.05  # [m] the clearance at which a piece of a path counts double

PathCost: TypeAlias = Callable[[JointPath, Problem], float]


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


def length(path: JointPath, problem: Problem) -> float:
    """Length in joint space, each joint's way multiplied by its weight [rad; m]."""
    return route_length(path.waypoints * _weights(problem))


def least_time(path: JointPath, problem: Problem) -> float:
    """Time [s] that the robot needs at least: of each motion the slowest joint at its velocity limit.

    Raises:
        InputError: If the robot has no velocity limit.
    """
    return float(_seconds(np.diff(path.waypoints, axis=0), problem.robot).sum())


def weighted_length(path: JointPath, problem: Problem) -> float:
    """Weighted length in joint space, where each piece counts ``1 + 0.05 m / clearance`` times [rad; m].

    The clearance is proven at 240 places on the path, so the true one is no smaller.
    """
    rows = path.waypoints
    motions, shares, places = places_along(problem.world.checks, rows)
    distances = distances_at(problem.world.checks, places)

    lengths = np.append(np.linalg.norm(np.diff(rows * _weights(problem), axis=0), axis=1), 0.0)
    ends = np.append(np.where(motions[1:] == motions[:-1], shares[1:], 1.0), 1.0)
    pieces = lengths[np.minimum(motions, len(lengths) - 1)] * (ends - shares)
    return float(pieces @ (1.0 + DOUBLE / np.maximum(distances, NEAREST)))


COSTS: Mapping[PathObjective, PathCost] = MappingProxyType(
    {"length": length, "time": least_time, "clearance": weighted_length}
)


def least_cost(problem: Problem, objective: PathObjective) -> float:
    """What no path costs less than: that of the straight motion to a goal in joint values; 0 for any other goal."""
    q = problem.goal.q
    if q is None:
        return 0.0
    span = q - problem.start
    if objective == "time":
        return float(_seconds(span[None], problem.robot)[0])
    return float(np.linalg.norm(span * _weights(problem)))


def _weights(problem: Problem) -> Vector | float:
    """How much each joint counts in lengths, shape (dof,); all alike where there are no weights."""
    return weights_of(problem.robot) if has_weights(problem) else 1.0


def _seconds(motions: np.ndarray, robot: Robot) -> Vector:
    """Least time of each motion, shapes (m, dof) and (m,)."""
    if not np.isfinite(robot.velocity).any():
        raise InputError(f"objective 'time': robot '{robot.name}' has no velocity limits; give them in its URDF")
    seconds: Vector = (np.abs(motions) / robot.velocity).max(axis=1, initial=0.0)
    return seconds
