"""Files of heights -> `shapes.HeightField`: arrays, tables of numbers, pictures."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import positive
from rrtik_ompl.errors import InputError
from rrtik_ompl.files.point_records import npy_rows, text_rows
from rrtik_ompl.files.text import file_name, read_bytes
from rrtik_ompl.shapes.height_field import HeightField
from rrtik_ompl.shapes.point_cloud import Invalid

TABLES = (".csv", ".txt", ".xyz")
PICTURES = (".png", ".tif", ".tiff", ".pgm")
MAX_BYTES = 256 * 1024 * 1024


def load_height_field(
    path: str | os.PathLike[str],
    cell: float,
    floor: float | None = None,
    *,
    scale: float = 1.0,
    invalid: Invalid = "refuse",
) -> HeightField:
    """Read a grid of heights: ``.npy``, rows of numbers (``.csv``, ``.txt``), or a grey picture of 8, 16 or 32 bits.

    Rows of arrays and tables go along y, the first one first; a picture lies as it is seen from above, its upper edge
    at the far end of y. A value of 0 in a picture is a height of 0.

    Args:
        path: The file.
        cell: Side of a cell [m].
        floor: Where the solid ends below [m]; one cell below the lowest height if None.
        scale: Metres per unit of the file's heights; 0.001 for millimetres.
        invalid: Whether heights that are not finite are refused or dropped.

    Raises:
        InputError: If the file cannot be read, is broken, or makes no height field; one line.

    Example:
        >>> seabed = load_height_field("seabed.npy", cell=0.1)  # doctest: +SKIP
    """
    factor, suffix = positive(scale, f"{file_name(path)}: scale"), Path(path).suffix.lower()
    if suffix not in (".npy", *TABLES, *PICTURES):
        have = ", ".join((".npy", *TABLES, *PICTURES))
        raise InputError(f"{path}: unknown kind of heights; have {have}; export it as one of these")
    data = read_bytes(path, MAX_BYTES)
    if suffix == ".npy":
        rows = npy_rows(data, str(path))
    else:
        rows = text_rows(data, None, str(path)) if suffix in TABLES else _picture(data, str(path))
    source = os.path.abspath(path)
    return HeightField(factor * rows, cell, floor, invalid=invalid, source=source, scale=factor)


def _picture(data: bytes, what: str) -> NDArray[Any]:
    """A grey picture, its lowest row first."""
    try:
        import cv2
    except ImportError:
        remedy = "pip install 'rrtik-ompl[markers]', or save it as .npy"
        raise InputError(f"{what}: pictures need OpenCV: {remedy}") from None
    try:
        found = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_UNCHANGED) if data else None
    except cv2.error:  # a header with a size larger than memory
        found = None
    if found is None:
        raise InputError(f"{what}: not a picture that can be read; save it as a grey PNG of 16 bits")
    if found.ndim != 2:
        raise InputError(f"{what}: a picture of heights is grey, this has {found.shape[2]} colours; save it as grey")
    return np.asarray(found[::-1])
