"""The shortest time along a curve under limits of velocity and acceleration, by reachability along the path [19]."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.kernels.reference import timing as reference
from rrtik_ompl.kernels.reference.timing import Rows
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.kernels.tables.memory import PlannedTable, TablePlan, sizes_of
from rrtik_ompl.kernels.timing.layout import KERNELS, LINE, SearchTable, line_count
from rrtik_ompl.motion.trajectory.curve import Samples
from rrtik_ompl.motion.trajectory.limits import RateLimits

CRUISE_PARTS = 12.0  # into which the least time of a cruise is cut
MOST_PARTS = 2000  # of a motion
MOST = 1e200  # path speed squared where nothing bounds it


@dataclass(frozen=True, slots=True, eq=False)
class Bounds:
    """What else a motion must keep at the points of a grid, in path acceleration u and path speed squared x.

    Attributes:
        rows: Shape (m, r) each; low at most 0, high at least 0, so that standing still is allowed.
        cap: Largest x, shape (m,).
    """

    rows: Rows
    cap: Vector

    @classmethod
    def capped(cls, cap: Vector) -> Bounds:
        """Only the speed is bounded."""
        none = np.empty((len(cap), 0))
        return cls(Rows(none, none, none, none), np.minimum(cap, MOST))

    def and_also(self, other: Bounds) -> Bounds:
        """These bounds and others at the same grid, both to be kept."""
        rows = Rows(*(np.hstack(pair) for pair in zip(self.rows, other.rows, strict=True)))
        return Bounds(rows, np.minimum(self.cap, other.cap))


@dataclass(frozen=True, slots=True, eq=False)
class PathTiming:
    """When a motion along a curve is where.

    Attributes:
        grid: Places, shape (m,).
        squares: Path speed squared there, shape (m,).
        times: From the beginning [s], shape (m,).
    """

    grid: Vector
    squares: Vector
    times: Vector

    @property
    def duration(self) -> float:
        """Of the whole motion [s]."""
        return float(self.times[-1])

    def places(self, clock: Vector) -> Vector:
        """Where the motion is at times, shape (k,); at its ends before and after."""
        t = np.clip(clock, 0.0, self.duration)
        k = np.clip(np.searchsorted(self.times, t, side="right") - 1, 0, len(self.times) - 2)
        elapsed = t - self.times[k]
        speeds = np.sqrt(self.squares)
        acceleration = (self.squares[k + 1] - self.squares[k]) / (2.0 * (self.grid[k + 1] - self.grid[k]))
        places = self.grid[k] + elapsed * (speeds[k] + 0.5 * elapsed * acceleration)
        return np.maximum.accumulate(np.clip(places, self.grid[0], self.grid[-1]))

    def cruising(self, seconds: float) -> Vector:
        """Path speeds at the grid, shape (m,), cut where they are higher for less than a time, or a third of it all."""
        seconds = min(seconds, self.duration / 3.0)
        count = int(np.clip(np.ceil(CRUISE_PARTS * self.duration / seconds), 1, MOST_PARTS))
        places = self.places(np.linspace(0.0, self.duration, count + 1))
        speeds = np.diff(places) * (count / self.duration)

        # the least speed of each window, then the largest of these: peaks narrower than a window are cut off
        width = 1 + int(seconds * count / self.duration)
        zeros = np.zeros(width)
        window_minima = sliding_window_view(np.concatenate([zeros, speeds, zeros]), width).min(axis=1)
        capped = sliding_window_view(window_minima, width).max(axis=1)[1 : count + 1]
        cruise_speeds: Vector = np.interp(self.grid, 0.5 * (places[1:] + places[:-1]), capped)
        return cruise_speeds


def fastest(grid: Vector, samples: Samples, limits: RateLimits, bounds: Bounds) -> PathTiming:
    """The motion from rest to rest in the shortest time, along a curve that has these samples at the grid."""
    kernels = library(KERNELS)
    if kernels is None:
        rows, cap = reference.all_rows(samples.values, limits.velocity, limits.acceleration, bounds.rows, bounds.cap)
        squares = reference.find_squares(rows, cap, grid)
    else:
        task = SearchTable(PlannedTable(_plan(len(grid), len(limits.velocity), bounds.rows.first.shape[1])))
        task.shape[:] = samples.values.ravel()
        task.velocity[:] = limits.velocity
        task.acceleration[:] = limits.acceleration
        task.cap[:] = bounds.cap
        task.grid[:] = grid
        task.first[:] = bounds.rows.first.ravel()
        task.second[:] = bounds.rows.second.ravel()
        task.low[:] = bounds.rows.low.ravel()
        task.high[:] = bounds.rows.high.ravel()
        kernels.find_squares(task.address)
        squares = task.squares.copy()

    speeds = np.sqrt(squares)
    with np.errstate(divide="ignore"):
        steps = 2.0 * (grid[1:] - grid[:-1]) / (speeds[1:] + speeds[:-1])
    return PathTiming(grid, squares, np.concatenate([np.zeros(1), np.cumsum(steps)]))


@lru_cache(maxsize=64)
def _plan(points: int, joints: int, rows: int) -> TablePlan:
    """Where the search for a grid of so many points lies in memory."""
    return sizes_of(
        SearchTable,
        shape=3 * joints * points,
        velocity=joints,
        acceleration=joints,
        cap=points,
        grid=points,
        squares=points,
        reached=points,
        lines=LINE * line_count(joints, rows),
        first=rows * points,
        second=rows * points,
        low=rows * points,
        high=rows * points,
        joints=joints,
        rows=rows,
        points=points,
    )
