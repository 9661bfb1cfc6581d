"""Along a straight line from rest to rest in the shortest time, by ruckig: at most seven pieces of constant jerk.

All joints follow the same profile, so the motion stays on the line; for one joint it is the joint's fastest motion.
Without a jerk limit the profile is the trapezoid of velocity, which is the shortest one on a line.
Source: [21].
"""

from __future__ import annotations

import numpy as np

from rrtik_ompl.arrays import Vector
from rrtik_ompl.errors import InputError
from rrtik_ompl.trajectory.limits import RateLimits
from rrtik_ompl.trajectory.pieces import Pieces

MIN_PHASE_SECONDS = 1e-9  # a shorter phase is left out


def along_line(a: Vector, b: Vector, limits: RateLimits) -> Pieces:
    """The fastest motion from rest at a to rest at b on the line between them, shape (n,) each.

    Raises:
        InputError: If the limits are so small or so large that numbers do not suffice.
    """
    length = float(np.linalg.norm(b - a))
    direction = (b - a) / length
    durations, distance, speed, push = _profile(length, *limits.along(direction))
    return Pieces(durations, a + np.outer(distance, direction), np.outer(speed, direction), np.outer(push, direction))


def _profile(length: float, velocity: float, acceleration: float, jerk: float) -> tuple[Vector, Vector, Vector, Vector]:
    """Durations of the phases, and distance, speed and acceleration at their beginnings, shape (m,) each."""
    from ruckig import InputParameter, Result, Ruckig, RuckigError, Trajectory

    task, found = InputParameter(1), Trajectory(1)
    task.target_position = [length]
    task.max_velocity, task.max_acceleration, task.max_jerk = [velocity], [acceleration], [jerk]
    try:
        status = Ruckig(1).calculate(task, found)
    except RuckigError:
        status = Result.Error
    if status not in (Result.Working, Result.Finished):
        raise InputError(
            f"no motion of {length:.3g} rad or m within velocity {velocity:.3g}, acceleration {acceleration:.3g} and "
            f"jerk {jerk:.3g} could be calculated; choose limits of an ordinary size"
        )
    profile = found.profiles[0][0]
    phases = np.array(profile.t)
    kept = phases > MIN_PHASE_SECONDS
    distance, speed, push = (np.array(column)[:-1][kept] for column in (profile.p, profile.v, profile.a))
    if np.isinf(jerk):
        push = np.diff(np.append(speed, 0.0)) / phases[kept]
    return phases[kept], distance, speed, push
