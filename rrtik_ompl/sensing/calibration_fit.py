"""Fit the intrinsics of a camera and the poses of a board to its corners in photographs: bundle adjustment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import cv2
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.markers.corner_pose import pose_of_points

View = tuple[Matrix, Matrix]  # corners of a board: on it [m], shape (k, 3), and their pixels, shape (k, 2)

FOCAL = 2  # the first of the fitted numbers are fx and fy
_MOST_STEPS = 100
_CONVERGED = 1e-8  # relative gain of the last step
_LARGEST_DAMPING = 1e6
# Standard deviation of a coefficient of a lens before anything is known of it. It decides only what photographs leave
# open: numerator and denominator of a rational lens that hardly bends rays are the same but for a factor.
_PRIOR = 10.0
_FISHEYE_STARTS = (0.7, 1.0, 1.5)  # focal lengths that are tried, as multiples of that of 180 degrees across


class Fit(NamedTuple):
    """A camera fitted to corners of a board.

    Attributes:
        camera: The camera; nothing in it is uncertain.
        poses: Of the board in the camera frame, one for each view.
        error: Root mean square distance of the corners from their pixels [pixels].
        view_errors: The same for each view, shape (m,).
        information: Inverse covariance of the intrinsics in units of the variance of a pixel coordinate.
        free: Which intrinsics were fitted, shape (4 + k,); the others are as given.
    """

    camera: Camera
    poses: tuple[pin.SE3, ...]
    error: float
    view_errors: Vector
    information: Matrix
    free: NDArray[np.bool_]

    def with_doubts(self, count: int) -> Camera:
        """Return the camera with the standard deviations and correlations that its residuals say.

        Args:
            count: Number of corners.
        """
        degrees = max(2 * count - int(self.free.sum()) - 6 * len(self.poses), 1)
        covariance = self.error**2 * count / degrees * np.linalg.inv(self.information)
        sigmas = np.zeros(len(self.free))
        sigmas[self.free] = np.sqrt(np.diag(covariance))
        correlation = np.eye(len(self.free))
        correlation[np.ix_(self.free, self.free)] = covariance / np.outer(sigmas[self.free], sigmas[self.free])
        return replace(self.camera, sigmas=sigmas, correlation=0.5 * (correlation + correlation.T))


def fit_camera(views: Sequence[View], shape: tuple[int, ...], lens: str) -> Fit | None:
    """Fit a camera with a lens model to views of a board, in pictures of a shape; None if no fit is found.

    The third radial coefficient of Brown's lens stays 0, because the second one is not stable together with it.
    """
    if lens == "fisheye":
        height, width = shape
        starts = [factor * max(height, width) / np.pi for factor in _FISHEYE_STARTS]
        fits = [_fisheye_from(views, focal, width, height) for focal in starts]
        found = [fit for fit in fits if fit is not None]
        return min(found, key=lambda fit: fit.error, default=None)

    start = _by_opencv(views, shape)
    if start is None or lens == "brown":
        return start
    brown = start.camera
    camera = Camera(brown.matrix, brown.width, brown.height, np.pad(brown.distortion, (0, 3)), lens=lens)
    return refined(views, camera, start.poses, np.ones(12, dtype=bool))


def with_focal_scaled(views: Sequence[View], fit: Fit, factor: float) -> Fit | None:
    """Fit all other numbers when the focal lengths are multiplied by a factor and stay so."""
    scaled = fit.camera.matrix * [[factor, 1.0, 1.0], [1.0, factor, 1.0], [1.0, 1.0, 1.0]]
    poses = [pin.SE3(T.rotation, T.translation * [1.0, 1.0, factor]) for T in fit.poses]
    free = fit.free.copy()
    free[:FOCAL] = False
    return refined(views, replace(fit.camera, matrix=scaled), poses, free)


def refined(views: Sequence[View], camera: Camera, poses: Sequence[pin.SE3], free: NDArray[np.bool_]) -> Fit | None:
    """Minimise the distances of the corners from their pixels by Levenberg-Marquardt; None if the start is none.

    Args:
        views: Corners of the board.
        camera: Start.
        poses: Start; of the board in the camera frame.
        free: Which of fx, fy, cx, cy and the coefficients of the lens are fitted, shape (4 + k,).
    """
    damping = 1e-4
    poses = list(poses)
    prior = np.zeros(len(free))
    prior[4:] = 1.0 / _PRIOR**2
    cost = _cost(views, camera, poses, prior)

    for _ in range(_MOST_STEPS):
        normals = [_normal_equations(view, camera, pose, free) for view, pose in zip(views, poses, strict=True)]
        information, gradient = _without_poses(normals, _numbers(camera)[free], prior[free], damping)
        try:
            step = _solved(information, gradient)
        except np.linalg.LinAlgError:
            return None

        moved = _moved(camera, step, free)
        turned = [
            stepped(pose, _solved(_damped(of_pose, damping), right - mixed.T @ step))
            for pose, (_, mixed, of_pose, _, right) in zip(poses, normals, strict=True)
        ]
        new_cost = np.inf if moved is None else _cost(views, moved, turned, prior)
        if moved is not None and new_cost < cost:
            gain = (cost - new_cost) / cost
            camera = moved
            poses = turned
            cost = new_cost
            damping *= 0.1
            if gain < _CONVERGED:
                break
        else:
            damping *= 10.0
            if damping > _LARGEST_DAMPING:
                break

    normals = [_normal_equations(view, camera, pose, free) for view, pose in zip(views, poses, strict=True)]
    information, _ = _without_poses(normals, _numbers(camera)[free], prior[free], 0.0)
    return _fit(views, camera, poses, information, free)


def _fisheye_from(views: Sequence[View], focal: float, width: int, height: int) -> Fit | None:
    """Fit a fisheye from a focal length; None if it does not explain the views at all."""
    matrix = [[focal, 0.0, 0.5 * (width - 1)], [0.0, focal, 0.5 * (height - 1)], [0.0, 0.0, 1.0]]
    camera = Camera(matrix, width, height, lens="fisheye")
    try:
        poses = [pose_of_points(camera, pixels, points).T_camera_object for points, pixels in views]
    except (IndexError, np.linalg.LinAlgError, cv2.error):  # no pose explains the pixels with this focal length
        return None
    return refined(views, camera, poses, np.ones(8, dtype=bool))


def _by_opencv(views: Sequence[View], shape: tuple[int, ...]) -> Fit | None:
    """Fit a camera with Brown's lens; None if that fails."""
    solve: Any = cv2.calibrateCameraExtended  # the stub of OpenCV does not allow None for the initial guesses
    points = [np.ascontiguousarray(p, dtype=np.float32) for p, _ in views]
    pixels = [np.ascontiguousarray(q, dtype=np.float32) for _, q in views]
    try:
        _, matrix, distortion, turns, shifts, *_ = solve(
            points, pixels, shape[::-1], None, None, flags=cv2.CALIB_FIX_K3
        )
    except cv2.error:
        return None

    height, width = shape
    free = np.arange(9) < 8  # all but k3
    camera = Camera(matrix, width, height, np.ravel(distortion)[:5])
    poses = [pin.SE3(cv2.Rodrigues(r)[0], np.ravel(t)) for r, t in zip(turns, shifts, strict=True)]
    return refined(views, camera, poses, free)


