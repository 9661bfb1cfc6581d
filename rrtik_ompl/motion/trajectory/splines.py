"""Represent a motion as whoever receives its points plays it: straight, or by cubics or quintics between them.

So does ROS's ``joint_trajectory_controller``: between two points it goes by a quintic if both have velocities and
accelerations, by a cubic if both have velocities, and straight otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb, factorial
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector, frozen
from rrtik_ompl.kernels.timing.run_layout import JUMP_SHARE
from rrtik_ompl.model.certificate import Route
from rrtik_ompl.motion.trajectory.cubics import Cubics, Peaks, State

ROUNDING = 1e-9  # share of the largest velocity by which two velocities differ that are the same
ORDER = 6  # number of coefficients of a quintic
Powers: TypeAlias = NDArray[np.float64]  # coefficients of polynomials, shape (pieces, power from 0, joints)


@dataclass(frozen=True, slots=True, eq=False)
class Splines:
    """A motion as a polynomial for each piece between two points; the numbers are not checked.

    Attributes:
        times: Times of the points [s], shape (m,), increasing from 0.
        powers: Coefficients of the powers 0 to 5 of the share of a piece, from 0 at its begin to 1 at its end, shape
            (m - 1, 6, n) [rad or m].
        end: Positions at the last point, shape (n,) [rad or m].
    """

    times: Vector
    powers: Powers
    end: Vector

    @classmethod
    def through(
        cls, times: Vector, positions: Matrix, velocities: Matrix | None = None, accelerations: Matrix | None = None
    ) -> Splines:
        """Make the motion of a controller that receives points.

        Args:
            times: Times of the points [s], shape (m,).
            positions: Positions, shape (m, n).
            velocities: Velocities, shape (m, n), NaN at a point that has none; None if no point has any.
            accelerations: Accelerations likewise; at a point without velocity they do not count.
        """
        h = np.diff(times)[:, None]
        rise = np.diff(positions, axis=0)
        lines = np.zeros((len(rise), ORDER, positions.shape[1]))
        lines[:, 0] = positions[:-1]
        lines[:, 1] = rise
        if velocities is None:
            return cls(times, lines, positions[-1])

        v = velocities[:-1] * h
        w = velocities[1:] * h
        cubics = np.zeros_like(lines)
        cubics[:, :4] = np.stack([positions[:-1], v, 3.0 * rise - 2.0 * v - w, v + w - 2.0 * rise], axis=1)
        powers = np.where(np.isfinite(cubics).all(axis=(1, 2), keepdims=True), cubics, lines)
        if accelerations is None:
            return cls(times, powers, positions[-1])

        a = accelerations[:-1] * h**2
        b = accelerations[1:] * h**2
        third = 10.0 * rise - 6.0 * v - 4.0 * w - 1.5 * a + 0.5 * b
        fourth = -15.0 * rise + 8.0 * v + 7.0 * w + 1.5 * a - b
        fifth = 6.0 * rise - 3.0 * (v + w) - 0.5 * (a - b)
        quintics = np.stack([positions[:-1], v, 0.5 * a, third, fourth, fifth], axis=1)
        powers = np.where(np.isfinite(quintics).all(axis=(1, 2), keepdims=True), quintics, powers)
        return cls(times, powers, positions[-1])

    @classmethod
    def of(cls, motion: Cubics) -> Splines:
        """Return a motion of cubics as it is."""
        h = motion.steps[:, None]
        powers = np.zeros((len(h), ORDER, motion.positions.shape[1]))
        powers[:, 0] = motion.positions[:-1]
        powers[:, 1] = motion.velocities[:-1] * h
        powers[:, 2] = motion.accelerations[:-1] * h**2 / 2.0
        powers[:, 3] = motion.jerks * h**3 / 6.0
        return cls(motion.times, powers, motion.positions[-1])

    @property
    def duration(self) -> float:
        """Return the time from the first to the last point [s]."""
        return float(self.times[-1])

    @property
    def positions(self) -> Matrix:
        """Return the positions at the points, shape (m, n) [rad or m]."""
        return np.vstack([self.powers[:, 0], self.end])

    @property
    def route(self) -> Route:
        """Return the motion as a certificate has it."""
        h = np.diff(self.times)[:, None]
        degree = max(1, int(np.flatnonzero(self.powers.any(axis=(0, 2)))[-1:].sum()))
        rates = [self.powers[:, k] * (factorial(k) / h**k) for k in range(1, degree + 1)]
        return Route(frozen(self.positions), frozen(self.times), frozen(np.stack(rates, axis=1)))

    @property
    def straight(self) -> bool:
        """Return whether all pieces are straight."""
        return not self.powers[:, 2:].any()

    @property
    def smooth(self) -> bool:
        """Return whether its velocities do not jump between pieces."""
        slopes = _slopes(self.powers)
        h = np.diff(self.times)[:, None]
        begins = slopes[1:, 0] / h[1:]
        ends = slopes[:-1].sum(axis=1) / h[:-1]
        return bool((np.abs(begins - ends) <= ROUNDING * np.abs(begins).max(initial=0.0)).all())

    def at(self, pieces: NDArray[np.int64], shares: Vector) -> Matrix:
        """Return the positions at places, given by piece and share of it, shape (k,) each: shape (k, n)."""
        return _values(self.powers[pieces], shares)

    def states(self, clock: Vector) -> State:
        """Return positions, velocities and accelerations at times [s], shape (k,): shape (k, n) each.

        Before the beginning and after the end the motion is at rest.
        """
        inside = np.clip(clock, 0.0, self.duration)
        piece = np.minimum(self.times.searchsorted(inside, side="right") - 1, len(self.times) - 2)
        h = self.times[piece + 1] - self.times[piece]
        shares = (inside - self.times[piece]) / h
        powers = self.powers[piece]
        slopes = _slopes(powers)
        moving = (clock == inside)[:, None]

        positions = _values(powers, shares)
        positions[inside == self.duration] = self.end
        velocities = np.where(moving, _values(slopes, shares) / h[:, None], 0.0)
        accelerations = np.where(moving, _values(_slopes(slopes), shares) / h[:, None] ** 2, 0.0)
        return State(positions, velocities, accelerations)

    def greatest_speeds(self) -> Matrix:
        """Return upper bounds of the joints' speeds on each piece, shape (m - 1, n) [rad/s or m/s]."""
        return np.asarray(_bounds(_slopes(self.powers)) / np.diff(self.times)[:, None])

    def greatest_accelerations(self) -> Matrix:
        """Return upper bounds of the joints' accelerations on each piece, shape (m - 1, n) [rad/s^2 or m/s^2]."""
        return _bounds(_slopes(_slopes(self.powers))) / np.diff(self.times)[:, None] ** 2

    def greatest_pushes(self, weights: Vector) -> Vector:
        """Return upper bounds of a weighted sum of the joints' accelerations on each piece, shape (n,) -> (m - 1,)."""
        return np.asarray(self.greatest_accelerations() @ weights)

    def peaks(self) -> Peaks:
        """Return the largest velocity, acceleration and jerk of each joint.

        A velocity or an acceleration peaks at an end of a piece or where its own derivative is 0, a jerk likewise. If
        the acceleration of a joint jumps anywhere, its jerk is inf.
        """
        h = np.diff(self.times)[:, None]
        slopes = _slopes(self.powers)
        bends = _slopes(slopes)
        velocity = (_extremes(slopes) / h).max(axis=0)
        acceleration = (_extremes(bends) / h**2).max(axis=0)
        jerk = (_extremes(_slopes(bends)) / h**3).max(axis=0)

        rest = np.zeros((1, len(velocity)))
        begins = np.vstack([bends[:, 0] / h**2, rest])
        ends = np.vstack([rest, bends.sum(axis=1) / h**2])
        jumps = np.abs(begins - ends).max(axis=0) > JUMP_SHARE * max(float(acceleration.max()), 1e-300)
        return Peaks(velocity, acceleration, np.where(jumps, np.inf, jerk))


