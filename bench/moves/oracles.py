"""What the fewest moves of a problem are, or are no fewer than, found apart from the planners and shortening."""

from __future__ import annotations

import numpy as np

from rrtik_ompl.base.arrays import Matrix, positive
from rrtik_ompl.base.budget import no_stop
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.transitions import lower_bound
from rrtik_ompl.planning.moves.lattice import MoveLattice
from rrtik_ompl.planning.moves.lower_bounds import sharper_bound
from rrtik_ompl.planning.moves.search import MoveSearch
from rrtik_ompl.planning.shortening.fewest_moves import turning_limits
from rrtik_ompl.world.problem import Problem

MAX_CELLS = 2_000_000  # of a grid


def least_moves(problem: Problem) -> int:
    """A lower bound of the number of single-joint moves that solve a problem whose goal is a configuration.

    Raises:
        InputError: If the goal is of another kind.
    """
    world = problem.world
    ends = _ends(problem, "least_moves")
    search = MoveSearch(ends[:1], ends[1:], *turning_limits(world.robot, ends), world.motion_valid_batch)
    search.try_corner_routes()
    if search.proven or search.bound == lower_bound(ends[0], ends[1]):  # met, or too many corners
        return search.bound
    return sharper_bound(world, range(world.robot.dof), ends[0], ends[1], no_stop)


def grid_route(problem: Problem, step: float) -> Matrix | None:
    """The route with the fewest moves on a regular grid, least travel second: the oracle of [1, ch. 6.3].

    Args:
        problem: Of at most 3 joints, its goal a configuration.
        step: Of the grid [rad or m]; the values of start and goal are added to it.

    Returns:
        Shape (moves + 1, n); None if the grid has no route.

    Raises:
        InputError: If there are more joints, the goal is of another kind, or the grid would be too large.
    """
    world = problem.world
    ends = _ends(problem, "grid_route")
    if world.robot.dof > 3:
        raise InputError(f"grid_route: expected at most 3 joints, got {world.robot.dof}")
    positive(step, "grid_route: step")

    lower, upper = turning_limits(world.robot, ends)
    size = float(np.prod((upper - lower) / step + 2.0))
    if size > MAX_CELLS:
        raise InputError(f"grid_route: {size:.1e} cells are too many (at most {MAX_CELLS:.0e}); use a larger step")

    limits = zip(lower, upper, ends.T, strict=True)
    values = [np.union1d(np.linspace(low, high, int((high - low) / step) + 1), both) for low, high, both in limits]
    lattice = MoveLattice(values, world.motion_valid_batch, np.ones(world.robot.dof))
    return lattice.best_route(ends[0], ends[1], range(world.robot.dof))


def _ends(problem: Problem, what: str) -> Matrix:
    """Start and goal of a problem, shape (2, n)."""
    if problem.goal.q is None:
        raise InputError(f"{what}: expected a goal in joint values, got a {type(problem.goal).__name__}")
    return np.array([problem.start, problem.goal.q])
