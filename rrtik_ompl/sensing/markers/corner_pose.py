"""The pose of an object from pixels of points that are known on it, and how far it can be trusted.

A single square seen almost from the front has two poses that explain its picture nearly as well (Collins and Bartoli,
2014 [51]): both are kept. Where perspective is strong, or by chance, only one of the two is a minimum of the
error: then the second one is that of the closed form, for a long valley may lead from there to the minimum, with the
true pose somewhere in it. Covariance: first-order propagation of the error of a corner.

A homography keeps straight lines straight, a lens does not: corners that were aligned by one are mended by `lens_bend`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Matrix, frozen
from rrtik_ompl.sensing.cameras.camera import Camera

MIN_ERROR_RATIO = 6.0  # of the two errors of a square; below it are 27 % of near-frontal views and all wrong choices
CHANCE_ERROR = 0.015  # [pixels]: four corners that agree better do so by chance
ALIGNED_SIGMA = 0.02  # error of a corner [pixels]: a quarter is noise of 1 %, the rest lens and blur
ROUGH_SIGMA = 0.2  # blur pulls corners that were not aligned inwards by as much
MAX_SURPRISE = 6.0  # squared deviations that chance makes of a square; what exceeds them enlarges the covariance
MAX_DISTANCE = 1e4  # [m]
MIN_BRANCH_ANGLE = 1e-3  # [rad]: minima that are nearer to each other are one; distinct ones are 0.03 apart and more
_MAX_STEPS = 40
_PLACES = 9  # in a row, on the marker and its rim, at which the lens is looked at
_OF_HOMOGRAPHIES = 8  # of the motions that are fitted; the others are the bends that alignment fits, too
_RIM = 1.1  # of the marker's side, with its rim


@dataclass(frozen=True, slots=True, eq=False)
class CornerPose:
    """A pose that explains the pixels of some points.

    Attributes:
        T_camera_object: The pose that explains them best.
        other: The second pose of a single square, None if there is none.
        error: Root mean square distance of a point from its pixel, in pixels.
        other_error: That of the second pose; infinite if there is none.
        covariance: Of (position [m], small rotation about the axes of the camera [rad]). Shape (6, 6).
        surprise: Squared deviations of the points from their pixels, by what is known of both, for each number that
            they have more than a pose: 1 is usual; far more is a contradiction.
        strain: Of these squared deviations, how many another focal length alone would explain, or another bend of the
            lens, whichever is more: as large as the square of a normal number by chance. 0 for a single square.
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
        """The second pose explains the picture almost as well, so that the first may be the wrong one."""
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
    """Angle between the rotations of two poses [rad]."""
    return float(np.linalg.norm(pin.log3(first.rotation.T @ second.rotation)))


def square_corners(side: float) -> Matrix:
    """Corners of a marker in its own frame: x right, y up, z out of it; in the order they are found. Shape (4, 3)."""
    half = 0.5 * side
    return np.array([[-half, half, 0.0], [half, half, 0.0], [half, -half, 0.0], [-half, -half, 0.0]])


def pose_of_square(
    camera: Camera,
    pixels: Matrix,
    side: float,
    sigma: float = ALIGNED_SIGMA,
    spread: Matrix | None = None,
    side_sigma: float = 0.0,
) -> CornerPose:
    """Pose of one marker from its four corners.

    Args:
        camera: Of the picture.
        pixels: Of the corners, shape (4, 2).
        side: Of the marker [m].
        sigma: Error of a corner [pixels].
        spread: Covariance of the corners in place of it, shape (8, 8) [pixels^2].
        side_sigma: Standard deviation of the side [m].
    """
    points = square_corners(side)
    shifts = [points * side_sigma / side] if side_sigma else []

    # Exactly in front of the camera the closed form fails: not a number, or a marker that faces away.
    guesses = _guesses(camera, points, pixels, cv2.SOLVEPNP_IPPE_SQUARE) or _guesses(camera, points, pixels)

    refined = [_levenberg(camera, points, pixels, guess) for guess in guesses]
    errors = [_error(camera, points, pixels, pose) for pose in refined]
    best_index = int(np.argmin(errors))
    best_pose = refined[best_index]
    error = errors[best_index]

    other = None
    other_error = np.inf
    if len(guesses) > 1:
        is_one_minimum = turn_between(best_pose, refined[1 - best_index]) < MIN_BRANCH_ANGLE
        other = (
            max(guesses, key=lambda guess: turn_between(best_pose, guess))
            if is_one_minimum
            else refined[1 - best_index]
        )
        other_error = _error(camera, points, pixels, other)

    covariances = _pixel_covariance(len(points), sigma, spread), _point_covariance(camera, points, best_pose, shifts)
    return CornerPose(
        best_pose, other, error, other_error, *_covariance(camera, points, pixels, best_pose, covariances)
    )


