"""A goal of the tip as OMPL knows goals: its configurations are found by the tree in the workspace, on demand."""

from __future__ import annotations

from typing import Any

import numpy as np
from ompl import base as ob

from rrtik_ompl.arrays import Matrix
from rrtik_ompl.errors import InputError
from rrtik_ompl.goal import GoalRegion, PoseGoal, PositionGoal
from rrtik_ompl.ik.mb_rrt.aims import tree_aims
from rrtik_ompl.ik.mb_rrt.axes import misfit
from rrtik_ompl.ompl_bridge.states import StateIO
from rrtik_ompl.world import World


class TipGoal(ob.GoalSampleableRegion):  # type: ignore[misc]  # OMPL has no types
    """Bring the tip to a pose or a position; for every OMPL planner that samples its goal.

    The configurations are looked for when the first is asked for, and then handed out in turn, nearest to ``near``
    first.
    """

    def __init__(
        self,
        si: Any,
        world: World,
        goal: PoseGoal | PositionGoal | GoalRegion,
        *,
        near: Any = None,
        seed: int = 0,
        seconds: float = 1.0,
    ) -> None:
        """Make a goal.

        Args:
            si: ``ompl.base.SpaceInformation`` over the robot's joints.
            world: The robot and its scene.
            goal: What the tip has to reach.
            near: Posture near which configurations are wanted, shape (dof,); the middle of the limits if None.
            seed: Of the random numbers.
            seconds: Time that the search may take.

        Raises:
            InputError: If the robot does not fit, or ``near`` is no configuration of it.
        """
        super().__init__(si)
        robot = world.robot
        fault = misfit(robot)
        if fault:
            raise InputError(f"robot '{robot.name}' does not fit MB-RRT: {fault}")
        self.setThreshold(1.0)
        self._world, self._goal, self._states, self._seconds = world, goal, StateIO(si), seconds
        self._near = 0.5 * np.sum(robot.finite_range(), axis=0) if near is None else robot.configuration(near, "near")
        self._rng, self._given = np.random.default_rng(seed), 0
        self._found: Matrix | None = None

    @property
    def rows(self) -> Matrix:
        """The configurations, shape (k, dof); looked for at the first call."""
        if self._found is None:
            self._found = tree_aims(self._world, self._goal, self._near, self._rng, seconds=self._seconds)
        return self._found

    def sampleGoal(self, state: Any) -> None:
        """Write the next configuration into a state; called by OMPL."""
        if len(self.rows):
            self._states.write(state, self.rows[self._given % len(self.rows)])
            self._given += 1

    def maxSampleCount(self) -> int:
        """Number of configurations; called by OMPL."""
        return len(self.rows)

    def couldSample(self) -> bool:
        """Whether there are any; called by OMPL."""
        return len(self.rows) > 0

    def distanceGoal(self, state: Any) -> float:
        """0 at the goal, else at least 1 more than the errors in units of their tolerances; called by OMPL."""
        q = self._states.read(state)[None]
        robot = self._world.robot
        reached = bool(self._goal.satisfied(robot, q)[0])
        return 0.0 if reached else 1.0 + float(self._goal.distance(robot, q)[0])
