"""Camera files, marker maps, sheets, calibration, pictures from everywhere."""

import cv2
import numpy as np
import pytest

from rrtik_bench.sensing.synthetic_camera import Print, clean_picture, photograph
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.sensing.calibration import calibrate
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.cameras.pictures import pictures_from, read_picture
from rrtik_ompl.sensing.markers.detection import charuco_board, find_markers
from rrtik_ompl.sensing.markers.marker_map import MarkerMap
from rrtik_ompl.sensing.markers.sheets import print_board, print_markers
from rrtik_tests.marker_files import CAMERA, MAP
from rrtik_tests.marker_views import facing


def test_a_camera_file_gives_back_the_camera(tmp_path):
    CAMERA.save(tmp_path / "c.yaml")
    again = Camera.load(tmp_path / "c.yaml")
    assert np.array_equal(again.matrix, CAMERA.matrix)
    assert np.array_equal(again.distortion, CAMERA.distortion)
    assert (again.width, again.height) == (640, 480)


@pytest.mark.parametrize(
    ("word", "instead", "place"), [("fx:", "fz:", "fz"), ("size: [640, 480]", "size: [640]", "size")]
)
def test_a_slip_in_a_camera_file_is_named(tmp_path, word, instead, place):
    CAMERA.save(tmp_path / "c.yaml")
    (tmp_path / "c.yaml").write_text((tmp_path / "c.yaml").read_text().replace(word, instead, 1))
    with pytest.raises(InputError, match=place):
        Camera.load(tmp_path / "c.yaml")


@pytest.mark.parametrize(
    ("word", "instead", "message"),
    [
        ("4x4_50", "4x4_5", "no dictionary of markers"),
        ("id: 7", "id: 70", "markers 0 to 49"),
        ("role: target", "role: goal", "role"),
        ("side: 0.08", "side: -1", "side"),
        ("solids", "solid", "solids"),
        ("role: base", "role: obstacle", "where the base is"),
    ],
)
def test_a_slip_in_a_marker_map_is_named(tmp_path, word, instead, message):
    (tmp_path / "m.yaml").write_text(MAP.replace(word, instead, 1))
    with pytest.raises(InputError, match=message) as error:
        MarkerMap.load(tmp_path / "m.yaml")
    assert "m.yaml" in str(error.value)


def test_printed_markers_are_found_again_at_their_size(tmp_path):
    assert print_markers(tmp_path / "sheet.png", range(4), side=0.04, dictionary="4x4_50", dots_per_inch=254) == 1
    gray = cv2.imread(str(tmp_path / "sheet.png"), cv2.IMREAD_GRAYSCALE)
    found = find_markers(gray, "4x4_50")
    assert [m.number for m in found] == [0, 1, 2, 3]
    assert [m.side for m in found] == pytest.approx([400.0] * 4, abs=1.5)  # ten dots a millimetre


def test_markers_that_do_not_fit_one_sheet_go_on_several(tmp_path):
    assert print_markers(tmp_path / "sheet.png", range(5), side=0.08, dictionary="4x4_50", dots_per_inch=50) == 3
    assert len(list(tmp_path.glob("sheet-*.png"))) == 3
    assert print_markers(tmp_path / "sheet.pdf", range(5), side=0.08, dictionary="4x4_50") == 3
    assert (tmp_path / "sheet.pdf").read_bytes().startswith(b"%PDF")


@pytest.mark.parametrize("wrong", [{"side": 0.5}, {"side": 0.0}, {"paper": "b5"}, {"dictionary": "x"}])
def test_sheets_that_cannot_be_are_refused(tmp_path, wrong):
    with pytest.raises(InputError):
        print_markers(tmp_path / "s.pdf", [1], **{"side": 0.08, "dictionary": "4x4_50"} | wrong)


def test_a_board_that_does_not_fit_is_refused(tmp_path):
    with pytest.raises(InputError, match="does not fit"):
        print_board(tmp_path / "b.pdf", columns=8, rows=12)


def test_a_camera_is_found_out_from_photographs_of_a_board(tmp_path):
    rng = np.random.default_rng(0)
    board = charuco_board(6, 8, 0.03, 0.022, "4x4_50")
    cells = np.pad(
        np.asarray(board.generateImage((6 * 20, 8 * 20), marginSize=0, borderBits=1)), 10, constant_values=255
    )
    sheet = Print(cells, 0.03 / 20)
    views = []
    for _ in range(7):
        place = [*rng.uniform(-0.04, 0.04, 2), rng.uniform(0.3, 0.42)]
        clean = clean_picture(CAMERA, [(facing(rng.uniform(-0.5, 0.5, 3), place), sheet)], rays=2)
        views.append(photograph(clean, rng, noise=0.007))
    blank = np.full_like(views[0], 128)
    found = calibrate([*views, blank], board)
    truth = CAMERA.matrix[[0, 1, 0, 1], [0, 1, 2, 2]]
    away = np.abs(found.camera.matrix[[0, 1, 0, 1], [0, 1, 2, 2]] - truth)
    assert (away < 4.0 * found.sigmas).all()
    assert (found.sigmas < 10.0).all()
    assert "corners of the board" in found.unused[-1]
    assert np.isnan(found.view_errors[-1])
    found.save(tmp_path / "c.yaml")
    assert np.array_equal(Camera.load(tmp_path / "c.yaml").matrix, found.camera.matrix)
    with pytest.raises(InputError, match="at least 5"):
        calibrate([*views[:4], blank], board)


def test_pictures_come_from_files_folders_and_videos(tmp_path, taken):
    cv2.imwrite(str(tmp_path / "a.png"), taken[0])
    cv2.imwrite(str(tmp_path / "b.png"), taken[0])
    assert [p.name for p in pictures_from(tmp_path)] == ["a.png", "b.png"]
    writer = cv2.VideoWriter(str(tmp_path / "v.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 10.0, (640, 480))
    for _ in range(3):
        writer.write(taken[0])
    writer.release()
    frames = list(pictures_from(tmp_path / "v.avi"))
    assert [frame.time for frame in frames] == pytest.approx([0.0, 0.1, 0.2])
    assert frames[0].pixels.shape == (480, 640, 3)


def test_what_is_no_picture_is_refused(tmp_path):
    (tmp_path / "text.png").write_text("hello")
    (tmp_path / "empty.png").touch()
    (tmp_path / "empty.mp4").write_text("no video")
    for name in ("text.png", "empty.png", "missing.png"):
        with pytest.raises(InputError, match=name):
            read_picture(tmp_path / name)
    with pytest.raises(InputError, match="check the name"):
        read_picture("a\0.png")
    with pytest.raises(InputError, match="not a video"):
        list(pictures_from(tmp_path / "empty.mp4"))
    with pytest.raises(InputError, match="cannot be opened"):
        list(pictures_from(77))
    for nothing in (-1, True, None, 0.5):
        with pytest.raises(InputError, match=r"number of a camera|name of a file"):
            list(pictures_from(nothing))
