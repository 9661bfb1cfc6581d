"""Points out of the bytes of files: records of a stated type, as many as a header claims, if they are there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.errors import InputError

AXES = ("x", "y", "z")


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


def text_rows(data: bytes, columns: Sequence[int], what: str, most: int | None = None) -> NDArray[np.float64]:
    """Columns of rows of numbers in a text, shape (n, len(columns)).

    Raises:
        InputError: If a row is too short or has something else.
    """
    lines = data.decode("ascii", "replace").replace(",", " ").splitlines()
    try:
        rows = np.loadtxt(lines, usecols=columns, ndmin=2, max_rows=most, dtype=np.float64)
    except ValueError as error:
        raise InputError(f"{what}: not rows of numbers: {str(error).splitlines()[0]}") from None
    return rows.reshape(-1, len(columns))


def coordinates(rows: NDArray[Any]) -> NDArray[Any]:
    """The fields x, y and z of records as rows, shape (n, 3)."""
    kind = np.float64 if any(rows.dtype[axis].itemsize > 4 for axis in AXES) else np.float32
    points = np.empty((len(rows), len(AXES)), dtype=kind)
    for k, axis in enumerate(AXES):
        points[:, k] = rows[axis]
    return points
