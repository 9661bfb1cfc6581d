"""How fast a motion is played: its pace, 1 as it was timed, 0 at rest, and changes of pace that keep all limits.

With s the motion's own time and p the pace, velocities are q' p, accelerations q'' p^2 + q' dp/dt, jerks
q''' p^3 + 3 q'' p dp/dt + q' d^2p/dt^2. A change of pace is a quintic over time; whether it keeps the limits is looked
up along it. Of many, some of which begin a little later, the one that ends first is taken. The arm stays on the path.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.polynomial.polynomial import polyder, polyint, polyval
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.motion.trajectory.cubics import Cubics
from rrtik_ompl.motion.trajectory.limits import RateLimits

SAMPLES = 80  # along a change of pace
FIRST_SAMPLES = 12  # along each of those that are tried; most that keep no limits are found by them
SHORTEST = 0.03  # [s] of a change of pace
LENGTHS_PER_DECADE = 12  # of those that are tried
DELAYS = np.concatenate([[0.0], np.geomspace(0.03, 1.0, 12)])  # [s] until it begins
KNOT_OFFSET = 1e-5  # [s] from a knot
SLACK = 1.0 + 1e-9  # times a limit
SHARES_OF_RISE = (1.0, 0.7, 0.4)  # of a higher pace, tried in turn: less of it leaves room for the change


class Change(NamedTuple):
    """A change of pace, or k of them side by side.

    Attributes:
        moment: When it begins [s]; a number, or shape (k,).
        length: How long it lasts [s].
        coefficients: Of the pace over the time since the beginning, shape (6,) or (6, k).
        end: The pace after it, of all of them.
    """

    moment: Vector
    length: Vector
    coefficients: Matrix
    end: float

    def at(self, clock: Vector) -> tuple[Vector, Vector, Vector, Vector]:
        """After times since the beginning, shape (..., k): how far it came, its pace and two derivatives of that."""
        c = self.coefficients
        rows = (polyint(c), c, polyder(c), polyder(c, 2))
        advance, pace, rise, curvature = (
            np.asarray(polyval(clock, row, tensor=False), dtype=np.float64) for row in rows
        )
        return advance, pace, rise, curvature

    def selected(self, numbers: int | NDArray[np.int64]) -> Change:
        """Those of several with these numbers, or the one with this number."""
        return Change(self.moment[numbers], self.length[numbers], self.coefficients[:, numbers], self.end)


def changes_to(end: float, starts: Matrix, moments: Vector, lengths: Vector) -> Change:
    """The quintics from paces with two derivatives, rows of ``starts``, shape (3, k), to a steady one."""
    p = starts[0]
    v = starts[1] * lengths
    a = starts[2] * lengths**2
    # what the three highest powers have to bring about at the end: of the pace and its two derivatives
    missing = np.stack([end - p - v - 0.5 * a, -v - a, -a])
    end_conditions = np.array([[1.0, 1.0, 1.0], [3.0, 4.0, 5.0], [6.0, 12.0, 20.0]])
    coefficients = np.concatenate([np.stack([p, v, 0.5 * a]), np.linalg.solve(end_conditions, missing)])
    return Change(moments, lengths, coefficients / lengths ** np.arange(6)[:, None], end)


class Pace:
    """The pace over time, and how far the motion has come by it.

    Attributes:
        place: In the motion's own time [s].
        now: Time since the beginning [s].
        end: The pace that it is at, or comes to by what has been decided.
    """

    def __init__(self, motion: Cubics, limits: RateLimits) -> None:
        """Full pace, at the beginning of a motion that keeps the limits."""
        self.place = 0.0
        self.now = 0.0
        self.end = 1.0
        self._motion = motion
        self._limits = limits
        self._jerks = motion.jerks
        self._changes: list[Change] = []  # at most two, one after the other
        self._pace_before = 1.0  # steady, before the first of them

        # a change to rest takes as much of the motion's time as half its length: no longer one ends before the motion
        longest = max(2.0 * motion.duration, 2.0 * SHORTEST)
        count = 2 + int(LENGTHS_PER_DECADE * np.log10(longest / SHORTEST))
        delays, lengths = np.meshgrid(DELAYS, np.geomspace(SHORTEST, longest, count), indexing="ij")
        order = np.argsort((delays + lengths).ravel(), kind="stable")
        self._delay_numbers = np.unravel_index(order, delays.shape)[0]
        self._lengths = lengths.ravel()[order]

    @property
    def steady(self) -> float | None:
        """The pace, if it does not change."""
        return None if self._changes else self._pace_before

    def advance(self, seconds: float) -> None:
        """Let time pass [s]: go on along the motion, and past changes of pace that end meanwhile."""
        self.place = self._state_after(seconds)[0]
        self.now += seconds
        while self._changes and self._end_time(0) <= self.now:
            self._pace_before = self._changes.pop(0).end

    def turn_to(self, end: float) -> None:
        """Decide on a change to another pace, now or soon, or to one nearer to it; on none if none keeps the limits."""
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
        """Which of k changes keep the limits at a first look and never go back, from places, shape (k,)."""
        clock = np.linspace(0.0, 1.0, FIRST_SAMPLES)[:, None] * changes.length
        advance, pace, *_ = changes.at(clock)
        keeps: Mask = np.all((pace >= -1e-9) & (pace <= SLACK), axis=0)

        if changes.end == 0.0:  # the motion rests at its own end too
            remaining = self._motion.duration - self.place
            keeps &= starts + advance[-1] < self._motion.duration
            keeps &= (changes.moment + changes.length - self.now) * self._state_after(0.0)[1] < remaining

        numbers = np.flatnonzero(keeps)
        within = self._within_limits_at(clock[:, numbers], changes.selected(numbers), starts[numbers])
        keeps[numbers] = within.all(axis=0)
        return keeps

    def _keeps_limits(self, change: Change, place: float) -> bool:
        """Whether the motion keeps the limits all along a change of pace from a place, and never goes back."""
        clock = np.linspace(0.0, change.length, SAMPLES)
        advance, pace, *_ = change.at(clock)
        if pace.min() < -1e-9 or pace.max() > SLACK:
            return False

        # the motion's jerk jumps at its knots: just before and after each that is passed
        places = place + advance
        knots = self._motion.times[(self._motion.times > places[0]) & (self._motion.times < places[-1])]
        knot_clock = np.interp(knots, places, clock)
        samples = np.clip(
            np.concatenate([clock, knot_clock - KNOT_OFFSET, knot_clock + KNOT_OFFSET]), 0.0, change.length
        )
        return bool(self._within_limits_at(samples, change, place).all())

    def _within_limits_at(self, clock: Vector, change: Change, place: float | Vector) -> Mask:
        """Whether the limits are kept after times since the beginning of changes; of the shape of ``clock``."""
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
        """The motion's jerk, shape (k, n); just after a jump, and none before its beginning and from its end on."""
        motion = self._motion
        pieces = np.clip(np.searchsorted(motion.times, places, side="right") - 1, 0, len(motion.times) - 2)
        moving = (places >= 0.0) & (places < motion.duration)
        jerks: Matrix = np.where(moving[:, None], self._jerks[pieces], 0.0)
        return jerks

    def _end_time(self, number: int) -> float:
        """When a change ends, or gives way to the next."""
        change = self._changes[number]
        next_moment = [self._changes[number + 1].moment] if number + 1 < len(self._changes) else []
        return float(min([change.moment + change.length, *next_moment]))

    def _state_after(self, seconds: float) -> tuple[float, float, float, float]:
        """Place, pace and its two derivatives after a time from now, as has been decided."""
        target_time = self.now + seconds
        time = self.now
        place = self.place
        pace_now = self._pace_before

        for number, change in enumerate(self._changes):
            if change.moment >= target_time:
                break  # it has not begun then
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
