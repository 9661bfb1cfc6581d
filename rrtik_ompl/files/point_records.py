"""Numbers out of the bytes of files: records of a stated type, as many as a header claims, if they are there."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.errors import InputError

AXES = ("x", "y", "z")
LONGEST_LINE = 4 * 1024 * 1024  # bytes, that are surely read; a line takes ten times its size in memory


def claimed(text: str, what: str) -> int:
    """A number of points that a header claims.

    Raises:
        InputError: If it is no whole number of at least 0.
    """
    if not text.isascii() or not text.isdigit() or len(text) > 18:
        raise InputError(f"{what}: expected a number of points, got '{text[:20]}'")
    return int(text)


def records(data: bytes, offset: int, kind: np.dtype[Any], count: int, what: str) -> NDArray[Any]:
    """Records from a place on, shape (count,), without a copy.

    Raises:
        InputError: If the file is too short for so many.
    """
    room = max(0, len(data) - offset) // max(1, kind.itemsize)
    if count > room:
        raise InputError(f"{what}: its header claims {count} points, but the file has room for {room}; save it again")
    return np.frombuffer(data, dtype=kind, count=count, offset=offset)


def npy_rows(data: bytes, what: str, columns: int | None = None) -> NDArray[Any]:
    """The array of a .npy file of numpy, shape (n, columns); any number of columns if None.

    Raises:
        InputError: If it is none, its shape is another one, or the file is too short for what its header claims.
    """
    stream = io.BytesIO(data)
    try:
        version = np.lib.format.read_magic(stream)
        read = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}[version]
        shape, columnwise, kind = read(stream)
    except (ValueError, KeyError) as error:
        raise InputError(f"{what}: not a .npy file of numpy: {str(error).splitlines()[0]}") from None

    if kind.kind not in "fiu" or len(shape) != 2 or columns not in (None, shape[1]):
        wanted = f"(any, {'any' if columns is None else columns})"
        raise InputError(f"{what}: expected numbers of shape {wanted}, got {kind} of shape {shape}")

    if not columnwise:
        return records(data, stream.tell(), np.dtype((kind, (shape[1],))), shape[0], what)
    return records(data, stream.tell(), kind, shape[1] * shape[0], what).reshape(shape[::-1]).T


def text_rows(data: bytes, columns: Sequence[int] | None, what: str, most: int | None = None) -> NDArray[np.float64]:
    """Columns of rows of numbers in a text, shape (n, len(columns)); all of them if None.

    Raises:
        InputError: If a row is too short, too long, or has something else.
    """
    for begin in range(0, len(data) - LONGEST_LINE, LONGEST_LINE):
        end = begin + LONGEST_LINE
        if data.find(b"\n", begin, end) < 0 and data.find(b"\r", begin, end) < 0:
            most = LONGEST_LINE // 2**20
            raise InputError(f"{what}: not rows of numbers: a line is longer than {most} MiB, the most that is read")

    plain = data.replace(b",", b" ") if b"," in data else data
    if not plain or plain.isspace():
        return np.zeros((0, len(columns or ())))

    lines = io.TextIOWrapper(io.BytesIO(plain), "ascii", errors="replace")  # read line by line: all at once take memory
    try:
        rows = np.loadtxt(lines, usecols=columns, ndmin=2, max_rows=most, dtype=np.float64)
    except ValueError as error:
        raise InputError(f"{what}: not rows of numbers: {str(error).splitlines()[0]}") from None
    return rows if columns is None else rows.reshape(-1, len(columns))


def coordinates(rows: NDArray[Any]) -> NDArray[Any]:
    """The fields x, y and z of records as rows, shape (n, 3)."""
    kind = np.float64 if any(rows.dtype[axis].itemsize > 4 for axis in AXES) else np.float32
    points = np.empty((len(rows), len(AXES)), dtype=kind)
    for k, axis in enumerate(AXES):
        points[:, k] = rows[axis]
    return points
