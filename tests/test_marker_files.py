"""Camera files, marker maps, sheets, pictures from everywhere, statistics, and the commands around them."""

import json

import cv2
import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.cli import app as cli
from rrtik_ompl.errors import InputError
from rrtik_ompl.problem_files.scene import load_scene
from rrtik_ompl.sensing.cameras.calibration import calibrate
from rrtik_ompl.sensing.cameras.camera_file import load_camera, save_camera
from rrtik_ompl.sensing.cameras.pictures import pictures_from, read_picture
from rrtik_ompl.sensing.cameras.synthetic_camera import Print, clean_picture, marker_print, photograph, published_camera
from rrtik_ompl.sensing.markers.detection import charuco_board, find_markers, marker_cells
from rrtik_ompl.sensing.markers.marker_map_file import load_marker_map
from rrtik_ompl.sensing.markers.sheets import print_board, print_markers
from rrtik_ompl.sensing.precision import Series, series_of

CAMERA = published_camera((0.05, -0.12, 0.0005, -0.0007, 0.0))
MAP = """version: 1
dictionary: 4x4_50
objects:
  - {name: stand, role: base, markers: [{id: 3, side: 0.08}]}
  - name: valve
    role: target
    markers: [{id: 7, side: 0.08}]
    solids: [{name: body, box: [0.08, 0.08, 0.02], pose: {xyz: [0, 0, -0.01]}}]
    grasps: [{type: front, levels: [{xyz: [0, 0, 0.05], rpy_deg: [180, 0, 0]}]}]
"""


def facing(turn, place):
    return pin.SE3(pin.exp3(np.array(turn, dtype=float)) @ np.diag([1.0, -1.0, -1.0]), np.array(place, dtype=float))


@pytest.fixture(scope="module")
def taken():
    """A picture of the stand and the valve, and T_stand_valve."""
    stand, valve = facing([0.4, -0.3, 0.0], [-0.1, 0.05, 0.8]), facing([0.4, 0.2, 0.1], [0.1, -0.05, 1.0])
    prints = [(T, marker_print(marker_cells("4x4_50", n), 0.08)) for n, T in ((3, stand), (7, valve))]
    gray = photograph(clean_picture(CAMERA, prints, rays=5), np.random.default_rng(0))
    return cv2.cvtColor(gray, cv2.COLOR_GRAY2BGR), stand.inverse() * valve


@pytest.fixture
def folder(tmp_path, taken):
    cv2.imwrite(str(tmp_path / "view.png"), taken[0])
    (tmp_path / "map.yaml").write_text(MAP)
    save_camera(CAMERA, tmp_path / "camera.yaml")
    return tmp_path


def run(capsys, *arguments):
    code = cli.run([str(a) for a in arguments])
    said = capsys.readouterr()
    return code, said.out, said.err


def sense(capsys, folder, source, *more):
    return run(
        capsys, "markers", "sense", source, "--camera", folder / "camera.yaml", "--map", folder / "map.yaml", *more
    )


def test_a_camera_file_gives_back_the_camera(tmp_path):
    save_camera(CAMERA, tmp_path / "c.yaml")
    again = load_camera(tmp_path / "c.yaml")
    assert np.array_equal(again.matrix, CAMERA.matrix)
    assert np.array_equal(again.distortion, CAMERA.distortion)
    assert (again.width, again.height) == (640, 480)


@pytest.mark.parametrize(
    ("word", "instead", "place"), [("fx:", "fz:", "fz"), ("size: [640, 480]", "size: [640]", "size")]
)
def test_a_slip_in_a_camera_file_is_named(tmp_path, word, instead, place):
    save_camera(CAMERA, tmp_path / "c.yaml")
    (tmp_path / "c.yaml").write_text((tmp_path / "c.yaml").read_text().replace(word, instead, 1))
    with pytest.raises(InputError, match=place):
        load_camera(tmp_path / "c.yaml")


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
        load_marker_map(tmp_path / "m.yaml")
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
    save_camera(found, tmp_path / "c.yaml")
    assert np.array_equal(load_camera(tmp_path / "c.yaml").matrix, found.camera.matrix)
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
    with pytest.raises(InputError, match="not a video"):
        list(pictures_from(tmp_path / "empty.mp4"))
    with pytest.raises(InputError, match="cannot be opened"):
        list(pictures_from(77))


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


def test_statistics_reproduce_the_published_ones():
    first = Series(100, 505.9640, 505.6400, 505.7898, 0.0671)
    last = Series(100, 2041.1300, 2029.8200, 2035.0656, 2.1142)
    assert first.mean_deviation == pytest.approx(0.0067, abs=5e-5)
    assert last.mean_deviation == pytest.approx(0.2114, abs=5e-5)
    assert first.largest_deviation == pytest.approx(0.1742, abs=5e-5)
    assert last.largest_deviation == pytest.approx(6.0644, abs=5e-5)


@pytest.mark.parametrize(
    ("largest", "smallest", "mean", "printed", "bound", "possible"),
    [
        (1963.3162, 1962.3938, 1962.9328, 0.5261, 0.464, False),
        (2134.1887, 2131.7919, 2132.7625, 1.2301, 1.204, False),
        (2407.2225, 2398.0351, 2402.7820, 5.3397, 4.617, False),
        (2791.8982, 2777.4443, 2784.6694, 5.5185, 7.263, True),
    ],
)
def test_an_impossible_deviation_is_flagged(largest, smallest, mean, printed, bound, possible):
    series = Series(100, largest, smallest, mean, printed)
    assert series.largest_possible_deviation == pytest.approx(bound, abs=2e-3)
    assert series.possible is possible


@pytest.mark.parametrize(
    ("mean", "percent"), [(299.1255, -0.2915), (300.3340, 0.1113), (300.8539, 0.2846), (302.9160, 0.9720)]
)
def test_errors_in_percent_are_the_published_ones(mean, percent):
    assert Series(100, mean, mean, mean, 0.0).error_percent(300.0) == pytest.approx(percent, abs=1e-4)


def test_a_series_of_values_is_summed_up():
    values = np.random.default_rng(0).normal(5.0, 2.0, 100_000)
    series = series_of(values)
    assert series.deviation == pytest.approx(2.0, rel=0.02)
    assert series.robust_deviation == pytest.approx(2.0, rel=0.02)
    assert series.possible
    with pytest.raises(InputError, match="at least two"):
        series_of([1.0])
