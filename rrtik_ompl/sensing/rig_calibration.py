"""How cameras stand to each other, from pictures of one board that they took at the same times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import cv2
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.sensing.calibration import MIN_CORNERS, Board, Calibration, calibrate_by_corners, seen_boards
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.markers.chessboard import Chessboard
from rrtik_ompl.sensing.rig import Rig

MIN_MOMENTS = 4  # in which both cameras see the board
MAX_ERROR = 1.0  # [pixels] of the corners of all moments; a larger one means other times, or cameras that moved


class Common(NamedTuple):
    """Corners that two cameras saw at one time: on the board [m], shape (k, 3), and their pixels, (k, 2) each."""

    points: NDArray[np.float32]
    first: NDArray[np.float32]
    other: NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class RigCalibration:
    """A calibrated rig and how good it is.

    Attributes:
        rig: The rig, with what is not certain of its poses.
        cameras: How each of its cameras was calibrated.
        moments: In how many moments each but the first saw the board together with the first.
        errors: Of each but the first: root mean square distance of corners from their pixels [pixels].
    """

    rig: Rig
    cameras: tuple[Calibration, ...]
    moments: tuple[int, ...]
    errors: tuple[float, ...]


def calibrate_rig(pictures: Sequence[Sequence[NDArray[np.uint8]]], board: Board) -> RigCalibration:
    """Calibrate cameras and how they stand to each other, from pictures of a board.

    Each camera is calibrated by all of its own pictures. Then its pose is that with which the corners that it and the
    first camera saw at the same times lie best; how sure that is, is what moments contradict each other by: each is
    left out once (the jackknife, [68]).

    Args:
        pictures: Of each camera, as many, in the order of the moments at which they were taken.
        board: The board; a chessboard has an even number of squares along one side and an odd one along the other.

    Raises:
        InputError: If there are fewer than two cameras, other numbers of pictures, too few of them show the board, or
            the cameras did not stand still to each other.
    """
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
            cameras.append(calibrate_by_corners(grays, found, board))
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
    """How a camera stands to the first one: its pose, in how many moments both saw the board, error and deviations.

    The last two are those of `_relative_pose`.
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
    """The corners that both saw; None if these are too few."""
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
    """``T_first_other``, the error [pixels], and standard deviations of its position [m] and rotation [rad]."""
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
    solve: Any = cv2.stereoCalibrate  # its type requires more where None is allowed
    error, *_, rotation, translation, _, _ = solve(
        [moment.points for moment in common],
        [moment.first for moment in common],
        [moment.other for moment in common],
        first.matrix.copy(), first.distortion.copy(), other.matrix.copy(), other.distortion.copy(),
        (first.width, first.height),
        flags=cv2.CALIB_FIX_INTRINSIC, criteria=(cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 100, 1e-9),
    )  # fmt: skip
    return pin.SE3(np.asarray(rotation), np.ravel(translation)).inverse(), float(error)
