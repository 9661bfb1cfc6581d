"""Out of the way: where a robot goes when an obstacle comes nearer than it should.

The DRRT-Con paper leaves this open ("optional evasive move"); here it is the move of one tick that ends farthest away.
"""

from __future__ import annotations

import numpy as np

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.moving_world import MovingWorld
from rrtik_ompl.replanning.connecting import Motions

TRIES = 192  # directions that are compared
SIZES = (0.25, 1.0)  # lengths of the moves in each direction, in ticks
ASKED = 16  # of the best moves, how many may be asked for self-collision
SLACK = 1e-3  # [m] by which a move may come nearer on its way


def evasion(
    q: Vector,
    step: float,
    most: Vector,
    near: MovingWorld,
    alone: Motions,
    rng: np.random.Generator,
    path: Matrix | None,
) -> Vector | None:
    """The move of one tick from q after which the arm is farthest from the obstacles, or None to stand still.

    Args:
        q: Where the robot is, shape (n,).
        step: How far the robot can go in a tick [unit of the space].
        most: How far each joint can move in a tick, shape (n,).
        near: The obstacles where they are, without self-collision.
        alone: Judges limits and self-collision.
        rng: Random numbers.
        path: The robot's path, whose next waypoint is one of the directions; or None.
    """
    moves = most * _directions(q, most, rng, path)
    moves *= np.minimum(step / np.linalg.norm(moves, axis=1), 1.0)[:, None]
    ends = np.vstack([q + size * moves for size in SIZES])
    ends = np.clip(ends, near.robot.lower, near.robot.upper)
    here = float(near.clearance(q[None])[0])
    middle, end = near.clearance(0.5 * (q + ends)), near.clearance(ends)
    better = np.flatnonzero((end > here) & (middle > max(min(here - SLACK, 0.5 * here), 0.0)))
    order = better[np.argsort(-end[better], kind="stable")][:ASKED]
    if len(order) == 0:
        return None
    free = np.flatnonzero(alone.motion_valid_batch(np.tile(q, (len(order), 1)), ends[order]))
    found: Vector | None = ends[order[free[0]]] if len(free) else None
    return found


def _directions(q: Vector, most: Vector, rng: np.random.Generator, path: Matrix | None) -> Matrix:
    """Single joints, random directions, and towards the next waypoint and back; largest part 1, shape (m, n)."""
    drawn = rng.uniform(-1.0, 1.0, (TRIES, len(q)))
    rows = [np.eye(len(q)), -np.eye(len(q)), drawn / np.abs(drawn).max(axis=1, keepdims=True)]
    if path is not None and len(path) > 1 and (path[1] != q).any():
        way = (path[1] - q) / most
        rows.append(np.outer([1.0, -1.0], way / np.abs(way).max()))
    return np.vstack(rows)
