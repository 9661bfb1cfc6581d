"""A simulated arm with known errors: it lags, sticks, overshoots, has backlash, and reads wrong angles.

Real arms of vehicles have all of these faults. The pilot's tool can be tested against them here, because the true
configuration of the links is known.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Vector, finite_array, frozen
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.pilot.devices.arm import SimulatedArm

MAX_LAG = 10.0  # [s]


@dataclass(frozen=True, slots=True, eq=False)
class Faults:
    """Errors of an arm: one number for all revolute joints [rad], or one for each joint [rad or m].

    Attributes:
        lag: Delay of all commands, also of a stop [s].
        stick: A joint at rest does not move towards a set point that is nearer than this.
        overshoot: A joint that ends its motion, or is stopped, moves on by this, and by half of its travel at most.
        backlash: Play between the drive, which is measured, and the link.
        offset: Error of the reading relative to the drive; may be negative.
    """

    lag: float = 0.0
    stick: ArrayLike = 0.0
    overshoot: ArrayLike = 0.0
    backlash: ArrayLike = 0.0
    offset: ArrayLike = 0.0

    def for_robot(self, robot: Robot) -> dict[str, Vector]:
        """Return the errors by name as arrays of shape (dof,), without ``lag``.

        Raises:
            InputError: If an error does not fit the robot, is not finite, or is negative where it must not be.
        """
        if not 0.0 <= float(self.lag) <= MAX_LAG:
            raise InputError(f"lag of the arm must be between 0 and {MAX_LAG:g} s, got {self.lag:g}")
        found = {}
        for name in [each.name for each in fields(self) if each.name != "lag"]:
            given = np.asarray(getattr(self, name), dtype=np.float64)
            values = np.where(robot.prismatic, 0.0, given) if given.ndim == 0 else given
            found[name] = frozen(finite_array(values, (robot.dof,), f"{name} of the arm"))
            if name != "offset" and (found[name] < 0.0).any():
                raise InputError(f"{name} of the arm must be 0 or more, got {found[name].min():g}")
        return found


class WrongArm(SimulatedArm):
    """A simulated arm with faults: `read` returns its own reading, `links` its true configuration.

    Example:
        >>> from rrtik_ompl import load_robot
        >>> import numpy as np
        >>> arm = WrongArm(load_robot("ur5"), np.zeros(6), Faults(offset=0.01))
        >>> float(arm.read()[0]), float(arm.links()[0])
        (0.01, 0.0)
    """

    def __init__(self, robot: Robot, start: ArrayLike, faults: Faults, rates: ArrayLike | None = None) -> None:
        """Begin at a configuration of the links, at rest in the middle of the backlash.

        Args:
            robot: The arm.
            start: Configuration of the links, shape (dof,).
            faults: Its errors.
            rates: Of the joints, shape (dof,) [rad/s or m/s]; None for the default rates.

        Raises:
            InputError: If one of them does not fit the robot.
        """
        super().__init__(robot, start, rates)
        each = faults.for_robot(robot)
        self._lag = float(faults.lag)
        self._stick = each["stick"]
        self._overshoot = each["overshoot"]
        self._half = 0.5 * each["backlash"]
        self._offset = each["offset"]
        self._links = self._q.copy()
        self._coasting = np.zeros(robot.dof)  # remaining overshoot of each joint, signed
        self._began = 0.0
        self._now = 0.0
        self._waiting: deque[tuple[float, Callable[[], None]]] = deque()

    def read(self) -> Vector:
        """Return the arm's own reading of its joints, shape (dof,) [rad or m]."""
        return self._q + self._offset

    def links(self) -> Vector:
        """Return the true joint values of the links, shape (dof,) [rad or m]."""
        return self._links.copy()

    def move(self, joint: int, target: float) -> None:
        """Send one joint to a value in terms of its own reading [rad or m]."""
        self._later(lambda: self._begin(joint, target - float(self._offset[joint])))

    def follow(self, q: ArrayLike) -> None:
        """Send all joints to a set point in terms of their own reading, shape (dof,).

        Raises:
            InputError: If they do not fit the robot.
        """
        course = self.robot.configuration(q, "set point")
        self._later(lambda: SimulatedArm.follow(self, course - self._offset))

    def stop(self) -> None:
        """Stop, after the lag of the arm."""
        self._later(self._end)

    def advance(self, seconds: float) -> None:
        """Advance the simulated time [s]; delayed commands take effect at their time."""
        end = self._now + seconds
        while self._waiting and self._waiting[0][0] <= end:
            due, act = self._waiting.popleft()
            self._go(max(due - self._now, 0.0))
            self._now = max(due, self._now)
            act()
        self._go(end - self._now)
        self._now = end

    def _later(self, act: Callable[[], None]) -> None:
        if self._lag > 0.0:
            self._waiting.append((self._now + self._lag, act))
        else:
            act()

    def _begin(self, joint: int, target: float) -> None:
        here = float(self._q[joint])
        if self.moving != joint:
            self._end()
            if not self._coasting[joint] and abs(target - here) <= float(self._stick[joint]):
                return
            self._began = here
        self._coasting[joint] = 0.0
        super().move(joint, target)

    def _go(self, seconds: float) -> None:
        """Move for an interval [s] in which no command takes effect.

        A joint that arrives within the interval overshoots in the time that is left. The links follow the drive when
        they touch the end of the backlash.
        """
        left = np.full(self.robot.dof, seconds)
        goal = self._goal
        if goal is not None:
            joint, target = goal
            needed = abs(target - float(self._q[joint])) / float(self._rates[joint])
            left[joint] = max(seconds - needed, 0.0)

        super().advance(seconds)
        if goal is not None and self._goal is None:
            self._coast(goal[0], float(np.sign(goal[1] - self._began)))

        step = np.clip(self._coasting, -self._rates * left, self._rates * left)
        self._coasting = self._coasting - step
        self._q = self.robot.clamp(self._q + step)
        self._links = np.clip(self._links, self._q - self._half, self._q + self._half)

    def _end(self) -> None:
        goal = self._goal
        self._goal = None
        self._course = None
        if goal is not None:
            self._coast(goal[0], float(np.sign(goal[1] - self._q[goal[0]])))

    def _coast(self, joint: int, way: float) -> None:
        self._coasting[joint] = way * min(float(self._overshoot[joint]), 0.5 * abs(float(self._q[joint]) - self._began))
