"""Poses and rotations: ``pinocchio.SE3`` inside, position plus quaternion (x, y, z, w) or roll-pitch-yaw in files."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import TypeAlias, TypeVar

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import LARGEST, TAU, Mask, Matrix, Vector, bounded_array, dimensions, finite_array, frozen
from rrtik_ompl.base.errors import InputError, PoseWarning, at_most

PoseLike: TypeAlias = pin.SE3 | ArrayLike  # a pose in any form that `rigid` takes
Coordinate = TypeVar("Coordinate", float, Vector)

IDENTITY_QUATERNION = (0.0, 0.0, 0.0, 1.0)  # x, y, z, w
LAST_ROW = frozen([0.0, 0.0, 0.0, 1.0])  # last row of every homogeneous matrix
LAST_ROW_TOLERANCE = 1e-8
NOT_RIGID = 1e-6  # largest entry of R R^T - 1 that counts as a rounding error, which is removed
ROUNDING = 1e-12  # largest entry of R R^T - 1 with which a rotation is used unchanged
ROTATION_NOISE = 1e-9  # [rad]: a smaller rotation between two poses of a solid that moves is rounding
SAME_QUATERNION = 1e-6  # largest difference of a number of equal quaternions
ORDER_DOUBT = (
    "quat_xyzw [1, 0, 0, 0] is read as x, y, z, w: half a turn about x. No rotation is [0, 0, 0, 1], or quat_wxyz "
    "[1, 0, 0, 0]. If half a turn is meant, write rpy [pi, 0, 0] (files: rpy_deg [180, 0, 0]) or quat_wxyz [0, 1, 0, 0]"
)
MOST_MOVING = 200  # largest number of joints for Pinocchio, whose memory grows with their cube (32 GB for 1,000)


def pose(
    xyz: PoseLike = (0.0, 0.0, 0.0),
    quat_xyzw: ArrayLike | None = None,
    *,
    quat_wxyz: ArrayLike | None = None,
    rpy: ArrayLike | None = None,
) -> pin.SE3:
    """Make a pose from a position [m] and at most one orientation, or from any form of a pose.

    Args:
        xyz: The position [m], shape (3,); without an orientation a pose in any form that :func:`rigid` accepts, such as
            [x, y, z, roll, pitch, yaw] in metres and radians or a 4 x 4 matrix.
        quat_xyzw: The orientation as a unit quaternion in the order x, y, z, w (as in ROS and SciPy), shape (4,).
        quat_wxyz: The orientation as a unit quaternion in the order w, x, y, z (as in MuJoCo and Eigen), shape (4,).
        rpy: The orientation as roll, pitch, yaw about the fixed x, y and z axes [rad], shape (3,).

    Raises:
        InputError: If a number is not finite, more than one orientation is given, or a quaternion's length differs
            from 1 by more than 1e-3.

    A :class:`~rrtik_ompl.base.errors.PoseWarning` says where ``quat_xyzw`` is [1, 0, 0, 0], half a turn, which would be
    no rotation in the order w, x, y, z, and where ``rpy`` looks like degrees.

    Example:
        >>> rrtik.pose([0.1, 0.2, 0.3], [0.0, 0.0, 1.0, 0.0]).translation
        array([0.1, 0.2, 0.3])
        >>> down = rrtik.pose([0.1, 0.2, 0.3], rpy=[np.pi, 0.0, 0.0])
        >>> down.isApprox(rrtik.pose([0.1, 0.2, 0.3], quat_wxyz=[0.0, 1.0, 0.0, 0.0]))
        True
    """
    if quat_xyzw is None and quat_wxyz is None and rpy is None:
        return rigid(xyz, "pose")
    angles = None if rpy is None else _radians(rpy, "pose")
    return placed(xyz, "pose", quat_xyzw=quat_xyzw, quat_wxyz=quat_wxyz, rpy=angles)


def placed(
    xyz: PoseLike,
    what: str,
    *,
    quat_xyzw: ArrayLike | None = None,
    quat_wxyz: ArrayLike | None = None,
    rpy: ArrayLike | None = None,
) -> pin.SE3:
    """Make a pose from a position and at most one orientation as a person wrote it, see :func:`pose`.

    ``what`` names it in messages.
    """
    orientations = {"quat_xyzw": quat_xyzw, "quat_wxyz": quat_wxyz, "rpy": rpy}
    given = [name for name, value in orientations.items() if value is not None]
    if len(given) > 1:
        raise InputError(f"{what}: give one orientation, got {' and '.join(given)}")

    position = bounded_array(xyz, (3,), f"{what}: xyz")
    if quat_xyzw is not None:
        quaternion = unit_quaternion(quat_xyzw, f"{what}: quat_xyzw", "x, y, z, w")
        if reads_as_identity(quaternion):
            warnings.warn(PoseWarning(f"{what}: {ORDER_DOUBT}"), stacklevel=3)
        return pose_from_xyzw(position, quaternion)
    if quat_wxyz is not None:
        return pose_from_xyzw(position, np.roll(unit_quaternion(quat_wxyz, f"{what}: quat_wxyz", "w, x, y, z"), -1))
    if rpy is not None:
        return pose_from_rpy(position, rpy, what)
    return pin.SE3(np.eye(3), position)


def pose_from_xyzw(xyz: ArrayLike, quaternion: ArrayLike, what: str = "pose") -> pin.SE3:
    """Make a pose from a position [m] and a unit quaternion x, y, z, w, whose order is certain.

    Raises:
        InputError: If a number is not finite, or the quaternion's length differs from 1 by more than 1e-3.
    """
    position = bounded_array(xyz, (3,), f"{what}: xyz")
    x, y, z, w = unit_quaternion(quaternion, f"{what}: quat_xyzw", "x, y, z, w")
    return pin.SE3(pin.Quaternion(w, x, y, z).matrix(), position)


def unit_quaternion(values: ArrayLike, what: str, order: str) -> Vector:
    """Validate a quaternion of length 1, shape (4,), and normalise it; ``order`` is that of its numbers, for messages.

    Raises:
        InputError: If its length differs from 1 by more than 1e-3.
    """
    quaternion = finite_array(values, (4,), what)
    length = float(np.linalg.norm(quaternion))
    if abs(length - 1.0) > 1e-3:
        raise InputError(f"{what} must have length 1, but has {length:.4g}; the order is {order}")
    return quaternion / length


def reads_as_identity(quat_xyzw: Vector) -> bool:
    """Check whether a quaternion x, y, z, w is [1, 0, 0, 0], which is no rotation in the order w, x, y, z."""
    return bool(np.abs(quat_xyzw - (1.0, 0.0, 0.0, 0.0)).max() <= SAME_QUATERNION)


def orientation_data(placement: pin.SE3) -> dict[str, list[float]]:
    """Return the orientation of a pose as files write it; a half-turn about x such that reading it gives no warning."""
    quaternion = quaternion_xyzw(placement)
    if reads_as_identity(quaternion):
        return {"quat_wxyz": np.roll(quaternion, 1).tolist()}
    return {"quat_xyzw": quaternion.tolist()}


def pose_from_rpy(xyz: ArrayLike, rpy: ArrayLike, what: str = "pose") -> pin.SE3:
    """Make a pose from a position [m] and fixed-axis roll, pitch, yaw [rad] (URDF's convention)."""
    roll, pitch, yaw = bounded_array(rpy, (3,), f"{what}: rpy")
    return pin.SE3(pin.rpy.rpyToMatrix(roll, pitch, yaw), bounded_array(xyz, (3,), f"{what}: xyz"))


def quaternion_xyzw(placement: pin.SE3) -> Vector:
    """Return the unit quaternion (x, y, z, w) of a pose, shape (4,), with w >= 0 so that it is unique."""
    quaternion: Vector = np.asarray(pin.Quaternion(placement.rotation).coeffs(), dtype=np.float64)
    return -quaternion if quaternion[3] < 0.0 else quaternion


def pose_row(placement: pin.SE3) -> Vector:
    """Return a pose as x, y, z [m] and the quaternion x, y, z, w, shape (7,)."""
    return np.concatenate([placement.translation, quaternion_xyzw(placement)])


def apart(first: pin.SE3, second: pin.SE3) -> tuple[float, float]:
    """Return the distance [m] and the rotation angle [rad] between two poses."""
    off = first.actInv(second)
    return float(np.linalg.norm(off.translation)), float(np.linalg.norm(pin.log3(off.rotation)))


def travel_bound(a: pin.SE3, b: pin.SE3, radius: float) -> float:
    """Return an upper bound on the way of any point of a solid from one pose to another [m].

    The bound is the way of the origin plus the arc of the farthest point.

    Args:
        a: First pose.
        b: Second pose.
        radius: Distance of the farthest point from the origin [m]; inf for an unbounded shape, and then the bound is
            inf if the solid turns.
    """
    angle = float(np.linalg.norm(pin.log3(a.rotation.T @ b.rotation)))
    arc = radius * angle if angle > ROTATION_NOISE else 0.0
    return float(np.linalg.norm(b.translation - a.translation)) + arc


def working_memory(model: pin.Model) -> pin.Data:
    """Allocate Pinocchio's working memory (``pinocchio.Data``) for a model (``pinocchio.Model``).

    Raises:
        InputError: If the model has so many joints that the memory may not suffice.
    """
    few_joints(model)
    return model.createData()


def few_joints(model: pin.Model) -> None:
    """Refuse a model (``pinocchio.Model``) with more moving joints than ``MOST_MOVING``.

    Raises:
        InputError: If it has more.
    """
    at_most(int(model.nv), MOST_MOVING, f"robot '{model.name}': moving joints", "fix some; fk and jacobian take more")


def rigid(T: PoseLike, what: str) -> pin.SE3:
    """Validate a pose in any accepted form and return a copy as ``pinocchio.SE3``. All poses from outside pass here.

    Deviations from a rotation of up to ``NOT_RIGID``, as by rounding, are removed.

    Args:
        T: ``pinocchio.SE3``; a matrix, shape (4, 4); a position [x, y, z] [m] without rotation, shape (3,); the same
            followed by roll, pitch, yaw [rad], shape (6,), or by a quaternion x, y, z, w, shape (7,).
        what: Name of the pose, for messages.

    Raises:
        InputError: If it is none of these, has a number that is not finite, lies beyond ``LARGEST`` [m], or scales,
            skews or mirrors.
    """
    if not isinstance(T, pin.SE3) and dimensions(T) == 1:
        return _written_pose(T, what)
    matrix = finite_array(T.homogeneous if isinstance(T, pin.SE3) else T, (4, 4), what)
    x, y, z, last = matrix.tolist()  # Python's floats are faster than numpy for so few numbers

    if max(abs(last[0]), abs(last[1]), abs(last[2]), abs(last[3] - 1.0)) > LAST_ROW_TOLERANCE:
        raise InputError(f"{what}: the last row must be 0 0 0 1, got {last}")
    if max(abs(x[3]), abs(y[3]), abs(z[3])) > LARGEST:
        raise InputError(f"{what}: its position {[x[3], y[3], z[3]]} is farther than {LARGEST:g} m away; check units")

    lengths = (_dot(x, x), _dot(y, y), _dot(z, z))
    corners = (_dot(x, y), _dot(y, z), _dot(z, x))
    # The lengths come first, because they are never NaN: max ignores a NaN only if a number stands before it.
    off = max(*(abs(square - 1.0) for square in lengths), *map(abs, corners))

    if off > NOT_RIGID:
        raise InputError(
            f"{what}: its upper left 3 x 3 part is no rotation: {off:.3g} away from orthonormal "
            f"(at most {NOT_RIGID:g}); make it orthonormal"
        )
    if left_handed(x, y, z):
        raise InputError(
            f"{what}: its upper left 3 x 3 part mirrors (determinant -1); make it orthonormal and right-handed"
        )

    if off > ROUNDING:
        outer, _, inner = np.linalg.svd(matrix[:3, :3])  # the nearest rotation
        return pin.SE3(outer @ inner, matrix[:3, 3])
    return pin.SE3(matrix)


def _radians(rpy: ArrayLike, what: str) -> Vector:
    """Validate roll, pitch, yaw that a person wrote, shape (3,), and warn if they look like degrees."""
    angles = bounded_array(rpy, (3,), f"{what}: rpy")
    if np.abs(angles).max() > TAU:
        doubt = f"rpy {angles.tolist()} is read as radians, which is more than a turn; for degrees write np.deg2rad(..)"
        warnings.warn(PoseWarning(f"{what}: {doubt}"), stacklevel=4)
    return angles


def _written_pose(numbers: ArrayLike, what: str) -> pin.SE3:
    """Convert a pose that is written as 3, 6 or 7 numbers, see rigid."""
    values = finite_array(numbers, (None,), what)
    if len(values) == 3:
        return pin.SE3(np.eye(3), bounded_array(values, (3,), what))
    if len(values) == 6:
        return pose_from_rpy(values[:3], _radians(values[3:], what), what)
    if len(values) == 7:
        return placed(values[:3], what, quat_xyzw=values[3:])
    raise InputError(
        f"{what}: a pose is a pinocchio.SE3, a 4 x 4 matrix, [x, y, z], [x, y, z, roll, pitch, yaw] or "
        f"[x, y, z, qx, qy, qz, qw], not {len(values)} numbers"
    )


def left_handed(x: Sequence[Coordinate], y: Sequence[Coordinate], z: Sequence[Coordinate]) -> bool | Mask:
    """Check whether the determinant of three vectors is negative; their coordinates are numbers or arrays."""
    return x[0] * (y[1] * z[2] - y[2] * z[1]) < x[1] * (y[0] * z[2] - y[2] * z[0]) - x[2] * (y[0] * z[1] - y[1] * z[0])


def _dot(a: Sequence[float], b: Sequence[float]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def unit_vector(values: ArrayLike, what: str) -> Vector:
    """Validate a direction of length 1, shape (3,), and normalise it.

    Raises:
        InputError: If its length differs from 1 by more than 1e-3.
    """
    vector = finite_array(values, (3,), what)
    length = float(np.linalg.norm(vector))
    if abs(length - 1.0) > 1e-3:
        raise InputError(f"{what} must have length 1, but has {length:.4g}; divide it by its length")
    return vector / length


def turned_z(direction: Vector) -> NDArray[np.float64]:
    """Return the shortest rotation that takes the z axis to a unit vector, (3,) -> (3, 3)."""
    rotation: NDArray[np.float64] = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), direction).matrix()
    return rotation


