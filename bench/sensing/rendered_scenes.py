"""Markers in rendered pictures of every kind, in short sequences: found or not, how far off, which of two poses."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from rrtik_bench.report.page import Report
from rrtik_bench.sensing.runs import CAMERA, DICTIONARY, SIDE, facing, in_view
from rrtik_bench.sensing.synthetic_camera import Print, clean_picture, marker_print, photograph
from rrtik_ompl.base.poses import pose
from rrtik_ompl.sensing.markers.dictionaries import marker_cells
from rrtik_ompl.sensing.markers.marker_map import MarkedObject, MarkerMap, MountedMarker
from rrtik_ompl.sensing.sight import Sighting, detect_objects
from rrtik_ompl.sensing.tracker import PoseTracker, Tracked

FRAMES = 12  # of a sequence
RATE = 10.0  # [Hz]
SPEED, TURN = 0.03, 0.1  # of the drift within a sequence [m/s], [rad/s]
PITCH = 0.107  # between markers of the board [m]: each has its white rim
BOARD = [pose([x * PITCH / 2.0, y * PITCH / 2.0, 0.0]) for x in (-1, 1) for y in (-1, 1)]


@dataclass(frozen=True)
class Kind:
    """What is in a picture and what becomes of it; ranges are drawn from, once a sequence."""

    name: str
    tilt: tuple[float, float] = (0.0, 50.0)  # [deg]
    gradient: tuple[float, float] = (0.0, 0.0)
    motion: tuple[float, float] = (0.0, 0.0)  # [pixels]
    strip: tuple[float, float] = (0.0, 0.0)  # width of what hangs before the marker, of its side
    markers: tuple[Any, ...] = (pin.SE3.Identity(),)


KINDS = (
    Kind("nothing special"),
    Kind("light falling off by 30 to 80 %", gradient=(0.3, 0.8)),
    Kind("motion blur of 2 to 8 pixels", motion=(2.0, 8.0)),
    Kind("strip over 2 to 12 % of the marker", strip=(0.02, 0.12)),
    Kind("the same strip, four markers", strip=(0.02, 0.12), markers=tuple(BOARD)),
    Kind("tilt 50 to 70 deg", tilt=(50.0, 70.0)),
    Kind("all of it", (0.0, 70.0), (0.0, 0.6), (0.0, 4.0), (0.0, 0.06)),
    Kind("all of it, four markers", (0.0, 70.0), (0.0, 0.6), (0.0, 4.0), (0.0, 0.06), tuple(BOARD)),
)


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """One picture: where the object was, what was seen of it, and what the filter made of that."""

    truth: Any
    sight: Sighting | None
    tracked: Tracked | None

    @property
    def position_error(self) -> float:
        """Of the sighting [m]."""
        assert self.sight is not None
        return float(np.linalg.norm(self.sight.pose.T_camera_object.translation - self.truth.translation))

    def turn(self, T: Any) -> float:
        """Between a pose and the true one [rad]."""
        return float(np.linalg.norm(pin.log3(self.truth.rotation.T @ T.rotation)))

    def flipped(self, other_branch: bool) -> bool:
        """Whether of the two poses of a sighting the one that is taken is farther from the true rotation."""
        assert self.sight is not None
        first, second = self.sight.pose.T_camera_object, self.sight.pose.other
        return second is not None and (self.turn(second) < self.turn(first)) != other_branch


def sequences(kind: Kind, count: int, seed: int) -> Iterator[list[Look]]:
    """Sequences of one kind, each followed by a fresh tracker."""
    mounted = tuple(MountedMarker(k, SIDE, T) for k, T in enumerate(kind.markers))
    thing = MarkedObject("thing", "target", mounted)
    marker_map, rng = MarkerMap(DICTIONARY, (thing,), pin.SE3.Identity()), np.random.default_rng(seed)
    for _ in range(count):
        yield _sequence(kind, marker_map, rng)


def _sequence(kind: Kind, marker_map: MarkerMap, rng: np.random.Generator) -> list[Look]:
    how: Mapping[str, Any] = {
        "noise": 0.01,
        "blur": rng.uniform(0.5, 0.9),
        "jpeg": 85,
        "flicker": 0.02,
        "gradient": rng.uniform(*kind.gradient),
        "motion": rng.uniform(*kind.motion),
    }
    path, tracker, looks = _drift(kind, rng), PoseTracker(), []
    strip = _strip(kind, rng)
    for k, T in enumerate(path):
        prints = [(T * at, marker_print(marker_cells(DICTIONARY, n), SIDE)) for n, at in enumerate(kind.markers)]
        picture = photograph(clean_picture(CAMERA, [*prints, *((T * at, it) for at, it in strip)], rays=5), rng, **how)
        seen = detect_objects(picture, CAMERA, marker_map)
        sight = seen[0] if seen and not seen[0].refused else None
        looks.append(Look(T, sight, None if sight is None else tracker.update(sight, k / RATE)))
    return looks


def _drift(kind: Kind, rng: np.random.Generator) -> list[Any]:
    """Poses of a sequence, all markers in the picture all the time; the tilt stays within its range."""
    while True:
        distance = float(np.exp(rng.uniform(np.log(0.5), np.log(2.0))))
        tilt, direction, roll = rng.uniform([np.deg2rad(kind.tilt[0]), 0, -np.pi], [np.deg2rad(kind.tilt[1]), 7, np.pi])
        place = np.array([*(distance * rng.uniform(-0.2, 0.2, 2)), distance])
        speed, spin = SPEED * rng.normal(size=3), TURN * rng.normal(size=2)
        poses = []
        for t in np.arange(FRAMES) / RATE:
            bent = np.clip(tilt + spin[0] * t, *np.deg2rad(kind.tilt))
            poses.append(facing(bent, direction + spin[1] * t, roll, place + t * speed))
        if all(in_view([T * at for at in kind.markers]) for T in poses):
            return poses


def _strip(kind: Kind, rng: np.random.Generator) -> list[tuple[Any, Print]]:
    """A grey strip that hangs 1 cm before the first marker, anywhere, in any direction."""
    width = SIDE * rng.uniform(*kind.strip)
    if width < 1e-4:
        return []
    sheet = Print(np.full((1, max(round(4.0 * SIDE / width), 1)), rng.integers(60, 200), dtype=np.uint8), width)
    across = rng.uniform(-0.6, 0.6) * SIDE
    turn = pin.SE3(pin.exp3(np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)])), np.zeros(3))
    return [(kind.markers[0] * turn * pose([0.0, across, 0.01]), sheet)]


def rendered_scenes(report: Report, count: int) -> None:
    """All kinds, so many sequences each."""
    every, rows, flips = [], [], []
    for number, kind in enumerate(KINDS):
        looks = [each for sequence in sequences(kind, count, number) for each in sequence]
        rows.append([kind.name, *_errors(looks)])
        flips.append([kind.name, *_flips(looks)])
        every += looks if len(kind.markers) == 1 else []
    rows.append(["all with one marker", *_errors(every)])
    flips.append(["all with one marker", *_flips(every)])
    size = len(KINDS) * count * FRAMES
    report.table(f"{size} rendered pictures: found, and error of the pose",
                 ["pictures", "found [%]", "position [mm], median", "95 %", "rotation [deg], median", "95 %"],
                 rows)  # fmt: skip
    report.table("The wrong one of two poses [%]",
                 ["pictures", "least error", "flagged ambiguous", "of those not flagged", "after the filter",
                  "filter not sure", "of those where it is sure"], flips)  # fmt: skip
    report.bar("rendered pictures with known truth", ">= 1000", str(size), size >= 1000)
    report.bar("found, nothing special, to 2 m", "100 %", f"{rows[0][1]} %", float(rows[0][1]) == 100.0)
    shares = "; ".join(f"{name}: {share} %" for name, share, *_ in rows[1 : len(KINDS)])
    report.note("Found, by what disturbs", shares + ". A marker that something covers is refused, not guessed.")
    before, _, after, followed, _, sure = flips[-1][1:]
    report.bar("wrong one of two poses, of pictures that are not flagged", "< 0.1 %", f"{after} %; {before} % of all",
               float(after) < 0.1)  # fmt: skip
    report.bar("wrong one of two poses after the filter, where it says that it is sure", "<= 0.1 %",
               f"{sure} %; {followed} % of all", float(sure) <= 0.1)  # fmt: skip


def _errors(looks: list[Look]) -> list[str]:
    seen = [each for each in looks if each.sight is not None]
    away = 1e3 * np.array([each.position_error for each in seen])
    turned = np.degrees([each.turn(each.sight.pose.T_camera_object) for each in seen if each.sight is not None])
    if not seen:
        return ["0.0", "-", "-", "-", "-"]
    numbers = (*np.quantile(away, [0.5, 0.95]), *np.quantile(turned, [0.5, 0.95]))
    return [f"{100 * len(seen) / len(looks):.1f}", *(f"{value:.2f}" for value in numbers)]


def _flips(looks: list[Look]) -> list[str]:
    """Least error, flagged, of those not flagged; after the filter, not sure, of those where it is sure."""
    both = [(each, each.sight, each.tracked) for each in looks if each.sight is not None and each.tracked is not None]
    first = np.array([each.flipped(False) for each, _, _ in both], dtype=bool)
    flagged = np.array([sight.pose.ambiguous for _, sight, _ in both], dtype=bool)
    kept = [(each, tracked) for each, _, tracked in both if not tracked.outlier]
    followed = np.array([each.flipped(tracked.other_branch) for each, tracked in kept], dtype=bool)
    sure = np.array([tracked.sure for _, tracked in kept], dtype=bool)
    parts = (first, flagged, first[~flagged], followed, ~sure, followed[sure])
    return [f"{100 * part.mean():.2f}" if len(part) else "none" for part in parts]
