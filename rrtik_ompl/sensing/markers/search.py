"""Search a picture for square markers: quickly where they are clear, and more closely for those that are missing.

OpenCV's detector sees clear markers of the whole picture in milliseconds. Faint, blurred and small ones need wide
threshold windows, even contrast, or an enlarged picture, which take dozens of times as long. So what is still missing
is searched for at its last place first, then in the whole picture, reduced if it is large, and then closely in those
parts whose contrast exceeds the noise. The work is bounded by a number of pixels, so the same picture gives the same
result on every computer. In a film the parts take turns.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.sensing.markers.alignment import mean_side
from rrtik_ompl.sensing.markers.dictionaries import is_turned, spare_bits, table_of

Gray = NDArray[np.uint8]
Pixels = NDArray[np.float32]
Window = tuple[int, int, int, int]  # left, top, right, bottom [pixels]

# [pixels]; how much of a picture is searched closely: of a single one, and of each picture of a film.
BUDGET = 640 * 480
FILM_BUDGET = 320 * 320
# [pixels]; pictures are reduced to less for the search of large markers.
_REDUCED = 600_000
# [pixels]; larger pictures are searched for small markers with one threshold window, reduced with all of them.
_LARGE = 3_000_000
_SINGLE = 13  # [pixels]; that window
_TILE = 320  # [pixels]; side of the parts that take turns,
_OVERLAP = 64  # [pixels]; and what neighbouring ones share
_LEAST_PERIMETER = 24.0  # [pixels]; of a marker in the picture that is searched
# [pixels]; largest threshold window of the thorough detector, which also corrects as many bits as the code allows.
# OpenCV's default is 23.
_WIDEST = 53
# How far a marker may have moved since the previous picture, in sides and in pixels.
_NEAR_SIDES = 1.0
_NEAR_PIXELS = 16
_NEAR_OUTLINE_SHARE = 0.5  # share of the longer side of that window; smaller outlines are noise

_ENLARGED = 2.0  # scale of the picture in a close search
# [enlarged pixels]; standard deviation of the blur against noise in the first and second attempt of a close search.
_CALM = 1.0, 1.4
# Sharpening of the second attempt: factor of the detail that is added, and its size [enlarged pixels].
_SHARPENED = 8.0
_EDGE = 3.0
_CALM_WHOLE = 0.7  # [pixels]; the blur against noise where the whole picture is evened
_AROUND = 21  # side of the window in which brightness and contrast are equalised, in fours of pixels
_FAINT = 1.5  # grey values; smaller contrast is noise
_CONTRAST = 60.0  # grey values to which the standard deviation in a window is scaled
_NOISE_ALONE = 1.4  # a contrast smaller than this multiple of the noise shows no marker
_QUARTER = 4  # factor by which a picture is reduced to find the parts that show more than noise
_PART = 9  # [reduced pixels]; side of the window in which contrast is compared with noise
_ROUNDED = 0.3  # grey values; noise of rounding
_MIDDLE = 0.6745 * 6.0**0.5  # median of the absolute second difference of white noise of unit deviation


class Found(NamedTuple):
    """A marker that the detector has found.

    Attributes:
        number: Its number in the dictionary.
        corners: Top left, top right, bottom right, bottom left as printed, shape (4, 2) [pixels].
    """

    number: int
    corners: Matrix


def search(
    gray: Gray,
    dictionary: str,
    *,
    wanted: Collection[int] | None = None,
    places: Mapping[int, Matrix] | None = None,
    near: bool = False,
    turn: int = 0,
) -> list[Found]:
    """Detect the markers of a dictionary in a grey picture.

    Args:
        gray: Shape (height, width).
        dictionary: One of `DICTIONARIES`.
        wanted: Numbers of the markers that are searched for closely if they are missing; None for all.
        places: Corners of markers where they were seen last.
        near: The picture is the next of a film: search only near those places, unless a marker is no longer there; and
            search less of it closely, the part whose turn it is.
        turn: Number of the picture in the film.
    """
    last = places or {}
    found = [marker for number in last for marker in _near(gray, dictionary, number, last[number])] if near else []
    if not near or len(found) < max(len(last), 1):
        found = _joined(found, quick(gray, dictionary))

    def missing() -> bool:
        return wanted is None or not {marker.number for marker in found}.issuperset(wanted)

    if missing():
        budget = FILM_BUDGET if near else BUDGET
        for area, more in _closer(gray, dictionary, found, last, near, turn):
            found = _joined(found, more if wanted is None else [each for each in more if each.number in wanted])
            budget -= area
            if budget <= 0 or not missing():
                break

    return sorted(found, key=lambda marker: marker.number)


def _joined(found: Sequence[Found], more: Sequence[Found]) -> list[Found]:
    """Add markers whose numbers have not been found before."""
    known = {marker.number for marker in found}
    return [*found, *(marker for marker in more if marker.number not in known)]


def _near(gray: Gray, dictionary: str, number: int, place: Matrix) -> list[Found]:
    """Search for one marker near its last place."""
    left, top, right, bottom = window = _around(gray, place)
    if right <= left or bottom <= top:
        return []
    piece = np.ascontiguousarray(gray[top:bottom, left:right])
    seen = _detected(piece, dictionary, _detector(dictionary, _NEAR_OUTLINE_SHARE))
    matching = [each for each in seen if each.number == number]
    return _moved(matching, window) if len(matching) == 1 else []


def quick(gray: Gray, dictionary: str) -> list[Found]:
    """Search the whole picture for clear markers."""
    if gray.size <= _LARGE:
        return _detected(gray, dictionary, _detector(dictionary, _outline_share(gray)))

    half = _reduced(gray, 2)
    found = _scaled(_detected(half, dictionary, _detector(dictionary, _outline_share(half))), 0.5)
    small = _detected(gray, dictionary, _detector(dictionary, _outline_share(gray), single=True))
    return _joined(small, found)


def _closer(
    gray: Gray, dictionary: str, found: Sequence[Found], places: Mapping[int, Matrix], near: bool, turn: int
) -> Iterator[tuple[int, list[Found]]]:
    """Search increasingly closely; each step gives the number of pixels that it searched, and the markers in them."""
    known = {marker.number for marker in found}
    noise = _noise(gray)
    for number, place in places.items():
        left, top, right, bottom = window = _around(gray, place)
        # Markers larger than a part are searched in the whole picture.
        if number not in known and 0 < (right - left) * (bottom - top) <= _TILE**2:
            yield from _close(gray, dictionary, window, noise)

    shows = _shows_more_than_noise(gray, noise, found)
    if not shows.any():
        return

    # In a film, the whole picture and its parts take turns.
    if not near or turn % 2 == 0:
        yield from _whole(gray, dictionary, noise)
    if not near or turn % 2 == 1:
        for window in _parts(gray, shows, turn // 2):
            yield from _close(gray, dictionary, window, noise)


def _whole(gray: Gray, dictionary: str, noise: float) -> Iterator[tuple[int, list[Found]]]:
    """Search the whole picture, reduced if it is large: with wide windows, then with its contrast equalised."""
    factor = 1
    while gray.size > _REDUCED * factor**2:
        factor *= 2
    small = _reduced(gray, factor)

    share = _outline_share(small)
    yield 0, _scaled(_detected(small, dictionary, _detector(dictionary, share, thorough=True)), 1.0 / factor)

    calm = np.asarray(cv2.GaussianBlur(small.astype(np.float32), (0, 0), _CALM_WHOLE), dtype=np.float32)
    evened = _evened(calm, noise / factor * _calmed(None))
    yield small.size // 4, _scaled(_detected(evened, dictionary, _detector(dictionary, share)), 1.0 / factor)


def _close(gray: Gray, dictionary: str, window: Window, noise: float) -> Iterator[tuple[int, list[Found]]]:
    """Search a part of the picture for faint, blurred or small markers, enlarged and with equalised contrast.

    The second attempt also sharpens the picture: blurred markers appear, while faint ones drown in noise.
    """
    left, top, right, bottom = window
    piece = gray[top:bottom, left:right]
    large = _enlarged(piece.astype(np.float32))
    for attempt in range(2):
        evened = _evened(_calm(large, attempt), noise * _calmed(attempt))
        seen = _detected(evened, dictionary, _detector(dictionary, _ENLARGED * _outline_share(evened)))
        yield piece.size // 2, _moved(_scaled(seen, _ENLARGED), window)


def _parts(gray: Gray, shows: NDArray[np.bool_], turn: int) -> list[Window]:
    """Return the parts of a picture that show more than noise, each with its surroundings, beginning with the turn's.

    Args:
        gray: The picture.
        shows: Where the reduced picture shows more than noise.
        turn: Number of the turn.
    """
    rows, columns = np.nonzero(shows)
    height, width = gray.shape
    low = _QUARTER * np.array([columns.min(), rows.min()]) - _OVERLAP // 2
    high = _QUARTER * np.array([columns.max() + 1, rows.max() + 1]) + _OVERLAP // 2
    left, top = np.maximum(low, 0)
    right, bottom = np.minimum(high, [width, height])
    if (right - left) * (bottom - top) <= BUDGET:
        return [(int(left), int(top), int(right), int(bottom))]

    parts = []
    for y in range(int(top), int(bottom), _TILE - _OVERLAP):
        for x in range(int(left), int(right), _TILE - _OVERLAP):
            inside = shows[y // _QUARTER : (y + _TILE) // _QUARTER, x // _QUARTER : (x + _TILE) // _QUARTER]
            if inside.any():
                parts.append((x, y, min(x + _TILE, width), min(y + _TILE, height)))

    begin = turn % len(parts)
    return parts[begin:] + parts[:begin]


def _shows_more_than_noise(gray: Gray, noise: float, found: Sequence[Found]) -> NDArray[np.bool_]:
    """Return where a picture, reduced by `_QUARTER`, has more contrast than its noise and shows no known marker."""
    quarter = _reduced(gray, _QUARTER).astype(np.float32)
    mean = cv2.boxFilter(quarter, -1, (_PART, _PART))
    variance = cv2.boxFilter(quarter * quarter, -1, (_PART, _PART)) - mean * mean
    quiet = _NOISE_ALONE * float(np.hypot(noise / _QUARTER, _ROUNDED))
    shows = (variance > quiet**2).astype(np.uint8)

    for marker in found:
        middle = marker.corners.mean(axis=0)
        outline = (middle + 1.5 * (marker.corners - middle)) / _QUARTER
        cv2.fillConvexPoly(shows, np.rint(outline).astype(np.int32), 0)
    return shows > 0


def _noise(gray: Gray) -> float:
    """Return the standard deviation of the noise of a picture, from the second differences in some of its rows."""
    rows = gray[:: max(gray.shape[0] // 128, 1)].astype(np.int16)
    second = np.abs(2 * rows[:, 1:-1] - rows[:, :-2] - rows[:, 2:])
    # The median of whole numbers: interpolated within the bin, as differences of quiet pictures are 0, 1 or 2.
    shares = np.cumsum(np.bincount(second.ravel())) / max(second.size, 1)
    bin_number = int(np.searchsorted(shares, 0.5))
    below = shares[bin_number - 1] if bin_number else 0.0
    middle = bin_number - 0.5 + (0.5 - below) / max(shares[bin_number] - below, 1e-9)
    return max(float(middle), 0.0) / _MIDDLE


def _reduced(gray: Gray, factor: int) -> Gray:
    """Reduce a picture by a power of two."""
    while factor > 1:
        gray = np.asarray(cv2.resize(gray, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA), dtype=np.uint8)
        factor //= 2
    return gray


def _enlarged(piece: Pixels) -> Pixels:
    large = cv2.resize(piece, None, fx=_ENLARGED, fy=_ENLARGED, interpolation=cv2.INTER_CUBIC)
    return np.asarray(large, dtype=np.float32)


def _calm(large: Pixels, attempt: int) -> Pixels:
    """Blur an enlarged picture against noise; the second attempt sharpens it afterwards."""
    calm = np.asarray(cv2.GaussianBlur(large, (0, 0), _CALM[attempt]), dtype=np.float32)
    if attempt == 0:
        return calm
    blurred = cv2.GaussianBlur(calm, (0, 0), _EDGE)
    return np.asarray(cv2.addWeighted(calm, 1.0 + _SHARPENED, blurred, -_SHARPENED, 0.0), dtype=np.float32)


@lru_cache
def _calmed(attempt: int | None) -> float:
    """Return the share of white noise that `_calm` leaves, or that is left where the whole picture is evened."""
    noise = np.random.default_rng(0).normal(0.0, 1.0, (256, 256)).astype(np.float32)
    left = cv2.GaussianBlur(noise, (0, 0), _CALM_WHOLE) if attempt is None else _calm(_enlarged(noise), attempt)
    return float(np.std(left))


def _evened(picture: Pixels, noise: float) -> Gray:
    """Equalise brightness and contrast locally; parts that show nothing but noise become grey."""
    height, width = picture.shape
    small = max(width // _QUARTER, 1), max(height // _QUARTER, 1)
    mean, square = (
        cv2.boxFilter(cv2.resize(each, small, interpolation=cv2.INTER_AREA), -1, (_AROUND, _AROUND))
        for each in (picture, picture * picture)
    )
    deviation = np.sqrt(np.maximum(square - mean * mean, _FAINT**2))
    gain = np.where(deviation > _NOISE_ALONE * noise, _CONTRAST / deviation, 0.0).astype(np.float32)

    centre, scale = (cv2.resize(each, (width, height), interpolation=cv2.INTER_LINEAR) for each in (mean, gain))
    evened: Any = cv2.add  # the stub of OpenCV does not allow numbers
    return np.asarray(evened(cv2.multiply(picture - centre, scale), 128.0, dtype=cv2.CV_8U), dtype=np.uint8)


def _around(gray: Gray, place: Matrix) -> Window:
    """Return the window in which a marker may be that was at a place, shape (4, 2), in the previous picture."""
    margin = int(_NEAR_SIDES * mean_side(place)) + _NEAR_PIXELS
    left, top = np.maximum(np.floor(place.min(axis=0)).astype(int) - margin, 0)
    right, bottom = np.minimum(np.ceil(place.max(axis=0)).astype(int) + margin, gray.shape[::-1])
    return int(left), int(top), int(right), int(bottom)


def _moved(markers: Sequence[Found], window: Window) -> list[Found]:
    return [Found(each.number, each.corners + window[:2]) for each in markers]


def _scaled(markers: Sequence[Found], scale: float) -> list[Found]:
    """Return markers of a picture of that scale with their pixels in the whole one."""
    return [Found(each.number, (each.corners + 0.5) / scale - 0.5) for each in markers]


def _detected(gray: Gray, dictionary: str, by: cv2.aruco.ArucoDetector) -> list[Found]:
    """Run OpenCV's detector."""
    if min(gray.shape) < 8:
        return []
    corners, numbers, _ = by.detectMarkers(gray)
    turned = 2 if is_turned(dictionary) else 0
    return [
        Found(int(number), np.roll(np.reshape(each, (4, 2)).astype(np.float64), turned, axis=0))
        for number, each in zip(() if numbers is None else np.ravel(numbers), corners, strict=False)
    ]


def _outline_share(picture: Gray) -> float:
    """Return the least perimeter of a marker as a share of the picture's longer side."""
    return _LEAST_PERIMETER / float(max(picture.shape))


@lru_cache(maxsize=256)
def _detector(
    dictionary: str, outline_share: float, *, thorough: bool = False, single: bool = False
) -> cv2.aruco.ArucoDetector:
    """Return OpenCV's detector for a dictionary.

    Args:
        dictionary: The dictionary.
        outline_share: Least perimeter of a marker as a share of the picture's longer side.
        thorough: Try larger threshold windows, and correct more bits.
        single: Try one threshold window only.
    """
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    parameters.minMarkerPerimeterRate = outline_share

    if thorough:
        parameters.adaptiveThreshWinSizeMax = _WIDEST
        parameters.errorCorrectionRate = 1.0 if spare_bits(dictionary) else parameters.errorCorrectionRate
    if single:
        parameters.adaptiveThreshWinSizeMin = parameters.adaptiveThreshWinSizeMax = _SINGLE

    # Otherwise markers that fill half of the picture are lost, although they are fully in view.
    parameters.minDistanceToBorder = 0
    return cv2.aruco.ArucoDetector(table_of(dictionary), parameters)
