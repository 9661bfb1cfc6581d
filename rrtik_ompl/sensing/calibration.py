"""Calibrate the intrinsics and the tone of a camera from photographs of a board, with standard deviations."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector, frozen
from rrtik_ompl.base.errors import InputError, listed, require
from rrtik_ompl.files.kinds import KINDS, found
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.markers.alignment import Look, look_of
from rrtik_ompl.sensing.markers.chessboard import Chessboard
from rrtik_ompl.sensing.markers.detection import charuco_corners, dictionary_of, find_markers
from rrtik_ompl.sensing.sight import as_gray

Board = cv2.aruco.CharucoBoard | Chessboard

MIN_CORNERS, MIN_VIEWS = 8, 5
# Number of photographs used to estimate the tone, and the least number of markers or pieces in them.
TONE_VIEWS, TONE_LOOKS = 3, 12
MIN_TONE_SIDE = 20.0  # [pixels]; least side of a marker or a piece of a chessboard for this estimate
GOOD_DOUBT = 0.005  # standard deviation of a focal length as a share of it; distances are uncertain by as much
# Other focal lengths, as multiples: if one explains the photographs nearly as well, they say nothing of it. The
# standard deviations of a fit do not show this, as fits to frontal views end anywhere.
_OTHERS = (0.6, 0.95, 1.05, 1.7)
# Twice the logarithm of the likelihood ratio at which another one is three standard deviations off.
_WORSE = 9.0
# Share of the squared error that a fisheye's model leaves: below it the lens is one.
_FISHEYE = 0.85
_MIN_POINTS = 100  # corners in all photographs, for the comparison of models
TILT = "tilt the board by 30 to 50 degrees to all sides, near and far, in the middle and in the corners of the picture"
MAX_VIEW_ERROR = 1.0  # [pixels]; a view with a larger error is blurred, bent or mismatched


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """A calibrated camera, and the quality of the calibration.

    Attributes:
        camera: The camera.
        sigmas: Standard deviations of fx, fy, cx, cy [pixels], shape (4,); they are also part of the camera.
        error: Root mean square reprojection error over all views [pixels].
        view_errors: The same for each photograph, shape (m,); NaN where it was not used.
        unused: For each photograph, why it was not used; "" if it was.
    """

    camera: Camera
    sigmas: Vector
    error: float
    view_errors: Vector
    unused: tuple[str, ...]

    @property
    def advice(self) -> str:
        """What would make the calibration better; "" if it is good."""
        share = self.sigmas[0] / self.camera.matrix[0, 0]
        if share <= GOOD_DOUBT:
            return ""
        return f"the focal length is uncertain by {100.0 * share:.1f} %, and so are distances: {TILT}"

    def save(self, file: str | os.PathLike[str]) -> None:
        """Write the camera with the errors of its calibration, as a file that :meth:`Camera.load` reads.

        Raises:
            InputError: If the file cannot be written.
        """
        found(KINDS["Camera"].writer)(self, file)


def board_corners(gray: NDArray[np.uint8], board: Board) -> tuple[Matrix, Matrix]:
    """Return the corners of a board in a grey picture: positions on the board [m], (k, 3), and pixels, (k, 2)."""
    return board.corners(gray) if isinstance(board, Chessboard) else charuco_corners(gray, board)


def calibrate(pictures: Sequence[NDArray[np.uint8]], board: Board, names: Sequence[str] | None = None) -> Calibration:
    """Calibrate a camera from photographs of one board, taken from different angles; ``names`` are for error messages.

    The board is made by `detection.charuco_board` or `Chessboard`. The third radial coefficient stays 0, because the
    second one is not stable together with it. The tone of the camera is the median over the tones with which the
    board's markers, or the pieces of a chessboard, correlate best with the photographs.

    Raises:
        InputError: If the photographs differ in size, fewer than five show the board well enough, they do not determine
            the focal length, or the lens is a fisheye.
    """
    require(board, cv2.aruco.CharucoBoard | Chessboard, "board", "use charuco_board(...) or Chessboard(...)")
    return calibrate_by_corners(*seen_boards(listed(pictures, "photographs"), board, names), board)


def seen_boards(
    pictures: Sequence[NDArray[np.uint8]], board: Board, names: Sequence[str] | None = None
) -> tuple[list[NDArray[np.uint8]], list[tuple[Matrix, Matrix]]]:
    """Convert photographs to grey values, and find the corners of the board in each.

    Args:
        pictures: The photographs.
        board: The board.
        names: Names of the photographs for error messages; None to count them.

    Returns:
        The grey pictures, and for each the result of `board_corners`.

    Raises:
        InputError: If the photographs differ in size.
    """
    grays = [as_gray(picture) for picture in pictures]
    shapes = Counter(gray.shape for gray in grays)
    if len(shapes) > 1:
        usual = shapes.most_common(1)[0][0]
        odd = next(k for k, gray in enumerate(grays) if gray.shape != usual)
        which = f"photograph {odd + 1}" if names is None else names[odd]
        raise InputError(
            f"{which}: {_size(grays[odd].shape)} pixels, but others have {_size(usual)}: the photographs differ in "
            "size; take all of them with the same camera and settings, and leave out others"
        )
    return grays, [board_corners(gray, board) for gray in grays]


def calibrate_by_corners(
    grays: Sequence[NDArray[np.uint8]], found: Sequence[tuple[Matrix, Matrix]], board: Board
) -> Calibration:
    """Calibrate as :func:`calibrate` does, from the results of :func:`seen_boards`."""
    unused = ["" if len(points) >= MIN_CORNERS else _too_few(len(points)) for points, _ in found]
    used = [k for k, reason in enumerate(unused) if not reason]

    # Views are removed one at a time, the worst first, because a bad view also increases the errors of the others.
    result = None
    while len(used) >= MIN_VIEWS:
        result = _solve([found[k] for k in used], grays[0].shape)
        errors = np.ravel(result[-1])
        worst = int(errors.argmax())
        if errors[worst] <= MAX_VIEW_ERROR:
            break
        unused[used.pop(worst)] = f"corners lie {errors[worst]:.1f} pixels off: blurred, or the board is bent"
        result = None

    if result is None:
        reasons = "; ".join(sorted({reason for reason in unused if reason})) or "there are no more"
        raise InputError(
            f"{len(used)} of {len(grays)} photographs show the board well, at least {MIN_VIEWS} must ({reasons}); "
            "take more, the board filling a third of the picture or more, sharp, under different angles; a chessboard "
            "is another kind of board, and has to be in view as a whole"
        )

    error, matrix, distortion, _, _, sigmas, _, each = result
    _check([found[k] for k in used], grays[0].shape, result)
    view_errors = np.full(len(grays), np.nan)
    view_errors[used] = np.ravel(each)
    height, width = grays[0].shape
    doubts = np.ravel(sigmas)[:9]

    tone = _tone([(grays[k], found[k][1]) for k in used[:TONE_VIEWS]], board)
    camera = Camera(matrix, width, height, np.ravel(distortion)[:5], sigmas=doubts, tone=tone)
    return Calibration(camera, frozen(doubts[:4]), float(error), frozen(view_errors), tuple(unused))


def _solve(
    views: Sequence[tuple[Matrix, Matrix]], shape: tuple[int, ...], fixed: tuple[Matrix, Matrix] | None = None
) -> tuple[Any, ...]:
    """Run OpenCV's calibration; ``fixed`` is a camera matrix, of which the focal lengths are kept, and a lens."""
    points = [np.ascontiguousarray(p, dtype=np.float32) for p, _ in views]
    pixels = [np.ascontiguousarray(q, dtype=np.float32) for _, q in views]
    solve: Any = cv2.calibrateCameraExtended  # the stub of OpenCV does not allow None for the initial guesses
    flags = cv2.CALIB_FIX_K3
    matrix, lens = (None, None) if fixed is None else (each.copy() for each in fixed)
    if fixed is not None:
        flags |= cv2.CALIB_USE_INTRINSIC_GUESS | cv2.CALIB_FIX_FOCAL_LENGTH
    solved: tuple[Any, ...] = solve(points, pixels, shape[::-1], matrix, lens, flags=flags)
    return solved


