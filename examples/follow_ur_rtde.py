"""A trajectory on an arm of Universal Robots, by ur_rtde; without a host, on a stub.

Usage: ``python examples/follow_ur_rtde.py [HOST]``. The arm moves its wrist a little and comes back. ``pip install
ur_rtde`` for a real arm. The robot here is a UR5; load your own.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

import rrtik_ompl as rrtik

RATE = 125.0  # set points a second; 500 for an e-series


class UrLink:
    """An arm behind ur_rtde's two interfaces.

    Args:
        control: ``rtde_control.RTDEControlInterface(host)``, or what has its ``servoJ`` and ``servoStop``.
        receive: ``rtde_receive.RTDEReceiveInterface(host)``, or what has its ``getActualQ``.
    """

    def __init__(self, control: Any, receive: Any) -> None:
        self._control, self._receive = control, receive

    def positions(self) -> np.ndarray:
        """Joint values now, shape (6,) [rad]."""
        return np.array(self._receive.getActualQ())

    def command(self, q: np.ndarray, t: float) -> None:
        """Send a set point: speed and acceleration are not used by servoJ; time, look-ahead and gain are."""
        self._control.servoJ(q.tolist(), 0.0, 0.0, 1.0 / RATE, 0.1, 300.0)

    def close(self) -> None:
        """End the servo mode."""
        self._control.servoStop()


class Stub:
    """Both interfaces of an arm that is where it was told to be."""

    def __init__(self, q: np.ndarray) -> None:
        self.q = q.tolist()

    def servoJ(self, q: list[float], speed: float, push: float, time: float, ahead: float, gain: float) -> bool:
        """Take a set point."""
        self.q = q
        return True

    def servoStop(self) -> bool:
        """End."""
        return True

    def getActualQ(self) -> list[float]:
        """Where it is."""
        return list(self.q)


def interfaces(host: str | None) -> tuple[Any, Any]:
    """Those of the arm, or a stub's."""
    if host is None:
        stub = Stub(np.array([0.0, -1.2, 1.0, -1.0, 0.5, 0.0]))
        return stub, stub
    from rtde_control import RTDEControlInterface
    from rtde_receive import RTDEReceiveInterface

    return RTDEControlInterface(host), RTDEReceiveInterface(host)


def main() -> int:
    """Follow a small motion."""
    link = UrLink(*interfaces(sys.argv[1] if len(sys.argv) > 1 else None))
    robot = rrtik.load_robot("ur5")
    world = rrtik.World(robot)
    here = link.positions()
    nod, turn = np.array([0, 0, 0, 0.2, 0, 0]), np.array([0, 0, 0, 0, 0.2, 0])
    path = rrtik.JointPath.of(robot, [here, here + nod, here + nod + turn, here])
    if faults := path.violations(world):
        print(f"the way is not free: {faults[0].reason}")
        return 1
    limits = rrtik.RateLimits.of(robot, share=0.3)
    motion = rrtik.time_parameterize(path, limits, blend=0.1, world=world, tip_speed=0.25)
    print(motion.report(limits))
    found = rrtik.following.Follower(motion, link, limits=limits, rate=RATE).run()
    link.close()
    print("arrived" if found.arrived else f"stopped: {found.reason}")
    return 0 if found.arrived else 1


if __name__ == "__main__":
    sys.exit(main())
