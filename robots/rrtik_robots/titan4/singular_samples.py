"""Random singular configurations of the TITAN 4 for tests and benchmarks, with or without regard to joint limits."""

from __future__ import annotations

import numpy as np

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.ik.analytic.analytic_solver import Limits, wrapped
from rrtik_robots.titan4.geometry import TitanGeometry

RIGHT = np.pi / 2
AT_LIMIT = 1e-12  # allowance for rounding at a limit [rad]
FEWEST = 1_000  # least number of configurations that are drawn at once
ROUNDS = 10_000  # number of draws before giving up
CASES = ("generic", "elbow", "wrist", "shoulder", "elbow wrist", "shoulder wrist", "case 1", "case 2", "all psi")


def singular_configurations(case: str, count: int, rng: np.random.Generator, g: TitanGeometry | None = None) -> Matrix:
    """Draw random configurations of one of ``CASES``, regardless of joint limits, shape (count, 6) [rad].

    The names are those of the families. In ``case 1`` and ``case 2``, axis 5 or axis 6 is on axis 1; in ``all psi`` the
    wrist point is on axis 1 and the gripper axis is normal to the arm plane while link 4 is upright.

    Raises:
        UnknownNameError: If there is no such case.
    """
    geometry = TitanGeometry() if g is None else g
    if case not in CASES:
        raise UnknownNameError("singular case", case, CASES, where="titan4")

    Q = rng.uniform(-np.pi, np.pi, (count, 6))
    if "shoulder" in case:
        Q = _on_axis(geometry, Q, None, rng)
    elif case in ("case 1", "case 2", "all psi"):
        psi = rng.choice([0.0, np.pi], count) if case == "case 1" else np.full(count, RIGHT)
        Q = _on_axis(geometry, Q, psi, rng)
    if "elbow" in case:
        Q[:, 2] = rng.choice([0.0, np.pi], count)
    if "wrist" in case or case == "all psi":
        Q[:, 4] = rng.choice([-RIGHT, RIGHT], count)
    if case == "case 2":
        Q[:, 4] = rng.choice([0.0, np.pi], count)
    return Q


def configurations_inside(
    case: str, count: int, rng: np.random.Generator, limits: Limits, g: TitanGeometry | None = None
) -> Matrix:
    """Draw random configurations of a case, see `singular_configurations`, that are inside joint limits.

    A wrist yaw of 90 degrees counts as inside limits of 90 degrees.

    Args:
        case: One of ``CASES``.
        count: Number of configurations.
        rng: Source of random numbers.
        limits: Lowest and highest joint values [rad], shape (6,) each.
        g: Lengths of the arm; the defaults if None.

    Raises:
        UnknownNameError: If there is no such case.
        InputError: If hardly any configuration of the case is inside the limits.
    """
    low = limits[0] - AT_LIMIT
    high = limits[1] + AT_LIMIT
    found = np.zeros((0, 6))
    for _ in range(ROUNDS):
        Q = singular_configurations(case, max(count, FEWEST), rng, g)
        found = np.vstack([found, Q[((low <= Q) & (high >= Q)).all(axis=1)]])
        if len(found) >= count:
            return found[:count]
    raise InputError(f"titan4: {len(found)} of {count} postures of case '{case}' found inside the limits; widen them")


def _on_axis(g: TitanGeometry, Q: Matrix, psi: np.ndarray | None, rng: np.random.Generator) -> Matrix:
    """Return configurations changed in joints 2 to 4 so that the wrist point is on axis 1.

    theta2 and theta3 are drawn until theta4 can bring the point there. If psi is given, theta2 is drawn until theta3
    and theta4 can do so with that psi.

    Args:
        g: Lengths of the arm.
        Q: Configurations, shape (m, 6).
        psi: Wanted sums of the three pitch angles [rad], shape (m,), or None.
        rng: Source of random numbers.
    """
    placed = Q.copy()
    todo = np.arange(len(Q))
    while len(todo):
        shoulder, elbow = rng.uniform(-np.pi, np.pi, (2, len(todo)))
        angle = elbow if psi is None else psi[todo]
        link, other = (g.a4, g.a3) if psi is None else (g.a3, g.a4)
        cosine = -(g.a1 + g.a2 * np.cos(shoulder) + other * np.cos(angle)) / link
        turn = np.arccos(np.clip(cosine, -1.0, 1.0)) * rng.choice([-1.0, 1.0], len(todo))
        forearm, last = (angle, turn) if psi is None else (turn, angle)
        placed[todo, 1:4] = np.column_stack([shoulder, wrapped(forearm - shoulder), wrapped(last - forearm)])
        todo = todo[np.abs(cosine) > 1.0]
    return placed
