"""ikpy (Python; scipy's optimizer inside the limits)."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from bench.peers.description import serial_urdf
from bench.peers.ik import Solver
from bench.peers.task import BASE
from rrtik_ompl.model.robot import Robot


def solver(robot: Robot, start: np.ndarray) -> Solver:
    """From a pose to a configuration."""
    from ikpy.chain import Chain

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "arm.urdf")
        file.write_text(serial_urdf(robot))
        mask = [False, *[True] * robot.dof, False]
        chain = Chain.from_urdf_file(str(file), base_elements=[BASE], active_links_mask=mask)
    first = np.concatenate([[0.0], start, [0.0]])

    def solve(pose: np.ndarray) -> np.ndarray | None:
        found = chain.inverse_kinematics_frame(pose, initial_position=first, orientation_mode="all")
        return np.array(found)[1:-1]

    return solve
