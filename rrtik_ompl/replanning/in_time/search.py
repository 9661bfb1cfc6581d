"""The search in configuration and time: two trees grow towards each other, in rounds with ever earlier arrivals.

It is RRT-Connect [4] in a space in which time only goes forward, as in ST-RRT* [70]. A sample has a time at which it
can be reached from the start and from which a goal can be reached. The tree from the goals has many roots, one for each
tried time of arrival. The latest arrival is early at first and is put off while nothing is found. Each motion that is
found is shortened and made earlier. Then new trees look for others: in one round only for earlier arrivals, in the next
round for any.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.budget import Budget, Stop, no_stop
from rrtik_ompl.replanning.in_time.foreseen import ForeseenWorlds

EXTENSION_SLOTS = 8  # largest number of slots of one extension
FIRST_HORIZON_RATIO = 1.5  # latest arrival at first, as a multiple of the least time
HORIZON_ITERATIONS = 150  # The latest arrival is doubled after so many iterations without a motion.
ROUND_ITERATIONS = 600  # iterations of a further round that looks for any arrival
MAX_FRUITLESS_ROUNDS = 12  # The search ends after so many rounds running without an earlier arrival.
WAIT_PROBABILITY = 0.1  # share of the extensions in which the robot stands still
SHORTCUT_TRIES = 200  # random shortcuts that are tried for each motion

WAIT_WEIGHT = 0.2  # weight of a slot between two vertices, where a slot of necessary motion has weight 1
ROUNDING = 1e-9  # [slots]
NEVER = 1 << 40  # a finite number of slots that is larger than that of any plan

Aim: TypeAlias = tuple[int, tuple[Vector, int]]  # a vertex, and the configuration and slot to grow towards
Place: TypeAlias = tuple[int, int]  # slot, and index of a place along a motion


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
        self._least_slots_of_goals: NDArray[np.int64] = np.maximum(pace.whole_slots(ends.goals - ends.start), 1)
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
        first_last_slot = int(np.ceil(FIRST_HORIZON_RATIO * self.least_slots)) + EXTENSION_SLOTS
        self._last = min(self.ends.last, first_last_slot) if earlier is None else earlier

    def run(self, budget: Budget) -> Matrix | None:
        """Search until the budget is used up or no earlier arrival can be hoped for.

        Args:
            budget: Limits of wall time and iterations.

        Returns:
            The motion with the earliest arrival: the configuration at the begin of each slot, shape (k, n); None if
            none was found.
        """
        self._over = budget.over
        most_iterations = np.inf if budget.iterations is None else budget.iterations
        best: Matrix | None = None
        fruitless = 0  # rounds running without an earlier arrival
        iterations_of_round = 0

        while self.iterations < most_iterations and not (self._over() or self._is_done(best, fruitless)):
            self.iterations += 1
            iterations_of_round += 1
            patience = HORIZON_ITERATIONS if self._must_be_earlier else ROUND_ITERATIONS
            rows = self._iterate()
            rows = None if rows is None else self._improved(rows)

            if rows is not None and (best is None or len(rows) < len(best)):
                best = rows
                fruitless = 0
            elif best is not None and (rows is not None or iterations_of_round >= patience):
                fruitless += 1
            else:
                if iterations_of_round % HORIZON_ITERATIONS == 0:
                    self._last = min(2 * self._last, self.ends.last)
                continue

            iterations_of_round = 0
            self._begin_anew(None if self._must_be_earlier else len(best) - 2)
        return best

    def _is_done(self, best: Matrix | None, fruitless: int) -> bool:
        """Check whether no earlier arrival than that of ``best`` is possible, or too many rounds were fruitless."""
        return best is not None and (fruitless >= MAX_FRUITLESS_ROUNDS or len(best) - 1 <= self.least_slots)

    def _iterate(self) -> Matrix | None:
        """Add an arrival, extend one tree, and try to connect the other tree to the new vertex.

        The trees take turns. Returns the motion, shape (k, n), if they meet, and else None.
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
        return self._rows_through(forward, backward)

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
        end = self._grow(tree, vertex, to, EXTENSION_SLOTS)
        return None if end is None else end[0]

    def _waiting(self, tree: TimeTree) -> Aim | None:
        """Return a random vertex and its own configuration some slots on, to wait; None if no slots are left."""
        vertex = int(self._rng.integers(tree.size))
        q = tree.q[vertex].copy()
        slot = int(tree.slot[vertex]) + tree.onward * EXTENSION_SLOTS
        slot = min(max(slot, 0), self._last)
        return (vertex, (q, slot)) if tree.onward * (slot - int(tree.slot[vertex])) > 0 else None

    def _sample(self, tree: TimeTree) -> Aim | None:
        """Sample a configuration and a slot in which it can lie on a motion, and return them with the nearest vertex.

        Returns None if speed limits leave no slot for the configuration, or no vertex from which to reach it.
        """
        q = self._rng.uniform(self.ends.lower, self.ends.upper)
        earliest = int(self.pace.whole_slots((q - self.ends.start)[None])[0])
        latest = self._last - int(self.pace.whole_slots(self.ends.goals - q).min())
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
            The new vertex, and whether it is the target; None if the first slot is blocked.
        """
        rows, complete = tree.rows_towards(vertex, *to, max_slots)
        begin = int(tree.slot[vertex])
        steps_free = self.worlds.steps_free(begin if tree.onward > 0 else begin - 1, rows, tree.onward, self._over)
        if steps_free == 0:
            return None
        new_vertex = tree.add(rows[steps_free], begin + tree.onward * steps_free, vertex)
        return new_vertex, complete and steps_free == len(rows) - 1

    def _rows_through(self, forward: int, backward: int) -> Matrix:
        """Return the motion from the start to a goal through two vertices at the same place, one of each tree.

        Args:
            forward: Vertex of the tree from the start.
            backward: Vertex of the tree from the goals.

        Returns:
            The configuration at the begin of each slot, shape (k, n).
        """
        first, before = self._trees[0].branch(forward)
        second, after = self._trees[1].branch(backward)
        rows = np.vstack([first, second[::-1][1:]])
        slots = np.concatenate([before, after[::-1][1:]])
        return each_slot(rows, slots)

    def _improved(self, rows: Matrix) -> Matrix:
        """Shorten a motion, shape (k, n), and make it earlier, in turn, until it no longer becomes earlier."""
        while True:
            rows = self._shortened(rows)
            earlier = retimed(rows, self.pace, self.worlds, len(rows) - 2, self._over)
            if earlier is None:
                return rows
            rows = earlier

    def _shortened(self, rows: Matrix) -> Matrix:
        """Replace random pieces of a motion, shape (k, n), by straight ones if shorter and free; same arrival."""
        for _ in range(SHORTCUT_TRIES):
            if len(rows) < 3 or self._over():
                break
            a, b = sorted(self._rng.choice(len(rows), 2, replace=False).tolist())
            straight = each_slot(rows[[a, b]], np.array([0, b - a]))
            shorter = _length(straight) < _length(rows[a : b + 1]) - 1e-9
            if shorter and self.worlds.steps_free(a, straight, 1, self._over) == b - a:
                rows = np.vstack([rows[:a], straight, rows[b + 1 :]])

        return rows


def each_slot(rows: Matrix, slots: NDArray[np.int64]) -> Matrix:
    """Interpolate configurations linearly, for every slot from the first to the last one.

    Args:
        rows: Configurations, shape (m, n).
        slots: The slot of each row, increasing, shape (m,).

    Returns:
        Shape (k, n), one row for each slot.
    """
    clock = np.arange(slots[0], slots[-1] + 1)
    return np.stack([np.interp(clock, slots, column) for column in rows.T], axis=1)


def _length(rows: Matrix) -> float:
    return float(np.linalg.norm(np.diff(rows, axis=0), axis=1).sum())


@dataclass(frozen=True, slots=True, eq=False)
class Pace:
    """How far a robot goes in a slot.

    Attributes:
        change: Largest change of each joint [rad or m], shape (n,).
        step: Largest step of the configuration, joints counted alike [unit of the space]; inf for no bound.
    """

    change: Vector
    step: float

    def slots(self, moves: Matrix) -> Vector:
        """Return the least number of slots that each of the moves, shape (m, n), takes, as fractions; shape (m,)."""
        joints = (np.abs(moves) / self.change).max(axis=1)
        slots: Vector = np.maximum(joints, np.linalg.norm(moves, axis=1) / self.step)
        return slots

    def whole_slots(self, moves: Matrix) -> NDArray[np.int64]:
        """Return the same number rounded up to whole slots, at most ``NEVER``; shape (m,)."""
        return np.minimum(np.ceil(self.slots(moves) - ROUNDING), NEVER).astype(np.int64)


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
        """Interpolate slot by slot from a vertex straight towards a configuration.

        Args:
            vertex: The vertex to start from.
            q: Target configuration, shape (n,).
            slot: Slot of the target.
            max_slots: Largest number of slots to go.

        Returns:
            Configurations, shape (k, n), that of the vertex first, and whether the last one is the target.
        """
        gap = abs(slot - int(self._slot[vertex]))
        shares = np.arange(min(gap, max_slots) + 1)[:, None] / gap
        rows: Matrix = self._q[vertex] + shares * (q - self._q[vertex])
        if gap <= max_slots:
            rows[-1] = q
        return rows, gap <= max_slots

    def branch(self, vertex: int) -> tuple[Matrix, NDArray[np.int64]]:
        """Return the branch from the root to a vertex: configurations, shape (k, n), and slots, shape (k,)."""
        numbers = [vertex]
        while self._parent[numbers[-1]] >= 0:
            numbers.append(int(self._parent[numbers[-1]]))
        return self._q[numbers[::-1]], self._slot[numbers[::-1]]


def at_full_speed(rows: Matrix, pace: Pace) -> Matrix:
    """Return places along a polyline, shape (k, n), about one slot at full speed apart; both ends stay.

    The number of slots is rounded up and they are made equal, so no speed limit is exceeded. Shape (m, n).
    """
    slots_along = np.concatenate([[0.0], np.cumsum(pace.slots(np.diff(rows, axis=0)))])
    moving = np.concatenate([[True], np.diff(slots_along) > 0.0])
    count = max(int(np.ceil(slots_along[-1] - 1e-9)), 1)
    slots_of_places = slots_along[-1] * np.arange(count + 1) / count
    places = np.stack([np.interp(slots_of_places, slots_along[moving], column) for column in rows[moving].T], axis=1)
    places[[0, -1]] = rows[[0, -1]]
    return places


def retimed(rows: Matrix, pace: Pace, worlds: ForeseenWorlds, max_slots: int, stop: Stop) -> Matrix | None:
    """Follow a path with the fewest slots of time.

    Along a fixed path only its timing is left to choose, as in the decomposition of [71]. Here it is chosen in whole
    slots: in each slot the robot goes on at full speed to the next place, or stands still. A breadth-first search with
    a double-ended queue (going on costs 0, standing still costs 1) finds the timing with the fewest slots of waiting.

    Args:
        rows: The configuration at the begin of each slot, shape (k, n).
        pace: How far the robot can go in a slot.
        worlds: Checks which motions are free in which slot.
        max_slots: Largest number of slots of the result.
        stop: Ends the search without a result when it returns True.

    Returns:
        The configuration at the begin of each slot, shape (m, n); None if there is no such timing.
    """
    places = at_full_speed(rows, pace)
    last = len(places) - 1
    begin = (0, 0)
    previous: dict[Place, Place] = {begin: begin}
    queue = deque([begin])  # ordered by the number of slots spent standing still

    while queue and not stop():
        slot, k = queue.popleft()
        if k == last:
            return places[_numbers(previous, (slot, k))]
        if slot + last - k > max_slots:
            continue

        # Going on comes last and is added on the left, so it is taken before standing still.
        for advance in (0, 1):
            place = (slot + 1, k + advance)
            if place in previous or (not advance and slot + 1 + last - k > max_slots):
                continue
            if worlds.free(slot, places[k], places[k + advance]):
                previous[place] = (slot, k)
                if advance:
                    queue.appendleft(place)
                else:
                    queue.append(place)

    return None


def _numbers(previous: dict[Place, Place], end: Place) -> list[int]:
    """Return the index of the place in each slot, from the first slot to ``end``."""
    numbers = [end[1]]
    place = end
    while previous[place] != place:
        place = previous[place]
        numbers.append(place[1])
    return numbers[::-1]
