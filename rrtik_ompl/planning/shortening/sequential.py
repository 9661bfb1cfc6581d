"""Sequential cut: from each waypoint straight to the last one that can be reached. Source: [1, ch. 5.3, method 1]."""

from __future__ import annotations

import numpy as np

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.model.transitions import without_repeats
from rrtik_ompl.planning.shortening.task import Task


def sequential_cut(route: Matrix, task: Task) -> Matrix:
    """Cut a route, shape (k, n), from its start; deterministic.

    Waypoints are tried from the last one on back to the next, which needs no check.
    """
    cut_route = [route[:1]]
    pivot = 0
    last = len(route) - 1
    while pivot < last:
        found = task.first_link(route[pivot], route[last : pivot + 1 : -1])
        if found is None:
            cut_route.append(route[pivot + 1 : pivot + 2])
            pivot += 1
        else:
            cut_route.append(found[1])
            pivot = last - found[0]
        task.report(np.vstack([*cut_route, route[pivot + 1 :]]))
    return without_repeats(np.vstack(cut_route))
