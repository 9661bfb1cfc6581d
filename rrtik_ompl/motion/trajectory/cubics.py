"""Cubics between knots: a motion as numbers, and what follows from them: places, peaks, set points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Matrix, Vector, finite_array
from rrtik_ompl.base.errors import InputError

JUMP_SHARE = 1e-6  # of the largest acceleration; a larger difference between two pieces is a jump, its jerk infinite
LONGEST_PERIOD = 0.02  # [s]; between set points of a drive
CLOCK_ERROR = 2e-9  # [s]; messages of ROS have nanoseconds
EXACT = 1e-12  # [rad] or [m]; what rounding leaves between a knot and the end of the cubic that leads to it
# of a piece in thirds: jerks times h^3, h^2 and h make these changes of position, velocity and acceleration
_THIRDS = np.array([[19.0, 7.0, 1.0], [45.0, 27.0, 9.0], [54.0, 54.0, 54.0]]) / 162.0


class State(NamedTuple):
    """Where a motion is, shape (n,) each for one time, (k, n) for k times.

    Attributes:
        positions: [rad or m].
        velocities: [rad/s or m/s].
        accelerations: [rad/s^2 or m/s^2]; just after a jump.
    """

    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]
    accelerations: NDArray[np.float64]


class Peaks(NamedTuple):
    """Largest absolute velocity, acceleration and jerk of each joint, shape (n,); inf is a jump of acceleration."""

    velocity: Vector
    acceleration: Vector
    jerk: Vector


@dataclass(frozen=True, slots=True, eq=False)
class Cubics:
    """Knots in time, and a cubic between each two: a motion as numbers alone, that nothing checks.

    Attributes:
        times: Of the knots [s], shape (m,), increasing from 0.
        positions: Shape (m, n) [rad or m].
        velocities: Shape (m, n).
        accelerations: Shape (m, n): at the beginning of each piece, in the last row at the end of the last one.
    """

    times: Vector
    positions: Matrix
    velocities: Matrix
    accelerations: Matrix

    @property
    def duration(self) -> float:
        """Time from the first to the last knot [s]."""
        return float(self.times[-1])

    @property
    def jerks(self) -> Matrix:
        """Jerk of each piece, with which it comes to the velocity of the next knot [rad/s^3 or m/s^3], (m - 1, n)."""
        h = np.diff(self.times)[:, None]
        jerks: Matrix = 2.0 * (np.diff(self.velocities, axis=0) - h * self.accelerations[:-1]) / h**2
        return jerks

    @property
    def ends(self) -> Matrix:
        """Where the cubic of each piece ends, shape (m - 1, n) [rad or m]."""
        h = np.diff(self.times)[:, None]
        v = self.velocities[:-1]
        a = self.accelerations[:-1]
        ends: Matrix = self.positions[:-1] + h * (v + h * (a / 2.0 + h * self.jerks / 6.0))
        return ends

    @property
    def last_accelerations(self) -> Matrix:
        """Acceleration at the end of each piece, shape (m - 1, n) [rad/s^2 or m/s^2]."""
        return np.asarray(self.accelerations[:-1] + np.diff(self.times)[:, None] * self.jerks)

    def states(self, clock: Vector) -> State:
        """Positions, velocities and accelerations at times, shape (k,); at rest before the beginning and after the end.

        Shape (k, n) each.
        """
        inside = np.clip(clock, 0.0, self.duration)
        piece = np.clip(np.searchsorted(self.times, inside, side="right") - 1, 0, len(self.times) - 2)
        x = (inside - self.times[piece])[:, None]
        h = (self.times[piece + 1] - self.times[piece])[:, None]
        q, v, a = (rows[piece] for rows in (self.positions, self.velocities, self.accelerations))
        j = 2.0 * (self.velocities[piece + 1] - v - h * a) / h**2

        positions = q + x * (v + x * (a / 2.0 + x * j / 6.0))
        velocities = v + x * (a + x * j / 2.0)
        accelerations = a + x * j

        positions[inside == self.duration] = self.positions[-1]  # to the bit
        velocities[clock != inside] = 0.0
        accelerations[clock != inside] = 0.0
        return State(positions, velocities, accelerations)

    def at_knots(self, numbers: NDArray[np.int64]) -> Cubics:
        """Some of the knots alone, by their numbers."""
        return Cubics(
            self.times[numbers], self.positions[numbers], self.velocities[numbers], self.accelerations[numbers]
        )

    def peaks(self) -> Peaks:
        """The largest velocity, acceleration and jerk of each joint: exact, for every piece is a cubic."""
        # joints in rows: numpy looks for the largest number along a row much faster than down a column
        h = np.diff(self.times)
        v, a, j = (np.ascontiguousarray(rows.T) for rows in (self.velocities, self.accelerations, self.jerks))

        with np.errstate(divide="ignore", invalid="ignore"):
            turn_time = -a[:, :-1] / j
            turning_velocity = np.where(
                (turn_time > 0.0) & (turn_time < h), v[:, :-1] + 0.5 * turn_time * a[:, :-1], 0.0
            )
        velocity = np.maximum(np.abs(v).max(axis=1), np.abs(turning_velocity).max(axis=1))

        ends = a[:, :-1] + h * j
        jump_sizes = np.abs(ends - a[:, 1:])
        # what rounding of times and velocities does to the acceleration at the end of a piece
        rounding = 8.0 * np.finfo(np.float64).eps * (np.abs(v).max() + self.times[-1] * np.abs(a).max()) / h
        smooth = jump_sizes <= rounding
        acceleration = np.maximum(np.abs(a).max(axis=1), np.abs(np.where(smooth, 0.0, ends)).max(axis=1))

        jump = JUMP_SHARE * acceleration.max()
        at_rest = np.abs(a[:, [0, -1]]) <= jump  # before its beginning and after its end the arm does not move
        smooth |= jump_sizes <= jump
        is_smooth = smooth.all(axis=1) & at_rest.all(axis=1)
        jerk = np.where(is_smooth, np.abs((a[:, 1:] - a[:, :-1]) / h).max(axis=1), np.inf)

        return Peaks(velocity, acceleration, jerk)

    def set_point_peaks(self) -> Peaks:
        """The same where the knots are set points, the jerk as a drive sees it: by differences of acceleration."""
        velocity = np.abs(self.velocities).max(axis=0)
        acceleration = np.abs(self.accelerations).max(axis=0)
        h = np.maximum(np.diff(self.times), period_of(self.times))[:, None]
        jerk = np.abs(np.diff(self.accelerations, axis=0) / h).max(axis=0)
        rest = np.abs(self.accelerations[[0, -1]]).max(axis=0) <= JUMP_SHARE * acceleration.max()
        return Peaks(velocity, acceleration, np.where(rest, jerk, np.inf))

    def are_set_points(self) -> bool:
        """Whether the knots are those of a smooth motion at a control rate, which jerks change between two of them."""
        if period_of(self.times) > LONGEST_PERIOD + CLOCK_ERROR:
            return False

        largest_misfit = np.abs(self.ends - self.positions[1:]).max()
        h = np.diff(self.times)[:, None]
        rise = np.diff(self.velocities, axis=0)
        max_acceleration = np.maximum(np.abs(self.accelerations).max(axis=0), np.abs(rise / h).max(axis=0))

        # of any motion whose acceleration is nowhere larger, positions differ by less from these
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
        """Cubics with three pieces from each knot to the next, that have its position, velocity and acceleration.

        Every third knot, of 3 m - 2, is one of these.
        """
        h = np.diff(self.times)[:, None]
        p = self.positions[:-1]
        v = self.velocities[:-1]
        a = self.accelerations[:-1]

        # what the jerks of the three thirds have to bring about: of position, velocity and acceleration
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
    """Cubics one after the other, from rest to rest.

    Attributes:
        durations: Of each [s], shape (m,), greater than 0.
        positions: Where each begins, shape (m, n) [rad or m].
        velocities: With which each begins, shape (m, n).
        accelerations: With which each begins, shape (m, n).
    """

    durations: Vector
    positions: Matrix
    velocities: Matrix
    accelerations: Matrix


def hermite_accelerations(times: Vector, positions: Matrix, velocities: Matrix) -> Matrix:
    """Accelerations at the beginning of the cubics through positions and velocities, and at the end of the last one."""
    h = np.diff(times)[:, None]
    mean = np.diff(positions, axis=0) / h
    first = velocities[:-1]
    last = velocities[1:]
    begin = (6.0 * mean - 4.0 * first - 2.0 * last) / h
    end = (2.0 * first + 4.0 * last - 6.0 * mean) / h
    return np.vstack([begin, end[-1:]])


def even_parts(counts: NDArray[np.int64]) -> tuple[NDArray[np.int64], Vector]:
    """Pieces cut into so many parts each: of each part its piece, and the share of that where it begins, shape (k,)."""
    pieces = np.repeat(np.arange(len(counts)), counts)
    first = np.cumsum(counts) - counts
    return pieces, (np.arange(len(pieces)) - first[pieces]) / counts[pieces]


def period_of(times: Vector) -> float:
    """Of even times, the last of which may be nearer to the one before, or a little later; inf if they are not [s]."""
    if len(times) < 3:
        return np.inf
    period = float(times[-2]) / (len(times) - 2)
    clock_error = np.abs(times[:-1] - period * np.arange(len(times) - 1)).max()
    return period if clock_error <= CLOCK_ERROR and times[-1] - times[-2] <= 1.002 * period else np.inf


def places(values: ArrayLike, count: int, what: str) -> NDArray[np.int64]:
    """Numbers of rows given by a user, of ``count`` rows, shape (k,).

    Raises:
        InputError: If they are no whole numbers from 0 to ``count - 1``.
    """
    array = finite_array(values, (None,), what)
    if (array != np.floor(array)).any() or array.min(initial=0) < 0 or array.max(initial=0) >= count:
        raise InputError(f"{what} must be whole numbers from 0 to {count - 1}")
    return array.astype(np.int64)
