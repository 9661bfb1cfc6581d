"""`rrtik markers sense --rig` as a person uses it: two cameras that take pictures at the same time, and bad input."""

import json

import cv2
import numpy as np
import pytest

from rrtik_bench.sensing.synthetic_camera import clean_picture, marker_print, photograph
from rrtik_ompl.base.poses import pose_from_rpy
from rrtik_ompl.sensing.markers.corner_pose import square_corners
from rrtik_ompl.sensing.markers.dictionaries import marker_cells
from rrtik_tests.command_line import rrtik
from rrtik_tests.marker_files import CAMERA
from rrtik_tests.marker_views import SIDE, facing

ASIDE = pose_from_rpy([0.35, 0.0, 0.05], np.radians([0.0, -17.0, 0.0]))
RIG = """version: 1
cameras:
- file: left.yaml
- file: right.yaml
  pose: {xyz: [0.35, 0.0, 0.05], rpy_deg: [0.0, -17.0, 0.0]}
position_sigma: 0.0002
rotation_sigma_deg: 0.01
"""
MAP = """version: 1
dictionary: 4x4_50
camera_pose: {xyz: [0, 0, 0]}
objects:
- {name: valve, role: target, markers: [{id: 7, side: 0.08}]}
"""
PLACES = [facing([0.08 * np.cos(k), 0.08 * np.sin(k), 0.2], [0.1, 0.02, 1.2]) for k in range(3)]  # nearly frontal


def photo(T, seed):
    clean = clean_picture(CAMERA, [(T, marker_print(marker_cells("4x4_50", 7), SIDE))], rays=4)
    return photograph(cv2.GaussianBlur(clean, (0, 0), 0.6), np.random.default_rng(seed), noise=0.01)


@pytest.fixture
def folder(tmp_path):
    for side, eye in (("left", pose_from_rpy([0, 0, 0], [0, 0, 0])), ("right", ASIDE)):
        (tmp_path / side).mkdir()
        CAMERA.save(tmp_path / f"{side}.yaml")
        for k, T in enumerate(PLACES):
            cv2.imwrite(str(tmp_path / side / f"{k}.png"), photo(eye.actInv(T), k + 100 * (side == "right")))
    (tmp_path / "rig.yaml").write_text(RIG)
    (tmp_path / "map.yaml").write_text(MAP)
    return tmp_path


def sense(capsys, folder, *arguments):
    return rrtik(capsys, "markers", "sense", *arguments, "--map", folder / "map.yaml")


def test_two_folders_are_sensed_together_and_better_than_one(capsys, folder):
    both, rig = (folder / "left", folder / "right"), ("--rig", folder / "rig.yaml")
    code, out, err = sense(capsys, folder, *both, *rig, "--json", "--picture", folder / "seen.png")
    assert (code, err) == (0, "")
    together = [json.loads(line)["objects"][0] for line in out.splitlines()]
    code, out, _ = sense(capsys, folder, folder / "left", "--camera-file", folder / "left.yaml", "--json")
    alone = [json.loads(line)["objects"][0] for line in out.splitlines()]
    assert code == 0
    assert len(together) == len(alone) == len(PLACES)
    for found, one, T in zip(together, alone, PLACES, strict=True):
        assert found["markers"] == [7]
        assert not found["refused"]
        assert found["position_sigma"] < one["position_sigma"]
        assert np.linalg.norm(found["xyz"] - T.translation) < 4.0 * found["position_sigma"]
    drawn, plain = (cv2.imread(str(folder / name)) for name in ("seen.png", "left/2.png"))
    T = PLACES[2]
    for corner in CAMERA.project(square_corners(SIDE) @ T.rotation.T + T.translation):
        x, y = np.rint(corner).astype(int)
        assert (drawn != plain)[y - 2 : y + 3, x - 2 : x + 3].any()


def test_a_marker_that_only_the_second_camera_sees_is_in_the_frame_of_the_first(capsys, folder):
    for k in range(len(PLACES)):
        cv2.imwrite(str(folder / "left" / f"{k}.png"), np.full((480, 640), 90, dtype=np.uint8))
    code, out, _ = sense(
        capsys, folder, folder / "left", folder / "right", "--rig", folder / "rig.yaml", "--json", "--smooth",
        "--picture", folder / "seen.png",
    )  # fmt: skip
    assert code == 0
    last = json.loads(out.splitlines()[-1])["objects"][0]
    assert np.linalg.norm(last["xyz"] - PLACES[-1].translation) < 0.02


def spoilt(folder, name, old, new):
    file = folder / name
    file.write_text(file.read_text().replace(old, new))


@pytest.mark.parametrize(
    ("prepare", "sources", "message"),
    [
        (lambda f: None, ("left",), "has 2 cameras and needs as many sources, got 1"),
        (lambda f: (f / "right" / "2.png").unlink(), ("left", "right"), "right: has no picture to 2.png"),
        (lambda f: spoilt(f, "rig.yaml", "right.yaml", "wrong.yaml"), ("left", "right"), "no such file"),
        (lambda f: spoilt(f, "rig.yaml", "  pose: ", "  place: "), ("left", "right"), "unknown key 'place'"),
        (lambda f: (f / "rig.yaml").write_text("version: 1\ncameras:\n- file: left.yaml\n- file: right.yaml\n"),
         ("left", "right"), "rig.yaml:4: cameras[1]: needs a pose in the frame of the first camera"),
        (lambda f: cv2.imwrite(str(f / "right" / "0.png"), np.full((100, 100), 90, np.uint8)), ("left", "right"),
         "0.png: 100 x 100 pixels"),
        (lambda f: (f / "left" / "1.png").write_bytes(b""), ("left", "right"), "1.png: is not an image"),
    ],
)  # fmt: skip
def test_what_no_rig_can_sense_is_one_line(capsys, folder, prepare, sources, message):
    prepare(folder)
    code, _, err = sense(capsys, folder, *(folder / each for each in sources), "--rig", folder / "rig.yaml")
    assert code == 2
    assert message in err
    assert err.count("\n") == 1


def test_a_rig_or_a_camera_is_needed_and_not_both(capsys, folder):
    for options in ((), ("--rig", folder / "rig.yaml", "--camera-file", folder / "left.yaml")):
        code, _, err = sense(capsys, folder, folder / "left", folder / "right", *options)
        assert (code, err.count("\n")) == (2, 1)
        assert "--camera-file FILE, or --rig FILE" in err
    code, _, err = sense(capsys, folder, folder / "left", folder / "right", "--camera-file", folder / "left.yaml")
    assert code == 2
    assert "need --rig FILE" in err


def test_films_that_do_not_begin_together_or_have_other_rates_are_refused(capsys, folder):
    for side, rate in (("left", 10), ("right", 5)):
        film = cv2.VideoWriter(str(folder / f"{side}.avi"), cv2.VideoWriter.fourcc(*"MJPG"), rate, (640, 480))
        for k in range(len(PLACES)):
            film.write(cv2.imread(str(folder / side / f"{k}.png")))
        film.release()
    code, out, err = sense(capsys, folder, folder / "left.avi", folder / "right.avi", "--rig", folder / "rig.yaml")
    assert code == 2
    assert "0.10 s later than the other camera's picture" in err
    assert out.count("\n") == 1
