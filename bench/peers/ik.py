"""Inverse kinematics of others on our arms: each a function from a pose to a configuration, or why it is absent.

All get the same chain from base to tip, as a URDF or as axes and offsets, and the same start. They live with our own
versions of numpy and Pinocchio, so they run in the process that measures.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import TypeAlias

import numpy as np

from rrtik_ompl.model.robot import Robot

Solver: TypeAlias = Callable[[np.ndarray], np.ndarray | None]
NAMES = ("pytracik", "ikpy", "eaik", "roboticstoolbox")  # modules of bench.peers.libraries


def solvers(robot: Robot, start: np.ndarray) -> dict[str, Solver | str]:
    """By name what solves for a pose, shape (4, 4), or a line that says why nothing does."""
    return {name: _made(name, robot, start) for name in NAMES}


def _made(name: str, robot: Robot, start: np.ndarray) -> Solver | str:
    try:
        made: Solver = import_module(f"bench.peers.libraries.{name}").solver(robot, start)
    except ImportError as error:
        return f"absent ({error})"
    except Exception as error:  # what another library makes of our chain is part of the comparison
        return f"{type(error).__name__}: {error}"
    return made
