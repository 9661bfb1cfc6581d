"""Corners of a marker to a hundredth of a pixel: the whole ideal marker is aligned with the picture.

The criterion is the enhanced correlation coefficient of Evangelidis and Psarakis, 2008 [52], which does not change
with brightness and contrast; the motion is a homography. Four corners alone are pulled inwards by blur, by as much
as 0.2 pixels; all edges of all cells together are not, if the ideal marker is blurred as the picture is: as much, and
evenly in the picture, so unevenly on a marker that is tilted.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Matrix

Pixels = NDArray[np.float32]

MIN_LIKENESS = 0.9  # below it the marker is partly covered or the picture is not sharp
_MAX_CORNER_SHIFT = 0.25  # of a side; inner edges are sometimes found in place of outer ones
_CELL_PIXELS = (3, 16)  # of a cell in the ideal picture; near its size in the camera's
_RIM_CELLS = 0.5  # width of the white rim that is used; farther out blur mixes in the background
_DEFAULT_SPOT = 0.8  # standard deviation of a sharp picture's blur: lens, photosite, interpolation [pixels]
_SPOTS = _DEFAULT_SPOT * 1.5 ** np.arange(-2, 3)  # that are tried
_SPOT_TOLERANCE = 0.1  # relative difference below which no second alignment is made
_STOP = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 30, 1e-6)


def aligned_corners(gray: NDArray[np.uint8], corners: Matrix, cells: NDArray[np.uint8]) -> tuple[Matrix, float]:
    """Sharper corners of a marker that was found, and how well the ideal marker fits the picture.

    Args:
        gray: The picture. Shape (height, width).
        corners: As found, within a few pixels. Shape (4, 2).
        cells: The ideal marker, its border included. Shape (n, n).

    Returns:
        Corners, shape (4, 2), and likeness from 0 to 1. Below `MIN_LIKENESS` the corners are returned unchanged.
    """
    count, side = len(cells), float(np.linalg.norm(np.roll(corners, -1, 0) - corners, axis=1).mean())
    cell = int(np.clip(round(side / count), *_CELL_PIXELS))
    rim = round(_RIM_CELLS * cell)
    square = np.array([[0, 0], [count, 0], [count, count], [0, count]], dtype=np.float64) * cell + rim - 0.5
    low, piece = _neighbourhood(gray, corners, margin=int(0.35 * side) + 4)
    guess = cv2.getPerspectiveTransform(square.astype(np.float32), (corners - low).astype(np.float32))
    try:
        likeness, homography = _aligned(_ideal(cells, cell, rim), piece, guess.astype(np.float32))
    except cv2.error:  # the alignment did not converge
        return corners, 0.0
    better = cv2.perspectiveTransform(square[:, None], homography.astype(np.float64))[:, 0] + low
    if np.abs(better - corners).max() > max(2.0, _MAX_CORNER_SHIFT * side):
        return corners, 0.0
    return (better if likeness >= MIN_LIKENESS else corners), likeness


def _aligned(ideal: Pixels, piece: Pixels, homography: Pixels) -> tuple[float, Pixels]:
    """Likeness and the homography from the ideal marker to a picture, whose blur is estimated too."""
    likeness, rough = _fitted(ideal, piece, homography, _DEFAULT_SPOT)
    spot = _spot(ideal, piece, rough)
    if abs(spot - _DEFAULT_SPOT) < _SPOT_TOLERANCE * _DEFAULT_SPOT:
        return likeness, rough
    return _fitted(ideal, piece, rough, spot)


def _fitted(ideal: Pixels, piece: Pixels, homography: Pixels, spot: float) -> tuple[float, Pixels]:
    align: Any = cv2.findTransformECC  # its type requires a mask where None is allowed
    blurred = _blurred(ideal, spot**2 * _spread(homography, ideal.shape))
    likeness, better = align(blurred, piece, homography, cv2.MOTION_HOMOGRAPHY, _STOP, None, 1)
    return float(likeness), better


def _spot(ideal: Pixels, piece: Pixels, homography: Pixels) -> float:
    """Standard deviation of the blur with which the ideal marker is most like the picture [pixels]."""
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    seen = cv2.warpPerspective(piece, homography, ideal.shape[::-1], flags=flags)
    spread = _spread(homography, ideal.shape)
    rows = np.stack([_blurred(ideal, spot**2 * spread).ravel() for spot in _SPOTS])
    rows -= rows.mean(axis=1, keepdims=True)
    likeness = rows @ (seen.ravel() - seen.mean()) / np.sqrt((rows**2).sum(axis=1))
    best = int(np.clip(likeness.argmax(), 1, len(_SPOTS) - 2))
    low, middle, high = likeness[best - 1 : best + 2]
    bend = low - 2.0 * middle + high
    aside = float(np.clip(0.5 * (low - high) / bend, -1.0, 1.0)) if bend < 0.0 else 0.0
    return float(_SPOTS[best] * (_SPOTS[1] / _SPOTS[0]) ** aside)


def _ideal(cells: NDArray[np.uint8], cell: int, rim: int) -> Pixels:
    large = np.kron(cells, np.ones((cell, cell), dtype=np.uint8))
    framed = cv2.copyMakeBorder(large, rim, rim, rim, rim, cv2.BORDER_CONSTANT, value=(255.0,))
    return framed.astype(np.float32)


def _spread(homography: Pixels, shape: tuple[int, ...]) -> Matrix:
    """Covariance, in the middle of the ideal marker, of what a round spot in the picture covers. Shape (2, 2)."""
    middle = np.array([0.5 * (shape[1] - 1), 0.5 * (shape[0] - 1), 1.0])
    (x, y), bottom = homography[:2] @ middle, homography[2] @ middle
    slope = (homography[:2, :2] - np.outer([x, y], homography[2, :2]) / bottom) / bottom
    back = np.linalg.inv(slope)
    return np.asarray(back @ back.T, dtype=np.float64)


def _blurred(picture: Pixels, spread: Matrix) -> Pixels:
    reach = max(int(np.ceil(3.0 * np.sqrt(spread.diagonal().max()))), 1)
    x = np.arange(-reach, reach + 1.0)
    y = x[:, None]
    (a, b), (_, c) = np.linalg.inv(spread)
    weights = np.exp(-0.5 * (a * x * x + 2.0 * b * x * y + c * y * y))
    blurred = cv2.filter2D(picture, cv2.CV_32F, weights / weights.sum(), borderType=cv2.BORDER_REPLICATE)
    return np.asarray(blurred, dtype=np.float32)


def _neighbourhood(gray: NDArray[np.uint8], corners: Matrix, margin: int) -> tuple[Matrix, Pixels]:
    low = np.maximum(np.floor(corners.min(axis=0)).astype(int) - margin, 0)
    high = np.ceil(corners.max(axis=0)).astype(int) + margin
    return low.astype(np.float64), gray[low[1] : high[1], low[0] : high[0]].astype(np.float32)
