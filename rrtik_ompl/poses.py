"""Poses: ``pinocchio.SE3`` inside, position plus quaternion (x, y, z, w) or roll-pitch-yaw in files."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.arrays import Vector, finite_array
from rrtik_ompl.errors import InputError

IDENTITY_QUATERNION = (0.0, 0.0, 0.0, 1.0)  # x, y, z, w


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
