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
