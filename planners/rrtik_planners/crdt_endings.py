"""Joints that move last: a search that leaves them alone ends where they alone have to move, straight to the goal."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.ompl_bridge import MotionChecker
from rrtik_ompl.planning.moves.rules import long_enough

NO_ENDING = "last_joints: they cannot go straight to the goal after all others, or would have to move too little"


class Endings:
    """The last moves to each goal: the joints that move last go straight to it, one after the other.

    Attributes:
        aims: Where the last moves begin, shape (k, n): goals whose last moves are free, with those joints as at the
            start. Without joints that move last these are the goals themselves.

    Args:
        start: The last joints are here until all others have arrived, shape (n,).
        goals: Shape (g, n).
        joints: Those that move last, in this order.
        smallest_move: Goals that need a shorter last move are left out, shape (n,).
        checker: Checks the last moves.
    """

    def __init__(
        self, start: Vector, goals: Matrix, joints: Sequence[int], smallest_move: Vector, checker: MotionChecker
    ) -> None:
        endings = [_last_moves(start, goal, joints) for goal in goals]
        if joints:
            endings = [ending for ending in endings if long_enough(ending, smallest_move) and _free(ending, checker)]
        self._endings = endings
        self.aims: Matrix = np.array([ending[0] for ending in endings]).reshape(-1, goals.shape[1])

    def completed(self, path: Matrix) -> Matrix:
        """A path to one of the aims, shape (k, n), and the last moves after it."""
        reached = int((self.aims == path[-1]).all(axis=1).argmax())
        return np.vstack([path, self._endings[reached][1:]])


def _last_moves(start: Vector, goal: Vector, joints: Sequence[int]) -> Matrix:
    """Rows from where the last moves begin to the goal; joints that are there already do not move."""
    row = goal.copy()
    row[list(joints)] = start[list(joints)]
    rows = [row]
    for joint in joints:
        if rows[-1][joint] != goal[joint]:
            row = rows[-1].copy()
            row[joint] = goal[joint]
            rows.append(row)
    return np.array(rows)


def _free(ending: Matrix, checker: MotionChecker) -> bool:
    if len(ending) == 1:
        return True
    return checker.valid(ending[0]) and bool(checker.motion_valid_batch(ending[:-1], ending[1:]).all())
