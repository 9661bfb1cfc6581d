"""Hold to run: a joint moves only as long as its command is renewed.

Each renewal gives the arm a set point that is a little ahead of it, by no more than `LEASH_SECONDS` of its way. Without
a renewal, whatever the reason (the key is released, the page or the line hangs), the arm stops there by itself.
"""

from __future__ import annotations

import time as clock

import numpy as np

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.pilot.devices.arm import Arm
from rrtik_ompl.pilot.devices.line_arm import LineArm
from rrtik_ompl.pilot.motion.supervisor import Supervisor

LEASH_SECONDS = 0.1  # how far a set point may be ahead of the arm, at the speed of the moment
HOLD_SECONDS = 0.25  # without a renewal for as long the drive is over
FIRST_SECONDS = 0.04  # of motion that the first command of a press asks for: a tap moves the arm by as much


class Drive:
    """Drives one joint at a time, or all together.

    Attributes:
        joint: Number of the joint that is driven; None if none is.
        goal: Where the drive ends [rad or m].
        leading: Whether all joints are led to set points.
        supervisor: Compares what the arm does with what it was told.
        read_by_arm: Whether the arm's own thread gives its readings to the supervisor.
    """

    def __init__(self, robot: Robot, arm: Arm, rates: Vector) -> None:
        """Begin at rest.

        Args:
            robot: What the arm is.
            arm: The arm that is moved.
            rates: Of its joints at full speed, shape (dof,) [rad/s or m/s].
        """
        self.joint: int | None = None
        self.goal = 0.0
        self.leading = False
        self.supervisor = Supervisor(robot, rates)
        self.read_by_arm = isinstance(arm, LineArm)
        if isinstance(arm, LineArm):
            arm.judge = self.supervisor
        self._arm, self._rates = arm, rates
        self._point, self._renewed = 0.0, -np.inf

    @property
    def active(self) -> bool:
        """Whether the arm is driven."""
        return self.leading or self.joint is not None

    def read(self, q: Vector, time: float) -> None:
        """Give a reading to the supervisor, shape (dof,) [rad or m], unless the arm itself does."""
        if not self.read_by_arm:
            self.supervisor.read(q, time)

    def standing(self, time: float) -> tuple[int, float, float] | None:
        """A driven joint that does not move; see `Supervisor.standing`."""
        return self.supervisor.standing(self._arms_time(time))

    def renew(self, joint: int, goal: float, speed: float, q: Vector, time: float) -> float:
        """Drive a joint on towards a goal; returns the set point [rad or m].

        Args:
            joint: Number of the joint.
            goal: Where it goes at most [rad or m].
            speed: Share of its rate, above 0 and up to 1.
            q: Where the arm is, shape (dof,).
            time: Now [s].
        """
        here, rate = float(q[joint]), speed * float(self._rates[joint])
        turned = self.active and (goal - self._point) * (self.goal - self._point) < 0.0
        if joint != self.joint or turned or self.leading:
            self.end(time)
            self._point, self._renewed = here, time - FIRST_SECONDS
        self.joint, self.goal = joint, goal
        seconds = float(np.clip(time - self._renewed, 0.0, LEASH_SECONDS))
        self._renewed = max(time, self._renewed)
        step = np.clip(goal - self._point, -rate * seconds, rate * seconds)
        leash = rate * LEASH_SECONDS
        self._point = float(np.clip(self._point + step, here - leash, here + leash))
        aim, ahead = q.copy(), np.zeros(len(q))
        aim[joint], ahead[joint] = self._point, leash
        self.supervisor.told(aim, ahead, q, self._arms_time(time))
        self._arm.move(joint, self._point)
        return self._point

    def lead(self, point: Vector, speed: float, q: Vector, time: float) -> None:
        """Send all joints to a set point that is ahead of the arm by `LEASH_SECONDS` at most.

        Args:
            point: Shape (dof,) [rad or m].
            speed: Share of the joints' rates, above 0 and up to 1.
            q: Where the arm is, shape (dof,).
            time: Now [s].
        """
        if self.joint is not None:
            self.end(time)
        self.leading, self._renewed = True, max(time, self._renewed)
        self.supervisor.told(point, speed * self._rates * LEASH_SECONDS, q, self._arms_time(time))
        self._arm.follow(point)

    def expire(self, time: float) -> bool:
        """End the drive if it was not renewed in time; whether that was so."""
        over = self.active and time - self._renewed > HOLD_SECONDS
        if over:
            self.end(time)
        return over

    def end(self, time: float) -> None:
        """Stop the arm at a time [s], if it is driven."""
        if self.active:
            self.joint, self.leading = None, False
            self.supervisor.stopped(self._arms_time(time))
            self._arm.stop()

    def _arms_time(self, time: float) -> float:
        """A time of the session [s] by the clock of whoever reads the arm."""
        return clock.monotonic() if self.read_by_arm else time
