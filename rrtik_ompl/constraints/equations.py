"""Path constraints as equations f(q) = 0 with a tolerance of 1, for anybody's solver: values and derivatives.

The values of a region are smooth and are 0 where it would be without tolerances; their Euclidean length is at most 1
inside it. Positions count in tolerances of the position, orientations in (sines of) that of the orientation.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.constraints.held_region import ANYWHERE, HeldRegion, Turning
from rrtik_ompl.constraints.held_regions import HeldRegions
from rrtik_ompl.constraints.residuals import SMALL, rates, twists
from rrtik_ompl.model.goal_kind import into_range, roll_pitch_yaw
from rrtik_ompl.model.robot import Robot

TURN_EQUATIONS = {Turning.FREE: 0, Turning.AXIS: 2, Turning.BALL: 3, Turning.RANGES: 3}


def equation_count(constraints: HeldRegions) -> int:
    """Return how many equations there are."""
    return sum(len(_coordinates(region)) + TURN_EQUATIONS[region.turning] for region in constraints.regions)


def equations(robot: Robot, constraints: HeldRegions, q: Vector) -> tuple[Vector, Matrix]:
    """Return values and derivatives of the equations.

    Args:
        robot: The arm.
        constraints: One region or more.
        q: A configuration, shape (dof,).

    Returns:
        Without unit, shapes (k,) and (k, dof).
    """
    parts = [_of_region(robot, region, q[None]) for region in constraints.regions]
    return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])


def _coordinates(region: HeldRegion) -> NDArray[np.int64]:
    """Return the coordinates of the position that a region bounds."""
    return np.flatnonzero((np.abs(region.region.bounds[:3]) < ANYWHERE).any(axis=1))


def _of_region(robot: Robot, region: HeldRegion, q: Matrix) -> tuple[Vector, Matrix]:
    D = region.displacements(q)[0]
    J = twists(robot, region, q)[0]
    task = region.region

    some = _coordinates(region)
    away = D[some, 3] - np.clip(D[some, 3], *task.bounds[some].T)
    values = [away / task.position_tolerance]
    derivatives = [J[some] * (away != 0.0)[:, None] / task.position_tolerance]

    R = D[:3, :3]
    tolerance = np.sin(min(task.orientation_tolerance, 0.5 * np.pi))

    if region.turning == Turning.AXIS:
        sides = np.linalg.svd(region.direction[None])[2][1:]
        lean = sides @ R[:, 2]
        if R[:, 2] @ region.direction < 0.0:  # behind: farther still
            lean = lean * (2.0 / max(float(np.linalg.norm(lean)), 1e-9) - 1.0)
        values.append(lean / tolerance)
        derivatives.append(np.cross(R[:, 2], sides) @ J[3:] / tolerance)
    elif region.turning == Turning.BALL and np.trace(R) < 1.0:  # behind: the sine of a half turn is 0 again
        values.append(pin.log3(R) / tolerance)
        derivatives.append(pin.Jlog3(R) @ R.T @ J[3:] / tolerance)
    elif region.turning == Turning.BALL:
        values.append(0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / tolerance)
        derivatives.append(0.5 * (np.trace(R) * np.eye(3) - R) @ J[3:] / tolerance)
    elif region.turning == Turning.RANGES:
        angles = roll_pitch_yaw(R[None])
        over = (angles - into_range(angles, *task.bounds[3:].T))[0]
        over[np.abs(over) < SMALL] = 0.0
        scale = np.sqrt(3.0) / task.orientation_tolerance  # the sum of three counts, which is no more than the length
        values.append(scale * over)
        derivatives.append(scale * (rates(R[None])[0] @ J[3:]) * (over != 0.0)[:, None])

    return np.concatenate(values), np.concatenate(derivatives)