def rotation_angles(rotations: NDArray[np.float64]) -> Vector:
    """Compute the angles of rotations, (m, 3, 3) -> (m,), accurately also near 0 and pi.

    The formula is atan2(|R - R^T| / (2 sqrt 2), (tr R - 1) / 2).
    """
    skew = (rotations - rotations.transpose(0, 2, 1)).reshape(len(rotations), 9)
    sine = np.sqrt(np.vecdot(skew, skew) / 8.0)
    angle: Vector = np.arctan2(sine, 0.5 * (rotations.trace(axis1=1, axis2=2) - 1.0))
    return angle


def rpy_matrices(angles: Matrix) -> NDArray[np.float64]:
    """Compute the rotations Rz(yaw) Ry(pitch) Rx(roll) for roll, pitch, yaw [rad]: (m, 3) -> (m, 3, 3)."""
    cr, cp, cy = np.cos(angles).T
    sr, sp, sy = np.sin(angles).T
    rows = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    matrices: NDArray[np.float64] = np.array(rows).transpose(2, 0, 1)
    return matrices


def joint_motions(axes: Matrix, prismatic: Mask, values: Matrix) -> NDArray[np.float64]:
    """Compute the transforms of joints for their values: translations, or rotations by Rodrigues' formula.

    Args:
        axes: Unit axes, shape (n, 3).
        prismatic: Which joints translate, shape (n,).
        values: Joint values [rad or m], shape (m, n).

    Returns:
        Homogeneous matrices, shape (m, n, 4, 4).
    """
    motions = np.zeros((*values.shape, 4, 4))
    motions[..., [0, 1, 2, 3], [0, 1, 2, 3]] = 1.0

    cross = np.zeros((len(axes), 3, 3))
    cross[:, [2, 0, 1], [1, 2, 0]] = axes
    cross[:, [1, 2, 0], [2, 0, 1]] = -axes
    cross[prismatic] = 0.0  # prismatic joints do not rotate

    sine = np.sin(values)[..., None, None]
    cosine = np.cos(values)[..., None, None]
    motions[..., :3, :3] += sine * cross + (1.0 - cosine) * (cross @ cross)
    motions[..., :3, 3][:, prismatic] = values[:, prismatic, None] * axes[prismatic]
    return motions


def cross_products(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute the cross products of rows, shape (m, 3), about five times faster than numpy for few rows."""
    product = a[:, [1, 2, 0]] * b[:, [2, 0, 1]]
    product -= a[:, [2, 0, 1]] * b[:, [1, 2, 0]]
    return product
