"""Evasive moves: where a robot goes when an obstacle comes nearer than it should.

DRRT-Con [1, ch. 5.2] leaves this open ("optional evasive move"); here it is the first tick of the straight motion that
keeps the largest distance.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.world.motion_queries import MotionQueries
from rrtik_ompl.world.moving_world import MovingWorld

RANDOM_DIRECTIONS = 192  # that are compared
SPEED_SHARES = (0.25, 1.0)  # of the highest speed, at which each direction is tried
HORIZON_TICKS = (1, 3, 6, 12)  # ticks after which a motion is rated
MAX_LOSS_SHARE = 0.1  # of the distance to keep, or of the one that there is now, that a move may cost
MAX_CANDIDATES = 16  # of the best motions, which are checked for self-collision


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
    """The configuration after a tick that lets the arm keep its distance to obstacles, or None to stand still.

    Straight motions are compared. Those that keep the distance after this tick come first; where none does, those that
    keep the largest distance in the ticks to come: to move away from the nearest obstacle alone would lead to the
    middle between two that close in.

    Args:
        q: The robot's configuration, shape (n,).
        path: The robot's path, whose next waypoint is one of the directions; or None.
        step: How far the robot can go in a tick [unit of the space].
        max_change: How far each joint can move in a tick, shape (n,).
        distance: To keep to every obstacle [m].
        ahead: The world so many ticks ahead, as predicted, without self-collision. It may be the same object each time.
        alone: Checks limits and self-collision.
        rng: Random numbers.
    """
    moves = max_change * _directions(q, max_change, rng, path)
    moves *= np.minimum(step / np.linalg.norm(moves, axis=1), 1.0)[:, None]
    moves = np.vstack([np.zeros_like(q), *(speed * moves for speed in SPEED_SHARES)])

    world_now = ahead(0)
    lower = world_now.robot.lower
    upper = world_now.robot.upper
    ends = np.clip(q + moves, lower, upper)
    clearance_half_way = world_now.clearance(0.5 * (q + ends))
    clearance_after_tick = world_now.clearance(ends)

    least_ahead = np.full(len(moves), np.inf)
    for ticks in HORIZON_TICKS:
        least_ahead = np.minimum(least_ahead, ahead(ticks).clearance(np.clip(q + ticks * moves, lower, upper)))

    least_clearance = clearance_after_tick[0] - MAX_LOSS_SHARE * max(abs(clearance_after_tick[0]), distance)
    usable = np.flatnonzero(np.minimum(clearance_half_way, clearance_after_tick) >= least_clearance)
    # Where a motion keeps the distance after this tick, such motions come first; else the ticks to come decide alone.
    rated_clearance = np.zeros_like(clearance_after_tick)
    if clearance_after_tick.max() >= distance:
        rated_clearance = np.minimum(clearance_after_tick, 2.0 * distance)
    order = usable[np.lexsort((-least_ahead[usable], -rated_clearance[usable]))][:MAX_CANDIDATES]

    free = alone.motion_valid_batch(np.tile(q, (len(order), 1)), ends[order])
    best = int(order[np.flatnonzero(free)[0]]) if free.any() else 0
    return ends[best] if best else None


def _directions(q: Vector, max_change: Vector, rng: np.random.Generator, path: Matrix | None) -> Matrix:
    """Single joints, random directions, and towards the next waypoint and back; largest part 1, shape (m, n)."""
    random = rng.uniform(-1.0, 1.0, (RANDOM_DIRECTIONS, len(q)))
    rows = [np.eye(len(q)), -np.eye(len(q)), random / np.abs(random).max(axis=1, keepdims=True)]
    if path is not None and len(path) > 1 and (path[1] != q).any():
        to_waypoint = (path[1] - q) / max_change
        rows.append(np.outer([1.0, -1.0], to_waypoint / np.abs(to_waypoint).max()))
    return np.vstack(rows)
