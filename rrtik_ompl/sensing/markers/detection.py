"""Square markers [50]: dictionaries, pictures and detection. OpenCV's ``aruco`` is called in this module only.

OpenCV stores AprilTag families turned by half a turn; here top is where the AprilTag library's own prints have it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import LARGEST, Matrix, finite_number, frozen, whole_number
from rrtik_ompl.base.errors import InputError, UnknownNameError, require
from rrtik_ompl.sensing.markers.alignment import Look, aligned_corners, mean_side
from rrtik_ompl.sensing.markers.chessboard import SMALLEST_SIDE

DICTIONARIES = {
    **{f"{bits}x{bits}_{size}": f"DICT_{bits}X{bits}_{size}" for bits in (4, 5, 6, 7) for size in (50, 100, 250, 1000)},
    **{f"apriltag_{family}": f"DICT_APRILTAG_{family}" for family in ("16h5", "25h9", "36h10", "36h11")},
    "aruco_original": "DICT_ARUCO_ORIGINAL",
    "aruco_mip_36h12": "DICT_ARUCO_MIP_36h12",
}
_ENLARGED = 2.0  # scale of the picture in further attempts
# [enlarged pixels]; standard deviation of the blur against noise in the first and second further attempt.
_CALM = 1.0, 1.4
# Sharpening of the second further attempt: factor of the detail that is added, and its size [enlarged pixels].
_SHARPENED, _EDGE = 8.0, 3.0
# [pixels]; largest threshold window of the thorough detector, which also corrects as many bits as the code allows.
# OpenCV's default is 23.
_WIDEST = 53
# Bits that a dictionary must be able to correct for this; others would find markers in any clutter.
_FAR_APART = 3
_AROUND = 81  # [enlarged pixels]; side of the window in which brightness and contrast are equalised
_FAINT = 1.5  # grey values; smaller contrast is noise
_CONTRAST = 60.0  # grey values to which the standard deviation in a window is scaled
# How far a marker may have moved since the previous picture, in sides and in pixels.
_NEAR_SIDES, _NEAR_PIXELS = 1.0, 16
_NEAR_OUTLINE_SHARE = 0.5  # share of the longer side of that window; smaller outlines are noise
# Least perimeter of a marker as a share of the picture's longer side; OpenCV's 0.03 would miss distant markers.
MIN_OUTLINE_SHARE = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class SeenMarker:
    """A detected marker.

    Attributes:
        dictionary: Its dictionary.
        number: Its number in the dictionary.
        corners: Top left, top right, bottom right, bottom left as printed, shape (4, 2) [pixels].
        likeness: Correlation of the ideal marker with the picture, at most 1. Below `MIN_LIKENESS` the corners are not
            aligned; NaN if alignment was not requested.
        spread: Covariance of the corners, shape (8, 8) [pixels^2]; None if they are not aligned.
        look: Blur and tone of the picture at this marker; None if they are not known.
    """

    dictionary: str
    number: int
    corners: Matrix
    likeness: float
    spread: Matrix | None = None
    look: Look | None = None

    @property
    def side(self) -> float:
        """Mean length of its edges, in pixels."""
        return mean_side(self.corners)


def marker_cells(dictionary: str, number: int) -> NDArray[np.uint8]:
    """Return the ideal marker, upright, with its black border: one number a cell, 0 black, 255 white, shape (n, n).

    Raises:
        InputError: If there is no such marker.
    """
    require(dictionary, str, "dictionary of markers")
    number = whole_number(number, "number of a marker")

    table = _table(dictionary)
    count = len(table.bytesList)
    if not 0 <= number < count:
        raise InputError(f"dictionary {dictionary} has markers 0 to {count - 1}, not {number}")

    cells = cv2.aruco.generateImageMarker(table, number, table.markerSize + 2)
    return np.ascontiguousarray(np.rot90(cells, 2 if _is_turned(dictionary) else 0), dtype=np.uint8)


def find_markers(
    gray: NDArray[np.uint8],
    dictionary: str,
    *,
    align: bool = True,
    tone: float | None = None,
    before: Sequence[SeenMarker] = (),
    near: bool = False,
) -> tuple[SeenMarker, ...]:
    """Detect all markers of a dictionary in a grey picture, sorted by their numbers.

    Args:
        gray: Shape (height, width).
        dictionary: One of `DICTIONARIES`.
        align: Refine the corners (`aligned_corners`); otherwise they are those of the detector.
        tone: Tone of the picture (`markers.lighting`); None to use, for each marker, the one with which it fits best.
        before: Markers of the previous picture of a film, which makes their alignment faster.
        near: Search only near those markers, unless one of them has disappeared. If nothing is found, the costly search
            for strongly blurred markers is skipped.
    """
    last_looks = {marker.number: marker.look for marker in before}
    corners, numbers = _detected(gray, dictionary, before, near)
    if numbers is None:
        return ()

    markers: list[SeenMarker] = []
    for k in np.argsort(np.ravel(numbers), kind="stable"):
        number = int(np.ravel(numbers)[k])
        rough = corners[k].reshape(4, 2).astype(np.float64)
        rough = np.roll(rough, 2 if _is_turned(dictionary) else 0, axis=0)

        if not align:
            markers.append(SeenMarker(dictionary, number, frozen(rough), np.nan))
            continue

        fit = aligned_corners(gray, rough, marker_cells(dictionary, number), tone, last_looks.get(number))
        markers.append(SeenMarker(dictionary, number, frozen(fit.corners), fit.likeness, fit.spread, fit.look))

    return tuple(markers)


def _detected(gray: NDArray[np.uint8], dictionary: str, before: Sequence[SeenMarker], near: bool) -> tuple[Any, Any]:
    """Run increasingly expensive detections until one finds a marker.

    Returns:
        Corners and numbers in OpenCV's format; the numbers are None if nothing was found.
    """
    corners, numbers = _near_last_places(gray, before) if near and before else ([], None)
    if numbers is None:
        corners, numbers, _ = _detector(dictionary).detectMarkers(gray)
    if numbers is None:
        corners, numbers, _ = _detector(dictionary, thorough=True).detectMarkers(gray)
    if numbers is None:
        corners, numbers = _further_tries(gray, dictionary, 1 if near else 2)
    return corners, numbers


def _near_last_places(gray: NDArray[np.uint8], before: Sequence[SeenMarker]) -> tuple[Any, Any]:
    """Search for the markers of the previous picture near their places.

    Returns:
        Corners and numbers in OpenCV's format; the numbers are None if any of the markers is missing.
    """
    corners = []
    numbers = []

    for marker in before:
        margin = int(_NEAR_SIDES * marker.side) + _NEAR_PIXELS
        origin = np.maximum(np.floor(marker.corners.min(axis=0)).astype(int) - margin, 0)
        high = np.ceil(marker.corners.max(axis=0)).astype(int) + margin
        window = np.ascontiguousarray(gray[origin[1] : high[1], origin[0] : high[0]])

        window_corners, window_numbers, _ = _detector(marker.dictionary, _NEAR_OUTLINE_SHARE).detectMarkers(window)
        matches = [] if window_numbers is None else np.flatnonzero(np.ravel(window_numbers) == marker.number)
        if len(matches) != 1:
            return [], None

        corners.append(window_corners[matches[0]] + origin)
        numbers.append(marker.number)

    return corners, np.array(numbers)


def _further_tries(gray: NDArray[np.uint8], dictionary: str, tries: int) -> tuple[Any, Any]:
    """Search for faint, blurred or small markers in an enlarged picture with equalised contrast.

    The second attempt also sharpens the picture: blurred markers appear, while faint ones drown in noise.

    Returns:
        Corners and numbers in OpenCV's format; the numbers are None if nothing was found.
    """
    large = cv2.resize(gray, None, fx=_ENLARGED, fy=_ENLARGED, interpolation=cv2.INTER_CUBIC).astype(np.float32)
    corners: Any = []
    numbers: Any = None
    for number in range(tries):
        calm: Any = cv2.GaussianBlur(large, (0, 0), _CALM[number])
        if number > 0:
            calm = calm + _SHARPENED * (calm - cv2.GaussianBlur(calm, (0, 0), _EDGE))
        corners, numbers, _ = _detector(dictionary).detectMarkers(_evened(calm))
        if numbers is not None:
            break

    return [(each + 0.5) / _ENLARGED - 0.5 for each in corners], numbers


def _evened(picture: NDArray[np.floating[Any]]) -> NDArray[np.uint8]:
    """Equalise brightness and contrast locally."""
    local_mean = cv2.boxFilter(picture, -1, (_AROUND, _AROUND))
    local_deviation = np.sqrt(
        np.maximum(cv2.boxFilter(picture * picture, -1, (_AROUND, _AROUND)) - local_mean * local_mean, _FAINT**2)
    )
    return np.clip(128.0 + _CONTRAST * (picture - local_mean) / local_deviation, 0.0, 255.0).astype(np.uint8)


def dictionaries_seen(gray: NDArray[np.uint8]) -> tuple[str, ...]:
    """Return the dictionaries that have markers in a picture, for the error message if the expected one has none."""
    return tuple(name for name in DICTIONARIES if _detector(name).detectMarkers(gray)[1] is not None)


def charuco_board(columns: int, rows: int, square: float, marker: float, dictionary: str) -> cv2.aruco.CharucoBoard:
    """Return a chessboard with markers in its white squares; sides of squares and markers in metres.

    Raises:
        InputError: If a number is none, a side is not positive, a marker does not fit its square, or the dictionary is
            unknown or too small.
    """
    columns = whole_number(columns, "columns of a board")
    rows = whole_number(rows, "rows of a board")
    square = finite_number(square, "side of a square")
    marker = finite_number(marker, "side of a marker")
    require(dictionary, str, "dictionary of markers")

    if columns < 3 or rows < 3 or not SMALLEST_SIDE <= marker < square <= LARGEST:
        raise InputError("a board needs at least 3 x 3 squares, and markers of 1 um and more, smaller than the squares")
    if columns * rows // 2 > len(_table(dictionary).bytesList):
        raise InputError(f"dictionary {dictionary} has too few markers for a board of {columns} x {rows} squares")
    return cv2.aruco.CharucoBoard((columns, rows), square, marker, _table(dictionary))


def dictionary_of(board: cv2.aruco.CharucoBoard) -> str | None:
    """Return the name of the dictionary of a board's markers; None if it is none of `DICTIONARIES`."""
    cells = board.getDictionary().bytesList
    return next((name for name in DICTIONARIES if np.array_equal(_table(name).bytesList, cells)), None)


