"""The pilot's arms as links that take set points of a trajectory."""

from __future__ import annotations

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.pilot.devices.arm import SimulatedArm
from rrtik_ompl.pilot.devices.line_arm import LineArm


class ArmLink:
    """A simulated arm, or one on the other side of a connection, that follows a trajectory."""

    def __init__(self, arm: SimulatedArm | LineArm) -> None:
        self.arm = arm

    def positions(self) -> Vector:
        """Joint values now, shape (dof,)."""
        return self.arm.read()

    def command(self, q: Vector, t: float) -> None:
        """Send all joints to a set point."""
        self.arm.follow(q)
