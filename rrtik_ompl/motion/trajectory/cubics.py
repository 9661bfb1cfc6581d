"""Cubics between knots: what follows from times, positions, velocities and accelerations; set points; even parts."""

from __future__ import annotations

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


def jerks_of(
    times: Vector, velocities: Matrix, accelerations: Matrix, pieces: NDArray[np.int64] | None = None
) -> Matrix:
    """The jerk with which each piece, or some of them, comes to the velocity of the next knot, shape (m - 1, n)."""
    first, last = (slice(None, -1), slice(1, None)) if pieces is None else (pieces, pieces + 1)
    h = (times[last] - times[first])[:, None]
    jerks: Matrix = 2.0 * (velocities[last] - velocities[first] - h * accelerations[first]) / h**2
    return jerks


def ends_of(times: Vector, positions: Matrix, velocities: Matrix, accelerations: Matrix) -> Matrix:
    """Where the cubic of each piece ends, shape (m - 1, n)."""
    h = (times[1:] - times[:-1])[:, None]
    v = velocities[:-1]
    a = accelerations[:-1]
    j = jerks_of(times, velocities, accelerations)
    ends: Matrix = positions[:-1] + h * (v + h * (a / 2.0 + h * j / 6.0))
    return ends


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


def cubic_peaks(times: Vector, velocities: Matrix, accelerations: Matrix) -> tuple[Vector, Vector, Vector]:
    """The largest velocity, acceleration and jerk of each joint, shape (n,) each: exact, for every piece is a cubic."""
    # joints in rows: numpy looks for the largest number along a row much faster than down a column
    h = times[1:] - times[:-1]
    jerks = jerks_of(times, velocities, accelerations)
    v, a, j = (np.ascontiguousarray(rows.T) for rows in (velocities, accelerations, jerks))

    with np.errstate(divide="ignore", invalid="ignore"):
        turn_time = -a[:, :-1] / j
        turning_velocity = np.where((turn_time > 0.0) & (turn_time < h), v[:, :-1] + 0.5 * turn_time * a[:, :-1], 0.0)
    velocity = np.maximum(np.abs(v).max(axis=1), np.abs(turning_velocity).max(axis=1))

    ends = a[:, :-1] + h * j
    jump_sizes = np.abs(ends - a[:, 1:])
    # what rounding of times and velocities does to the acceleration at the end of a piece
    rounding = 8.0 * np.finfo(np.float64).eps * (np.abs(v).max() + times[-1] * np.abs(a).max()) / h
    smooth = jump_sizes <= rounding
    acceleration = np.maximum(np.abs(a).max(axis=1), np.abs(np.where(smooth, 0.0, ends)).max(axis=1))

    jump = JUMP_SHARE * acceleration.max()
    at_rest = np.abs(a[:, [0, -1]]) <= jump  # before its beginning and after its end the arm does not move
    smooth |= jump_sizes <= jump
    is_smooth = smooth.all(axis=1) & at_rest.all(axis=1)
    jerk = np.where(is_smooth, np.abs((a[:, 1:] - a[:, :-1]) / h).max(axis=1), np.inf)

    return velocity, acceleration, jerk


def set_point_peaks(times: Vector, velocities: Matrix, accelerations: Matrix) -> tuple[Vector, Vector, Vector]:
    """The same at set points, the jerk as a drive sees it: the change of acceleration from one period to the next."""
    velocity = np.abs(velocities).max(axis=0)
    acceleration = np.abs(accelerations).max(axis=0)
    h = np.maximum(np.diff(times), period_of(times))[:, None]
    jerk = np.abs(np.diff(accelerations, axis=0) / h).max(axis=0)
    rest = np.abs(accelerations[[0, -1]]).max(axis=0) <= JUMP_SHARE * acceleration.max()
    return velocity, acceleration, np.where(rest, jerk, np.inf)


def period_of(times: Vector) -> float:
    """Of even times, the last of which may be nearer to the one before, or a little later; inf if they are not [s]."""
    if len(times) < 3:
        return np.inf
    period = float(times[-2]) / (len(times) - 2)
    clock_error = np.abs(times[:-1] - period * np.arange(len(times) - 1)).max()
    return period if clock_error <= CLOCK_ERROR and times[-1] - times[-2] <= 1.002 * period else np.inf


def are_set_points(times: Vector, positions: Matrix, velocities: Matrix, accelerations: Matrix) -> bool:
    """Whether points are those of a smooth motion at a control rate, which jerks change between two of them."""
    if period_of(times) > LONGEST_PERIOD + CLOCK_ERROR:
        return False

    largest_misfit = np.abs(ends_of(times, positions, velocities, accelerations) - positions[1:]).max()
    h = np.diff(times)[:, None]
    rise = np.diff(velocities, axis=0)
    max_acceleration = np.maximum(np.abs(accelerations).max(axis=0), np.abs(rise / h).max(axis=0))

    # of any motion whose acceleration is nowhere larger, positions differ by less from these
    position_residual = (
        np.diff(positions, axis=0) - h * (velocities[:-1] + 0.5 * rise) + h**2 * np.diff(accelerations, axis=0) / 12.0
    )
    is_smooth = (
        np.abs(position_residual)
        <= h**2 * max_acceleration / 2.0 + CLOCK_ERROR * np.abs(velocities).max(axis=0) + EXACT
    )
    return bool(largest_misfit > EXACT * max(1.0, np.abs(positions).max()) and is_smooth.all())


def in_thirds(times: Vector, positions: Matrix, velocities: Matrix, accelerations: Matrix) -> list[Matrix]:
    """Knots of cubics, three from each point to the next, that have its position, velocity and acceleration.

    Returns:
        Times, shape (3 m - 2, 1), positions, velocities and accelerations; every third is a point.
    """
    h = np.diff(times)[:, None]
    p = positions[:-1]
    v = velocities[:-1]
    a = accelerations[:-1]

    # what the jerks of the three thirds have to bring about: of position, velocity and acceleration
    gains = (positions[1:] - p - h * (v + h * a / 2.0), (velocities[1:] - v - h * a) * h)
    changes = np.stack([*gains, (accelerations[1:] - a) * h**2])
    first, second, _ = np.einsum("ij,jkl->ikl", np.linalg.inv(_THIRDS), changes) / h**3
    x = h / 3.0

    rows = [np.repeat(values, 3, axis=0)[:-2] for values in (times[:, None], positions, velocities, accelerations)]
    for k, jerk in enumerate((first, second), start=1):
        p = p + x * (v + x * (a / 2.0 + x * jerk / 6.0))
        v = v + x * (a + x * jerk / 2.0)
        a = a + x * jerk
        for row, values in zip(rows, (times[:-1, None] + k * x, p, v, a), strict=True):
            row[k::3] = values

    return rows


def places(values: ArrayLike, count: int, what: str) -> NDArray[np.int64]:
    """Numbers of rows given by a user, of ``count`` rows, shape (k,).

    Raises:
        InputError: If they are no whole numbers from 0 to ``count - 1``.
    """
    array = finite_array(values, (None,), what)
    if (array != np.floor(array)).any() or array.min(initial=0) < 0 or array.max(initial=0) >= count:
        raise InputError(f"{what} must be whole numbers from 0 to {count - 1}")
    return array.astype(np.int64)
