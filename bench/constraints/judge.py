"""An independent judge of paths: Pinocchio's kinematics and coal's collisions, nothing of the checks of planners."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pinocchio as pin

from bench.shared.judge import Contacts
from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.world.problem import Problem

PARTS = 50  # of a stored motion, at least, at which poses are looked at
FINER = 5  # of the motion resolution of 10 mm, likewise
CONTACTS = 2  # poses of which one is checked for contacts


@dataclass(frozen=True)
class Verdict:
    """What the judge saw.

    Attributes:
        metres: Largest distance of the frame from its region, beyond the tolerance [m].
        degrees: Largest angle, likewise [deg].
        tilt: Largest angle of the tool's axis from where it was at the start [deg].
        contacts: Configurations in collision.
        looked_at: Configurations.
    """

    metres: float
    degrees: float
    tilt: float
    contacts: int
    looked_at: int


def judged(problem: Problem, rows: Matrix) -> Verdict:
    """Look at a path in steps of a fiftieth of every stored motion, and of 2 mm at most."""
    robot, region = problem.robot, problem.constraints[0]
    model, data = robot.model, robot.model.createData()
    frame = model.getFrameId(robot.tip)
    dense = _dense(problem, rows)
    judge = Contacts(problem.world)
    full = robot.pinocchio_configuration(dense)
    first, metres, radians, tilt, contacts = None, 0.0, 0.0, 1.0, 0
    low, high = region.bounds.T
    w, tip_w = region.T_world_w.inverse(), region.T_w_tip.inverse()
    for number, q in enumerate(full):
        pin.forwardKinematics(model, data, q)
        pose = pin.updateFramePlacement(model, data, frame)
        D = w * pose * tip_w
        first = pose.rotation[:, 2].copy() if first is None else first
        tilt = min(tilt, float(pose.rotation[:, 2] @ first))
        metres = max(metres, float(np.linalg.norm(D.translation - np.clip(D.translation, low[:3], high[:3]))))
        radians = max(radians, _angle(D.rotation, low[3:], high[3:]))
        if number % CONTACTS == 0:
            contacts += any(True for _ in judge.depths(dense[number]))
    beyond = max(metres - region.position_tolerance, 0.0), max(radians - region.orientation_tolerance, 0.0)
    return Verdict(
        beyond[0], float(np.degrees(beyond[1])), float(np.degrees(np.arccos(min(tilt, 1.0)))), contacts, len(dense)
    )


def _dense(problem: Problem, rows: Matrix) -> Matrix:
    """Configurations along a path."""
    parts = [rows[:1]]
    for a, b in pairwise(rows):
        count = max(PARTS, FINER * problem.world.steps(a, b))
        shares = np.arange(1, count + 1)[:, None] / count
        parts.append((1.0 - shares) * a + shares * b)
    return np.vstack(parts)


def _angle(R: Matrix, low: Matrix, high: Matrix) -> float:
    """Angle from what a region of one of the measured kinds says of the orientation [rad]."""
    if (high - low > 6.0).all():
        return 0.0
    if (high - low > 6.0).any():  # yaw is free
        return float(np.arccos(np.clip(R[2, 2], -1.0, 1.0)))
    return float(np.linalg.norm(pin.log3(R)))
