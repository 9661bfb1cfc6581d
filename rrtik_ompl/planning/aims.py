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
        finds_goals_itself: Whether the planner finds configurations at the goal by itself: there is nothing to aim at.
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
        self.finds_goals_itself = traits.finds_goals and isinstance(problem.goal, TipGoal)
        self._problem = problem
        self._clearance = clearance
        self._attempts = attempts
        self._one_goal = traits.one_goal
        self._goal_in_joints = problem.goal.q is not None
        self._has_long_way = self._goal_in_joints and has_continuous(problem.robot) and attempts > 1
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
        if self.finds_goals_itself:
            return np.zeros((0, self._problem.robot.dof))

        num_known = len(self._goals.rows)
        found_more = attempt > 0 and self._goals.more()
        rows = self._find_with_clearance()
        if self.is_short_way(attempt):
            return rows[:1]  # the goal as it is given; in the others a joint goes the other way round

        first = num_known if found_more else attempt
        return np.roll(rows, -first, axis=0) if first else rows

    def is_short_way(self, attempt: int) -> bool:
        """Whether an attempt goes the short way round alone."""
        return self._has_long_way and attempt == 0

    def changes_after(self, attempt: int) -> bool:
        """Whether later attempts would aim at other configurations than this one."""
        if self.finds_goals_itself or attempt == self._attempts - 1:
            return False
        return not self._goals.exhausted or (self._one_goal and attempt + 1 < len(self._goals.rows))

    def _find_with_clearance(self) -> Matrix:
        """Configurations at the goal, shape (k, dof); of the tip, those that keep the clearance if any does.

        Searches for more of them, round after round, until one does.
        """
        rows = self._goals.first()
        if self._clearance is None or self._goal_in_joints:
            return rows

        for _ in range(MAX_ROUNDS):
            keeps_clearance = self._problem.world.prover.proven(rows, rows, clearance=self._clearance)
            if keeps_clearance.any():
                return rows[keeps_clearance]
            if not self._goals.more():
                break
            rows = self._goals.rows
        return rows
