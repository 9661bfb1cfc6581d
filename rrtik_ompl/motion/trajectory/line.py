"""Along straight lines from rest to rest in the shortest time: at most seven phases of constant jerk, in closed form.

All joints follow the same profile, so the motion stays on the line; for one joint it is the joint's fastest motion.
Without a jerk limit the profile is the trapezoid of velocity, which is the shortest one on a line.
Source: [21], for the special case of rest at both ends.
"""

from __future__ import annotations

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.motion.trajectory.limits import RateLimits
from rrtik_ompl.motion.trajectory.pieces import Pieces

MIN_PHASE_SECONDS = 1e-9  # a shorter phase is left out
PUSHES = np.array([0.0, 1.0, 1.0, 0.0, 0.0, -1.0, -1.0])  # acceleration at the beginning of each phase, of its largest


def along_lines(corners: Matrix, limits: RateLimits) -> list[Pieces]:
    """The fastest motions from rest at each row of corners, shape (k, n), to rest at the next one: k - 1 of them.

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
