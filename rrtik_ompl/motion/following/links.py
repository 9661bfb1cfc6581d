"""The interface to an arm that takes set points, and a simulated arm."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Vector, finite_array, finite_number
from rrtik_ompl.base.errors import require
from rrtik_ompl.model.robot import Robot


@runtime_checkable
class RobotLink(Protocol):
    """An arm that takes set points of its joints at a control rate.

    Example:
        >>> arm = rrtik.SimulatedLink(rrtik.load_robot("planar3"), np.zeros(3))
        >>> isinstance(arm, rrtik.RobotLink)
        True
    """

    def positions(self) -> Vector:
        """Joint values now, shape (n,) [rad or m]."""

    def command(self, q: Vector, t: float) -> None:
        """Take a set point, shape (n,) [rad or m], for the time t [s] since the motion began."""


class SimulatedLink:
    """An arm that is always where it is told to be.

    Attributes:
        sent: Times and set points so far.

    Example:
        >>> path = rrtik.JointPath([[0.0, 0.0, 0.0], [0.05, 0.0, 0.0]])
        >>> motion = rrtik.time_parameterize(path, rrtik.RateLimits(2.0, 20.0))
        >>> arm = rrtik.SimulatedLink(rrtik.load_robot("planar3"), np.zeros(3))
        >>> rrtik.Follower(motion, arm).run().arrived
        True
    """

    def __init__(self, robot: Robot, start: ArrayLike) -> None:
        """Begin at a configuration, shape (dof,).

        Raises:
            InputError: If it does not fit the robot, or there is none.
        """
        require(robot, Robot, "robot of a link", "use load_robot(name)")
        self._q = robot.configuration(start, "start")
        self.sent: list[tuple[float, Vector]] = []

    def positions(self) -> Vector:
        """Joint values now, shape (n,)."""
        return self._q.copy()

    def command(self, q: Vector, t: float) -> None:
        """Go to a set point at once.

        Raises:
            InputError: If it is no row of finite numbers, one for each joint, or the time is none.
        """
        place = finite_array(q, self._q.shape, "set point").copy()
        time = finite_number(t, "time of a set point")
        self._q = place
        self.sent.append((time, place))
