"""Smooth a motion to a cubic spline of even time steps, so that its acceleration never jumps and its jerk is limited.

The control points of the spline are means of the motion over a window of time. The velocities and accelerations of the
result are means over the same window, so they never exceed the original ones; the wider the window, the smaller the
jerk. A motion on a straight line stays on it. Where the path bends, the mean lies inside the bend, by at most half of
the window's variance times the acceleration across the path.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.motion.trajectory.limits import ROUNDING_MARGIN, RateLimits

WIDTHS = (1.0, 0.75, 0.55, 0.4, 0.25)  # shares of the widest window that are tried
MOST_PIECES = 1250  # approximate largest number of pieces of a curve
MOST_STEPS = 16  # most steps in the widest window
LEAST_PIECES = 8  # fewest pieces of a motion


@dataclass(frozen=True, slots=True, eq=False)
class Spline:
    """A cubic B-spline of even time steps that is at rest at both ends.

    Attributes:
        controls: Control points, the first and the last one three times, shape (m, n).
        step: Time between two knots [s].
    """

    controls: Matrix
    step: float

    @property
    def duration(self) -> float:
        """Return the duration of the whole spline [s]."""
        return (len(self.controls) - 3) * self.step

    def knots(self) -> tuple[Matrix, Matrix, Matrix]:
        """Return positions, velocities and accelerations at the knots, shape (m - 2, n) each."""
        before = self.controls[:-2]
        here = self.controls[1:-1]
        after = self.controls[2:]
        bends = after - 2.0 * here + before
        return here + bends / 6.0, (after - before) / (2.0 * self.step), bends / self.step**2

    def states(self) -> tuple[Matrix, Matrix, Matrix]:
        """Return the values of :meth:`knots`, then those midway between each two knots, shape (2 m - 5, n) each."""
        first, second, third, fourth = (self.controls[k : len(self.controls) - 3 + k] for k in range(4))
        between = (
            (first + 23.0 * (second + third) + fourth) / 48.0,
            (fourth - first + 5.0 * (third - second)) / (8.0 * self.step),
            (first - second - third + fourth) / (2.0 * self.step**2),
        )
        rows = [np.vstack(pair) for pair in zip(self.knots(), between, strict=True)]
        return rows[0], rows[1], rows[2]

    def slowed(self, factor: float) -> Spline:
        """Return the same spline, ``factor`` times as long."""
        return Spline(self.controls, self.step * factor)

    def peaks(self) -> tuple[Vector, Vector, Vector]:
        """Return bounds of velocity, acceleration and jerk, shape (n,) each; the last two are exact."""
        # Joints are in rows, as numpy finds the largest number along a row much faster than along a column.
        bounds = []
        rows = np.ascontiguousarray(self.controls.T)
        for power in (1, 2, 3):
            rows = rows[:, 1:] - rows[:, :-1]
            bounds.append(np.maximum(rows.max(axis=1), -rows.min(axis=1)) / self.step**power)
        return bounds[0], bounds[1], bounds[2]


def widest_window(limits: RateLimits) -> float:
    """Return the widest window that the jerk limits may need [s].

    Over such a window the acceleration of every joint can change from one limit to the other.
    """
    return float(np.where(np.isinf(limits.jerk), 0.0, 2.0 * limits.acceleration / limits.jerk).max())


def steps_for(duration: float, window: float, period: float) -> tuple[float, int, int]:
    """Choose the time steps of a spline.

    Args:
        duration: Duration of the motion to be smoothed [s].
        window: The widest window [s].
        period: The shortest step [s].

    Returns:
        The step [s], the number of steps of the motion, and the number of steps of the widest window.
    """
    min_step = max(period, window / MOST_STEPS, duration / MOST_PIECES)
    count = max(int(duration / min_step), LEAST_PIECES)
    step = max(duration / count, period)
    return step, count, max(1, min(int(np.ceil(window / step)), MOST_STEPS))


def smoothed(rows: Matrix, step: float, max_steps: int, limits: RateLimits) -> Spline:
    """Return the shortest spline that keeps the limits, of those with several windows of up to ``max_steps`` steps.

    Args:
        rows: The motion at even steps from rest to rest, shape (m, k): joint values, then any other coordinates.
        step: Time between two rows [s].
        max_steps: Number of steps of the widest window, 1 or more.
        limits: Limits of the joints, which are the first columns.
    """
    n = len(limits.velocity)
    widths = {int(np.ceil(share * max_steps)) for share in WIDTHS}
    splines = (Spline(controls, step) for controls in _means(rows, widths))
    timed = (spline.slowed(slowing(Spline(spline.controls[:, :n], step), limits)) for spline in splines)
    return min(timed, key=lambda spline: spline.duration)


def slowing(spline: Spline, limits: RateLimits) -> float:
    """Return the factor, 1 or more, by which a spline must be slowed to keep the limits."""
    bounds = (limits.velocity, limits.acceleration, limits.jerk)
    shares = [float((peak / bound).max()) for peak, bound in zip(spline.peaks(), bounds, strict=True)]
    factor: float = max(share ** (1.0 / power) for power, share in enumerate(shares, start=1))
    return max(1.0, factor * ROUNDING_MARGIN)


def _means(rows: Matrix, widths: set[int]) -> Iterator[Matrix]:
    """Yield control points for each window width: means of the motion over windows of so many rows.

    The first and the last control point are repeated, as the spline needs to be at rest there.

    Args:
        rows: The motion at even steps, shape (m, k).
        widths: Numbers of rows of the windows.
    """
    first = rows[:1]
    offsets = rows - first
    total = np.zeros((len(rows) - 1, rows.shape[1]))

    # The sums over windows of one more row are computed from the previous ones.
    for width in range(1, max(widths) + 1):
        last_rows = np.broadcast_to((width - 1) * offsets[-1], (1, rows.shape[1]))
        total = np.vstack([total, last_rows])
        total[width - 1 :] += offsets
        if width in widths:
            mean = first + total / width
            yield np.vstack([mean[[0, 0]], mean, mean[[-1, -1]]])