def pose_of_points(
    camera: Camera,
    pixels: Matrix,
    points: Matrix,
    sigma: float = ALIGNED_SIGMA,
    spread: Matrix | None = None,
    shifts: Sequence[Matrix] = (),
) -> CornerPose:
    """Pose of an object from points on it that are known in its frame. Shapes (m, 2) and (m, 3), m at least 4.

    ``sigma`` or ``spread``, shape (2 m, 2 m), as in `pose_of_square`; ``shifts``: by how much the points may be
    elsewhere on the object, one standard deviation of each independent reason, shape (m, 3) [m].
    """
    best = _levenberg(camera, points, pixels, _guesses(camera, points, pixels)[0])
    error = _error(camera, points, pixels, best)
    covariances = _pixel_covariance(len(points), sigma, spread), _point_covariance(camera, points, best, shifts)
    covariance, surprise = _covariance(camera, points, pixels, best, covariances)
    return CornerPose(
        best, None, error, np.inf, covariance, surprise, _strain(camera, points, pixels, best, covariances)
    )


def lens_bend(camera: Camera, corners: Matrix, side: float) -> Matrix:
    """How far the corners of an aligned marker lie off, because the lens is not a homography [pixels]. Shape (4, 2).

    Alignment fits bends along with the homography (`corner_spread`), so that of the lens the homography's part is left.

    Args:
        camera: Of the picture.
        corners: Of the marker, shape (4, 2) [pixels].
        side: Of the marker [m].
    """
    if not camera.distortion.any():
        return np.zeros((4, 2))

    at = pose_of_square(camera, corners, side).T_camera_object
    row = 0.5 * _RIM * side * np.linspace(-1.0, 1.0, _PLACES)
    x, y = (each.ravel() for each in np.meshgrid(row, row))
    flat = np.c_[x, y]

    square = square_corners(side)
    pixels = camera.project(np.c_[flat, np.zeros(len(flat))] @ at.rotation.T + at.translation)

    homography, _ = cv2.findHomography(flat, pixels, 0)
    back = cv2.perspectiveTransform(np.ascontiguousarray(pixels)[:, None], np.linalg.inv(homography))[:, 0]

    # What the lens adds to a homography, as small motions on the marker.
    scale = 0.5 * side
    shift, *_ = np.linalg.lstsq(np.vstack(_motions(flat / scale)), (back - flat).T.ravel(), rcond=None)

    # Alignment takes the bends among them for bends, and only the others move its corners.
    on_marker = square[:, :2] / scale
    moved = square[:, :2] + np.stack([part[:, :_OF_HOMOGRAPHIES] @ shift[:_OF_HOMOGRAPHIES]
                                      for part in _motions(on_marker)], axis=1)  # fmt: skip

    straight = cv2.perspectiveTransform(moved[:, None].copy(), homography)[:, 0]
    return np.asarray(straight - camera.project(square @ at.rotation.T + at.translation), dtype=np.float64)


def _motions(places: Matrix) -> tuple[Matrix, Matrix]:
    """Small motions of a plane, x and y by themselves: those of homographies, then four bends. Shapes (m, 12)."""
    u, v = places.T
    none = np.zeros(len(u))
    one = np.ones(len(u))

    along = [one, u, v, none, none, none, u * u, u * v, v * v, none, u * u, u * v]
    across = [none, none, none, one, u, v, u * v, v * v, none, u * u, -u * v, -v * v]

    return np.stack(along, axis=1), np.stack(across, axis=1)


def _guesses(camera: Camera, points: Matrix, pixels: Matrix, method: int = cv2.SOLVEPNP_SQPNP) -> list[pin.SE3]:
    """Poses in closed form that explain the pixels, best first."""
    object_points = np.ascontiguousarray(points)
    image_points = np.ascontiguousarray(pixels)
    _, turns, shifts, _ = cv2.solvePnPGeneric(
        object_points, image_points, camera.matrix, camera.distortion, flags=method
    )
    poses = [pin.SE3(cv2.Rodrigues(r)[0], t.ravel()) for r, t in zip(turns, shifts, strict=True)]
    return [T for T in poses if _plausible(T, method == cv2.SOLVEPNP_IPPE_SQUARE)]


def _plausible(pose: pin.SE3, facing: bool) -> bool:
    """Finite, before the camera, and with its z axis towards it if it has to face it."""
    if not (np.isfinite(pose.homogeneous).all() and 0.0 < pose.translation[2] < MAX_DISTANCE):
        return False
    return not facing or float(pose.rotation[:, 2] @ pose.translation) < 0.0


