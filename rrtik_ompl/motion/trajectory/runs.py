"""Runs from stop to stop: straight ones, or curves through rounded corners; each becomes a motion of its own."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.motion.trajectory.corners import COINCIDENCE
from rrtik_ompl.motion.trajectory.cubics import Pieces
from rrtik_ompl.motion.trajectory.curve import Curve, Samples
from rrtik_ompl.motion.trajectory.dynamics import DynamicLimits
from rrtik_ompl.motion.trajectory.fastest import Bounds, fastest
from rrtik_ompl.motion.trajectory.limits import RateLimits
from rrtik_ompl.motion.trajectory.smoothing import Spline, smoothed, steps_for, widest_window

PERIOD = 1e-3  # [s] the least piece of a curve: the control period of a fast drive
CRUISE_SLACK = 1e-3  # of a speed, by which it may be more than is said while the acceleration changes its sign
SHORT_WINDOW = 0.02  # [s]; one so short costs nothing
MAX_SLOWINGS = 3  # by limits of the tip or of torques; two are enough but for rounding
SMOOTHED_SHARE = 0.12  # of a corner's radius: by which the smoothing over time alone may leave the rounded corner

MIN_PHASE_SECONDS = 1e-9  # a shorter phase is left out
PUSHES = np.array([0.0, 1.0, 1.0, 0.0, 0.0, -1.0, -1.0])  # acceleration at the beginning of each phase, of its largest


class Attempt(NamedTuple):
    """How a motion is smoothed.

    Attributes:
        window: Largest one, of the widest that the jerk limits can ask for.
        cruises: Whether the speed holds for as long between growing and falling: a shorter window is enough then.
    """

    window: float
    cruises: bool = False


ATTEMPTS = (Attempt(1.0), Attempt(0.7, cruises=True), Attempt(0.35))


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """A motion from rest to rest.

    Attributes:
        pieces: Its cubics, m of them.
        places: Where on the path each begins, from the beginning of the path, shape (m,).
        deviations: How far from there the motion is, shape (m,) [rad or m].
        on_path: Which of them do not leave the path, shape (m,).
    """

    pieces: Pieces
    places: Vector
    deviations: Vector
    on_path: Mask

    @property
    def duration(self) -> float:
        """Of all pieces together [s]."""
        return float(self.pieces.durations.sum())


def runs(
    corners: Matrix,
    radii: Vector,
    limits: RateLimits,
    *,
    max_deviation: float = np.inf,
    more: DynamicLimits | None = None,
) -> list[Run]:
    """The motions from stop to stop, each as fast as the limits allow.

    Args:
        corners: The vertices, shape (k, n).
        radii: How far from each inner one its rounding begins, shape (k - 2,); 0 for a stop.
        limits: Of n joints.
        max_deviation: How far from the path the motion may be, if that can be.
        more: Limits of the tip or of torques.
    """
    stops = [0, *(np.flatnonzero(radii == 0.0) + 1).tolist(), len(corners) - 1]
    vertex_places = np.concatenate([np.zeros(1), np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    lines = along_lines(corners, limits) if more is None and (len(stops) > 2 or len(corners) == 2) else []

    motions = []
    for first, last in pairwise(stops):
        if last == first + 1 and more is None:
            motions.append(_straight(lines[first], corners[first], vertex_places[first]))
        else:
            curve = Curve.of(corners[first : last + 1], radii[first : last - 1])
            motions.append(
                along_curve(curve, limits, max_deviation=max_deviation, more=more, begin=vertex_places[first])
            )
    return motions


def _straight(pieces: Pieces, start: Vector, begin: float) -> Run:
    travelled = np.linalg.norm(pieces.positions - start, axis=1)
    return Run(pieces, begin + travelled, np.zeros(len(travelled)), np.ones(len(travelled), dtype=bool))


def along_curve(
    curve: Curve,
    limits: RateLimits,
    *,
    max_deviation: float = np.inf,
    more: DynamicLimits | None = None,
    begin: float = 0.0,
) -> Run:
    """The motion along a curve; where its jerk is limited it passes bends on their inner side.

    Args:
        curve: From rest to rest.
        limits: Of its joints.
        max_deviation: How far from the path the motion may be; kept where one of the windows does.
        more: Limits of the tip or of torques.
        begin: Where on the whole path the curve begins.

    Raises:
        InputError: If numbers do not suffice.
    """
    grid, tightest = curve.grid()
    samples = curve.at(grid)
    extra = None if more is None else more.bounds(samples)
    bends = _lengths(samples.bends)
    max_squares = SMOOTHED_SHARE * tightest / np.maximum(bends, 1e-300)

    splines = (_smooth(curve, (grid, samples, extra), max_squares, limits, attempt) for attempt in _attempts(limits))
    motions = [_along(curve, spline if more is None else _slowed(spline, more), begin) for spline in splines]
    return min(motions, key=lambda run: (run.deviations.max() > max_deviation, run.duration))


def _attempts(limits: RateLimits) -> tuple[Attempt, ...]:
    """What to try: one window where it is so short that it costs nothing."""
    return ATTEMPTS if widest_window(limits) > SHORT_WINDOW else (Attempt(1.0),)


def _smooth(
    curve: Curve,
    grid_samples: tuple[Vector, Samples, Bounds | None],
    max_squares: Vector,
    limits: RateLimits,
    attempt: Attempt,
) -> Spline:
    """The fastest motion that the windows of an attempt leave near the curve.

    That is where the path speed squared, times a twenty-fourth of the window squared, is at most ``max_squares``, of
    shape (m,).
    """
    window = attempt.window * widest_window(limits)
    grid, samples, extra = grid_samples

    bounds = Bounds.capped(2.0 * max_squares / (window**2 / 12.0 + PERIOD**2 / 3.0))
    bounds = bounds if extra is None else bounds.and_also(extra)
    timing = fastest(grid, samples, limits, bounds)
    if not np.isfinite(timing.duration) or timing.duration <= 0.0:
        raise InputError(
            f"no motion along {curve.length:.3g} rad or m could be calculated; choose limits of an ordinary size"
        )

    if attempt.cruises:
        cap = np.square((1.0 + CRUISE_SLACK) * timing.cruising(window))
        timing = fastest(grid, samples, limits, bounds.and_also(Bounds.capped(cap)))

    step, count, window_steps = steps_for(timing.duration, window, PERIOD)
    places = timing.places(np.linspace(0.0, timing.duration, count + 1))
    return smoothed(np.column_stack([curve.at(places).positions, places]), step, window_steps, limits)


def _slowed(spline: Spline, more: DynamicLimits) -> Spline:
    """The spline, slowed until it keeps the limits of the tip and of torques at its knots and between them."""
    n = more.robot.dof
    for _ in range(MAX_SLOWINGS):
        factor = more.slowing(*(rows[:, :n] for rows in spline.states()))
        if factor == 1.0:
            break
        spline = spline.slowed(factor)
    return spline


def _along(curve: Curve, spline: Spline, begin: float) -> Run:
    """A spline in joints and place as the run that it is."""
    positions, velocities, accelerations = (rows[:-1] for rows in spline.knots())
    n = curve.vertices.shape[1]
    deviations = _lengths(positions[:, :n] - curve.path_at(positions[:, n]))

    # a piece lies among its four control points: on an edge, if all of them lie on it
    controls = spline.controls[:, :n]
    control_places = spline.controls[:, n]
    on_path_controls = _lengths(controls - curve.path_at(control_places)) <= COINCIDENCE
    edge_of_control = curve.edges(control_places)
    count = len(positions)
    one_edge = edge_of_control[:count] == edge_of_control[3 : 3 + count]
    on_path = one_edge & np.logical_and.reduce([on_path_controls[k : k + count] for k in range(4)])

    pieces = Pieces(np.full(count, spline.step), positions[:, :n], velocities[:, :n], accelerations[:, :n])
    return Run(pieces, begin + positions[:, n], deviations, on_path)


def _lengths(rows: Matrix) -> Vector:
    """Of each row, shape (m,)."""
    lengths: Vector = np.sqrt(np.einsum("ij,ij->i", rows, rows))
    return lengths


def along_lines(corners: Matrix, limits: RateLimits) -> list[Pieces]:
    """The fastest motions from rest at each row of corners, shape (k, n), to rest at the next one: k - 1 of them.

    At most seven phases of constant jerk, in closed form [21, for rest at both ends]. All joints follow the same
    profile, so that the motion stays on the line; for one joint it is the joint's fastest motion. Without a jerk limit
    the profile is the trapezoid of velocity, which is the shortest one on a line.

    Raises:
        InputError: If the limits are so small or so large that numbers do not suffice.
    """
    edges = np.diff(corners, axis=0)
    lengths = np.linalg.norm(edges, axis=1)
    directions = edges / lengths[:, None]
    rates = limits.along(directions)

    phases, pushes = _phases(lengths, *rates)
    _check(phases, lengths, rates)
    jerks = np.diff(np.concatenate([pushes, np.zeros_like(pushes[:, :1])], axis=1), axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        jerks = np.where((phases > MIN_PHASE_SECONDS) & np.isfinite(rates[2])[:, None], jerks / phases, 0.0)

    speeds = np.zeros_like(phases)
    travelled = np.zeros_like(phases)
    for k in range(6):
        h = phases[:, k]
        v = speeds[:, k]
        a = pushes[:, k]
        j = jerks[:, k]
        speeds[:, k + 1] = v + h * (a + 0.5 * h * j)
        travelled[:, k + 1] = travelled[:, k] + h * (v + h * (0.5 * a + h * j / 6.0))

    is_used = phases > MIN_PHASE_SECONDS
    return [
        Pieces(h[phase_used], a + np.outer(s[phase_used], d), np.outer(v[phase_used], d), np.outer(p[phase_used], d))
        for h, phase_used, a, d, s, v, p in zip(
            phases, is_used, corners[:-1], directions, travelled, speeds, pushes, strict=True
        )
    ]


def _phases(length: Vector, v: Vector, a: Vector, j: Vector) -> tuple[Matrix, Matrix]:
    """Durations of the seven phases, and accelerations at their beginnings, shape (m, 7) each."""
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        onset = a / j  # in which the acceleration comes to its limit
        ramp = np.where(v >= a * onset, v / a + onset, 2.0 * np.sqrt(v / j))  # in which the speed comes to its own
        cruise = length / v - ramp
        limit = a * onset
        peak = 0.5 * (np.sqrt(limit**2 + 4.0 * a * length) - limit)  # speed where there is no cruise
        gentle = np.cbrt(length / (2.0 * j))  # the onset where neither limit is reached
        short = length < 2.0 * limit * onset
        fast = cruise < 0.0
        ramp = np.where(fast, np.where(short, 2.0 * gentle, peak / a + onset), ramp)
        onset = np.minimum(onset, 0.5 * ramp)

    hold = ramp - 2.0 * onset
    cruise = np.maximum(cruise, 0.0)
    push = np.where(np.isinf(j), a, np.where(np.isinf(j), 0.0, j) * onset)
    phases = np.stack([onset, hold, onset, cruise, onset, hold, onset], axis=1)
    return phases, push[:, None] * PUSHES


def _check(phases: Matrix, lengths: Vector, rates: tuple[Vector, Vector, Vector]) -> None:
    durations = phases.sum(axis=1)
    usual = np.isfinite(durations) & (durations > 2.0 * MIN_PHASE_SECONDS)
    if not usual.all():
        k = int(np.argmin(usual))
        v, a, j = (float(rate[k]) for rate in rates)
        raise InputError(
            f"no motion of {lengths[k]:.3g} rad or m within velocity {v:.3g}, acceleration {a:.3g} and jerk {j:.3g} "
            "could be calculated; choose limits of an ordinary size"
        )
