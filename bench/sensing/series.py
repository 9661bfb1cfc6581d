"""The series of [1, ch. 4] taken again by the synthetic camera: precision, gripper, accuracy, range."""

from __future__ import annotations

from typing import Any

import numpy as np

from rrtik_bench.report.page import Report
from rrtik_bench.sensing.runs import (
    CAMERA,
    HARD,
    PLAIN,
    gripper_distances,
    gripper_poses,
    in_view,
    noisy_poses,
    pair_at,
    pair_distances,
    positions,
    random_poses,
    seen_poses,
)
from rrtik_bench.sensing.tables import ACCURACY, GRIPPER, SERIES
from rrtik_ompl.sensing.cameras.synthetic_camera import published_camera
from rrtik_ompl.sensing.precision import NORMAL_QUARTILES, series_of

POSES = 8
WAYS = (("corners one by one", False, PLAIN), ("laid over", True, PLAIN), ("laid over, hard", True, HARD))
RANGE = (0.25, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0)
TRUSTED = 2e-3  # [m]


def precision(report: Report, count: int) -> None:
    """A marker that stands still, eight poses at each published distance."""
    rows, steadier, biases = [], [], {}
    for number, (_, _, z, printed) in enumerate(SERIES, start=1):
        row = [f"{z:.0f}", f"{printed:.3f}"]
        for name, align, how in WAYS:
            spreads, errors = [], []
            for T in random_poses(1e-3 * z, POSES, 0):
                seen = 1e3 * positions(seen_poses([T], count, number, align=align, **how))
                spreads.append(seen.std(axis=0, ddof=1))
                errors.append(abs(seen.mean(axis=0) - 1e3 * T.translation)[2])
            depth = np.array(spreads)[:, 2]
            row += [f"{np.median(depth):.3f} / {depth.max():.3f}", f"{np.median(errors):.2f} / {max(errors):.2f}"]
            if align and how is PLAIN:
                steadier.append(printed / depth.max())
                row.append(f"{steadier[-1]:.1f}")
            biases[name, number] = max(errors)
        rows.append(row)
    head = ["z [mm]", "published sd"]
    for name, align, how in WAYS:
        head += [f"{name}: sd", "error of the mean"] + (["times steadier"] if align and how is PLAIN else [])
    report.table(f"Precision: sd of z [mm], median / worst of {POSES} poses, {count} photographs each", head, rows)
    report.bar("sd of z at 1 % noise, worst of 8 poses, at every distance", ">= 3 times below published",
               f"{min(steadier):.1f} times at least", min(steadier) >= 3.0)  # fmt: skip
    plain, hard = biases["laid over", len(SERIES)], biases["laid over, hard", len(SERIES)]
    report.bar("error of the mean of z at 2 m, worst of 8 poses, plain pictures", "< 2 mm", f"{plain:.2f} mm",
               plain < 2.0)  # fmt: skip
    report.bar("error of the mean of z at 2 m, worst of 8 poses, hard pictures", "< 2 mm", f"{hard:.2f} mm",
               hard < 2.0)  # fmt: skip


def gripper(report: Report, count: int) -> None:
    """The tip of a virtual arm at the end of a lever of 1.92 m."""
    rows, model = [], []
    for distance, _, _, _, first, third in GRIPPER:
        row = [str(distance), f"{(third - first) / NORMAL_QUARTILES:.2f}"]
        places = gripper_poses(1e-3 * distance, POSES)
        spreads = [series_of(gripper_distances(noisy_poses(T, 5 * count, distance))).robust_deviation for T in places]
        model.append(1e3 * float(np.median(spreads)))
        row.append(_range(spreads))
        for _, align, how in WAYS:
            seen = [gripper_distances(seen_poses([T], count, distance, align=align, **how)) for T in places]
            row.append(_range([series_of(each).robust_deviation for each in seen]))
        rows.append(row)
    report.table("Gripper 1.92 m from the marker: spread of its distance by the quartiles [mm], median / worst",
                 ["l [mm]", "published", "corners with 0.03 px", *(name for name, _, _ in WAYS)], rows)  # fmt: skip
    report.bar("lever arm, simulated sensor of 0.03 px: spread grows with l", "grows; > 2 mm beyond 1.5 m",
               ", ".join(f"{value:.2f}" for value in model) + " mm",
               bool((np.diff(model) > 0.0).all()) and min(model[2:]) > 2.0)  # fmt: skip
    at_1500 = float(rows[2][4].split(" / ")[1])
    report.bar("lever arm, marker laid over the picture, 1.5 m", "< 2 mm, every pose", f"{at_1500:.2f} mm",
               at_1500 < 2.0)  # fmt: skip


