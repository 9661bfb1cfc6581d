"""The interface of inverse kinematics methods: request, response, and the method itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from rrtik_ompl.arrays import Mask, Matrix, Vector
from rrtik_ompl.goal import PoseGoal, PositionGoal, TipGoal
from rrtik_ompl.ik.random_stream import RandomStream
from rrtik_ompl.robot import Robot
from rrtik_ompl.world import World

Target: TypeAlias = PoseGoal | PositionGoal


@dataclass(frozen=True, slots=True, eq=False)
class IkRequest:
    """One inverse kinematics problem as methods get it.

    Attributes:
        robot: The arm.
        goal: The goal.
        targets: Goals without freedom drawn from it, for methods that need such; one of them is enough.
        near: Posture near which a solution is preferred, shape (dof,).
        accept: Which of some configurations, shape (k, dof), inside the limits and at the goal, will do.
        all: Whether to return every solution that the method can find, not just one.
        deadline: Time of ``time.monotonic`` at which to stop.
        random: Random numbers.
        world: What ``accept`` checks collisions with, for methods that place the arm link by link.
    """

    robot: Robot
    goal: TipGoal
    targets: tuple[Target, ...]
    near: Vector
    accept: Callable[[Matrix], Mask]
    all: bool
    deadline: float
    random: RandomStream
    world: World | None = None

    @property
    def rng(self) -> np.random.Generator:
        """Where random numbers come from."""
        return self.random.rng


@dataclass(frozen=True, slots=True, eq=False)
class IkResponse:
    """What a method found.

    Attributes:
        q: Configurations at one of the targets, inside the limits, in collision or not, shape (k, dof).
        nearest: If there is none: the posture that came nearest to the goal with no regard to limits, shape (dof,).
        iterations: Steps, 0 for a closed form.
        timed_out: Whether the time was up before the method was through.
        singular: Whether a target is in reach of a whole curve of solutions, of which ``q`` can only hold members.
    """

    q: Matrix
    nearest: Vector
    iterations: int = 0
    timed_out: bool = False
    singular: bool = False


@dataclass(frozen=True, slots=True)
class Method:
    """A method: ``misfit`` says why it does not fit a robot and a target ("" if it does); ``run`` solves."""

    misfit: Callable[[Robot, Target], str]
    run: Callable[[IkRequest], IkResponse]


def tolerances(target: Target) -> tuple[float, float]:
    """What the errors of a target may be at most: distance [m] and angle [rad] (0 for a position)."""
    if isinstance(target, PositionGoal):
        return target.tolerance, 0.0
    return target.position_tolerance, target.orientation_tolerance
