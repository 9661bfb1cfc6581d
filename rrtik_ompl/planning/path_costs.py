"""What a path costs, and what no path of a problem costs less than: what `plan(improve=)` makes small."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TypeAlias

import numpy as np

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.base.choices import PathObjective
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.description.joint_weights import weights_of
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.transitions import route_length
from rrtik_ompl.ompl_bridge.weighted import has_weights
from rrtik_ompl.world.clearance_curve import distances_at, places_along
from rrtik_ompl.world.problem import Problem

NEAREST = 1e-3  # [m] clearances below this cost no more
DOUBLE = 0.05  # [m] the clearance at which a piece of a path counts double

PathCost: TypeAlias = Callable[[JointPath, Problem], float]


def length(path: JointPath, problem: Problem) -> float:
    """Length in joint space, each joint's way multiplied by its weight [rad; m]."""
    return route_length(path.waypoints * _weights(problem))


def least_time(path: JointPath, problem: Problem) -> float:
    """Time [s] that the robot needs at least: of each motion the slowest joint at its velocity limit.

    Raises:
        InputError: If the robot has no velocity limit.
    """
    return float(_seconds(np.diff(path.waypoints, axis=0), problem.robot).sum())


def weighted_length(path: JointPath, problem: Problem) -> float:
    """Weighted length in joint space, where each piece counts ``1 + 0.05 m / clearance`` times [rad; m].

    The clearance is proven at 240 places on the path, so the true one is no smaller.
    """
    rows = path.waypoints
    motions, shares, places = places_along(problem.world, rows)
    distances = distances_at(problem.world, places)

    lengths = np.append(np.linalg.norm(np.diff(rows * _weights(problem), axis=0), axis=1), 0.0)
    ends = np.append(np.where(motions[1:] == motions[:-1], shares[1:], 1.0), 1.0)
    pieces = lengths[np.minimum(motions, len(lengths) - 1)] * (ends - shares)
    return float(pieces @ (1.0 + DOUBLE / np.maximum(distances, NEAREST)))


COSTS: Mapping[PathObjective, PathCost] = MappingProxyType(
    {"length": length, "time": least_time, "clearance": weighted_length}
)


def least_cost(problem: Problem, objective: PathObjective) -> float:
    """What no path costs less than: that of the straight motion to a goal in joint values; 0 for any other goal."""
    q = problem.goal.q
    if q is None:
        return 0.0
    span = q - problem.start
    if objective == "time":
        return float(_seconds(span[None], problem.robot)[0])
    return float(np.linalg.norm(span * _weights(problem)))


def _weights(problem: Problem) -> Vector | float:
    """How much each joint counts in lengths, shape (dof,); all alike where there are no weights."""
    return weights_of(problem.robot) if has_weights(problem) else 1.0


def _seconds(motions: np.ndarray, robot: Robot) -> Vector:
    """Least time of each motion, shapes (m, dof) and (m,)."""
    if not np.isfinite(robot.velocity).any():
        raise InputError(f"objective 'time': robot '{robot.name}' has no velocity limits; give them in its URDF")
    seconds: Vector = (np.abs(motions) / robot.velocity).max(axis=1, initial=0.0)
    return seconds
