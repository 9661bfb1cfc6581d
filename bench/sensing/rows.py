"""Rows of acceptance of marker sensing that need no long series: algebra, exactness, the simulated sensor, jitter."""

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
    SIDE,
    facing,
    in_view,
    noisy_poses,
    positions,
)
from rrtik_bench.sensing.tables import ACCURACY, GRIPPER, NOISE, SERIES
from rrtik_ompl import load_robot
from rrtik_ompl.base.poses import pose
from rrtik_ompl.ik.analytic.closed_form import solutions
from rrtik_ompl.pilot.overlay.virtual_camera import orbit_pose
from rrtik_ompl.sensing.cameras.synthetic_camera import clean_picture, marker_print, photograph, published_camera
from rrtik_ompl.sensing.markers.corner_pose import pose_of_square, square_corners
from rrtik_ompl.sensing.markers.detection import marker_cells
from rrtik_ompl.sensing.markers.marker_map import MarkedObject, MarkerMap, MountedMarker
from rrtik_ompl.sensing.precision import Series
from rrtik_ompl.sensing.scene_from_view import objects_in_base
from rrtik_ompl.sensing.sight import detect_objects
from rrtik_ompl.sensing.tracker import PoseTracker

BOARD = [pose([x * 0.0535, y * 0.0535, 0.0]) for x in (-1, 1) for y in (-1, 1)]


def algebra(report: Report, count: int) -> None:
    """Both ways to the gripper, and the inverse by its formula."""
    worst = 0.0
    for _ in range(count):
        T_0h, T_hb, T_be, T_0m = (pin.SE3.Random() for _ in range(4))
        T_0b = T_0h * T_hb
        R, p = T_0b.rotation, T_0b.translation
        formula = np.block([[R.T, -(R.T @ p)[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]])
        ways = (T_0b * T_be).homogeneous - (T_0m * ((T_0b.inverse() * T_0m).inverse() * T_be)).homogeneous
        worst = max(worst, np.abs(ways).max(), np.abs(formula - T_0b.inverse().homogeneous).max())
    report.bar(f"transform algebra, {count} random frames", "<= 1e-12", f"{worst:.1e}", worst <= 1e-12)


def exactness(report: Report, count: int) -> None:
    """Poses from corners without noise, of two the one with less error."""
    rng, camera, away, turned = np.random.default_rng(0), published_camera(), [], []
    for _ in range(count):
        z, tilt, direction, roll = rng.uniform([0.2, 0, 0, -np.pi], [2.5, np.deg2rad(70), 7, np.pi])
        T = facing(tilt, direction, roll, [*(z * rng.uniform(-0.2, 0.2, 2)), z])
        pixels = camera.project(square_corners(SIDE) @ T.rotation.T + T.translation)
        found = pose_of_square(camera, pixels, SIDE).T_camera_object
        away.append(1e3 * np.linalg.norm(found.translation - T.translation))
        turned.append(np.linalg.norm(pin.log3(found.rotation.T @ T.rotation)))
    report.bar(f"noiseless pose, z 200 to 2500 mm, tilt to 70 deg, {count} poses", "< 1e-6 mm, < 1e-8 rad",
               f"{max(away):.1e} mm, {max(turned):.1e} rad", max(away) < 1e-6 and max(turned) < 1e-8)  # fmt: skip


def simulated_sensor(report: Report, count: int) -> None:
    """Corners with noise of 0.03 pixels, the marker parallel to the picture."""
    rows, held, largest = [], True, True
    for number, (x, y, z, printed) in enumerate(SERIES, start=1):
        seen = 1e3 * positions(noisy_poses(facing(0.0, 0.0, 0.0, 1e-3 * np.array([x, y, z])), count, number))
        spread = seen.std(axis=0, ddof=1)
        factor = max(spread[2] / printed, printed / spread[2])
        held &= factor <= (1.5 if z <= 1500 else 2.0)
        largest &= spread[2] > spread[:2].max()
        rows.append([f"{z:.0f}", f"{printed:.3f}", *(f"{value:.3f}" for value in spread), f"{factor:.2f}"])
    report.table(f"Simulated sensor, {NOISE} px a corner coordinate, {count} observations: sd [mm]",
                 ["z [mm]", "published sd of z", "x", "y", "z", "factor"], rows)  # fmt: skip
    factors = ", ".join(row[-1] for row in rows)
    report.bar("sigma 0.03 px: sd of z", "within 1.5 to 1500 mm, 2 beyond", f"factors {factors}", held)
    report.bar("sigma 0.03 px: sd of z above those of x and y", "all series", "all" if largest else "not all", largest)
    near = float(rows[3][4])
    report.bar("sigma 0.03 px: sd of z at 1537 mm", "< 1 mm", f"{near:.3f} mm", near < 1.0)


def statistics(report: Report, _: int) -> None:
    """The module of statistics against the printed summaries."""
    first = Series(100, 505.9640, 505.6400, 505.7898, 0.0671)
    last = Series(100, 2041.1300, 2029.8200, 2035.0656, 2.1142)
    good = np.allclose([first.mean_deviation, last.mean_deviation], [0.0067, 0.2114], atol=5e-5)
    good &= np.allclose([first.largest_deviation, last.largest_deviation], [0.1742, 6.0644], atol=1e-4)
    errors = [Series(100, mean, mean, mean, 0.0).error_percent(300.0) for _, mean, _, _ in ACCURACY]
    good &= np.allclose(errors, [error for _, _, _, error in ACCURACY], atol=2e-3)
    flags = [Series(100, most, least, most, printed).possible for _, most, least, printed, _, _ in GRIPPER]
    report.bar("statistics from the printed summaries", "s_mean, largest deviation, error %; impossible sd flagged",
               f"{'all as printed' if good else 'NOT as printed'}; impossible: {flags.count(False)} of 4 series",
               bool(good) and flags == [False, False, False, True])  # fmt: skip


def simulated_accuracy(report: Report, _: int) -> None:
    """The accuracy test of [1, ch. 4] without pictures: corners pulled inwards by blur, the lens not corrected."""
    errors: list[float] = []
    published = [error for _, _, _, error in ACCURACY]
    bent, straight = published_camera((0.3, 0.0, 0.0, 0.0, 0.0)), published_camera()
    for distance in (each[0] for each in ACCURACY):
        centres = []
        for aside in (-0.15, 0.15):
            T = facing(0.0, 0.0, 0.0, [aside, 0.0, 1e-3 * distance])
            pixels = bent.project(square_corners(SIDE) @ T.rotation.T + T.translation)
            inwards = pixels.mean(axis=0) - pixels
            pixels = pixels + 0.12 * inwards / np.linalg.norm(inwards, axis=1, keepdims=True)
            centres.append(pose_of_square(straight, pixels, SIDE).T_camera_object.translation)
        errors.append(100.0 * (float(np.linalg.norm(centres[1] - centres[0])) / 0.3 - 1.0))
    near = [abs(error) for error in errors[1:3]]
    held = max(near) <= 0.5 and abs(errors[3]) > max(near) and int(np.argmin(np.abs(errors))) == 1
    report.bar("accuracy shape, x = 300 mm: k1 = 0.3 left in, corners 0.12 px inwards",
               "|error| <= 0.5 % to 1500 mm, grows to 2000, least near 1000",
               ", ".join(f"{error:.2f}" for error in errors) + f" % (published {published})", held)  # fmt: skip


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
