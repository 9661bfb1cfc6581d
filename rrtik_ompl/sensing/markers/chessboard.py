"""Plain chessboards for calibration: their inner corners in a picture, and pieces with little lens distortion."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import LARGEST, Matrix, finite_number, frozen, whole_number
from rrtik_ompl.base.errors import InputError

SMALLEST_SIDE = 1e-6  # [m]; smallest side of a square or a marker
PIECE = 2  # squares along a side


@dataclass(frozen=True, slots=True)
class Chessboard:
    """A chessboard without markers: numbers of squares across and down, and the side of a square [m].

    The whole board must be in view. If one of the two numbers is odd and the other even, the orientation of the board
    is unique: the square after the first corner is a black one. The calibration of a single camera does not need this.

    Raises:
        InputError: If the numbers are not whole, or less than 4, or the side is not positive.

    Example:
        >>> Chessboard(10, 7, 0.025).points.shape
        (54, 3)
    """

    columns: int
    rows: int
    square: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "columns", whole_number(self.columns, "columns of a chessboard"))
        object.__setattr__(self, "rows", whole_number(self.rows, "rows of a chessboard"))
        object.__setattr__(self, "square", finite_number(self.square, "side of a square"))

        if self.columns < 4 or self.rows < 4 or not SMALLEST_SIDE <= self.square <= LARGEST:
            raise InputError(
                f"a chessboard has at least 4 x 4 squares of a positive side, got {self.columns} x {self.rows} "
                f"of {self.square:g} m; squares are counted, not the corners between them"
            )

    @property
    def points(self) -> Matrix:
        """Corners between squares on the board [m], row by row, shape ((columns - 1) (rows - 1), 3)."""
        down, across = np.mgrid[1 : self.rows, 1 : self.columns]
        return frozen(np.c_[across.ravel(), down.ravel(), np.zeros(down.size)] * self.square)

    def corners(self, gray: NDArray[np.uint8]) -> tuple[Matrix, Matrix]:
        """Return points on the board [m], shape (k, 3), and their pixels, shape (k, 2); empty if it is not found."""
        pattern = (self.columns - 1, self.rows - 1)
        try:
            is_found, pixels = cv2.findChessboardCornersSB(gray, pattern, flags=cv2.CALIB_CB_ACCURACY)
        except cv2.error:  # OpenCV's copies of the picture may exceed the memory
            size = " x ".join(map(str, gray.shape[::-1]))
            raise InputError(f"a picture of {size} pixels is too large to find a chessboard in; scale it") from None

        if not is_found or pixels is None:
            return np.zeros((0, 3)), np.zeros((0, 2))

        corner_pixels = np.reshape(pixels, (-1, 2)).astype(np.float64)
        if (self.columns + self.rows) % 2 == 1 and self._first_is_white(gray, corner_pixels):
            corner_pixels = corner_pixels[::-1].copy()
        return self.points, corner_pixels

    def _first_is_white(self, gray: NDArray[np.uint8], pixels: Matrix) -> bool:
        """Check whether the square after the first corner is white, that is, lighter than its neighbour."""
        grid = pixels.reshape(self.rows - 1, self.columns - 1, 2)
        middles = [np.rint(grid[:2, k : k + 2].reshape(4, 2).mean(axis=0)).astype(int) for k in (0, 1)]
        first, neighbour = (int(gray[down, across]) for across, down in middles)
        return first > neighbour

    def pieces(self, gray: NDArray[np.uint8], pixels: Matrix) -> Iterator[tuple[Matrix, NDArray[np.uint8]]]:
        """Divide the board into pieces of at most `PIECE` squares a side, without gaps or overlap.

        Args:
            gray: The picture.
            pixels: Pixels from `corners`.

        Yields:
            Corners in the picture, shape (4, 2), and the piece with the squares around it, 0 for black and 255 for
            white.
        """
        grid = pixels.reshape(self.rows - 1, self.columns - 1, 2)
        side = min(PIECE, self.columns - 2, self.rows - 2)
        for row in range(0, self.rows - 1 - side, side):
            for column in range(0, self.columns - 1 - side, side):
                end_cells = (row, column), (row, column + side), (row + side, column + side), (row + side, column)
                is_odd = np.indices((side + 2, side + 2)).sum(axis=0) % 2 == 1
                middles = 0.25 * sum(
                    grid[row + a : row + a + side, column + b : column + b + side] for a in (0, 1) for b in (0, 1)
                )

                # The grey values in the picture decide which colour comes first.
                across, down = np.rint(middles).astype(np.intp).reshape(-1, 2).T
                grey_values = gray[down, across]
                inner = is_odd[1:-1, 1:-1].ravel()
                is_white = is_odd == bool(grey_values[inner].mean() > grey_values[~inner].mean())
                yield np.array([grid[end] for end in end_cells]), np.where(is_white, 255, 0).astype(np.uint8)
