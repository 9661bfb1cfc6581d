"""Cameras that are fixed to each other, calibrated from pictures of a board that they took together."""

import cv2
import numpy as np
import pinocchio as pin
import pytest

from rrtik_bench.sensing.synthetic_camera import Print, clean_picture, photograph
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import pose_from_rpy
from rrtik_ompl.sensing.markers.chessboard import Chessboard
from rrtik_ompl.sensing.markers.detection import charuco_board
from rrtik_ompl.sensing.rig import Rig
from rrtik_ompl.sensing.rig_calibration import calibrate_rig
from rrtik_tests.command_line import rrtik
from rrtik_tests.marker_views import CAMERA, facing
from rrtik_tests.sizes import how_many

ASIDE = pose_from_rpy([0.12, 0.0, 0.02], np.radians([0.0, -8.0, 5.0]))
BOARD = Chessboard(8, 7, 0.03)
CELLS = np.kron(np.indices((7, 8)).sum(axis=0) % 2, np.ones((20, 20))) * 255
SHEET = Print(np.pad(CELLS.astype(np.uint8), 20, constant_values=255), 0.03 / 20)


def together(sheet, count=7, far=(0.55, 0.7)):
    """Pictures of the first camera, and of the second one, which is rolled so that it may begin at the other end."""
    rng, first, other = np.random.default_rng(2), [], []
    for _ in range(count):
        T = facing(rng.uniform(-0.45, 0.45, 3), [*rng.uniform(-0.02, 0.06, 2), rng.uniform(*far)])
        for taken, seen in ((first, T), (other, ASIDE.actInv(T))):
            clean = clean_picture(CAMERA, [(seen, sheet)], rays=3)
            taken.append(photograph(cv2.GaussianBlur(clean, (0, 0), 0.6), rng, noise=0.007, blur=0.0))
    return first, other


@pytest.fixture(scope="module")
def taken():
    return together(SHEET)


def away(found):
    """How far a pose is from the true one: position [m], rotation [rad]."""
    return (float(np.linalg.norm(found.translation - ASIDE.translation)),
            float(np.linalg.norm(pin.log3(found.rotation.T @ ASIDE.rotation))))  # fmt: skip


@pytest.fixture(scope="module")
def found(taken):
    return calibrate_rig(taken, BOARD)


def test_a_rig_is_found_out_from_a_chessboard_and_says_how_sure_it_is(found):
    position, rotation = away(found.rig.poses[1])
    assert position < 3e-3
    assert rotation < np.deg2rad(0.5)
    assert 0.0 < found.rig.position_sigma < 2e-3
    both = [not any(reasons) for reasons in zip(*(each.unused for each in found.cameras), strict=True)]
    assert found.moments == (sum(both),)
    assert found.errors[0] < 0.15


def test_upside_down_in_one_camera_is_the_same_board(taken, found):
    turned = [np.ascontiguousarray(np.rot90(picture, 2)) for picture in taken[1]]
    upright, over = found.rig.poses[1], calibrate_rig((taken[0], turned), BOARD).rig.poses[1]
    about = np.abs(pin.log3(upright.rotation.T @ over.rotation))
    assert np.linalg.norm(about) == pytest.approx(np.pi, abs=0.02)
    assert np.linalg.norm(upright.translation - over.translation) < 3e-3


def test_a_board_with_markers_that_is_seen_in_part_will_do():
    board = charuco_board(8, 7, 0.03, 0.022, "4x4_50")
    drawn = np.asarray(board.generateImage((8 * 27, 7 * 27), marginSize=0, borderBits=1))
    pictures = together(
        Print(np.pad(drawn, 27, constant_values=255), 0.03 / 27), count=how_many(7, 5), far=(0.36, 0.45)
    )
    position, rotation = away(calibrate_rig(pictures, board).rig.poses[1])
    assert position < 3e-3
    assert rotation < np.deg2rad(0.5)


def test_a_rig_is_written_and_read_again(tmp_path, found):
    rig = found.rig
    assert [file.name for file in rig.save(tmp_path / "rig.yaml")] == ["rig_1.yaml", "rig_2.yaml"]
    again = Rig.load(tmp_path / "rig.yaml")
    assert np.allclose(again.poses[1].homogeneous, rig.poses[1].homogeneous, atol=1e-12)
    assert np.array_equal(again.cameras[1].matrix, rig.cameras[1].matrix)
    assert again.cameras[0].tone == rig.cameras[0].tone
    assert again.position_sigma == rig.position_sigma
    assert again.rotation_sigma == pytest.approx(rig.rotation_sigma, rel=1e-12)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda one, two: (one,), "two cameras or more"),
        (lambda one, two: (one, two[:-1]), "got 7, 6"),
        (lambda one, two: (one, [np.full_like(two[0], 90)] * 7), "camera 2: 0 of 7 photographs"),
        (lambda one, two: (one, [*two[1:], two[0]]), "camera 2: corners lie .* pixels off"),
    ],
)
def test_pictures_that_make_no_rig_are_refused_in_one_line(taken, change, said):
    with pytest.raises(InputError, match=said) as refused:
        calibrate_rig(change(*taken), BOARD)
    assert "\n" not in str(refused.value)


def test_a_chessboard_that_looks_the_same_upside_down_is_refused(taken):
    with pytest.raises(InputError, match="looks the same upside down"):
        calibrate_rig(taken, Chessboard(8, 8, 0.03))


def test_a_rig_is_calibrated_by_a_command_and_taken_by_sense(capsys, tmp_path, taken):
    for name, pictures in zip(("left", "right"), taken, strict=True):
        (tmp_path / name).mkdir()
        for k, picture in enumerate(pictures):
            cv2.imwrite(str(tmp_path / name / f"{k}.png"), picture)
    folders = tmp_path / "left", tmp_path / "right"
    options = ("--chessboard", "--columns", 8, "--rows", 7, "--square-mm", 30, "--out", tmp_path / "rig.yaml")
    code, out, err = rrtik(capsys, "markers", "calibrate", *folders, *options)
    assert (code, err) == (0, "")
    assert "camera 2 in the frame of camera 1: xyz 0.1" in out
    assert away(Rig.load(tmp_path / "rig.yaml").poses[1])[0] < 3e-3
    (tmp_path / "right" / "6.png").unlink()
    code, _, err = rrtik(capsys, "markers", "calibrate", *folders, *options)
    assert (code, err.count("\n")) == (2, 1)
    assert "right: has no picture to 6.png" in err
