"""Where the robot can be one tick later: a step along its path, under the speed limits of its joints."""

from __future__ import annotations

import numpy as np

from rrtik_ompl.arrays import Matrix, Vector


def one_step(path: Matrix, step: float, most: Vector) -> tuple[Vector, int]:
    """The point that a tick leads to, and how many waypoints of the path lie behind it then.

    Args:
        path: Shape (k, n), k at least 2, the robot's place first.
        step: Length of a step [unit of the space].
        most: How far each joint can move in a tick, shape (n,).
    """
    left = 1.0  # of the tick
    place, passed = path[0], 0
    for end in path[1:]:
        way = end - place
        share = _share(way, step, most)  # of a tick that the whole edge takes
        if share > left:
            return place + way * (left / share), passed
        left -= share
        place, passed = end, passed + 1
    return place, passed - 1


def to_first_corner(path: Matrix, step: float, most: Vector) -> tuple[Vector, int]:
    """As :func:`one_step`, but no farther than the next waypoint."""
    return one_step(path[:2], step, most)


def _share(way: Vector, step: float, most: Vector) -> float:
    """How many ticks a straight way takes."""
    with np.errstate(divide="ignore", invalid="ignore"):
        rates = np.where(way == 0.0, 0.0, np.abs(way) / most)
    return max(float(np.linalg.norm(way)) / step, float(rates.max()))