def charuco_corners(gray: NDArray[np.uint8], board: cv2.aruco.CharucoBoard) -> tuple[Matrix, Matrix]:
    """Return the corners of a board in a picture: points on the board [m], shape (k, 3), and pixels, shape (k, 2)."""
    pixels, numbers, _, _ = cv2.aruco.CharucoDetector(board).detectBoard(gray)
    if numbers is None or len(numbers) == 0:
        return np.zeros((0, 3)), np.zeros((0, 2))

    match: Any = board.matchImagePoints  # the stub of OpenCV requires a sequence, but arrays work
    points, matched_pixels = match(np.asarray(pixels).reshape(-1, 1, 2), np.ravel(numbers))
    return np.reshape(points, (-1, 3)).astype(np.float64), np.reshape(matched_pixels, (-1, 2)).astype(np.float64)


def _is_turned(dictionary: str) -> bool:
    return dictionary.startswith("apriltag_")


@lru_cache
def _table(dictionary: str) -> cv2.aruco.Dictionary:
    if dictionary not in DICTIONARIES:
        raise UnknownNameError("dictionary of markers", dictionary, DICTIONARIES)
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, DICTIONARIES[dictionary]))


@lru_cache
def _detector(
    dictionary: str, outline_share: float = MIN_OUTLINE_SHARE, thorough: bool = False
) -> cv2.aruco.ArucoDetector:
    """Return OpenCV's detector for a dictionary.

    outline_share is the least perimeter of a marker as a share of the picture's longer side; a thorough detector
    tries larger threshold windows and corrects more bits.
    """
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    parameters.minMarkerPerimeterRate = outline_share

    if thorough:
        parameters.adaptiveThreshWinSizeMax = _WIDEST
        far_apart = _table(dictionary).maxCorrectionBits >= _FAR_APART
        parameters.errorCorrectionRate = 1.0 if far_apart else parameters.errorCorrectionRate

    # Otherwise markers that fill half of the picture are lost, although they are fully in view.
    parameters.minDistanceToBorder = 0
    return cv2.aruco.ArucoDetector(_table(dictionary), parameters)
