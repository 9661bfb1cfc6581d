"""What every kind of goal answers, so that planning, inverse kinematics and pictures treat all kinds alike.

A new kind of goal of the tip is a :class:`GoalPart`: ``rrtik_ompl.model.goal`` has the others, and CONTRIBUTING.md an
example. Files have their own words for each kind, in ``rrtik_ompl.problem_files.goal``.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Mask, Vector, finite_array, whole_number
from rrtik_ompl.base.choices import FrameAxis
from rrtik_ompl.base.errors import InputError, require
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.tip_distance import metres_per_radian

if TYPE_CHECKING:
    from rrtik_ompl.model.task_region import TaskRegion


class Goal:
    """What a plan has to reach. Frozen.

    It has not the metaclass ABCMeta, by which ``isinstance`` would take several times as long: `solve_ik` of one pose
    takes 20 microseconds, and asks it often. mypy finds all the same what a kind does not answer.

    Attributes:
        oriented: Whether the orientation of the tip counts.
    """

    __slots__ = ()

    oriented: ClassVar[bool] = True

    @property
    @abstractmethod
    def title(self) -> str:
        """What it is, in two or three words."""
        raise NotImplementedError

    @abstractmethod
    def distance(self, robot: Robot, Q: ArrayLike) -> Vector:
        """How far each row of Q is from the goal, shape (m,) [m, of a configuration rad or m]."""
        raise NotImplementedError

    @abstractmethod
    def satisfied(self, robot: Robot, Q: ArrayLike) -> Mask:
        """Which rows of Q are at the goal, shape (m,)."""
        raise NotImplementedError

    @property
    def q(self) -> Vector | None:
        """The configuration that it is, shape (dof,) [rad or m]; None for a goal of a tip, which many may reach."""
        return None

    @property
    def parts(self) -> tuple[GoalPart, ...]:
        """Its goals of a tip: of one tip any of them is enough, of several tips each has its own."""
        return ()

    @property
    def frames(self) -> tuple[str, ...]:
        """Names of the links that are tips, one for each part; none unless it is a goal of several tips."""
        return ()

    def arms(self, robot: Robot) -> list[Robot]:
        """The robot with each of the tips that have a goal."""
        return [robot]

    def member_at(self, robot: Robot, q: ArrayLike) -> int | None:
        """Which of several goals a configuration, shape (dof,), reaches, from 0; None if it has no members."""
        del robot, q
        return None


class TipGoal(Goal):
    """A goal of the robot's own tip, which is at it where it is at one of the parts."""

    __slots__ = ()

    @abstractmethod
    def errors(self, robot: Robot, Q: ArrayLike) -> tuple[Vector, Vector]:
        """Distance [m] and angle [rad] of the tip from the nearest part, for each row of Q, shapes (m,)."""
        raise NotImplementedError

    @property
    @abstractmethod
    def has_regions(self) -> bool:
        """Whether it is or has a goal with freedom that no row of `rrtik_ompl.ik.targets` holds."""
        raise NotImplementedError

    def alone(self, number: int) -> TipGoal:
        """One of its parts as a goal of its own.

        Raises:
            InputError: If there is no part of that number.
        """
        return self.parts[self._place(number)]

    def _place(self, number: int) -> int:
        """The number of one of its parts, checked."""
        place = whole_number(number, "number of a part of a goal")
        if place >= len(self.parts):
            raise InputError(f"goal: it has {len(self.parts)} parts, counted from 0, and no part {place}")
        return place


class GoalPart(TipGoal):
    """A goal of the tip that is no set of others: a pose, a position, a region."""

    __slots__ = ()

    @property
    @abstractmethod
    def tolerances(self) -> tuple[float, float]:
        """What the errors may be at most: distance [m] and angle [rad] (0 for a position)."""
        raise NotImplementedError

    @abstractmethod
    def tip_errors(self, tips: NDArray[np.float64]) -> tuple[Vector, Vector]:
        """As :meth:`errors_at`, of poses that are known to be such, shape (m, 4, 4)."""
        raise NotImplementedError

    @abstractmethod
    def region(self) -> TaskRegion:
        """It, or where no region is all of it a part of it: what targets are drawn from, and what pictures show."""
        raise NotImplementedError

    @property
    def freedom(self) -> TaskRegion | None:
        """The region that targets are drawn from; None if it is a :class:`Target` itself."""
        return self.region()

    @property
    def has_regions(self) -> bool:
        """Whether it leaves freedom."""
        return self.freedom is not None

    def freed(self, axis: FrameAxis | None, box: Vector) -> GoalPart:
        """It with a free turn about an axis of its frame and a box of positions, if it is a pose."""
        del axis, box
        return self

    @property
    def parts(self) -> tuple[GoalPart, ...]:
        """It alone."""
        return (self,)

    def errors_at(self, tips: ArrayLike) -> tuple[Vector, Vector]:
        """Distance [m] and angle [rad] of poses of the tip, shape (m, 4, 4), from the goal, shapes (m,)."""
        return self.tip_errors(finite_array(tips, (None, 4, 4), "poses of the tip"))

    def errors(self, robot: Robot, Q: ArrayLike) -> tuple[Vector, Vector]:
        """Distance [m] and angle [rad] of the tip from the goal, for each row of Q, shapes (m,)."""
        require(robot, Robot, "robot of a goal")
        return self.tip_errors(robot.fk_batch(Q))

    def distance(self, robot: Robot, Q: ArrayLike) -> Vector:
        """How far the tip is from the goal, shape (m,) [m]: its way, and its turn at the lever of half the arm's reach.

        Small enough means at the goal only where the tolerances say so: ask :meth:`satisfied`.
        """
        position, angle = self.errors(robot, Q)
        return position + metres_per_radian(robot) * angle

    def satisfied(self, robot: Robot, Q: ArrayLike) -> Mask:
        """Which rows of Q are at the goal, shape (m,)."""
        position, angle = self.errors(robot, Q)
        near, turned = self.tolerances
        return (position <= near) & (angle <= turned)


class Target(GoalPart):
    """A goal without freedom, as methods of inverse kinematics take it: a pose, or a point in any orientation."""

    __slots__ = ()

    @property
    @abstractmethod
    def pose(self) -> pin.SE3:
        """T_world_tip (``pinocchio.SE3``), turned like the world if the orientation does not count."""
        raise NotImplementedError

    @property
    @abstractmethod
    def point(self) -> Vector:
        """Where the tip has to be [m], shape (3,)."""
        raise NotImplementedError

    @abstractmethod
    def tightened(self, share: float) -> Target:
        """The same goal with that share of its tolerances."""
        raise NotImplementedError

    @property
    def freedom(self) -> None:
        """It leaves none."""
        return None

    @property
    def has_regions(self) -> bool:
        """It has none."""
        return False
