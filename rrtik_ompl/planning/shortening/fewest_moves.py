"""The method "fewest-moves": improve a route of single-joint moves, and bound the number of moves of any route."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rrtik_ompl.base.arrays import TAU, Matrix, Vector
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.transitions import lower_bound, merge_moves, single_joint, transitions
from rrtik_ompl.planning.moves.clearance_levels import Level, clearance_levels
from rrtik_ompl.planning.moves.fine_grids import FineGrids, rounds_before
from rrtik_ompl.planning.moves.lower_bounds import reach_bound, remembered
from rrtik_ompl.planning.moves.rules import MoveRules
from rrtik_ompl.planning.moves.search import MoveSearch, Proof
from rrtik_ompl.world.world import World

MAX_IMPROVEMENT_ROUNDS = 10


@dataclass(frozen=True, slots=True, eq=False)
class MovesFound:
    """A route of single-joint moves with a lower bound.

    Attributes:
        route: Shape (k, n), start first.
        moves: Number of its moves.
        bound: Lower bound of the moves of any route between its ends.
    """

    route: Matrix
    moves: int
    bound: int


def fewest_moves(
    route: Matrix,
    world: World,
    *,
    rounds: int = MAX_IMPROVEMENT_ROUNDS,
    budget: Budget | None = None,
    rules: MoveRules | None = None,
    clearance: float | None = None,
) -> MovesFound:
    """Search for a route with fewer moves, or with as many moves and less travel.

    The search runs on levels of clearance, the largest first; a level with less clearance has to save a move. Fine
    grids follow if the number of moves is not yet proven to be the fewest. The motions of the route are proven free.

    Args:
        route: A free route, shape (k, n), every edge of which moves one joint.
        world: Checks motions.
        rounds: Limit of the rounds of improvement; the work ends earlier if it is proven that no route has fewer moves.
            The same number and seed give the same route.
        budget: When to end with the best route so far, and the seed of all random choices; None for no end.
        rules: Rules that the route keeps and the result has to keep. Joints that move last stay where they are.
        clearance: Clearance from obstacles that is wanted on top of their margins [m]; None for a centimetre. Less is
            kept where more moves would be needed, or where the ends have less.

    Returns:
        A route with the same ends, bit for bit, that is no worse. Its bound is the number of joints that differ, or
        more where that many moves are proven not to be enough (:mod:`rrtik_ompl.planning.moves.lower_bounds`), which is
        never proven for more than 12 such joints.

    Raises:
        InputError: If an edge moves several joints.
    """
    if len(route) > 1 and not single_joint(route[np.append(True, (np.diff(route, axis=0) != 0.0).any(axis=1))]):
        raise InputError(
            "path to shorten: an edge moves several joints at once; use one_joint_moves(path, problem) first"
        )

    move_rules = MoveRules.of_robot(world.robot) if rules is None else rules
    budget = Budget() if budget is None else budget
    work = _Work(route, world, move_rules, rounds, budget)
    levels = clearance_levels(world, route[[0, -1]], clearance)

    best = route
    bound = lower_bound(route[0], route[-1])
    moves_to_save = 0  # 1 once `best` is from a level
    for level in levels:
        if moves_to_save > 0 and (transitions(best) == bound or budget.over()):
            break
        search = work.search_level(level, best)
        bound = max(bound, search.bound)
        if search.route is not None and transitions(search.route) <= transitions(best) - moves_to_save:
            best = search.route
            moves_to_save = 1

    if transitions(best) > bound and rounds > 0 and not budget.over():
        best, bound = work.search_fine_grids(levels, best, bound)
    return MovesFound(best, transitions(best), bound)


@dataclass(frozen=True, eq=False)
class _Work:
    """Arguments of :func:`fewest_moves`."""

    rows: Matrix
    world: World
    rules: MoveRules
    rounds: int
    budget: Budget

    @property
    def joints(self) -> list[int]:
        """Indices of the joints that may move."""
        resting = [*self.rules.frozen_joints, *self.rules.last_joints]
        return [joint for joint in range(self.world.robot.dof) if joint not in resting]

    @cached_property
    def sharper_bound_of_ends(self) -> Proof:
        """A function that sharpens the bound between a start and a goal; its cache serves all levels."""
        return remembered(self.world, self.joints, self.budget.over)

    def search_level(self, level: Level, offered: Matrix) -> MoveSearch:
        """Search on a level of clearance, beginning with the offered route if that keeps the level."""
        search = MoveSearch(
            self.rows[:1],
            self.rows[-1:],
            *turning_limits(self.world.robot, self.rows),
            level.proving.motion_valid_batch,
            budget=self.budget,
            costs=self.rules.joint_costs,
            frozen=[*self.rules.frozen_joints, *self.rules.last_joints],
            smallest_move=self.rules.smallest_move,
            prove=self.sharper_bound_of_ends,
            all_free=self.world.motion_valid_batch,
        )
        if _keeps_level(level, offered):
            search.offer(offered)
        search.try_corner_routes()
        search.improve(rounds_before(self.rounds, self.joints))
        return search

    def search_fine_grids(self, levels: list[Level], best: Matrix, bound: int) -> tuple[Matrix, int]:
        """Search for fewer moves on fine grids.

        Returns:
            The best route, shape (k, n), which may be the given one, and a lower bound of the moves that is at least
            the given one.
        """
        ends = self.rows[0], self.rows[-1]
        limits = turning_limits(self.world.robot, self.rows)
        bound = max(bound, reach_bound(self.world, self.joints, *ends, transitions(best), self.budget.over))
        grids = FineGrids(self.joints, *limits, self.rules.joint_costs, self.rules.smallest_move, levels, self.budget)
        found = grids.route([ends], merge_moves(best, tolerance=0.0), bound)
        if found is None:
            return best, bound

        route, level = found
        search = self.search_level(levels[level], route)
        if search.route is not None:
            best = search.route
        return best, max(bound, search.bound)


def _keeps_level(level: Level, route: Matrix) -> bool:
    """Check whether the motions of a route keep a level."""
    return bool(level.proving.motion_valid_batch(route[:-1], route[1:]).all())


def turning_limits(robot: Robot, rows: Matrix) -> tuple[Vector, Vector]:
    """Return finite lower and upper limits of the joints, shapes (n,).

    A joint without limits may turn one turn farther than the rows, shape (k, n), do.
    """
    lower = np.where(np.isfinite(robot.lower), robot.lower, rows.min(axis=0) - TAU)
    upper = np.where(np.isfinite(robot.upper), robot.upper, rows.max(axis=0) + TAU)
    return lower, upper
