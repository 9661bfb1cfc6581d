"""DRRT-Con: a path that begins at the robot; its blocked part is cut out from both sides and reconnected.

Source: [1, ch. 5.2, algorithms 6 to 8], with two corrections. If the scene has changed but the path is free, the robot
goes on. If no connection is found, the path is kept, and the next call tries again with new samples to reconnect its
free pieces (a path that becomes free by itself needs no search).

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
STRAIGHT_TOLERANCE = 1e-9  # change of the unit direction below which two edges count as one straight line
REPAIR_TRIES = 16  # random shortcuts after a repair, where only a detour is new; walking shortens it further
REPAIR_PATIENCE = 6  # shortcuts without gain after which shortening ends

Post = Callable[[Matrix], Matrix]  # shortens a free route, shape (k, n), and returns it


class DrrtCon:
    """A path from the robot's configuration to a goal, kept free while the scene changes.

    Attributes:
        path: Waypoints, shape (k, n), the robot's configuration first; None before :meth:`begin` has found a path. A
            blocked path is kept.
        free: Whether every motion of the path was free when it was checked last.
        repairs: Number of searches for a new path so far.
        name: The name of the class as a setting.
        forgetting: Whether the class plans every repair from scratch.
        repairs_in_kernels: Whether :class:`KernelDrrtCon` can take the place of the class in a world that has kernels.

    Args:
        connect: The search between pieces of a path.
        max_edge: Longest edge of the trees [unit of the space]; the path is cut at points half as far apart.
        post: Shortens the new part of a path; the sequential cut if None, as published.
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

        # Results of the last check: points along the path, shape (k, n), and which of the motions between them are
        # blocked, shape (k - 1,).
        self._points_at_last_check = np.zeros((0, 0))
        self._blocked_at_last_check: Mask = np.zeros(0, dtype=bool)

    @classmethod
    def with_trees(cls, options: TreeOptions, post: Post | None) -> DrrtCon:
        """Make a replanner whose trees grow in Python with the given options."""
        return cls(PythonConnect(options), options.max_edge, post=post)

    def begin(self, start: Matrix | Vector, goals: Matrix, motions: MotionQueries, stop: Stop = no_stop) -> bool:
        """Look for a first path and return whether one was found.

        Args:
            start: Configuration where the path begins, shape (n,), or several to choose from, shape (s, n).
            goals: Configurations where it may end, shape (g, n).
            motions: Checks motions.
            stop: Ends the search when it returns True.
        """
        starts = np.atleast_2d(start)
        usable = motions.valid_batch(np.vstack([starts, goals]))
        free_starts = starts[usable[: len(starts)]]
        free_goals = goals[usable[len(starts) :]]
        if len(free_starts) == 0 or len(free_goals) == 0:
            return False

        connection = self.connect(free_starts, free_goals, motions, stop, chain=False)
        # The rows before the one where the connection begins are other starts and no part of the path.
        if connection is not None:
            connection = Connection(connection.path[connection.begin :], 0, connection.end - connection.begin)
        return self._take_over(connection, motions)

    def check_path(self, motions: MotionQueries) -> bool:
        """Check the whole path again in one call and return whether it is free."""
        if self.path is None:
            return False
        points = points_along(self.path, 0.5 * self.max_edge)
        self._points_at_last_check = points
        self._blocked_at_last_check = ~motions.motion_valid_batch(points[:-1], points[1:])
        self.free = not self._blocked_at_last_check.any()
        return self.free

    def repair(self, motions: MotionQueries, stop: Stop = no_stop) -> bool:
        """Look for another path after :meth:`check_path` found the path blocked; return whether one was found."""
        self.repairs += 1
        ends_free = self.path is not None and bool(motions.valid_batch(self.path[[0, -1]]).all())
        connection = self._reconnected(motions, stop) if ends_free else None
        return self._take_over(connection, motions)

    def retarget(self, goals: Matrix, motions: MotionQueries, stop: Stop = no_stop) -> bool:
        """Reconnect the free beginning of the path to one of other goals, without shortening.

        Args:
            goals: Configurations where the path may end, shape (g, n).
            motions: Checks motions.
            stop: Ends the search when it returns True.

        Returns:
            Whether a connection was found; if not, the path stays as it is.
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
        """Drop the part of the path that the robot has left behind, and shorten the rest.

        Args:
            place: The robot's new configuration on the path, shape (n,).
            passed: Number of waypoints behind the first one that it has passed.
            motions: Checks motions.
        """
        was_free = self.free
        self.rejoin(place, passed)
        self.free = was_free  # The rest of a free path is free.
        if self.path is not None and was_free and len(self.path) > 2:
            self.path = cut_from_start(self.path, 0.5 * self.max_edge, motions)

    def rejoin(self, place: Vector, passed: int = 0) -> None:
        """Let the path begin at ``place``, shape (n,), where the robot is now, on its path or not.

        The waypoints that were passed are dropped. The edge from ``place`` to the next waypoint is not checked, so the
        path no longer counts as free.
        """
        if self.path is not None:
            rest = self.path[1 + passed :] if len(self.path) > 1 + passed else self.path[-1:]
            self.path = rest if (rest[0] == place).all() else np.vstack([place, rest])
            self.free = False

    def _reconnected(self, motions: MotionQueries, stop: Stop) -> Connection | None:
        """Cut the path at its first and its last blocked motion, and connect the two free pieces that are left."""
        blocked = np.flatnonzero(self._blocked_at_last_check)
        first = int(blocked[0])
        last = int(blocked[-1])
        points = self._points_at_last_check
        return self.connect(points[: first + 1], points[last + 1 :], motions, stop)

    def _take_over(self, connection: Connection | None, motions: MotionQueries) -> bool:
        """Take over the path of a connection, with its new part shortened; return whether there is a connection."""
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
    """DRRT-Con, or planning from scratch, in kernels and in one world.

    :mod:`rrtik_ompl.kernels.search.repair_kernels` says what the kernels add to the published algorithm.

    Args:
        world: Checks motions; all methods expect it as their ``motions``.
        options: How the trees grow; its seed is also that of the shortcuts.
        forgetting: Whether each repair plans from scratch, as :class:`FromScratch` does.

    Raises:
        InputError: If the world has no kernels.
    """

    def __init__(self, world: MovingWorld, options: TreeOptions, *, forgetting: bool = False) -> None:
        self._world = world  # This stands before has_kernels(), which narrows the static type of ``world``.
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
    """Return the waypoints of a path and points between them, each at most ``step`` from the next; shape (m, n)."""
    return _points_and_edges(path, step)[0]


def without_points_between(path: Matrix) -> Matrix:
    """Return the path without the waypoints at which its direction does not change; both ends stay."""
    if len(path) < 3:
        return path
    edges = np.diff(path, axis=0)
    lengths = np.linalg.norm(edges, axis=1)
    units = edges / np.maximum(lengths, STRAIGHT_TOLERANCE)[:, None]
    turns = np.linalg.norm(np.diff(units, axis=0), axis=1) > STRAIGHT_TOLERANCE
    corners: Matrix = path[np.concatenate([[True], turns, [True]])]
    return corners


def dense_sequential_cut(path: Matrix, step: float, motions: MotionQueries) -> Matrix:
    """Shorten a free path by going straight from each kept point to the last reachable point.

    The points lie at most ``step`` apart along the path, and ``MAX_CUTS`` of them are tried in one call. In contrast,
    :func:`rrtik_ompl.planning.shortening.cuts.sequential_cut` tries exactly the waypoints. Source:
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
    """Return a free path whose beginning goes straight to the last reachable point along it.

    Up to ``MAX_CUTS`` points beyond the first edge are tried in one call; if none can be reached, the path is returned
    as it is.
    """
    points, edges = _points_and_edges(path, step)
    first_beyond = int(np.searchsorted(edges, 1))  # The first edge is free, so points on it are no gain.
    ends = np.unique(np.linspace(first_beyond, len(points) - 1, MAX_CUTS).round().astype(int))
    if first_beyond >= len(points):
        return path

    free = motions.motion_valid_batch(np.broadcast_to(path[0], (len(ends), path.shape[1])), points[ends])
    if not free.any():
        return path

    end = ends[np.flatnonzero(free)[-1]]
    return without_repeats(np.vstack([path[:1], points[end], path[edges[end] + 1 :]]))


def _points_and_edges(path: Matrix, step: float) -> tuple[Matrix, Vector]:
    """Return points along a path, see :func:`points_along`, and the edges on which they lie.

    Returns:
        Points, shape (m, n), and for each point the number of the edge on which, or at whose end, it lies; shape (m,).
    """
    path = path if len(path) > 1 else np.vstack([path, path])
    counts = part_counts(path, step)
    return subdivided(path, counts)
