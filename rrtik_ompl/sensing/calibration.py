"""Calibrate the intrinsics and the tone of a camera from photographs of a board, with standard deviations."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector, frozen
from rrtik_ompl.base.errors import InputError, UnknownNameError, listed, require
from rrtik_ompl.files.kinds import KINDS, found
from rrtik_ompl.sensing.calibration_fit import Fit, View, fit_camera, with_focal_scaled
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.cameras.lenses import LENSES
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
# Share of the picture in which corners should be seen; the picture has so many parts along each side.
GOOD_COVERAGE = 0.7
_PARTS = 4
# Other focal lengths, as multiples: if one explains the photographs nearly as well, they say nothing of it. The
# standard deviations of a fit do not show this, as fits to frontal views end anywhere.
_OTHERS = (0.6, 0.95, 1.05, 1.7)
# Twice the logarithm of the likelihood ratio at which another one is three standard deviations off.
_WORSE = 9.0
# Share of the squared error that another lens model leaves: below it the lens is of that kind.
_BETTER = 0.85
_MODELS = {"brown": "a usual one (Brown's)", "rational": "a rational one", "fisheye": "a fisheye"}
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
        covered: Share of the picture, in sixteen parts, in which corners were seen.
    """

    camera: Camera
    sigmas: Vector
    error: float
    view_errors: Vector
    unused: tuple[str, ...]
    covered: float = 1.0

    @property
    def advice(self) -> str:
        """What would make the calibration better; "" if it is good."""
        share = self.sigmas[0] / self.camera.matrix[0, 0]
        if share > GOOD_DOUBT:
            return f"the focal length is uncertain by {100.0 * share:.1f} %, and so are distances: {TILT}"
        if self.covered < GOOD_COVERAGE:
            seen = round(self.covered * _PARTS**2)
            return (
                f"corners were seen in {seen} of {_PARTS**2} parts of the picture, and the lens is known there: {TILT}"
            )
        return ""

    def save(self, file: str | os.PathLike[str]) -> None:
        """Write the camera with the errors of its calibration, as a file that :meth:`Camera.load` reads.

        Raises:
            InputError: If the file cannot be written.
        """
        found(KINDS["Camera"].writer)(self, file)


def board_corners(gray: NDArray[np.uint8], board: Board) -> View:
    """Return the corners of a board in a grey picture: positions on the board [m], (k, 3), and pixels, (k, 2)."""
    return board.corners(gray) if isinstance(board, Chessboard) else charuco_corners(gray, board)


def calibrate(
    pictures: Sequence[NDArray[np.uint8]], board: Board, names: Sequence[str] | None = None, *, lens: str = "brown"
) -> Calibration:
    """Calibrate a camera from photographs of one board, taken from different angles.

    The tone of the camera is the median over the tones with which the board's markers, or the pieces of a chessboard,
    correlate best with the photographs.

    Args:
        pictures: The photographs.
        board: Made by `detection.charuco_board` or `Chessboard`.
        names: Names of the photographs for error messages; None to count them.
        lens: The lens model: "brown", "rational" or "fisheye" (`Camera`).

    Raises:
        InputError: If the photographs differ in size, fewer than five show the board well enough, they do not determine
            the focal length, or another lens model explains them much better.
    """
    require(board, cv2.aruco.CharucoBoard | Chessboard, "board", "use charuco_board(...) or Chessboard(...)")
    if not isinstance(lens, str) or lens not in LENSES:
        raise UnknownNameError("lens model", lens, LENSES)
    return calibrate_by_corners(*seen_boards(listed(pictures, "photographs"), board, names), board, lens)