def _values(powers: Powers, shares: Vector) -> Matrix:
    """Return the values of polynomials, shape (k, powers, n), each at a share, shape (k,): shape (k, n)."""
    x = shares[:, None]
    values = np.array(powers[:, -1])
    for power in range(powers.shape[1] - 2, -1, -1):
        values = values * x + powers[:, power]
    return values


def _slopes(powers: Powers) -> Powers:
    """Return the derivatives of polynomials of shares."""
    slopes: Powers = powers[:, 1:] * np.arange(1.0, powers.shape[1])[:, None]
    return slopes


def _bounds(powers: Powers) -> Matrix:
    """Return upper bounds of polynomials' absolute values for shares from 0 to 1, shape (k, n).

    A polynomial lies in the hull of its coefficients in Bernstein's form.
    """
    degree = powers.shape[1] - 1
    to_bernstein = [[comb(i, k) / comb(degree, k) for k in range(degree + 1)] for i in range(degree + 1)]
    return np.asarray(np.abs(np.einsum("ik,mkn->imn", np.array(to_bernstein), powers)).max(axis=0))


def _extremes(powers: Powers) -> Matrix:
    """Return the largest absolute values of polynomials for shares from 0 to 1, shape (k, n).

    Their extremes are at the ends, and where their derivatives are 0: at the eigenvalues of companion matrices.
    """
    slopes = _slopes(powers)
    degree = slopes.shape[1] - 1
    found: Matrix = np.maximum(np.abs(powers[:, 0]), np.abs(powers.sum(axis=1)))
    if degree < 1:
        return found

    # A polynomial of less than the full degree gets one root far away.
    size = np.abs(slopes).max(axis=1)
    first = slopes[:, -1]
    first = np.where(np.abs(first) > 1e-13 * size, first, np.where(size > 0.0, 1e-13 * size, 1.0))
    companions = np.zeros((*first.shape, degree, degree))
    companions[..., np.arange(1, degree), np.arange(degree - 1)] = 1.0
    companions[..., -1] = -np.moveaxis(slopes[:, :-1], 1, -1) / first[..., None]
    roots = np.linalg.eigvals(companions)
    shares = np.where(np.abs(roots.imag) < 1e-6, np.clip(roots.real, 0.0, 1.0), 0.0)

    for k in range(degree):
        values = np.zeros_like(found)
        for power in range(powers.shape[1] - 1, -1, -1):
            values = values * shares[..., k] + powers[:, power]
        found = np.maximum(found, np.abs(values))
    return found
