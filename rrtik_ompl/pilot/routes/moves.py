"""Routes of few single-joint moves between two configurations, and variants of them with more clearance.

They are searched for on small lattices of joint values: the corners between start and goal, then further values of one
joint after the other. Only where those hold no route a planner is called.
Source: [1, ch. 6 and 6.3] (lists of single-joint moves).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache
from typing import Any

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.ompl_bridge.planner_traits import planners_with
from rrtik_ompl.pilot.routes.no_route import NoRoute
from rrtik_ompl.planning.moves.lattice import MoveLattice
from rrtik_ompl.planning.moves.values import Values, lattice_size, spread_values, values_of
from rrtik_ompl.planning.plan import plan
from rrtik_ompl.planning.shortening.fewest_moves import turning_limits
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

PLANNER_SECONDS = 5.0
MAX_CORNERS = 256  # of a lattice of moves
FURTHER_VALUES = 24  # of a joint
DETOUR_STEPS = (-16.0, -8.0, -4.0, 4.0, 8.0, 16.0)  # small errors by which a detour is made larger or smaller


def direct_routes(world: World, start: Vector, goal: Vector, orders: Sequence[Sequence[int]]) -> list[Matrix]:
    """Routes in which every joint moves once at most, shape (moves + 1, dof); none if that is not free.

    Args:
        world: In which they are to be free.
        start: Shape (dof,).
        goal: Shape (dof,).
        orders: For each route all joints; of several equally good routes the one whose last moves come first here.
    """
    values = values_of(np.array([start, goal]))
    return _routes(world, start, goal, values, orders) if lattice_size(values) <= MAX_CORNERS else []


def detours(world: World, start: Vector, goal: Vector, order: Sequence[int], rng: np.random.Generator) -> list[Matrix]:
    """Routes in which one joint takes further values in between, for each joint the best; see `direct_routes`."""
    ends = np.array([start, goal])
    if lattice_size(values_of(ends)) > MAX_CORNERS:
        return []

    lower, upper = turning_limits(world.robot, ends)

    routes: list[Matrix] = []
    for joint in range(world.robot.dof):
        values = values_of(ends)
        further = spread_values(float(lower[joint]), float(upper[joint]), FURTHER_VALUES, rng)
        values[joint] = np.union1d(values[joint], further)
        routes += _routes(world, start, goal, values, [order])
    return routes


def planned(world: World, start: Vector, goal: Vector, seed: int) -> Matrix | NoRoute:
    """A planner's route, shape (moves + 1, dof), or the reason why there is none.

    Raises:
        ProblemError: If the start or the goal is not free.
        InputError: If no package offers a planner that suits.
    """
    planner, options = _planner()
    result = plan(Problem(world, start, goal), planner, seconds=PLANNER_SECONDS, seed=seed, parameters=options)
    return NoRoute(result.reason) if result.path is None else result.path.waypoints


def moved_aside(world: World, route: Matrix, slack: Vector) -> Iterator[Matrix]:
    """The same route with another value where a joint makes a detour, as far as it is free. Shape (moves + 1, dof).

    Args:
        world: In which they are to be free.
        route: Shape (moves + 1, dof).
        slack: Small errors of the joints, shape (dof,) [rad or m].
    """
    for joint, column in enumerate(route.T):
        for value in np.setdiff1d(column, column[[0, -1]]):
            for step in DETOUR_STEPS:
                other = route.copy()
                other[column == value, joint] = value + step * slack[joint]
                if world.motion_valid_batch(other[:-1], other[1:]).all():
                    yield other


@cache
def _planner() -> tuple[str, dict[str, Any]]:
    """The planner of single-joint moves that can be told to be brief, and the options that tell it.

    Raises:
        InputError: If no package offers one.
    """
    for name, traits in planners_with(lambda traits: traits.one_joint and traits.brief_options).items():
        return name, dict(traits.brief_options)
    raise InputError("no installed planner moves one joint at a time and has brief_options; install rrtik-ompl whole")


def _routes(world: World, start: Vector, goal: Vector, values: Values, orders: Sequence[Sequence[int]]) -> list[Matrix]:
    lattice = MoveLattice(values, world.motion_valid_batch, np.ones(world.robot.dof))
    best_routes = [lattice.best_route(start, goal, order) for order in orders]

    different = {route.tobytes(): route for route in best_routes if route is not None}
    return list(different.values())
