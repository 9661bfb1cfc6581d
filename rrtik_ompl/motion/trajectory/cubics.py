"""Represent a motion by numbers alone: cubics between knots, with their values, peaks and set points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import BLOCK_ROWS, Matrix, Vector, allocated, finite_array
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.kernels.reference import timing as reference
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.kernels.timing.run_layout import JUMP_SHARE, KERNELS

LONGEST_PERIOD = 0.02  # [s] longest control period of a drive
CLOCK_ERROR = 2e-9  # [s] rounding of times, as messages of ROS have nanoseconds
EXACT = 1e-12  # [rad] or [m] rounding error between a knot and the end of the cubic that leads to it
# For a piece of duration h that is cut into thirds of constant jerk: row k times the three jerks, times h^3, h^2 and h,
# is the change of position, velocity and acceleration over the piece.
_THIRDS = np.array([[19.0, 7.0, 1.0], [45.0, 27.0, 9.0], [54.0, 54.0, 54.0]]) / 162.0


class State(NamedTuple):
    """The state of a motion, shape (n,) each for one time, (k, n) each for k times.

    Attributes:
        positions: Joint positions [rad or m].
        velocities: Joint velocities [rad/s or m/s].
        accelerations: Joint accelerations [rad/s^2 or m/s^2]; at a jump, the value just after it.
    """

    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]
    accelerations: NDArray[np.float64]


class Peaks(NamedTuple):
    """Largest absolute velocity, acceleration and jerk of each joint, shape (n,) each.

    A jerk of inf means that the acceleration jumps.
    """

    velocity: Vector
    acceleration: Vector
    jerk: Vector


@dataclass(frozen=True, slots=True, eq=False)
class Cubics:
    """A motion as knots in time with a cubic between each two; the numbers are not checked.

    Attributes:
        times: Times of the knots [s], shape (m,), increasing from 0.
        positions: Positions at the knots, shape (m, n) [rad or m].
        velocities: Velocities at the knots, shape (m, n) [rad/s or m/s].
        accelerations: Accelerations at the beginning of each piece and, in the last row, at the end of the last piece,
            shape (m, n) [rad/s^2 or m/s^2].
    """

    times: Vector
    positions: Matrix
    velocities: Matrix
    accelerations: Matrix

    @property
    def duration(self) -> float:
        """Return the time from the first to the last knot [s]."""
        return float(self.times[-1])

    @property
    def smooth(self) -> bool:
        """Return whether its velocities do not jump between pieces: they are those of the knots."""
        return True

    @property
    def steps(self) -> Vector:
        """Return the duration of each piece [s], shape (m - 1,)."""
        return self.times[1:] - self.times[:-1]

    @property
    def jerks(self) -> Matrix:
        """Return the jerk by which each piece reaches the next knot's velocity, shape (m - 1, n) [rad/s^3 or m/s^3]."""
        h = self.steps[:, None]
        rise = self.velocities[1:] - self.velocities[:-1]
        jerks: Matrix = 2.0 * (rise - h * self.accelerations[:-1]) / h**2
        return jerks

    @property
    def ends(self) -> Matrix:
        """Return the positions at which the cubics of all pieces end, shape (m - 1, n) [rad or m]."""
        h = self.steps[:, None]
        v = self.velocities[:-1]
        a = self.accelerations[:-1]
        ends: Matrix = self.positions[:-1] + h * (v + h * (a / 2.0 + h * self.jerks / 6.0))
        return ends

    @property
    def last_accelerations(self) -> Matrix:
        """Return the acceleration at the end of each piece, shape (m - 1, n) [rad/s^2 or m/s^2]."""
        return np.asarray(self.accelerations[:-1] + self.steps[:, None] * self.jerks)

    def greatest_speeds(self) -> Matrix:
        """Return upper bounds of the joints' speeds on each piece, shape (m - 1, n) [rad/s or m/s]."""
        h = self.steps[:, None]
        peak = np.abs(self.velocities)
        speeds: Matrix = np.maximum(peak[1:], peak[:-1]) + h * np.abs(self.jerks * h) / 8.0
        return speeds

    def greatest_pushes(self, weights: Vector) -> Vector:
        """Return a weighted sum of the joints' largest accelerations on each piece, shape (n,) -> (m - 1,)."""
        kernels = library(KERNELS)
        if kernels is None:
            largest = np.maximum(np.abs(self.accelerations[:-1]), np.abs(self.last_accelerations))
            return np.asarray(largest @ weights)
        rows = [np.ascontiguousarray(each) for each in (self.times, self.velocities, self.accelerations, weights)]
        pushes = np.empty(len(self.times) - 1)
        addresses = [each.ctypes.data for each in rows]
        kernels.find_pushes(*addresses, *self.velocities.shape, pushes.ctypes.data)
        return pushes

    def states(self, clock: Vector) -> State:
        """Return positions, velocities and accelerations at times, shape (k, n) each.

        Before the beginning and after the end the motion is at rest.

        Args:
            clock: Times [s], shape (k,).
        """
        kernels = library(KERNELS)
        if kernels is None:
            return self._states(clock)
        rows = [
            np.ascontiguousarray(each) for each in (self.times, self.positions, self.velocities, self.accelerations)
        ]
        moments = np.ascontiguousarray(clock)
        knots, n = self.positions.shape
        found = allocated((3, len(moments), n))
        motion = [each.ctypes.data for each in rows]
        for first in range(0, len(moments), BLOCK_ROWS):
            part = slice(first, first + BLOCK_ROWS)
            block = moments[part]
            sinks = [each[part].ctypes.data for each in found]
            kernels.sample_cubics(*motion, knots, n, block.ctypes.data, len(block), *sinks)
        return State(*found)

    def _states(self, clock: Vector) -> State:
        """As states, without kernels."""
        inside = np.minimum(np.maximum(clock, 0.0), self.duration)
        piece = np.minimum(self.times.searchsorted(inside, side="right") - 1, len(self.times) - 2)
        x = (inside - self.times[piece])[:, None]
        h = (self.times[piece + 1] - self.times[piece])[:, None]
        q, v, a = (rows[piece] for rows in (self.positions, self.velocities, self.accelerations))
        j = 2.0 * (self.velocities[piece + 1] - v - h * a) / h**2

        positions = q + x * (v + x * (a / 2.0 + x * j / 6.0))
        velocities = v + x * (a + x * j / 2.0)
        accelerations = a + x * j

        # The end is set exactly, without the rounding of the cubic.
        positions[inside == self.duration] = self.positions[-1]
        velocities[clock != inside] = 0.0
        accelerations[clock != inside] = 0.0
        return State(positions, velocities, accelerations)

    def slowed(self, factor: float) -> Cubics:
        """Return the same motion, ``factor`` times as long."""
        return Cubics(self.times * factor, self.positions, self.velocities / factor, self.accelerations / factor**2)

    def at_knots(self, numbers: NDArray[np.int64]) -> Cubics:
        """Return the cubics through only the knots with these indices."""
        return Cubics(
            self.times[numbers], self.positions[numbers], self.velocities[numbers], self.accelerations[numbers]
        )

    def peaks(self) -> Peaks:
        """Return the largest velocity, acceleration and jerk of each joint: exact, as every piece is a cubic.

        A velocity can peak at a knot or where the acceleration changes sign within a piece; an acceleration peaks at an
        end of a piece. If the acceleration of a joint jumps anywhere, its jerk is inf.
        """
        rows = [np.ascontiguousarray(each) for each in (self.times, self.velocities, self.accelerations)]
        kernels = library(KERNELS)
        if kernels is None:
            return Peaks(*reference.peaks(*rows))
        found = np.empty((4, self.velocities.shape[1]))
        addresses = [each.ctypes.data for each in rows]
        kernels.find_peaks(*addresses, *self.velocities.shape, found.ctypes.data)
        return Peaks(*found[:3])

    def set_point_peaks(self) -> Peaks:
        """Return the peaks at knots that are set points; as in a drive, jerks are differences of acceleration."""
        velocity = np.abs(self.velocities).max(axis=0)
        acceleration = np.abs(self.accelerations).max(axis=0)
        h = np.maximum(np.diff(self.times), period_of(self.times))[:, None]
        jerk = np.abs(np.diff(self.accelerations, axis=0) / h).max(axis=0)
        rest = np.abs(self.accelerations[[0, -1]]).max(axis=0) <= JUMP_SHARE * acceleration.max()
        return Peaks(velocity, acceleration, np.where(rest, jerk, np.inf))

    def are_set_points(self) -> bool:
        """Check whether the knots are set points of a smooth motion at a control rate.

        This is so if the period is short enough, the cubics do not lead exactly to the next knots (the motion's jerk
        varies between them), and yet the positions fit a motion with the given velocities and accelerations.
        """
        if period_of(self.times) > LONGEST_PERIOD + CLOCK_ERROR:
            return False

        largest_misfit = np.abs(self.ends - self.positions[1:]).max()
        h = np.diff(self.times)[:, None]
        rise = np.diff(self.velocities, axis=0)
        max_acceleration = np.maximum(np.abs(self.accelerations).max(axis=0), np.abs(rise / h).max(axis=0))

        # Difference of positions from the integral of velocities and accelerations, bounded for any such motion.
        position_residual = (
            np.diff(self.positions, axis=0)
            - h * (self.velocities[:-1] + 0.5 * rise)
            + h**2 * np.diff(self.accelerations, axis=0) / 12.0
        )
        is_smooth = (
            np.abs(position_residual)
            <= h**2 * max_acceleration / 2.0 + CLOCK_ERROR * np.abs(self.velocities).max(axis=0) + EXACT
        )
        return bool(largest_misfit > EXACT * max(1.0, np.abs(self.positions).max()) and is_smooth.all())

    def in_thirds(self) -> Cubics:
        """Return cubics with three pieces per interval, which reach each knot's position, velocity and acceleration.

        The jerks of the three thirds are found from these three conditions. Of the 3 m - 2 new knots every third is a
        given one.
        """
        h = np.diff(self.times)[:, None]
        p = self.positions[:-1]
        v = self.velocities[:-1]
        a = self.accelerations[:-1]

        # Changes of position, velocity and acceleration that the jerks of the three thirds have to bring about.
        gains = (self.positions[1:] - p - h * (v + h * a / 2.0), (self.velocities[1:] - v - h * a) * h)
        changes = np.stack([*gains, (self.accelerations[1:] - a) * h**2])
        first, second, _ = np.einsum("ij,jkl->ikl", np.linalg.inv(_THIRDS), changes) / h**3
        x = h / 3.0

        rows = [
            np.repeat(values, 3, axis=0)[:-2]
            for values in (self.times[:, None], self.positions, self.velocities, self.accelerations)
        ]
        for k, jerk in enumerate((first, second), start=1):
            p = p + x * (v + x * (a / 2.0 + x * jerk / 6.0))
            v = v + x * (a + x * jerk / 2.0)
            a = a + x * jerk
            for row, values in zip(rows, (self.times[:-1, None] + k * x, p, v, a), strict=True):
                row[k::3] = values

        clock, *values = rows
        return Cubics(clock[:, 0], *values)


