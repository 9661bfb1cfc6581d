"""Refine the corners of a marker to a hundredth of a pixel by aligning the whole ideal marker with the picture.

The criterion is the enhanced correlation coefficient of Evangelidis and Psarakis, 2008 [52], which is invariant to
brightness and contrast; the motion model is a homography. Blur pulls single corners inwards by up to 0.2 pixels. The
edges of all cells together do not have this error, provided that the ideal marker is blurred like the picture: by the
same amount, and isotropically in the picture, thus anisotropically on a tilted marker. A lens blurs light, not grey
values. So the ideal marker is blurred first, then converted by the tone curve and clipped at white; the tone is the
one with the best correlation (`lighting`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.markers.corner_spread import corner_spread
from rrtik_ompl.sensing.markers.lighting import LINEAR, SRGB, TONES, likenesses, shown

Pixels = NDArray[np.float32]

MIN_LIKENESS = 0.9  # below it the marker is partly covered or the picture is not sharp
# Largest error of a cell as a share of the contrast: cells of markers have up to 0.21, of a symbol on a box 0.47.
MAX_CELL_ERROR = 0.3
_MAX_CORNER_SHIFT = 0.25  # share of a side; the detector sometimes returns inner edges instead of outer ones
# Range of pixels per cell in the ideal picture. It should be near the cell's size in the camera's picture, because
# coarser sampling shifts the corners.
_CELL_PIXELS = (3, 64)
# The same for a piece of a chessboard, whose few edges must suffice to estimate the tone.
_SQUARE_PIXELS = (3, 80)
_RIM_CELLS = 0.5  # width of the white rim that is used; farther out the background blurs into it
# [pixels]; standard deviation of the blur of a sharp picture, by lens, photosite and interpolation.
_DEFAULT_SPOT = 0.8
_SPOTS = _DEFAULT_SPOT * 1.5 ** np.arange(-2, 5)  # the blurs that are tried
_NEAR_SPOTS = 1.5 ** np.arange(-1.0, 2.0)  # the factors that are tried if a blur is known
_SPOT_TOLERANCE = 0.1  # relative difference below which no second alignment is made
_TONE_TOLERANCE = 0.05
_UNLIKENESS_RATIO = 1.2  # factor of 1 - likeness up to which the last estimate of blur and tone remains valid
_ROUNDS = 3  # rounds of alignment, each with the blur and tone estimated in the round before
# Smaller estimates of the tone count as linear: coarse sampling makes the tone of a linear camera appear larger.
_LINEAR_BELOW = 0.35
# Number of samples along a side that suffices for the search of blur and tone.
_FEW = 48
_NARROWEST = 3.0  # [pixels]; of a marker in the picture, with its rim: narrower ones cannot be read
_STOP = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 30, 1e-6)


class Look(NamedTuple):
    """How a picture renders a marker.

    Attributes:
        spot: Standard deviation of its blur [pixels].
        tone: Tone of the picture (`markers.lighting`).
        likeness: Correlation of the marker with the picture when both were estimated.
    """

    spot: float
    tone: float
    likeness: float = 0.0


class Aligned(NamedTuple):
    """The result of aligning a marker with a picture.

    Attributes:
        corners: Shape (4, 2) [pixels].
        likeness: Correlation of the ideal marker with the picture, from 0 to 1.
        spread: Covariance of the corners' eight coordinates, shape (8, 8) [pixels^2]; None if they were not aligned.
        look: Blur and tone; None if the corners were not aligned.
        common: The part of ``spread`` that all markers of the picture share (`corner_spread`).
    """

    corners: Matrix
    likeness: float
    spread: Matrix | None
    look: Look | None
    common: Matrix | None = None


def aligned_corners(
    gray: NDArray[np.uint8],
    corners: Matrix,
    cells: NDArray[np.uint8],
    tone: float | None = None,
    before: Look | None = None,
    spoilt: int = 0,
    camera: Camera | None = None,
) -> Aligned:
    """Refine the corners of a detected marker, and estimate their covariance.

    Args:
        gray: The picture, shape (height, width).
        corners: Detected corners, correct to a few pixels, shape (4, 2).
        cells: The ideal marker including its border, shape (n, n).
        tone: Tone of the picture; None to use the one with which the marker fits best.
        before: Look of the marker in the previous picture; a search that starts there is three times as fast.
        spoilt: Number of cells that may look as they should not, because the code can tell its markers without them.
        camera: Camera of the picture, whose lens bends the sides of the marker; None if it does not matter.

    Returns:
        The aligned marker; its likeness is at most that of the worst cell, if that one is too unlike. With a likeness
        below `MIN_LIKENESS` it has the corners that were given.
    """
    framed = np.pad(cells, 1, constant_values=255)
    low, square, fit = _lay_over(gray, corners, framed, _CELL_PIXELS, tone, before)
    if fit is None:
        return Aligned(corners, 0.0, None, None)

    moved = cv2.perspectiveTransform(square[:, None], fit.homography.astype(np.float64))[:, 0]
    moved_corners = np.asarray(moved, dtype=np.float64)
    if np.abs(moved_corners + low - corners).max() > max(2.0, _MAX_CORNER_SHIFT * mean_side(corners)):
        return Aligned(corners, 0.0, None, None)
    worst = float(np.sort(cell_errors(fit.model, fit.seen, len(cells)))[-1 - spoilt])
    likeness = fit.likeness if worst <= MAX_CELL_ERROR else min(fit.likeness, 1.0 - worst)
    if likeness < MIN_LIKENESS:
        return Aligned(corners, likeness, None, None)

    refined, spread, common = corner_spread(fit.model, fit.seen, square, moved_corners + low, camera)
    return Aligned(refined, fit.likeness, spread, fit.look, common)


def look_of(gray: NDArray[np.uint8], corners: Matrix, framed: NDArray[np.uint8]) -> Look | None:
    """Return how a picture renders a pattern of squares, such as a piece of a chessboard; None if it does not fit.

    Args:
        gray: The picture, shape (height, width).
        corners: Corners of the pattern without its surroundings, correct to a pixel, shape (4, 2).
        framed: The pattern with one more cell on each side for its surroundings, shape (n + 2, n + 2).
    """
    fit = _lay_over(gray, corners, framed, _SQUARE_PIXELS)[2]
    return None if fit is None or fit.likeness < MIN_LIKENESS else fit.look


def mean_side(corners: Matrix) -> float:
    """Return the mean length of the edges of a marker, from its corners, shape (4, 2), in their unit."""
    return float(np.linalg.norm(np.roll(corners, -1, 0) - corners, axis=1).mean())


def cell_errors(model: Pixels, seen: Pixels, count: int) -> Vector:
    """Return how far cells of a marker are from what they should be, as shares of the contrast of black and white.

    An error of 1 is a white cell that looks black; above 0.5 a cell is nearer to the other colour. A correlation of the
    whole marker does not see single cells: any dark square with a light blot has a likeness of 0.95 with some marker.

    Args:
        model: The ideal marker as the picture would render it, with a rim, shape (h, h).
        seen: The picture in the frame of the model, of the same shape.
        count: Cells along a side of the marker.

    Returns:
        Errors of the cells, row by row, then of the pieces of the white rim, shape (count^2 + 4 count,).
    """
    cell = round(len(model) / (count + 2.0 * _RIM_CELLS))
    rim = (len(model) - count * cell) // 2
    inset = cell // 4
    lines = [slice(rim + k * cell + inset, rim + (k + 1) * cell - inset) for k in range(count)]
    before = slice(0, rim)
    after = slice(len(model) - rim, len(model))

    pieces = [np.s_[row, column] for row in lines for column in lines]
    pieces += [piece for line in lines for side in (before, after) for piece in (np.s_[side, line], np.s_[line, side])]
    shown_means = np.array([model[piece].mean() for piece in pieces])
    seen_means = np.array([seen[piece].mean() for piece in pieces])

    middle = 0.5 * (shown_means.min() + shown_means.max())
    contrast = shown_means[shown_means > middle].mean() - shown_means[shown_means <= middle].mean()
    return np.asarray(np.abs(seen_means - shown_means) / max(float(contrast), 1e-6), dtype=np.float64)


class _TooNarrow(Exception):
    """An alignment has collapsed to less than a marker can be: its blur would reach across thousands of samples."""


class _Fit(NamedTuple):
    """The alignment of an ideal marker with a picture.

    Attributes:
        likeness: Their correlation.
        homography: From the ideal marker to the piece of the picture, shape (3, 3).
        model: The ideal marker as the picture would render it, shape (h, w).
        seen: The picture in the frame of the ideal marker, shape (h, w).
        look: Blur and tone that were assumed.
    """

    likeness: float
    homography: Pixels
    model: Pixels
    seen: Pixels
    look: Look


def _lay_over(
    gray: NDArray[np.uint8],
    corners: Matrix,
    framed: NDArray[np.uint8],
    sizes: tuple[int, int],
    tone: float | None = None,
    last_look: Look | None = None,
) -> tuple[Matrix, Matrix, _Fit | None]:
    """Align a pattern, which has a frame of one cell, with a picture.

    Returns:
        The origin of the piece of the picture that was used, shape (2,), the corners of the pattern in the ideal
        picture, shape (4, 2), and the fit; None if the alignment does not converge.
    """
    count = len(framed) - 2
    side = mean_side(corners)
    cell = int(np.clip(round(side / count), *sizes))
    rim = round(_RIM_CELLS * cell)
    square = np.array([[0, 0], [count, 0], [count, count], [0, count]], dtype=np.float64) * cell + rim - 0.5

    origin, piece = _neighbourhood(gray, corners, margin=int(0.35 * side) + 4)
    homography = cv2.getPerspectiveTransform(square.astype(np.float32), (corners - origin).astype(np.float32))

    ideal = _ideal(framed, cell, rim)
    try:
        fit = _align_with_look(ideal, piece, homography.astype(np.float32), tone, last_look)
        if last_look is not None and fit.likeness < MIN_LIKENESS:  # the look of the previous picture was misleading
            fit = _align_with_look(ideal, piece, homography.astype(np.float32), tone, None)
    except (cv2.error, _TooNarrow):  # the alignment did not converge
        return origin, square, None

    return origin, square, fit


def _neighbourhood(gray: NDArray[np.uint8], corners: Matrix, margin: int) -> tuple[Matrix, Pixels]:
    low = np.maximum(np.floor(corners.min(axis=0)).astype(int) - margin, 0)
    high = np.ceil(corners.max(axis=0)).astype(int) + margin
    return low.astype(np.float64), gray[low[1] : high[1], low[0] : high[0]].astype(np.float32)


def _ideal(framed: NDArray[np.uint8], cell: int, rim: int) -> Pixels:
    large = np.kron(framed, np.ones((cell, cell), dtype=np.uint8))
    cut = slice(cell - rim, rim - cell)
    return large[cut, cut].astype(np.float32)


def _align_with_look(
    ideal: Pixels, piece: Pixels, homography: Pixels, tone: float | None, last_look: Look | None
) -> _Fit:
    """Find the homography from the ideal marker to a picture together with blur and tone.

    Alignment and estimation of blur and tone alternate, for at most `_ROUNDS`. With a look from the previous picture,
    which still explains this one, a single alignment is enough.
    """
    tones = TONES if tone is None else (tone,)
    starts = [Look(_DEFAULT_SPOT, start_tone) for start_tone in ((LINEAR, SRGB) if tone is None else tones)]
    if last_look is not None:
        starts = [last_look if tone is None else last_look._replace(tone=tone)]
    best = max((_fit(ideal, piece, homography, start) for start in starts), key=lambda fit: fit.likeness)

    look_is_known = last_look is not None
    if last_look is not None and 1.0 - best.likeness <= _UNLIKENESS_RATIO * (1.0 - last_look.likeness):
        return best

    for round_number in range(_ROUNDS):
        spots: Vector = np.asarray(best.look.spot * _NEAR_SPOTS if look_is_known else _SPOTS, dtype=np.float64)
        look = _spot_and_tone(ideal, best.seen, _spread(best.homography, ideal.shape), best.look, tones, spots)
        if tone is None and abs(look.tone) < _LINEAR_BELOW:
            look = look._replace(tone=LINEAR)
        if (last_look is not None or round_number > 1) and _like_last_look(look, best.look):
            break
        best = _fit(ideal, piece, best.homography, look)
        look_is_known = True

    return best._replace(look=best.look._replace(likeness=best.likeness))


def _fit(ideal: Pixels, piece: Pixels, homography: Pixels, look: Look) -> _Fit:
    """Find the homography for a given blur and tone."""
    blurred = _blurred(ideal, look.spot**2 * _spread(homography, ideal.shape))
    model = shown(blurred, _warped(piece, homography, ideal.shape), look.tone)
    likeness, refined = _find_homography(model, piece, homography)
    return _Fit(likeness, refined, model, _warped(piece, refined, ideal.shape), look)


def _find_homography(model: Pixels, piece: Pixels, homography: Pixels) -> tuple[float, Pixels]:
    align: Any = cv2.findTransformECC  # the stub of OpenCV does not allow None for the mask
    likeness, refined = align(model, piece, homography, cv2.MOTION_HOMOGRAPHY, _STOP, None, 1)
    return float(likeness), refined


def _warped(piece: Pixels, homography: Pixels, shape: tuple[int, ...]) -> Pixels:
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return np.asarray(cv2.warpPerspective(piece, homography, shape[::-1], flags=flags), dtype=np.float32)


def _spot_and_tone(
    ideal: Pixels, seen: Pixels, spread: Matrix, look: Look, tones: tuple[float, ...], spots: Vector
) -> Look:
    """Return the blur [pixels] and then the tone that maximise the correlation of the ideal marker with the picture.

    Args:
        ideal: The marker.
        seen: The picture in the frame of the marker.
        spread: Covariance of a spot of one pixel in that frame, shape (2, 2).
        look: Present estimate.
        tones: Tones that are tried; equally spaced.
        spots: Blurs that are tried; each is larger than the one before by the same factor.
    """
    step = max(len(seen) // _FEW, 1)
    samples = np.ascontiguousarray(seen[::step, ::step])

    def blurred(spot: float) -> Pixels:
        return _blurred(ideal, spot**2 * spread)[::step, ::step]

    # The peak is a fractional index into the blurs.
    spot_index = _peak(likenesses([blurred(each) for each in spots], samples, [look.tone]))
    spot = float(spots[0] * (spots[1] / spots[0]) ** spot_index)

    if len(tones) == 1:
        return Look(spot, tones[0])

    # The peak is a fractional index into the tones; only they have known limits.
    tone_index = _peak(likenesses([blurred(spot)], samples, list(tones)))
    tone = tones[0] + (tones[1] - tones[0]) * tone_index
    return Look(spot, float(np.clip(tone, tones[0], tones[-1])))


def _peak(values: Vector) -> float:
    """Return the maximum of the parabola through the largest value and its neighbours, as a fractional index."""
    best = int(np.clip(np.argmax(values), 1, len(values) - 2))
    low, middle, high = values[best - 1 : best + 2]
    curvature = low - 2.0 * middle + high
    return best + (float(np.clip(0.5 * (low - high) / curvature, -1.0, 1.0)) if curvature < 0.0 else 0.0)


def _like_last_look(look: Look, last_look: Look) -> bool:
    similar_spot = abs(look.spot - last_look.spot) < _SPOT_TOLERANCE * last_look.spot
    return similar_spot and abs(look.tone - last_look.tone) < _TONE_TOLERANCE


def _spread(homography: Pixels, shape: tuple[int, ...]) -> Matrix:
    """Return the covariance, at the centre of the ideal marker, of a round spot of one pixel in the picture.

    Raises:
        _TooNarrow: If the marker would be narrower than `_NARROWEST` in the picture.
    """
    middle = np.array([0.5 * (shape[1] - 1), 0.5 * (shape[0] - 1), 1.0])
    x, y = homography[:2] @ middle
    bottom = homography[2] @ middle
    slope = (homography[:2, :2] - np.outer([x, y], homography[2, :2]) / bottom) / bottom

    narrow_side = np.linalg.svd(slope, compute_uv=False)[-1] * min(shape) if np.isfinite(slope).all() else 0.0
    if narrow_side < _NARROWEST:
        raise _TooNarrow
    inverse_slope = np.linalg.inv(slope)
    return np.asarray(inverse_slope @ inverse_slope.T, dtype=np.float64)


def _blurred(picture: Pixels, spread: Matrix) -> Pixels:
    reach = int(np.clip(np.ceil(3.0 * np.sqrt(spread.diagonal().max())), 1, max(picture.shape)))
    x = np.arange(-reach, reach + 1.0)
    y = x[:, None]
    (a, b), (_, c) = np.linalg.inv(spread)
    weights = np.exp(-0.5 * (a * x * x + 2.0 * b * x * y + c * y * y))

    blurred = cv2.filter2D(picture, cv2.CV_32F, weights / weights.sum(), borderType=cv2.BORDER_REPLICATE)
    return np.asarray(blurred, dtype=np.float32)
