"""Camera files of others, chessboards, and the tone that is kept per camera."""

import cv2
import numpy as np
import pytest

from rrtik_bench.sensing.synthetic_camera import Print, clean_picture, marker_print, photograph
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.sensing.calibration import calibrate
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.markers.chessboard import Chessboard
from rrtik_ompl.sensing.markers.corner_pose import pose_of_square
from rrtik_ompl.sensing.markers.detection import charuco_board, dictionary_of, find_markers
from rrtik_ompl.sensing.markers.dictionaries import marker_cells
from rrtik_ompl.sensing.markers.lighting import coded
from rrtik_tests.marker_views import CAMERA, SIDE, facing

ROS = """\
image_width: 640
image_height: 480
camera_name: narrow_stereo
camera_matrix:
  rows: 3
  cols: 3
  data: [438.78, 0.0, 305.59, 0.0, 437.35, 243.73, 0.0, 0.0, 1.0]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.361976, 0.110510, 0.001014, 0.000505, 0.0]
rectification_matrix:
  rows: 3
  cols: 3
  data: [0.999978, 0.002789, -0.006046, -0.002816, 0.999986, -0.004401, 0.006034, 0.004417, 0.999972]
projection_matrix:
  rows: 3
  cols: 4
  data: [393.65, 0.0, 322.79, 0.0, 0.0, 393.65, 241.09, 0.0, 0.0, 0.0, 1.0, 0.0]
"""


@pytest.mark.parametrize("ending", ["yaml", "xml"])
@pytest.mark.parametrize("lens", [(0.05, -0.12, 0.0005, -0.0007, 0.03), (0.1, -0.2, 0.0, 0.0), (0.1,) * 5 + (0.0,) * 9])
def test_a_camera_that_opencv_stored_is_read_to_the_bit(tmp_path, ending, lens):
    file = tmp_path / f"c.{ending}"
    storage = cv2.FileStorage(str(file), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", 640)
    storage.write("image_height", 480)
    storage.write("camera_matrix", CAMERA.matrix)
    storage.write("distortion_coefficients", np.array(lens)[None])
    storage.release()
    found = Camera.load(file)
    assert np.array_equal(found.matrix, CAMERA.matrix)
    assert np.array_equal(found.distortion, (*lens, 0.0)[:5])
    assert (found.width, found.height) == (640, 480)


def test_a_camera_info_of_ros_is_read(tmp_path):
    file = tmp_path / "ost.yaml"
    file.write_text(ROS)
    found = Camera.load(file)
    assert found.matrix[[0, 1, 0, 1], [0, 1, 2, 2]] == pytest.approx([438.78, 437.35, 305.59, 243.73])
    assert found.distortion == pytest.approx([-0.361976, 0.110510, 0.001014, 0.000505, 0.0])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (ROS.replace("plumb_bob", "omni"), "distortion_model"),
        (ROS.replace("640", "-3"), "image_width"),
        (ROS.replace("cols: 3\n  data: [438.78, ", "cols: 3\n  data: [", 1), "3 x 3 numbers, got 8"),
        (ROS.replace("0.000505, 0.0]", "0.000505, 0.0, 0.2]"), "6 coefficients"),
        ("%YAML:1.0\n---\na: 3\n", "no camera_matrix"),
        ("%YAML:1.0\n---\n{[", "not a file of OpenCV"),
        ("<?xml version='1.0'?><opencv_storage><x>", "not a file of OpenCV"),
    ],
)
def test_what_is_no_camera_of_this_kind_is_refused_in_one_line(tmp_path, text, said):
    file = tmp_path / "c.yaml"
    file.write_text(text)
    with pytest.raises(InputError, match=said) as refused:
        Camera.load(file)
    assert "c.yaml" in str(refused.value)
    assert "\n" not in str(refused.value)


KALIBR = """\
cam0:
  camera_model: pinhole
  distortion_model: radtan
  distortion_coeffs: [-0.36, 0.11, 0.001, 0.0005]
  intrinsics: [438.78, 437.35, 305.59, 243.73]
  resolution: [640, 480]
  rostopic: /camera
"""


def test_a_file_of_kalibr_is_read_or_named_as_such(tmp_path):
    file = tmp_path / "camchain.yaml"
    file.write_text(KALIBR)
    found = Camera.load(file)
    assert found.matrix[[0, 1, 0, 1], [0, 1, 2, 2]].tolist() == [438.78, 437.35, 305.59, 243.73]
    assert found.distortion.tolist() == [-0.36, 0.11, 0.001, 0.0005, 0.0]
    assert (found.width, found.height) == (640, 480)
    for wrong in (KALIBR.replace("pinhole", "omni"), KALIBR.replace("resolution", "size")):
        file.write_text(wrong)
        with pytest.raises(InputError, match=r"camchain.yaml:\d+: cam0: a file of kalibr"):
            Camera.load(file)


