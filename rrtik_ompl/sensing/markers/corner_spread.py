"""Estimate the covariance of the corners of an aligned marker from the residuals of the alignment.

The residuals are not noise but structure: sheets are bent, ink has spread, something moved, and neighbouring samples
have similar errors. So the marker is divided into blocks, each block is left out once, and the resulting movements of
the corners show how far the blocks contradict each other (the jackknife, [68]). Sixteen blocks say little of eight
numbers, so their covariance is averaged with that of white noise, scaled to the same size. Spread ink, anisotropic
blur, sharpening, and a bent sheet are fitted together with the corners; bends beyond their own uncertainty add to that
of the corners.

What moves all blocks alike they cannot show: a wrong tone or sharpened edges move the outline, a fringe of colour the
whole marker, by the more the larger the residuals are. All markers of a picture share these causes.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector, frozen
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.markers.lighting import CUT_OFF

Pixels = NDArray[np.float32]

FLOOR = 0.002  # [pixels]; error in a picture without noise, by rounding
# Standard deviations of an outline that is too large, and of a marker that is displaced as a whole, for residuals that
# are as large as the contrast [pixels]. Measured on pictures with tone curves, sharpening, fringes of colour, and JPEG.
OUTLINE, DISPLACED = 0.8, 0.5
# Standard deviation of the corners for a blur along one direction, as a share of that of the blur: something moved, and
# the ideal marker is blurred to all sides.
SMEARED = 0.04
_SHARPENED = 2.0  # radius of the detail that cameras sharpen [pixels]
# [pixels]; possible displacement of the whole marker, multiplied by the share of samples that are clipped at white.
CUT_SHIFT = 0.12
# Samples along a side from which on only some of them are used; edges fall between the samples where they are few.
_FEW = 320
_TINY = 1e-6  # relative regularisation: parameters that the marker cannot determine stay 0
_BLOCKS = 4  # along a side
_ALIKE = np.tile(np.eye(2), (4, 1))  # displacements of all four corners together, along x and along y
_BLURS = slice(11, 14)  # columns of the blur
_BENDS = slice(14, 18)  # columns of the bends
_STEP = 0.05  # step of a corner for finite differences [pixels]


def corner_spread(
    model: Pixels, seen: Pixels, square: Matrix, corners: Matrix, camera: Camera | None = None
) -> tuple[Matrix, Matrix, Matrix]:
    """Refine the corners of an aligned marker by a linear fit, and return their covariance.

    Alignment keeps straight lines straight, which a lens does not: what it displaces within the marker is known and
    left out of the fit.

    Args:
        model: The ideal marker, blurred and lit as in the picture.
        seen: The picture in the frame of the model, of the same shape.
        square: Corners of the marker in the model, shape (4, 2).
        corners: Corners in the picture, shape (4, 2).
        camera: Camera of the picture; None if its lens does not matter.

    Returns:
        The corners, shape (4, 2) [pixels], the covariance of their eight coordinates, shape (8, 8) [pixels^2], and the
        part of it that all markers of the picture share: displacements by one standard deviation of each cause, shape
        (8, 3) [pixels].
    """
    step = max(len(model) // _FEW, 1)
    across, down = (_slope(model, *way) for way in ((1, 0), (0, 1)))
    columns = _columns(model, across, down, square, corners, step)
    values = seen[::step, ::step].ravel().astype(np.float64)
    if camera is not None and not camera.is_pinhole:
        values += _bent_by_lens(camera, across[::step, ::step], down[::step, ::step], square, corners, step)
    shape = columns.shape[:2]
    columns = columns.reshape(len(values), -1)
    # Samples within one pixel have the same error.
    samples_per_pixel = max(_area(square) / _area(corners) / step**2, 1.0)

    normal = columns.T @ columns
    right_side = columns.T @ values
    normal += np.diag(_TINY * normal.diagonal() + _TINY)
    inverse = np.linalg.inv(normal)

    solution = inverse @ right_side
    residuals = values - columns @ solution
    variance = samples_per_pixel * float(residuals @ residuals) / max(len(values) - len(normal), 1)

    jackknife = _jackknife_covariance(shape, columns, residuals, normal)
    white = variance * inverse[:8, :8]
    scale = max(float(np.trace(np.linalg.solve(white, jackknife))) / 8.0, 1.0)

    # Bends may displace the corners by their own size.
    by_chance = scale * variance * float(np.trace(inverse[_BENDS, _BENDS]))
    bends = max(float(solution[_BENDS] @ solution[_BENDS]) - by_chance, 0.0) * _area(corners) / _area(square)
    along, oblique, across = solution[_BLURS] * [2.0, 1.0, 2.0] * _area(corners) / _area(square)
    smeared = SMEARED**2 * float(np.hypot(0.5 * (along - across), oblique))
    own = 0.5 * (jackknife + scale * white) + (bends + smeared + FLOOR**2) * np.eye(8)

    # Clipping, tone, halos and colour shift all blocks alike, which the jackknife cannot detect.
    unlike = float(np.std(residuals)) / max(float(np.ptp(model)), 1.0)
    displaced = np.hypot(CUT_SHIFT * float((values >= CUT_OFF).mean()), DISPLACED * unlike)
    outwards = (corners - corners.mean(axis=0)).ravel()
    outwards *= 2.0 / np.linalg.norm(outwards)  # corners move by one pixel in the mean
    common = np.column_stack([OUTLINE * unlike * outwards, displaced * _ALIKE])

    return corners + solution[:8].reshape(4, 2), frozen(own + common @ common.T), frozen(common)


def _columns(model: Pixels, across: Matrix, down: Matrix, square: Matrix, corners: Matrix, step: int) -> Matrix:
    """Return the Jacobian of the grey values of the marker with respect to all fitted numbers, shape (h, w, k).

    The columns are eight coordinates of corners, then brightness, contrast, spread of ink, three of blur, four bends,
    and sharpening. Only one sample in ``step`` along each side is used. The model's slopes are ``across`` and ``down``.
    """
    radius = _SHARPENED * float(np.sqrt(_area(square) / _area(corners)))
    detail = (model - cv2.GaussianBlur(model, (0, 0), radius))[::step, ::step]

    blurs = [_slope(across, 1, 0), _slope(across, 0, 1), _slope(down, 0, 1)]

    across = across[::step, ::step]
    down = down[::step, ::step]
    model = model[::step, ::step]
    blurs = [blur[::step, ::step] for blur in blurs]

    x, y = _sample_places(*model.shape, step)
    low = square[0]
    high = square[2]
    u = (2.0 * x - low[0] - high[0]) / (high[0] - low[0])
    v = (2.0 * y - low[1] - high[1]) / (high[1] - low[1])

    # Motions of second order that are no homographies, whose own ones are (u u, u v) and (u v, v v).
    bends = [across * v * v, down * u * u, across * u * u - down * u * v, across * u * v - down * v * v]
    light_and_bends = [np.ones(model.shape), model, np.hypot(across, down), *blurs, *bends]
    return np.dstack([_slopes(across, down, (x, y), square, corners), *light_and_bends, detail])


def _bent_by_lens(camera: Camera, across: Matrix, down: Matrix, square: Matrix, corners: Matrix, step: int) -> Vector:
    """Return how much brighter the samples would be if the lens kept straight lines straight, shape (h w,)."""
    samples = np.stack([each.ravel() for each in _sample_places(*across.shape, step)], axis=1)

    view, on_plane = camera.seen_by_pinhole(corners)
    to_plane, to_picture = _perspectives(np.stack([square, square]), np.stack([on_plane, corners]))
    pixels = camera.project(np.column_stack([_moved(to_plane, samples), np.ones(len(samples))]) @ view.T)
    shift = _moved(np.linalg.inv(to_picture), pixels) - samples
    return np.asarray(across.ravel() * shift[:, 0] + down.ravel() * shift[:, 1], dtype=np.float64)


def _moved(homography: Matrix, points: Matrix) -> Matrix:
    moved = points @ homography[:, :2].T + homography[:, 2]
    return np.asarray(moved[:, :2] / moved[:, 2:], dtype=np.float64)


def _slope(picture: NDArray[np.floating[Any]], across: int, down: int) -> Matrix:
    return np.asarray(cv2.Sobel(picture, cv2.CV_64F, across, down, scale=0.125), dtype=np.float64)


@lru_cache(maxsize=64)
def _sample_places(height: int, width: int, step: int) -> tuple[Matrix, Matrix]:
    """Return the x and y coordinates of the samples, shape (height, width) each."""
    y, x = np.mgrid[0.0:height, 0.0:width] * step
    return x, y


def _slopes(across: Matrix, down: Matrix, places: tuple[Matrix, Matrix], square: Matrix, corners: Matrix) -> Matrix:
    """Return the Jacobian of the model's grey values with respect to the corners [1 / pixel], shape (h, w, 8)."""
    x, y = (coordinate.ravel() for coordinate in places)
    moved_corners = corners.reshape(8) + _STEP * np.eye(8)

    to_square = _perspectives(corners[None], square[None])[0]
    to_square_moved = to_square @ _perspectives(np.broadcast_to(square, (8, 4, 2)), moved_corners.reshape(8, 4, 2))
    homogeneous = to_square_moved[..., 0, None] * x + (
        to_square_moved[..., 1, None] * y + to_square_moved[..., 2, None]
    )
    shift = (homogeneous[:, :2] / homogeneous[:, 2:] - [x, y]) * (-1.0 / _STEP)

    slopes = across.ravel() * shift[:, 0] + down.ravel() * shift[:, 1]
    return np.asarray(slopes.T.reshape(*across.shape, 8), dtype=np.float64)


