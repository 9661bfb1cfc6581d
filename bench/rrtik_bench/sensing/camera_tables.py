"""The measured series of [1, ch. 4], taken again by the synthetic camera: as published, and as here.

"As published" are corners refined one by one, as the toolkits do it; noise of 1 % is what makes their depth as unsteady
as the published one, and the same noise is given to the whole marker laid over the picture, which is how poses are
sensed here.
"""

from __future__ import annotations

import numpy as np

from rrtik_bench.report.rows import Bar, Row, about, judged, within
from rrtik_bench.sensing.precision import series_of
from rrtik_bench.sensing.tables import ACCURACY, COORDINATES, GRIPPER, SOURCE
from rrtik_bench.tables import Table

TIMES_STEADIER = 3.0  # wanted of the depth of a marker; of a gripper only that it is not less steady
CHANCE = 3.0  # factor between poses of one series; theirs is not known
LEAST_ERROR = 0.03  # [%] an error below is none
ROUGH, FINE = "corners one by one", "whole marker laid over"


def precision(quick: bool) -> list[Row]:
    """Standard deviation of the depth of one marker, the worst of several random poses."""
    from rrtik_bench.sensing.runs import PLAIN, positions, random_poses, seen_poses

    poses, count, rows = (2, 20, []) if quick else (8, 100, [])
    for number, (_, _, (_, _, z, printed)) in enumerate(COORDINATES, start=1):
        worst = {}
        for align in (False, True):
            seen = [seen_poses([T], count, number, align=align, **PLAIN) for T in random_poses(1e-3 * z, poses, 0)]
            worst[align] = 1e3 * max(series_of(positions(each)[:, 2]).robust_deviation for each in seen)
        rows += _rows(f"series {number}, z = {z:.0f} mm: standard deviation of z", printed, worst, TIMES_STEADIER)
    return rows


def gripper(quick: bool) -> list[Row]:
    """How unsteady a gripper 1.92 m away from the marker is, by the quartiles; the median of poses."""
    from rrtik_bench.sensing.runs import PLAIN, gripper_distances, gripper_poses, seen_poses

    poses, count, rows = (3, 20, []) if quick else (5, 100, [])
    for distance, published in GRIPPER.items():
        spread = {}
        for align in (False, True):
            places = gripper_poses(1e-3 * distance, poses)
            seen = [seen_poses([T], count, distance, align=align, **PLAIN) for T in places]
            spread[align] = 1e3 * float(
                np.median([series_of(gripper_distances(each)).robust_deviation for each in seen])
            )
        rows += _rows(f"gripper, l = {distance} mm: spread by the quartiles",
                      published.robust_deviation, spread, 1.0)  # fmt: skip
    return rows


def accuracy(quick: bool) -> list[Row]:
    """Two markers 300 mm apart, the lens known or taken to be without distortion."""
    from rrtik_bench.sensing.runs import CAMERA, PLAIN, pair_at, pair_distances, seen_poses
    from rrtik_bench.sensing.synthetic_camera import published_camera

    count, rows = 10 if quick else 100, []
    for distance, _, _, printed in ACCURACY:
        error = {}
        for align, believed in ((False, published_camera()), (True, CAMERA)):
            seen = seen_poses(pair_at(1e-3 * distance, 0.3), count, distance, align=align, believed=believed, **PLAIN)
            error[align] = 100.0 * (float(pair_distances(seen).mean()) / 0.3 - 1.0)
        name = f"300 mm apart at {distance} mm: error"
        rows.append(judged(f"{name}, {ROUGH}, lens not corrected", f"{printed:.2f} %", f"{error[False]:.2f} %",
                           error[False], Bar((-50.0, 50.0), held=about(printed, 0.2), differs=about(printed, 1.0)),
                           "their lens and light are not known; blur pulls corners inwards"))  # fmt: skip
        size = abs(printed)
        rows.append(judged(f"{name}, {FINE}, lens calibrated", f"{printed:.2f} %", f"{error[True]:.3f} %",
                           abs(error[True]), Bar((0.0, 50.0), held=(max(0.3 * size, LEAST_ERROR), size),
                                                 better=(0.0, max(0.3 * size, LEAST_ERROR))),
                           f"a {abs(printed / error[True]):.0f}th of the error"))  # fmt: skip
    return rows


def _rows(name: str, printed: float, found: dict[bool, float], times: float) -> list[Row]:
    rough, fine = found[False], found[True]
    return [
        judged(f"{name}, {ROUGH}", f"{printed:.3f} mm", f"{rough:.3f} mm", rough,
               Bar((0.0, 100.0), held=within(CHANCE, printed)), f"{rough / printed:.2f} times the print"),
        judged(f"{name}, {FINE}", f"{printed:.3f} mm", f"{fine:.3f} mm", fine,
               Bar((0.0, 100.0), held=(printed / times, printed), better=(0.0, printed / times)),
               f"{printed / fine:.1f} times steadier with the same noise"),
    ]  # fmt: skip


FITTED = "the noise of the camera, 1 % of full scale"
TABLES = (
    Table("sensing-precision", "Precision against distance, photographed", SOURCE, precision, 180, 15, fitted=FITTED),
    Table("sensing-gripper", "Precision of a gripper far from the marker", SOURCE, gripper, 60, 10, fitted=FITTED),
    Table("sensing-accuracy", "Two markers at a known distance", SOURCE, accuracy, 30, 8, fitted=FITTED),
)
