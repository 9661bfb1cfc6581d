"""The best route of single-joint moves so far, and how a better one takes its place."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.model.transitions import edge_keys, merge_moves, transitions
from rrtik_ompl.planning.moves.axis_cut import cut_parts, double_axis_cut
from rrtik_ompl.planning.moves.lattice import MoveLattice
from rrtik_ompl.planning.moves.rules import long_enough
from rrtik_ompl.planning.moves.values import Values, lattice_size, within_travel
from rrtik_ompl.world.motion_queries import BatchedMotionQueries, MotionsFree

DIGITS = 9  # of the travel after the point; the rest is rounding
NONE = 2**31  # moves, if there is no route


class BestRoute:
    """The route with the fewest moves that is known, the least travel among those.

    Attributes:
        route: Shape (k, n), or None.

    Args:
        queries: Checks motions.
        costs: Cost of each joint's travel, shape (n,).
        order: All joints; among equal routes on a lattice the one whose last moves come first here.
        smallest_move: A route with a shorter move is not kept, shape (n,).
    """

    def __init__(
        self, queries: BatchedMotionQueries, costs: Vector, order: Sequence[int], smallest_move: Vector
    ) -> None:
        self._queries = queries
        self._costs = costs
        self._order = order
        self._smallest_move = smallest_move
        self.route: Matrix | None = None
        self._rank: tuple[int, float] = NONE, np.inf  # of the route

    @property
    def moves(self) -> int:
        """Of the route; more than any number if there is none."""
        return self._rank[0]

    def take(self, route: Matrix) -> None:
        """Take in a free route, shape (k, n); it is kept if it is better."""
        if self._is_better(route):
            self.route = route
            self._rank = self.rank(route)

    def rank(self, route: Matrix) -> tuple[int, float]:
        """What is to be made small: moves, then travel; a gain of rounding is none."""
        travel = float((np.abs(np.diff(route, axis=0)) @ self._costs).sum())
        return transitions(route), round(travel, DIGITS)

    def cut(self, route: Matrix, axes: Sequence[int] | None = None) -> Matrix:
        """The published double axis cut of a free route: on long ones it gains much more in a second than a lattice.

        As far as it comes in time; what has been cut by then stays cut.
        """
        return self._take_if_free(
            double_axis_cut(route, self._queries.in_time, axes=axes, stop=self._queries.stop), route
        )

    def cut_parts(self, route: Matrix) -> Matrix:
        """Cuts of parts of a free route that get longer: much of what the cut of the whole gains, much sooner."""
        return self._take_if_free(cut_parts(route, self._queries.in_time, stop=self._queries.stop), route)

    def search(self, values: Values, start: Vector, goal: Vector, *, shorter: bool = False) -> Matrix | None:
        """The best route between a start and a goal on a lattice of values, if there is one.

        With ``shorter`` one of as many moves and more travel than the best so far need not be found.

        Raises:
            OutOfTime: If it is time to stop.
        """
        values = self._values_of_less_travel(values, start, goal) if shorter else values
        found = self._lattice_route(values, start, goal)
        if found is not None:
            self.take(found)
        return found

    def replace(self, route: Matrix, first: int, last: int, values: Values, *, shorter: bool = False) -> None:
        """Take in a free route whose waypoints from ``first`` to ``last`` are replaced by the best part on a lattice.

        With ``shorter`` as in :meth:`search`.

        Raises:
            OutOfTime: If it is time to stop.
        """
        if shorter and last - first == len(route) - 1:  # where a part begins or ends moves may become one
            values = self._values_of_less_travel(values, route[0], route[-1])

        part = self._lattice_route(values, route[first], route[last])
        if part is not None:
            replaced = merge_moves(np.vstack([route[:first], part, route[last + 1 :]]), tolerance=0.0)
            if self._is_better(replaced) and self._is_free(replaced, route):
                self.route = replaced
                self._rank = self.rank(replaced)

    def _values_of_less_travel(self, values: Values, start: Vector, goal: Vector) -> Values:
        """Those values that a route between two ends can take with no more travel than the best one."""
        if self.route is None:
            return values
        left = within_travel(values, start, goal, self._costs, self._rank[1])
        nothing_to_search = [v[:1] for v in values]
        return nothing_to_search if left is None else left

    def _is_better(self, route: Matrix) -> bool:
        """Whether a route, shape (k, n), is to take the place of the best one."""
        return self.rank(route) < self._rank and long_enough(route, self._smallest_move)

    def _take_if_free(self, cut_route: Matrix, route: Matrix) -> Matrix:
        """Take in the cut of a route if it is free, which is found out even when it is time to stop.

        Returns:
            The cut route, or else the route.
        """
        if not self._is_free(cut_route, route, self._queries.to_the_end):
            return route
        self.take(cut_route)
        return cut_route

    def _lattice_route(self, values: Values, start: Vector, goal: Vector) -> Matrix | None:
        """The best route on a lattice of values, each of its moves checked as a whole; None if there is none."""
        if lattice_size(values) < 2:
            return None

        lattice = MoveLattice(values, self._queries, self._costs)
        found = lattice.best_route(start, goal, self._order)
        if found is None or not self._is_free(found, start[None]):
            return None
        return found

    def _is_free(self, route: Matrix, known_free: Matrix, motions_free: MotionsFree | None = None) -> bool:
        """Whether every edge of a route is free; those of the known one are. Runs have been checked in pieces."""
        motions_free = self._queries if motions_free is None else motions_free
        known_edges = set(edge_keys(known_free))
        fresh = [k for k, edge in enumerate(edge_keys(route)) if edge not in known_edges]
        return not fresh or bool(motions_free(route[fresh], route[np.add(fresh, 1)]).all())