def _check(views: Sequence[tuple[Matrix, Matrix]], shape: tuple[int, ...], result: tuple[Any, ...]) -> None:
    """Refuse a calibration that says nothing, or whose lens model is wrong.

    Raises:
        InputError: If another focal length, or the model of a fisheye, explains the photographs as well or better.
    """
    error, matrix, lens = result[:3]
    count = sum(len(points) for points, _ in views)
    for factor in _OTHERS:
        scaled = matrix * [[factor, 1.0, 1.0], [1.0, factor, 1.0], [1.0, 1.0, 1.0]]
        other = float(_solve(views, shape, (scaled, lens))[0])
        if 4.0 * count * np.log(max(other, 1e-12) / max(float(error), 1e-12)) < _WORSE:
            raise InputError(
                f"the photographs do not say the focal length: {matrix[0, 0]:.0f} and {scaled[0, 0]:.0f} pixels "
                f"explain them alike, because the board is seen too much alike in them: {TILT}"
            )

    if count < _MIN_POINTS:
        return
    fisheye_error = _fisheye_error(views, shape)
    if fisheye_error**2 < _FISHEYE * float(error) ** 2:
        raise InputError(
            f"the lens is a fisheye: its model leaves {fisheye_error:.3f} pixels, that of k1, k2, p1, p2 leaves "
            f"{float(error):.3f}, and poses far from the middle would be wrong by centimetres; take a lens of less "
            "than 100 degrees, or photographs that are rectified"
        )