def _fit(
    views: Sequence[View], camera: Camera, poses: Sequence[pin.SE3], information: Matrix, free: NDArray[np.bool_]
) -> Fit:
    squares = [np.square(_off(view, camera, pose)).sum() for view, pose in zip(views, poses, strict=True)]
    counts = [len(points) for points, _ in views]
    view_errors = np.sqrt(np.divide(squares, counts))
    return Fit(camera, tuple(poses), float(np.sqrt(np.sum(squares) / np.sum(counts))), view_errors, information, free)


def _off(view: View, camera: Camera, pose: pin.SE3) -> Vector:
    """Return how far corners are from where they should be, shape (2 k,) [pixels]."""
    points, pixels = view
    return np.asarray((pixels - camera.project(points @ pose.rotation.T + pose.translation)).ravel(), dtype=np.float64)


def _numbers(camera: Camera) -> Vector:
    return np.concatenate([camera.matrix[[0, 1, 0, 1], [0, 1, 2, 2]], camera.distortion])


def _cost(views: Sequence[View], camera: Camera, poses: Sequence[pin.SE3], prior: Vector) -> float:
    squares = [np.square(_off(view, camera, pose)).sum() for view, pose in zip(views, poses, strict=True)]
    return float(np.sum(squares) + prior @ _numbers(camera) ** 2)


def _normal_equations(
    view: View, camera: Camera, pose: pin.SE3, free: NDArray[np.bool_]
) -> tuple[Matrix, Matrix, Matrix, Vector, Vector]:
    """Return the normal matrices of intrinsics, of both, and of the pose, and the right sides of both."""
    turned = view[0] @ pose.rotation.T
    of_camera = camera.own_slopes(turned + pose.translation)[:, free]
    of_pose = camera.jacobian(turned, pose.translation)
    off = _off(view, camera, pose)
    return of_camera.T @ of_camera, of_camera.T @ of_pose, of_pose.T @ of_pose, of_camera.T @ off, of_pose.T @ off


def _without_poses(
    normals: Sequence[tuple[Matrix, Matrix, Matrix, Vector, Vector]], numbers: Vector, prior: Vector, damping: float
) -> tuple[Matrix, Vector]:
    """Return the normal matrix and the right side of the intrinsics when the poses follow (the Schur complement)."""
    information = _damped(np.sum([each[0] for each in normals], axis=0) + np.diag(prior), damping)
    gradient = np.sum([each[3] for each in normals], axis=0) - prior * numbers
    for _, mixed, of_pose, _, right in normals:
        follow = np.linalg.solve(_damped(of_pose, damping), np.column_stack([mixed.T, right]))
        information = information - mixed @ follow[:, :-1]
        gradient = gradient - mixed @ follow[:, -1]
    return information, gradient


def _solved(normal: Matrix, right: Vector) -> Vector:
    return np.asarray(np.linalg.solve(normal, right), dtype=np.float64)


def _damped(normal: Matrix, damping: float) -> Matrix:
    return normal + damping * np.diag(np.diag(normal))


def _moved(camera: Camera, step: Vector, free: NDArray[np.bool_]) -> Camera | None:
    """Return the camera with its free numbers moved; None if it is no camera."""
    numbers = _numbers(camera)
    numbers[free] += step
    fx, fy, cx, cy = numbers[:4]
    if not np.isfinite(numbers).all() or min(fx, fy) <= 0.0:
        return None
    matrix = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    return Camera(matrix, camera.width, camera.height, numbers[4:], lens=camera.lens)


def stepped(pose: pin.SE3, step: Vector) -> pin.SE3:
    """Return a pose moved by a position [m] and a rotation about the axes of the frame in which it is given [rad]."""
    return pin.SE3(pin.exp3(step[3:]) @ pose.rotation, pose.translation + step[:3])
