"""The ``run:`` section of a problem file: how to replan while its obstacles move."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from rrtik_ompl.base.arrays import Matrix, Vector, frozen
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.files.sections import NotNegative, Numbers, Positive, Section
from rrtik_ompl.model.robot import Robot


class GoalWaypoint(Section):
    """Where a moving goal is at a time [s], in joint values."""

    time: NotNegative
    joints: Numbers | None = None
    joints_deg: Numbers | None = None

    @model_validator(mode="after")
    def _one_unit(self) -> GoalWaypoint:
        if (self.joints is None) == (self.joints_deg is None):
            raise PydanticCustomError("units", "give either joints or joints_deg")
        return self

    def configuration(self, robot: Robot) -> Vector:
        """Return the configuration, shape (dof,) [rad or m].

        Raises:
            InputError: If it has the wrong number of joints or is outside the limits.
        """
        what = f"goal at {self.time:g} s"
        if self.joints is None:
            q = robot.configuration_deg(self.joints_deg or [], what)
        else:
            q = robot.configuration(self.joints, what)
        if fault := robot.limit_fault(q):
            raise InputError(f"{what}: {fault}")
        return robot.onto_limits(q)


class RunSection(Section):
    """Steps, ticks and distances of a run; what is left out is as in ``rrtik_ompl.replanning``."""

    step: Positive = Field(description="how far the robot goes in a tick [rad or m]")
    rate: Positive = Field(description="ticks a second [Hz]")
    margin: NotNegative = Field(0.0, description="distance to obstacles that is always kept [m]")
    clearance: NotNegative | None = Field(None, description="what moves are proven to keep beside the margin [m]")
    speed_bound: Positive | None = Field(None, description="no point of an obstacle is faster [m/s]")
    max_edge: Positive | None = Field(None, description="longest edge of the trees [rad or m]")
    lookahead_ticks: Annotated[int, Field(strict=True, ge=0)] = Field(
        0, description="predict obstacle motion this many ticks ahead"
    )
    repair_budget: Positive | None = Field(None, description="time that a repair may take, one tick if absent [s]")
    seconds: Positive = Field(60.0, description="simulated time at most [s]")
    velocity: Numbers | None = Field(None, description="joint speeds, one or one a joint [rad/s or m/s]")
    goal: Annotated[list[GoalWaypoint], Field(min_length=1)] | None = Field(None, description="a goal that moves")

    def goal_motion(self, robot: Robot) -> GoalMotion | None:
        """Return the motion of the goal, or None if it does not move.

        Raises:
            InputError: If times do not increase, or a row has the wrong number of joints or is outside the limits.
        """
        if self.goal is None:
            return None
        rows = [waypoint.configuration(robot) for waypoint in self.goal]
        return GoalMotion(np.array([w.time for w in self.goal]), np.array(rows))


class GoalMotion:
    """A goal that moves in straight lines between configurations, and rests before and after.

    Calling it returns the goal configuration at a time.

    Args:
        times: Increasing times of the configurations [s], shape (k,).
        rows: Configurations, shape (k, n).
    """

    def __init__(self, times: Vector, rows: Matrix) -> None:
        if (np.diff(times) <= 0.0).any():
            raise InputError(f"run: goal: times must increase, got {times.tolist()}")
        self._times = frozen(times)
        self._rows = frozen(rows)

    def __call__(self, time: float) -> Vector:
        """Return the configuration at ``time`` [s], shape (n,)."""
        return np.array([np.interp(time, self._times, column) for column in self._rows.T])
