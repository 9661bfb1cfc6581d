"""How far the corners of an aligned marker can be trusted: from what the alignment could not explain of the picture.

What is left is no noise but structure: sheets are bent, ink has spread, something moved, and neighbours err alike. So
the marker is cut into blocks, and each is left out once: how far the corners then move is what blocks contradict each
other by (the jackknife, [68]). The white noise of the samples is added. Ink that has spread, blur that differs from way
to way, and a sheet that is bent are fitted along with the corners; bends are part of what the corners are doubted by.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Matrix, Vector, frozen

Pixels = NDArray[np.float32]

FLOOR = 0.02  # [pixels]; of a picture without any noise: sampling, rounding, shape of the blur
_FEW = 48  # samples along a side that are enough
_TINY = 1e-6  # of the squares: what a marker cannot tell, such as a bend along its view, stays 0
_BLOCKS = 4  # along a side
_BENDS = slice(14, 18)  # of the columns
_STEP = 0.05  # of a corner, by which slopes are measured [pixels]


def corner_spread(model: Pixels, seen: Pixels, square: Matrix, corners: Matrix) -> tuple[Matrix, Matrix]:
    """Better corners, shape (4, 2), and the covariance of their eight numbers [pixels^2], shape (8, 8).

    Args:
        model: The ideal marker, blurred and lit as the picture shows it.
        seen: The picture in the frame of the model, of the same shape.
        square: Corners of the marker in the model, shape (4, 2).
        corners: In the picture, shape (4, 2).
    """
    every = max(len(model) // _FEW, 1)
    columns = _columns(model, square, corners)[::every, ::every]
    light, shape = seen[::every, ::every].ravel().astype(np.float64), columns.shape[:2]
    columns = columns.reshape(len(light), -1)
    repeated = max(_area(square) / _area(corners) / every**2, 1.0)  # samples of one pixel err alike
    normal, right = columns.T @ columns, columns.T @ light
    normal += np.diag(_TINY * normal.diagonal() + _TINY)
    whole = np.linalg.inv(normal)
    found = whole @ right
    rest = light - columns @ found
    variance = repeated * float(rest @ rest) / max(len(light) - len(normal), 1)
    left_out = _left_out(shape, columns, rest, normal)
    bent = float(found[_BENDS] @ found[_BENDS]) * _area(corners) / _area(square)  # by as much corners may lie off
    spread = left_out + variance * whole[:8, :8] + (bent + FLOOR**2) * np.eye(8)
    return corners + found[:8].reshape(4, 2), frozen(spread)


def _columns(model: Pixels, square: Matrix, corners: Matrix) -> Matrix:
    """How the picture of the marker changes with what is fitted, eight numbers of corners first. Shape (h, w, k)."""
    across, down = _slope(model, 1, 0), _slope(model, 0, 1)
    moved = _slopes(model, across, down, square, corners)
    low, high = square[0], square[2]
    u = (2.0 * np.arange(model.shape[1]) - low[0] - high[0]) / (high[0] - low[0])
    v = ((2.0 * np.arange(model.shape[0]) - low[1] - high[1]) / (high[1] - low[1]))[:, None]
    # Motions of second order that no homography has: those of homographies are (u u, u v) and (u v, v v).
    bends = [across * v * v, down * u * u, across * u * u - down * u * v, across * u * v - down * v * v]
    blurs = [_slope(across, 1, 0), _slope(across, 0, 1), _slope(down, 0, 1)]
    more = [np.ones(model.shape), model, np.hypot(across, down), *blurs, *bends]
    return np.dstack([moved, *more])


def _slope(picture: NDArray[np.floating[Any]], across: int, down: int) -> Matrix:
    return np.asarray(cv2.Sobel(picture, cv2.CV_64F, across, down, scale=0.125), dtype=np.float64)


def _left_out(shape: tuple[int, ...], slopes: Matrix, rest: Vector, normal: Matrix) -> Matrix:
    """Covariance of the corners by how they move when one block after the other is left out. Shape (8, 8)."""
    rows, columns = (np.arange(size) * _BLOCKS // size for size in shape[:2])
    block = (rows[:, None] * _BLOCKS + columns).ravel()
    order = np.argsort(block, kind="stable")
    ends = np.searchsorted(block[order], np.arange(1, _BLOCKS**2))
    moves = []
    for part in np.split(order, ends):
        own = slopes[part]
        moves.append(np.linalg.solve(normal - own.T @ own, own.T @ rest[part])[:8])
    away = np.array(moves)
    count = len(moves)
    return np.asarray((count - 1) / count * away.T @ away)


def _area(corners: Matrix) -> float:
    (a, b), (c, d) = corners[2] - corners[0], corners[3] - corners[1]
    return 0.5 * abs(float(a * d - b * c))


def _slopes(model: Pixels, across: Matrix, down: Matrix, square: Matrix, corners: Matrix) -> Matrix:
    """How the model's grey values change with each number of the corners [1 / pixel]. Shape (h, w, 8)."""
    height, width = model.shape
    x, y = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
    places = np.stack([x.ravel(), y.ravel(), np.ones(x.size)])
    found, back = np.empty((model.size, 8)), _perspective(corners, square)
    for k in range(8):
        moved = corners.copy()
        moved[k // 2, k % 2] += _STEP
        at = back @ _perspective(square, moved) @ places
        shift = at[:2] / at[2] - places[:2]
        found[:, k] = -(across.ravel() * shift[0] + down.ravel() * shift[1]) / _STEP
    return found.reshape(height, width, 8)


def _perspective(before: Matrix, after: Matrix) -> Matrix:
    """The homography that leads four points to four others, in float64. Shape (3, 3)."""
    rows, right = np.zeros((8, 8)), np.zeros(8)
    for k, ((x, y), (u, v)) in enumerate(zip(before, after, strict=True)):
        rows[2 * k] = x, y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y
        rows[2 * k + 1] = 0.0, 0.0, 0.0, x, y, 1.0, -v * x, -v * y
        right[2 * k : 2 * k + 2] = u, v
    return np.append(np.linalg.solve(rows, right), 1.0).reshape(3, 3)
