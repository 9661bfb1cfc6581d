"""A lower bound of the moves of two joints: how many moves it takes through cells that are not surely in collision.

The range of both joints is cut into cells. A cell is closed if its middle collides so deeply that nothing within the
cell is free. Every free route stays in open cells, and a move of one joint stays in a row of them, so a goal whose
cell is first reached after k moves through open cells is not reached in fewer than k moves. More joints would need
cells too small for this: the depth of a collision has to exceed the reach of a cell.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.base.budget import Stop
from rrtik_ompl.geometry.collision.overlap_depth import OverlapDepth
from rrtik_ompl.model.transitions import SAME
from rrtik_ompl.world.world import World

CELLS = (64, 128, 256)  # along each joint, one division after the other; each is cut into the next
MOST_DEPTHS = 20_000  # computed: each takes some 30 microseconds
AT_ONCE = 256  # of them between two looks at the clock


def reach_bound(world: World, joints: Sequence[int], start: Vector, goal: Vector, most: int, stop: Stop) -> int:
    """No route between two configurations, shapes (n,), that moves these joints alone has fewer moves.

    Args:
        world: Holds the solids; only joints with limits are bounded.
        joints: Those that may move.
        start: Where the moves begin.
        goal: Where they end; the same as the start in all other joints.
        most: Moves of a route that is known.
        stop: True ends the work.

    Returns:
        At most ``most``; 0 if there are not two joints, one has no limits, or there was no time.
    """
    chosen = list(joints)
    lower = world.robot.lower[chosen]
    upper = world.robot.upper[chosen]
    if len(chosen) != 2 or not np.isfinite([lower, upper]).all() or not (lower < upper).all():
        return 0

    depth = OverlapDepth(world.robot, world.bodies, world.pairs)
    left = MOST_DEPTHS
    bound = 0
    closed = np.zeros((1, 1), dtype=bool)

    for count in CELLS:
        closed = closed.repeat(count // len(closed), axis=0).repeat(count // closed.shape[1], axis=1)
        half = 0.5 * (upper - lower) / count
        places = np.argwhere(~closed)
        rows = np.repeat(start[None], len(places), axis=0)
        rows[:, chosen] = lower + (2 * places + 1) * half
        hits = np.flatnonzero(~world.valid_batch(rows))
        if len(hits) > left or stop():
            break
        left -= len(hits)

        deep = _deep(depth, rows[hits], float(world.weights[chosen] @ (half + SAME)), stop)
        if deep is None:
            break
        closed[tuple(places[hits[deep]].T)] = True

        ends = [_cell(q[chosen], lower, half, count) for q in (start, goal)]
        bound = _moves_between(closed, ends[0], ends[1], most)
        if bound == most:
            break
    return bound


def _deep(depth: OverlapDepth, rows: Matrix, reach: float, stop: Stop) -> Mask | None:
    """Which configurations, shape (m, n), collide more deeply than a reach [m]; None if there is no time."""
    found = np.zeros(len(rows), dtype=bool)

    for k, q in enumerate(rows):
        if k % AT_ONCE == 0 and stop():
            return None
        found[k] = depth.travel(q) > reach
    return found


def _cell(values: Vector, lower: Vector, half: Vector, count: int) -> tuple[int, int]:
    """The cell that two joint values are in."""
    first, second = np.clip((values - lower) // (2.0 * half), 0, count - 1).astype(int).tolist()
    return first, second


def _moves_between(closed: Mask, start: tuple[int, int], goal: tuple[int, int], most: int) -> int:
    """Fewest moves along rows of open cells, at most so many."""
    reached = np.zeros_like(closed)
    reached[start] = True
    for moves in range(most):
        if reached[goal]:
            return moves
        reached = reached | _swept(reached, closed) | _swept(reached.T, closed.T).T
    return most


def _swept(reached: Mask, closed: Mask) -> Mask:
    """The cells that a move along the second axis reaches."""
    runs = np.cumsum(np.insert(closed, 0, True, axis=1), axis=1)[:, 1:]  # grows at closed cells
    runs += (closed.shape[1] + 2) * np.arange(len(closed))[:, None]
    met = np.zeros(int(runs.max()) + 1, dtype=bool)
    met[runs[reached & ~closed]] = True
    swept: Mask = met[runs] & ~closed
    return swept
