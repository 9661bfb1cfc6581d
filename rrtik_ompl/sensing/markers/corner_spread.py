"""How far the corners of an aligned marker can be trusted: from what the alignment could not explain of the picture.

What is left is no noise but structure: sheets are bent, ink has spread, something moved, and neighbours err alike. So
the marker is cut into blocks, and each is left out once: how far the corners then move is what blocks contradict each
other by (the jackknife, [68]). The white noise of the samples is added. Ink that has spread, blur that differs from way
to way, and a sheet that is bent are fitted along with the corners; bends are part of what the corners are doubted by.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector, frozen
from rrtik_ompl.sensing.markers.lighting import CUT_OFF

Pixels = NDArray[np.float32]

FLOOR = 0.02  # [pixels]; of a picture without any noise: sampling, rounding, shape of the blur
CUT_SHIFT = 0.12  # [pixels] by which a marker as a whole may lie off, times the share of it that is cut off at white
_FEW = 48  # samples along a side that are enough
_TINY = 1e-6  # of the squares: what a marker cannot tell, such as a bend along its view, stays 0
_BLOCKS = 4  # along a side
_ALIKE = np.kron(np.ones((4, 4)), np.eye(2))  # of the corners' eight numbers, moved together
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
    columns = _columns(model, square, corners, every)
    light = seen[::every, ::every].ravel().astype(np.float64)
    shape = columns.shape[:2]
    columns = columns.reshape(len(light), -1)
    repeated = max(_area(square) / _area(corners) / every**2, 1.0)  # samples of one pixel err alike

    normal = columns.T @ columns
    right = columns.T @ light
    normal += np.diag(_TINY * normal.diagonal() + _TINY)
    whole = np.linalg.inv(normal)

    found = whole @ right
    rest = light - columns @ found
    variance = repeated * float(rest @ rest) / max(len(light) - len(normal), 1)

    left_out = _left_out(shape, columns, rest, normal)
    bent = float(found[_BENDS] @ found[_BENDS]) * _area(corners) / _area(square)  # by as much corners may lie off
    cut = CUT_SHIFT * float((light >= CUT_OFF).mean())  # blocks err alike there, which the jackknife does not see
    spread = left_out + variance * whole[:8, :8] + (bent + FLOOR**2) * np.eye(8) + cut**2 * _ALIKE

    return corners + found[:8].reshape(4, 2), frozen(spread)


def _columns(model: Pixels, square: Matrix, corners: Matrix, every: int) -> Matrix:
    """How the picture of the marker changes with what is fitted, eight numbers of corners first. Shape (h, w, k).

    Of one sample among ``every`` along each side.
    """
    across = _slope(model, 1, 0)
    down = _slope(model, 0, 1)
    blurs = [_slope(across, 1, 0), _slope(across, 0, 1), _slope(down, 0, 1)]

    across = across[::every, ::every]
    down = down[::every, ::every]
    model = model[::every, ::every]
    blurs = [each[::every, ::every] for each in blurs]

    x, y = _places(*model.shape, every)
    low = square[0]
    high = square[2]
    u = (2.0 * x - low[0] - high[0]) / (high[0] - low[0])
    v = (2.0 * y - low[1] - high[1]) / (high[1] - low[1])

    # Motions of second order that no homography has: those of homographies are (u u, u v) and (u v, v v).
    bends = [across * v * v, down * u * u, across * u * u - down * u * v, across * u * v - down * v * v]
    more = [np.ones(model.shape), model, np.hypot(across, down), *blurs, *bends]
    return np.dstack([_slopes(across, down, (x, y), square, corners), *more])


def _slope(picture: NDArray[np.floating[Any]], across: int, down: int) -> Matrix:
    return np.asarray(cv2.Sobel(picture, cv2.CV_64F, across, down, scale=0.125), dtype=np.float64)


@lru_cache(maxsize=64)
def _places(height: int, width: int, every: int) -> tuple[Matrix, Matrix]:
    """Where the samples are, across and down. Each of shape (height, width)."""
    y, x = np.mgrid[0.0:height, 0.0:width] * every
    return x, y


def _slopes(across: Matrix, down: Matrix, places: tuple[Matrix, Matrix], square: Matrix, corners: Matrix) -> Matrix:
    """How the model's grey values change with each number of the corners [1 / pixel]. Shape (h, w, 8)."""
    x, y = (each.ravel() for each in places)
    moved = corners.reshape(8) + _STEP * np.eye(8)

    back = _perspectives(corners[None], square[None])[0]
    turned = back @ _perspectives(np.broadcast_to(square, (8, 4, 2)), moved.reshape(8, 4, 2))
    at = turned[..., 0, None] * x + (turned[..., 1, None] * y + turned[..., 2, None])
    shift = (at[:, :2] / at[:, 2:] - [x, y]) * (-1.0 / _STEP)

    found = across.ravel() * shift[:, 0] + down.ravel() * shift[:, 1]
    return np.asarray(found.T.reshape(*across.shape, 8), dtype=np.float64)


def _perspectives(before: Matrix, after: Matrix) -> Matrix:
    """The homographies that lead four points to four others, in float64. Each of shape (k, 4, 2); (k, 3, 3)."""
    count = len(before)
    x, y = np.moveaxis(before, 2, 0)
    u, v = np.moveaxis(after, 2, 0)
    one = np.ones((count, 4))
    none = np.zeros((count, 4))
    # Two equations a point, for the eight numbers beside the last one, which is 1.
    rows = np.concatenate([
        np.stack([x, y, one, none, none, none, -u * x, -u * y], axis=2),
        np.stack([none, none, none, x, y, one, -v * x, -v * y], axis=2),
    ], axis=1)  # fmt: skip

    found = np.linalg.solve(rows, np.concatenate([u, v], axis=1)[..., None])[..., 0]
    return np.append(found, np.ones((count, 1)), axis=1).reshape(count, 3, 3)


def _area(corners: Matrix) -> float:
    a, b = corners[2] - corners[0]
    c, d = corners[3] - corners[1]
    return 0.5 * abs(float(a * d - b * c))


def _left_out(shape: tuple[int, ...], slopes: Matrix, rest: Vector, normal: Matrix) -> Matrix:
    """Covariance of the corners by how they move when one block after the other is left out. Shape (8, 8)."""
    order, ends = _blocks(*shape[:2])
    both = np.column_stack([slopes, rest])[order]
    own = np.stack([part.T @ part for part in np.split(both, ends)])
    away = np.linalg.solve(normal - own[:, :-1, :-1], own[:, :-1, -1:])[:, :8, 0]
    count = len(away)
    return np.asarray((count - 1) / count * away.T @ away)


@lru_cache(maxsize=64)
def _blocks(height: int, width: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """An order of the samples in which each block stands together, and where blocks end in it."""
    rows, columns = (np.arange(size) * _BLOCKS // size for size in (height, width))
    block = (rows[:, None] * _BLOCKS + columns).ravel()
    order = np.argsort(block, kind="stable")
    return order, np.searchsorted(block[order], np.arange(1, _BLOCKS**2))
