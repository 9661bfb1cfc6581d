"""Plain chessboards for calibration: their inner corners in a picture."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Matrix, frozen
from rrtik_ompl.errors import InputError


@dataclass(frozen=True, slots=True)
class Chessboard:
    """A chessboard without markers: squares across and down, and the side of a square [m].

    It must be in view as a whole. Sides of which one is odd and one even make it clear which end is which; the
    calibration of a camera does not need to know that.

    Raises:
        InputError: If it has fewer than 4 x 4 squares, or the side is not positive.

    Example:
        >>> Chessboard(10, 7, 0.025).points.shape
        (54, 3)
    """

    columns: int
    rows: int
    square: float

    def __post_init__(self) -> None:
        if self.columns < 4 or self.rows < 4 or not self.square > 0.0:
            raise InputError(
                f"a chessboard has at least 4 x 4 squares of a positive side, got {self.columns} x {self.rows} "
                f"of {self.square:g} m; squares are counted, not the corners between them"
            )

    @property
    def points(self) -> Matrix:
        """Corners between squares on the board [m], row by row. Shape ((columns - 1) (rows - 1), 3)."""
        down, across = np.mgrid[1 : self.rows, 1 : self.columns]
        return frozen(np.c_[across.ravel(), down.ravel(), np.zeros(down.size)] * self.square)

    def corners(self, gray: NDArray[np.uint8]) -> tuple[Matrix, Matrix]:
        """Points on the board [m], shape (k, 3), and their pixels, shape (k, 2); none if the board is not found."""
        pattern = (self.columns - 1, self.rows - 1)
        found, pixels = cv2.findChessboardCornersSB(gray, pattern, flags=cv2.CALIB_CB_ACCURACY)
        if not found or pixels is None:
            return np.zeros((0, 3)), np.zeros((0, 2))
        return self.points, np.reshape(pixels, (-1, 2)).astype(np.float64)
