"""TRAC-IK by pytracik (C++; two threads, of which the first to end decides)."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from bench.peers.description import serial_urdf
from bench.peers.ik import Solver
from rrtik_ompl.model.robot import Robot

SECONDS = 0.1  # by the clock, so that a busy machine does not count against it; its default is 0.005


def solver(robot: Robot, start: np.ndarray) -> Solver:
    """From a pose to a configuration.

    Raises:
        ValueError: If it does not see all joints.
    """
    from trac_ik import TracIK

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "arm.urdf")
        file.write_text(serial_urdf(robot))
        solver_of_arm = TracIK("link0", "tip", str(file), timeout=SECONDS)
    if solver_of_arm.dof != robot.dof:
        raise ValueError(f"it sees {solver_of_arm.dof} joints")

    def solve(pose: np.ndarray) -> np.ndarray | None:
        found = solver_of_arm.ik(pose[:3, 3], pose[:3, :3], start)
        return None if found is None else np.array(found)

    return solve
