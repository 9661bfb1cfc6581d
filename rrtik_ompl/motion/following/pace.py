"""Vary the pace at which a motion is played (1 as it was timed, 0 at rest) by changes of pace that keep all limits.

With s the motion's own time and p the pace, velocities are q' p, accelerations q'' p^2 + q' dp/dt, jerks q''' p^3 + 3
q'' p dp/dt + q' d^2p/dt^2. A change of pace is a quintic over time; whether it keeps the limits is checked at samples
along it. Many changes are tried, some of which begin a little later, and the one that ends first is taken. The arm
stays on the path.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.polynomial.polynomial import polyder, polyint, polyval
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.motion.trajectory.cubics import Cubics
from rrtik_ompl.motion.trajectory.limits import RateLimits

SAMPLES = 80  # samples along a change of pace at which the limits are checked
FIRST_SAMPLES = 12  # samples of the first check, which rejects most changes that do not keep the limits
SHORTEST = 0.03  # [s] shortest change of pace
LENGTHS_PER_DECADE = 12  # number of lengths that are tried per decade
DELAYS = np.concatenate([[0.0], np.geomspace(0.03, 1.0, 12)])  # [s] delays until a change begins
KNOT_OFFSET = 1e-5  # [s] distance from a knot at which its two sides are checked
SLACK = 1.0 + 1e-9  # factor by which a limit may be exceeded by rounding
SHARES_OF_RISE = (1.0, 0.7, 0.4)  # shares of a higher pace, tried in turn: a lower one leaves room for the change


class Change(NamedTuple):
    """A change of pace, or k of them in parallel.

    Attributes:
        moment: When it begins [s]; a number, or shape (k,).
        length: How long it lasts [s]; a number, or shape (k,).
        coefficients: Coefficients of the pace as a polynomial of the time since the beginning, lowest power first,
            shape (6,) or (6, k).
        end: The pace after the change, the same for all of them.
    """

    moment: Vector
    length: Vector
    coefficients: Matrix
    end: float

    def at(self, clock: Vector) -> tuple[Vector, Vector, Vector, Vector]:
        """Evaluate the change at times since its beginning, shape (..., k).

        Returns:
            The advance along the motion since the beginning [s], the pace, and the pace's first and second derivative,
            each of the shape of ``clock``.
        """
        c = self.coefficients
        rows = (polyint(c), c, polyder(c), polyder(c, 2))
        advance, pace, rise, curvature = (
            np.asarray(polyval(clock, row, tensor=False), dtype=np.float64) for row in rows
        )
        return advance, pace, rise, curvature

    def selected(self, numbers: int | NDArray[np.int64]) -> Change:
        """Return the changes with these indices, or the one with this index."""
        return Change(self.moment[numbers], self.length[numbers], self.coefficients[:, numbers], self.end)


def changes_to(end: float, starts: Matrix, moments: Vector, lengths: Vector) -> Change:
    """Return quintics that lead from given paces to a steady one.

    Args:
        end: The steady pace at the end.
        starts: Pace and its first and second derivative at the beginning, shape (3, k).
        moments: When each change begins [s], shape (k,).
        lengths: How long each lasts [s], shape (k,).
    """
    p = starts[0]
    v = starts[1] * lengths
    a = starts[2] * lengths**2
    # Changes of the pace and its two derivatives at the end that the three highest powers have to bring about.
    missing = np.stack([end - p - v - 0.5 * a, -v - a, -a])
    end_conditions = np.array([[1.0, 1.0, 1.0], [3.0, 4.0, 5.0], [6.0, 12.0, 20.0]])
    coefficients = np.concatenate([np.stack([p, v, 0.5 * a]), np.linalg.solve(end_conditions, missing)])
    return Change(moments, lengths, coefficients / lengths ** np.arange(6)[:, None], end)


class Pace:
    """The pace over time, and how far the motion has advanced.

    Attributes:
        place: Place in the motion's own time [s].
        now: Time since the beginning [s].
        end: The current pace, or the one at the end of all changes that have been decided.
    """

    def __init__(self, motion: Cubics, limits: RateLimits) -> None:
        """Start at full pace, at the beginning of a motion that keeps the limits."""
        self.place = 0.0
        self.now = 0.0
        self.end = 1.0
        self._motion = motion
        self._limits = limits
        self._jerks = motion.jerks
        self._changes: list[Change] = []  # at most two, one after the other
        self._pace_before = 1.0  # steady pace before the first of them

        # A change from full pace to rest advances the motion by half its length, so longer ones would end too late.
        longest = max(2.0 * motion.duration, 2.0 * SHORTEST)
        count = 2 + int(LENGTHS_PER_DECADE * np.log10(longest / SHORTEST))
        delays, lengths = np.meshgrid(DELAYS, np.geomspace(SHORTEST, longest, count), indexing="ij")
        order = np.argsort((delays + lengths).ravel(), kind="stable")
        self._delay_numbers = np.unravel_index(order, delays.shape)[0]
        self._lengths = lengths.ravel()[order]

    @property
    def steady(self) -> float | None:
        """Return the pace if it is constant now, otherwise None."""
        return None if self._changes else self._pace_before

    def advance(self, seconds: float) -> None:
        """Advance by a time [s]: move along the motion, and drop changes of pace that end meanwhile."""
        self.place = self._state_after(seconds)[0]
        self.now += seconds
        while self._changes and self._end_time(0) <= self.now:
            self._pace_before = self._changes.pop(0).end

    def turn_to(self, end: float) -> None:
        """Decide on a change to another pace, or part of the way there, that begins now or soon.

        If no change keeps the limits, none is made.

        Candidates are sorted by when they end. A quick check at few samples selects some, of which the first one that
        passes the dense check is taken.
        """
        starts = np.array([self._state_after(delay) for delay in DELAYS]).T[:, self._delay_numbers]

        for share in SHARES_OF_RISE if end > self.end else SHARES_OF_RISE[:1]:
            if share * end <= self.end < end:
                return
            changes = changes_to(share * end, starts[1:], self.now + DELAYS[self._delay_numbers], self._lengths)
            for k in np.flatnonzero(self._passes_first_look(changes, starts[0])):
                change = changes.selected(int(k))
                if self._keeps_limits(change, starts[0, k]):
                    self._changes = [c for c in self._changes if c.moment < change.moment] + [change]
                    self.end = change.end
                    return

    def _passes_first_look(self, changes: Change, starts: Vector) -> Mask:
        """Check k changes at few samples: whether they keep the limits and never move backwards.

        Args:
            changes: The changes.
            starts: Place at which each begins, in the motion's own time [s], shape (k,).

        Returns:
            Mask of the changes that pass, shape (k,).
        """
        clock = np.linspace(0.0, 1.0, FIRST_SAMPLES)[:, None] * changes.length
        advance, pace, *_ = changes.at(clock)
        keeps: Mask = np.all((pace >= -1e-9) & (pace <= SLACK), axis=0)

        if changes.end == 0.0:  # A change to rest is pointless if the motion would end before it.
            remaining = self._motion.duration - self.place
            keeps &= starts + advance[-1] < self._motion.duration
            keeps &= (changes.moment + changes.length - self.now) * self._state_after(0.0)[1] < remaining

        numbers = np.flatnonzero(keeps)
        within = self._within_limits_at(clock[:, numbers], changes.selected(numbers), starts[numbers])
        keeps[numbers] = within.all(axis=0)
        return keeps

    def _keeps_limits(self, change: Change, place: float) -> bool:
        """Check whether a change of pace from a place on keeps the limits all along and never moves backwards."""
        clock = np.linspace(0.0, change.length, SAMPLES)
        advance, pace, *_ = change.at(clock)
        if pace.min() < -1e-9 or pace.max() > SLACK:
            return False

        # The motion's jerk jumps at its knots, so it is checked just before and just after each knot that is passed.
        places = place + advance
        knots = self._motion.times[(self._motion.times > places[0]) & (self._motion.times < places[-1])]
        knot_clock = np.interp(knots, places, clock)
        samples = np.clip(
            np.concatenate([clock, knot_clock - KNOT_OFFSET, knot_clock + KNOT_OFFSET]), 0.0, change.length
        )
        return bool(self._within_limits_at(samples, change, place).all())

    def _within_limits_at(self, clock: Vector, change: Change, place: float | Vector) -> Mask:
        """Check whether limits are kept at times since the beginning of changes; the mask has the shape of ``clock``.

        Args:
            clock: Times since the beginning [s], shape (k,), or (samples, k) for k changes.
            change: One change or k of them.
            place: Place at which each begins, in the motion's own time [s].
        """
        advance, *paces = change.at(clock)
        places = np.ravel(place + advance)
        state = self._motion.states(places)
        p, rise, curvature = (row.reshape(-1, 1) for row in paces)
        v = state.velocities
        a = state.accelerations
        j = self._jerks_at(places)

        rates = (v * p, a * p**2 + v * rise, j * p**3 + 3.0 * a * p * rise + v * curvature)
        bounds = (self._limits.velocity, self._limits.acceleration, self._limits.jerk)
        within = [
            (np.abs(rate) <= SLACK * bound + 1e-12).all(axis=1) for rate, bound in zip(rates, bounds, strict=True)
        ]
        keeps: Mask = np.logical_and.reduce(within).reshape(np.shape(clock))
        return keeps

    def _jerks_at(self, places: Vector) -> Matrix:
        """Return the motion's jerk at places, shape (k, n); at a knot the one after it, and 0 outside the motion."""
        motion = self._motion
        pieces = np.clip(np.searchsorted(motion.times, places, side="right") - 1, 0, len(motion.times) - 2)
        moving = (places >= 0.0) & (places < motion.duration)
        jerks: Matrix = np.where(moving[:, None], self._jerks[pieces], 0.0)
        return jerks

    def _end_time(self, number: int) -> float:
        """Return when a change ends or is replaced by the next one [s]."""
        change = self._changes[number]
        next_moment = [self._changes[number + 1].moment] if number + 1 < len(self._changes) else []
        return float(min([change.moment + change.length, *next_moment]))

    def _state_after(self, seconds: float) -> tuple[float, float, float, float]:
        """Return the state after a time from now [s], by the changes that have been decided.

        Returns:
            Place in the motion's own time [s], pace, and the pace's first and second derivative.
        """
        target_time = self.now + seconds
        time = self.now
        place = self.place
        pace_now = self._pace_before

        for number, change in enumerate(self._changes):
            if change.moment >= target_time:
                break  # The change begins after that time.
            moment = float(change.moment)
            if moment > time:
                place += pace_now * (moment - time)
                time = moment

            stop = min(self._end_time(number), target_time)
            advance, pace, rise, curvature = (
                row.tolist() for row in change.at(np.array([time - moment, stop - moment]))
            )
            place += advance[1] - advance[0]
            time = stop
            pace_now = change.end
            if stop == target_time and target_time < moment + change.length:
                return place, pace[1], rise[1], curvature[1]

        return place + pace_now * (target_time - time), pace_now, 0.0, 0.0
