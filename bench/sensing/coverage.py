"""Whether poses are as uncertain as their covariance says: all six numbers, under what cheap cameras do.

Pictures are rendered by `stress_pictures`, by 36 rays a photosite; their seeds are held out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any

import cv2
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.stats import chi2
from typer import Option

from bench.sensing.stress import CAMERA, DICTIONARY, NEAR, SEED, SLANTED
from bench.sensing.stress_pictures import SIDE, Trouble, facing, taken
from bench.shared.parts import Parts
from bench.shared.run import Run
from rrtik_bench.report.page import Report
from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.base.poses import pose
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.markers.marker_map import MarkedObject, MarkerMap, MountedMarker
from rrtik_ompl.sensing.sight import Sighting, detect_objects

INSIDE = float(chi2.ppf(0.99, 6))
HEADS = ("condition", "pictures", "accepted", "error [mm], median", "95 %",
         "squared error of the pose by its covariance, median (honest: 5.3)",
         "within the 99 % ellipsoid [%]")  # fmt: skip
INTRO = (
    "AprilTags 36h11 of 80 mm, 640 x 480, the lens of a usual web camera, light coded by sRGB's curve, a spot of 0.6 "
    "pixels, noise of 0.8 %; 0.4 to 1.8 m and tilts to 60 degrees where nothing else is said. All mild: a filmic tone "
    "curve, half of the light lost in the corners, red larger than blue by 0.3 %, sharpening by a half, and JPEG 75 at "
    "once. A rolling shutter reads the picture in 30 ms while the marker moves in any direction; the pose is that of "
    "the middle row, and the camera's file and the marker map say readout and speed. The pose has six numbers; "
    "where two poses are given, the better one counts."
)

ONE = (pose([0.0, 0.0, 0.0]),)
FLAT = (pose([-0.07, 0.0, 0.0]), pose([0.07, 0.0, 0.0]))
STEP = (pose([-0.07, 0.0, 0.0]), pose([0.07, 0.0, -0.1]))
NUMBERS = (3, 11)
FARTHER = (0.5, 1.8)  # [m]
READOUT = 0.03  # of a rolling shutter [s]
MILD = Trouble(filmic=True, vignetting=0.5, chromatic=0.003, sharpened=0.5, jpeg=75)


@dataclass(frozen=True)
class Condition:
    """A row: its pictures, the places of the markers on the object, and the side of a marker [m]."""

    name: str
    trouble: Trouble
    places: tuple[Any, ...] = ONE
    distance: tuple[float, float] = NEAR
    tilt: tuple[float, float] = SLANTED
    size: tuple[int, int] = (640, 480)
    rays: int = 6


CONDITIONS = (
    Condition("clean", Trouble()),
    Condition("all mild", MILD),
    Condition("chromatic 0.3 %", Trouble(chromatic=0.003)),
    Condition("rolling shutter, 0.2 m/s", Trouble(speed=0.2, readout=READOUT)),
    Condition("marker of 500 pixels", Trouble(), distance=(0.25, 0.32), tilt=(0.0, 30.0), size=(1280, 960), rays=4),
    Condition("JPEG 60", Trouble(jpeg=60)),
    Condition("sharpened by a half", Trouble(sharpened=0.5)),
    Condition("filmic curve, vignetting", Trouble(filmic=True, vignetting=0.5)),
    Condition("motion 3 to 6 pixels", Trouble(motion=(3.0, 6.0))),
    Condition("two in one plane, clean", Trouble(), FLAT, FARTHER),
    Condition("two in one plane, all mild", MILD, FLAT, FARTHER),
    Condition("two on a step, all mild", MILD, STEP, FARTHER),
)
ASKED = 5  # of these, what their median must be is a bar, too


def off(T: Any, truth: Any) -> Vector:
    """Error of a pose as covariances count it: position [m], small rotation about the axes of the camera [rad]."""
    return np.concatenate([T.translation - truth.translation, pin.log3(T.rotation @ truth.rotation.T)])


def squared(sight: Sighting, truth: Any) -> float:
    """The squared error by its own covariance; where two poses are given, of the better one."""
    poses = [sight.pose.T_camera_object]
    if sight.pose.ambiguous and sight.pose.other is not None:
        poses.append(sight.pose.other)
    return min(float(a @ np.linalg.solve(sight.pose.covariance, a)) for a in (off(T, truth) for T in poses))


def camera_of(condition: Condition) -> Camera:
    """The camera, with larger pictures where the condition says so; its file says the time of the readout."""
    scale = condition.size[0] / CAMERA.width
    matrix = CAMERA.matrix.copy()
    matrix[[0, 1], [0, 1]] *= scale
    matrix[[0, 1], [2, 2]] = scale * (matrix[[0, 1], [2, 2]] + 0.5) - 0.5
    width, height = condition.size
    return replace(CAMERA, matrix=matrix, width=width, height=height, readout=condition.trouble.readout)


def photographed(condition: Condition, camera: Camera, rng: np.random.Generator) -> tuple[Any, NDArray[np.uint8]]:
    """The pose of an object with all of its markers in view, and its picture."""
    while True:
        truth = facing(rng, camera, condition.distance, condition.tilt)
        prints = [(truth * T, number) for T, number in zip(condition.places, NUMBERS, strict=False)]
        if all(_in_view(T, camera) for T, _ in prints) and not _covered([T for T, _ in prints], camera):
            return truth, taken(camera, prints, DICTIONARY, condition.trouble, rng, rays=condition.rays)


def _in_view(T: Any, camera: Camera) -> bool:
    """Whether a marker with its rim is in the picture and faces the camera."""
    reach = 0.5 * SIDE * 1.4
    outline = np.array([[x, y, 0.0] for x in (-reach, reach) for y in (-reach, reach)])
    at = outline @ T.rotation.T + T.translation
    pixels = camera.project(at)
    inside = (pixels > 4).all() and (pixels < np.array([camera.width, camera.height]) - 5).all()
    return bool(inside and at[:, 2].min() > 0.1 and T.rotation[:, 2] @ T.translation < 0.0)


def _covered(places: list[Any], camera: Camera) -> bool:
    """Whether one of two markers may hide a part of the other."""
    middles = np.array([T.translation for T in places])
    apart = np.linalg.norm(np.diff(camera.project(middles), axis=0), axis=1)
    return bool((apart < SIDE * 1.5 * camera.matrix[0, 0] / middles[:, 2].min()).any())


def map_of(condition: Condition) -> MarkerMap:
    """The map of the object."""
    markers = tuple(MountedMarker(n, SIDE, T) for n, T in zip(NUMBERS, condition.places, strict=False))
    thing = MarkedObject("thing", "target", markers, speed=condition.trouble.speed)
    return MarkerMap(DICTIONARY, (thing,), pose([0, 0, 0]))


@dataclass(frozen=True)
class Row:
    """A row: what is printed, the share within the ellipsoid [%], the median of the squared error."""

    cells: list[str]
    within: float
    median: float


def measured(number: int, count: int) -> Row:
    """So many pictures of one condition."""
    cv2.setNumThreads(1)
    condition = CONDITIONS[number]
    camera = camera_of(condition)
    marker_map = map_of(condition)
    squares = []
    errors = []
    for k in range(count):
        truth, picture = photographed(condition, camera, np.random.default_rng([SEED + 400 + number, k]))
        for sight in detect_objects(picture, camera, marker_map):
            if not sight.refused:
                squares.append(squared(sight, truth))
                errors.append(1e3 * float(np.linalg.norm(off(sight.pose.T_camera_object, truth)[:3])))

    within = 100.0 * float(np.mean(np.array(squares) <= INSIDE))
    median = float(np.median(squares))
    error = np.quantile(errors, [0.5, 0.95])
    cells = [condition.name, str(count), str(len(squares)), f"{error[0]:.2f}", f"{error[1]:.2f}", f"{median:.1f}",
             f"{within:.1f}"]  # fmt: skip
    return Row(cells, within, median)


def main(run: Run, parts: Parts, *, pictures: Annotated[int, Option(help="Of each condition.")] = 300) -> Report:
    """Measure."""
    report = run.report("Whether poses are as uncertain as their covariance says", intro=INTRO)
    rows = parts(measured, [(number, pictures) for number in range(len(CONDITIONS))])
    for number, (condition, row) in enumerate(zip(CONDITIONS, rows, strict=True)):
        report.bar(f"{condition.name}: within the 99 % ellipsoid", ">= 95 %", f"{row.within:.1f} %", row.within >= 95.0)
        if 0 < number < ASKED:
            report.bar(f"{condition.name}: median of the squared error", "3 to 9", f"{row.median:.1f}",
                       3.0 <= row.median <= 9.0)  # fmt: skip
    report.table("Conditions", HEADS, [row.cells for row in rows])
    return report
