"""Proofs that a list of moves cannot be shorter.

:func:`sharper_bound`: whatever the one free value of such a list is, something collides. A route of one move more than
joints must move has a single free value: where the joint that moves twice turns back. The same holds for three moves if
one joint must move: another leaves and returns. The free value's range is halved until each part is refuted: on every
route is a collision so deep that no value of the part avoids it.

:func:`reach_bound`, for two joints: how many moves it takes through cells that are not surely in collision. The range
of both joints is cut into cells. A cell is closed if its middle collides so deeply that nothing within the cell is
free. Every free route stays in open cells, and a move of one joint stays in a row of them, so a goal whose cell is
first reached after k moves through open cells is not reached in fewer than k moves. More joints would need cells too
small for this: the depth of a collision has to exceed the reach of a cell.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from rrtik_ompl.base.arrays import TAU, Mask, Matrix, Vector
from rrtik_ompl.base.budget import Stop
from rrtik_ompl.geometry.collision.overlap_depth import OverlapDepth
from rrtik_ompl.model.transitions import SAME, moved
from rrtik_ompl.world.world import World

MOST_WORK = 4096  # parts of a range, times the corners of the other joints
SMALLEST_PART = 1e-5  # of a range
PROBES = 4  # stretches of a colliding motion in the middle of which the depth is computed
MOST_CORNERS = 256
START, FREE, GOAL = range(3)  # where the free joint is

# what is known of a part of its range, see `OneFreeValue._verdict`
REFUTED = "refuted"
MIDDLE_IS_FREE = "middle is free"
UNDECIDED = "undecided"

CELLS = (64, 128, 256)  # along each of two joints, one division after the other; each is cut into the next
MOST_DEPTHS = 20_000  # computed: each takes some 30 microseconds
AT_ONCE = 256  # of them between two looks at the clock

Place: TypeAlias = tuple[int, int]  # which of the other joints have arrived, a set of bits; where the free joint is
Step: TypeAlias = tuple[Place, Place]


def sharper_bound(world: World, joints: Sequence[int], start: Vector, goal: Vector, stop: Stop) -> int:
    """A lower bound of the moves between two configurations, shape (n,), that are not joined by the least number.

    Args:
        world: Checks motions, which are taken as they are, without regard to their resolution.
        joints: Those that may move.
        start: Where the moves begin.
        goal: Where they end.
        stop: True ends the work; nothing is proven then.

    Returns:
        With c joints that differ, c + 2 (4 for c = 1) if there is a proof that c + 1 (3 for c = 1) moves will not do;
        else c + 1 (3 for c = 1).
    """
    changing = np.flatnonzero(moved(start, goal)).tolist()
    if len(changing) == 1:  # another joint leaves and returns
        bound = 3
        may_move_twice = [j for j in joints if j not in changing]
    else:
        bound = len(changing) + 1
        may_move_twice = changing
    proofs = (OneFreeValue(world, start, goal, joint, stop).refuted() for joint in may_move_twice)
    return bound + 1 if all(proofs) else bound


def remembered(world: World, joints: Sequence[int], stop: Stop) -> Callable[[Vector, Vector], int]:
    """:func:`sharper_bound` of a world, computed once for each start and goal; again if it was stopped."""
    bounds: dict[tuple[bytes, bytes], int] = {}

    def bound(start: Vector, goal: Vector) -> int:
        """The bound between a start and a goal, shapes (n,)."""
        ends = (start.tobytes(), goal.tobytes())
        if ends not in bounds:
            found = sharper_bound(world, joints, start, goal, stop)
            if stop():
                return found
            bounds[ends] = found
        return bounds[ends]

    return bound


class OneFreeValue:
    """All routes in which each joint that differs moves once, but one joint moves twice and so has a free value.

    Args:
        world: Checks motions.
        start: Shape (n,).
        goal: Shape (n,).
        joint: The one that moves twice.
        stop: True ends the work.
    """

    def __init__(self, world: World, start: Vector, goal: Vector, joint: int, stop: Stop) -> None:
        self._world = world
        self._start = start
        self._goal = goal
        self._joint = joint
        self._stop = stop

        self._others = [k for k in np.flatnonzero(moved(start, goal)).tolist() if k != joint]
        self._all_arrived = (1 << len(self._others)) - 1  # the mask of a place where all others have arrived
        self._depth = OverlapDepth(world.robot, world.bodies, world.pairs)

        ends = start[joint], goal[joint]
        self._lower = float(max(world.robot.lower[joint], min(ends) - TAU))
        self._upper = float(min(world.robot.upper[joint], max(ends) + TAU))

    def refuted(self) -> bool:
        """Whether there is a proof that something collides on every such route."""
        if self._all_arrived >= MOST_CORNERS:
            return False

        corners = range(self._all_arrived + 1)
        self._free_ranges = {(mask, end): self._free_range(mask, end) for end in (START, GOAL) for mask in corners}
        steps = [step for end in (START, GOAL) for step in self._steps_of_others(end)]
        self._free_steps = {step for step in steps if self._step_is_free(step, 0.0)}

        parts = [(self._lower, self._upper)]
        for _ in range(MOST_WORK // (self._all_arrived + 1)):
            if not parts:
                return True
            low, high = parts.pop()
            if self._stop():
                return False

            verdict = self._verdict(low, high)
            too_small = high - low < SMALLEST_PART * (self._upper - self._lower)
            if verdict == MIDDLE_IS_FREE or too_small:
                return False
            if verdict == UNDECIDED:
                parts += [(low, 0.5 * (low + high)), (0.5 * (low + high), high)]
        return False

    def _verdict(self, low: float, high: float) -> str:
        """Whether some value from ``low`` to ``high`` of the free joint makes a free route.

        Returns:
            REFUTED if none does, MIDDLE_IS_FREE if that in the middle does, UNDECIDED if halves are to be looked at.
        """
        middle = 0.5 * (low + high)
        refuted = set[Step]()
        while True:
            route = self._route(low, high, refuted)
            if route is None:
                return REFUTED
            free = [step for step in pairwise(route) if step[0][1] == step[1][1] == FREE]

            fresh = {step for step in free if self._step_is_refuted(step, middle, 0.5 * (high - low))}
            if not fresh:
                middle_is_free = all(self._step_is_free(step, middle) for step in pairwise(route))
                return MIDDLE_IS_FREE if middle_is_free else UNDECIDED
            refuted |= fresh

    def _route(self, low: float, high: float, refuted: set[Step]) -> list[Place] | None:
        """A route from start to goal on which nothing is known to collide for all values of a part, or None."""
        origin: dict[Place, Place | None] = {(0, START): None}
        for here in ((mask, state) for state in (START, FREE, GOAL) for mask in range(self._all_arrived + 1)):
            if here in origin:
                for there in self._next_places(here, low, high, refuted):
                    origin.setdefault(there, here)

        place: Place | None = (self._all_arrived, GOAL)
        if place not in origin:
            return None

        route = []
        while place is not None:
            route.append(place)
            place = origin[place]
        return route[::-1]

    def _next_places(self, here: Place, low: float, high: float, refuted: set[Step]) -> Iterator[Place]:
        """The next places of a route."""
        mask, state = here
        for step in self._steps_from(here):
            may_be_free = step not in refuted if state == FREE else step in self._free_steps
            if may_be_free:
                yield step[1]

        if state != GOAL:  # the free joint moves: away from its start, or to its goal
            lowest, highest = self._free_ranges[mask, START if state == START else GOAL]
            if low <= highest and high >= lowest:
                yield mask, state + 1

    def _steps_from(self, here: Place) -> list[Step]:
        """The moves of the other joints from a place."""
        mask, state = here
        return [(here, (mask | 1 << k, state)) for k in range(len(self._others)) if not mask >> k & 1]

    def _steps_of_others(self, state: int) -> list[Step]:
        """All moves of the other joints while the free joint is in a state."""
        return [step for mask in range(self._all_arrived + 1) for step in self._steps_from((mask, state))]

    def _configuration(self, place: Place, value: float) -> Vector:
        """Where the arm is at a place; ``value`` is that of the free joint where it is free."""
        mask, state = place
        q = self._start.copy()
        arrived = [joint for k, joint in enumerate(self._others) if mask >> k & 1]
        q[arrived] = self._goal[arrived]
        q[self._joint] = (self._start[self._joint], value, self._goal[self._joint])[state]
        return q

    def _step_is_free(self, step: Step, value: float) -> bool:
        """Whether the world finds a move free, the free joint at a value where it is free."""
        return self._world.motion_valid(*(self._configuration(place, value) for place in step))

    def _free_range(self, mask: int, end: int) -> tuple[float, float]:
        """Between which values the free joint could move to or from an end of its motion, while the others rest."""
        rows = self._step_configurations(((mask, FREE), (mask, FREE)), (self._lower, self._upper))
        here = self._configuration((mask, end), 0.0)[self._joint]
        hits = rows[~self._world.valid_batch(rows), self._joint]
        return hits[hits <= here].max(initial=self._lower), hits[hits >= here].min(initial=self._upper)

    def _step_configurations(self, step: Step, values: tuple[float, float]) -> Matrix:
        """Configurations of a move as dense as the world checks it, shape (k, n).

        ``values``: of the free joint, where it is free, at the begin and at the end.
        """
        a = self._configuration(step[0], values[0])
        b = self._configuration(step[1], values[1])
        shares = np.linspace(0.0, 1.0, self._world.steps(a, b) + 1)[:, None]
        rows: Matrix = (1.0 - shares) * a + shares * b
        return rows

    def _step_is_refuted(self, step: Step, value: float, half_width: float) -> bool:
        """Whether a move collides wherever the free joint is within ``half_width`` of a value."""
        rows = self._step_configurations(step, (value, value))
        needed_depth = float(self._world.weights[self._joint]) * half_width

        hits = np.flatnonzero(~self._world.valid_batch(rows))

        stretches = sorted(np.split(hits, np.flatnonzero(np.diff(hits) > 1) + 1), key=len, reverse=True)
        probes = [stretch[len(stretch) // 2] for stretch in stretches[:PROBES] if len(stretch)]
        return any(self._depth.travel(rows[k]) > needed_depth for k in probes)


def reach_bound(world: World, joints: Sequence[int], start: Vector, goal: Vector, known_moves: int, stop: Stop) -> int:
    """No route between two configurations, shapes (n,), that moves these joints alone has fewer moves.

    Args:
        world: Holds the solids; only joints with limits are bounded.
        joints: Those that may move.
        start: Where the moves begin.
        goal: Where they end; the same as the start in all other joints.
        known_moves: Moves of a route that is known.
        stop: True ends the work.

    Returns:
        At most ``known_moves``; 0 if there are not two joints, one has no limits, or there was no time.
    """
    chosen = list(joints)
    lower = world.robot.lower[chosen]
    upper = world.robot.upper[chosen]
    if len(chosen) != 2 or not np.isfinite([lower, upper]).all() or not (lower < upper).all():
        return 0

    depth = OverlapDepth(world.robot, world.bodies, world.pairs)
    depths_left = MOST_DEPTHS
    bound = 0
    cell_is_closed = np.zeros((1, 1), dtype=bool)

    for cells_per_joint in CELLS:
        finer = cells_per_joint // len(cell_is_closed)
        cell_is_closed = cell_is_closed.repeat(finer, axis=0).repeat(finer, axis=1)
        half_cell = 0.5 * (upper - lower) / cells_per_joint
        cells = np.argwhere(~cell_is_closed)
        middles = np.repeat(start[None], len(cells), axis=0)
        middles[:, chosen] = lower + (2 * cells + 1) * half_cell
        colliding = np.flatnonzero(~world.valid_batch(middles))
        if len(colliding) > depths_left or stop():
            break
        depths_left -= len(colliding)

        reach_of_cell = float(world.weights[chosen] @ (half_cell + SAME))
        is_deep = _deeper_than(depth, middles[colliding], reach_of_cell, stop)
        if is_deep is None:
            break
        cell_is_closed[tuple(cells[colliding[is_deep]].T)] = True

        ends = [_cell(q[chosen], lower, half_cell, cells_per_joint) for q in (start, goal)]
        bound = _moves_between(cell_is_closed, ends[0], ends[1], known_moves)
        if bound == known_moves:
            break
    return bound


def _deeper_than(depth: OverlapDepth, rows: Matrix, reach: float, stop: Stop) -> Mask | None:
    """Which configurations, shape (m, n), collide more deeply than a reach [m]; None if there is no time."""
    is_deep = np.zeros(len(rows), dtype=bool)

    for k, q in enumerate(rows):
        if k % AT_ONCE == 0 and stop():
            return None
        is_deep[k] = depth.travel(q) > reach
    return is_deep


def _cell(values: Vector, lower: Vector, half_cell: Vector, cells_per_joint: int) -> tuple[int, int]:
    """The cell that two joint values are in."""
    first, second = np.clip((values - lower) // (2.0 * half_cell), 0, cells_per_joint - 1).astype(int).tolist()
    return first, second


def _moves_between(cell_is_closed: Mask, start: tuple[int, int], goal: tuple[int, int], max_moves: int) -> int:
    """Fewest moves along rows of open cells, at most so many."""
    reached = np.zeros_like(cell_is_closed)
    reached[start] = True
    for moves in range(max_moves):
        if reached[goal]:
            return moves
        reached = reached | _swept(reached, cell_is_closed) | _swept(reached.T, cell_is_closed.T).T
    return max_moves


def _swept(reached: Mask, cell_is_closed: Mask) -> Mask:
    """The cells that a move along the second axis reaches."""
    runs = np.cumsum(np.insert(cell_is_closed, 0, True, axis=1), axis=1)[:, 1:]  # grows at closed cells
    runs += (cell_is_closed.shape[1] + 2) * np.arange(len(cell_is_closed))[:, None]
    met = np.zeros(int(runs.max()) + 1, dtype=bool)
    met[runs[reached & ~cell_is_closed]] = True
    swept: Mask = met[runs] & ~cell_is_closed
    return swept
