"""Attempt after attempt of one planner at one problem, until the second check accepts a path."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.choices import ProofMode
from rrtik_ompl.ik.goal_configurations import MAX_ROUNDS, GoalSearch
from rrtik_ompl.model.goal import TipGoal, has_continuous
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.ompl_bridge.attempt import EFFORT_ITERATIONS, EFFORT_MOTIONS, Attempt, attempt
from rrtik_ompl.ompl_bridge.planner_traits import PlannerFactory, traits_of
from rrtik_ompl.planning.second_check import SecondCheck
from rrtik_ompl.world.problem import Problem, densely_checked

SHORTEST = 1e-3  # [s] that an attempt gets at least
ROUNDS = 24  # attempts to find a proven path, once there is one that is checked in steps
BRIEF_ROUNDS = 2  # attempts to find one that keeps the clearance, once there is a proven one that keeps less
IN_KERNELS = 5  # of them, without proofs while searching, for planners that run in kernels
MOVE_RULES = ("frozen_joints", "last_joints", "smallest_move")  # options of planners, see MoveRules
SEPARATED = 2  # attempts with further goal configurations, once none that is known can be reached
SHORT_WAY_EFFORT = 16  # for the short way round alone, before the long way is tried; some 0.2 s of kernels
ANYTIME_SHARE = 0.8  # of the time, for the first attempt of an anytime planner, which keeps a clearance


class Search:
    """Attempt after attempt, one per seed, until the second check accepts a path.

    Attributes:
        totals: The counts of all attempts.
        reason: Why there is no path, in a line; "" if there is one.
        counting: Time that was no planning [s]; the deadline was put off by it.

    Args:
        problem: What to solve.
        factory: Makes the planner.
        name: Of the planner, for messages.
        deadline: When to end [s, of ``time.perf_counter``].
        seeds: One for each attempt.
        parameters: Options of the planner.
        proof: See :func:`rrtik_ompl.planning.plan.plan`.
        clearance: Likewise.
        iterations: Of all attempts together, about; of planners that support a limit of iterations.
    """

    def __init__(
        self,
        problem: Problem,
        factory: PlannerFactory,
        name: str,
        deadline: float,
        seeds: list[int],
        parameters: Mapping[str, Any],
        proof: ProofMode,
        clearance: float | None,
        *,
        iterations: int | None = None,
    ) -> None:
        self.totals: dict[str, int | float] = {"attempts": 0, "rejected": 0}
        self.reason, self.counting = "", 0.0
        self._problem, self._factory, self._clearance = problem, factory, clearance
        self._deadline, self._seeds = deadline, seeds
        self._goals = GoalSearch(problem, seeds[0], seconds_left=self._left)
        self._traits, joints = traits_of(factory), problem.goal.q is not None
        self._iterations = iterations if self._traits.supports_iteration_limit else None
        wanted = {"clearance": clearance} if self._traits.leaves_room and clearance is not None else {}
        self._parameters = {**wanted, **parameters}
        self._aimless = self._traits.finds_goals and isinstance(problem.goal, TipGoal)
        self._long_ways = joints and has_continuous(problem.robot) and len(seeds) > 1
        ruled = any(option in parameters for option in MOVE_RULES)
        self._check = SecondCheck(problem, name, proof, clearance, self._traits, ruled=ruled)
        self._strict: dict[bool, Problem] = {}  # by whether motions have to be proven
        self._strict_attempts = 0
        self._spent = {True: 0, False: 0}  # by whether room was left: checked motions, and what an attempt costs beside

    def run(self) -> JointPath | None:
        """The path, or None and a reason."""
        self.reason = self._check.impossible()
        if self.reason:
            return None
        for number in range(len(self._seeds)):
            if self._done():
                break
            self.totals["attempts"] += 1
            aims = self._aims(number)
            if len(aims) == 0 and not self._aimless:
                if self._goals.exhausted:
                    break
                continue
            path = self._quick_path(aims) if number == 0 else None
            if path is None and not self._done():
                path = self._path(number, aims)
            if path is not None:
                return path
        self.reason = "" if self._check.best is not None else self._check.reason or self._goals.reason
        return self._check.best

    def still(self) -> JointPath | None:
        """The path that stays at the start, or None and a reason."""
        self.reason = self._check.impossible()
        path = JointPath.of(self._problem.robot, self._problem.start[None])
        return None if self.reason else self._check.still(path) if self._check.proves else path

    def _done(self) -> bool:
        """Whether there is no time left, or nothing better to be expected."""
        best = self._check.best
        enough = best is not None and self._check.open > (BRIEF_ROUNDS if best.proven else ROUNDS)
        return self._left() <= 0.0 or self._used_up() or self._check.settled or enough or self._separated()

    def _used_up(self) -> bool:
        """Whether all iterations are used."""
        return self._iterations is not None and self.totals.get("iterations", 0) >= self._iterations

    def _separated(self) -> bool:
        """Whether path constraints keep start and goal apart, as far as the planner sees."""
        seen = self.totals.get("separated", 0)
        return seen > 0 and (self._goals.exhausted or seen > SEPARATED)

    def _left(self) -> float:
        return self._deadline - time.perf_counter()

    def _short_way(self, number: int) -> bool:
        """Whether an attempt goes the short way round alone."""
        return self._long_ways and number == 0

    def _aims(self, number: int) -> Matrix:
        """What an attempt aims at: all that is known, the newest first, for some planners take the first alone."""
        if self._aimless:
            return np.zeros((0, self._problem.robot.dof))
        known = len(self._goals.rows)
        newer = number > 0 and self._goals.more()
        rows, first = self._roomy_goals(), known if newer else number
        return rows[:1] if self._short_way(number) else np.roll(rows, -first, axis=0) if first else rows

    def _roomy_goals(self) -> Matrix:
        """All that is known to be at a goal of the tip: those that keep the clearance asked for, if there are any."""
        rows, wanted = self._goals.first(), self._clearance
        if wanted is None or self._problem.goal.q is not None:
            return rows
        for _ in range(MAX_ROUNDS):
            kept = self._problem.world.prover.proven(rows, rows, clearance=wanted)
            if kept.any():
                return rows[kept]
            if not self._goals.more():
                break
            rows = self._goals.rows
        return rows

    def _quick_path(self, aims: Matrix) -> JointPath | None:
        """Of a brief attempt on what the kernels can prove; None where it finds nothing or cannot prove an end."""
        if not self._traits.supports_iteration_limit or self._problem.world.accuracy != "exact":
            return None
        if self._aimless and not self._traits.kernels:
            return None
        proven = self._problem.with_accuracy("conservative")
        free = proven.world.checks.free(np.concatenate([proven.start[None], aims]))
        aims = aims[free[1:]]
        if not free[0] or (len(aims) == 0 and not self._aimless):
            return None
        return self._accepted(self._attempt(proven, 0, aims, self._left(), effort=1, checked=True))

    def _path(self, number: int, aims: Matrix) -> JointPath | None:
        """Of an attempt with exact checks, with room to spare as soon as a path was not proven."""
        if self._leaves_room(number):
            proving = not self._traits.kernels or self._strict_attempts >= IN_KERNELS
            strict = self._strict_problem(proving)
            roomy = aims[strict.world.checks.free(aims)]
            if len(roomy) or self._aimless:
                return self._strict_path(strict, number, roomy, base=2 if proving else 4)
        effort = self._effort(number)
        dense = self._traits.anytime or self._check.rejected
        asked = densely_checked(self._problem) if dense else self._problem
        checked = asked.world.accuracy == "exact"  # by the problem and by the search for goals
        seconds = self._share(number) * self._left()
        outcome = self._attempt(asked, number, aims, seconds, effort, checked=checked)
        self._count(outcome, room=False)
        return self._accepted(outcome)

    def _effort(self, number: int) -> int | None:
        """Of an attempt after which others aim elsewhere, of planners that have it; None for all there is time for."""
        if not self._traits.supports_iteration_limit:
            return None
        if self._short_way(number):
            return SHORT_WAY_EFFORT
        return 2**number if self._others(number) else None

    def _strict_problem(self, proving: bool) -> Problem:
        """See :meth:`SecondCheck.strict`; made once."""
        if proving not in self._strict:
            self._strict[proving] = self._check.strict(proving=proving)
        return self._strict[proving]

    def _leaves_room(self, number: int) -> bool:
        """Whether an attempt keeps more than the clearance: half of the effort, from the first unproven path on.

        The first one of an anytime planner does: an optimal path touches what it goes round.
        """
        first = self._traits.anytime and number == 0 and len(self._seeds) > 1
        less = self._strict_attempts == 0 or self._spent[True] < self._spent[False]
        turn = self._check.open > 0 and (self._traits.anytime or less)
        return self._check.proves and not self._traits.leaves_room and (first or turn)

    def _strict_path(self, strict: Problem, number: int, aims: Matrix, base: int) -> JointPath | None:
        """Of an attempt with room to spare, each with ``base`` times the effort of the one before."""
        self._strict_attempts += 1
        effort = base**self._strict_attempts if self._traits.supports_iteration_limit else None
        share = ANYTIME_SHARE if self._traits.anytime else self._share(number)
        outcome = self._attempt(strict, number, aims, share * self._left(), effort)
        self._count(outcome, room=True)
        return self._accepted(outcome)

    def _count(self, outcome: Attempt, *, room: bool) -> None:
        self._spent[room] += int(outcome.statistics.get("checked_motions", 0)) + EFFORT_MOTIONS

    def _share(self, number: int) -> float:
        """Of time and iterations left, what an attempt gets: half for the short way round, before the long one."""
        return 0.5 if self._short_way(number) else 1.0

    def _accepted(self, outcome: Attempt) -> JointPath | None:
        """The path of an attempt, if the second check accepts it."""
        path = self._check.accepted(outcome, self._seeds[0])
        self.totals["rejected"] = self._check.rejected
        return path

    def _others(self, number: int) -> bool:
        """Whether later attempts would aim at other configurations than this one."""
        if self._aimless or number == len(self._seeds) - 1:
            return False
        return not self._goals.exhausted or (self._traits.one_goal and number + 1 < len(self._goals.rows))

    def _attempt(
        self,
        problem: Problem,
        number: int,
        aims: Matrix,
        seconds: float,
        effort: int | None,
        *,
        checked: bool = False,
    ) -> Attempt:
        """One attempt, counted; ``checked``: start and goals are known to be free."""
        if self._iterations is not None:
            open_ = self._share(number) * (self._iterations - int(self.totals.get("iterations", 0)))
            left = int(-(-open_ // EFFORT_ITERATIONS))
            effort = max(left if effort is None else min(effort, left), 1)
        outcome = attempt(
            problem,
            self._factory,
            aims,
            seconds=max(seconds, SHORTEST),
            seed=self._seeds[number],
            parameters=self._parameters,
            effort=effort,
            checked=checked,
        )
        self.counting += outcome.counting
        self._deadline += outcome.counting
        for key, value in outcome.statistics.items():
            self.totals[key] = value if key in self._traits.path_statistics else self.totals.get(key, 0) + value
        return outcome
