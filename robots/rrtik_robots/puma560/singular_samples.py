"""Random postures of the PUMA 560 inside its joint limits, singular ones among them, for tests and benchmarks."""

from __future__ import annotations

import numpy as np

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.errors import UnknownNameError
from rrtik_ompl.ik.analytic.analytic_solver import wrapped
from rrtik_ompl.model.robot import Robot
from rrtik_robots.puma560 import ROWS_560

CASES = ("generic", "elbow", "wrist", "shoulder", "elbow wrist", "shoulder wrist")


def singular_configurations(robot: Robot, case: str, count: int, rng: np.random.Generator) -> Matrix:
    """Draw random configurations of one of ``CASES`` (combinations of families) inside the limits.

    In the elbow cases the elbow is stretched, since a folded one would be outside its limits. Shape (count, 6) [rad].

    Raises:
        UnknownNameError: If there is no such case.
    """
    if case not in CASES:
        raise UnknownNameError("singular case", case, CASES, where=robot.name)

    a2 = ROWS_560[1][0]
    a3 = ROWS_560[2][0]
    d4 = ROWS_560[3][2]
    bend = np.arctan2(d4, a3)  # minus theta3 where the elbow is stretched
    found = np.zeros((0, 6))
    while len(found) < count:
        Q = rng.uniform(robot.lower, robot.upper, (4 * count, 6))
        if "elbow" in case:
            Q[:, 2] = -bend
        if "wrist" in case:
            Q[:, 4] = 0.0
        if "shoulder" in case:
            cosine = -a2 * np.cos(Q[:, 1]) / np.hypot(a3, d4)
            Q = Q[np.abs(cosine) <= 1.0]
            cosine = cosine[np.abs(cosine) <= 1.0]
            Q[:, 2] = wrapped(np.arccos(cosine) * rng.choice([-1.0, 1.0], len(Q)) - bend - Q[:, 1])
            Q = Q[np.abs(np.sin(Q[:, 2] + bend)) > 0.1]  # With a folded elbow the wrist centre is in the shoulder.
        found = np.vstack([found, Q[robot.within_limits(Q, 0.0)]])
    return found[:count]
