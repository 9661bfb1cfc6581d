"""One length for how far a tip is from a pose: its way, and its turn at the lever of half the arm's reach."""

from __future__ import annotations

import numpy as np

from rrtik_ompl.model.robot import Robot

PER_RADIAN = 0.5  # [reach/rad]: two radians count as much as the whole reach


def reach_of(robot: Robot) -> float:
    """Unit of length of an arm [m]: all offsets between its joints in a row."""
    return float(np.linalg.norm(robot.chain.placement[:, :3, 3], axis=1).sum()) or 1.0


def metres_per_radian(robot: Robot) -> float:
    """What a turn of the tip counts beside its way [m/rad]."""
    return PER_RADIAN * reach_of(robot)
