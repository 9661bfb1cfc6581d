"""What a person calls in this room, each argument given each odd value: an answer, or one line of ours."""

import os
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.errors import InputError, RrtikError
from rrtik_ompl.sensing import rig_file
from rrtik_ompl.sensing.calibration import calibrate
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.cameras.pan_tilt_zoom import PanTiltZoom
from rrtik_ompl.sensing.cameras.pictures import Picture, pictures_from, read_picture
from rrtik_ompl.sensing.depth import cloud_from_depth
from rrtik_ompl.sensing.markers.chessboard import Chessboard
from rrtik_ompl.sensing.markers.detection import charuco_board
from rrtik_ompl.sensing.markers.dictionaries import marker_cells
from rrtik_ompl.sensing.markers.marker_map import GraspType, MarkedObject, MarkerMap, MountedMarker
from rrtik_ompl.sensing.markers.sheets import print_board, print_markers
from rrtik_ompl.sensing.rig import Rig, detect_in_rig
from rrtik_ompl.sensing.rig_calibration import calibrate_rig
from rrtik_ompl.sensing.rig_file import pictures_together
from rrtik_ompl.sensing.scene_feed import scenes_of_pictures
from rrtik_ompl.sensing.scene_from_view import scene_from_image
from rrtik_ompl.sensing.sensor import Sensor
from rrtik_ompl.sensing.sight import detect_objects
from rrtik_tests.marker_views import BOX, CAMERA, STAND


class OnlyFspath:
    """A path that is nothing else."""

    def __init__(self, path):
        self._path = path

    def __fspath__(self):
        return self._path


NAN = float("nan")
ODD = [None, True, 5, -1, 0, 0.5, 7.5, 1e308, NAN, float("inf"), 1j, 10**400, "", "x", "\0", "é\n", b"x", (), [], [1]]
ODD += [["a"], [None], [[1, 2]], [[0, NAN]] * 3, [["a", "b"]], [{}], {}, {"a": 1}, {1: 2}, {"xyz": [1]}, {1, 2}]
ODD += [np.zeros(3), np.zeros((4, 4)), np.eye(4), np.array(["a"]), np.array(1.0), np.int64(7), np.timedelta64(7)]
ODD += [object(), len, int, OnlyFspath("x"), OnlyFspath(b"x")]

RIG = Rig((CAMERA, CAMERA), (pin.SE3.Identity(), pin.SE3.Identity()))
MAP = MarkerMap("4x4_50", (BOX, STAND))
GRAY = np.zeros((48, 64), np.uint8)
BOARD = Chessboard(6, 7, 0.03)
SQUARE = MountedMarker(1, 0.08)


def first_picture(source):
    return next(pictures_from(source))


def first_pictures(sources):
    return next(pictures_together(sources), None)


def all_views(*args):
    return list(scenes_of_pictures(*args))


