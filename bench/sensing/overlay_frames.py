"""The arm drawn over a picture: its silhouette pixel for pixel, and what a whole frame costs."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import cv2
import numpy as np

from bench.shared.problems import goal_joints
from bench.shared.reference_z_buffer import ROUNDING, reference_z_buffer
from rrtik_bench.report.page import Report
from rrtik_bench.sensing.synthetic_camera import clean_picture, marker_print, photograph, published_camera
from rrtik_ompl import load_problem, load_robot
from rrtik_ompl.pilot.devices.simulated_vehicle import find_vehicle, load_vehicle
from rrtik_ompl.pilot.overlay.augment import Augmenter, Ghost
from rrtik_ompl.pilot.overlay.rasterizer import FARTHEST_DRAWN, Canvas, figure_of, placed, robot_surfaces
from rrtik_ompl.pilot.overlay.virtual_camera import orbit_pose
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.cameras.pictures import Picture
from rrtik_ompl.sensing.markers.dictionaries import marker_cells
from rrtik_ompl.sensing.sensor import Sensor

BUDGET = 20.0  # [ms] of processor time


def silhouettes(report: Report, count: int) -> None:
    """TITAN-4 and UR5 at random configurations from random places, against a second rasteriser in double precision."""
    camera, rng, rows, different = published_camera(), np.random.default_rng(0), [], 0
    for name in ("titan4", "ur5"):
        robot = load_robot(name)
        arm, drawn, differ, doubtful, deep = figure_of(robot_surfaces(robot, 3000)), 0, 0, 0, 0.0
        for _ in range(count):
            q = rng.uniform(np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi))
            eye = orbit_pose([0.6, 0.0, 0.2], *rng.uniform([1.8, -np.pi, -0.3], [3.0, np.pi, 1.2]))
            shown = placed(arm, eye.inverse().homogeneous @ robot.joint_frames(q[None])[0])
            canvas = Canvas(camera)
            canvas.draw(shown)
            truth, doubt = reference_z_buffer(camera, shown)
            both = canvas.drawn & (truth < FARTHEST_DRAWN)
            drawn += int(both.sum())
            differ += int((canvas.drawn != (truth < FARTHEST_DRAWN)).sum())
            doubtful += int((both & doubt).sum())
            deep = max(deep, float(np.abs(canvas.depths - truth)[both].max()))
        different += differ
        rows.append(
            [name, str(count), str(len(arm.faces)), str(drawn), str(differ), str(doubtful), f"{1e3 * deep:.3f}"]
        )
    report.table("Silhouettes against a z-buffer in double precision",
                 ["robot", "pictures", "triangles", "pixels drawn", "that differ",
                  f"centres within {ROUNDING:g} of an edge", "largest difference of depth [mm]"], rows)  # fmt: skip
    report.bar("silhouette against an independent z-buffer", "equal pixel for pixel",
               f"{different} pixels differ", different == 0)  # fmt: skip


def wide(camera: Camera) -> Camera:
    """The same lens before a chip of 1280 x 720 pixels: twice as fine, cut above and below."""
    matrix = np.array(camera.matrix)
    matrix[:2] *= 2.0
    matrix[1, 2] -= 120.0
    return replace(camera, matrix=matrix, width=1280, height=720)


def frame_times(report: Report, count: int) -> None:
    """One picture with two markers of each size: detect, refine, pose, draw TITAN-4, encode."""
    camera = load_vehicle(find_vehicle("titan4_sdu")).camera
    for lens, wanted in ((camera, 40.0), (wide(camera), 25.0)):
        size = f"{lens.width} x {lens.height}"
        median = stage_times(report, lens, count)
        if lens is camera:
            whole, most = sum(list(median.values())[:3]), list(median.values())[-1]
            budget = f"<= {BUDGET:g} ms of processor time"
            report.bar(f"whole {size} frame: detect, refine, pose, draw, encode", budget,
                       f"{whole:.1f} ms", whole <= BUDGET)  # fmt: skip
            report.bar("draw the moving arm, a moving ghost, a trail and a frame", budget,
                       f"{most:.1f} ms", most <= BUDGET)  # fmt: skip
        rate = 1e3 / sum(median[name] for name in WITH_ALL)
        report.bar(f"{size}, with a ghost, a trail and a frame", f">= {wanted:g} a second of processor time",
                   f"{rate:.0f}", rate >= wanted)  # fmt: skip


DETECT, ENCODE = "detect, refine, pose", "encode (JPEG, quality 80)"
MORE = "draw the moving arm, a ghost that stands still, a trail and a frame"
WITH_ALL = (DETECT, MORE, ENCODE)


def stage_times(report: Report, camera: Camera, count: int) -> dict[str, float]:
    """Processor time of each stage [ms], as a table."""
    problem, scenario = load_problem("titan4_sdu"), load_vehicle(find_vehicle("titan4_sdu"))
    sensor, augmenter = Sensor(camera, scenario.marker_map), Augmenter(problem.robot, camera)
    seen_from = scenario.T_base_camera.inverse()
    prints = [(seen_from * scenario.places[thing.name] * marker.T_object_marker,
               marker_print(marker_cells(scenario.marker_map.dictionary, marker.number), marker.side))
              for thing in scenario.marker_map.objects for marker in thing.markers]  # fmt: skip
    gray = photograph(clean_picture(camera, prints, rays=6), np.random.default_rng(0))
    taken = np.repeat(gray[..., None], 3, axis=2)
    q, goal = np.array(problem.start), np.array(goal_joints(problem))
    tips = problem.robot.fk_batch(q + np.linspace(0.0, 1.0, 40)[:, None] * (goal - q))[:, :3, 3]
    arm = partial(augmenter.draw, taken, scenario.T_base_camera)
    more: dict[str, Any] = {"trail": tips, "frames": [problem.robot.fk(goal)]}
    drawn = arm(q)
    stages: dict[str, Callable[[int], Any]] = {  # arms that move: what stands still is not drawn anew
        DETECT: lambda k: sensor.view(Picture(taken, "picture", k / 30.0)),
        "draw the arm, which moves": lambda k: arm(q + 1e-3 * k * (goal - q)),
        ENCODE: lambda _: cv2.imencode(".jpg", drawn, [cv2.IMWRITE_JPEG_QUALITY, 80]),
        MORE: lambda k: arm(q + 1e-3 * (k + 0.5) * (goal - q), ghosts=[Ghost(goal)], **more),
        "the same, the ghost moves, too": lambda k: arm(
            q + 1e-3 * (k + 0.7) * (goal - q), ghosts=[Ghost(goal + 1e-3 * k * (q - goal))], **more
        ),
    }
    spent = {name: [] for name in stages}  # type: dict[str, list[float]]
    for k in range(count):
        for name, run in stages.items():
            begin = time.process_time()
            run(k)
            spent[name].append(1e3 * (time.process_time() - begin))
    median = {name: float(np.median(values)) for name, values in spent.items()}
    faces = len(figure_of(robot_surfaces(problem.robot)).faces)
    title = f"Processor time of a {camera.width} x {camera.height} frame, TITAN-4 with {faces} triangles, two markers"
    report.table(f"{title}, median of {count} [ms]",
                 ["stage", "ms"], [[name, f"{value:.1f}"] for name, value in median.items()])  # fmt: skip
    return median