def _levenberg(camera: Camera, points: Matrix, pixels: Matrix, pose: pin.SE3) -> pin.SE3:
    """The nearby pose of least error: Levenberg's steps about the axes of the camera, kept where they help."""
    damping = 1e-6
    error = _error(camera, points, pixels, pose)

    for _ in range(_MAX_STEPS):
        in_camera_axes = points @ pose.rotation.T
        jacobian = camera.jacobian(in_camera_axes, pose.translation)
        residuals = (pixels - camera.project(in_camera_axes + pose.translation)).ravel()
        normal = jacobian.T @ jacobian
        step = np.linalg.solve(normal + damping * np.diag(normal.diagonal()), jacobian.T @ residuals)
        candidate = pin.SE3(pin.exp3(step[3:]) @ pose.rotation, pose.translation + step[:3])

        candidate_error = _error(camera, points, pixels, candidate)
        gain = error - candidate_error
        if gain > 0.0:
            pose = candidate
            error = candidate_error
            damping = 0.1 * damping
        else:
            damping *= 100.0

        if abs(gain) <= 1e-9 * error or damping > 1e3:
            break

    return pose


def _error(camera: Camera, points: Matrix, pixels: Matrix, pose: pin.SE3) -> float:
    residuals = camera.project(points @ pose.rotation.T + pose.translation) - pixels
    return float(np.sqrt((residuals**2).sum(axis=1).mean()))


def _pixel_covariance(count: int, sigma: float, spread: Matrix | None) -> Matrix:
    """Covariance of the pixels as they were found. Shape (2 m, 2 m)."""
    return sigma**2 * np.eye(2 * count) if spread is None else spread


def _point_covariance(camera: Camera, points: Matrix, pose: pin.SE3, shifts: Sequence[Matrix]) -> Matrix:
    """Covariance of the pixels of what is not known of lens and object. Shape (2 m, 2 m)."""
    in_camera_axes = points @ pose.rotation.T
    covariance = camera.doubt(in_camera_axes + pose.translation)
    jacobian = camera.jacobian(in_camera_axes, pose.translation)[:, :3].reshape(-1, 2, 3)

    for shift in shifts:
        pixel_shift = np.einsum("kij,kj->ki", jacobian, shift @ pose.rotation.T).ravel()
        covariance = covariance + np.outer(pixel_shift, pixel_shift)

    return covariance


def _covariance(
    camera: Camera, points: Matrix, pixels: Matrix, pose: pin.SE3, covariances: tuple[Matrix, Matrix]
) -> tuple[Matrix, float]:
    """Of (position, rotation), larger where the points deviate from their pixels by more than they should; how much."""
    in_camera_axes = points @ pose.rotation.T
    of_pixels, of_points = covariances
    jacobian = camera.jacobian(in_camera_axes, pose.translation)
    pseudo_inverse = np.linalg.pinv(jacobian)
    residuals = (camera.project(in_camera_axes + pose.translation) - pixels).ravel()

    weighted = np.linalg.solve(of_pixels + of_points, np.c_[residuals, jacobian])
    normal_rows = (
        jacobian.T @ weighted
    )  # of a pose near this one that explains the pixels best by what is known of them
    squares = float(
        residuals @ weighted[:, 0] - normal_rows[:, 0] @ np.linalg.solve(normal_rows[:, 1:], normal_rows[:, 0])
    )

    covariance = (
        max(squares / MAX_SURPRISE, 1.0) * (pseudo_inverse @ of_pixels @ pseudo_inverse.T)
        + pseudo_inverse @ of_points @ pseudo_inverse.T
    )
    return frozen(covariance), max(squares, 0.0) / (2 * len(points) - 6)


def _strain(camera: Camera, points: Matrix, pixels: Matrix, pose: pin.SE3, covariances: tuple[Matrix, Matrix]) -> float:
    """Squared deviations that another focal length or another k1 would explain: their score tests [69]."""
    in_camera_axes = points @ pose.rotation.T
    in_camera = in_camera_axes + pose.translation
    residuals = (camera.project(in_camera) - pixels).ravel()
    jacobian = camera.jacobian(in_camera_axes, pose.translation)

    intrinsic_slopes = camera.own_slopes(in_camera)
    lens_slopes = np.c_[intrinsic_slopes[:, :2] @ camera.matrix[[0, 1], [0, 1]], intrinsic_slopes[:, 4]]

    weighted = np.linalg.solve(covariances[0] + covariances[1], np.c_[residuals, jacobian, lens_slopes])
    normal_rows = jacobian.T @ weighted
    without_pose = weighted - weighted[:, 1:7] @ np.linalg.solve(
        normal_rows[:, 1:7], normal_rows
    )  # of what another pose explains

    score = lens_slopes.T @ without_pose[:, 0]
    information = np.einsum("ij,ij->j", lens_slopes, without_pose[:, 7:])
    return float((score**2 / np.maximum(information, 1e-9)).max())
