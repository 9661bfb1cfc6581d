"""Along a curve from rest to rest in the shortest time under velocity and acceleration limits, by toppra.

Source: [19].
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.arrays import Vector
from rrtik_ompl.errors import PlannerError
from rrtik_ompl.trajectory.corners import Curve
from rrtik_ompl.trajectory.limits import RateLimits
from rrtik_ompl.trajectory.pieces import Pieces

if TYPE_CHECKING:
    from toppra.interpolator import AbstractGeometricPath

STEPS_PER_PIECE = 80  # grid steps of each piece of a curve


def along_curve(curve: Curve, limits: RateLimits) -> Pieces:
    """The fastest motion along a curve that keeps the limits at the points of a grid.

    Between two of them every joint follows the cubic through its positions and velocities there.

    Raises:
        PlannerError: If toppra finds no motion.
    """
    path = _path(curve)
    ends = np.concatenate([np.zeros(1), np.cumsum(curve.lengths)])
    shares = np.arange(STEPS_PER_PIECE) / STEPS_PER_PIECE
    inside = [begin + (end - begin) * shares for begin, end in pairwise(ends)]
    grid = np.append(np.concatenate(inside), ends[-1])
    speeds = _speeds(path, grid, limits)
    durations = 2.0 * np.diff(grid) / (speeds[1:] + speeds[:-1])
    positions, velocities = path(grid), path(grid, 1) * speeds[:, None]
    positions[0], positions[-1] = curve.points[0, 0], curve.points[-1, -1]
    h, mean = durations[:, None], np.diff(positions, axis=0) / durations[:, None]
    accelerations = (6.0 * mean - 4.0 * velocities[:-1] - 2.0 * velocities[1:]) / h
    return Pieces(durations, positions[:-1], velocities[:-1], accelerations)


def _speeds(path: AbstractGeometricPath, grid: Vector, limits: RateLimits) -> Vector:
    """Speed of the parameter at the points of the grid, 0 at both ends."""
    from toppra.algorithm import TOPPRA
    from toppra.constraint import DiscretizationType, JointAccelerationConstraint, JointVelocityConstraint

    v, a = (np.stack([-row, row], axis=1) for row in (limits.velocity, limits.acceleration))
    rules = [
        JointVelocityConstraint(v),
        JointAccelerationConstraint(a, discretization_scheme=DiscretizationType.Interpolation),
    ]
    _, speeds, _ = TOPPRA(rules, path, gridpoints=grid, solver_wrapper="seidel").compute_parameterization(0.0, 0.0)
    if speeds is None or not np.isfinite(speeds).all() or not ((speeds[1:] + speeds[:-1]) > 0.0).all():
        raise PlannerError("toppra finds no timing for the rounded path; round its corners less, or not at all")
    found: Vector = speeds
    return found


def _path(curve: Curve) -> AbstractGeometricPath:
    """The curve in toppra's interface: values and derivatives at many places, by scipy's Bernstein polynomials."""
    from scipy.interpolate import BPoly
    from toppra.interpolator import AbstractGeometricPath

    ends = np.concatenate([np.zeros(1), np.cumsum(curve.lengths)])
    values = BPoly(np.moveaxis(curve.points, 0, 1), ends)
    orders = (values, values.derivative(1), values.derivative(2))

    class Path(AbstractGeometricPath):  # type: ignore[misc]
        dof = curve.points.shape[2]
        path_interval = ends[[0, -1]]

        def __call__(self, places: ArrayLike, order: int = 0) -> NDArray[np.float64]:
            values: NDArray[np.float64] = orders[order](places)
            return values

    return Path()
