"""The interface of an arm that can be read and moved, and a simulated arm without errors."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Vector, finite_array
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.robot import Robot

DEFAULT_RATE = np.deg2rad(10.0)  # [rad/s]; of a joint whose rate is not given
DEFAULT_SLIDING_RATE = 0.02  # [m/s]


class Arm(Protocol):
    """An arm that a pilot moves.

    Attributes:
        lost: Why the connection is lost; "" if it is not.
    """

    lost: str

    def read(self) -> Vector:
        """Return the joint values, shape (dof,) [rad or m]."""

    def move(self, joint: int, target: float) -> None:
        """Send one joint to a value [rad or m] while all others stand still. A new move replaces the last."""

    def follow(self, q: ArrayLike) -> None:
        """Send all joints to a set point, shape (dof,) [rad or m], each at its full rate."""

    def stop(self) -> None:
        """Stop at once."""

    def grip(self, closed: bool) -> None:
        """Close or open the gripper."""


def joint_rates(robot: Robot, rates: ArrayLike | None = None) -> Vector:
    """Return the rate at which each joint is driven, shape (dof,) [rad/s or m/s].

    Without ``rates`` these are the default rates, limited to the velocity limits of the robot.

    Raises:
        InputError: If a rate is not positive.
    """
    if rates is None:
        usual = np.where(robot.prismatic, DEFAULT_SLIDING_RATE, DEFAULT_RATE)
        return np.minimum(usual, robot.velocity)

    given = finite_array(rates, (robot.dof,), "rates")
    if (given <= 0.0).any():
        raise InputError(f"rates must be positive, got {given.tolist()}")
    return given


class SimulatedArm:
    """A simulated arm without errors of control or measurement."""

    def __init__(self, robot: Robot, start: ArrayLike, rates: ArrayLike | None = None) -> None:
        """Begin at a configuration.

        Raises:
            InputError: If the configuration does not fit the robot.
        """
        self.robot = robot
        self.lost = ""
        self.closed = False
        self._q = robot.configuration(start, "start")
        self._rates = joint_rates(robot, rates)
        self._goal: tuple[int, float] | None = None
        self._course: Vector | None = None

    def read(self) -> Vector:
        """Return the joint values, shape (dof,) [rad or m]."""
        return self._q.copy()

    def links(self) -> Vector:
        """Return the true joint values of the links, which a camera sees, shape (dof,) [rad or m]."""
        return self._q.copy()

    @property
    def rates(self) -> Vector:
        """Rates of the joints, shape (dof,) [rad/s or m/s]."""
        return self._rates.copy()

    @property
    def at_rest(self) -> bool:
        """Whether no joint is told to move."""
        return self._goal is None and self._course is None

    @property
    def moving(self) -> int | None:
        """The number of the joint that moves; None if no single joint does."""
        return None if self._goal is None else self._goal[0]

    def move(self, joint: int, target: float) -> None:
        """Send one joint to a value [rad or m], clipped to its limits."""
        low = float(self.robot.lower[joint])
        high = float(self.robot.upper[joint])
        self._goal = (joint, min(max(target, low), high))
        self._course = None

    def follow(self, q: ArrayLike) -> None:
        """Send all joints to a set point, shape (dof,) [rad or m], each at its full rate.

        Raises:
            InputError: If it does not fit the robot.
        """
        self._goal = None
        self._course = self.robot.clamp(self.robot.configuration(q, "set point"))

    def stop(self) -> None:
        """Stop at once."""
        self._goal = self._course = None

    def grip(self, closed: bool) -> None:
        """Close or open the gripper."""
        self.closed = closed

    def advance(self, seconds: float) -> None:
        """Advance the simulated time [s]: joints move towards their targets at their rates."""
        if self._course is not None:
            max_step = self._rates * seconds
            self._q = self._q + np.clip(self._course - self._q, -max_step, max_step)
        if self._goal is None:
            return

        joint, target = self._goal
        step = self._rates[joint] * seconds
        to_go = target - self._q[joint]
        if abs(to_go) <= step:
            self._q[joint] = target
            self._goal = None
        else:
            self._q[joint] += np.sign(to_go) * step
