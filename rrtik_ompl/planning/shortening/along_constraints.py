"""Shortcuts under path constraints: walks along the constraints from one waypoint straight towards a later one.

Source: the shortcuts of [17, section 5] for paths of CBiRRT2.
"""

from __future__ import annotations

import numpy as np

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.ik.held_tables import held_tables
from rrtik_ompl.kernels.search.constrained.search import ConstrainedSearch
from rrtik_ompl.model.transitions import route_length
from rrtik_ompl.planning.shortening.task import Task, box_around
from rrtik_ompl.world.motion_queries import decider, keeps_constraints
from rrtik_ompl.world.problem import Problem

TRIES = 200  # limit of the tries
PATIENCE = 40  # tries in a row without a gain that end the work
SHORTER = 1e-6  # [rad or m] least gain of a shortcut


def along_constraints(route: Matrix, task: Task, problem: Problem) -> Matrix:
    """Shorten a route, shape (k, n), by random shortcuts, each a walk along the constraints of a problem.

    The shortcut from start to goal is tried first. If the world has no kernels the route stays as it is.
    """
    world = problem.world
    if not keeps_constraints(world) or (motions := world.free_motions) is None:
        return route
    tables = held_tables(world.robot, world.constraints)
    if tables is None:
        return route

    lower, upper = box_around(world, route)
    search = ConstrainedSearch(motions, tables.held, lower, upper, shortest=tables.shortest)
    ask = decider(world, world.motion_valid_batch)
    rng = np.random.default_rng(task.seed)

    failures = 0
    pair = (0, len(route) - 1)
    for _ in range(TRIES):
        if failures >= PATIENCE or len(route) < 3 or task.expired():
            break

        # Walk from one waypoint towards the other, and keep the walk if it is shorter.
        i, j = pair
        walk = search.connect(route[i], route[j], ask=ask) if j > i + 1 else None
        task.asked += int(search.statistics()["motions"])
        failures += 1
        if walk is not None and route_length(walk) < route_length(route[i : j + 1]) - SHORTER:
            route = np.vstack([route[:i], walk, route[j + 1 :]])
            failures = 0
            task.report(route)

        # Draw the next pair of waypoints.
        first, second = rng.integers(len(route), size=2)
        pair = int(min(first, second)), int(max(first, second))
    return route
