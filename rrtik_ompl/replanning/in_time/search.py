"""The search in configuration and time: two trees grow towards each other, in rounds with ever earlier arrivals.

It is RRT-Connect [4] in a space in which time only goes forward, as in ST-RRT* [70]. A sample has a time at which it
can be reached from the start and from which a goal can be reached. The tree from the goals has many roots, one for each
tried time of arrival. The latest arrival is early at first and is put off while nothing is found. Each edge is a
straight stretch from rest to rest that keeps the limits of speed and acceleration. The straight way to each goal is
tried first. Each motion that is found is shortened and made earlier. Then new trees look for others: in one round only
for earlier arrivals, in the next round for any.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from heapq import heappop, heappush
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.budget import Budget, Stop, no_stop
from rrtik_ompl.model.transitions import without_repeats
from rrtik_ompl.replanning.drrt_con import without_points_between
from rrtik_ompl.replanning.in_time.foreseen import ForeseenWorlds
from rrtik_ompl.replanning.in_time.pace import ROUNDING, Pace, Timing, stretch

EXTENSION_SLOTS = 8  # largest number of slots of one extension at full speed
FIRST_HORIZON_RATIO = 1.5  # latest arrival at first, as a multiple of the least time
HORIZON_ITERATIONS = 150  # The latest arrival is doubled after so many iterations without a motion.
ROUND_ITERATIONS = 600  # iterations of a further round that looks for any arrival
MAX_FRUITLESS_ROUNDS = 12  # The search ends after so many rounds running without an earlier arrival.
WAIT_PROBABILITY = 0.1  # share of the extensions in which the robot stands still
SHORTCUT_TRIES = 60  # random shortcuts and moved corners that are tried for each motion
MOST_GOALS = 8  # goals to which the straight way is tried first
PART_SLOTS = 8  # slots at full speed from a place where the arm may stop to the next one
SLOWER = (0, 1, 3)  # slots that a stretch may take more than it needs

# Stops along a straight piece of a way, its end included, and stretches that are checked, for the earliest timing of a
# way: coarse for every way that is tried, fine for the straight ones and for the best so far.
COARSE = (2, 100)
FINE = (4, 3000)

WAIT_WEIGHT = 0.2  # weight of a slot between two vertices, where a slot of necessary motion has weight 1

Aim: TypeAlias = tuple[int, tuple[Vector, int]]  # a vertex, and the configuration and slot to grow towards
Place: TypeAlias = tuple[int, int]  # slot, and index of a place along a way
BlockedSteps: TypeAlias = dict[tuple[int, int, int], int]  # by the places and the slots of a stretch, see _stretch_free


@dataclass(frozen=True, slots=True, eq=False)
class Ends:
    """Where a search begins and ends.

    Attributes:
        start: Start configuration, shape (n,).
        goals: Goal configurations, any of which will do, shape (g, n).
        lower: Lower corner of the box to sample in, shape (n,).
        upper: Upper corner of the box to sample in, shape (n,).
        last: The last slot in which to arrive.
    """

    start: Vector
    goals: Matrix
    lower: Vector
    upper: Vector
    last: int


class TimeSearch:
    """The search that the module describes.

    Attributes:
        worlds, pace, ends: The arguments of the constructor.
        iterations: Number of iterations so far.
        least_slots: Least number of slots that a motion needs by the speed limits.

    Args:
        worlds: Checks which motions are free in which slot.
        pace: How far the robot can go in a slot.
        ends: Start, goals, sampling box and the last slot.
        rng: Source of random numbers.
    """

    def __init__(self, worlds: ForeseenWorlds, pace: Pace, ends: Ends, rng: np.random.Generator) -> None:
        self.worlds = worlds
        self.pace = pace
        self.ends = ends
        self._rng = rng
        self._least_slots_of_goals: NDArray[np.int64] = np.maximum(pace.least_slots(ends.goals - ends.start), 1)
        # An extension also speeds up and slows down.
        self._extension = EXTENSION_SLOTS + int(np.ceil(min((pace.change / pace.rise).max(), 1e3)))
        self.least_slots = int(self._least_slots_of_goals.min())
        self.iterations = 0
        self._over: Stop = no_stop  # says whether the budget of the run is used up
        self._begin_anew(None)

    @property
    def blocked_arrivals(self) -> int:
        """Number of arrivals tried so far if the goal was free at none of them; 0 otherwise."""
        return 0 if self._trees[1].size else len(self._arrivals_tried)

    def _begin_anew(self, earlier: int | None) -> None:
        """Begin a round with new trees.

        Args:
            earlier: The latest slot of arrival, if only earlier arrivals than the best one count; None for any arrival,
                with a latest slot that is near at first.
        """
        self._trees = (TimeTree(self.pace, 1), TimeTree(self.pace, -1))
        self._trees[0].add(self.ends.start, 0, -1)
        self._arrivals_tried: set[tuple[int, int]] = set()
        self._must_be_earlier = earlier is not None
        first_last_slot = int(np.ceil(FIRST_HORIZON_RATIO * self.least_slots)) + self._extension
        self._last = min(self.ends.last, first_last_slot) if earlier is None else earlier

    def run(self, budget: Budget) -> Timing | None:
        """Search until the budget is used up or no earlier arrival can be hoped for.

        Args:
            budget: Limits of wall time and iterations.

        Returns:
            The motion with the earliest arrival; None if none was found.
        """
        self._over = budget.over
        most_iterations = np.inf if budget.iterations is None else budget.iterations
        best = self._straight()
        fruitless = 0  # rounds running without an earlier arrival
        iterations_of_round = 0
        if best is not None:
            self._begin_anew(best.arrival - 1)

        while self.iterations < most_iterations and not (self._over() or self._is_done(best, fruitless)):
            self.iterations += 1
            iterations_of_round += 1
            patience = HORIZON_ITERATIONS if self._must_be_earlier else ROUND_ITERATIONS
            found = self._iterate()
            found = None if found is None else self._improved(found)

            if found is not None and (best is None or found.arrival < best.arrival):
                best = self._refined(found)
                fruitless = 0
            elif best is not None and (found is not None or iterations_of_round >= patience):
                fruitless += 1
            else:
                if iterations_of_round % HORIZON_ITERATIONS == 0:
                    self._last = min(2 * self._last, self.ends.last)
                continue

            iterations_of_round = 0
            self._begin_anew(None if self._must_be_earlier else best.arrival - 1)
        return best

    def _straight(self) -> Timing | None:
        """Return the earliest motion that goes straight to a goal, with waits; None if none was found."""
        best: Timing | None = None
        for goal in np.argsort(self._least_slots_of_goals, kind="stable")[:MOST_GOALS].tolist():
            way = without_repeats(np.vstack([self.ends.start, self.ends.goals[goal]]))
            last = self.ends.last if best is None else best.arrival - 1
            best = self._timed(way, last, FINE) or best
        return best

    def _timed(self, way: Matrix, last: int, effort: tuple[int, int]) -> Timing | None:
        """Return the earliest motion along a way, shape (k, n), see :func:`timed`."""
        return timed(way, self.pace, self.worlds, last, self._over, effort)

    def _is_done(self, best: Timing | None, fruitless: int) -> bool:
        """Check whether no earlier arrival than that of ``best`` is possible, or too many rounds were fruitless."""
        return best is not None and (fruitless >= MAX_FRUITLESS_ROUNDS or best.arrival <= self.least_slots)

    def _iterate(self) -> Timing | None:
        """Add an arrival, extend one tree, and try to connect the other tree to the new vertex.

        The trees take turns. Returns the motion if they meet, and else None.
        """
        self._add_arrival()
        grown, other = self._trees[:: 1 if self.iterations % 2 else -1]

        new_vertex = self._extend(grown) if grown.size else None
        if new_vertex is None:
            return None

        nearest_vertex = other.nearest(grown.q[new_vertex], int(grown.slot[new_vertex]))
        if nearest_vertex is None:
            return None

        target = grown.q[new_vertex], int(grown.slot[new_vertex])
        end = self._grow(other, nearest_vertex, target, self.ends.last)
        if end is None or not end[1]:
            return None

        forward, backward = (new_vertex, end[0]) if grown.onward > 0 else (end[0], new_vertex)
        return self._through(forward, backward)

    def _add_arrival(self) -> None:
        """Add a root to the tree from the goals: a random goal in a random slot, if the goal is free then."""
        goal = int(self._rng.integers(len(self.ends.goals)))
        earliest = int(self._least_slots_of_goals[goal])
        if earliest > self._last:
            return

        slot = int(self._rng.integers(earliest, self._last + 1))
        q = self.ends.goals[goal]
        if (goal, slot) not in self._arrivals_tried and self.worlds.free(slot - 1, q, q):
            self._trees[1].add(q, slot, -1)
        self._arrivals_tried.add((goal, slot))

    def _extend(self, tree: TimeTree) -> int | None:
        """Extend a tree towards a sample or by standing still; return the new vertex, or None if that is blocked."""
        aim = self._waiting(tree) if self._rng.random() < WAIT_PROBABILITY else self._sample(tree)
        if aim is None:
            return None
        vertex, to = aim
        end = self._grow(tree, vertex, to, self._extension)
        return None if end is None else end[0]

    def _waiting(self, tree: TimeTree) -> Aim | None:
        """Return a random vertex and its own configuration some slots on, to wait; None if no slots are left."""
        vertex = int(self._rng.integers(tree.size))
        q = tree.q[vertex].copy()
        slot = int(tree.slot[vertex]) + tree.onward * self._extension
        slot = min(max(slot, 0), self._last)
        return (vertex, (q, slot)) if tree.onward * (slot - int(tree.slot[vertex])) > 0 else None

    def _sample(self, tree: TimeTree) -> Aim | None:
        """Sample a configuration and a slot in which it can lie on a motion, and return them with the nearest vertex.

        Returns None if speed limits leave no slot for the configuration, or no vertex from which to reach it.
        """
        q = self._rng.uniform(self.ends.lower, self.ends.upper)
        earliest = int(self.pace.least_slots((q - self.ends.start)[None])[0])
        latest = self._last - int(self.pace.least_slots(self.ends.goals - q).min())
        if earliest > latest:
            return None

        slot = int(self._rng.integers(earliest, latest + 1))
        nearest_vertex = tree.nearest(q, slot)
        return None if nearest_vertex is None else (nearest_vertex, (q, slot))

    def _grow(self, tree: TimeTree, vertex: int, to: tuple[Vector, int], max_slots: int) -> tuple[int, bool] | None:
        """Grow a tree from a vertex straight towards a configuration in a slot, as far as the motion is free.

        Args:
            tree: The tree, which gets a new vertex.
            vertex: The vertex to start from.
            to: Target configuration, shape (n,), and its slot.
            max_slots: Largest number of slots to go.

        Returns:
            The new vertex, and whether it is the target; None if no stretch is free.
        """
        rows, complete = tree.rows_towards(vertex, *to, max_slots)
        free = self._steps_free(tree, vertex, rows)

        # Where the stretch is blocked midway the arm is not at rest, so that it has to be shorter.
        if 1 < free < len(rows) - 1:
            rows, complete = tree.rows_towards(vertex, rows[free], int(tree.slot[vertex]) + tree.onward * free, free)
            complete = False
            free = self._steps_free(tree, vertex, rows)
        if free == 0 or free < len(rows) - 1:
            return None
        return tree.add(rows[-1], int(tree.slot[vertex]) + tree.onward * free, vertex), complete

    def _steps_free(self, tree: TimeTree, vertex: int, rows: Matrix) -> int:
        """Return how many of the steps from row to row, shape (k, n), that begin at a vertex are free."""
        begin = int(tree.slot[vertex])
        return self.worlds.steps_free(begin if tree.onward > 0 else begin - 1, rows, tree.onward, self._over)

    def _through(self, forward: int, backward: int) -> Timing:
        """Return the motion from the start to a goal through two vertices at the same place, one of each tree.

        Args:
            forward: Vertex of the tree from the start.
            backward: Vertex of the tree from the goals.
        """
        first, before = self._trees[0].branch(forward)
        second, after = self._trees[1].branch(backward)
        rows = np.vstack([first, second[::-1][1:]])
        return Timing(rows, np.concatenate([before, after[::-1][1:]]))

    def _improved(self, motion: Timing) -> Timing:
        """Make a motion earlier: along its own way, then by random changes of the way that take fewer slots.

        In turn a shortcut and a corner that is moved: a shortcut has a stop more than the corner that it cuts off.
        """
        way = without_points_between(without_repeats(motion.rows))
        motion = self._timed(way, motion.arrival - 1, COARSE) or motion

        for number in range(SHORTCUT_TRIES):
            if len(way) < 3 or self._over():
                break
            shorter = self._with_moved_corner(way) if number % 2 else self._shortcut(way)
            if self._least(shorter) >= self._least(way) - ROUNDING:
                continue
            found = self._timed(shorter, motion.arrival, COARSE)
            if found is not None:
                motion = found
                way = shorter
        return motion

    def _refined(self, motion: Timing) -> Timing:
        """Make a motion earlier along its own way, with more places where the arm may stop."""
        way = without_points_between(without_repeats(motion.rows))
        return self._timed(way, motion.arrival - 1, FINE) or motion

    def _shortcut(self, way: Matrix) -> Matrix:
        """Return a way, shape (k, n), with the piece between two random points on it replaced by a straight one."""
        a, b = np.sort(self._rng.uniform(0.0, len(way) - 1.0, 2))
        # Half of the ends are corners, so that corners can vanish.
        a, b = (float(np.round(x)) if self._rng.random() < 0.5 else float(x) for x in (a, b))
        ends = [way[int(x)] + (x - int(x)) * (way[min(int(x) + 1, len(way) - 1)] - way[int(x)]) for x in (a, b)]
        pieces = [way[: int(np.floor(a)) + 1], np.array(ends), way[int(np.ceil(b)) :]]
        return without_points_between(without_repeats(np.vstack(pieces)))

    def _with_moved_corner(self, way: Matrix) -> Matrix:
        """Return a way, shape (k, n), with a random corner moved towards the straight line between its neighbours."""
        corner = int(self._rng.integers(1, len(way) - 1))
        on_line, moved = self._rng.random(2)
        before = way[corner - 1]
        after = way[corner + 1]
        shorter = way.copy()
        shorter[corner] += moved * (before + on_line * (after - before) - way[corner])
        return shorter

    def _least(self, way: Matrix) -> float:
        """Return the slots that a way, shape (k, n), takes with a stop at each corner."""
        return float(self.pace.slots(np.diff(way, axis=0)).sum())


class TimeTree:
    """A tree of configurations at the begin of slots; an edge is a straight motion at constant speed.

    Attributes:
        q: Configurations of the vertices, shape (k, n).
        slot: Slots of the vertices, shape (k,).
        size: Number of vertices.
        onward: 1 if children are later than their parents, -1 if they are earlier.

    Args:
        pace: How far the robot can go in a slot.
        onward: See the attribute.
    """

    def __init__(self, pace: Pace, onward: int) -> None:
        self._pace = pace
        self.onward = onward
        self.size = 0
        self._q = np.zeros((64, len(pace.change)))
        self._slot = np.zeros(64, dtype=np.int64)
        self._parent = np.zeros(64, dtype=np.int64)

    @property
    def q(self) -> Matrix:
        """Configurations of the vertices, shape (k, n)."""
        return self._q[: self.size]

    @property
    def slot(self) -> NDArray[np.int64]:
        """Slots of the vertices, shape (k,)."""
        return self._slot[: self.size]

    def add(self, q: Vector, slot: int, parent: int) -> int:
        """Add a vertex, a root if the parent is -1, and return its number."""
        if self.size == len(self._q):
            self._q = np.vstack([self._q, np.zeros_like(self._q)])
            self._slot = np.concatenate([self._slot, np.zeros_like(self._slot)])
            self._parent = np.concatenate([self._parent, np.zeros_like(self._parent)])

        self._q[self.size] = q
        self._slot[self.size] = slot
        self._parent[self.size] = parent
        self.size += 1
        return self.size - 1

    def nearest(self, q: Vector, slot: int) -> int | None:
        """Return the vertex with the least cost to reach a configuration in a slot; None if none is near enough.

        The cost is the number of slots that the motion needs, plus ``WAIT_WEIGHT`` times the slots between the two.
        """
        gap = self.onward * (slot - self.slot)
        needed = self._pace.slots(q - self.q)
        reachable = np.flatnonzero((gap > 0) & (needed <= gap + ROUNDING))
        if len(reachable) == 0:
            return None
        return int(reachable[(needed[reachable] + WAIT_WEIGHT * gap[reachable]).argmin()])

    def rows_towards(self, vertex: int, q: Vector, slot: int, max_slots: int) -> tuple[Matrix, bool]:
        """Return a stretch from a vertex straight towards a configuration, slot by slot, as far as the slots suffice.

        Args:
            vertex: The vertex to start from.
            q: Target configuration, shape (n,).
            slot: Slot of the target.
            max_slots: Largest number of slots to go.

        Returns:
            Configurations, shape (k, n), that of the vertex first, and whether the last one is the target.
        """
        begin = self._q[vertex]
        gap = abs(slot - int(self._slot[vertex]))
        slots = min(gap, max_slots)
        share = min(slots / gap, self._pace.reach(q - begin, slots))
        complete = gap <= max_slots and share >= 1.0 - ROUNDING
        end = q if complete else begin + share * (q - begin)
        return stretch(begin, end, slots, self._pace), complete

    def branch(self, vertex: int) -> tuple[Matrix, NDArray[np.int64]]:
        """Return the branch from the root to a vertex: configurations, shape (k, n), and slots, shape (k,)."""
        numbers = [vertex]
        while self._parent[numbers[-1]] >= 0:
            numbers.append(int(self._parent[numbers[-1]]))
        return self._q[numbers[::-1]], self._slot[numbers[::-1]]


def timed(
    way: Matrix, pace: Pace, worlds: ForeseenWorlds, last: int, stop: Stop, effort: tuple[int, int] = FINE
) -> Timing | None:
    """Follow a way with the earliest arrival.

    Along a fixed path only its timing is left to choose, as in the decomposition of [71]. Here the arm stops at the
    corners, and may stop at some places between them. It goes from stop to stop in a stretch that may take more slots
    than it needs, or waits. A best-first search finds the earliest arrival; stretches are checked when they are due.

    Args:
        way: The corners, shape (k, n).
        pace: How fast the robot can go.
        worlds: Checks which motions are free in which slot.
        last: The last slot in which to arrive.
        stop: Ends the search without a result when it returns True.
        effort: Largest number of stops along a straight piece, and of stretches that are checked.

    Returns:
        The motion; None if there is none or too many were tried.
    """
    most_parts, most_stretches = effort
    places, end_of_piece = _stops(way, pace, most_parts)
    goal = len(places) - 1
    least = _least_slots_left(places, end_of_piece, pace)
    previous: dict[Place, Place] = {}
    blocked_steps: BlockedSteps = {}

    # The same stretches are looked at from slot to slot.
    @cache
    def slots_of(begin: int, end: int) -> list[int]:
        return _slots_of(places[end] - places[begin], pace)

    @cache
    def rows_of(begin: int, end: int, slots: int) -> Matrix:
        return stretch(places[begin], places[end], slots, pace)

    queue: list[tuple[int, int, int, Place]] = [(int(least[0]), 0, 0, (0, 0))]  # arrival, -place, slot, from where

    checked = 0
    while queue and checked < most_stretches and not stop():
        _, minus_place, slot, before = heappop(queue)
        number = -minus_place
        if (slot, number) in previous:
            continue
        checked += slot > 0
        if slot:
            begin_slot, begin = before
            stretch_rows = rows_of(begin, number, slot - begin_slot)
            if not _stretch_free(stretch_rows, before, number, worlds, blocked_steps, stop):
                continue
        previous[slot, number] = before
        if number == goal and slot:
            return _timing(places, previous, (slot, number))

        for after in range(number, int(end_of_piece[number]) + 1):
            for slots in slots_of(number, after):
                arrival = slot + slots + int(least[after])
                if arrival <= last:
                    heappush(queue, (arrival, -after, slot + slots, (slot, number)))
    return None


def _slots_of(move: Vector, pace: Pace) -> list[int]:
    """Return how many slots a stretch may take, or 1 for a wait."""
    if not move.any():
        return [1]
    needed = int(pace.whole_slots(move[None])[0])
    return [needed + more for more in SLOWER]


def _stops(way: Matrix, pace: Pace, most_parts: int) -> tuple[Matrix, NDArray[np.int64]]:
    """Return the places of a way where the arm may stop, and the last place that is straight ahead of each."""
    places = [way[:1]]
    counts = []
    for a, b in pairwise(way):
        parts = int(np.clip(pace.slots((b - a)[None])[0] / PART_SLOTS, 1, most_parts))
        shares = np.arange(1, parts + 1)[:, None] / parts
        places.append(a + shares * (b - a))
        places[-1][-1] = b
        counts.append(parts)
    piece_ends = np.cumsum(counts, dtype=np.int64)
    last = int(piece_ends[-1]) if counts else 0
    ends = np.append(np.repeat(piece_ends, counts), last)
    return np.vstack(places), ends


def _least_slots_left(places: Matrix, end_of_piece: NDArray[np.int64], pace: Pace) -> NDArray[np.int64]:
    """Return the least number of slots from each place to the last one, shape (k,)."""
    least = np.zeros(len(places), dtype=np.int64)
    for k in range(len(places) - 2, -1, -1):
        end = int(end_of_piece[k])
        least[k] = least[end] + int(pace.whole_slots((places[end] - places[k])[None])[0])
    return least


def _stretch_free(
    rows: Matrix, begin: Place, end: int, worlds: ForeseenWorlds, blocked_steps: BlockedSteps, stop: Stop
) -> bool:
    """Check whether the stretch from place to place, or the wait at one, is free in each of its slots.

    The step at which the same stretch was blocked last, in other slots, is checked first.

    Args:
        rows: The configurations at the begin of each slot and at the end, shape (k, n).
        begin: Where and when it begins.
        end: The place where it ends.
        worlds: Checks which motions are free in which slot.
        blocked_steps: Gets the step that was found blocked.
        stop: Ends the check when it returns True; the stretch then counts as blocked.
    """
    slot, place = begin
    count = len(rows) - 1

    suspect = blocked_steps.get((place, end, count))
    if suspect is not None and not worlds.free(slot + suspect, rows[suspect], rows[suspect + 1]):
        return False
    free = worlds.steps_free(slot, rows, 1, stop)
    if free < count:
        blocked_steps[place, end, count] = free
    return free == count


def _timing(places: Matrix, previous: dict[Place, Place], end: Place) -> Timing:
    """Return the motion that ends at a place and a slot."""
    stops = [end]
    while stops[-1] != (0, 0):
        stops.append(previous[stops[-1]])
    slots, numbers = np.array(stops[::-1], dtype=np.int64).T
    return Timing(places[numbers], slots)
