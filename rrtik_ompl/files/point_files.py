"""Readers of points and rows of numbers from the bytes of text, .npy, PLY and PCD files.

From a PLY file (text, little- or big-endian) the element ``vertex`` is read, from a PCD file (ascii, binary,
binary_compressed) the fields x, y and z. The pose of the sensor that a PCD file may state (VIEWPOINT) is not applied. A
file must have as many points as its header claims.
"""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Sequence
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.errors import CloudWarning, InputError

AXES = ("x", "y", "z")
LONGEST_LINE = 4 * 1024 * 1024  # [bytes] lines up to this length are read; a line takes ten times its size in memory
PLY_TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4"}
PLY_TYPES |= {"double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"}
PLY_TYPES |= {"float32": "f4", "float64": "f8"}
PLY_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
PLY_END = b"end_header"
PCD_KINDS = {"F": "f", "I": "i", "U": "u"}
PCD_SIZES = ("1", "2", "4", "8")
MOST_UNPACKED = 256 * 1024 * 1024  # [bytes] largest size of compressed points after unpacking


def claimed(text: str, what: str) -> int:
    """Parse the number of points that a header claims.

    Raises:
        InputError: If it is not a whole number of at least 0.
    """
    if not text.isascii() or not text.isdigit() or len(text) > 18:
        raise InputError(f"{what}: expected a number of points, got '{text[:20]}'")
    return int(text)


def records(
    data: bytes, offset: int, kind: np.dtype[Any], count: int, what: str, things: str = "points"
) -> NDArray[Any]:
    """Return ``count`` records of a file from a byte offset on, shape (count,), without copying.

    Raises:
        InputError: If the file is too short for them.
    """
    most = max(0, len(data) - offset) // max(1, kind.itemsize)
    if count > most:
        raise InputError(f"{what}: its header claims {count} {things}, but the file has room for {most}; save it again")
    return np.frombuffer(data, dtype=kind, count=count, offset=offset)


def npy_rows(data: bytes, what: str) -> NDArray[Any]:
    """Read the array of a .npy file of numpy, shape (n, any), without copying.

    Raises:
        InputError: If it is not such a file, its shape is another one, or it is shorter than its header claims.
    """
    rows = _npy_numbers(data, what)
    if rows.ndim != 2:
        raise InputError(f"{what}: expected numbers of shape (any, any), got {rows.dtype} of shape {rows.shape}")
    return rows


def npy_points(data: bytes, what: str) -> NDArray[Any]:
    """Read the points of a .npy file of numpy, shape (n, 3), without copying; organised ones row by row.

    Raises:
        InputError: As :func:`npy_rows`.
    """
    rows = _npy_numbers(data, what)
    columns = rows.shape[-1]
    if columns < len(AXES):
        wanted = "(any, 3) or (rows, columns, 3)"
        raise InputError(f"{what}: expected numbers of shape {wanted}, got {rows.dtype} of shape {rows.shape}")
    if columns > len(AXES):
        told = f"{what}: the first three of its {columns} columns are taken for x, y and z"
        warnings.warn(told, CloudWarning, stacklevel=4)
    return rows.reshape(-1, columns)[:, : len(AXES)]


def _npy_numbers(data: bytes, what: str) -> NDArray[Any]:
    """Read the array of a .npy file of numpy, of any shape."""
    stream = io.BytesIO(data)
    try:
        version = np.lib.format.read_magic(stream)
        read = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}[version]
        shape, columnwise, kind = read(stream)
    except (ValueError, KeyError) as error:
        raise InputError(f"{what}: not a .npy file of numpy: {str(error).splitlines()[0]}") from None

    if kind.kind not in "fiu" or len(shape) not in (2, 3):
        raise InputError(f"{what}: expected numbers of shape (any, any), got {kind} of shape {shape}")

    if columnwise:
        return records(data, stream.tell(), kind, prod(shape), what).reshape(shape[::-1]).T
    return records(data, stream.tell(), np.dtype((kind, shape[-1:])), prod(shape[:-1]), what).reshape(shape)


def text_rows(data: bytes, columns: Sequence[int] | None, what: str, most: int | None = None) -> NDArray[np.float64]:
    """Read columns of rows of numbers from a text, shape (n, len(columns)).

    Args:
        data: The text, with blanks or commas between numbers.
        columns: Indices of the columns; None for all.
        what: Name of the file, for messages.
        most: Largest number of rows to read; None for all.

    Raises:
        InputError: If a row is too short or too long, or contains other things than numbers.
    """
    for begin in range(0, len(data) - LONGEST_LINE, LONGEST_LINE):
        end = begin + LONGEST_LINE
        if data.find(b"\n", begin, end) < 0 and data.find(b"\r", begin, end) < 0:
            most = LONGEST_LINE // 2**20
            raise InputError(f"{what}: not rows of numbers: a line is longer than {most} MiB, the most that is read")

    plain = data.replace(b",", b" ") if b"," in data else data
    if not plain or plain.isspace():
        return np.zeros((0, len(columns or ())))

    # Lines are read one by one, as a list of all of them would take much memory.
    lines = io.TextIOWrapper(io.BytesIO(plain), "ascii", errors="replace")
    try:
        rows = np.loadtxt(lines, usecols=columns, ndmin=2, max_rows=most, dtype=np.float64)
    except ValueError as error:
        raise InputError(f"{what}: not rows of numbers: {str(error).splitlines()[0]}") from None
    return rows if columns is None else rows.reshape(-1, len(columns))


