"""Poses: ``pinocchio.SE3`` inside, position plus quaternion (x, y, z, w) or roll-pitch-yaw in files."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.arrays import Matrix, Vector, finite_array, frozen
from rrtik_ompl.errors import InputError

IDENTITY_QUATERNION = (0.0, 0.0, 0.0, 1.0)  # x, y, z, w
LAST_ROW = frozen([0.0, 0.0, 0.0, 1.0])  # of every pose
LAST_ROW_TOLERANCE = 1e-8
NOT_RIGID = 1e-3  # largest entry of R^T R - 1 that still counts as rounding of a file


def pose(xyz: ArrayLike = (0.0, 0.0, 0.0), quat_xyzw: ArrayLike = IDENTITY_QUATERNION, what: str = "pose") -> Any:
    """Make a pose from a position [m] and a unit quaternion in the order x, y, z, w.

    Raises:
        InputError: If a number is not finite, or the quaternion's length differs from 1 by more than 1e-3.
    """
    position = finite_array(xyz, (3,), f"{what}: xyz")
    quaternion = finite_array(quat_xyzw, (4,), f"{what}: quat_xyzw")
    length = float(np.linalg.norm(quaternion))
    if abs(length - 1.0) > 1e-3:
        raise InputError(f"{what}: quat_xyzw must have length 1, but has {length:.4g}; the order is x, y, z, w")
    x, y, z, w = quaternion / length
    return pin.SE3(pin.Quaternion(w, x, y, z).matrix(), position)


def pose_from_rpy(xyz: ArrayLike, rpy: ArrayLike, what: str = "pose") -> Any:
    """Make a pose from a position [m] and fixed-axis roll, pitch, yaw [rad] (URDF's convention)."""
    roll, pitch, yaw = finite_array(rpy, (3,), f"{what}: rpy")
    return pin.SE3(pin.rpy.rpyToMatrix(roll, pitch, yaw), finite_array(xyz, (3,), f"{what}: xyz"))


def quaternion_xyzw(placement: Any) -> Vector:
    """Unit quaternion (x, y, z, w) of a pose, w not negative, so that equal rotations read equal. Shape (4,)."""
    quaternion: Vector = np.asarray(pin.Quaternion(placement.rotation).coeffs(), dtype=np.float64)
    return -quaternion if quaternion[3] < 0.0 else quaternion


def rigid(T: Any, what: str) -> Any:
    """A pose given as ``pinocchio.SE3`` or as a matrix, shape (4, 4).

    Raises:
        InputError: If it is neither, or scales, skews or mirrors.
    """
    matrix = finite_array(T.homogeneous if isinstance(T, pin.SE3) else T, (4, 4), what)
    if np.abs(matrix[3] - LAST_ROW).max() > LAST_ROW_TOLERANCE:
        raise InputError(f"{what}: the last row must be 0 0 0 1, got {matrix[3].tolist()}")
    rotation = matrix[:3, :3]
    off = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
    if off > NOT_RIGID:
        raise InputError(
            f"{what}: its upper left 3 x 3 part is no rotation: {off:.3g} away from orthonormal "
            f"(at most {NOT_RIGID:g}); make it orthonormal"
        )
    x, y, z = rotation.tolist()
    if x[0] * (y[1] * z[2] - y[2] * z[1]) < x[1] * (y[0] * z[2] - y[2] * z[0]) - x[2] * (y[0] * z[1] - y[1] * z[0]):
        raise InputError(
            f"{what}: its upper left 3 x 3 part mirrors (determinant -1); make it orthonormal and right-handed"
        )
    return pin.SE3(matrix)


def unit_vector(values: ArrayLike, what: str) -> Vector:
    """A direction, shape (3,).

    Raises:
        InputError: If its length differs from 1 by more than 1e-3.
    """
    vector = finite_array(values, (3,), what)
    length = float(np.linalg.norm(vector))
    if abs(length - 1.0) > 1e-3:
        raise InputError(f"{what} must have length 1, but has {length:.4g}; divide it by its length")
    return vector / length


def rotation_angles(rotations: NDArray[np.float64]) -> Vector:
    """Angle of rotations, shape (m, 3, 3): atan2(|R - R^T| / (2 sqrt 2), (tr R - 1) / 2), accurate near 0 and pi."""
    skew = (rotations - np.swapaxes(rotations, 1, 2)).reshape(len(rotations), 9)
    sine = np.sqrt(np.vecdot(skew, skew) / 8.0)
    angle: Vector = np.arctan2(sine, 0.5 * (np.einsum("mii->m", rotations) - 1.0))
    return angle


def rpy_matrices(angles: Matrix) -> NDArray[np.float64]:
    """Rotations Rz(yaw) Ry(pitch) Rx(roll) for rows of roll, pitch, yaw [rad], shape (m, 3): (m, 3, 3)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(angles).T, np.sin(angles).T
    rows = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    matrices: NDArray[np.float64] = np.moveaxis(np.array(rows), 2, 0)
    return matrices