class Pieces(NamedTuple):
    """Successive cubics that form a motion from rest to rest.

    Attributes:
        durations: Duration of each piece [s], shape (m,), greater than 0.
        positions: Positions at the beginning of each piece, shape (m, n) [rad or m].
        velocities: Velocities at the beginning of each piece, shape (m, n) [rad/s or m/s].
        accelerations: Accelerations at the beginning of each piece, shape (m, n) [rad/s^2 or m/s^2].
    """

    durations: Vector
    positions: Matrix
    velocities: Matrix
    accelerations: Matrix


def hermite_accelerations(times: Vector, positions: Matrix, velocities: Matrix) -> Matrix:
    """Return the accelerations of the cubics through positions and velocities, shape (m, n).

    Each row is the acceleration at the beginning of a piece, the last row that at the end of the last piece.
    """
    h = np.diff(times)[:, None]
    mean = np.diff(positions, axis=0) / h
    first = velocities[:-1]
    last = velocities[1:]
    begin = (6.0 * mean - 4.0 * first - 2.0 * last) / h
    end = (2.0 * first + 4.0 * last - 6.0 * mean) / h
    return np.vstack([begin, end[-1:]])


def even_parts(counts: NDArray[np.int64]) -> tuple[NDArray[np.int64], Vector]:
    """Cut pieces into equal parts.

    Args:
        counts: Number of parts of each piece.

    Returns:
        For each part the index of its piece, and the share of the piece at which it begins, from 0 to below 1,
        shape (k,) both.
    """
    pieces = np.repeat(np.arange(len(counts)), counts)
    first = np.cumsum(counts) - counts
    return pieces, (np.arange(len(pieces)) - first[pieces]) / counts[pieces]


def period_of(times: Vector) -> float:
    """Return the period of evenly spaced times [s]; inf if they are not evenly spaced.

    The last step may be shorter than the others, or a little longer.
    """
    if len(times) < 3:
        return np.inf
    period = float(times[-2]) / (len(times) - 2)
    clock_error = np.abs(times[:-1] - period * np.arange(len(times) - 1)).max()
    return period if clock_error <= CLOCK_ERROR and times[-1] - times[-2] <= 1.002 * period else np.inf


def places(values: ArrayLike, count: int, what: str) -> NDArray[np.int64]:
    """Check row numbers given by a user, and return them as integers, shape (k,).

    Args:
        values: The row numbers.
        count: Number of rows.
        what: Name of the numbers in error messages.

    Raises:
        InputError: If they are not whole numbers from 0 to ``count - 1``.
    """
    array = finite_array(values, (None,), what)
    if (array != np.floor(array)).any() or array.min(initial=0) < 0 or array.max(initial=0) >= count:
        raise InputError(f"{what} must be whole numbers from 0 to {count - 1}")
    return array.astype(np.int64)
