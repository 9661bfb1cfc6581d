"""A camera or a marker that is not as its file says: stated, it is in the covariance; not stated, two markers show it.

Pictures are rendered by `stress_pictures`; their seeds are held out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import cv2
import numpy as np
from numpy.typing import NDArray
from typer import Option

from bench.sensing.stress import CAMERA, DICTIONARY, LENS, NEAR, SEED, SLANTED, judged
from bench.sensing.stress_pictures import SIDE, Trouble, facing, taken
from bench.shared.parts import Parts
from bench.shared.run import Run
from rrtik_bench.report.page import Report
from rrtik_ompl.base.poses import pose
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.markers.marker_map import MarkedObject, MarkerMap, MountedMarker
from rrtik_ompl.sensing.sight import detect_objects

NUMBERS = (3, 11)
PLACES = {
    "one marker": (pose([0.0, 0.0, 0.0]),),
    "two, 0.2 m apart in one plane": (pose([-0.1, 0.0, 0.0]), pose([0.1, 0.0, 0.0])),
    "two, 0.2 m apart, one 0.2 m behind": (pose([-0.1, 0.0, 0.0]), pose([0.1, 0.0, -0.2])),
}
FOCAL, LARGER = 0.01, 0.02  # shares by which focal length and side are wrong
HEADS = ("wrong", "stated", "markers", "accepted [%]", "refused [%]", "error [mm], median",
         "of the accepted within 3 sigma [%]", "contradiction, median")  # fmt: skip
INTRO = (
    "640 x 480, AprilTags 36h11 of 80 mm, sRGB, a spot of 0.6 pixels, noise of 0.8 %, 0.4 to 1.8 m, tilts to 60 "
    "degrees. Focal length 1 % too large, side 2 % too large, the lens taken to have no distortion. Stated: a standard "
    "deviation of that size stands in the camera file or the marker map. Distances across the view do not depend on "
    "the focal length, only those along it do: two markers side by side in one plane that faces the camera cannot show "
    "it. Contradiction: squared deviations of their corners for each number more than a pose has; above 5 is refused."
)


@dataclass(frozen=True)
class Wrong:
    """What is wrong: shares of focal length and side, whether the lens is left out."""

    name: str
    focal: float = 0.0
    side: float = 0.0
    lens: bool = False

    def camera(self, stated: bool) -> Camera:
        """As its file says."""
        matrix, doubts = CAMERA.matrix.copy(), np.zeros(9)
        matrix[[0, 1], [0, 1]] *= 1.0 + self.focal
        doubts[:2] = self.focal * CAMERA.matrix[[0, 1], [0, 1]]
        doubts[4:] = np.abs(LENS) if self.lens else 0.0
        lens = (0.0,) * 5 if self.lens else LENS
        return Camera(matrix, CAMERA.width, CAMERA.height, lens, sigmas=doubts if stated else (0.0,) * 9)

    def marker_map(self, places: tuple[Any, ...], stated: bool) -> MarkerMap:
        """As its file says."""
        side, doubt = SIDE * (1.0 + self.side), SIDE * self.side if stated else 0.0
        markers = tuple(MountedMarker(n, side, T, doubt) for n, T in zip(NUMBERS, places, strict=False))
        return MarkerMap(DICTIONARY, (MarkedObject("thing", "target", markers),), pose([0, 0, 0]))


WRONGS = (Wrong("nothing"), Wrong("focal length", focal=FOCAL), Wrong("side", side=LARGER), Wrong("lens", lens=True))


@dataclass(frozen=True)
class Row:
    """A row: what is printed; shares that were accepted, refused, and within 3 sigma of the accepted [%]."""

    cells: list[str]
    accepted: float
    refused: float
    within: float


def measured(wrong: int, markers: str, stated: bool, count: int) -> Row:
    """So many pictures of one case; those in which not all markers are in view are drawn again."""
    cv2.setNumThreads(1)
    case, places = WRONGS[wrong], PLACES[markers]
    camera, marker_map = case.camera(stated), case.marker_map(places, stated)
    outcomes, refused, surprises = [], 0, []
    for k in range(count):
        truth, picture = _picture(places, k)
        seen = [each for each in detect_objects(picture, camera, marker_map) if len(each.markers) == len(places)]
        outcomes.append(judged(seen[0] if seen else None, truth))
        refused += bool(seen and seen[0].refused)
        surprises += [each.pose.surprise for each in seen]
    accepted = [each for each in outcomes if each.accepted]
    shares = 100.0 * len(accepted) / count, 100.0 * refused / count
    within = 100.0 * float(np.mean([each.within for each in accepted] or [True]))
    error = 1e3 * float(np.median([each.error for each in accepted] or [np.nan]))
    cells = [case.name, "yes" if stated else "no", markers, f"{shares[0]:.0f}", f"{shares[1]:.0f}", f"{error:.2f}",
             f"{within:.0f}", f"{np.median(surprises or [np.nan]):.1f}" if len(places) > 1 else "-"]  # fmt: skip
    return Row(cells, *shares, within)


def _picture(places: tuple[Any, ...], k: int) -> tuple[Any, NDArray[np.uint8]]:
    rng = np.random.default_rng([SEED + 300, len(places), k])
    while True:
        truth = facing(rng, CAMERA, NEAR, SLANTED)
        corners = [(truth * T).translation for T in places]
        facing_us = all((truth * T).rotation[:, 2] @ at < 0.0 for T, at in zip(places, corners, strict=True))
        pixels = CAMERA.project(np.array(corners))
        margin = 0.75 * SIDE * CAMERA.matrix[0, 0] / min(at[2] for at in corners)
        inside = (pixels > margin).all() and (pixels < np.array([CAMERA.width, CAMERA.height]) - margin).all()
        if facing_us and inside and min(at[2] for at in corners) > NEAR[0]:
            prints = [(truth * T, number) for T, number in zip(places, NUMBERS, strict=False)]
            return truth, taken(CAMERA, prints, DICTIONARY, Trouble(), rng)


def main(run: Run, parts: Parts, *, pictures: Annotated[int, Option(help="Of each case.")] = 40) -> Report:
    """Measure."""
    report = run.report("Cameras and markers that are not as their files say", intro=INTRO)
    cases = [(wrong, markers, stated, pictures) for wrong in range(len(WRONGS)) for markers in PLACES
             for stated in ((False,) if wrong == 0 else (True, False))]  # fmt: skip
    rows = parts(measured, cases)
    for (wrong, markers, stated, _), row in zip(cases, rows, strict=True):
        name = f"{WRONGS[wrong].name} wrong, {markers}"
        if stated or wrong == 0:
            report.bar(f"{name}: of the accepted within 3 sigma", ">= 95 %", f"{row.within:.0f} %", row.within >= 95.0)
        elif len(PLACES[markers]) > 1:
            report.bar(f"{name}, not stated", "refused", f"{row.refused:.0f} % refused", row.refused == 100.0)
    report.table("Cases", HEADS, [row.cells for row in rows])
    return report