def coordinates(rows: NDArray[Any]) -> NDArray[Any]:
    """Return the fields x, y and z of records as rows, shape (n, 3), in float32 unless a field is wider."""
    kind = np.float64 if any(rows.dtype[axis].itemsize > 4 for axis in AXES) else np.float32
    points = np.empty((len(rows), len(AXES)), dtype=kind)
    for k, axis in enumerate(AXES):
        points[:, k] = rows[axis]
    return points


def is_ply_mesh(data: bytes) -> bool:
    """Check whether the header of a PLY file announces faces, so that its points are not all there is."""
    return stated_faces(data) > 0


def stated_faces(data: bytes) -> int:
    """Return how many faces the header of a PLY file states; 0 if it states none."""
    stated = re.search(rb"\nelement face (\d+)", data.partition(PLY_END)[0])
    return 0 if stated is None else int(stated[1])


def ply_points(data: bytes, what: str) -> NDArray[Any]:
    """Read the points of a PLY file, shape (n, 3).

    Raises:
        InputError: If it is not a PLY file, or has no points.
    """
    lines, order, begin = _ply_head(data, what)
    fields, claim, before = _vertex(lines, what)
    names = [line[2] for line in fields]
    count = claimed(claim, what)

    if order == "ascii":
        for _ in range(sum(number for number, _ in before)):  # a line for each thing that comes before the points
            begin = data.find(b"\n", begin) + 1 or len(data)
        rows = text_rows(data[begin:], [names.index(axis) for axis in AXES], what, count)
        if len(rows) < count:
            raise InputError(f"{what}: its header claims {count} points, but the file has {len(rows)}; save it again")
        return rows

    kinds = [
        (f"{k} {name}" if name not in AXES else name, PLY_ORDERS[order] + PLY_TYPES[kind])
        for k, (_, kind, name) in enumerate(fields)
    ]
    for number, properties in before:
        if any(line[1] not in PLY_TYPES for line in properties):
            raise InputError(f"{what}: lists stand before its points; export points alone, or as text")
        begin += number * sum(np.dtype(PLY_TYPES[line[1]]).itemsize for line in properties)
    return coordinates(records(data, begin, np.dtype(kinds), count, what))


def _ply_head(data: bytes, what: str) -> tuple[list[list[str]], str, int]:
    """Return the words of each line of the header of a PLY file, its format, and where its body begins [bytes].

    Raises:
        InputError: If it is not a PLY file, or of an unknown format.
    """
    head, found, _ = data.partition(PLY_END)
    if not data.startswith(b"ply") or not found:
        raise InputError(f"{what}: not a PLY file: no header from 'ply' to 'end_header'; export it again")

    begin = data.find(b"\n", len(head)) + 1
    lines = [line.split() for line in head.decode("ascii", "replace").splitlines()]
    order = next((line[1] for line in lines if line[0:1] == ["format"] and len(line) > 1), "")
    if order not in PLY_ORDERS:
        raise InputError(f"{what}: format '{order}' of a PLY file is unknown; have {', '.join(PLY_ORDERS)}")
    return lines, order, begin


def _vertex(lines: list[list[str]], what: str) -> tuple[list[list[str]], str, list[tuple[int, list[list[str]]]]]:
    """Parse the element ``vertex`` of the header of a PLY file.

    Args:
        lines: The words of each line of the header.
        what: Name of the file, for messages.

    Returns:
        The properties, each as the words "property", type and name; the number of points as text; the elements that
        stand before them, each as its number and its properties.
    """
    parts = _elements(lines)
    names = [head[1] for head, _ in parts]
    if "vertex" not in names:
        raise InputError(f"{what}: a PLY file of points needs an element 'vertex'; it has {', '.join(names) or 'none'}")

    place = names.index("vertex")
    head, fields = parts[place]
    before = [(claimed(other[2], what), own) for other, own in parts[:place]]
    if any(len(line) != 3 or line[1] not in PLY_TYPES for line in fields):
        raise InputError(f"{what}: a property of 'vertex' is a list or of an unknown type; export points alone")

    names = [line[2] for line in fields]
    if missing := [axis for axis in AXES if names.count(axis) != 1]:
        raise InputError(f"{what}: 'vertex' needs one property '{missing[0]}'; it has {', '.join(names) or 'none'}")
    return fields, head[2], before


def _elements(lines: list[list[str]]) -> list[tuple[list[str], list[list[str]]]]:
    """Return the elements that the header of a PLY file states: the words of each, and those of its properties."""
    elements = [k for k, line in enumerate(lines) if line[0:1] == ["element"] and len(line) == 3]
    return [
        (lines[k], [line for line in lines[k + 1 : end] if line[0:1] == ["property"]])
        for k, end in zip(elements, [*elements[1:], len(lines)], strict=True)
    ]


