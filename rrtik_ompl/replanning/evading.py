"""Evasive moves: where a robot goes when an obstacle comes nearer than it should.

DRRT-Con [1, ch. 5.2] leaves this open ("optional evasive move"). Here the robot makes the first tick of the straight
motion that keeps the largest distance to obstacles. Where a bound on their speed is stated, see :mod:`.refuge`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.world.motion_queries import MotionQueries
from rrtik_ompl.world.moving_world import MovingWorld

RANDOM_DIRECTIONS = 192  # number of random directions that are compared
SPEED_SHARES = (0.25, 1.0)  # shares of the highest speed at which each direction is tried
HORIZON_TICKS = (1, 3, 6, 12)  # numbers of ticks after which a motion is rated
MAX_LOSS_SHARE = 0.1  # A move may cost this share of the required or of the present distance, whichever is larger.
MAX_CANDIDATES = 16  # number of the best motions that are checked for self-collision


def evasion(
    q: Vector,
    path: Matrix | None,
    *,
    step: float,
    max_change: Vector,
    distance: float,
    ahead: Callable[[int], MovingWorld],
    alone: MotionQueries,
    rng: np.random.Generator,
) -> Vector | None:
    """Return the configuration, shape (n,), to move to in this tick to evade obstacles, or None to stand still.

    Straight motions in many directions are compared, and standing still is one of them. Motions that lose too much
    clearance within this tick are dropped. If any motion has the required distance after the tick, the others are
    ordered by their clearance then (twice the required distance is as good as more), and equal ones by their smallest
    clearance in the ticks to come. Otherwise only the ticks to come count: moving away from the nearest obstacle alone
    would lead to the middle between two that close in. The best of them that is free of self-collision is taken.

    Args:
        q: The robot's configuration, shape (n,).
        path: The robot's path, towards and away from whose next waypoint is tried too; or None.
        step: How far the robot can go in a tick [unit of the space].
        max_change: How far each joint can move in a tick [rad or m], shape (n,).
        distance: Required distance to every obstacle [m].
        ahead: Returns the world predicted so many ticks ahead, without self-collision. It may move and return the same
            object each time.
        alone: Checks limits and self-collision.
        rng: Source of the random directions.
    """
    # The motions of one tick, standing still first.
    moves = max_change * directions(q, max_change, rng, path, RANDOM_DIRECTIONS)
    moves *= np.minimum(step / np.linalg.norm(moves, axis=1), 1.0)[:, None]
    moves = np.vstack([np.zeros_like(q), *(speed * moves for speed in SPEED_SHARES)])

    # Clearances in this tick and in the ticks to come.
    world_now = ahead(0)
    lower = world_now.robot.lower
    upper = world_now.robot.upper
    ends = np.clip(q + moves, lower, upper)
    clearance_half_way = world_now.clearance(0.5 * (q + ends))
    clearance_after_tick = world_now.clearance(ends)

    least_ahead = np.full(len(moves), np.inf)
    for ticks in HORIZON_TICKS:
        least_ahead = np.minimum(least_ahead, ahead(ticks).clearance(np.clip(q + ticks * moves, lower, upper)))

    # Order the motions that lose little: first by the rating of this tick, then by the ticks to come.
    least_clearance = clearance_after_tick[0] - MAX_LOSS_SHARE * max(abs(clearance_after_tick[0]), distance)
    usable = np.flatnonzero(np.minimum(clearance_half_way, clearance_after_tick) >= least_clearance)
    # If no motion has the required distance after this tick, all rate alike, and the ticks to come decide.
    rated_clearance = np.zeros_like(clearance_after_tick)
    if clearance_after_tick.max() >= distance:
        rated_clearance = np.minimum(clearance_after_tick, 2.0 * distance)
    order = usable[np.lexsort((-least_ahead[usable], -rated_clearance[usable]))][:MAX_CANDIDATES]

    free = alone.motion_valid_batch(np.tile(q, (len(order), 1)), ends[order])
    best = int(order[np.flatnonzero(free)[0]]) if free.any() else 0
    return ends[best] if best else None


def directions(q: Vector, max_change: Vector, rng: np.random.Generator, path: Matrix | None, count: int) -> Matrix:
    """Return directions to try in units of ``max_change``, shape (m, n); the largest entry of each is 1 or -1.

    They are each joint by itself in both senses, ``count`` random directions, and the direction to the path's next
    waypoint and its opposite.
    """
    random = rng.uniform(-1.0, 1.0, (count, len(q)))
    rows = [np.eye(len(q)), -np.eye(len(q)), random / np.abs(random).max(axis=1, keepdims=True)]
    if path is not None and len(path) > 1 and (path[1] != q).any():
        to_waypoint = (path[1] - q) / max_change
        rows.append(np.outer([1.0, -1.0], to_waypoint / np.abs(to_waypoint).max()))
    return np.vstack(rows)
