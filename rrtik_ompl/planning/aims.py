"""Which configurations at the goal the attempts of a planner aim at."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.ik.goal_configurations import MAX_ROUNDS, GoalSearch
from rrtik_ompl.model.goal import TipGoal, has_continuous
from rrtik_ompl.ompl_bridge.planner_traits import PlannerTraits
from rrtik_ompl.world.problem import Problem


class Aims:
    """What each attempt of a planner aims at; attempts are counted from 0.

    Args:
        problem: What is solved.
        traits: Of the planner.
        clearance: To be kept where there are configurations that do [m], or None.
        attempts: How many there may be.
        seed: Of inverse kinematics.
        seconds_left: How long there is time.

    Attributes:
        none_needed: Whether the planner finds configurations at the goal itself, so that there is nothing to aim at.
    """

    def __init__(
        self,
        problem: Problem,
        traits: PlannerTraits,
        clearance: float | None,
        *,
        attempts: int,
        seed: int,
        seconds_left: Callable[[], float],
    ) -> None:
        self.none_needed = traits.finds_goals and isinstance(problem.goal, TipGoal)
        self._problem = problem
        self._clearance = clearance
        self._attempts = attempts
        self._one_goal = traits.one_goal
        self._in_joints = problem.goal.q is not None
        self._long_ways = self._in_joints and has_continuous(problem.robot) and attempts > 1
        self._goals = GoalSearch(problem, seed, seconds_left=seconds_left)

    @property
    def exhausted(self) -> bool:
        """Whether no more configurations will come."""
        return self._goals.exhausted

    @property
    def reason(self) -> str:
        """Why there is no configuration, in a line; "" if there is one."""
        return self._goals.reason

    def of(self, attempt: int) -> Matrix:
        """What an attempt aims at: all that is known, shape (k, dof).

        Some planners take the first row alone. So the newest ones come first or, if there is nothing new, at each
        attempt another one does.
        """
        if self.none_needed:
            return np.zeros((0, self._problem.robot.dof))

        known = len(self._goals.rows)
        newer = attempt > 0 and self._goals.more()
        rows = self._roomy()
        if self.short_way(attempt):
            return rows[:1]  # the goal as it is given; in the others a joint goes the other way round

        first = known if newer else attempt
        return np.roll(rows, -first, axis=0) if first else rows

    def short_way(self, attempt: int) -> bool:
        """Whether an attempt goes the short way round alone."""
        return self._long_ways and attempt == 0

    def others_after(self, attempt: int) -> bool:
        """Whether later attempts would aim at other configurations than this one."""
        if self.none_needed or attempt == self._attempts - 1:
            return False
        return not self._goals.exhausted or (self._one_goal and attempt + 1 < len(self._goals.rows))

    def _roomy(self) -> Matrix:
        """All that is known to be at the goal or, at one of the tip, those that keep the clearance if any does."""
        rows = self._goals.first()
        if self._clearance is None or self._in_joints:
            return rows

        for _ in range(MAX_ROUNDS):
            kept = self._problem.world.prover.proven(rows, rows, clearance=self._clearance)
            if kept.any():
                return rows[kept]
            if not self._goals.more():
                break
            rows = self._goals.rows
        return rows
