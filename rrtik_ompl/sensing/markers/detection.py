"""Detect square markers [50] in pictures, each with the covariance of its corners."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import LARGEST, Matrix, finite_number, frozen, whole_number
from rrtik_ompl.base.errors import InputError, require
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.markers.alignment import Look, aligned_corners, mean_side
from rrtik_ompl.sensing.markers.chessboard import SMALLEST_SIDE
from rrtik_ompl.sensing.markers.dictionaries import DICTIONARIES, marker_cells, spare_bits, table_of
from rrtik_ompl.sensing.markers.search import Codes, quick, search


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
        common: The part of ``spread`` by causes that all markers of a picture share, such as its sharpening:
            displacements of the corners by one standard deviation of each, shape (8, k) [pixels]; None for none.
    """

    dictionary: str
    number: int
    corners: Matrix
    likeness: float
    spread: Matrix | None = None
    look: Look | None = None
    common: Matrix | None = None

    @property
    def side(self) -> float:
        """Mean length of its edges, in pixels."""
        return mean_side(self.corners)


def find_markers(
    gray: NDArray[np.uint8],
    dictionary: str,
    *,
    align: bool = True,
    tone: float | None = None,
    wanted: Collection[int] | None = None,
    before: Sequence[SeenMarker] = (),
    near: bool = False,
    turn: int = 0,
    camera: Camera | None = None,
    thorough: bool = False,
) -> tuple[SeenMarker, ...]:
    """Detect the markers of a dictionary in a grey picture, sorted by their numbers.

    Args:
        gray: Shape (height, width).
        dictionary: One of `DICTIONARIES`.
        align: Refine the corners (`aligned_corners`); otherwise they are those of the detector.
        tone: Tone of the picture (`markers.lighting`); None to use, for each marker, the one with which it fits best.
        wanted: Numbers of the markers that are searched for; None for all of the dictionary. As long as one of them is
            missing, the picture is searched more closely (`markers.search`).
        before: Markers of earlier pictures of a film, where they were seen last, which makes their alignment faster.
        near: The picture is the next of a film: search only near those places, unless a marker is no longer there, and
            closely only in the part of the picture whose turn it is.
        turn: Number of the picture in the film.
        camera: Camera of the picture, whose lens bends the sides of markers; None if it does not matter.
        thorough: Search all of a large picture closely, as a single photograph deserves, however long it takes: some
            seconds for 12 million pixels.
    """
    last_looks = {marker.number: marker.look for marker in before}
    places = {marker.number: marker.corners for marker in before}
    markers: list[SeenMarker] = []

    for number, rough in search(
        gray, dictionary, wanted=wanted, places=places, near=near, turn=turn, thorough=thorough
    ):
        if not align:
            markers.append(SeenMarker(dictionary, number, frozen(rough), np.nan))
            continue

        cells = marker_cells(dictionary, number)
        fit = aligned_corners(gray, rough, cells, tone, last_looks.get(number), spare_bits(dictionary), camera)
        markers.append(
            SeenMarker(dictionary, number, frozen(fit.corners), fit.likeness, fit.spread, fit.look, fit.common)
        )

    return tuple(markers)


def dictionaries_seen(gray: NDArray[np.uint8]) -> tuple[str, ...]:
    """Return the dictionaries that have markers in a picture, for the error message if the expected one has none."""
    return tuple(name for name in DICTIONARIES if quick(gray, Codes(name)))


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
    if columns * rows // 2 > len(table_of(dictionary).bytesList):
        raise InputError(f"dictionary {dictionary} has too few markers for a board of {columns} x {rows} squares")
    return cv2.aruco.CharucoBoard((columns, rows), square, marker, table_of(dictionary))


def dictionary_of(board: cv2.aruco.CharucoBoard) -> str | None:
    """Return the name of the dictionary of a board's markers; None if it is none of `DICTIONARIES`."""
    cells = board.getDictionary().bytesList
    return next((name for name in DICTIONARIES if np.array_equal(table_of(name).bytesList, cells)), None)


def charuco_corners(gray: NDArray[np.uint8], board: cv2.aruco.CharucoBoard) -> tuple[Matrix, Matrix]:
    """Return the corners of a board in a picture: points on the board [m], shape (k, 3), and pixels, shape (k, 2)."""
    pixels, numbers, _, _ = cv2.aruco.CharucoDetector(board).detectBoard(gray)
    if numbers is None or len(numbers) == 0:
        return np.zeros((0, 3)), np.zeros((0, 2))

    match: Any = board.matchImagePoints  # the stub of OpenCV requires a sequence, but arrays work
    points, matched_pixels = match(np.asarray(pixels).reshape(-1, 1, 2), np.ravel(numbers))
    return np.reshape(points, (-1, 3)).astype(np.float64), np.reshape(matched_pixels, (-1, 2)).astype(np.float64)
