"""Routes with fewer moves on fine grids of all joint values, for arms of which few joints move.

A route that turns back several times has more free values than the lattices of a search hold. Where three joints or
fewer may move, a grid of all of them is small enough. It is searched without a clearance first, in steps; only where
that finds fewer moves, each level of clearance is tried.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.moves.best_route import BestRoute
from rrtik_ompl.moves.values import Values, spread_values, values_of
from rrtik_ompl.world.motion_queries import BatchedMotionQueries, MotionsFree, OutOfTime, Stop

FINE_NODES = (2**15, 2**18)  # of a grid: a twentieth and half of a second in the kernels
MOST_JOINTS = 3  # that may move
MOST_PAIRS = 2  # of a start and a goal
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
        in_steps: Which straight motions are free without a clearance; quick.
        levels: Which are proven free at each level of clearance, the largest first.
    """

    joints: Sequence[int]
    lower: Vector
    upper: Vector
    costs: Vector
    smallest_move: Vector
    in_steps: MotionsFree
    levels: Sequence[MotionsFree]

    def route(
        self, pairs: Sequence[tuple[Vector, Vector]], moves: int, seed: int, stop: Stop
    ) -> tuple[Matrix, int] | None:
        """A route with fewer moves than known, and the number of the level that it keeps, or None.

        Args:
            pairs: Of a start and a goal, shapes (n,), that agree in the joints that must not move.
            moves: The fewest that are known.
            seed: Of the places of the grids.
            stop: True ends the search; the best so far is returned.
        """
        best: tuple[Matrix, int] | None = None
        if not 0 < len(self.joints) <= MOST_JOINTS:
            return best
        rng = np.random.default_rng(seed)
        with suppress(OutOfTime):
            for nodes in FINE_NODES:
                for start, goal in pairs[:MOST_PAIRS]:
                    values = self._values(start, goal, nodes, rng)
                    found = self._kept(values, start, goal, moves, stop)
                    if found is not None:
                        best, moves = found, len(found[0]) - 1
        return best

    def _values(self, start: Vector, goal: Vector, nodes: int, rng: np.random.Generator) -> Values:
        values, each = values_of(np.array([start, goal])), int(nodes ** (1.0 / len(self.joints)))
        for joint in self.joints:
            more = spread_values(float(self.lower[joint]), float(self.upper[joint]), each, rng)
            values[joint] = np.union1d(values[joint], more)
        return values

    def _kept(self, values: Values, start: Vector, goal: Vector, moves: int, stop: Stop) -> tuple[Matrix, int] | None:
        """The first level of clearance at which a grid has a route with fewer moves, and that route."""
        if self._on_grid(self.in_steps, values, start, goal, moves, stop) is None:
            return None
        for number, motions_free in enumerate(self.levels):
            route = self._on_grid(motions_free, values, start, goal, moves, stop)
            if route is not None:
                return route, number
        return None

    def _on_grid(
        self, motions_free: MotionsFree, values: Values, start: Vector, goal: Vector, moves: int, stop: Stop
    ) -> Matrix | None:
        queries = BatchedMotionQueries(motions_free)
        queries.stop = stop
        best = BestRoute(queries, self.costs, range(len(start)), self.smallest_move)
        best.search(values, start, goal)
        return best.route if best.moves < moves else None
