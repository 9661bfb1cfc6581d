"""Routes with fewer moves on fine grids of all joint values, for arms of which few joints move.

A route that turns back several times has more free values than the lattices of a search hold. Where three joints or
fewer may move, a grid of all of them is small enough. Its motions are checked in steps, which is quick; only those of a
route are proven, and where that fails the grid loses them and is searched again. The search begins without a clearance;
where that finds fewer moves, the largest clearance is looked for that needs no more.
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

# Configurations of one grid after the other, and whether their values are near those of the best route. The largest
# take half a second in the kernels.
GRIDS = ((2**15, False), (2**18, False), (2**16, True), (2**18, False), (2**16, True))
MOST_IDLE = 3  # grids in a row without gain
NEAR = 0.02  # of a joint's range
MOST_JOINTS = 3  # that may move
MOST_PAIRS = 2  # of a start and a goal
MOST_PROOFS = 16  # of routes of one grid
FEW_ROUNDS = 2  # of improvement before the grids, which do more in less time


def rounds_before(rounds: int, joints: Sequence[int]) -> int:
    """How many rounds of improvement to spend where grids come after them, of so many allowed."""
    grids_follow = len(joints) <= MOST_JOINTS
    return min(rounds, FEW_ROUNDS) if grids_follow else rounds


@dataclass(frozen=True, eq=False)
class FineGrids:
    """Where to look for routes, and what they must keep.

    Attributes:
        joints: Those that may move.
        lower: Finite limits, shape (n,).
        upper: Finite limits, shape (n,).
        costs: Cost of each joint's travel, shape (n,).
        smallest_move: No move is shorter, shape (n,).
        levels: Of clearance, the largest first.
        budget: When to end, with the best so far, and the seed of the places of the grids.
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
        """A route with fewer moves than known.

        Args:
            pairs: Of a start and a goal, shapes (n,), that agree in the joints that must not move.
            best_known: The best route so far, shape (k, n), every edge of which is a move.
            lower_bound: No route has fewer moves.

        Returns:
            The route, shape (k, n), and the number of the level that it keeps, the first of `levels` is 0; None if
            there is no such route.
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
                    if len(best_known) - 1 <= lower_bound or grids_without_gain > MOST_IDLE:
                        return best

                    if near_best:
                        values = self._grid_values_near(best_known, nodes, rng)
                        first = best_known[0]
                        last = best_known[-1]
                    else:
                        values = self._grid_values(start, goal, nodes, rng)
                        first = start
                        last = goal

                    found = self._clearest_route(values, first, last, max_moves=len(best_known) - 2)
                    if found is not None:
                        best = found
                        best_known = found[0]
                        grids_without_gain = 0
        return best

    def _grid_values(self, start: Vector, goal: Vector, nodes: int, rng: np.random.Generator) -> Values:
        """As many values of each joint as a grid of so many configurations has, at equal distances."""
        values = values_of(np.array([start, goal]))
        count = self._values_per_joint(nodes)
        for joint in self.joints:
            more = spread_values(float(self.lower[joint]), float(self.upper[joint]), count, rng)
            values[joint] = distinct(np.append(values[joint], more))
        return values

    def _grid_values_near(self, route: Matrix, nodes: int, rng: np.random.Generator) -> Values:
        """The values of a route, and as many close to each as a grid of so many configurations has."""
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
        """Of a grid of so many configurations, rounded down."""
        return int(nodes ** (1.0 / len(self.joints)))

    def _clearest_route(self, values: Values, start: Vector, goal: Vector, max_moves: int) -> tuple[Matrix, int] | None:
        """The route of a grid with the fewest moves, with the largest clearance that needs no more of them.

        Returns:
            The route and the number of its level of clearance; None if no route has at most `max_moves`.
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
        """The route of a grid with the fewest moves, at most `max_moves`, that is proven to keep a level, or None.

        Lazy: the grid is checked in steps; where the proof of a route fails, its segments are closed, and the grid is
        searched again.
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
            if lattice.close_colliding_segments(route, proving) == 0:  # the same route would come again
                return None
        return None
