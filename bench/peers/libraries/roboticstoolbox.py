"""The Robotics Toolbox (C++ behind Python): Levenberg-Marquardt with random restarts inside the limits."""

from __future__ import annotations

import numpy as np

from bench.peers.description import uncoupled_columns
from bench.peers.ik import Solver
from rrtik_ompl.model.robot import Robot

TOLERANCE = 1e-10  # of half the squared error, which is TRAC-IK's 1e-5; its default 1e-6 leaves 1.4 mm


def solver(robot: Robot, start: np.ndarray) -> Solver:
    """From a pose to a configuration.

    Raises:
        ValueError: If the arm has coupled joints.
    """
    from roboticstoolbox import ET, ETS

    tip = uncoupled_columns(robot)
    steps = [ET.SE3(tip.fixed[0])]
    for k, limits in enumerate(zip(*robot.finite_range(), strict=True)):
        moves = ET.tz if tip.prismatic[k] else ET.Rz
        steps += [moves(qlim=list(limits)), ET.SE3(tip.fixed[k + 1])]
    arm, first = ETS(steps), np.array(start)  # it takes no array that is read-only

    def solve(pose: np.ndarray) -> np.ndarray | None:
        answer = arm.ik_LM(pose, q0=first, tol=TOLERANCE)
        return np.array(answer.q) if answer.success else None

    return solve