def seen_boards(
    pictures: Sequence[NDArray[np.uint8]], board: Board, names: Sequence[str] | None = None
) -> tuple[list[NDArray[np.uint8]], list[View]]:
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
    grays: Sequence[NDArray[np.uint8]], found: Sequence[View], board: Board, lens: str = "brown"
) -> Calibration:
    """Calibrate as :func:`calibrate` does, from the results of :func:`seen_boards`."""
    unused = ["" if len(points) >= MIN_CORNERS else _too_few(len(points)) for points, _ in found]
    used = [k for k, reason in enumerate(unused) if not reason]

    # Views are removed one at a time, the worst first, because a bad view also increases the errors of the others. A
    # wrong lens model makes many views bad.
    fit = None
    checked = False
    while len(used) >= MIN_VIEWS:
        fit = fit_camera([found[k] for k in used], grays[0].shape, lens)
        if fit is None:
            raise InputError(f"{_MODELS[lens]} lens does not explain the photographs at all; try another --model")
        worst = int(fit.view_errors.argmax())
        if fit.view_errors[worst] <= MAX_VIEW_ERROR:
            break
        if not checked:
            _check_lens([found[k] for k in used], grays[0].shape, fit)
            checked = True
        unused[used.pop(worst)] = f"corners lie {fit.view_errors[worst]:.1f} pixels off: blurred, or the board is bent"
        fit = None

    if fit is None:
        reasons = "; ".join(sorted({reason for reason in unused if reason})) or "there are no more"
        raise InputError(
            f"{len(used)} of {len(grays)} photographs show the board well, at least {MIN_VIEWS} must ({reasons}); "
            "take more, the board filling a third of the picture or more, sharp, under different angles; a chessboard "
            "is another kind of board, and has to be in view as a whole"
        )

    views = [found[k] for k in used]
    _check_focal(views, fit)
    _check_lens(views, grays[0].shape, fit)
    view_errors = np.full(len(grays), np.nan)
    view_errors[used] = fit.view_errors

    tone = _tone([(grays[k], found[k][1]) for k in used[:TONE_VIEWS]], board)
    camera = replace(fit.with_doubts(sum(len(points) for points, _ in views)), tone=tone)
    covered = _covered(np.vstack([pixels for _, pixels in views]), grays[0].shape)
    return Calibration(camera, frozen(camera.sigmas[:4]), fit.error, frozen(view_errors), tuple(unused), covered)


def _covered(pixels: Matrix, shape: tuple[int, ...]) -> float:
    """Return the share of the parts of a picture, `_PARTS` along each side, that hold corners."""
    row_of = np.clip((pixels[:, 1] * _PARTS / shape[0]).astype(int), 0, _PARTS - 1)
    column_of = np.clip((pixels[:, 0] * _PARTS / shape[1]).astype(int), 0, _PARTS - 1)
    return len(set(zip(row_of.tolist(), column_of.tolist(), strict=True))) / _PARTS**2


def _check_focal(views: Sequence[View], fit: Fit) -> None:
    """Refuse photographs that do not determine the focal length.

    Raises:
        InputError: If another focal length explains them as well.
    """
    count = sum(len(points) for points, _ in views)
    focal = fit.camera.matrix[0, 0]
    for factor in _OTHERS:
        other = with_focal_scaled(views, fit, factor)
        if other is not None and 4.0 * count * np.log(max(other.error, 1e-12) / max(fit.error, 1e-12)) < _WORSE:
            raise InputError(
                f"the photographs do not say the focal length: {focal:.0f} and {factor * focal:.0f} pixels "
                f"explain them alike, because the board is seen too much alike in them: {TILT}"
            )


def _check_lens(views: Sequence[View], shape: tuple[int, ...], fit: Fit) -> None:
    """Refuse a wrong lens model.

    Raises:
        InputError: If another lens model explains the photographs much better.
    """
    if sum(len(points) for points, _ in views) < _MIN_POINTS:
        return
    fits = {lens: fit_camera(views, shape, lens) for lens in LENSES if lens != fit.camera.lens}
    errors = {lens: other.error for lens, other in fits.items() if other is not None}
    least = min(errors.values(), default=np.inf)
    if least**2 < _BETTER * fit.error**2:
        # A rational lens can be like a fisheye: of models that are nearly alike, the one with the fewest numbers.
        alike = [lens for lens in errors if _BETTER * errors[lens] ** 2 < least**2]
        best = min(alike, key=lambda lens: len(LENSES[lens].names))
        raise InputError(
            f"the lens is {_MODELS[best]}: its model leaves {errors[best]:.3f} pixels, that of "
            f"{_MODELS[fit.camera.lens]} leaves {fit.error:.3f}, and poses far from the middle would be wrong; "
            f"calibrate with --model {best}"
        )


def _size(shape: tuple[int, ...]) -> str:
    return f"{shape[1]} x {shape[0]}"


def _too_few(count: int) -> str:
    return (
        f"{count} corners of the board seen, {MIN_CORNERS} are needed: too small, blurred, another board or dictionary"
    )


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
        looks = _looks_of_markers([gray for gray, _ in views], board)

    tones = [each.tone for each in looks if each is not None]
    return round(float(np.median(tones)), 3) if len(tones) >= TONE_LOOKS else None


def _looks_of_markers(grays: Sequence[NDArray[np.uint8]], board: cv2.aruco.CharucoBoard) -> list[Look | None]:
    dictionary = dictionary_of(board)
    if dictionary is None:
        return []
    numbers = [int(number) for number in np.ravel(board.getIds())]
    seen = [marker for gray in grays for marker in find_markers(gray, dictionary, wanted=numbers)]
    return [each.look for each in seen if each.side >= MIN_TONE_SIDE]