DOORS = {
    "Camera": (Camera, [CAMERA.matrix, 640, 480, CAMERA.distortion], {"sigmas": np.zeros(9), "tone": 0.0}),
    "Chessboard": (Chessboard, [6, 7, 0.03], {}),
    "GraspType": (GraspType, ["g", [pin.SE3.Identity()], 0.1, 0.1], {}),
    "MarkedObject": (MarkedObject, ["n", "target", (SQUARE,), (), (), False], {}),
    "MarkerMap": (MarkerMap, ["4x4_50", (BOX, STAND), None], {}),
    "MountedMarker": (MountedMarker, [1, 0.08, pin.SE3.Identity(), 0.0], {}),
    "PanTiltZoom": (PanTiltZoom, [[CAMERA], [0.0], pin.SE3.Identity(), pin.SE3.Identity()], {}),
    "Rig": (Rig, [(CAMERA, CAMERA), (pin.SE3.Identity(), pin.SE3.Identity()), 0.0, 0.0], {}),
    "Sensor": (Sensor, [CAMERA, MAP], {"sigmas": 3.0}),
    "calibrate": (calibrate, [[GRAY], BOARD], {}),
    "calibrate_rig": (calibrate_rig, [[[GRAY], [GRAY]], BOARD], {}),
    "charuco_board": (charuco_board, [6, 8, 0.03, 0.02, "4x4_50"], {}),
    "cloud_from_depth": (
        cloud_from_depth,
        [np.ones((480, 640)), CAMERA, pin.SE3.Identity()],
        {"radius": 0.01, "scale": 1.0, "nearest": 0.1, "farthest": 3.0, "every": 8},
    ),
    "detect_in_rig": (detect_in_rig, [[GRAY, GRAY], RIG, MAP], {}),
    "detect_objects": (detect_objects, [GRAY, CAMERA, MAP], {}),
    "Camera.load": (Camera.load, ["camera.yaml"], {}),
    "MarkerMap.load": (MarkerMap.load, ["map.yaml"], {}),
    "Rig.load": (Rig.load, ["rig.yaml"], {}),
    "marker_cells": (marker_cells, ["4x4_50", 1], {}),
    "pictures_from": (first_picture, ["a.png"], {}),
    "pictures_together": (first_pictures, [["a.png", "b.png"]], {}),
    "print_board": (
        print_board,
        ["b.png"],
        {
            "columns": 6,
            "rows": 8,
            "square": 0.03,
            "marker": 0.022,
            "dictionary": "4x4_50",
            "paper": "a4",
            "dots_per_inch": 20,
        },
    ),
    "print_markers": (
        print_markers,
        ["m.png", [1]],
        {"side": 0.05, "dictionary": "4x4_50", "paper": "a4", "dots_per_inch": 20},
    ),
    "project": (CAMERA.project, [np.ones((1, 3))], {}),
    "rays": (CAMERA.rays, [np.ones((1, 2))], {}),
    "read_picture": (read_picture, ["a.png"], {}),
    "Camera.save": (CAMERA.save, ["c.yaml"], {}),
    "Rig.save": (RIG.save, ["r.yaml"], {}),
    "scenes_of_pictures": (all_views, [[], Sensor(CAMERA, MAP), None], {}),
    "scene_from_image": (scene_from_image, [GRAY, CAMERA, MAP], {"sigmas": 3.0}),
}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder, which is the current one: some odd values are names of files that are written."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def odd_calls(name):
    """The calls of a door with one odd value each, and what they are."""
    door, args, options = DOORS[name]
    for odd in ODD:
        for k in range(len(args)):
            yield f"argument {k}, {odd!r:.40}", partial(door, *args[:k], odd, *args[k + 1 :], **options)
        for key in options:
            yield f"{key}, {odd!r:.40}", partial(door, *args, **options | {key: odd})


@pytest.mark.parametrize("name", DOORS)
def test_an_odd_value_is_answered_or_refused_in_one_line(name, folder):
    wrong = []
    for said, call in odd_calls(name):
        try:
            call()
        except RrtikError as error:
            if not str(error).isprintable():
                wrong.append(f"{said}: {error!r}")
        except Exception as error:
            wrong.append(f"{said}: {error!r:.200}")
    assert wrong == []


