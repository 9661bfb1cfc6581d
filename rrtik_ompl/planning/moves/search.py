"""An anytime search for routes of single-joint moves: fewest moves first, least travel second.

The search solves one small lattice of joint values after another for its best route. A route of only a few moves more
than there are joints to move has few values other than those of the start and the goal. Lattices of all corners between
start and goal, with many values of one, two or three joints, therefore hold such routes. Other lattices are made of the
values of the routes that are known so far.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from itertools import combinations, islice, product
from typing import TypeAlias

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.model.transitions import edge_keys, lower_bound, merge_moves, transitions
from rrtik_ompl.planning.moves.axis_cut import axis_moves, cut_parts, double_axis_cut
from rrtik_ompl.planning.moves.lattice import (
    MoveLattice,
    Values,
    lattice_size,
    near_values,
    values_of,
    with_spread,
    within_travel,
)
from rrtik_ompl.planning.moves.rules import long_enough
from rrtik_ompl.planning.moves.staircase import staircase_orders
from rrtik_ompl.world.motion_queries import BatchedMotionQueries, MotionsFree, OutOfTime

MOST_NODES = 4096  # largest size of a lattice; it takes some milliseconds in the kernels
MOST_FREE = 3  # largest number of joints with free values in one lattice
WIDTHS = 0.1 * 0.5 ** np.arange(0, 16, 3)  # widths in the search for less travel, as shares of a joint's range
NEAR_NODES = 512  # largest size of a lattice close to a route
CUTS = 3  # cuts in random orders without a gain before a round goes on
SPARE = 8  # a part that gets further values fills at most 1 / SPARE of the lattice without them
REPEATS = 8  # repetitions of the search for less travel with the same width

DIGITS = 9  # decimals of the travel that are compared; the rest is rounding
NONE = 2**31  # number of moves if there is no route

Proof: TypeAlias = Callable[[Vector, Vector], int]  # returns a lower bound of the moves between a start and a goal


class MoveSearch:
    """A search for routes from starts to goals that improves its best route round by round.

    Attributes:
        pairs: Each start with each goal.
        rounds: Rounds of improvement so far.

    Args:
        starts: Free configurations, shape (s, n).
        goals: Free configurations, shape (g, n).
        lower, upper: Finite limits of the joint values, shapes (n,).
        motions_free: Returns which straight motions are free, for batches of shape (m, n).
        budget: When to end with the best route so far, and the seed of all random choices; None for no end.
        costs: Cost of each joint's travel, shape (n,); all 1 if None.
        frozen: Joints that must not move.
        smallest_move: Least change of each joint in one move, shape (n,); None for no minimum.
        most_nodes: Largest size of a lattice.
        prove: Computes a sharper lower bound between a start and a goal; called once, when the best route has one move
            more than the bound.
        all_free: Returns which motions are free without clearance and without proofs. A lower bound may only rely on
            these collisions. None if they are the same as those of ``motions_free``.
    """

    def __init__(
        self,
        starts: Matrix,
        goals: Matrix,
        lower: Vector,
        upper: Vector,
        motions_free: MotionsFree,
        *,
        budget: Budget | None = None,
        costs: Vector | None = None,
        frozen: Sequence[int] = (),
        smallest_move: Vector | None = None,
        most_nodes: int = MOST_NODES,
        prove: Proof | None = None,
        all_free: MotionsFree | None = None,
    ) -> None:
        budget = Budget() if budget is None else budget
        self.pairs = [(s, g) for s, g in product(starts, goals)]
        self._bounds = [lower_bound(s, g) for s, g in self.pairs]  # lower bound of the moves of each pair
        self._min_bound = min(self._bounds)  # the bound before the search
        self._lower = lower
        self._upper = upper

        self._queries = BatchedMotionQueries(motions_free, budget.over)
        self._rng = np.random.default_rng(budget.seed)

        count = starts.shape[1]
        order = self._rng.permutation(count).tolist()
        shortest = np.zeros(count) if smallest_move is None else smallest_move
        travel = np.ones(count) if costs is None else costs
        self._best = BestRoute(self._queries, travel, order, shortest)

        # Only collisions without clearance may raise the bound, see `all_free`.
        self._queries_without_clearance: BatchedMotionQueries | None = None
        self._best_without_clearance = self._best
        if all_free is not None:
            self._queries_without_clearance = BatchedMotionQueries(all_free, budget.over)
            self._best_without_clearance = BestRoute(self._queries_without_clearance, travel, order, shortest)

        self._movable = [j for j in range(count) if j not in frozen and lower[j] < upper[j]]
        self._most_nodes = most_nodes
        self._prove = prove  # None once it has been called
        self._offers: list[Matrix] = []
        self.rounds = 0

    @property
    def route(self) -> Matrix | None:
        """The best route so far, shape (k, n), or None."""
        return self._best.route

    @property
    def moves(self) -> int:
        """Number of moves of the best route; a very large number if there is none."""
        return self._best.moves

    @property
    def bound(self) -> int:
        """Lower bound of the moves of any route; :meth:`try_corner_routes` and :meth:`raise_bound` sharpen it."""
        return min(*self._bounds, self.moves)

    @property
    def proven(self) -> bool:
        """Whether no route has fewer moves than the best one."""
        return self.moves == self.bound

    @property
    def direct(self) -> bool:
        """Whether each joint of the best route moves once, straight to the goal, so that no route can be better."""
        return self.route is not None and self.proven and self.moves <= lower_bound(self.route[0], self.route[-1])

    @property
    def motions(self) -> int:
        """How many straight motions have been checked."""
        asked = self._queries.asked
        if self._queries_without_clearance is not None:
            asked += self._queries_without_clearance.asked
        return asked

    def raise_bound(self, pair: int, bound: int) -> None:
        """Record that no route of a pair has fewer than ``bound`` moves; ``pair`` is an index of ``pairs``."""
        self._bounds[pair] = max(self._bounds[pair], bound)

    def offer(self, route: Matrix) -> None:
        """Take in a free route of single-joint moves, shape (k, n), from one of the starts to one of the goals."""
        merged = merge_moves(route, tolerance=0.0)
        self._offers.append(merged)
        self._best.take(merged)

    def try_corner_routes(self) -> None:
        """Check for each start and goal whether a route without detours joins them, and sharpen the bound if not.

        A route without detours has no free values: it passes corners of the box between start and goal, all of which
        are tried. If there is no such route, a joint has to move twice, so the bound rises by one. If only one joint
        differs it rises from 1 to 3, because that joint cannot move twice alone: another joint has to leave and return.
        """
        with suppress(OutOfTime):
            for number, (start, goal) in enumerate(self.pairs):
                values = values_of(np.array([start, goal]))
                fewest = self._bounds[number]
                if not 0 < fewest <= self.moves:
                    continue
                if lattice_size(values) > self._most_nodes:
                    self._try_plain_orders(start, goal)
                    continue

                found = self._best.search(values, start, goal)
                needs_more = found is None or transitions(found) > fewest
                if needs_more and self._best_without_clearance is not self._best:
                    found = self._best_without_clearance.search(values, start, goal)
                    needs_more = found is None or transitions(found) > fewest
                if needs_more:
                    self.raise_bound(number, 3 if fewest == 1 else fewest + 1)

    def _try_plain_orders(self, start: Vector, goal: Vector) -> None:
        """Take in the moves of the joints from the last to the first, or from first to last, if they are free."""
        for order in (range(len(start))[::-1], range(len(start))):
            route = np.vstack([start, axis_moves(start, goal, order)])
            if self._queries(route[:-1], route[1:]).all():
                self._best.take(route)

    def _try_corners_of_large_boxes(self) -> None:
        """Take in routes without detours, if found, for pairs with too many corners to try them all on a lattice."""
        for start, goal in self.pairs:
            too_many = lattice_size(values_of(np.array([start, goal]))) > self._most_nodes
            if not too_many or self.direct:
                continue
            orders = staircase_orders(start, goal, self._queries)
            if orders:
                self._best.take(np.vstack([start, axis_moves(start, goal, orders[0])]))

    def improve(self, rounds: int) -> None:
        """Look for better routes, for at most ``rounds`` rounds or until it is time to stop.

        The steps are: cut the offered routes; search with free values of each joint; rearrange the offered routes; then
        in each round search with free values of several joints, cut the best route and improve a random part of it. The
        rounds end once the best route is proven to have the fewest moves. At the end a few steps reduce the travel.
        """
        if self.direct:
            return
        with suppress(OutOfTime):
            # Begin with quick gains: corners of large boxes, and cuts of the offered routes.
            self._try_corners_of_large_boxes()
            if not self.proven:
                self._offers = [self._cut(offered) for offered in self._offers]
                self._cut_again()

            # Search with one free joint at a time, then rearrange the offered routes.
            for joint in self._movable:
                self._search_with_free_values([joint])
            for offered in self._offers:
                if not self.proven:
                    self._rearrange(offered)

            # Each round frees further joints, until the best route is proven to have the fewest moves.
            for joints in islice(self._free_joints(), rounds):
                self._sharpen_bound()
                if self.proven:
                    break
                self.rounds += 1
                self._search_with_free_values(joints)
                self._cut_again()
                if self.route is not None:
                    self._improve_part(self.route)

            # Reduce the travel.
            self._reorder_detours()
            self._reduce_travel()

    def _cut(self, offered: Matrix) -> Matrix:
        """Cut a free route by both methods, and return the better result."""
        return min(self._best.cut_parts(offered), self._best.cut(offered), key=self._best.rank)

    def _cut_again(self) -> None:
        """Cut the best route with random orders of the joints, until several cuts in a row gain no move."""
        cuts_without_gain = 0
        while self.route is not None and not self.proven and cuts_without_gain < CUTS:
            if self._queries.stop():
                raise OutOfTime
            before = self.moves
            self._best.cut(self.route, self._rng.permutation(self.route.shape[1]).tolist())
            if self.moves == before:
                cuts_without_gain += 1
            else:
                cuts_without_gain = 0

    def _rearrange(self, route: Matrix) -> None:
        """Search for the best route on the values of a route, part by part if they are too many for one lattice."""
        first = 0
        while first < len(route) - 1:
            last = self._window(route, first)
            self._best.replace(route, first, last, values_of(route[first : last + 1]))
            first = last

    def _window(self, route: Matrix, first: int) -> int:
        """Return the index of the last waypoint of the longest part from ``first`` on whose values fit in a lattice."""
        last = first + 1
        while last + 1 < len(route) and lattice_size(values_of(route[first : last + 2])) <= self._most_nodes:
            last += 1
        return last

    def _sharpen_bound(self) -> None:
        """Prove a sharper bound if it could show that the best route has the fewest moves; done at most once."""
        if self._prove is None or self.moves != self.bound + 1:
            return

        prove = self._prove
        self._prove = None
        for number, (start, goal) in enumerate(self.pairs):
            # Only if all corners of the pair have been tried.
            if lower_bound(start, goal) < self._bounds[number] < self.moves:
                self.raise_bound(number, prove(start, goal))

    def _search_with_free_values(self, joints: Sequence[int]) -> None:
        """Search for a route between corners where some joints take many values.

        The pair of start and goal is drawn at random from those that may have a better route. Nothing is searched if
        the corners alone are too many for a lattice.
        """
        promising = [k for k, bound in enumerate(self._bounds) if bound <= self.moves]
        if promising:
            start, goal = self.pairs[int(self._rng.choice(promising))]
            values = self._with_spread(np.array([start, goal]), joints)
            if lattice_size(values) <= self._most_nodes:
                self._best.search(values, start, goal, shorter=self.proven)

    def _improve_part(self, route: Matrix) -> None:
        """Replace a random part of a route by the best part on its values and further values of some joints."""
        first = int(self._rng.integers(len(route) - 1))
        last = self._window(route, first)
        while first > 0 and lattice_size(values_of(route[first - 1 : last + 1])) <= self._most_nodes // SPARE:
            first -= 1

        joints = self._some_joints(MOST_FREE)
        self._best.replace(route, first, last, self._with_spread(route[first : last + 1], joints))

    def _reduce_travel(self) -> None:
        """Shift the free values of the best route by smaller and smaller steps, as long as its travel decreases."""
        for width in WIDTHS:
            for _ in range(REPEATS):
                before = self.route
                if before is None or len(before) < 2:
                    return
                last = self._window(before, 0)
                part = before[: last + 1]
                near = near_values(part, float(width), self._lower, self._upper, NEAR_NODES)
                self._best.replace(before, 0, last, near, shorter=self.proven)
                if self.route is before:
                    break

    def _reorder_detours(self) -> None:
        """Search with free values of the joints that make detours in the best route, so that others may be found."""
        if self.route is not None:
            values = values_of(self.route)
            ends = values_of(self.route[[0, -1]])
            detours = [j for j in self._movable if len(values[j]) > len(ends[j])]
            if detours:
                self._search_with_free_values(detours)

    def _with_spread(self, rows: Matrix, joints: Sequence[int]) -> Values:
        """Return the values of rows, shape (k, n), with as many more of some joints as fit in a lattice."""
        return with_spread(values_of(rows), joints, self._lower, self._upper, self._most_nodes, self._rng)

    def _some_joints(self, max_count: int) -> list[int]:
        """Draw one to ``max_count`` joints that may move."""
        if not self._movable:
            return []
        count = int(self._rng.integers(1, min(max_count, len(self._movable)) + 1))
        chosen: list[int] = self._rng.choice(self._movable, size=count, replace=False).tolist()
        return chosen

    def _free_joints(self) -> Iterator[list[int]]:
        """Yield sets of joints to be given free values, forever.

        All pairs come in random order, then all sets of three, then each joint alone, and so on. A set is never larger
        than the number of joints that can have free values in a route with one move fewer than the best one.
        """
        smallest_size = 2  # `improve` has tried each joint alone before
        while self._movable:
            for size in range(smallest_size, MOST_FREE + 1):
                sets = list(combinations(self._movable, size))
                for k in self._rng.permutation(len(sets)):
                    if size <= max(self.moves - 1 - self._min_bound, 1):
                        yield list(sets[k])
            smallest_size = 1


class BestRoute:
    """The best route known: fewest moves first, least travel second.

    Attributes:
        route: Shape (k, n), or None.

    Args:
        queries: Checks motions.
        costs: Cost of each joint's travel, shape (n,).
        order: All joints. Of equally good routes on a lattice, the one whose last moves come first in this order is
            chosen.
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
        """Number of moves of the route; a very large number if there is none."""
        return self._rank[0]

    def take(self, route: Matrix) -> None:
        """Take in a free route, shape (k, n), and keep it if it is better than the best one."""
        if self._is_better(route):
            self.route = route
            self._rank = self.rank(route)

    def rank(self, route: Matrix) -> tuple[int, float]:
        """Return the rank of a route, smaller is better: number of moves, then travel.

        The travel is rounded, so that rounding errors do not count as a gain.
        """
        travel = float((np.abs(np.diff(route, axis=0)) @ self._costs).sum())
        return transitions(route), round(travel, DIGITS)

    def cut(self, route: Matrix, axes: Sequence[int] | None = None) -> Matrix:
        """Cut a free route with the published double axis cut, take in the result and return it.

        On long routes this gains much more per second than a lattice does. If time runs out, the part that has been cut
        until then stays cut.
        """
        return self._take_if_free(
            double_axis_cut(route, self._queries.in_time, axes=axes, stop=self._queries.stop), route
        )

    def cut_parts(self, route: Matrix) -> Matrix:
        """Cut parts of a free route, then longer parts, take in the result and return it.

        This gets most of the gain of cutting the whole route, much sooner.
        """
        return self._take_if_free(cut_parts(route, self._queries.in_time, stop=self._queries.stop), route)

    def search(self, values: Values, start: Vector, goal: Vector, *, shorter: bool = False) -> Matrix | None:
        """Return the best route between a start and a goal on a lattice of values, or None, and take it in.

        Args:
            values: For each joint the values of the lattice.
            start: Shape (n,).
            goal: Shape (n,).
            shorter: Whether to search only for routes of no more travel than the best one, on a smaller lattice.

        Raises:
            OutOfTime: If it is time to stop.
        """
        values = self._values_of_less_travel(values, start, goal) if shorter else values
        found = self._lattice_route(values, start, goal)
        if found is not None:
            self.take(found)
        return found

    def replace(self, route: Matrix, first: int, last: int, values: Values, *, shorter: bool = False) -> None:
        """Replace a part of a free route by the best part on a lattice, and take in the result if it is better.

        Args:
            route: Shape (k, n).
            first: Index of the waypoint at which the part begins.
            last: Index of the waypoint at which it ends.
            values: For each joint the values of the lattice.
            shorter: As in :meth:`search`.

        Raises:
            OutOfTime: If it is time to stop.
        """
        # Only for whole routes: at the ends of a part two moves may be merged into one, which changes the travel
        # allowed.
        if shorter and last - first == len(route) - 1:
            values = self._values_of_less_travel(values, route[0], route[-1])

        part = self._lattice_route(values, route[first], route[last])
        if part is not None:
            replaced = merge_moves(np.vstack([route[:first], part, route[last + 1 :]]), tolerance=0.0)
            if self._is_better(replaced) and self._is_free(replaced, route):
                self.route = replaced
                self._rank = self.rank(replaced)

    def _values_of_less_travel(self, values: Values, start: Vector, goal: Vector) -> Values:
        """Return the values that a route between two ends can take with no more travel than the best route."""
        if self.route is None:
            return values
        left = within_travel(values, start, goal, self._costs, self._rank[1])
        nothing_to_search = [v[:1] for v in values]
        return nothing_to_search if left is None else left

    def _is_better(self, route: Matrix) -> bool:
        """Check whether a route, shape (k, n), is better than the best one and has no move that is too short."""
        return self.rank(route) < self._rank and long_enough(route, self._smallest_move)

    def _take_if_free(self, cut_route: Matrix, route: Matrix) -> Matrix:
        """Take in the cut of a route if it is free; this check is completed even when it is time to stop.

        Returns:
            The cut route if it is free, else the route.
        """
        if not self._is_free(cut_route, route, self._queries.to_the_end):
            return route
        self.take(cut_route)
        return cut_route

    def _lattice_route(self, values: Values, start: Vector, goal: Vector) -> Matrix | None:
        """Return the best route on a lattice of values if each of its moves is free as a whole, else None.

        The lattice checks each move in pieces, from one value to the next.
        """
        if lattice_size(values) < 2:
            return None

        lattice = MoveLattice(values, self._queries, self._costs)
        found = lattice.best_route(start, goal, self._order)
        if found is None or not self._is_free(found, start[None]):
            return None
        return found

    def _is_free(self, route: Matrix, known_free: Matrix, motions_free: MotionsFree | None = None) -> bool:
        """Check whether all edges of a route are free; edges of the known route are not checked again.

        Args:
            route: Shape (k, n).
            known_free: Another route, shape (m, n), whose edges are known to be free.
            motions_free: The check to use; None for that of the search.
        """
        motions_free = self._queries if motions_free is None else motions_free
        known_edges = set(edge_keys(known_free))
        fresh = [k for k, edge in enumerate(edge_keys(route)) if edge not in known_edges]
        return not fresh or bool(motions_free(route[fresh], route[np.add(fresh, 1)]).all())