def _perspectives(before: Matrix, after: Matrix) -> Matrix:
    """Return the homographies that map four points to four others, shape (k, 3, 3), from arrays of shape (k, 4, 2)."""
    count = len(before)
    x, y = np.moveaxis(before, 2, 0)
    u, v = np.moveaxis(after, 2, 0)
    ones = np.ones((count, 4))
    zeros = np.zeros((count, 4))
    # Each point gives two equations for the eight unknown entries; the ninth entry is 1.
    rows = np.concatenate([
        np.stack([x, y, ones, zeros, zeros, zeros, -u * x, -u * y], axis=2),
        np.stack([zeros, zeros, zeros, x, y, ones, -v * x, -v * y], axis=2),
    ], axis=1)  # fmt: skip

    coefficients = np.linalg.solve(rows, np.concatenate([u, v], axis=1)[..., None])[..., 0]
    return np.append(coefficients, np.ones((count, 1)), axis=1).reshape(count, 3, 3)


def _area(corners: Matrix) -> float:
    a, b = corners[2] - corners[0]
    c, d = corners[3] - corners[1]
    return 0.5 * abs(float(a * d - b * c))


def _jackknife_covariance(shape: tuple[int, ...], slopes: Matrix, residuals: Vector, normal: Matrix) -> Matrix:
    """Return the covariance of the corners from their movement when each block is left out once, shape (8, 8)."""
    order, ends = _blocks(*shape[:2])
    slopes_and_residuals = np.column_stack([slopes, residuals])[order]
    block_normals = np.stack([part.T @ part for part in np.split(slopes_and_residuals, ends)])
    corner_shifts = np.linalg.solve(normal - block_normals[:, :-1, :-1], block_normals[:, :-1, -1:])[:, :8, 0]
    count = len(corner_shifts)
    return np.asarray((count - 1) / count * corner_shifts.T @ corner_shifts)


@lru_cache(maxsize=64)
def _blocks(height: int, width: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return an order of the samples in which each block is contiguous, and the ends of the blocks in it."""
    rows, columns = (np.arange(size) * _BLOCKS // size for size in (height, width))
    block = (rows[:, None] * _BLOCKS + columns).ravel()
    order = np.argsort(block, kind="stable")
    return order, np.searchsorted(block[order], np.arange(1, _BLOCKS**2))
