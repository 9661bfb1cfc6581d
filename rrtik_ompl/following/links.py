"""The interface to an arm that takes set points, and a simulated arm."""

from __future__ import annotations

from typing import Protocol

from numpy.typing import ArrayLike

from rrtik_ompl.arrays import Vector
from rrtik_ompl.robot import Robot


class RobotLink(Protocol):
    """An arm that takes set points of its joints at a control rate."""

    def positions(self) -> Vector:
        """Joint values now, shape (n,) [rad or m]."""

    def command(self, q: Vector, t: float) -> None:
        """Take a set point, shape (n,) [rad or m], for the time t [s] since the motion began."""


class SimulatedLink:
    """An arm that is always where it is told to be.

    Attributes:
        sent: Times and set points so far.
    """

    def __init__(self, robot: Robot, start: ArrayLike) -> None:
        """Begin at a configuration, shape (dof,).

        Raises:
            InputError: If it does not fit the robot.
        """
        self._q = robot.configuration(start, "start")
        self.sent: list[tuple[float, Vector]] = []

    def positions(self) -> Vector:
        """Joint values now, shape (n,)."""
        return self._q.copy()

    def command(self, q: Vector, t: float) -> None:
        """Go to a set point at once."""
        self._q = q.copy()
        self.sent.append((t, self._q))