def ply_mesh(data: bytes, what: str) -> tuple[NDArray[Any], list[NDArray[Any]]]:
    """Read the vertices, shape (n, 3), and the vertex numbers of each face of a PLY file of bytes.

    Raises:
        InputError: If it is not such a file, is cut off, or has no vertices.
    """
    lines, order, place = _ply_head(data, what)
    parts = _elements(lines)
    kinds = {word for _, own in parts for line in own for word in line[1:-1] if word != "list"}
    if order == "ascii" or not kinds <= PLY_TYPES.keys():
        raise InputError(f"{what}: not a PLY file of bytes, or with a property of an unknown type; export it again")

    _vertex(lines, what)
    points = np.empty((0, 3))
    polygons: list[NDArray[Any]] = []
    for (_, name, claim), own in parts:
        number = claimed(claim, what)
        if any(line[1] == "list" for line in own):
            rows, place = _list_rows(data, place, own, PLY_ORDERS[order], number, what)
            polygons += rows if name == "face" else []
            continue

        kind = np.dtype([(line[-1], PLY_ORDERS[order] + PLY_TYPES[line[1]]) for line in own])
        found = records(data, place, kind, number, what)
        place += number * kind.itemsize
        if name == "vertex":
            points = coordinates(found)
    return points, polygons


def _list_rows(
    data: bytes, place: int, properties: list[list[str]], order: str, number: int, what: str
) -> tuple[list[NDArray[Any]], int]:
    """Return the first list of each row of an element of a PLY file, and where the element ends [bytes].

    Args:
        data: The file.
        place: Where the element begins [bytes].
        properties: The words of each of its properties.
        order: Its order of bytes, as numpy writes it.
        number: Its rows.
        what: Name of the file, for messages.
    """
    rows = []
    for _ in range(number):
        lists = []
        for line in properties:
            kind = np.dtype(order + PLY_TYPES[line[-2]])
            count = 1
            if line[1] == "list":
                length = np.dtype(order + PLY_TYPES[line[2]])
                count = int(records(data, place, length, 1, what, "lists")[0])
                place += length.itemsize
                lists.append(records(data, place, kind, max(count, 0), what, "numbers"))
            place += count * kind.itemsize
        if place > len(data):
            raise InputError(f"{what}: it is cut off; save it again")
        rows.append(lists[0])
    return rows, place


def pcd_points(data: bytes, what: str) -> NDArray[Any]:
    """Read the points of a PCD file, shape (n, 3).

    Raises:
        InputError: If it is not a PCD file, or has no points.
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
    """Return the numpy type of one point of a PCD file from its header."""
    sizes = header.get("SIZE", [])
    kinds = header.get("TYPE", [])
    counts = header.get("COUNT", ["1"] * len(names))
    if not len(names) == len(sizes) == len(kinds) == len(counts):
        raise InputError(f"{what}: FIELDS, SIZE, TYPE and COUNT must have as many entries each")

    known = all(
        size in PCD_SIZES and kind in PCD_KINDS and (kind, size) != ("F", "1")
        for size, kind in zip(sizes, kinds, strict=True)
    )
    if not known or not all(count.isdigit() and int(count) < 10_000 for count in counts):
        raise InputError(f"{what}: SIZE, TYPE or COUNT has an entry that is unknown; export it again")

    fields = []
    for k, (name, size, kind, many) in enumerate(zip(names, sizes, kinds, counts, strict=True)):
        own = f"<{PCD_KINDS[kind]}{size}"
        fields.append((name, own) if name in AXES else (f"{k} {name}", own, (int(many),)))
    return np.dtype(fields)


def _columns(body: bytes, kind: np.dtype[Any], count: int, what: str) -> NDArray[Any]:
    """Read the points of compressed data, which contain all x, then all y and so on.

    Args:
        body: The bytes behind the header: two sizes of four bytes each, then the compressed data.
        kind: Type of one point, see :func:`_record`.
        count: Number of points that the header claims.
        what: Name of the file, for messages.

    Returns:
        The points, shape (n, 3).
    """
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
    """Decompress data of Lehmann's LZF format: literal runs of bytes, and copies of earlier output.

    Args:
        packed: The compressed bytes.
        size: Number of bytes after decompression.
        what: Name of the file, for messages.

    Raises:
        InputError: If the data are damaged.
    """
    plain = bytearray()
    place = 0
    try:
        while place < len(packed):
            control = packed[place]
            place += 1
            # A literal run: the next control + 1 bytes are copied as they are.
            if control < 32:
                plain += packed[place : place + control + 1]
                place += control + 1
                continue

            # A copy of earlier output: the control byte holds its length and a part of its distance.
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
            else:  # The copy overlaps its own output, so it is made byte by byte.
                for k in range(begin, end):
                    plain.append(plain[k])
    except IndexError:
        raise InputError(f"{what}: the compressed points are damaged; save it again") from None

    if len(plain) != size:
        raise InputError(f"{what}: the compressed points are damaged; save it again")
    return bytes(plain)
