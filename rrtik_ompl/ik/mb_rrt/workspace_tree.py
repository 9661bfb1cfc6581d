"""The tree of a real arm: nodes are frames of joints, edges are links held to limits and free of obstacles."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.ik.mb_rrt.axes import Axes
from rrtik_ompl.ik.mb_rrt.turns import draw_turns

TRIES = 24  # other nodes of the same index that are tried where an edge cannot be

LinkFree = Callable[[int, Matrix], Mask]  # from level and rows of q, of which joints 0..level count


class WorkspaceTree:
    """Grows branches towards a point, several passes at a time.

    A pass goes on from its own node; where that has no useful angle, or the link would touch something, from other
    nodes of the same index, drawn at random.

    Attributes:
        passes: Done so far.
        edges: Links tried so far.
    """

    def __init__(
        self, axes: Axes, goal: Vector, start: Vector, rng: np.random.Generator, link_is_free: LinkFree | None = None
    ) -> None:
        """Plant the tree.

        Args:
            axes: The arm.
            goal: The point in the world that it aims at, shape (3,).
            start: Values of joints that need not move, shape (dof,).
            rng: Random numbers.
            link_is_free: Which rows are free of collision as far as the link of a level; everything if None.
        """
        self._axes = axes
        self._goal = goal
        self._rng = rng
        self._start = np.array(start)[None]
        self.passes = 0
        self.edges = 0
        self.check_links(link_is_free)

    def check_links(self, link_is_free: LinkFree | None) -> None:
        """Plant the tree anew: its further edges are held free, and no earlier one is built on."""
        self._link_is_free = link_is_free
        self._q: list[Matrix] = [self._start, *(np.zeros((0, self._start.shape[1])),) * self._axes.count]
        self._frames: list[NDArray[np.float64]] = [self._axes.fixed[:1], *(np.zeros((0, 4, 4)),) * self._axes.count]

    def nodes(self, level: int) -> Matrix:
        """Configurations up to a level's joint, in the order in which they were added, shape (k, dof)."""
        return self._q[level]

    def grow(self, width: int = 1) -> Matrix:
        """Do some passes at a time.

        Returns:
            Configurations of those that came to the end of the arm, shape (k, dof), k <= width.
        """
        self.passes += width
        q = np.repeat(self._q[0], width, axis=0)
        frames = np.repeat(self._frames[0], width, axis=0)
        for level in range(self._axes.count):
            q, frames = self._add_link(level, q, frames)
            if len(q) == 0:
                break
            self._q[level + 1] = np.vstack([self._q[level + 1], q])
            self._frames[level + 1] = np.concatenate([self._frames[level + 1], frames])
        return q

    def _add_link(self, level: int, q: Matrix, frames: NDArray[np.float64]) -> tuple[Matrix, NDArray[np.float64]]:
        """Add a link to each branch, or to another of the same index in its place; those that succeed."""
        done_q = []
        done_frames = []
        num_missing = len(q)
        for attempt in range(TRIES):
            turned, usable = self._turn_joint(level, q, frames, keep_idle_joints=attempt == 0)
            done_q.append(turned[usable])
            done_frames.append(self._next_frames(level, frames[usable], turned[usable]))
            num_missing -= int(usable.sum())
            if num_missing == 0 or len(self._q[level]) < 2:
                break
            others = self._rng.integers(len(self._q[level]), size=num_missing)
            q = self._q[level][others]
            frames = self._frames[level][others]

        return np.vstack(done_q), np.concatenate(done_frames)

    def _turn_joint(
        self, level: int, q: Matrix, frames: NDArray[np.float64], *, keep_idle_joints: bool
    ) -> tuple[Matrix, Mask]:
        """Rows with the level's joint turned to a useful angle, and which of them will do.

        With ``keep_idle_joints`` a joint that cannot bring the goal nearer keeps its value.
        """
        axes = self._axes
        angle, useful = draw_turns(axes, level, frames, self._goal, self._rng)
        # Where the regions are not exact, "useful" is a hint: what counts is whether the polish gets to the goal.
        usable = useful if axes.exact else np.ones(len(q), dtype=bool)

        if keep_idle_joints and axes.idle[level]:
            current_angle = self._start[0, axes.joints[level]] + axes.offset[level]
            angle = np.full(len(q), np.clip(current_angle, axes.lower[level], axes.upper[level]))

        turned = np.array(q)
        turned[:, axes.joints[level]] = angle - axes.offset[level]
        self.edges += len(q)
        if self._link_is_free is not None and usable.any():
            usable[usable] = self._link_is_free(level, turned[usable])
        return turned, usable

    def _next_frames(self, level: int, frames: NDArray[np.float64], q: Matrix) -> NDArray[np.float64]:
        """Frames of the next joint."""
        angle = q[:, self._axes.joints[level]] + self._axes.offset[level]
        turn = np.tile(np.eye(4), (len(q), 1, 1))
        cosine = np.cos(angle)
        sine = np.sin(angle)
        turn[:, 0, 0] = cosine
        turn[:, 0, 1] = -sine
        turn[:, 1, 0] = sine
        turn[:, 1, 1] = cosine

        moved: NDArray[np.float64] = frames @ turn @ self._axes.fixed[level + 1]
        return moved
