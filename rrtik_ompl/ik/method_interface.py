"""The interface of inverse kinematics methods: request, response, the method itself, and the result for users."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector, frozen, seed_of
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.choices import IkMethod
from rrtik_ompl.base.copies import as_value, in_one_line, restored, set_fields
from rrtik_ompl.base.kept import kept_with
from rrtik_ompl.description.joint_weights import weighted_difference
from rrtik_ompl.model.goal import Target, TipGoal, has_continuous, joint_difference
from rrtik_ompl.model.result import required
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.world.world import World

SAME_POSTURE = 1e-3  # [rad] or [m]: solutions of a numeric method this near to each other count as one
EXACT = 1e-10  # [m, rad]: a tip that misses a pose by less is at the pose itself, not only within its tolerances
SLACK_SHARE = 0.4  # of the smaller tolerance: a target this near to a singular one is solved as if it were singular


@dataclass(frozen=True, slots=True, eq=False)
class IkRequest:
    """One inverse kinematics problem as methods get it.

    Attributes:
        robot: The arm.
        goal: The goal.
        targets: Targets without freedom drawn from the goal, for methods that need these; reaching one is enough.
        near: Configuration near which a solution is preferred, shape (dof,).
        accept: Checks which configurations, shape (k, dof), inside the limits and at the goal, are acceptable; returns
            shape (k,).
        all: Whether to return every solution that the method can find, not just one.
        budget: Time limit, which a method reads between its rounds.
        random: Source of random numbers.
        world: The world that ``accept`` checks collisions with, for methods that place the arm link by link.
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
        """Source of random numbers."""
        return self.random.rng


@dataclass(frozen=True, slots=True, eq=False)
class IkResponse:
    """The response of a method to a request.

    Attributes:
        q: Configurations at one of the targets, inside the limits, in collision or not, shape (k, dof).
        nearest: If there are none, the configuration that came nearest to the goal, regardless of limits, shape (dof,).
        iterations: Number of steps; 0 for a closed form.
        timed_out: Whether the time was up before the method had finished.
        singular: Whether a target has a whole curve of solutions, of which ``q`` can only hold samples.
    """

    q: Matrix
    nearest: Vector
    iterations: int = 0
    timed_out: bool = False
    singular: bool = False


@dataclass(frozen=True, slots=True)
class Method:
    """A method of inverse kinematics.

    Attributes:
        misfit: Returns why the method does not fit a robot and a target; "" if it does.
        run: Solves a request.
    """

    misfit: Callable[[Robot, Target], str]
    run: Callable[[IkRequest], IkResponse]


def fits_all(robot: Robot, target: Target) -> str:
    """Return "", the misfit of a method that fits every robot and target."""
    del robot, target
    return ""


class _Deferred:
    """A value of which some fields are made when one of them is first read."""

    __slots__ = ("_later",)

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> object:
            if name.startswith("_"):
                raise AttributeError(name)
            make, *given = self._later
            set_fields(self, **make(name, *given))
            return object.__getattribute__(self, name)


@dataclass(frozen=True, slots=True, eq=False)
class IkResult(_Deferred):
    """The result of inverse kinematics.

    Attributes:
        solutions: Configurations at the goal, inside the limits, free if a world was given, nearest first; shape
            (k, dof). At most one unless all were asked for.
        residuals: Distance [m] and angle [rad] of each from the goal by forward kinematics, shape (k, 2); for several
            tips those of the tip that is farthest away.
        reason: Why there is no solution: ``unreachable``, ``limits``, ``collision`` or ``time`` (which also means that
            the method gave up, or tried only a part of a region); "" if there is one.
        detail: The reason as a line: by how much, which joint, what touches.
        iterations: Number of steps of a numeric method.
        method: The method that answered.
        seconds: Time taken [s].

    Example:
        >>> result = rrtik.solve_ik(rrtik.load_robot("planar3"), rrtik.PositionGoal([9.0, 0.0, 0.0]))
        >>> result.found, result.reason
        (False, 'unreachable')
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

    @classmethod
    def later(cls, make: Callable[..., dict[str, Any]], *given: object) -> IkResult:
        """Return a result whose fields are made when they are read: ``make(name, *given)`` for the first that is.

        It returns this field and any others by their names.
        """
        result = restored(cls, {})
        _set_later(result, (make, *given))
        return result

    @property
    def found(self) -> bool:
        """Whether there is a solution."""
        return len(self.solutions) > 0

    @property
    def statistics(self) -> Mapping[str, Any]:
        """The method and its number of iterations."""
        return {"method": self.method, "iterations": self.iterations}

    def require(self) -> Vector:
        """Return the best configuration, shape (dof,): the nearest one.

        Raises:
            NotFoundError: If there is none.

        Example:
            >>> robot = rrtik.load_robot("ur5")
            >>> rrtik.solve_ik(robot, robot.fk(robot.posture("up"))).require().shape
            (6,)
        """
        best = self.solutions[0] if self.found else None
        return required(best, "no configuration", f"{self.reason}: {self.detail}")

    def nearest(self) -> IkResult:
        """Return the result with only its nearest solution."""
        return replace(self, solutions=self.solutions[:1], residuals=self.residuals[:1])


_set_later: Callable[[IkResult, tuple[Any, ...]], None] = vars(_Deferred)["_later"].__set__


def nearest_first(robot: Robot, rows: Matrix, near: Vector) -> NDArray[np.intp]:
    """Return the indices that sort rows, shape (k, dof), by their weighted joint distance from a configuration."""
    difference = weighted_difference(robot, rows, near)
    order: NDArray[np.intp] = np.vecdot(difference, difference).argsort(kind="stable")
    return order


def different_rows(rows: Matrix, order: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return indices of different rows in the given order; rows within `SAME_POSTURE` of one before are dropped."""
    chosen: list[int] = []
    for k in order.tolist():
        if not chosen or np.abs(rows[k] - rows[chosen]).max(axis=1).min() > SAME_POSTURE:
            chosen.append(k)
    return np.array(chosen, dtype=np.intp)


def unwind(robot: Robot, rows: Matrix, start: Vector | None) -> None:
    """Change continuous joints by full turns, in place, so that each row is as near as possible to the row before.

    Args:
        robot: The arm.
        rows: Configurations, shape (k, dof), changed in place; rows of NaN are skipped.
        start: Configuration before the first row, shape (dof,), or None.
    """
    if not has_continuous(robot):
        return

    last = start
    for k in np.flatnonzero(~np.isnan(rows[:, 0])):
        if last is not None:
            rows[k] = np.where(robot.continuous, last + joint_difference(robot, rows[k], last), rows[k])
        last = rows[k]


@kept_with
def mid_range_configuration(robot: Robot) -> Vector:
    """Return the middle of the limits, shape (dof,), where a search begins by default."""
    return frozen(0.5 * np.sum(robot.finite_range(), axis=0))


class RandomStream:
    """A source of random numbers that is made when it is first used; the same seed gives the same numbers.

    Args:
        seed: A whole number of at least 0; None draws one.

    Raises:
        InputError: If the seed is no such number.
    """

    def __init__(self, seed: int | None) -> None:
        self._seed = seed_of(seed)

    @cached_property
    def rng(self) -> np.random.Generator:
        """The random generator."""
        return np.random.default_rng(self._seed)
