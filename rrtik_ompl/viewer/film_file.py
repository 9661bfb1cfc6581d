"""Files of films: one appears only when it is complete; WebM is written here, as OpenCV writes no silent one."""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from rrtik_ompl.base.errors import InputError

ROOM_BYTES = 65536
MILLISECOND = 1_000_000  # [ns]
KEY_FRAME = 0x80


@contextmanager
def whole_film(target: Path) -> Iterator[Path]:
    """Yield the name of a file to write to, which replaces the target if the block ends without an error.

    Raises:
        InputError: If the file cannot be written, or there is no room on the disk, which OpenCV's writer does not say.
    """
    unfinished = target.with_name(f".{target.stem}.unfinished{target.suffix}")
    try:
        yield unfinished
        if not _has_room_to_grow(unfinished):
            raise InputError(f"{target}: cannot be written whole; is there room on the disk?")
        os.replace(unfinished, target)
    except OSError as error:
        raise InputError(f"{target}: cannot be written: {error.strerror or error}") from None
    finally:
        unfinished.unlink(missing_ok=True)


def _has_room_to_grow(file: Path) -> bool:
    """Check whether a file can still grow: on a full disk a film may lack nothing but its index."""
    size = file.stat().st_size
    try:
        with open(file, "ab", buffering=0) as film:
            return film.write(bytes(ROOM_BYTES)) == ROOM_BYTES
    except OSError:
        return False
    finally:
        os.truncate(file, size)


def webm(pictures: Sequence[tuple[bool, bytes]], rate: float, size: tuple[int, int]) -> bytes:
    """Return a WebM file of pictures that VP9 has encoded.

    Source: RFC 8794 (EBML) and RFC 9559 (Matroska), of which WebM is a part.

    Args:
        pictures: Whether each is a whole one, of which the first must be, and its bytes.
        rate: Pictures a second.
        size: Width and height [px].
    """
    header = _group(
        0x1A45DFA3,
        *(_number(name, value) for name, value in ((0x4286, 1), (0x42F7, 1), (0x42F2, 4), (0x42F3, 8))),
        _element(0x4282, b"webm"),
        _number(0x4287, 4),
        _number(0x4285, 2),
    )
    length = _element(0x4489, struct.pack(">d", 1e3 * len(pictures) / rate))
    programs = [_element(name, b"rrtik-ompl") for name in (0x4D80, 0x5741)]
    about = _group(0x1549A966, _number(0x2AD7B1, MILLISECOND), length, *programs)

    video = _group(0xE0, _number(0xB0, size[0]), _number(0xBA, size[1]))
    spacing = _number(0x23E383, round(1e9 / rate))
    track = [_number(0xD7, 1), _number(0x73C5, 1), _number(0x83, 1), _element(0x86, b"V_VP9"), spacing, video]
    tracks = _group(0x1654AE6B, _group(0xAE, *track))

    # Each whole picture begins a cluster, at which a player can begin; the cues say where they are.
    begins = [k for k, (whole, _) in enumerate(pictures) if whole]
    ends = [*begins[1:], len(pictures)]
    clusters = [_cluster(pictures[a:b], a, rate) for a, b in zip(begins, ends, strict=True)]
    places = [len(about) + len(tracks) + sum(map(len, clusters[:k])) for k in range(len(clusters))]
    cues = [
        _group(0xBB, _number(0xB3, _stamp(first, rate)), _group(0xB7, _number(0xF7, 1), _number(0xF1, place)))
        for first, place in zip(begins, places, strict=True)
    ]
    return header + _group(0x18538067, about, tracks, *clusters, _group(0x1C53BB6B, *cues))


def _cluster(pictures: Sequence[tuple[bool, bytes]], first: int, rate: float) -> bytes:
    """Return pictures that follow a whole one, which is the ``first`` of the film by number."""
    begin = _stamp(first, rate)
    blocks = []
    for k, (whole, data) in enumerate(pictures, start=first):
        head = struct.pack(">BhB", 0x81, _stamp(k, rate) - begin, KEY_FRAME if whole else 0)
        blocks.append(_element(0xA3, head + data))
    return _group(0x1F43B675, _number(0xE7, begin), *blocks)


def _stamp(number: int, rate: float) -> int:
    """Return the time of a picture [ms]."""
    return round(1e3 * number / rate)


def _group(name: int, *parts: bytes) -> bytes:
    return _element(name, b"".join(parts))


def _number(name: int, value: int) -> bytes:
    return _element(name, value.to_bytes(8, "big"))


def _element(name: int, data: bytes) -> bytes:
    """Return an element: its name, its length in eight bytes, and its content."""
    return name.to_bytes((name.bit_length() + 7) // 8, "big") + (len(data) | 1 << 56).to_bytes(8, "big") + data
