"""The baseline of one tree: it grows from the goal, what has become blocked is trimmed, and it is grown again.

Source: Ferguson, Kalra and Stentz, 2006 [8], with the tree's root at the goal; as [1, ch. 5.2] says of this method, a
sample is the robot's configuration with probability 0.4.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from rrtik_ompl.arrays import Mask, Matrix, Vector
from rrtik_ompl.replanning.connecting import ITERATIONS, Joined, Motions, Stop, Tree, joined, never
from rrtik_ompl.replanning.drrt_con import DrrtCon, Post

ROBOT_PROBABILITY = 0.4  # of a sample at the robot's configuration


class SingleTree(DrrtCon):
    """DRRT: when the path is blocked all edges of the tree are checked, and branches behind blocked ones are trimmed.

    Args:
        lower, upper: The box to sample in, shape (n,).
        max_edge: See :class:`DrrtCon`.
        seed: Of the samples.
        post: See :class:`DrrtCon`.
    """

    name: ClassVar[str] = "drrt"

    def __init__(self, lower: Vector, upper: Vector, max_edge: float, seed: int, *, post: Post | None = None) -> None:
        super().__init__(self, max_edge, post=post)
        self._lower, self._upper = lower, upper
        self._rng = np.random.default_rng(seed)
        self._tree: Tree | None = None
        self.samples = 0

    def begin(self, start: Vector, goals: Matrix, motions: Motions, stop: Stop = never) -> bool:
        """See :meth:`DrrtCon.begin`; the tree's only root is the first goal that is free."""
        self._tree = None
        return super().begin(start, goals, motions, stop)

    def _reconnected(self, motions: Motions, stop: Stop) -> Joined | None:
        if self._tree is not None:
            self._tree = trimmed(self._tree, motions)
        return self(self._dense[:1], self._dense[-1:], motions, stop)

    def __call__(
        self, first: Matrix, second: Matrix, motions: Motions, stop: Stop, *, chain: bool = True
    ) -> Joined | None:
        """Grow the tree until it reaches the end of ``first``; the way back to its root, or None."""
        del chain
        aim = first[-1]
        if self._tree is None or not (self._tree.rows[0] == second[0]).all():
            self._tree = Tree(second[:1])
        for _ in range(ITERATIONS):
            if stop():
                return None
            self.samples += 1
            at_robot = self._rng.random() < ROBOT_PROBABILITY
            target = aim if at_robot else self._rng.uniform(self._lower, self._upper)
            new = self._tree.extend(target, self.max_edge, motions)
            if new is not None and (self._tree.rows[new] == aim).all():
                return joined(first, self._tree.branch(new)[::-1], second, chain=False)
        return None


def trimmed(tree: Tree, motions: Motions) -> Tree:
    """What is left of a tree when blocked edges and all that hangs on them are cut off; checked in one call."""
    rows, parents = np.array(tree.rows), np.array(tree.parents)
    keep: Mask = np.ones(len(rows), dtype=bool)
    keep[1:] = motions.motion_valid_batch(rows[parents[1:]], rows[1:])
    for k in range(1, len(rows)):  # parents come before their children
        keep[k] &= keep[parents[k]]
    numbers = np.cumsum(keep) - 1
    left = Tree(rows[:1])
    for k in np.flatnonzero(keep)[1:]:
        left.add(rows[k], int(numbers[parents[k]]))
    return left
