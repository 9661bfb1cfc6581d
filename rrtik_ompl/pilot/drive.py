"""Hold to run: a joint moves only as long as its command is renewed.

Each renewal gives the arm a set point that is a little ahead of it, by no more than `LEASH_SECONDS` of its way. Without
a renewal, whatever the reason (the key is released, the page or the line hangs), the arm stops there by itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rrtik_ompl.pilot.routes.follower import MADE

LEASH_SECONDS = 0.1  # how far a set point may be ahead of the arm, at the speed of the moment
HOLD_SECONDS = 0.25  # without a renewal for as long the drive is over
FIRST_SECONDS = 0.04  # of motion that the first command of a press asks for: a tap moves the arm by as much


@dataclass(frozen=True, slots=True)
class Press:
    """A key, button or stick that is held; one at a time.

    Attributes:
        verb: The command that it renews.
        number: Of the press: a key that is pressed anew has another.
        over: It was ended: whoever still holds it has to press again.
        due: Joint and end of the move that it makes.
        nearest: How near to its end the arm has come, and when.
        near: From the end of a move at which it is made [rad or m].
    """

    verb: str = ""
    number: float = -1.0
    over: bool = False
    due: tuple[int, float] = (0, 0.0)
    nearest: tuple[float, float] = (np.inf, 0.0)
    near: float = MADE

    def is_of(self, verb: str, number: object) -> bool:
        """Whether a command renews it."""
        return (verb, number) == (self.verb, self.number)


@dataclass(frozen=True, slots=True)
class Drive:
    """How the arm is driven: one joint at a time, or all together.

    Attributes:
        joint: Number of the joint that is driven; None if none is.
        goal: Where the drive ends [rad or m].
        leading: Whether all joints are led to set points.
        point: The set point of the joint [rad or m].
        renewed: When the drive was renewed last [s].
    """

    joint: int | None = None
    goal: float = 0.0
    leading: bool = False
    point: float = 0.0
    renewed: float = -np.inf

    @property
    def active(self) -> bool:
        """Whether the arm is driven."""
        return self.leading or self.joint is not None

    def expired(self, time: float) -> bool:
        """Whether it was not renewed in time."""
        return self.active and time - self.renewed > HOLD_SECONDS

    def goes_on_to(self, joint: int, goal: float) -> bool:
        """Whether a joint is driven already, and in the direction of a goal [rad or m]."""
        turned = self.active and (goal - self.point) * (self.goal - self.point) < 0.0
        return joint == self.joint and not turned and not self.leading

    def begun(self, here: float, time: float) -> Drive:
        """A new drive of a joint that is at a value [rad or m]."""
        return Drive(point=here, renewed=time - FIRST_SECONDS)

    def on(self, joint: int, goal: float, rate: float, here: float, time: float) -> Drive:
        """Driven on towards a goal.

        Args:
            joint: Number of the joint.
            goal: Where it goes at most [rad or m].
            rate: Of the joint [rad/s or m/s].
            here: Where the joint is [rad or m].
            time: Now [s].
        """
        seconds = float(np.clip(time - self.renewed, 0.0, LEASH_SECONDS))
        step = np.clip(goal - self.point, -rate * seconds, rate * seconds)
        leash = rate * LEASH_SECONDS
        point = float(np.clip(self.point + step, here - leash, here + leash))
        return Drive(joint, goal, False, point, max(time, self.renewed))

    def led(self, time: float) -> Drive:
        """All joints are led to set points."""
        return Drive(None, self.goal, True, self.point, max(time, self.renewed))
