"""The loop of attempts behind `plan()`: :func:`walk` runs a planner until the second check accepts a path.

A `Turn` is one planner at one problem. Its attempts are the rows of this table; which row comes next depends on the
results of the rows before it:

| row | its motions are checked | its effort | when |
|---|---|---|---|
| quick | by kernels alone | 1 | first |
| plain | exactly; twice as densely once a path was rejected | 1, 2, 4, ... | if no strict one is due |
| strict | in steps, with room beyond the clearance | 4, 16, ... | see below |
| proving | by proofs, with that room | 2, 4, ... | after five strict ones, or without kernels |

As soon as a path is found that is valid but not proven, strict attempts get half of the effort. A plain attempt is
limited by time alone if later attempts would have the same goal configurations.

`Turn.rows` yields a row, :func:`walk` makes the attempt and hands its outcome to `Turn.take`, and only then does `rows`
resume: the state of the turn decides the next row.

A named planner has one turn. "auto" and ``improve=`` are several turns one after the other
(:mod:`rrtik_ompl.planning.portfolio`, :mod:`rrtik_ompl.planning.improving`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import Literal, NamedTuple, TypeAlias, get_args

import numpy as np

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.errors import InputError, PlannerError
from rrtik_ompl.ik.methods import load_kernels
from rrtik_ompl.kernels.proof.rows import PROOF_KERNELS
from rrtik_ompl.kernels.warming import load_together
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.search_tree import SearchTree
from rrtik_ompl.ompl_bridge.attempt import MOTIONS_PER_ITERATION, Attempt, attempt, attempt_seeds
from rrtik_ompl.ompl_bridge.planner_options import check_options
from rrtik_ompl.ompl_bridge.planner_traits import PlannerFactory, planners_with, traits_of
from rrtik_ompl.planning.goal_choice import GoalChoice
from rrtik_ompl.planning.grown import tree_of
from rrtik_ompl.planning.outcome import NamedPlanner, Plan, Request
from rrtik_ompl.planning.second_check import SecondCheck
from rrtik_ompl.world.problem import Problem, densely_checked, problem_in
from rrtik_ompl.world.proven_edges import KERNELS as EDGE_KERNELS
from rrtik_ompl.world.world import form_of

SHORTEST = 1e-3  # [s] the least time of an attempt
EFFORT_ITERATIONS = 1000  # iterations of an attempt of effort 1
SHORT_WAY_EFFORT = 16  # effort of the attempt that goes the short way round only; about 0.2 s in kernels
ANYTIME_SHARE = 0.8  # share of the time for a strict attempt of an anytime planner; a plain one can follow
ROUNDS = 24  # attempts to find a proven path after one that is only checked in steps
BRIEF_ROUNDS = 2  # attempts to find a path with the clearance after a proven one with less
IN_KERNELS = 5  # strict attempts before proving ones, for planners that run in kernels
SEPARATED = 2  # attempts with further goal configurations once no known one can be reached

Kind: TypeAlias = Literal["quick", "plain", "strict"]
KINDS: tuple[Kind, ...] = get_args(Kind)


class Row(NamedTuple):
    """One attempt: a row of the table at the head of this module.

    Attributes:
        kind: The kind of row; proving rows count as "strict" too.
        problem: The problem in the form in which the motions of this attempt are checked.
        goals: Goal configurations, shape (k, dof); none for a planner that finds them itself.
        budget: Time limit, limit of iterations and seed of the attempt.
        checked: Whether start and goals are already known to be free.
    """

    kind: Kind
    problem: Problem
    goals: Matrix
    budget: Budget
    checked: bool = False


def run_planner(problem: Problem, planner: NamedPlanner, request: Request, budget: Budget | None = None) -> Plan:
    """Let one planner search for a path that the second check accepts.

    Args:
        problem: The problem to solve.
        planner: The planner that solves it.
        request: What is asked for.
        budget: Budget of the search in place of the request's.

    Raises:
        InputError: If the planner does not take a parameter.
        PlannerError: If the planner broke.
    """
    (turn,) = walk([Turn(problem, planner, request, budget)])
    if turn.error is not None:
        raise turn.error
    return turn.plan()


def walk(turns: Iterable[Turn]) -> Iterator[Turn]:
    """Make the attempts of each turn, and yield each turn after its last attempt.

    A turn whose planner breaks ends with that attempt and keeps the error in `Turn.error`.
    """
    for turn in turns:
        try:
            for row in turn.rows():
                outcome = attempt(
                    row.problem,
                    turn.planner.factory,
                    row.goals,
                    row.budget,
                    parameters=turn.parameters,
                    checked=row.checked,
                    keep_graph=turn.keeps_tree,
                )
                turn.take(row, outcome)
        except PlannerError as error:
            turn.error = error
        turn.finish()
        yield turn


class Turn:
    """One planner at one problem: it decides on the attempts and collects their results.

    Attributes:
        planner: The planner and its name.
        parameters: Options of the planner.
        budget: Budget of all attempts together; its time begins with the first row, after all kernels are loaded.
        path: The accepted path, or None.
        reason: One line that says why there is no path; "" if there is one.
        seconds: Wall time of all attempts together [s].
        totals: Counts, added up over all attempts.
        error: The error that broke the planner, or None.
        goal_fault: One line that says why no configuration is at the goal, if that is why there is no path; else "".
        out_of_time: Whether the time was up before there was a path.
        keeps_tree: Whether the tree of the attempt that finds the path is kept, or else that of the last one.

    Args:
        problem: The problem to solve.
        planner: The planner that solves it.
        request: Options, proofs, clearance and restarts; its budget holds unless ``budget`` is given.
        budget: Budget of this turn in place of the request's.
    """

    def __init__(self, problem: Problem, planner: NamedPlanner, request: Request, budget: Budget | None = None) -> None:
        self.planner = planner
        self.budget = request.budget if budget is None else budget
        self.path: JointPath | None = None
        self.reason = ""
        self.seconds = 0.0
        self.totals: dict[str, int | float] = {"attempts": 0, "rejected": 0}
        self.error: PlannerError | None = None
        self.goal_fault = ""
        self.out_of_time = False
        self.keeps_tree = request.tree
        self._tree: SearchTree | None = None

        traits = traits_of(planner.factory)
        seeds = attempt_seeds(self.budget.seed, request.restarts)
        parameters = dict(request.parameters)
        if traits.leaves_room and request.clearance is not None:
            parameters = {"clearance": request.clearance} | parameters
        self.parameters: Mapping[str, object] = parameters
        self._problem = problem
        self._request = request
        self._traits = traits
        self._seeds = seeds
        self._goal_choice = GoalChoice(
            problem,
            traits,
            request,
            seeds,
            # Reads the attribute at each call, because `rows` and `take` replace the budget.
            seconds_left=lambda: self.budget.left,
        )
        self._check = SecondCheck(problem, planner, request, seed=seeds[0])

        # Results of the attempts so far.
        self._num_attempts: dict[Kind, int] = dict.fromkeys(KINDS, 0)
        self._motions_spent: dict[Kind, int] = dict.fromkeys(KINDS, 0)  # checked motions, see `take`
        self._strict_problems: dict[bool, Problem] = {}  # keyed by ``proving``

    def rows(self) -> Iterator[Row]:
        """Yield the attempts until there is a path, the time is up, or no better result can be expected.

        The caller must hand the outcome of each row to `take` before it asks for the next row.
        """
        if self._problem.constraints:
            _refuse_if_it_breaks_constraints(self.planner)
        load_kernels_for(self._problem, self.planner.factory)
        self.budget = self.budget.begun_now()
        if self._decide_without_attempts():
            return

        for number in range(len(self._seeds)):
            if self._is_over():
                return

            self.totals["attempts"] += 1
            goals = self._goal_choice.of(number)
            if len(goals) == 0 and not self._goal_choice.planner_finds_goals:
                if self._goal_choice.exhausted:
                    return
                continue  # a fruitless round of inverse kinematics counts too

            if number == 0:
                yield from self._quick(goals)
                if self._is_over():
                    return
            yield self._strict(number, goals) or self._plain(number, goals)

    def take(self, row: Row, outcome: Attempt) -> None:
        """Add up the counts of an attempt, and keep its path if the second check accepts it.

        Changes `totals` and `path`. Time that was spent on counting vertices and edges does not count against `budget`.
        """
        if outcome.counting:
            self.budget = self.budget.put_off(outcome.counting)
        for key, value in outcome.statistics.items():
            describes_path = key in self._traits.path_statistics
            self.totals[key] = value if describes_path else self.totals.get(key, 0) + value

        if outcome.graph is not None:
            self._tree = tree_of(self.planner.name, outcome.graph, one_joint=self._traits.one_joint)

        self._num_attempts[row.kind] += 1
        self._motions_spent[row.kind] += int(outcome.statistics.get("checked_motions", 0))
        # Each attempt also has a fixed cost beyond the motions that it checks.
        self._motions_spent[row.kind] += EFFORT_ITERATIONS * MOTIONS_PER_ITERATION

        self.path = self._check.accept(outcome)  # if it is None, another attempt follows
        self.totals["rejected"] = self._check.num_rejected

    def finish(self) -> None:
        """Set the time taken and, if no path was accepted, set the best path so far or the reason why there is none."""
        self.seconds = self.budget.elapsed
        if self.error is not None or self.path is not None:
            return

        if not self.reason:
            self.path = self._check.best
            self.goal_fault = "" if self._goal_choice.planner_finds_goals else self._goal_choice.reason
            self.reason = self.goal_fault or self._check.reason
        if self.path is not None or self.goal_fault:
            return

        self.out_of_time = self.seconds >= self.budget.seconds
        if self.out_of_time:
            last = self.reason or "out of time"
            self.reason = no_path_within(self._request.budget.seconds, self.totals["attempts"], f"the last one: {last}")

    def plan(self) -> Plan:
        """Return the result of the turn as a `Plan`."""
        return Plan(
            self.path is not None,
            self.path,
            self.reason,
            self.seconds,
            self.planner.name,
            self.budget.seed,
            MappingProxyType(self.totals),
            problem=self._problem,
            tree=self._tree,
        )

    def _decide_without_attempts(self) -> bool:
        """Set the path where the start is at the goal, or the reason where no path can be accepted.

        Returns:
            Whether either was the case, so that there is nothing to attempt.
        """
        at_goal = _starts_at_goal(self._problem)  # some planners would find a detour
        if at_goal:  # no attempt will check the options
            check_options(self.planner.factory, self.planner.name, self._request.parameters)

        self.reason = self._check.why_impossible()
        if at_goal and not self.reason:
            self.path = self._check.resting_path()
        return at_goal or self.reason != ""

    def _is_over(self) -> bool:
        """Check whether there is a path, no time or iterations are left, or no better result can be expected."""
        if self.path is not None or self._best_will_do() or self._goal_is_unreachable():
            return True
        iterations_left = self._iterations_left()
        no_iterations_left = iterations_left is not None and iterations_left <= 0
        return self.budget.over() or no_iterations_left

    def _best_will_do(self) -> bool:
        """Check whether to settle for the best path although it is not proven with the clearance wanted.

        That is so if its ends cannot be proven free, or if many further attempts have found no better path.
        """
        best = self._check.best
        if best is None:
            return False
        max_rounds = BRIEF_ROUNDS if best.proven else ROUNDS
        return self._check.cannot_improve or self._check.num_unproven > max_rounds

    def _goal_is_unreachable(self) -> bool:
        """Check whether path constraints seem to separate start and goal, as the planner has reported."""
        times_seen = self.totals.get("separated", 0)
        return times_seen > 0 and (self._goal_choice.exhausted or times_seen > SEPARATED)

    def _quick(self, goals: Matrix) -> list[Row]:
        """Return a brief attempt with the kernels alone, or none where they cannot prove the start and a goal free.

        Returns:
            A list of one row, or an empty list.
        """
        if not self._traits.supports_iteration_limit or self._problem.world.accuracy != "exact":
            return []
        if self._goal_choice.planner_finds_goals and not self._traits.kernels:
            return []

        conservative = problem_in(self._problem, form_of(self._problem.world, accuracy="conservative"))
        is_free = conservative.world.checks.free(np.concatenate([conservative.start[None], goals]))
        start_is_free = is_free[0]
        goals = goals[is_free[1:]]
        no_goal_is_free = len(goals) == 0 and not self._goal_choice.planner_finds_goals
        if not start_is_free or no_goal_is_free:
            return []
        return [Row("quick", conservative, goals, self._budget(0, effort=1), checked=True)]

    def _strict(self, number: int, goals: Matrix) -> Row | None:
        """Return an attempt with room beyond the clearance; None if none is due or no goal configuration has that room.

        Args:
            number: Number of the attempt, from 0.
            goals: Its goal configurations, shape (k, dof).
        """
        if not self._strict_is_due(number):
            return None

        earlier = self._num_attempts["strict"]
        proving = not self._traits.kernels or earlier >= IN_KERNELS
        if proving not in self._strict_problems:
            self._strict_problems[proving] = self._check.strict_problem(proving=proving)
        strict_problem = self._strict_problems[proving]
        roomy = goals[strict_problem.world.checks.free(goals)]
        if len(roomy) == 0 and not self._goal_choice.planner_finds_goals:
            return None

        growth = 2 if proving else 4
        effort = growth ** (earlier + 1) if self._traits.supports_iteration_limit else None
        share = ANYTIME_SHARE if self._traits.anytime else self._share(number)
        return Row("strict", strict_problem, roomy, self._budget(number, effort, share))

    def _strict_is_due(self, number: int) -> bool:
        """Check whether the next attempt is a strict one.

        After the first path that is valid but not proven, strict attempts get half of the effort, counted in checked
        motions.
        """
        if not self._check.wants_proofs or self._traits.leaves_room:
            return False
        if self._traits.anytime and number == 0 and len(self._seeds) > 1:
            # An optimal path touches the obstacles that it goes round, so it could not be proven.
            return True
        if self._check.num_unproven == 0:
            return False
        if self._traits.anytime or self._num_attempts["strict"] == 0:
            return True
        return self._motions_spent["strict"] < self._motions_spent["plain"]

    def _plain(self, number: int, goals: Matrix) -> Row:
        """Return an attempt whose motions are checked exactly."""
        dense = self._traits.anytime or self._check.num_rejected
        problem = densely_checked(self._problem) if dense else self._problem
        # The problem has checked its start, and the search for goals the goal configurations.
        checked = problem.world.accuracy == "exact"
        budget = self._budget(number, self._plain_effort(number), self._share(number))
        return Row("plain", problem, goals, budget, checked)

    def _plain_effort(self, number: int) -> int | None:
        """Return the effort of a plain attempt in units of `EFFORT_ITERATIONS`; None if only time limits it."""
        if not self._traits.supports_iteration_limit:
            return None
        if self._goal_choice.is_short_way(number):
            return SHORT_WAY_EFFORT
        return 2**number if self._goal_choice.changes_after(number) else None

    def _share(self, number: int) -> float:
        """Return the share of the remaining time and iterations for an attempt.

        An attempt that goes the short way round gets half, so that the long way can be tried after it.
        """
        return 0.5 if self._goal_choice.is_short_way(number) else 1.0

    def _budget(self, number: int, effort: int | None, share: float = 1.0) -> Budget:
        """Return the budget of one attempt: a share of the time left, and iterations by its effort.

        Args:
            number: Number of the attempt, which selects its seed.
            effort: In units of `EFFORT_ITERATIONS`, as far as any are left; None sets no limit but that of all attempts
                together.
            share: Share of the time left.
        """
        iterations_left = self._iterations_left()
        if iterations_left is not None:
            affordable_effort = max(math.ceil(self._share(number) * iterations_left / EFFORT_ITERATIONS), 1)
            effort = affordable_effort if effort is None else min(effort, affordable_effort)
        iterations = None if effort is None else effort * EFFORT_ITERATIONS
        seconds = max(share * self.budget.left, SHORTEST)
        return Budget(self._seeds[number], seconds, iterations, self.budget.stop)

    def _iterations_left(self) -> int | None:
        """Return how many iterations all attempts together have left; None if there is no limit.

        A planner that does not count iterations has no limit either.
        """
        if self.budget.iterations is None or not self._traits.supports_iteration_limit:
            return None
        return self.budget.iterations - int(self.totals.get("iterations", 0))


def no_path_within(seconds: float, attempts: float, more: str) -> str:
    """Return a line that says how many attempts were not enough in a time [s], and more about them."""
    return f"no path within {seconds:g} s of wall time ({attempts:.0f} attempt{'s' * (attempts != 1)}; {more})"


def load_kernels_for(problem: Problem, factory: PlannerFactory) -> None:
    """Load the kernels that the search will use, so that compiling them does not count as planning time."""
    if problem.goal.q is None:
        load_kernels(problem.robot)
    if problem.world.fast is not None or problem.constraints:
        own = traits_of(factory).kernels or (EDGE_KERNELS,)
        load_together((*own, PROOF_KERNELS))


def _refuse_if_it_breaks_constraints(planner: NamedPlanner) -> None:
    """Raise an InputError if the paths of a planner may leave the regions of the problem's path constraints."""
    traits = traits_of(planner.factory)
    if traits.keeps_constraints:
        return
    able = ", ".join(planners_with(lambda traits: traits.keeps_constraints)) or "none is installed"
    why = "moves one joint at a time, which leaves their regions" if traits.one_joint else "does not keep them"
    raise InputError(f"planner {planner.name}: the problem has path constraints, and it {why}; use {able}")


def _starts_at_goal(problem: Problem) -> bool:
    """Check whether the start is at the goal; goal joint values have to be equal to the last bit."""
    if problem.goal.q is not None:
        return bool((problem.start == problem.goal.q).all())
    return problem.reached(problem.start)
