"""Compute the fastest timing along a curve under velocity and acceleration limits, by reachability analysis [19]."""

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
from rrtik_ompl.kernels.timing.run_layout import CRUISE_PARTS, MOST_PARTS
from rrtik_ompl.motion.trajectory.curve import Samples
from rrtik_ompl.motion.trajectory.limits import RateLimits

MOST = 1e200  # path speed squared where there is no bound


@dataclass(frozen=True, slots=True, eq=False)
class Bounds:
    """Further constraints at the points of a grid, on path acceleration u and path speed squared x.

    Attributes:
        rows: Constraints ``low <= first * u + second * x <= high``, shape (m, r) each; low is at most 0 and high at
            least 0, so that standing still is allowed.
        cap: Largest x, shape (m,).
    """

    rows: Rows
    cap: Vector

    @classmethod
    def capped(cls, cap: Vector) -> Bounds:
        """Return bounds of the speed only, from the largest x, shape (m,)."""
        none = np.empty((len(cap), 0))
        return cls(Rows(none, none, none, none), np.minimum(cap, MOST))

    def and_also(self, other: Bounds) -> Bounds:
        """Return the combination of these bounds and others at the same grid."""
        rows = Rows(*(np.hstack(pair) for pair in zip(self.rows, other.rows, strict=True)))
        return Bounds(rows, np.minimum(self.cap, other.cap))


@dataclass(frozen=True, slots=True, eq=False)
class PathTiming:
    """The timing of a motion along a curve.

    Attributes:
        grid: Places on the curve, shape (m,).
        squares: Path speed squared at these places, shape (m,).
        times: Times at which the motion is there [s], shape (m,), from 0.
    """

    grid: Vector
    squares: Vector
    times: Vector

    @property
    def duration(self) -> float:
        """Return the duration of the whole motion [s]."""
        return float(self.times[-1])

    def places(self, clock: Vector) -> Vector:
        """Return the places of the motion at times [s], shape (k,); its ends for times outside the motion."""
        t = np.clip(clock, 0.0, self.duration)
        k = np.clip(np.searchsorted(self.times, t, side="right") - 1, 0, len(self.times) - 2)
        elapsed = t - self.times[k]
        speeds = np.sqrt(self.squares)
        acceleration = (self.squares[k + 1] - self.squares[k]) / (2.0 * (self.grid[k + 1] - self.grid[k]))
        places = self.grid[k] + elapsed * (speeds[k] + 0.5 * elapsed * acceleration)
        return np.maximum.accumulate(np.clip(places, self.grid[0], self.grid[-1]))

    def cruising(self, seconds: float) -> Vector:
        """Return path speeds at the grid, shape (m,), without peaks that last for less than a given time.

        The speed is sampled evenly in time. The minimum over a sliding window, followed by the maximum over the same
        window (a morphological opening), cuts off all peaks that are narrower than the window.

        Args:
            seconds: Shortest duration of a peak [s]; at most a third of the motion's duration is used.
        """
        seconds = min(seconds, self.duration / 3.0)
        count = int(np.clip(np.ceil(CRUISE_PARTS * self.duration / seconds), 1, MOST_PARTS))
        places = self.places(np.linspace(0.0, self.duration, count + 1))
        speeds = np.diff(places) * (count / self.duration)

        # Take the least speed of each window, then the largest of these: peaks narrower than a window are cut off.
        width = 1 + int(seconds * count / self.duration)
        zeros = np.zeros(width)
        window_minima = sliding_window_view(np.concatenate([zeros, speeds, zeros]), width).min(axis=1)
        capped = sliding_window_view(window_minima, width).max(axis=1)[1 : count + 1]
        cruise_speeds: Vector = np.interp(self.grid, 0.5 * (places[1:] + places[:-1]), capped)
        return cruise_speeds


def fastest(grid: Vector, samples: Samples, limits: RateLimits, bounds: Bounds) -> PathTiming:
    """Compute the fastest motion from rest to rest along a curve.

    Args:
        grid: Places on the curve, shape (m,).
        samples: The curve at these places.
        limits: Velocity and acceleration limits of the joints.
        bounds: Further constraints at these places.
    """
    kernels = library(KERNELS)
    if kernels is None:
        rows, cap = reference.all_rows(samples.values, limits.velocity, limits.acceleration, bounds.rows, bounds.cap)
        squares = reference.find_squares(rows, cap, grid)
    else:
        task = search_table(len(grid), len(limits.velocity), bounds.rows.first.shape[1])
        task.velocity[:] = limits.velocity
        task.acceleration[:] = limits.acceleration
        task.grid[:] = grid
        task.shape[:] = samples.values.ravel()
        task.cap[:] = bounds.cap
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


def search_table(points: int, joints: int, rows: int = 0) -> SearchTable:
    """Return a table for kernels: the search at so many points of a grid, with further constraints at each."""
    return SearchTable(PlannedTable(_plan(points, joints, rows)))


@lru_cache(maxsize=64)
def _plan(points: int, joints: int, rows: int) -> TablePlan:
    """Return the memory layout of the search on a grid of so many points; cached."""
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
