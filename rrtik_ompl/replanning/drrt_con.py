"""DRRT-Con: a path that follows the robot and whose blocked part is cut out from both sides and reconnected.

Source: [1, ch. 5.2, algorithms 6 to 8], with these corrections: where the scene has changed but the path is free the
robot goes on; where no connection is found the path is kept, and what is left of it is tried again at the next call,
with new samples (a path that becomes free by itself needs none).

``replan()`` and ``rrtik replan`` use it; ``rrtik_planners.DRRTCon`` makes an OMPL planner of it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

import numpy as np

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.base.budget import Stop, no_stop
from rrtik_ompl.base.choices import Replanner
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.kernels.search.repair import PathRepair
from rrtik_ompl.model.transitions import part_counts, subdivided, without_repeats
from rrtik_ompl.replanning.connecting import (
    SHORTCUT_PATIENCE,
    SHORTCUT_TRIES,
    Connect,
    Connection,
    KernelConnect,
    KernelCuts,
    PythonConnect,
    TreeOptions,
)
from rrtik_ompl.world.motion_queries import MotionQueries, has_kernels
from rrtik_ompl.world.moving_world import MovingWorld

MAX_CUTS = 24  # shortcut ends that are tried from one point of a path
STRAIGHT_TOLERANCE = 1e-9  # change of the unit direction
REPAIR_TRIES = 16  # of random shortcuts, where only a detour is new; walking shortens it further
REPAIR_PATIENCE = 6  # of them without gain, after which it ends

Post = Callable[[Matrix], Matrix]  # a free route, shape (k, n), made shorter


class DrrtCon:
    """A path from the robot's configuration to a goal, kept free while the scene changes.

    Attributes:
        path: Shape (k, n), the robot's configuration first; None before :meth:`begin` has found one. It is kept while
            it is blocked.
        free: Whether every motion of the path was free when it was checked last.
        repairs: Number of searches for a new path so far.
        name: Of the class, as a setting.
        forgetting: Of the class: whether each repair plans from scratch.
        repairs_in_kernels: Of the class: whether :class:`KernelDrrtCon` does its work in a world that has kernels.

    Args:
        connect: The search between pieces of a path.
        max_edge: Longest edge of the trees [unit of the space]; the path is cut at points half as far apart.
        post: Shortens what is new of a path; the sequential cut if None, as published.
    """

    name: ClassVar[Replanner] = "drrt-con"
    forgetting: ClassVar[bool] = False
    repairs_in_kernels: ClassVar[bool] = True

    def __init__(self, connect: Connect, max_edge: float, *, post: Post | None = None) -> None:
        self.connect = connect
        self.max_edge = max_edge
        self.post = post
        self.path: Matrix | None = None
        self.free = False
        self.repairs = 0

        # Of the last check: points along the path, shape (k, n), and which motions between them are blocked, (k - 1,).
        self._points_at_last_check = np.zeros((0, 0))
        self._blocked_at_last_check: Mask = np.zeros(0, dtype=bool)

    @classmethod
    def with_trees(cls, options: TreeOptions, post: Post | None) -> DrrtCon:
        """One whose search, in Python, grows trees so."""
        return cls(PythonConnect(options), options.max_edge, post=post)

    def begin(self, start: Matrix | Vector, goals: Matrix, motions: MotionQueries, stop: Stop = no_stop) -> bool:
        """Look for a first path; whether there is one.

        Args:
            start: Where it may begin, shape (n,), or several of these, shape (s, n), at once.
            goals: Where it may end, shape (g, n).
            motions: Checks motions.
            stop: True ends the search.
        """
        starts = np.atleast_2d(start)
        usable = motions.valid_batch(np.vstack([starts, goals]))
        free_starts = starts[usable[: len(starts)]]
        free_goals = goals[usable[len(starts) :]]
        if len(free_starts) == 0 or len(free_goals) == 0:
            return False

        connection = self.connect(free_starts, free_goals, motions, stop, chain=False)
        if connection is not None:  # the other starts do not lead to the one where it begins
            connection = Connection(connection.path[connection.begin :], 0, connection.end - connection.begin)
        return self._take_over(connection, motions)

    def check_path(self, motions: MotionQueries) -> bool:
        """Check the path again, all of it in one call; whether it is free."""
        if self.path is None:
            return False
        points = points_along(self.path, 0.5 * self.max_edge)
        self._points_at_last_check = points
        self._blocked_at_last_check = ~motions.motion_valid_batch(points[:-1], points[1:])
        self.free = not self._blocked_at_last_check.any()
        return self.free

    def repair(self, motions: MotionQueries, stop: Stop = no_stop) -> bool:
        """After a :meth:`check_path` that found the path blocked: find another one; whether there is one."""
        self.repairs += 1
        ends_free = self.path is not None and bool(motions.valid_batch(self.path[[0, -1]]).all())
        connection = self._reconnected(motions, stop) if ends_free else None
        return self._take_over(connection, motions)

    def retarget(self, goals: Matrix, motions: MotionQueries, stop: Stop = no_stop) -> bool:
        """Reconnect the free beginning of the path to the nearest of other goals, shape (g, n), without shortening.

        Whether it could be done; if not, the path stays as it is.
        """
        goals = goals[motions.valid_batch(goals)]
        if self.path is None or len(goals) == 0:
            return False

        points = points_along(self.path, 0.5 * self.max_edge)
        blocked = np.flatnonzero(~motions.motion_valid_batch(points[:-1], points[1:]))
        points = points[: blocked[0] + 1] if len(blocked) else points
        if not motions.valid_batch(points[:1])[0]:
            return False

        connection = self.connect(points, goals, motions, stop, chain=False)
        if connection is not None:
            self.path = connection.path
            self.free = True
        return connection is not None

    def advance(self, place: Vector, passed: int, motions: MotionQueries) -> None:
        """The robot has gone to ``place``, past ``passed`` waypoints: drop what lies behind it, shorten the rest."""
        was_free = self.free
        self.rejoin(place, passed)
        self.free = was_free  # it was, so the part of it that is left is
        if self.path is not None and was_free and len(self.path) > 2:
            self.path = cut_from_start(self.path, 0.5 * self.max_edge, motions)

    def rejoin(self, place: Vector, passed: int = 0) -> None:
        """The robot is at ``place``, on its path or not, past ``passed`` waypoints: the edge there is unchecked."""
        if self.path is not None:
            rest = self.path[1 + passed :] if len(self.path) > 1 + passed else self.path[-1:]
            self.path = rest if (rest[0] == place).all() else np.vstack([place, rest])
            self.free = False

    def _reconnected(self, motions: MotionQueries, stop: Stop) -> Connection | None:
        """Cut at the first hit seen from the robot and at the first one seen from the goal; join the two pieces."""
        blocked = np.flatnonzero(self._blocked_at_last_check)
        first = int(blocked[0])
        last = int(blocked[-1])
        points = self._points_at_last_check
        return self.connect(points[: first + 1], points[last + 1 :], motions, stop)

    def _take_over(self, connection: Connection | None, motions: MotionQueries) -> bool:
        """Make a new path the path, if there is one, what is new of it shortened; whether there is one."""
        self.free = connection is not None
        if connection is not None:
            path = connection.path
            begin = connection.begin
            end = connection.end
            new_part = path[begin : end + 1]
            if self.post is None:
                new_part = dense_sequential_cut(new_part, 0.5 * self.max_edge, motions)
            else:
                new_part = self.post(new_part)
            self.path = without_points_between(np.vstack([path[:begin], new_part, path[end + 1 :]]))
        return self.free


class FromScratch(DrrtCon):
    """The baseline without memory: RRT-Connect from the robot to the goal whenever the path is blocked."""

    name: ClassVar[Replanner] = "rrt-connect"
    forgetting: ClassVar[bool] = True

    def _reconnected(self, motions: MotionQueries, stop: Stop) -> Connection | None:
        return self.connect(self._points_at_last_check[:1], self._points_at_last_check[-1:], motions, stop)


class KernelDrrtCon(DrrtCon):
    """As :class:`DrrtCon`, in one world: its path is kept free of what moves there.

    What the kernels add to the published algorithm: :mod:`rrtik_ompl.kernels.search.repair_kernels`.

    Args:
        world: Checks motions; the ``motions`` of all methods.
        options: How the trees grow; the seed is that of the shortcuts too.
        forgetting: Whether each repair plans from scratch, as :class:`FromScratch` does.

    Raises:
        InputError: If the world has no kernels.
    """

    def __init__(self, world: MovingWorld, options: TreeOptions, *, forgetting: bool = False) -> None:
        self._world = world  # before the check, behind which its type is a lesser one
        if not has_kernels(world):
            raise InputError("replanning in kernels: the world has none; install numba")

        self._forgetting = forgetting
        self._rng = np.random.default_rng([options.seed, 1])
        super().__init__(KernelConnect(world, options), options.max_edge, post=KernelCuts(world, options.seed))
        tries = SHORTCUT_TRIES if forgetting else REPAIR_TRIES
        patience = SHORTCUT_PATIENCE if forgetting else REPAIR_PATIENCE
        self._kernels = PathRepair(
            world.motions, options.lower, options.upper, max_edge=options.max_edge, iterations=options.iterations,
            tries=tries, patience=patience,
        )  # fmt: skip

    def check_path(self, motions: MotionQueries) -> bool:
        """See :meth:`DrrtCon.check_path`."""
        if self.path is None:
            return False
        self.free = self._kernels.check(self.path)
        self._world.checked += self._kernels.checked
        return self.free

    def repair(self, motions: MotionQueries, stop: Stop = no_stop) -> bool:
        """See :meth:`DrrtCon.repair`."""
        self.repairs += 1
        seed = int(self._rng.integers(2**62))
        new_path: Matrix | None = None
        if self.path is not None:
            new_path = self._kernels.repair(seed, stop, forgetting=self._forgetting)
        self.free = new_path is not None
        if new_path is not None:
            self.path = new_path
        return self.free


def points_along(path: Matrix, step: float) -> Matrix:
    """The path with further points, none farther than ``step`` from the next; all waypoints stay. Shape (m, n)."""
    return _points_and_edges(path, step)[0]


def without_points_between(path: Matrix) -> Matrix:
    """The path without waypoints at which its direction does not change; both ends stay."""
    if len(path) < 3:
        return path
    edges = np.diff(path, axis=0)
    lengths = np.linalg.norm(edges, axis=1)
    units = edges / np.maximum(lengths, STRAIGHT_TOLERANCE)[:, None]
    turns = np.linalg.norm(np.diff(units, axis=0), axis=1) > STRAIGHT_TOLERANCE
    corners: Matrix = path[np.concatenate([[True], turns, [True]])]
    return corners


def dense_sequential_cut(path: Matrix, step: float, motions: MotionQueries) -> Matrix:
    """Shorten a free path: from each kept point straight to the last point that can be reached.

    Points lie every ``step`` along the path, and ``MAX_CUTS`` of them are tried in one call;
    :func:`rrtik_ompl.planning.shortening.cuts.sequential_cut` tries every waypoint and no others. Source:
    [1, ch. 5.3, method 1], as DRRT-Con uses it.
    """
    points_kept = [path[:1]]
    rest = path
    while len(rest) > 2:
        rest = cut_from_start(rest, step, motions)
        points_kept.append(rest[1:2])
        rest = rest[1:]
    return np.vstack([*points_kept, rest[1:]])


def cut_from_start(path: Matrix, step: float, motions: MotionQueries) -> Matrix:
    """A free path with its beginning straight to the last point along it that can be reached, asked in one call."""
    points, edges = _points_and_edges(path, step)
    first_beyond = int(np.searchsorted(edges, 1))  # the first point behind the first edge, which is free
    ends = np.unique(np.linspace(first_beyond, len(points) - 1, MAX_CUTS).round().astype(int))
    if first_beyond >= len(points):
        return path

    free = motions.motion_valid_batch(np.broadcast_to(path[0], (len(ends), path.shape[1])), points[ends])
    if not free.any():
        return path

    end = ends[np.flatnonzero(free)[-1]]
    return without_repeats(np.vstack([path[:1], points[end], path[edges[end] + 1 :]]))


def _points_and_edges(path: Matrix, step: float) -> tuple[Matrix, Vector]:
    """See :func:`points_along`; also the number of the edge on which, or at whose end, each point lies."""
    path = path if len(path) > 1 else np.vstack([path, path])
    counts = part_counts(path, step)
    return subdivided(path, counts)
