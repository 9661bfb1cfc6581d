"""How near a free motion comes to anything, and whether it stays free if every move ends a little beside its end."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.path import JointPath
from rrtik_ompl.world import Contact, World

CLOSE_ENOUGH = 0.002  # [m]; the least distance found is at most that much too large


def tightest(world: World, rows: Matrix) -> Contact | None:
    """The pair that is nearest to its margin or to contact at some free configuration; None if nothing can collide.

    Few looks are enough, for between two of them a distance changes little.
    Looks first where the bound from earlier looks is lowest: two bodies approach each other by no more than twice the
    bound on the arm's displacement (world.py), so that most rows need no look.

    Args:
        world: Robot and surroundings.
        rows: Configurations that are free, shape (m, dof), m > 0.
    """
    bound, best = np.full(len(rows), -np.inf), None
    while True:
        row = int(np.argmin(bound))
        if best is not None and bound[row] >= best.clearance - CLOSE_ENOUGH:
            return best
        found = world.closest(rows[row], known_free=True)
        if found is None:
            return None
        if best is None or found.clearance < best.clearance:
            best = found
        bound = np.maximum(bound, found.clearance - 2.0 * np.abs(rows - rows[row]) @ world.weights)
        bound[row] = np.inf


def executions(path: JointPath, slack: Vector, count: int, rng: np.random.Generator) -> Matrix:
    """Corners of a path of single-joint moves as hands make them: every move ends up to ``slack`` beside its end.

    Args:
        path: One joint at a time.
        slack: Largest error of each joint, shape (dof,) [rad or m].
        count: How many executions.
        rng: For the errors, which are uniform.

    Returns:
        Shape (count, moves + 1, dof).
    """
    names, moves = list(path.joint_names), path.moves()
    rows = np.tile(path.start, (count, len(moves) + 1, 1))
    for number, move in enumerate(moves, start=1):
        joint = names.index(move.joint)
        errors = rng.uniform(-slack[joint], slack[joint], (count, 1))
        rows[:, number:, joint] = move.end + errors
    return rows


def free_rows(world: World, rows: Matrix) -> NDArray[np.bool_]:
    """Which of some `executions` touch nothing; limits stop a joint, and are no fault. Shape (count,)."""
    if rows.shape[1] < 2:
        return np.ones(len(rows), dtype=bool)
    inside = world.robot.clamp(rows.reshape(-1, rows.shape[-1])).reshape(rows.shape)
    starts, ends = (part.reshape(-1, rows.shape[-1]) for part in (inside[:, :-1], inside[:, 1:]))
    return np.asarray(world.motion_valid_batch(starts, ends).reshape(len(rows), -1).all(axis=1))