REFUSED = {
    "half a column": (lambda: Chessboard(7.5, 6, 0.03), "columns of a chessboard must be a whole number"),
    "rows as text": (lambda: Chessboard(7, "6", 0.03), "rows of a chessboard must be a whole number"),
    "no side": (lambda: Chessboard(7, 6, None), "side of a square"),
    "a side that is no number": (lambda: Chessboard(7, 6, NAN), "side of a square"),
    "half a column of a board": (lambda: charuco_board(6.5, 8, 0.03, 0.02, "4x4_50"), "columns of a board"),
    "a marker as text": (lambda: charuco_board(6, 8, 0.03, "a", "4x4_50"), "side of a marker"),
    "a list of dictionaries": (lambda: charuco_board(6, 8, 0.03, 0.02, ["4x4_50"]), "dictionary of markers must be"),
    "cells of no dictionary": (lambda: marker_cells({}, 1), "dictionary of markers must be"),
    "cells of half a marker": (lambda: marker_cells("4x4_50", 1.5), "number of a marker must be a whole number"),
    "cells of True": (lambda: marker_cells("4x4_50", True), "number of a marker must be a whole number"),
    "one source alone": (lambda: first_pictures("film.mp4"), "sources of pictures must be a list"),
    "one camera alone": (lambda: first_pictures(0), "sources of pictures must be a list"),
    "a source of no kind": (lambda: first_pictures([1.5]), "name of a file"),
    "no picture in a feed": (lambda: all_views([GRAY], Sensor(CAMERA, MAP)), "picture of a scene feed must be"),
    "a rig of no board": (lambda: calibrate_rig([[GRAY], [GRAY]], None), "board must be"),
    "a rig of one picture": (lambda: calibrate_rig([5, 5], BOARD), "pictures of a camera must be a list"),
    "a path of bytes": (lambda: Camera.load(OnlyFspath(b"c.yaml")), "name of a file"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_the_line_names_what_is_wrong(case):
    call, message = REFUSED[case]
    with pytest.raises(InputError, match=message):
        call()


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"numbers": 1}, "numbers of markers must be a list"),
        ({"numbers": "1"}, "numbers of markers must be a list"),
        ({"numbers": [0.5]}, "number of a marker"),
        ({"side": "0.05"}, "side of a marker"),
        ({"side": NAN}, "side of a marker"),
        ({"paper": 4}, "paper must be of type str"),
        ({"dictionary": None}, "dictionary of markers must be"),
        ({"path": 1}, "name of a file"),
        ({"dots_per_inch": 19}, "dots_per_inch must be a whole number of at least 20"),
        ({"dots_per_inch": 20.5}, "dots_per_inch must be a whole number"),
        ({"dots_per_inch": 2401}, "dots_per_inch: 2401 are more than the 2400"),
    ],
    ids=str,
)
def test_a_sheet_that_cannot_be_is_refused_by_name(folder, wrong, message):
    good = {"path": "m.png", "numbers": [1], "side": 0.05, "dictionary": "4x4_50", "dots_per_inch": 20}
    with pytest.raises(InputError, match=message):
        print_markers(**good | wrong)
    if "dots_per_inch" in wrong:
        with pytest.raises(InputError, match=message):
            print_board("b.png", **wrong)
    assert os.listdir(folder) == []


def test_numbers_may_come_from_anything_that_can_be_iterated(folder):
    assert print_markers("m.png", (k for k in (np.int64(1), 2)), side=np.float32(0.05), dictionary="4x4_50") == 1


def test_numbers_of_numpy_make_the_same_chessboard():
    board = Chessboard(np.int64(6), np.int32(7), np.float32(0.5))
    assert board == Chessboard(6, 7, 0.5)
    assert [type(each) for each in (board.columns, board.rows, board.square)] == [int, int, float]


@pytest.mark.parametrize("kind", [str, Path, OnlyFspath])
def test_pictures_together_takes_every_kind_of_path(folder, kind):
    for name in ("a.png", "b.png"):
        cv2.imwrite(name, GRAY)
    ((first, second),) = pictures_together(kind(name) for name in ("a.png", "b.png"))
    assert (first.name, second.name) == ("a.png", "b.png")


def test_sources_that_are_cameras_are_not_matched_by_time(folder, monkeypatch):
    pictures = [Picture(np.zeros((2, 2, 3), np.uint8), f"camera {k}", float(k)) for k in (0, 1)]
    monkeypatch.setattr(rig_file, "pictures_from", lambda source: iter([pictures[source]]))
    assert list(pictures_together([0, 1])) == [tuple(pictures)]
