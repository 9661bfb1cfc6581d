"""A trajectory on a Franka arm, by pylibfranka (the Python side of libfranka); without a host, on a stub.

Usage: ``python examples/follow_libfranka.py [HOST]``. The arm lifts its hand a little and comes back. The robot sets
the pace: 1,000 set points a second, of which it rejects what exceeds its limits of jerk or jumps.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

import rrtik_ompl as rrtik

TICK = 1e-3  # [s] of the robot's control


class FrankaLink:
    """An arm under joint position control.

    Args:
        control: What ``robot.start_joint_position_control(mode)`` gives: it has ``readOnce`` and ``writeOnce``.
        positions: Makes a set point of seven numbers: ``pylibfranka.JointPositions``.
    """

    def __init__(self, control: Any, positions: Any) -> None:
        self._control, self._set_point = control, positions
        self._state, _ = control.readOnce()
        self.last = False

    def positions(self) -> np.ndarray:
        """The joint values that the robot follows now, shape (7,) [rad]."""
        return np.array(self._state.q_d)

    def command(self, q: np.ndarray, t: float) -> None:
        """Send a set point, and wait until the robot wants the next one."""
        wanted = self._set_point(q.tolist())
        wanted.motion_finished = self.last
        self._control.writeOnce(wanted)
        self._state, _ = self._control.readOnce()


class StubPositions:
    """Seven numbers, and whether they are the last ones."""

    def __init__(self, q: list[float]) -> None:
        self.q, self.motion_finished = q, False


class StubControl:
    """An arm that is where it was told to be, and rejects what a Franka rejects: jerks above the limit."""

    def __init__(self, robot: rrtik.Robot) -> None:
        self.q_d = robot.posture("default").tolist()
        self._rows, self._jerk = [np.array(self.q_d)] * 3, robot.jerk

    def readOnce(self) -> tuple[Any, float]:
        """State and time since the last one."""
        return self, TICK

    def writeOnce(self, wanted: StubPositions) -> None:
        """Take a set point."""
        self._rows = [*self._rows[-3:], np.array(wanted.q)]
        jerks = np.abs(np.diff(self._rows, 3, axis=0)) / TICK**3
        if (jerks > self._jerk).any():
            raise RuntimeError("joint_motion_generator_acceleration_discontinuity")
        self.q_d = wanted.q


def opened(host: str | None, robot: rrtik.Robot) -> FrankaLink:
    """The link to an arm, or to a stub."""
    if host is None:
        return FrankaLink(StubControl(robot), StubPositions)
    import pylibfranka

    arm = pylibfranka.Robot(host)
    mode = pylibfranka.ControllerMode.JointImpedance
    return FrankaLink(arm.start_joint_position_control(mode), pylibfranka.JointPositions)


def main() -> int:
    """Follow a small motion."""
    robot = rrtik.load_robot("panda")
    world = rrtik.World(robot)
    link = opened(sys.argv[1] if len(sys.argv) > 1 else None, robot)
    here = link.positions()
    up, aside = np.array([0, -0.2, 0, 0.2, 0, 0.3, 0]), np.array([0.3, 0, 0, 0, 0, 0, 0])
    path = rrtik.JointPath.of(robot, [here, here + up, here + up + aside, here])
    if faults := path.violations(world):
        print(f"the way is not free: {faults[0].reason}")
        return 1
    limits = rrtik.RateLimits.of(robot, share=0.3)
    motion = rrtik.time_parameterize(path, limits, blend=0.1, world=world)
    print(motion.report(limits))
    follower = rrtik.following.Follower(motion, link, limits=limits, rate=1.0 / TICK)
    while not follower.ended:
        link.last = follower.place + TICK >= motion.duration
        follower.step(TICK)
    print("arrived" if follower.result.arrived else f"stopped: {follower.result.reason}")
    return 0 if follower.result.arrived else 1


if __name__ == "__main__":
    sys.exit(main())
