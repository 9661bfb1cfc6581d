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
from rrtik_ompl.sensing.calibration import MIN_CORNERS, Board, Calibration, board_corners, calibrate
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.markers.chessboard import Chessboard
from rrtik_ompl.sensing.rig import Rig
from rrtik_ompl.sensing.sight import as_gray

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
    if len(pictures) < 2 or len({len(each) for each in pictures}) > 1:
        counts = ", ".join(str(len(each)) for each in pictures)
        raise InputError(
            f"a rig needs as many pictures of each of two cameras or more, in the same order; got {counts}"
        )
    if isinstance(board, Chessboard) and (board.columns + board.rows) % 2 == 0:
        raise InputError(
            f"a chessboard of {board.columns} x {board.rows} squares looks the same upside down, so that two cameras "
            "may take each other's corners: use one with an even and an odd side, or a ChArUco board"
        )

    cameras = []
    for number, taken in enumerate(pictures, start=1):
        try:
            cameras.append(calibrate(taken, board))
        except InputError as reason:
            raise InputError(f"camera {number}: {reason}") from None

    corners = [[board_corners(as_gray(picture), board) for picture in taken] for taken in pictures]
    beside = [_beside_first(cameras, corners, number) for number in range(1, len(pictures))]
    poses, moments, errors, sigmas = zip(*beside, strict=True)

    position, rotation = np.max(sigmas, axis=0)
    lenses = tuple(each.camera for each in cameras)
    rig = Rig(lenses, (pin.SE3.Identity(), *poses), float(position), float(rotation))
    return RigCalibration(rig, tuple(cameras), moments, errors)


def _beside_first(
    cameras: Sequence[Calibration], corners: Sequence[Sequence[tuple[Matrix, Matrix]]], number: int
) -> tuple[pin.SE3, int, float, Vector]:
    """How a camera stands to the first one: its pose, in how many moments both saw the board, and as of `_stands`."""
    common = [each for pair in zip(corners[0], corners[number], strict=True) if (each := _common(*pair))]
    if len(common) < MIN_MOMENTS:
        raise InputError(
            f"cameras 1 and {number + 1} see the board together in {len(common)} moments, at least {MIN_MOMENTS} "
            "are needed: hold it where both see it"
        )

    pose, error, sigma = _stands(cameras[0].camera, cameras[number].camera, common)
    if error > MAX_ERROR:
        raise InputError(
            f"camera {number + 1}: corners lie {error:.1f} pixels off where the first has them: pictures "
            "are of other times, or the cameras moved against each other"
        )
    return pose, len(common), error, sigma


def _common(first: tuple[Matrix, Matrix], other: tuple[Matrix, Matrix]) -> Common | None:
    """The corners that both saw; None if these are too few."""
    places = {tuple(np.round(point, 6)): k for k, point in enumerate(other[0])}
    both = [(k, places[key]) for k, point in enumerate(first[0]) if (key := tuple(np.round(point, 6))) in places]
    if len(both) < MIN_CORNERS:
        return None

    one, two = np.array(both).T
    return Common(*(each.astype(np.float32) for each in (first[0][one], first[1][one], other[1][two])))


def _stands(first: Camera, other: Camera, common: Sequence[Common]) -> tuple[pin.SE3, float, Vector]:
    """``T_first_other``, the error [pixels], and standard deviations of its position [m] and rotation [rad]."""
    pose, error = _solved(first, other, common)
    away = []
    for left_out in range(len(common)):
        less, _ = _solved(first, other, [each for k, each in enumerate(common) if k != left_out])
        away.append([*(less.translation - pose.translation), *pin.log3(less.rotation @ pose.rotation.T)])

    spread = (len(common) - 1) / len(common) * np.square(away).sum(axis=0)
    return pose, error, np.sqrt([spread[:3].max(), spread[3:].max()])


def _solved(first: Camera, other: Camera, common: Sequence[Common]) -> tuple[pin.SE3, float]:
    solve: Any = cv2.stereoCalibrate  # its type requires more where None is allowed
    error, *_, turn, shift, _, _ = solve(
        [each.points for each in common], [each.first for each in common], [each.other for each in common],
        first.matrix.copy(), first.distortion.copy(), other.matrix.copy(), other.distortion.copy(),
        (first.width, first.height),
        flags=cv2.CALIB_FIX_INTRINSIC, criteria=(cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 100, 1e-9),
    )  # fmt: skip
    return pin.SE3(np.asarray(turn), np.ravel(shift)).inverse(), float(error)
