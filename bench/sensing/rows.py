"""How far a marker can be trusted, how an arm's tip jitters, and how near a grasp comes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from rrtik_bench.report.page import Report
from rrtik_bench.sensing.runs import (
    ARM,
    CAMERA,
    DICTIONARY,
    HARD,
    PLAIN,
    SIDE,
    facing,
    in_view,
    positions,
    random_poses,
    seen_poses,
)
from rrtik_bench.sensing.synthetic_camera import clean_picture, marker_print, photograph
from rrtik_ompl import load_robot
from rrtik_ompl.base.poses import pose
from rrtik_ompl.ik.analytic.closed_form import solutions
from rrtik_ompl.pilot.overlay.virtual_camera import orbit_pose
from rrtik_ompl.sensing.markers.dictionaries import marker_cells
from rrtik_ompl.sensing.markers.marker_map import MarkedObject, MarkerMap, MountedMarker
from rrtik_ompl.sensing.scene_from_view import objects_in_base
from rrtik_ompl.sensing.sight import detect_objects
from rrtik_ompl.sensing.tracker import PoseTracker

POSES = 8
RANGE = (0.25, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0)  # [m]
TRUSTED = 2e-3  # [m]
BOARD = [pose([x * 0.0535, y * 0.0535, 0.0]) for x in (-1, 1) for y in (-1, 1)]


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


def jitter(report: Report, count: int) -> None:
    """The tip of the virtual arm before the camera: base known from its mount, by one marker, by four, smoothed."""
    rng, base = np.random.default_rng(0), facing(np.deg2rad(25.0), 0.4, 0.2, [0.1, 0.0, 1.5])
    reach = np.array([ARM, 0.0, 0.0])
    one = MarkedObject("one", "base", (MountedMarker(9, SIDE),))
    four = MarkedObject("four", "base", tuple(MountedMarker(k, SIDE, T) for k, T in enumerate(BOARD)))
    tips: dict[str, list[Any]] = {"one marker": [], "one marker, followed over time": [], "four markers": []}
    tracker = PoseTracker()
    for thing in (one, four):
        prints = [(base * m.T_object_marker, marker_print(marker_cells(DICTIONARY, m.number), SIDE))
                  for m in thing.markers]  # fmt: skip
        clean = clean_picture(CAMERA, prints, rays=6)
        for k in range(count):
            (sight,) = detect_objects(photograph(clean, rng), CAMERA, MarkerMap(DICTIONARY, (thing,)))
            tips["one marker" if thing is one else "four markers"].append(sight.pose.T_camera_object.act(reach))
            if thing is one:
                followed = tracker.update(sight, k / 30.0).T_camera_object
                tips["one marker, followed over time"].append(followed.act(reach))
    settled = count // 3  # the filter needs a second until it is steady
    spread = {name: 1e3 * float(np.linalg.norm(np.std(rows[settled:], axis=0))) for name, rows in tips.items()}
    report.table("Jitter of the virtual arm's tip, base 1.5 m away [mm]", ["base", "sd", "ratio to one marker"],
                 [["known from the mount (endogenous)", "0", "0"],
                  *([n, f"{s:.3f}", f"{s / spread['one marker']:.2f}"] for n, s in spread.items())])  # fmt: skip
    report.bar("endogenous: jitter of the arm", "exactly 0", "0: no picture enters T_base_camera", True)
    better = spread["one marker"] / max(spread["four markers"], spread["one marker, followed over time"])
    report.bar("exogenous jitter with four markers, and with the temporal filter", "a third of one marker's",
               f"{better:.1f} times less at least", better >= 3.0)  # fmt: skip


def end_to_end(report: Report, count: int) -> None:
    """Photograph, pose of the object, grasp, closed-form inverse kinematics, forward kinematics: error at the tip."""
    errors: list[float] = []
    covered: list[bool] = []
    robot, rng = load_robot("titan4"), np.random.default_rng(3)
    T_base_camera = orbit_pose([1.2, 0.0, 0.1], 0.8, np.deg2rad(-150.0), np.deg2rad(35.0))
    thing = MarkedObject("valve", "target", (MountedMarker(0, SIDE),))
    marker_map = MarkerMap(DICTIONARY, (thing,), T_base_camera)
    sheet = marker_print(marker_cells(DICTIONARY, 0), SIDE)
    tries = 0
    while len(errors) < count and tries < 100 * count:
        tries += 1
        z, tilt, direction, roll = rng.uniform([0.5, 0.15, 0, -np.pi], [1.0, 0.7, 7, np.pi])
        T = facing(tilt, direction, roll, [*(z * rng.uniform(-0.15, 0.15, 2)), z])
        grasp = pose([0.0, 0.0, 0.08]) * pin.SE3(pin.exp3(np.array([np.pi, 0.0, 0.0])), np.zeros(3))
        wanted = T_base_camera * T * grasp
        if not in_view([T]) or not solutions(robot, wanted.homogeneous[None]).valid.any():
            continue
        picture = photograph(clean_picture(CAMERA, [(T, sheet)], rays=5), rng, **HARD)
        (placed,) = objects_in_base(detect_objects(picture, CAMERA, marker_map), marker_map)
        off = float(np.linalg.norm(placed.T_base_object.translation - (T_base_camera * T).translation))
        covered.append(off < placed.sigmas * placed.position_sigma)
        found = solutions(robot, (placed.T_base_object * grasp).homogeneous[None])
        if found.valid.any():
            reached = robot.fk(found.branches[0][found.valid[0]][0]).translation
            errors.append(1e3 * float(np.linalg.norm(reached - wanted.translation)))
    rms = float(np.sqrt(np.mean(np.square(errors)))) if errors else np.inf
    report.bar("end to end, endogenous, grasp 80 mm before the marker, l 0.5 to 1 m, hard pictures", "<= 2 mm rms",
               f"{rms:.2f} mm rms, {max(errors, default=np.inf):.2f} mm worst of {len(errors)}",
               rms <= 2.0 and len(errors) == count)  # fmt: skip
    share = float(np.mean(covered))
    report.bar("covariance as obstacle margin: true place within the margin by which solids grow", ">= 99 %",
               f"{100 * share:.0f} % of {len(covered)}", share >= 0.99)  # fmt: skip
