"""The kernels for timing again, slow and obvious, in numpy: for tests, and where there is no compiler."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.kernels.timing.layout import FLAT, ROUNDS
from rrtik_ompl.kernels.timing.run_layout import JUMP_SHARE, MIN_PHASE_SECONDS, ROUNDING

# Acceleration at the beginning of each of the seven phases of a straight motion, as a share of the largest one.
PUSHES = np.array([0.0, 1.0, 1.0, 0.0, 0.0, -1.0, -1.0])


def sample_curve(vertices: Matrix, along: Vector, directions: Matrix, radii: Vector, at: Vector) -> Matrix:
    """Position and its first and second derivative, shape (m, 3 n); see :mod:`rrtik_ompl.kernels.timing.layout`."""
    edge = np.clip(np.searchsorted(along, at, side="right") - 1, 0, len(along) - 2)
    q = vertices[edge] + (at - along[edge])[:, None] * directions[edge]
    slope = directions[edge].copy()
    bend = np.zeros_like(q)
    for corner in range(1, len(along) - 1):
        gap = at - along[corner]
        turn = directions[corner] - directions[corner - 1]
        near = np.abs(gap) < radii[corner]
        inside = (radii[corner] - np.abs(gap[near]))[:, None]
        sign = np.where(gap[near] >= 0.0, -1.0, 1.0)[:, None]
        q[near] += inside**3 / (6.0 * radii[corner] ** 2) * turn
        slope[near] += sign * inside**2 / (2.0 * radii[corner] ** 2) * turn
        bend[near] += inside / radii[corner] ** 2 * turn
    return np.hstack([q, slope, bend])


class Rows(NamedTuple):
    """Row r at point i says low <= first u + second x <= high, shape (m, r) each."""

    first: Matrix
    second: Matrix
    low: Matrix
    high: Matrix


def all_rows(shape: Matrix, velocity: Vector, acceleration: Vector, rows: Rows, cap: Vector) -> tuple[Rows, Vector]:
    """The rows with those of the acceleration limits, and the cap lowered by the velocity limits."""
    n = len(velocity)
    slopes = shape[:, n : 2 * n]
    bends = shape[:, 2 * n :]
    most = np.broadcast_to(acceleration, slopes.shape)
    with np.errstate(divide="ignore"):
        by_speed = ((velocity / np.abs(slopes)) ** 2).min(axis=1)
        still = np.where(np.abs(slopes) < FLAT, acceleration / np.abs(bends), np.inf).min(axis=1)
    columns = zip((slopes, bends, -most, most), rows, strict=True)
    return Rows(*(np.hstack(pair) for pair in columns)), np.minimum(cap, np.minimum(by_speed, still))


def find_squares(rows: Rows, cap: Vector, grid: Vector) -> Vector:
    """Path speed squared at the points of the grid; see :mod:`rrtik_ompl.kernels.timing.layout`."""
    first, second, low, high = rows
    steps = 2.0 * np.diff(grid)

    def lines(i: int) -> tuple[Matrix, Matrix]:
        """Lower and upper bounds of u, each a value and a slope over x, shape (k, 2)."""
        a = np.concatenate([first[i], first[i + 1] + steps[i] * second[i + 1]])
        b = np.concatenate([second[i], second[i + 1]])
        ends = np.stack([np.concatenate([row[i], row[i + 1]]) for row in (low, high)])
        used = np.abs(a) >= FLAT
        a, b, ends = a[used], b[used], np.sort(ends[:, used] / a[used], axis=0)
        slope = -b / a
        below = np.vstack([np.stack([ends[0], slope], axis=1), [[0.0, -1.0 / steps[i]]]])
        above = np.vstack([np.stack([ends[1], slope], axis=1), [[reached[i + 1] / steps[i], -1.0 / steps[i]]]])
        return below, above

    reached = np.zeros(len(grid))
    for i in range(len(grid) - 2, -1, -1):
        below, above = lines(i)
        x = cap[i]
        for _ in range(ROUNDS):
            lower = below[(below @ [1.0, x]).argmax()]
            upper = above[(above @ [1.0, x]).argmin()]
            if upper @ [1.0, x] >= lower @ [1.0, x]:
                break
            fall = lower[1] - upper[1]
            nearer = (upper[0] - lower[0]) / fall if fall > 0.0 else 0.0
            x = max(nearer if nearer < x else x * (1.0 - 1e-9), 0.0)
        reached[i] = x
    squares = np.zeros(len(grid))
    for i in range(len(grid) - 1):
        u = (lines(i)[1] @ [1.0, squares[i]]).min()
        squares[i + 1] = min(max(squares[i] + steps[i] * u, 0.0), reached[i + 1])
    return squares


def peaks(times: Vector, velocities: Matrix, accelerations: Matrix) -> tuple[Vector, Vector, Vector]:
    """Largest velocity, acceleration and jerk of each joint of cubics between knots, shape (n,) each.

    Args:
        times: Of the knots, shape (m,).
        velocities: There, shape (m, n).
        accelerations: At the beginning of each piece and, in the last row, at the end of the last one, shape (m, n).
    """
    h = np.diff(times)[:, None]
    v = velocities[:-1]
    a = accelerations[:-1]
    j = 2.0 * (velocities[1:] - v - h * a) / h**2
    with np.errstate(divide="ignore", invalid="ignore"):
        turn_time = -a / j
        turning_velocity = np.where((turn_time > 0.0) & (turn_time < h), v + 0.5 * turn_time * a, 0.0)
    velocity = np.maximum(np.abs(velocities).max(axis=0), np.abs(turning_velocity).max(axis=0))

    ends = a + h * j
    jump_sizes = np.abs(ends - accelerations[1:])
    # Effect of the rounding of times and velocities on the acceleration at the end of a piece.
    rounding = ROUNDING * (np.abs(velocities).max() + times[-1] * np.abs(accelerations).max()) / h
    smooth = jump_sizes <= rounding
    acceleration = np.maximum(np.abs(accelerations).max(axis=0), np.abs(np.where(smooth, 0.0, ends)).max(axis=0))

    jump = JUMP_SHARE * acceleration.max()
    # The arm is at rest before the beginning and after the end, so other accelerations there are jumps.
    at_rest = np.abs(accelerations[[0, -1]]) <= jump
    is_smooth = (smooth | (jump_sizes <= jump)).all(axis=0) & at_rest.all(axis=0)
    jerk = np.where(is_smooth, np.abs((accelerations[1:] - a) / h).max(axis=0), np.inf)
    return velocity, acceleration, jerk


def phases_of_lines(length: Vector, v: Vector, a: Vector, j: Vector) -> tuple[Matrix, Matrix]:
    """Compute the seven phases of the fastest motions over lengths, from rest to rest.

    Args:
        length: Lengths of m lines [rad or m], shape (m,).
        v: Velocity limits along the lines, shape (m,).
        a: Acceleration limits along the lines, shape (m,).
        j: Jerk limits along the lines, inf for none, shape (m,).

    Returns:
        Durations of the phases [s] and accelerations at their beginnings, shape (m, 7) each.
    """
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        onset = a / j  # time until the acceleration reaches its limit
        ramp = np.where(v >= a * onset, v / a + onset, 2.0 * np.sqrt(v / j))  # time until the speed reaches its limit
        cruise = length / v - ramp
        limit = a * onset
        peak = 0.5 * (np.sqrt(limit**2 + 4.0 * a * length) - limit)  # speed if there is no cruise
        gentle = np.cbrt(length / (2.0 * j))  # onset if neither limit is reached
        short = length < 2.0 * limit * onset
        fast = cruise < 0.0
        ramp = np.where(fast, np.where(short, 2.0 * gentle, peak / a + onset), ramp)
        onset = np.minimum(onset, 0.5 * ramp)

    hold = ramp - 2.0 * onset
    cruise = np.maximum(cruise, 0.0)
    push = np.where(np.isinf(j), a, np.where(np.isinf(j), 0.0, j) * onset)
    phases = np.stack([onset, hold, onset, cruise, onset, hold, onset], axis=1)
    return phases, push[:, None] * PUSHES


def time_lines(
    vertices: Matrix, directions: Matrix, along: Vector, phases: Matrix, pushes: Matrix, smooth: NDArray[np.bool_]
) -> tuple[Vector, Matrix, Matrix, Matrix, Vector]:
    """Cut straight motions between vertices into pieces; phases without duration are left out.

    Args:
        vertices: The vertices, shape (k, n).
        directions: Unit vectors along the edges, shape (k - 1, n).
        along: Distance of each vertex from the first one along the path, shape (k,).
        phases: Durations of the phases on each edge, shape (k - 1, 7) [s].
        pushes: Accelerations along the edges at their beginnings, shape (k - 1, 7).
        smooth: Whether the jerk along an edge is limited, shape (k - 1,).

    Returns:
        Durations, positions, velocities and accelerations of all pieces, and the places on the path where they begin.
    """
    jerks = np.diff(np.concatenate([pushes, np.zeros_like(pushes[:, :1])], axis=1), axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        jerks = np.where((phases > MIN_PHASE_SECONDS) & smooth[:, None], jerks / phases, 0.0)

    speeds = np.zeros_like(phases)
    travelled = np.zeros_like(phases)
    for k in range(6):
        h = phases[:, k]
        v = speeds[:, k]
        a = pushes[:, k]
        j = jerks[:, k]
        speeds[:, k + 1] = v + h * (a + 0.5 * h * j)
        travelled[:, k + 1] = travelled[:, k] + h * (v + h * (0.5 * a + h * j / 6.0))

    edge, phase = np.nonzero(phases > MIN_PHASE_SECONDS)
    direction = directions[edge]
    begin = travelled[edge, phase]
    positions = vertices[edge] + begin[:, None] * direction
    velocities = speeds[edge, phase][:, None] * direction
    accelerations = pushes[edge, phase][:, None] * direction
    return phases[edge, phase], positions, velocities, accelerations, along[edge] + begin
