"""Out of the way: where a robot goes when an obstacle comes nearer than it should.

The DRRT-Con paper leaves this open ("optional evasive move"); here it is the first tick of the straight way that keeps
farthest away.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.scene import Scene
from rrtik_ompl.world.motion_queries import MotionQueries
from rrtik_ompl.world.moving_world import MovingWorld

TRIES = 192  # directions that are compared
SPEEDS = (0.25, 1.0)  # at which the robot may go in each of them, of the fastest
AHEAD = (1, 3, 6, 12)  # ticks after which a way is looked at
KEPT = 0.9  # of the distance that there is now, what a move must leave
ASKED = 16  # of the best ways, how many may be asked for self-collision


def evasion(
    q: Vector,
    step: float,
    most: Vector,
    room: float,
    near: MovingWorld,
    later: Callable[[int], Scene],
    alone: MotionQueries,
    rng: np.random.Generator,
    path: Matrix | None,
) -> Vector | None:
    """Where to go in a tick so that the arm can stay away from the obstacles, or None to stand still.

    Ways straight on are compared. What leaves enough room after this tick comes first, and where nothing does, what
    keeps farthest away in the ticks to come: to move away from the nearest obstacle alone would lead to the middle
    between two that close in.

    Args:
        q: Where the robot is, shape (n,).
        step: How far the robot can go in a tick [unit of the space].
        most: How far each joint can move in a tick, shape (n,).
        room: What is far enough from every obstacle [m].
        near: A world without self-collision, which is moved.
        later: The scene so many ticks ahead, as far as it can be told.
        alone: Judges limits and self-collision.
        rng: Random numbers.
        path: The robot's path, whose next waypoint is one of the directions; or None.
    """
    moves = most * _directions(q, most, rng, path)
    moves *= np.minimum(step / np.linalg.norm(moves, axis=1), 1.0)[:, None]
    moves = np.vstack([np.zeros_like(q), *(speed * moves for speed in SPEEDS)])
    lower, upper = near.robot.lower, near.robot.upper
    ends = np.clip(q + moves, lower, upper)
    near.move(later(0))
    middle, end = near.clearance(0.5 * (q + ends)), near.clearance(ends)
    future = np.full(len(moves), np.inf)
    for ticks in AHEAD:
        near.move(later(ticks))
        future = np.minimum(future, near.clearance(np.clip(q + ticks * moves, lower, upper)))
    usable = np.flatnonzero(np.minimum(middle, end) >= KEPT * end[0])
    enough = np.minimum(end, 2.0 * room) if end.max() >= room else np.zeros_like(end)
    order = usable[np.lexsort((-future[usable], -enough[usable]))][:ASKED]
    free = alone.motion_valid_batch(np.tile(q, (len(order), 1)), ends[order])
    best = int(order[np.flatnonzero(free)[0]]) if free.any() else 0
    return ends[best] if best else None


def _directions(q: Vector, most: Vector, rng: np.random.Generator, path: Matrix | None) -> Matrix:
    """Single joints, random directions, and towards the next waypoint and back; largest part 1, shape (m, n)."""
    drawn = rng.uniform(-1.0, 1.0, (TRIES, len(q)))
    rows = [np.eye(len(q)), -np.eye(len(q)), drawn / np.abs(drawn).max(axis=1, keepdims=True)]
    if path is not None and len(path) > 1 and (path[1] != q).any():
        way = (path[1] - q) / most
        rows.append(np.outer([1.0, -1.0], way / np.abs(way).max()))
    return np.vstack(rows)
