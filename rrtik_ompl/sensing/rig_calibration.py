"""Calibrate the relative poses of cameras from pictures of one board that they took at the same times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import cv2
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.errors import InputError, listed, require
from rrtik_ompl.sensing.calibration import MIN_CORNERS, Board, Calibration, calibrate_by_corners, seen_boards
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.markers.chessboard import Chessboard
from rrtik_ompl.sensing.rig import Rig

MIN_MOMENTS = 4  # least number of moments in which both cameras see the board
# [pixels]; a larger error of the corners means that times differ, or that the cameras moved.
MAX_ERROR = 1.0


class Common(NamedTuple):
    """Corners seen by two cameras at one time.

    Attributes:
        points: On the board [m], shape (k, 3).
        first: Their pixels in the first camera, shape (k, 2).
        other: Their pixels in the other camera, shape (k, 2).
    """

    points: NDArray[np.float32]
    first: NDArray[np.float32]
    other: NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class RigCalibration:
    """A calibrated rig, and the quality of the calibration.

    Attributes:
        rig: The rig, with the standard deviations of its poses.
        cameras: Calibration of each camera.
        moments: For each camera but the first, the number of moments in which it saw the board together with the first.
        errors: For each camera but the first, the root mean square reprojection error [pixels].
    """

    rig: Rig
    cameras: tuple[Calibration, ...]
    moments: tuple[int, ...]
    errors: tuple[float, ...]


def calibrate_rig(
    pictures: Sequence[Sequence[NDArray[np.uint8]]], board: Board, *, lens: str = "brown"
) -> RigCalibration:
    """Calibrate cameras and their relative poses from pictures of a board.

    Each camera is calibrated from all of its own pictures. Its pose then minimises the reprojection error of the
    corners that it and the first camera saw at the same times. The uncertainty of the pose follows from leaving out
    each moment once (the jackknife, [68]).

    Args:
        pictures: For each camera the same number of pictures, in the order of time.
        board: The board; a chessboard must have an even number of squares along one side and an odd one along the
            other.
        lens: The lens model of all cameras: "brown" or "rational" (`Camera`).

    Raises:
        InputError: If there are fewer than two cameras, the numbers of pictures differ, too few of them show the board,
            the cameras moved relative to each other, or they are fisheyes.
    """
    if lens == "fisheye":
        raise InputError(
            "cameras with fisheyes are not calibrated as a rig: calibrate each by itself, and write the rig's file"
        )
    require(board, cv2.aruco.CharucoBoard | Chessboard, "board", "use charuco_board(...) or Chessboard(...)")
    pictures = [listed(each, "pictures of a camera") for each in listed(pictures, "pictures of a rig")]

    if len(pictures) < 2 or len({len(camera_pictures) for camera_pictures in pictures}) > 1:
        counts = ", ".join(str(len(camera_pictures)) for camera_pictures in pictures)
        raise InputError(
            f"a rig needs as many pictures of each of two cameras or more, in the same order; got {counts}"
        )
    if isinstance(board, Chessboard) and (board.columns + board.rows) % 2 == 0:
        raise InputError(
            f"a chessboard of {board.columns} x {board.rows} squares looks the same upside down, so that two cameras "
            "may take each other's corners: use one with an even and an odd side, or a ChArUco board"
        )

    cameras = []
    corners = []
    for number, camera_pictures in enumerate(pictures, start=1):
        try:
            grays, found = seen_boards(camera_pictures, board)
            cameras.append(calibrate_by_corners(grays, found, board, lens))
            corners.append(found)
        except InputError as reason:
            raise InputError(f"camera {number}: {reason}") from None

    relative = [_relative_to_first(cameras, corners, number) for number in range(1, len(pictures))]
    poses, moments, errors, sigmas = zip(*relative, strict=True)

    position, rotation = np.max(sigmas, axis=0)
    lenses = tuple(calibration.camera for calibration in cameras)
    rig = Rig(lenses, (pin.SE3.Identity(), *poses), float(position), float(rotation))
    return RigCalibration(rig, tuple(cameras), moments, errors)


def _relative_to_first(
    cameras: Sequence[Calibration], corners: Sequence[Sequence[tuple[Matrix, Matrix]]], number: int
) -> tuple[pin.SE3, int, float, Vector]:
    """Calibrate the pose of a camera relative to the first one.

    Returns:
        The pose, the number of moments in which both saw the board, and error and standard deviations as of
        `_relative_pose`.
    """
    common = [moment for pair in zip(corners[0], corners[number], strict=True) if (moment := _common_corners(*pair))]
    if len(common) < MIN_MOMENTS:
        raise InputError(
            f"cameras 1 and {number + 1} see the board together in {len(common)} moments, at least {MIN_MOMENTS} "
            "are needed: hold it where both see it"
        )

    pose, error, sigma = _relative_pose(cameras[0].camera, cameras[number].camera, common)
    if error > MAX_ERROR:
        raise InputError(
            f"camera {number + 1}: corners lie {error:.1f} pixels off where the first has them: pictures "
            "are of other times, or the cameras moved against each other"
        )
    return pose, len(common), error, sigma


def _common_corners(first: tuple[Matrix, Matrix], other: tuple[Matrix, Matrix]) -> Common | None:
    """Return the corners that both cameras saw; None if there are too few."""
    index_of_point = {tuple(np.round(point, 6)): k for k, point in enumerate(other[0])}
    index_pairs = []
    for k, point in enumerate(first[0]):
        key = tuple(np.round(point, 6))
        if key in index_of_point:
            index_pairs.append((k, index_of_point[key]))
    if len(index_pairs) < MIN_CORNERS:
        return None

    first_rows, other_rows = np.array(index_pairs).T
    return Common(
        *(rows.astype(np.float32) for rows in (first[0][first_rows], first[1][first_rows], other[1][other_rows]))
    )


def _relative_pose(first: Camera, other: Camera, common: Sequence[Common]) -> tuple[pin.SE3, float, Vector]:
    """Calibrate the relative pose of two cameras.

    Returns:
        ``T_first_other``, the root mean square error [pixels], and the standard deviations of position [m] and rotation
        [rad], shape (2,).
    """
    pose, error = _stereo_calibrated(first, other, common)
    shifts = []
    for left_out in range(len(common)):
        without_one, _ = _stereo_calibrated(first, other, [moment for k, moment in enumerate(common) if k != left_out])
        shifts.append(
            [*(without_one.translation - pose.translation), *pin.log3(without_one.rotation @ pose.rotation.T)]
        )

    variances = (len(common) - 1) / len(common) * np.square(shifts).sum(axis=0)
    return pose, error, np.sqrt([variances[:3].max(), variances[3:].max()])


def _stereo_calibrated(first: Camera, other: Camera, common: Sequence[Common]) -> tuple[pin.SE3, float]:
    solve: Any = cv2.stereoCalibrate  # the stub of OpenCV requires arguments that may be None
    error, *_, rotation, translation, _, _ = solve(
        [moment.points for moment in common],
        [moment.first for moment in common],
        [moment.other for moment in common],
        first.matrix.copy(), first.distortion.copy(), other.matrix.copy(), other.distortion.copy(),
        (first.width, first.height),
        flags=cv2.CALIB_FIX_INTRINSIC, criteria=(cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 100, 1e-9),
    )  # fmt: skip
    return pin.SE3(np.asarray(rotation), np.ravel(translation)).inverse(), float(error)
