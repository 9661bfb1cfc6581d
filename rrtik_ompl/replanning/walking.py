"""The configuration one tick later: a step along the path, under the speed limits of the joints."""

from __future__ import annotations

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector


def one_step(path: Matrix, step: float, max_change: Vector) -> tuple[Vector, int]:
    """The configuration after a tick, and how many waypoints of the path lie behind it then.

    Args:
        path: Shape (k, n), k at least 2, the robot's configuration first.
        step: Length of a step [unit of the space].
        max_change: How far each joint can move in a tick, shape (n,).
    """
    left = 1.0  # of the tick
    place, passed = path[0], 0
    for end in path[1:]:
        edge = end - place
        share = _share(edge, step, max_change)  # of a tick that the whole edge takes
        if share > left:
            return place + edge * (left / share), passed
        left -= share
        place, passed = end, passed + 1
    return place, passed - 1


def to_first_corner(path: Matrix, step: float, max_change: Vector) -> tuple[Vector, int]:
    """As :func:`one_step`, but no farther than the next waypoint."""
    return one_step(path[:2], step, max_change)


def _share(edge: Vector, step: float, max_change: Vector) -> float:
    """How many ticks an edge takes."""
    with np.errstate(divide="ignore", invalid="ignore"):
        rates = np.where(edge == 0.0, 0.0, np.abs(edge) / max_change)
    return max(float(np.linalg.norm(edge)) / step, float(rates.max()))
