"""How fast a motion is played: its pace, 1 as it was timed, 0 at rest, and changes of pace that keep all limits.

With s the motion's own time and p the pace, velocities are q' p, accelerations q'' p^2 + q' dp/dt, jerks
q''' p^3 + 3 q'' p dp/dt + q' d^2p/dt^2. A change of pace is a quintic over time; whether it keeps the limits is looked
up along it. Of many, some of which begin a little later, the one that ends first is taken. The arm stays on the path.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.polynomial import Polynomial

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.trajectory import RateLimits, Trajectory

LOOKS = 80  # along a change of pace
LENGTHS = np.geomspace(0.03, 3.0, 12)  # [s] of a change of pace
DELAYS = np.concatenate([[0.0], np.geomspace(0.03, 1.0, 9)])  # [s] until it begins
BESIDE = 1e-5  # [s] from a knot
SLACK = 1.0 + 1e-9
TRIALS = sorted(((float(d), float(n)) for d in DELAYS for n in LENGTHS), key=sum)


class Change(NamedTuple):
    """A change of pace that begins at a moment and lasts for a while.

    Attributes:
        pace: Over the time since its beginning.
        length: How long it lasts [s].
        end: The pace after it.
    """

    pace: Polynomial
    length: float
    end: float


def change_of(start: tuple[float, float, float], end: float, length: float) -> Change:
    """The quintic from a pace with two derivatives to a steady one, over a length of time [s]."""
    p, v, a = start[0], start[1] * length, start[2] * length**2
    rest = np.array([end - p - v - 0.5 * a, -v - a, -a])
    ends = np.array([[1.0, 1.0, 1.0], [3.0, 4.0, 5.0], [6.0, 12.0, 20.0]])
    coefficients = np.concatenate([[p, v, 0.5 * a], np.linalg.solve(ends, rest)])
    return Change(Polynomial(coefficients / length ** np.arange(6)), length, end)


def keeps_limits(change: Change, motion: Trajectory, place: float, limits: RateLimits) -> bool:
    """Whether a motion whose pace changes at a place of it [s] keeps the limits and never goes back."""
    clock = np.linspace(0.0, change.length, LOOKS)
    pace = change.pace(clock)
    if pace.min() < -1e-9 or pace.max() > SLACK:
        return False
    return _kept_at(clock, change, motion, place, limits) and _kept_at(
        _with_knots(clock, change, motion, place), change, motion, place, limits
    )


def _kept_at(clock: Vector, change: Change, motion: Trajectory, place: float, limits: RateLimits) -> bool:
    """Whether the limits are kept at some times since the beginning of a change, shape (k,)."""
    rises = change.pace.deriv()
    places = place + change.pace.integ()(clock)
    return _within(motion, places, (change.pace(clock), rises(clock), rises.deriv()(clock)), limits)


def _with_knots(clock: Vector, change: Change, motion: Trajectory, place: float) -> Vector:
    """Times with those just before and after each knot that is passed, where the motion's jerk jumps."""
    places = place + change.pace.integ()(clock)
    knots = motion.times[(motion.times > places[0]) & (motion.times < places[-1])]
    at = np.interp(knots, places, clock)
    looks: Vector = np.clip(np.concatenate([clock, at - BESIDE, at + BESIDE]), 0.0, change.length)
    return looks


class Pace:
    """The pace over time, and how far the motion has come by it.

    Attributes:
        place: In the motion's own time [s].
        now: Time since the beginning [s].
        end: The pace that it is at, or comes to by what has been decided.
    """

    def __init__(self) -> None:
        """Full pace, at the beginning."""
        self.place, self.now, self.end = 0.0, 0.0, 1.0
        self._changes: list[tuple[float, Change]] = []  # with the moments at which they begin; at most two
        self._steady = 1.0  # before the first of them

    @property
    def steady(self) -> float | None:
        """The pace, if it does not change."""
        return None if self._changes else self._steady

    def advance(self, seconds: float) -> None:
        """Let time pass."""
        self.place = self._after(seconds)[0]
        self.now += seconds
        while self._changes and self._ends(0) <= self.now:
            self._steady = self._changes.pop(0)[1].end

    def turn_to(self, end: float, motion: Trajectory, limits: RateLimits) -> bool:
        """Decide on a change to another pace, now or soon; whether there is one that keeps the limits."""
        for delay, length in TRIALS:
            place, *start = self._after(delay)
            change = change_of((start[0], start[1], start[2]), end, length)
            if keeps_limits(change, motion, place, limits):
                moment = self.now + delay
                self._changes = [(t, c) for t, c in self._changes if t < moment] + [(moment, change)]
                self.end = end
                return True
        return False

    def _ends(self, number: int) -> float:
        """When a change ends, or gives way to the next."""
        moment, change = self._changes[number]
        later = [self._changes[number + 1][0]] if number + 1 < len(self._changes) else []
        return min([moment + change.length, *later])

    def _after(self, seconds: float) -> tuple[float, float, float, float]:
        """Place, pace and its two derivatives after a time from now, as has been decided."""
        until, at, place, steady = self.now + seconds, self.now, self.place, self._steady
        for number, (moment, change) in enumerate(self._changes):
            if moment >= until:
                break
            if moment > at:
                place, at = place + steady * (moment - at), moment
            stop = min(self._ends(number), until)
            gone = change.pace.integ()
            place += float(gone(stop - moment) - gone(at - moment))
            at, steady = stop, change.end
            if stop == until and until < moment + change.length:
                rise, bend = (float(change.pace.deriv(k)(until - moment)) for k in (1, 2))
                return place, float(change.pace(until - moment)), rise, bend
        return place + steady * (until - at), steady, 0.0, 0.0


def _within(motion: Trajectory, places: Vector, paces: tuple[Vector, Vector, Vector], limits: RateLimits) -> bool:
    state = motion(places)
    piece = np.clip(np.searchsorted(motion.times, places, side="right") - 1, 0, len(motion.times) - 2)
    jerks = np.where((places >= 0.0)[:, None] & (places < motion.duration)[:, None], motion.jerks[piece], 0.0)
    p, rise, bend = (row[:, None] for row in paces)
    v, a = state.velocities, state.accelerations
    rates: tuple[Matrix, ...] = (v * p, a * p**2 + v * rise, jerks * p**3 + 3.0 * a * p * rise + v * bend)
    bounds = (limits.velocity, limits.acceleration, limits.jerk)
    return all(bool((np.abs(rate) <= SLACK * bound + 1e-12).all()) for rate, bound in zip(rates, bounds, strict=True))
