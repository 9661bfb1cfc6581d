"""The interface of inverse kinematics: request and response of a method, the method itself, and what is found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector, frozen, whole_number
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.choices import IkMethod
from rrtik_ompl.base.copies import as_value, in_one_line
from rrtik_ompl.description.joint_weights import weighted_difference
from rrtik_ompl.model.goal import Target, TipGoal, has_continuous, joint_difference
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.world.world import World

SAME_POSTURE = 1e-3  # [rad] or [m]; solutions of a numeric method this near are one


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
        budget: How long a method may take; it looks between its rounds. The random numbers are those of ``random``.
        random: Random numbers.
        world: What ``accept`` checks collisions with, for methods that place the arm link by link.
    """

    robot: Robot
    goal: TipGoal
    targets: tuple[Target, ...]
    near: Vector
    accept: Callable[[Matrix], Mask]
    all: bool
    budget: Budget
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


def fits_all(robot: Robot, target: Target) -> str:
    """The misfit of a method that fits every robot and target."""
    del robot, target
    return ""


@dataclass(frozen=True, slots=True, eq=False)
class IkResult:
    """What inverse kinematics found.

    Attributes:
        solutions: Configurations at the goal, inside the limits, free if a world was given, nearest first; shape
            (k, dof). At most one unless all were asked for.
        residuals: Distance [m] and angle [rad] of each from the goal by forward kinematics, shape (k, 2); of several
            tips those of the tip that is farthest away.
        reason: "" or why there is none: ``unreachable``, ``limits``, ``collision``, ``time`` (or the method gave up,
            or tried a part of a region alone).
        detail: The same in a line: by how much, which joint, what touches.
        iterations: Steps of a numeric method.
        method: The method that answered.
        seconds: Time taken.
    """

    solutions: Matrix
    residuals: Matrix
    reason: str
    detail: str
    iterations: int
    method: IkMethod
    seconds: float

    __reduce__ = as_value
    __repr__ = in_one_line

    @property
    def found(self) -> bool:
        """Whether there is a solution."""
        return len(self.solutions) > 0

    def nearest(self) -> IkResult:
        """The same with the nearest solution alone."""
        return replace(self, solutions=self.solutions[:1], residuals=self.residuals[:1])


def nearest_first(robot: Robot, rows: Matrix, near: Vector) -> NDArray[np.intp]:
    """Numbers of rows, shape (k, dof), those nearest to a posture first; joints count as their weights say."""
    difference = weighted_difference(robot, rows, near)
    order: NDArray[np.intp] = np.vecdot(difference, difference).argsort(kind="stable")
    return order


def different_rows(rows: Matrix, order: NDArray[np.intp]) -> NDArray[np.intp]:
    """Numbers of the rows, taken in that order, without those that repeat an earlier one to `SAME_POSTURE`."""
    chosen: list[int] = []
    for k in order.tolist():
        if not chosen or np.abs(rows[k] - rows[chosen]).max(axis=1).min() > SAME_POSTURE:
            chosen.append(k)
    return np.array(chosen, dtype=np.intp)


def unwind(robot: Robot, rows: Matrix, start: Vector | None) -> None:
    """Turn continuous joints to where they were in the row before, in place; rows of NaN are passed over.

    Args:
        robot: The arm.
        rows: Shape (k, dof).
        start: Before the first row, shape (dof,); None for nowhere.
    """
    if not has_continuous(robot):
        return

    last = start
    for k in np.flatnonzero(~np.isnan(rows[:, 0])):
        if last is not None:
            rows[k] = np.where(robot.continuous, last + joint_difference(robot, rows[k], last), rows[k])
        last = rows[k]


@lru_cache(maxsize=64)
def mid_range_configuration(robot: Robot) -> Vector:
    """Where a search begins if nobody says: the middle of the limits, shape (dof,)."""
    return frozen(0.5 * np.sum(robot.finite_range(), axis=0))


class RandomStream:
    """The same seed gives the same numbers.

    Args:
        seed: A whole number of at least 0.

    Raises:
        InputError: If it is none.
    """

    def __init__(self, seed: int) -> None:
        self._seed = whole_number(seed, "seed")

    @cached_property
    def rng(self) -> np.random.Generator:
        """Where the numbers come from."""
        return np.random.default_rng(self._seed)
