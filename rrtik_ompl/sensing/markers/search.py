"""Search a picture for square markers: quickly where they are clear, and more closely for those that are missing.

OpenCV's detector sees clear markers of the whole picture in milliseconds. Faint, blurred and small ones need wide
threshold windows, even contrast, or an enlarged picture, which take dozens of times as long. So what is still missing
is searched for at its last place first, then in the whole picture, reduced if it is large, and then closely in those
parts whose contrast exceeds the noise. The work is bounded by a number of pixels, so the same picture gives the same
result on every computer. In a film the parts take turns.

What takes most of the time are the outlines of texture, about 10 ms for a million pixels and a threshold window. So
large pictures are reduced and searched with one window, unless a thorough search is asked for. Codes are compared with
those that are wanted only: comparing one outline with all 587 of the family 36h11 takes 0.7 ms.
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

# [pixels]; how much of a picture is searched closely: of a single one, of each picture of a film, and of large ones.
BUDGET = 640 * 480
FILM_BUDGET = 320 * 320
LARGE_BUDGET = 128 * 128
# [pixels]; larger pictures are searched quickly in at most 25 ms for 2 million pixels and 60 ms for 12 million.
SMALL = 500_000
# [pixels]; to which they are reduced, but at most by `_MOST_REDUCED`.
_CLEAR = 1_000_000
_MOST_REDUCED = 2.5
# [pixels]; pictures are reduced to less for the search of large markers.
_REDUCED = 600_000
# [pixels]; larger pictures are searched for small markers with one threshold window, reduced with all of them.
_LARGE = 3_000_000
_SINGLE = 13  # [pixels]; that window
_TILE = 320  # [pixels]; side of the parts that take turns,
_SMALL_TILE = 160  # [pixels]; the same in large pictures,
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


class Codes(NamedTuple):
    """Codes that are searched for.

    Attributes:
        dictionary: Their dictionary.
        numbers: Their numbers, sorted; None for all of the dictionary.
    """

    dictionary: str
    numbers: tuple[int, ...] | None = None

    def table(self) -> cv2.aruco.Dictionary:
        """Return them as OpenCV stores them."""
        whole = table_of(self.dictionary)
        if self.numbers is None:
            return whole
        rows = whole.bytesList[list(self.numbers)]
        return cv2.aruco.Dictionary(rows, whole.markerSize, whole.maxCorrectionBits)

    def number(self, row: int) -> int:
        """Return the number of a row of the table."""
        return row if self.numbers is None else self.numbers[row]


def search(
    gray: Gray,
    dictionary: str,
    *,
    wanted: Collection[int] | None = None,
    places: Mapping[int, Matrix] | None = None,
    near: bool = False,
    turn: int = 0,
    thorough: bool = False,
) -> list[Found]:
    """Detect the markers of a dictionary in a grey picture.

    Args:
        gray: Shape (height, width).
        dictionary: One of `DICTIONARIES`.
        wanted: Numbers of the markers that are searched for; None for all.
        places: Corners of markers where they were seen last.
        near: The picture is the next of a film: search only near those places, unless a marker is no longer there; and
            search less of it closely, the part whose turn it is.
        turn: Number of the picture in the film.
        thorough: Search the whole picture closely, however long it takes.
    """
    codes = Codes(dictionary, None if wanted is None else tuple(sorted(set(wanted))))
    last = {number: place for number, place in (places or {}).items() if wanted is None or number in wanted}
    large = gray.size > SMALL and not thorough
    found = [marker for number in last for marker in _near(gray, dictionary, number, last[number])] if near else []
    if not near or len(found) < max(len(last), 1):
        found = _joined(found, _quick_reduced(gray, codes) if large else quick(gray, codes))

    def missing() -> bool:
        return wanted is None or not {marker.number for marker in found}.issuperset(wanted)

    if missing():
        budget = _budget(gray, large, near, thorough)
        for area, more in _closer(gray, codes, found, last, large, near, turn):
            found = _joined(found, more, copies=wanted is None)
            budget -= area
            if budget <= 0 or not missing():
                break

    return sorted(found, key=lambda marker: marker.number)


def _budget(gray: Gray, large: bool, near: bool, thorough: bool) -> int:
    """Return how many pixels are searched closely."""
    if thorough:
        return 4 * gray.size
    if large:
        return LARGE_BUDGET
    return FILM_BUDGET if near else BUDGET


def _joined(found: Sequence[Found], more: Sequence[Found], copies: bool = False) -> list[Found]:
    """Add markers whose numbers have not been found before; or, with copies, not at the same place."""

    def known(marker: Found) -> bool:
        return any(each.number == marker.number and not (copies and _apart(each, marker)) for each in found)

    return [*found, *(marker for marker in more if not known(marker))]


def _apart(one: Found, other: Found) -> bool:
    """Check whether two markers lie at different places."""
    return float(np.linalg.norm(one.corners.mean(axis=0) - other.corners.mean(axis=0))) > 0.5 * mean_side(one.corners)


def _near(gray: Gray, dictionary: str, number: int, place: Matrix) -> list[Found]:
    """Search for one marker near its last place."""
    left, top, right, bottom = window = _around(gray, place)
    if right <= left or bottom <= top:
        return []
    piece = np.ascontiguousarray(gray[top:bottom, left:right])
    seen = _detected(piece, Codes(dictionary, (number,)), _NEAR_OUTLINE_SHARE)
    return _moved(seen, window) if len(seen) == 1 else []


def quick(gray: Gray, codes: Codes) -> list[Found]:
    """Search the whole picture for clear markers."""
    if gray.size <= _LARGE:
        return _detected(gray, codes, _outline_share(gray))

    half = _reduced(gray, 2)
    found = _scaled(_detected(half, codes, _outline_share(half)), 0.5)
    return _joined(_detected(gray, codes, _outline_share(gray), single=True), found, copies=codes.numbers is None)


def _quick_reduced(gray: Gray, codes: Codes) -> list[Found]:
    """Search a large picture, reduced, for clear markers with one threshold window."""
    factor = min(max((gray.size / _CLEAR) ** 0.5, 1.0), _MOST_REDUCED)
    size = round(gray.shape[1] / factor), round(gray.shape[0] / factor)
    small = np.asarray(cv2.resize(_reduced(gray, 2 if factor >= 2.0 else 1), size), dtype=np.uint8)
    return _scaled(_detected(small, codes, _outline_share(small), single=True), size[0] / gray.shape[1])


def _closer(
    gray: Gray,
    codes: Codes,
    found: Sequence[Found],
    places: Mapping[int, Matrix],
    large: bool,
    near: bool,
    turn: int,
) -> Iterator[tuple[int, list[Found]]]:
    """Search increasingly closely; each step gives the number of pixels that it searched, and the markers in them."""
    known = {marker.number for marker in found}
    noise = _noise(gray)
    for number, place in places.items():
        left, top, right, bottom = window = _around(gray, place)
        # Markers larger than a part are searched in the whole picture.
        if number not in known and 0 < (right - left) * (bottom - top) <= _TILE**2:
            yield from _close(gray, codes, window, noise)

    shows = _shows_more_than_noise(gray, noise, found)
    if not shows.any():
        return

    # In a film, the whole picture and its parts take turns.
    if not near or turn % 2 == 0:
        yield from _whole(gray, codes, noise, large)
    if not near or turn % 2 == 1:
        for window in _parts(gray, shows, _SMALL_TILE if large else _TILE, turn // 2):
            yield from _close(gray, codes, window, noise)


def _whole(gray: Gray, codes: Codes, noise: float, single: bool) -> Iterator[tuple[int, list[Found]]]:
    """Search the whole picture, reduced if it is large: with wide windows, then with its contrast equalised.

    Args:
        gray: The picture.
        codes: The codes.
        noise: Standard deviation of its noise.
        single: Equalise its contrast at once, and try one threshold window only.
    """
    factor = 1
    while gray.size > _REDUCED * factor**2:
        factor *= 2
    small = _reduced(gray, factor)

    share = _outline_share(small)
    if not single:
        yield 0, _scaled(_detected(small, codes, share, thorough=True), 1.0 / factor)

    calm = np.asarray(cv2.GaussianBlur(small.astype(np.float32), (0, 0), _CALM_WHOLE), dtype=np.float32)
    evened = _evened(calm, noise / factor * _calmed(None))
    yield small.size // 4, _scaled(_detected(evened, codes, share, single=single), 1.0 / factor)


def _close(gray: Gray, codes: Codes, window: Window, noise: float) -> Iterator[tuple[int, list[Found]]]:
    """Search a part of the picture for faint, blurred or small markers, enlarged and with equalised contrast.

    The second attempt also sharpens the picture: blurred markers appear, while faint ones drown in noise.
    """
    left, top, right, bottom = window
    piece = gray[top:bottom, left:right]
    large = _enlarged(piece.astype(np.float32))
    for attempt in range(2):
        evened = _evened(_calm(large, attempt), noise * _calmed(attempt))
        seen = _detected(evened, codes, _ENLARGED * _outline_share(evened))
        yield piece.size // 2, _moved(_scaled(seen, _ENLARGED), window)


def _parts(gray: Gray, shows: NDArray[np.bool_], tile: int, turn: int) -> list[Window]:
    """Return the parts of a picture that show more than noise, each with its surroundings, beginning with the turn's.

    Args:
        gray: The picture.
        shows: Where the reduced picture shows more than noise.
        tile: Side of the parts [pixels].
        turn: Number of the turn.
    """
    rows, columns = np.nonzero(shows)
    height, width = gray.shape
    low = _QUARTER * np.array([columns.min(), rows.min()]) - _OVERLAP // 2
    high = _QUARTER * np.array([columns.max() + 1, rows.max() + 1]) + _OVERLAP // 2
    left, top = np.maximum(low, 0)
    right, bottom = np.minimum(high, [width, height])
    if (right - left) * (bottom - top) <= max(tile**2, BUDGET if tile == _TILE else 0):
        return [(int(left), int(top), int(right), int(bottom))]

    ys = np.arange(int(top), int(bottom), tile - _OVERLAP)
    xs = np.arange(int(left), int(right), tile - _OVERLAP)
    counts = cv2.integral(shows.astype(np.uint8))
    y0, y1 = (np.minimum(y // _QUARTER, shows.shape[0]) for y in (ys, ys + tile))
    x0, x1 = (np.minimum(x // _QUARTER, shows.shape[1]) for x in (xs, xs + tile))
    inside = counts[np.ix_(y1, x1)] - counts[np.ix_(y0, x1)] - counts[np.ix_(y1, x0)] + counts[np.ix_(y0, x0)]
    parts = [
        (int(xs[k]), int(ys[row]), min(int(xs[k]) + tile, width), min(int(ys[row]) + tile, height))
        for row, k in np.argwhere(inside)
    ]
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


def _detected(
    gray: Gray, codes: Codes, outline_share: float, *, thorough: bool = False, single: bool = False
) -> list[Found]:
    """Run OpenCV's detector (`_detector`)."""
    if min(gray.shape) < 8:
        return []
    corners, rows, _ = _detector(codes, outline_share, thorough=thorough, single=single).detectMarkers(gray)
    turned = 2 if is_turned(codes.dictionary) else 0
    return [
        Found(codes.number(int(row)), np.roll(np.reshape(each, (4, 2)).astype(np.float64), turned, axis=0))
        for row, each in zip(() if rows is None else np.ravel(rows), corners, strict=False)
    ]


def _outline_share(picture: Gray) -> float:
    """Return the least perimeter of a marker as a share of the picture's longer side."""
    return _LEAST_PERIMETER / float(max(picture.shape))


@lru_cache(maxsize=256)
def _detector(
    codes: Codes, outline_share: float, *, thorough: bool = False, single: bool = False
) -> cv2.aruco.ArucoDetector:
    """Return OpenCV's detector for some codes.

    Args:
        codes: The codes.
        outline_share: Least perimeter of a marker as a share of the picture's longer side.
        thorough: Try larger threshold windows, and correct more bits.
        single: Try one threshold window only.
    """
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    parameters.minMarkerPerimeterRate = outline_share

    if thorough:
        parameters.adaptiveThreshWinSizeMax = _WIDEST
        parameters.errorCorrectionRate = 1.0 if spare_bits(codes.dictionary) else parameters.errorCorrectionRate
    if single:
        parameters.adaptiveThreshWinSizeMin = parameters.adaptiveThreshWinSizeMax = _SINGLE

    # Otherwise markers that fill half of the picture are lost, although they are fully in view.
    parameters.minDistanceToBorder = 0
    return cv2.aruco.ArucoDetector(codes.table(), parameters)