def test_a_file_of_opencv_without_the_pictures_size_says_what_is_missing(tmp_path):
    file = tmp_path / "intrinsics.yml"
    storage = cv2.FileStorage(str(file), cv2.FILE_STORAGE_WRITE)
    storage.write("M1", CAMERA.matrix)
    storage.release()
    with pytest.raises(InputError, match="image_width"):
        Camera.load(file)


def views(sheet, count, far=(0.3, 0.42), tone=0.0):
    rng = np.random.default_rng(0)
    for _ in range(count):
        place = [*rng.uniform(-0.04, 0.04, 2), rng.uniform(*far)]
        clean = clean_picture(CAMERA, [(facing(rng.uniform(-0.5, 0.5, 3), place), sheet)], rays=3)
        yield photograph(coded(cv2.GaussianBlur(clean, (0, 0), 0.6), tone), rng, noise=0.007, blur=0.0)


def chessboard():
    cells = np.kron(np.indices((7, 8)).sum(axis=0) % 2, np.ones((20, 20))) * 255
    return Print(np.pad(cells.astype(np.uint8), 20, constant_values=255), 0.03 / 20)


def test_a_plain_chessboard_calibrates_a_camera():
    found = calibrate(list(views(chessboard(), 7, (0.5, 0.6))), Chessboard(8, 7, 0.03))
    truth = CAMERA.matrix[[0, 1, 0, 1], [0, 1, 2, 2]]
    assert np.abs(found.camera.matrix[[0, 1, 0, 1], [0, 1, 2, 2]] - truth).max() < 6.0  # of 880; k3 is not estimated
    assert found.error < 0.12
    assert found.camera.tone == 0.0
    with pytest.raises(InputError, match="in view as a whole"):
        calibrate([np.full((480, 640), 128, dtype=np.uint8)] * 6, Chessboard(8, 7, 0.03))


@pytest.mark.parametrize(("far", "tone", "turned"), [((0.5, 0.6), 1.0, False), ((0.9, 1.1), 1.0, True),
                                                     ((0.9, 1.1), 0.5, False), ((0.9, 1.1), 0.0, True)])  # fmt: skip
def test_a_chessboard_tells_the_tone_of_its_photographs(far, tone, turned):
    taken = list(views(chessboard(), 5, far, tone))
    board = Chessboard(7, 8, 0.03) if turned else Chessboard(8, 7, 0.03)
    found = calibrate([np.rot90(each) for each in taken] if turned else taken, board).camera
    assert found.tone == pytest.approx(tone, abs=0.25)


def test_a_camera_whose_tone_a_chessboard_told_places_markers_as_well_as_it_says(tmp_path):
    camera = calibrate(list(views(chessboard(), 5, (0.5, 0.6), 1.0)), Chessboard(8, 7, 0.03)).camera
    camera.save(tmp_path / "c.yaml")
    tone = Camera.load(tmp_path / "c.yaml").tone
    sheet, squares = marker_print(marker_cells("4x4_50", 7), SIDE), []
    for seed, place in enumerate(([0.1, -0.05, 0.7], [0.05, 0.1, 1.0], [-0.1, 0.0, 1.4])):
        T, rng = facing([0.5, 0.3 - 0.3 * seed, 0.2], place), np.random.default_rng(seed)
        light = cv2.GaussianBlur(clean_picture(CAMERA, [(T, sheet)], rays=6), (0, 0), 0.6)
        gray = photograph(coded(light, 1.0), rng, noise=0.008, blur=0.0)
        (marker,) = find_markers(gray, "4x4_50", tone=tone)
        found = pose_of_square(CAMERA, marker.corners, SIDE, spread=marker.spread)
        away = found.T_camera_object.translation - T.translation
        assert np.linalg.norm(away) < 2.5e-3 * T.translation[2] ** 2
        squares.append(float(away @ np.linalg.solve(found.covariance[:3, :3], away)))
    assert max(squares) < 14.2  # 0.3 % of honest ones are larger


@pytest.mark.parametrize("wrong", [(3, 8, 0.03), (8, 8, 0.0)])
def test_what_is_no_chessboard_is_refused(wrong):
    with pytest.raises(InputError, match="4 x 4 squares"):
        Chessboard(*wrong)


def test_a_calibration_keeps_the_tone_of_the_camera(tmp_path):
    board = charuco_board(6, 8, 0.03, 0.02, "4x4_50")
    assert dictionary_of(board) == "4x4_50"
    drawn = np.asarray(board.generateImage((6 * 27, 8 * 27), marginSize=0, borderBits=1))
    sheet = Print(np.pad(drawn, 9, constant_values=255), 0.03 / 27)
    found = calibrate(list(views(sheet, 5, tone=1.0)), board).camera
    assert found.tone == pytest.approx(1.0, abs=0.2)
    found.save(tmp_path / "c.yaml")
    assert Camera.load(tmp_path / "c.yaml").tone == found.tone
    assert Camera(CAMERA.matrix, 640, 480).tone is None
