"""Corners of a marker to a hundredth of a pixel: the whole ideal marker is laid over the picture until they agree.

The agreement is the enhanced correlation coefficient of Evangelidis and Psarakis (PAMI 2008), which does not change
with brightness and contrast; the motion is a homography. Four corners alone are pulled inwards by blur, by as much
as 0.2 pixels; all edges of all cells together are not.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Matrix

LEAST_LIKENESS = 0.9  # below it something covers the marker or the picture is not sharp: the corners stay as they were
_CELL_PIXELS = (3, 12)  # of a cell in the ideal picture; near its size in the camera's
_QUIET_CELLS = 0.7  # of the white rim that takes part
_STOP = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 30, 1e-6)


def aligned_corners(gray: NDArray[np.uint8], corners: Matrix, cells: NDArray[np.uint8]) -> tuple[Matrix, float]:
    """Sharper corners of a marker that was found, and how well the ideal marker fits the picture.

    Args:
        gray: The picture. Shape (height, width).
        corners: As found, within a few pixels. Shape (4, 2).
        cells: The ideal marker, its border included. Shape (n, n).

    Returns:
        Corners, shape (4, 2), and likeness from 0 to 1. Where the two do not fit the corners are returned unchanged.
    """
    count, side = len(cells), float(np.linalg.norm(np.roll(corners, -1, 0) - corners, axis=1).mean())
    cell = int(np.clip(round(side / count), *_CELL_PIXELS))
    rim = round(_QUIET_CELLS * cell)
    ideal = _ideal(cells, cell, rim, blur=0.7 * cell * count / side)
    square = np.array([[0, 0], [count, 0], [count, count], [0, count]], dtype=np.float64) * cell + rim - 0.5
    low, piece = _neighbourhood(gray, corners, margin=int(0.35 * side) + 4)
    guess = cv2.getPerspectiveTransform(square.astype(np.float32), (corners - low).astype(np.float32))
    try:
        align: Any = cv2.findTransformECC  # its type wants a mask where None does
        likeness, homography = align(
            ideal, piece.astype(np.float32), guess.astype(np.float32), cv2.MOTION_HOMOGRAPHY, _STOP, None, 1
        )
    except cv2.error:  # the two never came to agree
        return corners, 0.0
    better = cv2.perspectiveTransform(square[:, None], homography.astype(np.float64))[:, 0] + low
    if likeness < LEAST_LIKENESS or np.abs(better - corners).max() > max(2.0, 0.08 * side):
        return corners, float(likeness)
    return better, float(likeness)


def _ideal(cells: NDArray[np.uint8], cell: int, rim: int, blur: float) -> NDArray[np.float32]:
    large = np.kron(cells, np.ones((cell, cell), dtype=np.uint8))
    framed = cv2.copyMakeBorder(large, rim, rim, rim, rim, cv2.BORDER_CONSTANT, value=(255.0,))
    return np.asarray(cv2.GaussianBlur(framed.astype(np.float32), (0, 0), blur), dtype=np.float32)


def _neighbourhood(gray: NDArray[np.uint8], corners: Matrix, margin: int) -> tuple[Matrix, NDArray[np.uint8]]:
    low = np.maximum(np.floor(corners.min(axis=0)).astype(int) - margin, 0)
    high = np.ceil(corners.max(axis=0)).astype(int) + margin
    return low.astype(np.float64), gray[low[1] : high[1], low[0] : high[0]]