def _fisheye_error(views: Sequence[tuple[Matrix, Matrix]], shape: tuple[int, ...]) -> float:
    """Return the root mean square error that the model of Kannala and Brandt leaves [pixels]; infinite if it fails."""
    points = [np.ascontiguousarray(p, dtype=np.float64)[None] for p, _ in views]
    pixels = [np.ascontiguousarray(q, dtype=np.float64)[None] for _, q in views]
    solve: Any = cv2.fisheye.calibrate  # the stub of OpenCV does not allow None for the initial guesses
    home: Any = cv2 if hasattr(cv2, "CALIB_FIX_SKEW") else cv2.fisheye  # OpenCV 5, and before
    flags = home.CALIB_RECOMPUTE_EXTRINSIC | home.CALIB_FIX_SKEW
    try:
        return float(solve(points, pixels, shape[::-1], None, None, flags=flags)[0])
    except cv2.error:  # the views do not determine it
        return np.inf


def _size(shape: tuple[int, ...]) -> str:
    return f"{shape[1]} x {shape[0]}"


def _too_few(count: int) -> str:
    return f"{count} corners of the board seen, {MIN_CORNERS} are needed: too small, blurred, or another board"


def _tone(views: Sequence[tuple[NDArray[np.uint8], Matrix]], board: Board) -> float | None:
    """Return the median tone of a board's markers or pieces; None if too few of them are large and clear.

    Args:
        views: Photographs, and the pixels of the board's corners in them, shape (k, 2).
        board: The board.
    """
    if isinstance(board, Chessboard):
        pieces = [(gray, *piece) for gray, pixels in views for piece in board.pieces(gray, pixels)]
        looks = [look_of(*each) for each in pieces if np.ptp(each[1], axis=0).max() >= MIN_TONE_SIDE]
    else:
        looks = _looks_of_markers([gray for gray, _ in views], dictionary_of(board))

    tones = [each.tone for each in looks if each is not None]
    return round(float(np.median(tones)), 3) if len(tones) >= TONE_LOOKS else None


def _looks_of_markers(grays: Sequence[NDArray[np.uint8]], dictionary: str | None) -> list[Look | None]:
    if dictionary is None:
        return []
    seen = [marker for gray in grays for marker in find_markers(gray, dictionary, wanted=())]
    return [each.look for each in seen if each.side >= MIN_TONE_SIDE]
