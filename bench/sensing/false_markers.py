"""Photographs without markers: what each dictionary finds in them, and what is accepted.

Needs folders of photographs that show no marker, as the clones of github.com/BIDS/BSDS500 (500 photographs) and of
github.com/openMVG/ImageDataset_SceauxCastle (11 large ones).
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated
from unittest.mock import patch

import cv2
import numpy as np
from typer import Argument, Option

from bench.shared.parts import Parts
from bench.shared.run import Run
from rrtik_bench.report.page import Report
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.sensing.cameras.pictures import read_picture
from rrtik_ompl.sensing.markers import search
from rrtik_ompl.sensing.markers.alignment import MIN_LIKENESS, aligned_corners, mean_side
from rrtik_ompl.sensing.markers.dictionaries import DICTIONARIES, is_turned, marker_cells, spare_bits, table_of
from rrtik_ompl.sensing.sight import MIN_SIDE_PIXELS, as_gray

SEED = 43_000
WIDTH, HEIGHT = 320, 240  # [pixels]; of a crop
PIXELS_PER_CROP = 120_000  # of the photograph
MARKERS = 50  # in a map
LEAST_PICTURES, LEAST_PHOTOGRAPHS = 1000, 150
# Those with the same first markers find the less, the more markers they have, as fewer bits are corrected.
STRICTER = {f"{bits}x{bits}_{size}": f"{bits}x{bits}_50" for bits in (4, 5, 6, 7) for size in (100, 250, 1000)}
SEARCHED = tuple(name for name in DICTIONARIES if name not in STRICTER)
CORRECTING = "apriltag_36h11"  # a dictionary whose bits are corrected as far as possible in a thorough search
USUAL_CORRECTION = 0.6  # OpenCV's share of the bits that could be corrected
HEADS = ("dictionary", "markers in the map", "squares whose bits are a marker's", "largest likeness", "accepted")
INTRO = (
    f"Crops of {WIDTH} x {HEIGHT} pixels at random places of photographs without markers, each searched for the first "
    f"{MARKERS} markers of every dictionary (all, if it has fewer) at the settings of `detect_objects`. None is there, "
    "so every search goes to its end. One search serves all: OpenCV's detector compares each square with several "
    "dictionaries, with as many corrected bits as for each alone. Accepted: likeness and size suffice for the pose of "
    "an object. Dictionaries of one size have the same first markers, and the one of 50 corrects most bits: what the "
    "others find, it finds, too."
)


def crops_of(file: str) -> dict[str, list[float]]:
    """Likenesses of all that the dictionaries find in crops of a photograph; -1 in place of one that is too small."""
    cv2.setNumThreads(1)
    gray = as_gray(read_picture(file))
    height, width = gray.shape
    rng = np.random.default_rng([SEED, height, width, int(gray.sum())])

    found: dict[str, list[float]] = {"pictures": []}
    for _ in range(max(round(gray.size / PIXELS_PER_CROP), 1)):
        x, y = int(rng.integers(width - WIDTH + 1)), int(rng.integers(height - HEIGHT + 1))
        crop = np.ascontiguousarray(gray[y : y + HEIGHT, x : x + WIDTH])
        found["pictures"].append(float(crop.std()))
        with patch.object(search, "_detected", detected_of_all):
            squares = search.search(crop, CORRECTING)
        for number, corners in squares:
            name, number = SEARCHED[number // MARKERS], number % MARKERS
            fit = aligned_corners(crop, corners, marker_cells(name, number), spoilt=spare_bits(name))
            large = mean_side(fit.corners) >= MIN_SIDE_PIXELS
            found.setdefault(name, []).append(fit.likeness if large else -1.0)
    return found


def detected_of_all(gray: search.Gray, codes: search.Codes, share: float, **how: bool) -> list[search.Found]:
    """In place of `search._detected`: of all that are `SEARCHED`, whose numbers count on from each to the next."""
    if min(gray.shape) < 8:
        return []
    tables = [search.Codes(name, tuple(range(count_of(name)))).table() for name in SEARCHED]
    parameters = search._detector(codes, share, **how).getDetectorParameters()
    if how.get("thorough"):
        for name, table in zip(SEARCHED, tables, strict=True):
            # Only codes that are far apart are corrected as far as they can be; others as far as elsewhere.
            table.maxCorrectionBits = spare_bits(name) or int(USUAL_CORRECTION * table.maxCorrectionBits)
    squares, rows, _, which = cv2.aruco.ArucoDetector(tables, parameters).detectMarkersMultiDict(gray)
    if rows is None:
        return []
    found = []
    places = [int(each) for each in np.ravel(which)]
    for square, row, place in zip(squares, np.ravel(rows), places, strict=True):
        turned = 2 if is_turned(SEARCHED[place]) else 0
        outline = np.roll(square.reshape(4, 2).astype(np.float64), turned, axis=0)
        found.append(search.Found(int(MARKERS * place + row), outline))
    return found


def count_of(name: str) -> int:
    """Markers of a dictionary that are in the map."""
    return min(len(table_of(name).bytesList), MARKERS)


def main(
    run: Run,
    parts: Parts,
    photographs: Annotated[
        list[Path], Argument(help="Folders of photographs without markers.", exists=True, file_okay=False)
    ],
    *,
    step: Annotated[int, Option(help="Take every so manieth photograph.")] = 1,
) -> Report:
    """Search all photographs."""
    files = sorted(str(file) for folder in photographs for file in folder.rglob("*") if file.suffix.lower() == ".jpg")
    files = [file for file in files if min(read_picture(file).shape[:2]) >= HEIGHT][::step]
    if not files:
        raise InputError("the folders have no photograph (.jpg) that is large enough")
    results = parts(crops_of, [(file,) for file in files])
    pictures = sum(len(result["pictures"]) for result in results)

    report = run.report("False markers", intro=INTRO)
    report.bar("photographs", f">= {LEAST_PHOTOGRAPHS}", str(len(files)), len(files) >= LEAST_PHOTOGRAPHS)
    report.bar("pictures without markers", f">= {LEAST_PICTURES}", str(pictures), pictures >= LEAST_PICTURES)

    rows = []
    for name in DICTIONARIES:
        likenesses = np.array([each for result in results for each in result.get(STRICTER.get(name, name), [])])
        accepted = int((likenesses >= MIN_LIKENESS).sum())
        at_most = "at most " if name in STRICTER else ""
        largest = f"{likenesses.max():.2f}" if (likenesses >= 0.0).any() else "-"
        report.bar(f"{name}: accepted", "0", f"{at_most}{accepted}", accepted == 0)
        rows.append([name, str(count_of(name)), f"{at_most}{len(likenesses)}", largest, f"{at_most}{accepted}"])
    report.table("Dictionaries", HEADS, rows)
    return report
