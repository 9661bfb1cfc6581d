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
from rrtik_ompl.planning.moves.lattice import MoveLattice
from rrtik_ompl.planning.moves.rules import long_enough
from rrtik_ompl.planning.moves.values import Values, spread_values, values_of
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
    return min(rounds, FEW_ROUNDS) if len(joints) <= MOST_JOINTS else rounds


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

    def route(self, pairs: Sequence[tuple[Vector, Vector]], known: Matrix, least: int) -> tuple[Matrix, int] | None:
        """A route with fewer moves than known, and the number of the level that it keeps, or None.

        Args:
            pairs: Of a start and a goal, shapes (n,), that agree in the joints that must not move.
            known: The best route so far, shape (k, n), every edge of which is a move.
            least: No route has fewer moves.
        """
        best: tuple[Matrix, int] | None = None
        if not 0 < len(self.joints) <= MOST_JOINTS:
            return best

        rng = np.random.default_rng(self.budget.seed)
        with suppress(OutOfTime):
            idle = 0
            for nodes, near in GRIDS:
                idle += 1
                for start, goal in pairs[:MOST_PAIRS]:
                    if len(known) - 1 <= least or idle > MOST_IDLE:
                        return best

                    values = self._values_near(known, nodes, rng) if near else self._values(start, goal, nodes, rng)
                    first, last = (known[0], known[-1]) if near else (start, goal)

                    found = self._kept(values, first, last, len(known) - 2)
                    if found is not None:
                        best = found
                        known = found[0]
                        idle = 0
        return best

    def _values(self, start: Vector, goal: Vector, nodes: int, rng: np.random.Generator) -> Values:
        """As many values of each joint as a grid of so many configurations has, at equal distances."""
        values = values_of(np.array([start, goal]))
        each = self._each(nodes)
        for joint in self.joints:
            more = spread_values(float(self.lower[joint]), float(self.upper[joint]), each, rng)
            values[joint] = distinct(np.append(values[joint], more))
        return values

    def _values_near(self, route: Matrix, nodes: int, rng: np.random.Generator) -> Values:
        """The values of a route, and as many close to each as a grid of so many configurations has."""
        values = values_of(route)
        each = self._each(nodes)
        for joint in self.joints:
            own = values[joint]
            low = float(self.lower[joint])
            high = float(self.upper[joint])
            aside = NEAR * (high - low) * spread_values(-1.0, 1.0, max(each // len(own), 1), rng)
            values[joint] = distinct(np.append(own, np.clip(np.add.outer(own, aside).ravel(), low, high)))
        return values

    def _each(self, nodes: int) -> int:
        return int(nodes ** (1.0 / len(self.joints)))

    def _kept(self, values: Values, start: Vector, goal: Vector, most: int) -> tuple[Matrix, int] | None:
        """The route of a grid with the fewest moves, at most so many, and the largest clearance that it can keep."""
        last = len(self.levels) - 1
        route = self._proven(self.levels[last], values, start, goal, most)
        if route is None:
            return None

        for number, level in enumerate(self.levels[:last]):
            roomy = self._proven(level, values, start, goal, len(route) - 1)
            if roomy is not None:
                return roomy, number
        return route, last

    def _proven(self, level: Level, values: Values, start: Vector, goal: Vector, most: int) -> Matrix | None:
        """The route of a grid with the fewest moves, at most so many, that is proven to keep a level."""
        in_steps = BatchedMotionQueries(level.searched.motion_valid_batch, self.budget.over)
        proving = BatchedMotionQueries(level.proving.motion_valid_batch, self.budget.over)
        lattice = MoveLattice(values, in_steps, self.costs)

        for _ in range(MOST_PROOFS):
            route = lattice.best_route(start, goal, range(len(start)), most)
            if route is None or not long_enough(route, self.smallest_move):
                return None
            if proving(route[:-1], route[1:]).all():
                return route
            if lattice.closed_on(route, proving) == 0:
                return None
        return None