def accuracy(report: Report, count: int) -> None:
    """The known distance between two markers, lens calibrated or taken to have no distortion."""
    rows, errors, published = [], {}, {distance: error for distance, _, _, error in ACCURACY}
    ways = ((False, published_camera()), (False, CAMERA), (True, CAMERA))
    for apart in (125, 300, 400, 500):
        for distance in published:
            places = pair_at(1e-3 * distance, 1e-3 * apart)
            if not in_view(places):
                continue
            row = [str(apart), str(distance), f"{published[distance]:.2f}" if apart == 300 else "plotted only"]
            for align, believed in ways:
                seen = pair_distances(seen_poses(places, count, distance, align=align, believed=believed, **PLAIN))
                error = 100.0 * (float(1e3 * seen.mean()) / apart - 1.0)
                errors[apart, distance, align] = error
                row += [f"{error:.3f}", f"{1e3 * float(seen.std(ddof=1)):.3f}"]
            rows.append(row)
    names = ("one by one, lens not corrected", "one by one, lens known", "laid over, lens known")
    head = ["x [mm]", "l [mm]", "published"] + [f"{n}: {w}" for n in names for w in ("error [%]", "sd [mm]")]
    report.table(f"Accuracy: distance between two markers, {count} photographs each", head, rows)
    worst = {near: max(abs(e) for (_, distance, align), e in errors.items() if align and (distance <= 1500) == near)
             for near in (True, False)}  # fmt: skip
    report.bar("accuracy, marker laid over the picture, all x, 600 to 1500 mm", "|error| <= 0.5 %",
               f"{worst[True]:.3f} % at most; {worst[False]:.3f} % at 2000 mm", worst[True] <= 0.5)  # fmt: skip


def safe_range(report: Report, count: int) -> None:
    """How far one marker of 80 mm can be trusted."""
    rows, farthest = [], {"plain": 0.0, "hard": 0.0}
    for distance in RANGE:
        row = [f"{distance:g}"]
        for name, how in (("plain", PLAIN), ("hard", HARD)):
            away, found = [], 0
            for T in [T for T in random_poses(distance, 8 * POSES, 1) if in_view([T])][:POSES]:
                seen = positions(seen_poses([T], count, 7, **how))
                found += len(seen)
                away += list(np.linalg.norm(seen - T.translation, axis=1))
            late = float(np.quantile(away, 0.95)) if away else np.inf
            share = found / (count * POSES)
            if share == 1.0 and late <= TRUSTED and farthest[name] in (0.0, RANGE[RANGE.index(distance) - 1]):
                farthest[name] = distance
            row += [f"{100 * share:.0f}", f"{1e3 * np.median(away):.2f}" if away else "-", f"{1e3 * late:.2f}"]
        rows.append(row)
    head = ["distance [m]"] + [f"{n}: {w}" for n in ("plain", "hard") for w in ("found [%]", "median", "95 %")]
    report.table(f"Range of one marker of 80 mm: error of the position [mm], tilt to 40 deg, {POSES} poses", head, rows)
    report.bar("safe range: all found, 95 % of positions within 2 mm", "500 to 1500 mm (published)",
               f"to {farthest['plain']:g} m; hard pictures to {farthest['hard']:g} m",
               min(farthest.values()) >= 1.5)  # fmt: skip


def _range(values: Any) -> str:
    return f"{1e3 * np.median(values):.2f} / {1e3 * max(values):.2f}"
