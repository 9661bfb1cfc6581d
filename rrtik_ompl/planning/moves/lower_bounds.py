"""Lower bounds of the number of single-joint moves between two configurations.

:func:`sharper_bound` proves that one move more than there are joints to move is not enough. A route of that many moves
has a single free value: the value where the joint that moves twice turns back. (If only one joint has to move, the same
holds for three moves: another joint leaves and returns.) The range of the free value is halved until each part is
refuted: every route has a collision so deep that no value within the part avoids it.

:func:`reach_bound`, for two joints, counts the moves through cells that are not surely in collision. The range of both
joints is divided into cells. A cell is closed if its middle collides so deeply that no configuration in the cell is
free. Every free route stays in open cells, and a move of one joint stays in one row of them. So a goal whose cell is
first reached after k moves through open cells is not reached in fewer than k moves. More joints would need smaller
cells than are practical, because the depth of a collision has to exceed the reach of a cell.
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

MOST_WORK = 4096  # limit of the parts of a range times the corners of the other joints
SMALLEST_PART = 1e-5  # least size of a part, as a share of the range
PROBES = 4  # longest colliding stretches of a motion; the depth is computed in their middles
MOST_CORNERS = 256
START, FREE, GOAL = range(3)  # states of the free joint

# Verdicts on a part of the range of the free joint, see `OneFreeValue._verdict`.
REFUTED = "refuted"
MIDDLE_IS_FREE = "middle is free"
UNDECIDED = "undecided"

CELLS = (64, 128, 256)  # cells per joint in successive divisions, each a multiple of the one before
MOST_DEPTHS = 20_000  # limit of computed depths, about 30 microseconds each
AT_ONCE = 256  # depths computed between two looks at the clock

Place: TypeAlias = tuple[int, int]  # bit mask of the other joints that have arrived, and state of the free joint
Step: TypeAlias = tuple[Place, Place]


def sharper_bound(world: World, joints: Sequence[int], start: Vector, goal: Vector, stop: Stop) -> int:
    """Return a lower bound of the moves between two configurations that no route without detours joins.

    Args:
        world: Checks motions; their collisions are taken as exact, whatever the motion resolution.
        joints: The joints that may move.
        start: Shape (n,).
        goal: Shape (n,).
        stop: Returns True to end the work; nothing is proven then.

    Returns:
        With c joints that differ: c + 2 (4 for c = 1) if c + 1 moves (3 for c = 1) are proven not to be enough; else c
        + 1 (3 for c = 1).
    """
    changing = np.flatnonzero(moved(start, goal)).tolist()
    if len(changing) == 1:  # another joint has to leave and return
        bound = 3
        may_move_twice = [j for j in joints if j not in changing]
    else:
        bound = len(changing) + 1
        may_move_twice = changing
    proofs = (OneFreeValue(world, start, goal, joint, stop).refuted() for joint in may_move_twice)
    return bound + 1 if all(proofs) else bound


def remembered(world: World, joints: Sequence[int], stop: Stop) -> Callable[[Vector, Vector], int]:
    """Return :func:`sharper_bound` of a world as a function that caches the bound of each start and goal.

    A bound whose computation was stopped is not cached.
    """
    bounds: dict[tuple[bytes, bytes], int] = {}

    def bound(start: Vector, goal: Vector) -> int:
        """Return the bound between a start and a goal, shapes (n,)."""
        ends = (start.tobytes(), goal.tobytes())
        if ends not in bounds:
            found = sharper_bound(world, joints, start, goal, stop)
            if stop():
                return found
            bounds[ends] = found
        return bounds[ends]

    return bound


class OneFreeValue:
    """All routes on which one joint moves twice and each other joint that differs moves once.

    Such a route is fixed by the order of its moves and one free value: where the joint that moves twice turns back. A
    place of a route is a pair of the other joints that have arrived and the state of the free joint (START, FREE or
    GOAL).

    Args:
        world: Checks motions.
        start: Shape (n,).
        goal: Shape (n,).
        joint: The joint that moves twice.
        stop: Returns True to end the work.
    """

    def __init__(self, world: World, start: Vector, goal: Vector, joint: int, stop: Stop) -> None:
        self._world = world
        self._start = start
        self._goal = goal
        self._joint = joint
        self._stop = stop

        self._others = [k for k in np.flatnonzero(moved(start, goal)).tolist() if k != joint]
        self._all_arrived = (1 << len(self._others)) - 1  # the mask when all others have arrived
        self._depth = OverlapDepth(world.robot, world.bodies, world.pairs)

        ends = start[joint], goal[joint]
        self._lower = float(max(world.robot.lower[joint], min(ends) - TAU))
        self._upper = float(min(world.robot.upper[joint], max(ends) + TAU))

    def refuted(self) -> bool:
        """Check whether every such route is proven to collide.

        Parts of the range of the free value are refuted or halved. A part whose middle gives a free route, a part that
        is too small, too much work or `stop` ends the attempt, and nothing is proven.
        """
        if self._all_arrived >= MOST_CORNERS:
            return False

        # Moves from or to the ends of the free joint do not depend on the free value, so they are checked once.
        corners = range(self._all_arrived + 1)
        self._free_ranges = {(mask, end): self._free_range(mask, end) for end in (START, GOAL) for mask in corners}
        steps = [step for end in (START, GOAL) for step in self._steps_of_others(end)]
        self._free_steps = {step for step in steps if self._step_is_free(step, 0.0)}

        # Refute or halve the parts of the range, one after the other.
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
        """Decide whether a value from ``low`` to ``high`` of the free joint may give a free route.

        A route is searched that has no step known to be refuted; its steps are then examined, and refuted ones are
        excluded, until there is no route left or no further step of the route can be refuted.

        Returns:
            REFUTED if no value does, MIDDLE_IS_FREE if the value in the middle does, UNDECIDED if the part has to be
            halved.
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
        """Return a route from start to goal without a step that is refuted for all values of a part, or None.

        Args:
            low: Least value of the part.
            high: Greatest value of the part.
            refuted: Steps that are refuted while the free joint is in the part.
        """
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
        """Yield the places that one move reaches from a place, as far as the move may be free.

        Args:
            here: The place.
            low: Least value of the free joint in the part of its range.
            high: Greatest value of the free joint in that part.
            refuted: Steps that are refuted while the free joint is in the part.
        """
        mask, state = here
        for step in self._steps_from(here):
            may_be_free = step not in refuted if state == FREE else step in self._free_steps
            if may_be_free:
                yield step[1]

        # The free joint moves away from its start, or to its goal.
        if state != GOAL:
            lowest, highest = self._free_ranges[mask, START if state == START else GOAL]
            if low <= highest and high >= lowest:
                yield mask, state + 1

    def _steps_from(self, here: Place) -> list[Step]:
        """Return the moves of the other joints from a place."""
        mask, state = here
        return [(here, (mask | 1 << k, state)) for k in range(len(self._others)) if not mask >> k & 1]

    def _steps_of_others(self, state: int) -> list[Step]:
        """Return all moves of the other joints while the free joint is in a state."""
        return [step for mask in range(self._all_arrived + 1) for step in self._steps_from((mask, state))]

    def _configuration(self, place: Place, value: float) -> Vector:
        """Return the configuration at a place, shape (n,); ``value`` is that of the free joint if its state is FREE."""
        mask, state = place
        q = self._start.copy()
        arrived = [joint for k, joint in enumerate(self._others) if mask >> k & 1]
        q[arrived] = self._goal[arrived]
        q[self._joint] = (self._start[self._joint], value, self._goal[self._joint])[state]
        return q

    def _step_is_free(self, step: Step, value: float) -> bool:
        """Check whether the world finds a step free; ``value`` is that of the free joint if its state is FREE."""
        return self._world.motion_valid(*(self._configuration(place, value) for place in step))

    def _free_range(self, mask: int, end: int) -> tuple[float, float]:
        """Return the range in which the free joint can move from or to an end of its motion while the others rest.

        Args:
            mask: Which of the other joints have arrived.
            end: START or GOAL.

        Returns:
            Least and greatest joint value.
        """
        rows = self._step_configurations(((mask, FREE), (mask, FREE)), (self._lower, self._upper))
        here = self._configuration((mask, end), 0.0)[self._joint]
        hits = rows[~self._world.valid_batch(rows), self._joint]
        return hits[hits <= here].max(initial=self._lower), hits[hits >= here].min(initial=self._upper)

    def _step_configurations(self, step: Step, values: tuple[float, float]) -> Matrix:
        """Return configurations of a step, as dense as the world checks it, shape (k, n).

        Args:
            step: Begin and end.
            values: Value of the free joint at begin and end, where its state is FREE.
        """
        a = self._configuration(step[0], values[0])
        b = self._configuration(step[1], values[1])
        shares = np.linspace(0.0, 1.0, self._world.steps(a, b) + 1)[:, None]
        rows: Matrix = (1.0 - shares) * a + shares * b
        return rows

    def _step_is_refuted(self, step: Step, value: float, half_width: float) -> bool:
        """Check whether a step collides for all values of the free joint within ``half_width`` of ``value``.

        A change of the free joint moves no point of the arm farther than its weight times the change. A deeper overlap
        therefore persists.

        Args:
            step: Begin and end of the step.
            value: Middle of the range of the free joint [rad or m].
            half_width: Half the width of this range [rad or m].
        """
        rows = self._step_configurations(step, (value, value))
        needed_depth = float(self._world.weights[self._joint]) * half_width

        hits = np.flatnonzero(~self._world.valid_batch(rows))

        stretches = sorted(np.split(hits, np.flatnonzero(np.diff(hits) > 1) + 1), key=len, reverse=True)
        probes = [stretch[len(stretch) // 2] for stretch in stretches[:PROBES] if len(stretch)]
        return any(self._depth.travel(rows[k]) > needed_depth for k in probes)


def reach_bound(world: World, joints: Sequence[int], start: Vector, goal: Vector, known_moves: int, stop: Stop) -> int:
    """Return a lower bound of the moves of two joints between two configurations.

    Args:
        world: The world with the obstacles; only joints with limits have a bound.
        joints: The joints that may move.
        start: Shape (n,).
        goal: Shape (n,), the same as the start in all other joints.
        known_moves: Number of moves of a known route.
        stop: Returns True to end the work; the bound so far is returned then.

    Returns:
        At most ``known_moves``; 0 if there are not two joints, if one of them has no limits, or if there was no time.
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
        # Divide the cells further; parts of closed cells stay closed.
        finer = cells_per_joint // len(cell_is_closed)
        cell_is_closed = cell_is_closed.repeat(finer, axis=0).repeat(finer, axis=1)
        half_cell = 0.5 * (upper - lower) / cells_per_joint
        # Find the open cells whose middles collide.
        cells = np.argwhere(~cell_is_closed)
        middles = np.repeat(start[None], len(cells), axis=0)
        middles[:, chosen] = lower + (2 * cells + 1) * half_cell
        colliding = np.flatnonzero(~world.valid_batch(middles))
        if len(colliding) > depths_left or stop():
            break
        depths_left -= len(colliding)

        # Close those that collide more deeply than any point of the arm moves within the cell.
        reach_of_cell = float(world.weights[chosen] @ (half_cell + SAME))
        is_deep = _deeper_than(depth, middles[colliding], reach_of_cell, stop)
        if is_deep is None:
            break
        cell_is_closed[tuple(cells[colliding[is_deep]].T)] = True

        # Count the moves through open cells.
        ends = [_cell(q[chosen], lower, half_cell, cells_per_joint) for q in (start, goal)]
        bound = _moves_between(cell_is_closed, ends[0], ends[1], known_moves)
        if bound == known_moves:
            break
    return bound


def _deeper_than(depth: OverlapDepth, rows: Matrix, reach: float, stop: Stop) -> Mask | None:
    """Check which configurations, shape (m, n), collide more deeply than a reach [m]; None if there is no time."""
    is_deep = np.zeros(len(rows), dtype=bool)

    for k, q in enumerate(rows):
        if k % AT_ONCE == 0 and stop():
            return None
        is_deep[k] = depth.travel(q) > reach
    return is_deep


def _cell(values: Vector, lower: Vector, half_cell: Vector, cells_per_joint: int) -> tuple[int, int]:
    """Return the indices of the cell that contains two joint values."""
    first, second = np.clip((values - lower) // (2.0 * half_cell), 0, cells_per_joint - 1).astype(int).tolist()
    return first, second


def _moves_between(cell_is_closed: Mask, start: tuple[int, int], goal: tuple[int, int], max_moves: int) -> int:
    """Return the fewest moves along rows and columns of open cells from one cell to another, at most ``max_moves``."""
    reached = np.zeros_like(cell_is_closed)
    reached[start] = True
    for moves in range(max_moves):
        if reached[goal]:
            return moves
        reached = reached | _swept(reached, cell_is_closed) | _swept(reached.T, cell_is_closed.T).T
    return max_moves


def _swept(reached: Mask, cell_is_closed: Mask) -> Mask:
    """Return a mask of the open cells that moves along the second axis reach from the reached cells."""
    # Number the runs of open cells along the second axis; the offset keeps the numbers of different rows apart.
    runs = np.cumsum(np.insert(cell_is_closed, 0, True, axis=1), axis=1)[:, 1:]  # a number for each run of open cells
    runs += (cell_is_closed.shape[1] + 2) * np.arange(len(cell_is_closed))[:, None]
    # A run is swept if one of its open cells has been reached.
    met = np.zeros(int(runs.max()) + 1, dtype=bool)
    met[runs[reached & ~cell_is_closed]] = True
    swept: Mask = met[runs] & ~cell_is_closed
    return swept
