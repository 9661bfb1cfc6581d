"""Points in PCD files (ascii, binary, binary_compressed): the fields x, y and z.

The sensor's pose that a file may state (VIEWPOINT) is not applied: points are taken as they stand in the file.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.files.point_records import AXES, claimed, coordinates, records, text_rows

KINDS = {"F": "f", "I": "i", "U": "u"}
SIZES = ("1", "2", "4", "8")
MOST_UNPACKED = 256 * 1024 * 1024  # bytes of compressed points


def pcd_points(data: bytes, what: str) -> NDArray[Any]:
    """Points of a PCD file, shape (n, 3).

    Raises:
        InputError: If it is none, or has no points; one line.
    """
    head, found, rest = data.partition(b"\nDATA ")
    if not found:
        raise InputError(f"{what}: not a PCD file: its header has no line DATA; export it again")

    way, _, body = rest.partition(b"\n")
    lines = [line.split() for line in head.decode("ascii", "replace").splitlines()]
    header = {line[0]: line[1:] for line in lines if line and not line[0].startswith("#")}
    names = header.get("FIELDS", [])
    count = claimed(" ".join(header.get("POINTS", [])), f"{what}: POINTS")
    if missing := [axis for axis in AXES if names.count(axis) != 1]:
        raise InputError(f"{what}: FIELDS needs one '{missing[0]}'; it has {', '.join(names) or 'none'}")

    kind = _record(header, names, what)
    stored = way.strip().decode("ascii", "replace")
    if stored == "ascii":
        places = np.cumsum([0, *(kind[k].shape[0] if kind[k].shape else 1 for k in range(len(names)))])
        rows = text_rows(body, [int(places[names.index(axis)]) for axis in AXES], what, count)
        if len(rows) < count:
            raise InputError(f"{what}: its header claims {count} points, but the file has {len(rows)}; save it again")
        return rows
    if stored == "binary":
        return coordinates(records(body, 0, kind, count, what))
    if stored == "binary_compressed":
        return _columns(body, kind, count, what)
    raise InputError(f"{what}: DATA '{stored[:20]}' is unknown; have ascii, binary, binary_compressed")


def _record(header: dict[str, list[str]], names: list[str], what: str) -> np.dtype[Any]:
    """The type of one point."""
    sizes = header.get("SIZE", [])
    kinds = header.get("TYPE", [])
    counts = header.get("COUNT", ["1"] * len(names))
    if not len(names) == len(sizes) == len(kinds) == len(counts):
        raise InputError(f"{what}: FIELDS, SIZE, TYPE and COUNT must have as many entries each")

    known = all(
        size in SIZES and kind in KINDS and (kind, size) != ("F", "1") for size, kind in zip(sizes, kinds, strict=True)
    )
    if not known or not all(count.isdigit() and 0 < int(count) < 10_000 for count in counts):
        raise InputError(f"{what}: SIZE, TYPE or COUNT has an entry that is unknown; export it again")

    fields = []
    for k, (name, size, kind, many) in enumerate(zip(names, sizes, kinds, counts, strict=True)):
        own = f"<{KINDS[kind]}{size}"
        fields.append((name, own) if name in AXES else (f"{k} {name}", own, (int(many),)))
    return np.dtype(fields)


def _columns(body: bytes, kind: np.dtype[Any], count: int, what: str) -> NDArray[Any]:
    """The points of compressed data: all x, then all y, ..."""
    if len(body) < 8:
        raise InputError(f"{what}: the compressed points are missing; save it again")
    packed, size = (int.from_bytes(body[k : k + 4], "little") for k in (0, 4))
    if size != count * kind.itemsize or packed > len(body) - 8:
        raise InputError(f"{what}: its header claims {count} points, which the compressed data are not; save it again")
    if size > MOST_UNPACKED:
        raise InputError(f"{what}: {size >> 20} MiB of compressed points, more than is read; save it as DATA binary")

    plain = unpacked(body[8 : 8 + packed], size, what)
    assert kind.names is not None

    points = np.empty((count, len(AXES)))
    begin = 0
    for name in kind.names:
        if name in AXES:
            points[:, AXES.index(name)] = np.frombuffer(plain, kind[name], count, begin)
        begin += count * kind[name].itemsize
    return points


def unpacked(packed: bytes, size: int, what: str) -> bytes:
    """Bytes out of Lehmann's LZF: runs of bytes, and copies of what came before.

    Raises:
        InputError: If they are damaged.
    """
    plain = bytearray()
    place = 0
    try:
        while place < len(packed):
            control = packed[place]
            place += 1
            # As many bytes as this says follow as they are.
            if control < 32:
                plain += packed[place : place + control + 1]
                place += control + 1
                continue

            # Or it is a copy: of how many bytes, and from how far back.
            count = control >> 5
            if count == 7:
                count += packed[place]
                place += 1

            begin = len(plain) - ((control & 31) << 8) - packed[place] - 1
            place += 1
            if begin < 0:
                raise IndexError
            end = begin + count + 2
            if end <= len(plain):
                plain += plain[begin:end]
            else:  # it goes on with what it has just copied
                for k in range(begin, end):
                    plain.append(plain[k])
    except IndexError:
        raise InputError(f"{what}: the compressed points are damaged; save it again") from None

    if len(plain) != size:
        raise InputError(f"{what}: the compressed points are damaged; save it again")
    return bytes(plain)
