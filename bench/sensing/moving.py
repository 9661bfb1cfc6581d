"""Targets that move, and photographs that are no film: how far off what the sensor says is, and whether it says so.

Pictures are rendered by `stress_pictures`; their seeds are held out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Annotated, Any

import cv2
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from typer import Option

from bench.sensing.stress import CAMERA, DICTIONARY, NEAR, SEED, SLANTED, Outcome, judged, marker_map
from bench.sensing.stress_pictures import Trouble, facing, taken
from bench.shared.parts import Parts
from bench.shared.run import Run
from rrtik_bench.report.page import Report
from rrtik_ompl.base.arrays import TAU
from rrtik_ompl.sensing.cameras.pictures import Picture
from rrtik_ompl.sensing.sensor import Sensor

NUMBER = 3
RATE = 15.0  # pictures a second
SWAY, OFTEN = 0.1, 0.3  # of a vehicle [m], [Hz]
PLACE = np.array([0.02, -0.03, 1.0])
HEADS = ("target", "pictures", "one by one: median [mm]", "95 %", "followed: median [mm]", "95 %",
         "followed: within 3 sigma [%]", "followed: steadiness of the error [mm]")  # fmt: skip


def swaying(t: float) -> Any:
    """Along all three axes, each with its own phase, and turning by some degrees."""
    phase = TAU * OFTEN * t + np.array([0.0, 2.0, 4.0])
    shift = SWAY * np.sin(phase) * np.array([1.0, 0.5, 1.0])
    return _at(PLACE + shift, 0.5 + 0.08 * np.sin(phase[1]))


def _at(place: Any, tilt: float) -> Any:
    return pin.SE3(pin.exp3(np.array([tilt, 0.1, 0.0])) @ np.diag([1.0, -1.0, -1.0]), np.asarray(place))


def _steady(speed: float) -> Callable[[float], Any]:
    return lambda t: _at(PLACE + np.array([speed * (t - 1.0) * 0.5, 0.0, speed * t]), 0.5)


TARGETS: dict[str, Callable[[float], Any]] = {
    "sways by 0.1 m at 0.3 Hz": swaying,
    "stands still": _steady(0.0),
    "0.05 m/s": _steady(0.05),
    "0.2 m/s": _steady(0.2),
}


def followed(path: Callable[[float], Any], count: int, seed: int) -> list[tuple[Outcome, Outcome, Any]]:
    """Of so many pictures: by itself, over time, and the error over time [m]."""
    alone = Sensor(CAMERA, marker_map(NUMBER), smooth=False)
    film, found = Sensor(CAMERA, marker_map(NUMBER)), []
    for picture, truth in _film(path, count, seed):
        (one,), (over_time,) = alone.view(picture).seen, film.view(picture).seen
        away = over_time.pose.T_camera_object.translation - truth.translation
        found.append((judged(one, truth), judged(over_time, truth), away))
    return found


def _film(path: Callable[[float], Any], count: int, seed: int) -> Iterator[tuple[Picture, Any]]:
    rng = np.random.default_rng(seed)
    for k in range(count):
        truth = path(k / RATE)
        gray = taken(CAMERA, [(truth, NUMBER)], DICTIONARY, replace(Trouble(), noise=0.01), rng)
        yield Picture(_coloured(gray), str(k), k / RATE), truth


def _coloured(gray: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.repeat(gray[..., None], 3, axis=2)


def moving(name: str, count: int) -> list[str]:
    """One row: a target that moves."""
    cv2.setNumThreads(1)
    every = followed(TARGETS[name], count, SEED + 100 + list(TARGETS).index(name))
    one, film = (1e3 * np.array([each[k].error for each in every]) for k in (0, 1))
    share = 100.0 * float(np.mean([each[1].within for each in every]))
    steady = 1e3 * float(np.linalg.norm(np.std([each[2] for each in every[len(every) // 3 :]], axis=0)))
    return [name, str(count), f"{np.median(one):.2f}", f"{np.quantile(one, 0.95):.2f}", f"{np.median(film):.2f}",
            f"{np.quantile(film, 0.95):.2f}", f"{share:.0f}", f"{steady:.3f}"]  # fmt: skip


def photographs(count: int) -> Report:
    """Unrelated photographs, each by itself, as `rrtik markers sense FOLDER` takes them."""
    cv2.setNumThreads(1)
    sensor, outcomes = Sensor(CAMERA, marker_map(NUMBER), smooth=False), []
    for k in range(count):
        rng = np.random.default_rng([SEED + 200, k])
        truth = facing(rng, CAMERA, NEAR, SLANTED)
        gray = taken(CAMERA, [(truth, NUMBER)], DICTIONARY, Trouble(), rng)
        seen = sensor.view(Picture(_coloured(gray), str(k), float(k))).seen
        outcomes.append(judged(seen[0] if seen else None, truth))
    accepted = [each for each in outcomes if each.accepted]
    off = sum(not each.within for each in accepted)
    report = Report("", "")
    report.bar(f"{count} unrelated photographs of a folder", "all within 3 sigma or refused",
               f"{len(accepted)} accepted, {off} of them beyond 3 sigma", off == 0)  # fmt: skip
    return report


def main(
    run: Run, parts: Parts, *, pictures: Annotated[int, Option(help="Of each target, and photographs.")] = 90
) -> Report:
    """Measure."""
    report = run.report("Targets that move, photographs that do not")
    rows = parts(moving, [(name, pictures) for name in TARGETS])
    middle = float(rows[0][4])
    report.bar(f"{rows[0][0]}: median error over time", "<= 1.5 mm", f"{middle:.2f} mm", middle <= 1.5)
    for row in rows:
        report.bar(f"{row[0]}: within 3 sigma over time", ">= 95 %", f"{row[6]} %", float(row[6]) >= 95.0)
    (part,) = parts(photographs, [(pictures,)])
    report.add(part)
    report.table(f"Targets, {RATE:g} pictures a second", HEADS, rows)
    return report
