"""What goes wrong in detection [1, ch. 4.2.3]: markers not found, found where there are none, taken for others."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_bench.report.rows import Bar, Row, exactly, judged
from rrtik_bench.sensing.runs import CAMERA, DICTIONARY, HARD, PLAIN, SIDE, random_poses
from rrtik_bench.sensing.synthetic_camera import clean_picture, marker_print, photograph
from rrtik_bench.tables import Table
from rrtik_ompl.sensing.markers.detection import find_markers
from rrtik_ompl.sensing.markers.dictionaries import marker_cells

DISTANCES = (500, 1000, 1500, 2000)  # [mm]
NUMBERS = 50  # of the dictionary
LIGHTS: dict[str, Mapping[str, Any]] = {"even light": PLAIN, "blur, gradient, flicker, JPEG": HARD}
USABLE = 1500  # [mm] as [1] concludes


@dataclass(frozen=True, slots=True, eq=False)
class Counts:
    """Of photographs with one marker each: found as itself, not found, taken for another; and what else was found.

    ``matrix`` says how often which number (a row) was found as which (a column), the last column as none.
    """

    right: int
    missing: int
    confused: int
    extra: int
    matrix: NDArray[np.int64]

    def __str__(self) -> str:
        return f"{self.right} right, {self.missing} not found, {self.confused} confused, {self.extra} beside it"


@cache
def counts(distance: int, light: str, pictures: int) -> Counts:
    """Photographs of markers at a distance [mm] in one of `LIGHTS`, each with the next number of the dictionary."""
    how, matrix = LIGHTS[light], np.zeros((NUMBERS, NUMBERS + 1), dtype=np.int64)
    rng, right, confused, extra = np.random.default_rng([7, distance]), 0, 0, 0
    for k, place in enumerate(random_poses(1e-3 * distance, pictures, 7)):
        number = k % NUMBERS
        clean = clean_picture(CAMERA, [(place, marker_print(marker_cells(DICTIONARY, number), SIDE))], rays=4)
        found = [marker.number for marker in find_markers(photograph(clean, rng, **how), DICTIONARY)]
        right += number in found
        confused += bool(found) and number not in found
        extra += len(found) - (number in found)
        for each in found or [NUMBERS]:
            matrix[number, each] += 1
    return Counts(right, pictures - right - confused, confused, extra, matrix)


def confusion(quick: bool) -> NDArray[np.int64]:
    """How often which number was found as which, over all distances and lights; see :class:`Counts`."""
    found = [counts(each, light, _pictures(quick)).matrix for light in LIGHTS for each in DISTANCES]
    total: NDArray[np.int64] = np.sum(found, axis=0, dtype=np.int64)
    return total


def _pictures(quick: bool) -> int:
    return 4 if quick else 100


def false_positives(pictures: int) -> int:
    """Markers that are found where printed squares bear random cells, none of the dictionary's."""
    rng, found = np.random.default_rng(8), 0
    cells = [marker_cells(DICTIONARY, k) for k in range(NUMBERS)]
    for place in random_poses(0.8, pictures, 8):
        pattern = rng.permutation(cells[int(rng.integers(NUMBERS))].ravel()).reshape(cells[0].shape)
        clean = clean_picture(CAMERA, [(place, marker_print(pattern, SIDE))], rays=4)
        found += len(find_markers(photograph(clean, rng, **PLAIN), DICTIONARY))
    return found


def detections(quick: bool) -> list[Row]:
    """The three kinds of failure by distance and light."""
    pictures, rows = _pictures(quick), []
    for light in LIGHTS:
        for distance in DISTANCES:
            found = counts(distance, light, pictures)
            least = 0.9 if distance <= USABLE else 0.5
            rows.append(
                judged(
                    f"{distance} mm, {light}",
                    "kinds are named, not counted",
                    str(found),
                    found.right / pictures,
                    Bar((0.0, 1.0), held=(least, 1.0)),
                    f"{pictures} photographs by the synthetic camera; usable to {USABLE} mm in print",
                )
            )
            wrong = found.confused + found.extra
            rows.append(
                judged(
                    f"{distance} mm, {light}: confused or beside it",
                    "named",
                    str(wrong),
                    wrong,
                    exactly(0, 10 * pictures),
                )
            )
    matrix = confusion(quick)
    shown = matrix.sum(axis=1)[matrix.sum(axis=1) > 0]
    off = int(matrix[:, :NUMBERS].sum() - np.trace(matrix))
    rows.append(
        judged(
            "number by number, all photographs: off the diagonal",
            "named",
            f"{off} of {matrix.sum()}, {int(matrix[:, NUMBERS].sum())} as none",
            off,
            exactly(0, 1e6),
            f"{len(shown)} of the dictionary's numbers, each at least {shown.min()} times; figure sensing_confusion",
        )
    )
    none = false_positives(pictures)
    rows.append(
        judged(
            "false positives in squares with shuffled cells",
            "named",
            f"{none} in {pictures}",
            none / pictures,
            Bar((0.0, 10.0), held=(0.0, 0.05)),
            "cells of the dictionary's markers in random order",
        )
    )
    return rows


TABLES = (
    Table(
        "sensing-detections",
        "Not found, confused, false",
        "[1, ch. 4.2.3]",
        detections,
        60,
        8,
        bars="ours; the source names kinds of failure and counts none",
    ),
)
