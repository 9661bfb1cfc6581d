"""Routes with fewer moves on fine grids of all joint values, for arms with at most three joints that may move.

A route that turns back several times has more free values than the lattices of a search can hold. With three joints or
fewer, a grid of all their values is small enough. The motions of a grid are checked in steps, which is quick, and only
those of a found route are proven. Where that fails, the grid loses these motions and is searched again. The search
begins without a clearance; if it finds fewer moves, the largest clearance that needs no more moves is chosen.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector, distinct
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.planning.moves.clearance_levels import Level
from rrtik_ompl.planning.moves.lattice import MoveLattice, Values, spread_values, values_of
from rrtik_ompl.planning.moves.rules import long_enough
from rrtik_ompl.world.motion_queries import BatchedMotionQueries, OutOfTime

# The grids in their order: number of configurations, and whether their values are near those of the best route. The
# largest take half a second in the kernels.
GRIDS = ((2**15, False), (2**18, False), (2**16, True), (2**18, False), (2**16, True))
MOST_IDLE = 3  # grids in a row without a gain before the search ends
NEAR = 0.02  # greatest distance of values near a route, as a share of the joint's range
MOST_JOINTS = 3  # largest number of joints that may move
MOST_PAIRS = 2  # pairs of a start and a goal that are tried
MOST_PROOFS = 16  # routes of one grid that are proven
FEW_ROUNDS = 2  # rounds of improvement before the grids, which gain more in less time


def rounds_before(rounds: int, joints: Sequence[int]) -> int:
    """Return how many rounds of improvement to make: ``rounds``, but fewer if grids follow."""
    grids_follow = len(joints) <= MOST_JOINTS
    return min(rounds, FEW_ROUNDS) if grids_follow else rounds


@dataclass(frozen=True, eq=False)
class FineGrids:
    """The settings of a search on fine grids: the joints, their limits and costs, and the clearances.

    Attributes:
        joints: The joints that may move.
        lower: Finite limits, shape (n,).
        upper: Finite limits, shape (n,).
        costs: Cost of each joint's travel, shape (n,).
        smallest_move: No move is shorter, shape (n,).
        levels: Levels of clearance, the largest first.
        budget: When to end with the best route so far, and the seed that places the grids.
    """

    joints: Sequence[int]
    lower: Vector
    upper: Vector
    costs: Vector
    smallest_move: Vector
    levels: Sequence[Level]
    budget: Budget

    def route(
        self, pairs: Sequence[tuple[Vector, Vector]], best_known: Matrix, lower_bound: int
    ) -> tuple[Matrix, int] | None:
        """Search for a route with fewer moves than the best known one.

        Args:
            pairs: Pairs of a start and a goal, shapes (n,), that agree in the joints that must not move.
            best_known: The best route so far, shape (k, n); every edge is a move.
            lower_bound: Lower bound of the moves of any route.

        Returns:
            The route, shape (k, n), and the index of the level of clearance that it keeps; None if no such route was
            found.
        """
        best: tuple[Matrix, int] | None = None
        if not 0 < len(self.joints) <= MOST_JOINTS:
            return best

        rng = np.random.default_rng(self.budget.seed)
        with suppress(OutOfTime):
            grids_without_gain = 0
            for nodes, near_best in GRIDS:
                grids_without_gain += 1
                for start, goal in pairs[:MOST_PAIRS]:
                    # Stop at the lower bound, or if several grids have gained nothing.
                    if len(best_known) - 1 <= lower_bound or grids_without_gain > MOST_IDLE:
                        return best

                    # Choose the values of the grid and the ends of its route.
                    if near_best:
                        values = self._grid_values_near(best_known, nodes, rng)
                        first = best_known[0]
                        last = best_known[-1]
                    else:
                        values = self._grid_values(start, goal, nodes, rng)
                        first = start
                        last = goal

                    # A route has to save at least one move.
                    found = self._clearest_route(values, first, last, max_moves=len(best_known) - 2)
                    if found is not None:
                        best = found
                        best_known = found[0]
                        grids_without_gain = 0
        return best

    def _grid_values(self, start: Vector, goal: Vector, nodes: int, rng: np.random.Generator) -> Values:
        """Return equally spaced values of each joint for a grid of ``nodes`` configurations, with start and goal."""
        values = values_of(np.array([start, goal]))
        count = self._values_per_joint(nodes)
        for joint in self.joints:
            more = spread_values(float(self.lower[joint]), float(self.upper[joint]), count, rng)
            values[joint] = distinct(np.append(values[joint], more))
        return values

    def _grid_values_near(self, route: Matrix, nodes: int, rng: np.random.Generator) -> Values:
        """Return the values of a route, and values close to each of them for a grid of ``nodes`` configurations."""
        values = values_of(route)
        count = self._values_per_joint(nodes)
        for joint in self.joints:
            of_route = values[joint]
            low = float(self.lower[joint])
            high = float(self.upper[joint])
            offsets = NEAR * (high - low) * spread_values(-1.0, 1.0, max(count // len(of_route), 1), rng)
            values[joint] = distinct(np.append(of_route, np.clip(np.add.outer(of_route, offsets).ravel(), low, high)))
        return values

    def _values_per_joint(self, nodes: int) -> int:
        """Return how many values each joint has in a grid of ``nodes`` configurations, rounded down."""
        return int(nodes ** (1.0 / len(self.joints)))

    def _clearest_route(self, values: Values, start: Vector, goal: Vector, max_moves: int) -> tuple[Matrix, int] | None:
        """Return the route of a grid with the fewest moves, with the largest clearance that needs no more of them.

        Returns:
            The route and the index of its level of clearance; None if no route has at most `max_moves`.
        """
        last_level = len(self.levels) - 1
        route = self._proven_route(self.levels[last_level], values, start, goal, max_moves)
        if route is None:
            return None

        for number, level in enumerate(self.levels[:last_level]):
            clear = self._proven_route(level, values, start, goal, len(route) - 1)
            if clear is not None:
                return clear, number
        return route, last_level

    def _proven_route(self, level: Level, values: Values, start: Vector, goal: Vector, max_moves: int) -> Matrix | None:
        """Return the route of a grid with the fewest moves that is proven to keep a level; None without one.

        The grid is checked in steps, and only the motions of a route are proven. Segments whose proof fails are closed,
        and the grid is searched again. The route has at most `max_moves` moves.

        Args:
            level: Level of clearance.
            values: For each joint the values of the grid.
            start: Shape (n,).
            goal: Shape (n,).
            max_moves: Limit of the moves of the route.
        """
        in_steps = BatchedMotionQueries(level.searched.motion_valid_batch, self.budget.over)
        proving = BatchedMotionQueries(level.proving.motion_valid_batch, self.budget.over)
        lattice = MoveLattice(values, in_steps, self.costs)

        for _ in range(MOST_PROOFS):
            route = lattice.best_route(start, goal, range(len(start)), max_moves)
            if route is None or not long_enough(route, self.smallest_move):
                return None
            if proving(route[:-1], route[1:]).all():
                return route
            # Without a closed segment the same route would be found again.
            if lattice.close_colliding_segments(route, proving) == 0:
                return None
        return None
