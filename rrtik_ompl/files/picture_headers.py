"""Headers of grey pictures: the number of bits of their values, and the value that stands for missing data."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.errors import InputError

PNG = b"\x89PNG\r\n\x1a\n"  # signature
PNG_BITS = 24  # offset of the number of bits of a sample
PNG_COLOUR = 25  # offset of the colour type
# Tags of TIFF.
BITS = 258
PHOTOMETRIC = 262
GDAL_METADATA = 42112
GDAL_NODATA = 42113
TIFF_SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 11: 4, 12: 8, 16: 8}  # number of bytes of each type of value
MOST_TAGS = 4096


@dataclass(frozen=True)
class PictureHeader:
    """Data of a header that readers of pictures do not report.

    Attributes:
        most: The largest possible value of the file if the reader stretches it to 255; None if it does not.
        nodata: The value that stands for missing data; None if there is none.
    """

    most: int | None = None
    nodata: float | None = None


def picture_header(data: bytes, what: str) -> PictureHeader:
    """Read the header of a picture of heights.

    Raises:
        InputError: If its values are not heights: a bitmap, a picture whose white is 0, or one with a scale or offset.
    """
    if data.startswith(PNG) and len(data) > PNG_COLOUR:
        bits = data[PNG_BITS]
        grey = data[PNG_COLOUR] == 0
        return PictureHeader(most=2**bits - 1 if grey and bits < 8 else None)
    if data[:2] in (b"P1", b"P4"):
        raise InputError(f"{what}: a bitmap of black and white holds no heights; save it as a grey PNG of 16 bits")
    if data.startswith(b"P2"):
        words = re.sub(rb"#[^\n]*", b" ", data[:4096]).split()
        most = int(words[3]) if len(words) > 3 and words[3].isdigit() else 255
        return PictureHeader(most=most if most < 255 else None)
    if data[:2] in (b"II", b"MM"):
        return _tiff_header(data, what)
    return PictureHeader()


def unstretched(rows: Matrix, header: PictureHeader) -> Matrix:
    """Recover the values of the file from values that a reader has stretched to 255."""
    if header.most is None:
        return rows
    return np.round(rows * (header.most / 255.0))


def _tiff_header(data: bytes, what: str) -> PictureHeader:
    """Read the header of a TIFF file; refuse values that readers would change."""
    tags = dict(_tags(data))
    bits = min(_numbers(tags.get(BITS)), default=1)
    if bits < 8:
        raise InputError(f"{what}: {bits} bits a height are stretched by readers; save it with 8 bits or more")
    if _numbers(tags.get(PHOTOMETRIC))[:1] == [0]:
        raise InputError(f"{what}: a picture whose white is 0 (WhiteIsZero); save it with black as 0")

    for role in re.findall(rb'role="(scale|offset)"[^>]*>([^<]*)<', tags.get(GDAL_METADATA, (0, b""))[1]):
        neutral = 1.0 if role[0] == b"scale" else 0.0
        if (given := _number(role[1])) is not None and given != neutral:
            said = f"{role[0].decode()} of {given:g}"
            raise InputError(f"{what}: its heights have a {said} (GDAL's metadata); save the heights themselves")

    return PictureHeader(nodata=_number(tags.get(GDAL_NODATA, (0, b""))[1]))


def _tags(data: bytes) -> Iterator[tuple[int, tuple[int, bytes]]]:
    """Yield number, type and bytes of each tag of the first picture of a TIFF file; stop at damaged data."""
    order = "<" if data[:2] == b"II" else ">"
    try:
        (magic,) = struct.unpack_from(f"{order}H", data, 2)
        big = magic == 43
        (at,) = struct.unpack_from(f"{order}{'Q' if big else 'I'}", data, 8 if big else 4)
        (count,) = struct.unpack_from(f"{order}{'Q' if big else 'H'}", data, at)
        at += 8 if big else 2

        for _ in range(min(count, MOST_TAGS)):
            tag, kind, values = struct.unpack_from(f"{order}HH{'Q' if big else 'I'}", data, at)
            inline, size = (8, 20) if big else (4, 12)
            length = TIFF_SIZES.get(kind, 1) * values
            place = at + size - inline
            if length > inline:
                (place,) = struct.unpack_from(f"{order}{'Q' if big else 'I'}", data, place)
            found = data[place : place + length]
            # Numbers of two bytes are converted to little-endian; other numbers are not used.
            short = kind == 3 and order == ">"
            yield tag, (kind, np.frombuffer(found, dtype=">u2").astype("<u2").tobytes() if short else found)
            at += size
    except (struct.error, ValueError):
        return


def _numbers(tag: tuple[int, bytes] | None) -> list[int]:
    """Return the values of a tag with two-byte numbers; an empty list for other tags."""
    if tag is None or tag[0] != 3:
        return []
    return [int(value) for value in np.frombuffer(tag[1][: len(tag[1]) // 2 * 2], dtype="<u2")]


def _number(text: bytes) -> float | None:
    """Return the finite number in a text; None if there is none."""
    try:
        value = float(text.split(b"\0")[0].strip() or b"nan")
    except ValueError:
        return None
    return value if np.isfinite(value) else None
