"""The baseline DRRT: a single tree that grows from the goal, is trimmed where it is blocked, and grows again.

Source: Ferguson, Kalra and Stentz, 2006 [8], with the tree's root at the goal. As [1, ch. 5.2] describes this method, a
sample is the robot's configuration with probability 0.4.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.base.budget import Stop, no_stop
from rrtik_ompl.base.choices import Replanner
from rrtik_ompl.planning.search.rrt_connect import ConfigurationTree, extend
from rrtik_ompl.replanning.connecting import Connection, TreeOptions, connected, one_by_one
from rrtik_ompl.replanning.drrt_con import DrrtCon, Post
from rrtik_ompl.world.motion_queries import MotionQueries

ROBOT_PROBABILITY = 0.4  # probability that a sample is the robot's configuration


class SingleTree(DrrtCon):
    """DRRT: if the path is blocked, all edges of the tree are checked and branches behind blocked ones are trimmed.

    Args:
        options: How the tree grows.
        post: Shortens the new part of a path, see :class:`DrrtCon`.
    """

    name: ClassVar[Replanner] = "drrt"
    repairs_in_kernels: ClassVar[bool] = False

    def __init__(self, options: TreeOptions, *, post: Post | None = None) -> None:
        super().__init__(self, options.max_edge, post=post)
        self._options = options
        self._rules = options.rules
        self._rng = np.random.default_rng(options.seed)
        self._tree: ConfigurationTree | None = None
        self.samples = 0

    @classmethod
    def with_trees(cls, options: TreeOptions, post: Post | None) -> SingleTree:
        """See :meth:`DrrtCon.with_trees`."""
        return cls(options, post=post)

    def begin(self, start: Vector, goals: Matrix, motions: MotionQueries, stop: Stop = no_stop) -> bool:
        """Look for a first path, see :meth:`DrrtCon.begin`; only the first free goal is used, as the tree's root."""
        self._tree = None
        return super().begin(start, goals, motions, stop)

    def _reconnected(self, motions: MotionQueries, stop: Stop) -> Connection | None:
        if self._tree is not None:
            self._tree = trimmed(self._tree, motions)
        return self(self._points_at_last_check[:1], self._points_at_last_check[-1:], motions, stop)

    def __call__(
        self, first: Matrix, second: Matrix, motions: MotionQueries, stop: Stop, *, chain: bool = True
    ) -> Connection | None:
        """Grow the tree until it reaches the robot and return the path from there to its root, see :class:`Connect`.

        The tree of the last call is kept if its root is still ``second[0]``.

        Args:
            first: Configurations, shape (a, n), of which the last one is the robot's.
            second: Configurations, shape (b, n), of which the first one is the root.
            motions: Checks motions.
            stop: Ends the search when it returns True.
            chain: Has no effect, since the path always ends at the root.
        """
        del chain
        robot_configuration = first[-1]
        if self._tree is None or not (self._tree.rows[0] == second[0]).all():
            self._tree = ConfigurationTree(second[:1])

        for _ in range(self._options.iterations):
            if stop():
                return None
            self.samples += 1
            at_robot = self._rng.random() < ROBOT_PROBABILITY
            target = robot_configuration if at_robot else self._rng.uniform(self._options.lower, self._options.upper)
            vertex = extend(self._tree, target, self._rules, one_by_one(motions))
            if vertex is not None and (self._tree.rows[vertex] == robot_configuration).all():
                return connected(first, self._tree.branch(vertex)[::-1], second, chain=False)
        return None


def trimmed(tree: ConfigurationTree, motions: MotionQueries) -> ConfigurationTree:
    """Return a tree without its blocked edges and the branches behind them; all edges are checked in one call."""
    rows = tree.rows
    parents = np.array(tree.parents)
    connected: Mask = np.ones(len(rows), dtype=bool)
    connected[1:] = motions.motion_valid_batch(rows[parents[1:]], rows[1:])
    # Parents come before their children, so one pass passes a cut on to whole branches.
    for k in range(1, len(rows)):
        connected[k] &= connected[parents[k]]

    numbers = np.cumsum(connected) - 1
    trimmed_tree = ConfigurationTree(rows[:1])
    for k in np.flatnonzero(connected)[1:]:
        trimmed_tree.add(rows[k], int(numbers[parents[k]]))
    return trimmed_tree
