"""Path constraints as equations f(q) = 0 with a tolerance of 1, for any solver: values and derivatives.

The values of a region are smooth and are 0 where the region would be without tolerances; inside the region their
Euclidean norm is at most 1. Positions are divided by the tolerance of the position, orientations (or their sines) by
that of the orientation.
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
    """Return the number of equations."""
    return sum(len(_coordinates(region)) + TURN_EQUATIONS[region.turning] for region in constraints.regions)


def equations(robot: Robot, constraints: HeldRegions, q: Vector) -> tuple[Vector, Matrix]:
    """Compute the values and derivatives of the equations.

    Args:
        robot: The arm.
        constraints: One or more regions.
        q: A configuration, shape (dof,).

    Returns:
        Values without unit, shape (k,), and their derivatives with respect to q, shape (k, dof).
    """
    parts = [_of_region(robot, region, q[None]) for region in constraints.regions]
    return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])


def _coordinates(region: HeldRegion) -> NDArray[np.int64]:
    """Return the indices of the position coordinates that a region bounds."""
    return np.flatnonzero((np.abs(region.region.bounds[:3]) < ANYWHERE).any(axis=1))


def _of_region(robot: Robot, region: HeldRegion, q: Matrix) -> tuple[Vector, Matrix]:
    """Compute the values and derivatives of the equations of one region.

    Args:
        robot: The arm.
        region: The region.
        q: A configuration as a row, shape (1, dof).

    Returns:
        Values without unit, shape (k,), and their derivatives with respect to q, shape (k, dof).
    """
    displacement = region.displacements(q)[0]
    twist = twists(robot, region, q)[0]
    task = region.region

    bounded = _coordinates(region)
    position = displacement[bounded, 3]
    away = position - np.clip(position, *task.bounds[bounded].T)
    values = [away / task.position_tolerance]
    derivatives = [twist[bounded] * (away != 0.0)[:, None] / task.position_tolerance]

    rotation = displacement[:3, :3]
    if region.turning == Turning.AXIS:
        turned, by_turning = _leaning(rotation[:, 2], region.direction)
        scale = 1.0 / _sine_of(task.orientation_tolerance)
    elif region.turning == Turning.BALL:
        turned, by_turning = _turned(rotation)
        scale = 1.0 / _sine_of(task.orientation_tolerance)
    elif region.turning == Turning.RANGES:
        angles = roll_pitch_yaw(rotation[None])
        turned = (angles - into_range(angles, *task.bounds[3:].T))[0]
        turned[np.abs(turned) < SMALL] = 0.0
        by_turning = rates(rotation[None])[0] * (turned != 0.0)[:, None]
        # The tolerance bounds the sum of the three excesses, which is at most sqrt(3) times their length.
        scale = np.sqrt(3.0) / task.orientation_tolerance
    else:
        return values[0], derivatives[0]

    values.append(scale * turned)
    derivatives.append(scale * by_turning @ twist[3:])
    return np.concatenate(values), np.concatenate(derivatives)


def _sine_of(tolerance: float) -> float:
    return float(np.sin(min(tolerance, 0.5 * np.pi)))


def _leaning(axis: Vector, direction: Vector) -> tuple[Vector, Matrix]:
    """Compute how far a unit vector leans from a direction, shape (2,), and its derivatives, shape (2, 3).

    The norm is the sine of the angle between them, or 2 minus the sine beyond a right angle, so that it grows up to the
    opposite direction. The derivatives are with respect to a rotation of the vector.
    """
    sides = np.linalg.svd(direction[None])[2][1:]  # two unit vectors that span the plane normal to the direction
    lean = sides @ axis
    slope = np.cross(axis, sides)
    if axis @ direction >= 0.0:
        return lean, slope

    sine = max(float(np.linalg.norm(lean)), 1e-9)
    outward = lean / sine if sine > 1e-9 else np.array([1.0, 0.0])
    # The derivative of (2 - |v|) v / |v|: along v it falls as |v| grows, across v it turns.
    along = np.outer(outward, outward)
    across = np.eye(2) - along
    return (2.0 - sine) * outward, ((2.0 - sine) / sine * across - along) @ slope


def _turned(rotation: Matrix) -> tuple[Vector, Matrix]:
    """Convert a rotation to a vector along its axis, shape (3,), with its derivatives by a rotation, shape (3, 3).

    The norm is the sine of the angle up to a right angle. Beyond, where the sine decreases again, it is the angle
    itself.
    """
    if np.trace(rotation) < 1.0:
        return pin.log3(rotation), pin.Jlog3(rotation) @ rotation.T
    skew = 0.5 * np.array(
        [rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]]
    )
    return skew, 0.5 * (np.trace(rotation) * np.eye(3) - rotation)
