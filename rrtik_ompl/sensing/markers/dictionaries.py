"""Dictionaries of square markers [50]: their names, and the cells of their markers.

OpenCV stores AprilTag families turned by half a turn; here top is where the AprilTag library's own prints have it.
"""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import whole_number
from rrtik_ompl.base.errors import InputError, UnknownNameError, require

DICTIONARIES = {
    **{f"{bits}x{bits}_{size}": f"DICT_{bits}X{bits}_{size}" for bits in (4, 5, 6, 7) for size in (50, 100, 250, 1000)},
    **{f"apriltag_{family}": f"DICT_APRILTAG_{family}" for family in ("16h5", "25h9", "36h10", "36h11")},
    "aruco_original": "DICT_ARUCO_ORIGINAL",
    "aruco_mip_36h12": "DICT_ARUCO_MIP_36h12",
}
# Bits that a code must be able to correct, so that markers with wrong cells are accepted.
_FAR_APART = 3


def marker_cells(dictionary: str, number: int) -> NDArray[np.uint8]:
    """Return the ideal marker, upright, with its black border: one number a cell, 0 black, 255 white, shape (n, n).

    Raises:
        InputError: If there is no such marker.
    """
    require(dictionary, str, "dictionary of markers")
    number = whole_number(number, "number of a marker")

    table = table_of(dictionary)
    count = len(table.bytesList)
    if not 0 <= number < count:
        raise InputError(f"dictionary {dictionary} has markers 0 to {count - 1}, not {number}")

    cells = cv2.aruco.generateImageMarker(table, number, table.markerSize + 2)
    return np.ascontiguousarray(np.rot90(cells, 2 if is_turned(dictionary) else 0), dtype=np.uint8)


def spare_bits(dictionary: str) -> int:
    """Return how many cells of a marker may be wrong without a doubt about its number; 0 for codes of few bits.

    Codes that cannot correct at least `_FAR_APART` bits are found in any clutter, if wrong cells are allowed.
    """
    bits = int(table_of(dictionary).maxCorrectionBits)
    return bits if bits >= _FAR_APART else 0


def is_turned(dictionary: str) -> bool:
    """Check whether OpenCV stores the markers of a dictionary upside down."""
    return dictionary.startswith("apriltag_")


@lru_cache
def table_of(dictionary: str) -> cv2.aruco.Dictionary:
    """Return the cells of a dictionary's markers as OpenCV stores them."""
    if dictionary not in DICTIONARIES:
        raise UnknownNameError("dictionary of markers", dictionary, DICTIONARIES)
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, DICTIONARIES[dictionary]))
