"""How far the corners of an aligned marker can be trusted: from what the alignment could not explain of the picture.

First-order propagation, as for any least-squares fit: the residual's variance over the squared slopes of the picture by
each of the eight numbers; brightness and contrast are fitted along with them.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Matrix, frozen

Pixels = NDArray[np.float32]

ROOT_OF_STRUCTURE = 3.0  # what is left is no noise but structure: neighbours err alike
FLOOR = 0.03  # [pixels]; of a picture without any noise: sampling, rounding, shape of the blur
_STEP = 0.05  # of a corner, by which slopes are measured [pixels]


def corner_spread(model: Pixels, seen: Pixels, square: Matrix, corners: Matrix) -> Matrix:
    """Covariance of the corners [pixels^2]. Shape (8, 8), in the order x, y of each corner.

    Args:
        model: The ideal marker, blurred.
        seen: The picture's light in the frame of the model, of the same shape.
        square: Corners of the marker in the model, shape (4, 2).
        corners: In the picture, shape (4, 2).
    """
    fit = np.c_[np.ones(model.size), model.ravel()]
    weights, *_ = np.linalg.lstsq(fit, seen.ravel(), rcond=None)
    rest = seen.ravel() - fit @ weights
    slopes = np.c_[_slopes(model, square, corners) * weights[1], fit]
    repeated = max(_area(square) / _area(corners), 1.0)  # samples of one pixel err alike
    variance = ROOT_OF_STRUCTURE**2 * repeated * float(rest @ rest) / max(model.size - 10, 1)
    found = variance * np.linalg.pinv(slopes.T @ slopes)[:8, :8]
    return frozen(found + FLOOR**2 * np.eye(8))


def _area(corners: Matrix) -> float:
    (a, b), (c, d) = corners[2] - corners[0], corners[3] - corners[1]
    return 0.5 * abs(float(a * d - b * c))


def _slopes(model: Pixels, square: Matrix, corners: Matrix) -> Matrix:
    """How the model's grey values change with each number of the corners [1 / pixel]. Shape (m, 8)."""
    height, width = model.shape
    across, down = cv2.Sobel(model, cv2.CV_64F, 1, 0, scale=0.125), cv2.Sobel(model, cv2.CV_64F, 0, 1, scale=0.125)
    x, y = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
    places = np.stack([x.ravel(), y.ravel(), np.ones(x.size)])
    found, back = np.empty((model.size, 8)), _perspective(corners, square)
    for k in range(8):
        moved = corners.copy()
        moved[k // 2, k % 2] += _STEP
        at = back @ _perspective(square, moved) @ places
        shift = at[:2] / at[2] - places[:2]
        found[:, k] = -(across.ravel() * shift[0] + down.ravel() * shift[1]) / _STEP
    return found


def _perspective(before: Matrix, after: Matrix) -> Matrix:
    """The homography that leads four points to four others, in float64. Shape (3, 3)."""
    rows, right = np.zeros((8, 8)), np.zeros(8)
    for k, ((x, y), (u, v)) in enumerate(zip(before, after, strict=True)):
        rows[2 * k] = x, y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y
        rows[2 * k + 1] = 0.0, 0.0, 0.0, x, y, 1.0, -v * x, -v * y
        right[2 * k : 2 * k + 2] = u, v
    return np.append(np.linalg.solve(rows, right), 1.0).reshape(3, 3)
