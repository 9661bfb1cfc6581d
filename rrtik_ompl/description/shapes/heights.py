"""Read files of heights as `shapes.HeightField`: arrays, tables of numbers, pictures."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import finite_number, positive
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.files.picture_headers import picture_header, unstretched
from rrtik_ompl.files.point_files import npy_rows, text_rows
from rrtik_ompl.files.text import file_name, read_bytes
from rrtik_ompl.model.shapes.height_field import HeightField
from rrtik_ompl.model.shapes.point_cloud import Invalid, known_choice

TABLES = (".csv", ".txt", ".xyz")
PICTURES = (".png", ".tif", ".tiff", ".pgm")
USUAL = (-9999.0, -99999.0, -32768.0, -32767.0)  # numbers that often mean "no data" without the file saying so
MAX_BYTES = 256 * 1024 * 1024


def read_heights(
    file: str | os.PathLike[str],
    cell: float,
    floor: float | None = None,
    *,
    scale: float = 1.0,
    invalid: Invalid = "refuse",
    nodata: float | None = None,
) -> HeightField:
    """Read a grid of heights; see :meth:`HeightField.load`.

    Raises:
        InputError: If the file cannot be read, is broken, has cells without data, or makes no height field; one line.
    """
    factor = positive(scale, f"{file_name(file)}: scale")
    suffix = Path(file).suffix.lower()
    if suffix not in (".npy", *TABLES, *PICTURES):
        have = ", ".join((".npy", *TABLES, *PICTURES))
        raise InputError(f"{file}: unknown kind of heights; have {have}; export it as one of these")

    data = read_bytes(file, MAX_BYTES)
    what = str(file)
    no_data_value = None if nodata is None else finite_number(nodata, f"{file}: nodata")
    known_choice(invalid, what)

    picture = suffix in PICTURES
    if suffix == ".npy":
        rows = npy_rows(data, what)
    elif picture:
        header = picture_header(data, what)
        rows = unstretched(_picture(data, what), header)
        no_data_value = header.nodata if no_data_value is None else no_data_value
    else:
        rows = text_rows(data, None, what)

    rows = _with_missing_as_nan(rows, no_data_value, invalid, what, from_above=picture)
    source = os.path.abspath(file)

    return HeightField(
        factor * rows,
        cell,
        floor,
        invalid=invalid,
        source=source,
        scale=factor,
        nodata=None if nodata is None else no_data_value,
    )


def _with_missing_as_nan(
    rows: NDArray[Any], no_data_value: float | None, invalid: Invalid, what: str, *, from_above: bool
) -> NDArray[Any]:
    """Return the heights with NaN where there is no data.

    Args:
        rows: The heights of the file, shape (m, n).
        no_data_value: The number that means "no data"; if None, a usual one that lies far below all heights is refused.
        invalid: Whether such heights, and those that are not finite, are refused.
        what: The file, for messages.
        from_above: Whether the last row is the first one of the file.

    Raises:
        InputError: If there is such a height and it is refused, with the place of the first one in the file.
    """
    guess = (
        next((usual for usual in USUAL if _stands_for_no_data(rows, usual)), None) if no_data_value is None else None
    )
    number = guess if no_data_value is None else no_data_value

    missing = ~np.isfinite(rows)
    if number is not None:
        missing |= rows == (rows.dtype.type(number) if rows.dtype.kind == "f" else number)

    if not missing.any():
        return rows

    if invalid == "refuse" or guess is not None:
        in_file = missing[::-1] if from_above else missing
        row, column = np.argwhere(in_file)[0].tolist()
        counted = f"{np.count_nonzero(missing)} of {rows.size} heights are no numbers"
        remedy = "invalid='drop' leaves out their columns"
        if number is not None:
            counted = f"{counted} or {number:g}, which stands for no data"
        if guess is not None:
            remedy = f"nodata={guess:g} with invalid='drop' leaves out their columns; if it is a height, state another"
        raise InputError(f"{what}: {counted}, the first in row {row}, column {column} (from 0); {remedy}")

    return np.where(missing, np.nan, rows)


def _stands_for_no_data(rows: NDArray[Any], usual: float) -> bool:
    """Check whether a usual "no data" number occurs in a grid, far below all other heights."""
    finite = rows[np.isfinite(rows)].astype(np.float64)
    others = finite[finite != usual]
    if len(others) == len(finite):
        return False
    return len(others) == 0 or float(others.min()) - usual > float(np.ptp(others))


def _picture(data: bytes, what: str) -> NDArray[Any]:
    """Return a grey picture as an array, its lowest row first."""
    try:
        import cv2
    except ImportError:
        remedy = "pip install opencv-python-headless, or save it as .npy"
        raise InputError(f"{what}: pictures need OpenCV: {remedy}") from None

    try:
        picture = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_UNCHANGED) if data else None
    except cv2.error:  # The header may state a size larger than the memory.
        picture = None

    if picture is None:
        raise InputError(f"{what}: not a picture that can be read; save it as a grey PNG of 16 bits")
    if picture.ndim != 2:
        raise InputError(f"{what}: a picture of heights is grey, this has {picture.shape[2]} colours; save it as grey")
    return np.asarray(picture[::-1])
