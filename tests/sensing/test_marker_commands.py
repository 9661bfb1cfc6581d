"""`rrtik markers` as a person uses it: sensing a scene from a picture, and bad input."""

import json

import cv2
import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.problem_files.scene import load_scene
from rrtik_tests.command_line import rrtik
from rrtik_tests.marker_files import CAMERA, MAP


@pytest.fixture
def folder(tmp_path, taken):
    cv2.imwrite(str(tmp_path / "view.png"), taken[0])
    (tmp_path / "map.yaml").write_text(MAP)
    CAMERA.save(tmp_path / "camera.yaml")
    return tmp_path


def sense(capsys, folder, source, *more):
    return rrtik(
        capsys, "markers", "sense", source, "--camera-file", folder / "camera.yaml", "--map", folder / "map.yaml", *more
    )


def test_sensing_writes_scene_and_picture(capsys, folder, taken):
    code, out, err = sense(
        capsys, folder, folder / "view.png", "--scene", folder / "s.yaml", "--picture", folder / "p.png", "--json"
    )
    assert (code, err) == (0, "")
    valve = next(o for o in json.loads(out)["objects"] if o["name"] == "valve")
    assert valve["frame"] == "base"
    assert valve["xyz"] == pytest.approx(taken[1].translation, abs=2e-3)
    (body,) = load_scene(folder / "s.yaml").obstacles
    assert body.pose.translation == pytest.approx(
        (taken[1] * pin.SE3(np.eye(3), np.array([0, 0, -0.01]))).translation, abs=2e-3
    )
    assert body.margin > 3.0 * valve["position_sigma"]
    assert body.margin < 0.01
    drawn = cv2.imread(str(folder / "p.png"))
    assert (drawn != taken[0]).any()


def test_margins_of_what_is_sensed_can_be_switched_off(capsys, folder):
    for sigmas, code in ((0, 0), (-1, 2), ("nan", 2)):
        ended, _, err = sense(capsys, folder, folder / "view.png", "--scene", folder / "s.yaml", "--sigmas", sigmas)
        assert ended == code
        assert err.count("sigmas") == err.count("\n") == (code == 2)
    assert load_scene(folder / "s.yaml").obstacles[0].margin == 0.0


@pytest.mark.parametrize(
    ("prepare", "message"),
    [
        (lambda f: cv2.imwrite(str(f / "view.png"), np.full((480, 640), 90, np.uint8)), "no marker in view"),
        (lambda f: (f / "map.yaml").write_text(MAP.replace("4x4_50", "apriltag_36h11")), "but of 4x4_50"),
        (
            lambda f: (f / "map.yaml").write_text(MAP.replace("id: 3", "id: 30").replace("id: 7", "id: 31")),
            "add their ids",
        ),
        (lambda f: (f / "view.png").write_text("x"), "is not an image"),
        (lambda f: (f / "camera.yaml").unlink(), "no such file"),
        (lambda f: cv2.imwrite(str(f / "view.png"), np.full((100, 100), 90, np.uint8)), "100 x 100 pixels"),
    ],
)
def test_what_cannot_be_sensed_is_one_line(capsys, folder, prepare, message):
    prepare(folder)
    code, _, err = sense(capsys, folder, folder / "view.png")
    assert code == 2
    assert message in err
    assert err.count("\n") == 1
