"""Compute the pose of an object from the pixels of known points on it, with its covariance.

A single square seen almost from the front has two poses that explain its picture nearly equally well (Collins and
Bartoli, 2014 [51]): both are returned. With strong perspective, or by chance, only one of them is a minimum of the
error. Then the second one is the closed-form solution, because the true pose may lie in the long valley between it and
the minimum. The covariance follows from first-order propagation of the errors of the corners.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
import pinocchio as pin
from scipy.special import chdtri

from rrtik_ompl.base.arrays import Matrix, Vector, frozen
from rrtik_ompl.sensing.cameras.camera import Camera

# A smaller ratio of the two errors is ambiguous: this covers 27 % of near-frontal views, and all wrong choices.
MIN_ERROR_RATIO = 6.0
CHANCE_ERROR = 0.015  # [pixels]; smaller errors of four corners occur by chance
ALIGNED_SIGMA = 0.02  # [pixels]; error of an aligned corner: a quarter is noise of 1 %, the rest lens and blur
ROUGH_SIGMA = 0.2  # [pixels]; error of a corner that was not aligned, which blur pulls inwards
# Probability of honest deviations that are so large that they scale the covariance up.
SURPRISING = 0.05
MAX_DISTANCE = 1e4  # [m]
# [rad]; minima closer than this are the same. Distinct ones differ by at least 0.03.
MIN_BRANCH_ANGLE = 1e-3
_FLAT = 1e-6  # extent of points in a plane across it, as a share of that along it
_MAX_STEPS = 40


@dataclass(frozen=True, slots=True, eq=False)
class CornerPose:
    """A pose that explains the pixels of known points.

    Attributes:
        T_camera_object: The pose with the least error.
        other: The second pose of a single square, or of points in a plane; None if there is none.
        error: Root mean square distance of the points from their pixels [pixels].
        other_error: That of the second pose; infinite if there is none.
        covariance: Covariance of (position [m], small rotation about the axes of the camera [rad]), shape (6, 6).
        surprise: Sum of squared normalised residuals divided by the degrees of freedom: about 1 is usual; a much larger
            value is a contradiction.
        strain: How much of this sum another focal length, or another distortion, would explain, whichever is more; for
            correct intrinsics the square of a standard normal number. 0 for a single square.
    """

    T_camera_object: pin.SE3
    other: pin.SE3 | None
    error: float
    other_error: float
    covariance: Matrix
    surprise: float = 1.0
    strain: float = 0.0

    @property
    def ambiguous(self) -> bool:
        """Whether the second pose explains the picture almost as well, so that the first may be wrong."""
        return self.other_error < MIN_ERROR_RATIO * max(self.error, CHANCE_ERROR)

    @property
    def position_sigma(self) -> float:
        """Standard deviation of the position along its worst direction [m]."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance[:3, :3])[-1]))

    @property
    def rotation_sigma(self) -> float:
        """Standard deviation of the rotation about its worst axis [rad]."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance[3:, 3:])[-1]))


def turn_between(first: pin.SE3, second: pin.SE3) -> float:
    """Return the angle between the rotations of two poses [rad]."""
    return float(np.linalg.norm(pin.log3(first.rotation.T @ second.rotation)))


def square_corners(side: float) -> Matrix:
    """Return the corners of a marker in its own frame (x right, y up, z out of it) as detected, shape (4, 3)."""
    half = 0.5 * side
    return np.array([[-half, half, 0.0], [half, half, 0.0], [half, -half, 0.0], [-half, -half, 0.0]])


def pose_of_square(
    camera: Camera,
    pixels: Matrix,
    side: float,
    sigma: float = ALIGNED_SIGMA,
    spread: Matrix | None = None,
    side_sigma: float = 0.0,
    shifts: Sequence[Matrix] = (),
    moving: bool = False,
) -> CornerPose:
    """Compute the pose of one marker from its four corners.

    The closed form gives up to two poses, which Levenberg-Marquardt refines. If both converge to the same minimum, the
    unrefined closed-form solution that is farther away becomes the second pose.

    Args:
        camera: Camera of the picture.
        pixels: Pixels of the corners, shape (4, 2).
        side: Side of the marker [m].
        sigma: Standard deviation of a corner [pixels].
        spread: Covariance of the corners, used instead of ``sigma``, shape (8, 8) [pixels^2].
        side_sigma: Standard deviation of the side [m].
        shifts: Further possible displacements of the corners, as in `pose_of_points`.
        moving: As in `pose_of_points`.
    """
    points = square_corners(side)
    shifts = [*shifts, points * side_sigma / side] if side_sigma else shifts

    # For an exactly frontal marker the closed form may give NaN or a marker that faces away. Then SQPnP is used.
    guesses = _guesses(camera, points, pixels, cv2.SOLVEPNP_IPPE_SQUARE) or _guesses(camera, points, pixels)

    best_pose, other, valley = _branches(camera, points, pixels, guesses)
    other = valley if other is None else other
    covariances = _pixel_covariance(len(points), sigma, spread), _point_covariance(camera, points, best_pose, shifts)
    return _judged(camera, points, pixels, (best_pose, other), covariances, moving)


def pose_of_points(
    camera: Camera,
    pixels: Matrix,
    points: Matrix,
    sigma: float = ALIGNED_SIGMA,
    spread: Matrix | None = None,
    shifts: Sequence[Matrix] = (),
    moving: bool = False,
) -> CornerPose:
    """Compute the pose of an object from at least four known points on it; points in a plane may have two.

    Args:
        camera: Camera of the picture.
        pixels: Pixels of the points, shape (m, 2).
        points: In the frame of the object, shape (m, 3) [m].
        sigma: Standard deviation of a pixel coordinate [pixels].
        spread: Covariance of the pixels, used instead of ``sigma``, shape (2 m, 2 m) [pixels^2].
        shifts: Possible displacements of the points on the object, one standard deviation for each independent cause,
            shape (m, 3) each [m].
        moving: Whether the displacements are large beside the error of the pixels, as with a rolling shutter: then the
            points are weighted by the inverse of their covariance, so that the pose does not bend to the motion.
    """
    guesses = _guesses_in_a_plane(camera, points, pixels) or _guesses(camera, points, pixels)[:1]
    best, other, _ = _branches(camera, points, pixels, guesses)
    covariances = _pixel_covariance(len(points), sigma, spread), _point_covariance(camera, points, best, shifts)
    found = _judged(camera, points, pixels, (best, other), covariances, moving)
    return replace(found, strain=_strain(camera, points, pixels, found.T_camera_object, covariances))


def _judged(
    camera: Camera,
    points: Matrix,
    pixels: Matrix,
    poses: tuple[pin.SE3, pin.SE3 | None],
    covariances: tuple[Matrix, Matrix],
    moving: bool,
) -> CornerPose:
    """Return the poses with their errors and covariance.

    Args:
        camera: See `pose_of_points`.
        points: See `pose_of_points`.
        pixels: See `pose_of_points`.
        poses: The pose with the least error, and the second one.
        covariances: See `_covariance`.
        moving: See `pose_of_points`.
    """
    error, other_error = (np.inf if T is None else _error(camera, points, pixels, T) for T in poses)
    best, other = poses
    if moving:
        both = covariances[0] + covariances[1]
        best = _levenberg(camera, points, pixels, best, both)
        other = None if other is None else _levenberg(camera, points, pixels, other, both)
    covariance, surprise = _covariance(camera, points, pixels, best, covariances, moving)
    return CornerPose(best, other, error, other_error, covariance, surprise)


def _guesses_in_a_plane(camera: Camera, points: Matrix, pixels: Matrix) -> list[pin.SE3]:
    """Return the closed-form poses of points in a plane, best first; none if the points are in no plane."""
    middle = points.mean(axis=0)
    _, extents, axes = np.linalg.svd(points - middle, full_matrices=False)
    if extents[2] >= _FLAT * extents[0]:
        return []

    # OpenCV's solution is wrong for points in another plane than z = 0.
    axes[2] = np.cross(axes[0], axes[1])
    T_plane_object = pin.SE3(axes, -axes @ middle)
    on_plane = (points - middle) @ axes.T * [1.0, 1.0, 0.0]
    return [guess * T_plane_object for guess in _guesses(camera, on_plane, pixels, cv2.SOLVEPNP_IPPE)]


def _branches(
    camera: Camera, points: Matrix, pixels: Matrix, guesses: Sequence[pin.SE3]
) -> tuple[pin.SE3, pin.SE3 | None, pin.SE3 | None]:
    """Return the minimum with the least error, the other one, and, if both are one, the guess that is farther away."""
    refined = [_levenberg(camera, points, pixels, guess) for guess in guesses]
    best_index = int(np.argmin([_error(camera, points, pixels, pose) for pose in refined]))
    best = refined[best_index]
    if len(guesses) < 2:
        return best, None, None

    other = refined[1 - best_index]
    if turn_between(best, other) < MIN_BRANCH_ANGLE:
        return best, None, max(guesses, key=lambda guess: turn_between(best, guess))
    return best, other, None


def _guesses(camera: Camera, points: Matrix, pixels: Matrix, method: int = cv2.SOLVEPNP_SQPNP) -> list[pin.SE3]:
    """Return closed-form poses that explain the pixels, best first; implausible ones are left out."""
    view = np.eye(3)
    intrinsics = camera.matrix, camera.distortion
    if camera.lens == "fisheye":
        # OpenCV's closed forms know no fisheye, and pinholes that look elsewhere do not see all of what it sees.
        view, pixels = camera.seen_by_pinhole(pixels)
        intrinsics = np.eye(3), np.zeros(5)

    object_points = np.ascontiguousarray(points)
    image_points = np.ascontiguousarray(pixels)
    _, turns, shifts, _ = cv2.solvePnPGeneric(object_points, image_points, *intrinsics, flags=method)
    poses = [pin.SE3(cv2.Rodrigues(r)[0], t.ravel()) for r, t in zip(turns, shifts, strict=True)]
    plausible = [T for T in poses if _plausible(T, method == cv2.SOLVEPNP_IPPE_SQUARE)]
    return [pin.SE3(view, np.zeros(3)) * T for T in plausible]


def _plausible(pose: pin.SE3, facing: bool) -> bool:
    """Check that a pose is finite, in front of the camera, and, if required, with its z axis towards the camera."""
    if not (np.isfinite(pose.homogeneous).all() and 0.0 < pose.translation[2] < MAX_DISTANCE):
        return False
    return not facing or float(pose.rotation[:, 2] @ pose.translation) < 0.0


def _levenberg(
    camera: Camera, points: Matrix, pixels: Matrix, pose: pin.SE3, covariance: Matrix | None = None
) -> pin.SE3:
    """Refine a pose to the nearby minimum of the reprojection error by Levenberg-Marquardt.

    Rotations are updated about the axes of the camera; steps that increase the error are rejected. With a covariance of
    the pixels, shape (2 m, 2 m), the errors are weighted by its inverse.
    """
    whitening = np.eye(pixels.size) if covariance is None else np.linalg.inv(np.linalg.cholesky(covariance))

    def residuals_at(T: pin.SE3) -> Vector:
        return np.asarray(whitening @ (pixels - camera.project(points @ T.rotation.T + T.translation)).ravel())

    damping = 1e-6
    residuals = residuals_at(pose)

    for _ in range(_MAX_STEPS):
        jacobian = whitening @ camera.jacobian(points @ pose.rotation.T, pose.translation)
        normal = jacobian.T @ jacobian
        step = np.linalg.solve(normal + damping * np.diag(normal.diagonal()), jacobian.T @ residuals)
        candidate = pin.SE3(pin.exp3(step[3:]) @ pose.rotation, pose.translation + step[:3])

        new_residuals = residuals_at(candidate)
        error, new_error = (float(np.linalg.norm(each)) for each in (residuals, new_residuals))
        if new_error < error:
            pose = candidate
            residuals = new_residuals
            damping = 0.1 * damping
        else:
            damping *= 100.0

        if abs(error - new_error) <= 1e-9 * error or damping > 1e3:
            break

    return pose


def _error(camera: Camera, points: Matrix, pixels: Matrix, pose: pin.SE3) -> float:
    residuals = camera.project(points @ pose.rotation.T + pose.translation) - pixels
    return float(np.sqrt((residuals**2).sum(axis=1).mean()))


def _pixel_covariance(count: int, sigma: float, spread: Matrix | None) -> Matrix:
    """Return the covariance of the detected pixels, shape (2 m, 2 m) [pixels^2]."""
    return sigma**2 * np.eye(2 * count) if spread is None else spread


def _point_covariance(camera: Camera, points: Matrix, pose: pin.SE3, shifts: Sequence[Matrix]) -> Matrix:
    """Return the covariance of the pixels due to uncertain intrinsics and points, shape (2 m, 2 m) [pixels^2]."""
    in_camera_axes = points @ pose.rotation.T
    covariance = camera.doubt(in_camera_axes + pose.translation)
    jacobian = camera.jacobian(in_camera_axes, pose.translation)[:, :3].reshape(-1, 2, 3)

    for shift in shifts:
        pixel_shift = np.einsum("kij,kj->ki", jacobian, shift @ pose.rotation.T).ravel()
        covariance = covariance + np.outer(pixel_shift, pixel_shift)

    return covariance


def _covariance(
    camera: Camera,
    points: Matrix,
    pixels: Matrix,
    pose: pin.SE3,
    covariances: tuple[Matrix, Matrix],
    weighted: bool,
) -> tuple[Matrix, float]:
    """Return the covariance of a pose, and its normalised sum of squared residuals.

    The part due to the pixels is scaled up if the residuals are larger than they should be (`SURPRISING`).

    Args:
        camera: Camera of the picture.
        points: In the frame of the object, shape (m, 3) [m].
        pixels: Shape (m, 2).
        pose: ``T_camera_object``.
        covariances: Of the pixels and of the points, as covariances of pixels, shape (2 m, 2 m) each.
        weighted: Whether the points were weighted by the inverse of their sum.

    Returns:
        Covariance of (position [m], rotation [rad]), shape (6, 6), and the ``surprise`` of `CornerPose`.
    """
    in_camera_axes = points @ pose.rotation.T
    of_pixels, of_points = covariances
    jacobian = camera.jacobian(in_camera_axes, pose.translation)
    pseudo_inverse = np.linalg.pinv(jacobian)
    residuals = (camera.project(in_camera_axes + pose.translation) - pixels).ravel()

    scaled = np.linalg.solve(of_pixels + of_points, np.c_[residuals, jacobian])
    normal_rows = jacobian.T @ scaled  # normal equations of the weighted least-squares pose near this one
    squares = float(
        residuals @ scaled[:, 0] - normal_rows[:, 0] @ np.linalg.solve(normal_rows[:, 1:], normal_rows[:, 0])
    )

    if weighted:
        pseudo_inverse = np.linalg.solve(normal_rows[:, 1:], scaled[:, 1:].T)

    degrees = 2 * len(points) - 6
    covariance = (
        max(squares / float(chdtri(degrees, SURPRISING)), 1.0) * (pseudo_inverse @ of_pixels @ pseudo_inverse.T)
        + pseudo_inverse @ of_points @ pseudo_inverse.T
    )
    return frozen(covariance), max(squares, 0.0) / degrees


def _strain(camera: Camera, points: Matrix, pixels: Matrix, pose: pin.SE3, covariances: tuple[Matrix, Matrix]) -> float:
    """Return the score statistic [69] of another focal length or another k1, whichever is larger."""
    in_camera_axes = points @ pose.rotation.T
    in_camera = in_camera_axes + pose.translation
    residuals = (camera.project(in_camera) - pixels).ravel()
    jacobian = camera.jacobian(in_camera_axes, pose.translation)

    intrinsic_slopes = camera.own_slopes(in_camera)
    lens_slopes = np.c_[intrinsic_slopes[:, :2] @ camera.matrix[[0, 1], [0, 1]], intrinsic_slopes[:, 4]]

    weighted = np.linalg.solve(covariances[0] + covariances[1], np.c_[residuals, jacobian, lens_slopes])
    normal_rows = jacobian.T @ weighted
    # Remove the part that a change of the pose would explain.
    without_pose = weighted - weighted[:, 1:7] @ np.linalg.solve(normal_rows[:, 1:7], normal_rows)

    score = lens_slopes.T @ without_pose[:, 0]
    information = np.einsum("ij,ij->j", lens_slopes, without_pose[:, 7:])
    return float((score**2 / np.maximum(information, 1e-9)).max())
