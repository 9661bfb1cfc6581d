"""What is not certain of markers is in the covariance; markers that contradict each other are refused. Tags upright."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from rrtik_bench.sensing.synthetic_camera import clean_picture, marker_print, photograph
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import pose
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.markers import sheets
from rrtik_ompl.sensing.markers.corner_pose import pose_of_square, square_corners
from rrtik_ompl.sensing.markers.detection import SeenMarker, find_markers
from rrtik_ompl.sensing.markers.dictionaries import marker_cells
from rrtik_ompl.sensing.markers.marker_map import MarkedObject, MarkerMap, MountedMarker
from rrtik_ompl.sensing.sight import sighting
from rrtik_tests.marker_views import CAMERA, SIDE, facing

# The first codes of the families as their library lists them [50]: cells row by row, the first one top left, 1 white.
CODES = {
    "apriltag_36h11": (0xD5D628584, 0xD97F18B49, 0xDD280910E),
    "apriltag_25h9": (0x155CBF1, 0x1E4D1B6, 0x17B0B68),
    "apriltag_16h5": (0x231B, 0x2EA5, 0x346A),
}
APART = (pose([-0.075, 0.0, 0.0]), pose([0.075, 0.0, -0.2]))  # two markers on a step
SPREAD = 0.02**2 * np.eye(8)


def official(family, number):
    count = int(family.removeprefix("apriltag_").split("h")[0])
    bits = [(CODES[family][number] >> (count - 1 - k)) & 1 for k in range(count)]
    side = int(count**0.5)
    return np.pad(np.array(bits).reshape(side, side) * 255, 1).astype(np.uint8)


@pytest.mark.parametrize("family", CODES)
def test_april_tags_are_upright_as_their_library_prints_them(family):
    for number in range(3):
        assert np.array_equal(marker_cells(family, number), official(family, number))
    T = facing([0.5, 0.2, 0.3], [0.02, -0.03, 0.5])
    clean = clean_picture(CAMERA, [(T, marker_print(official(family, 1), SIDE))], rays=6)
    (seen,) = find_markers(photograph(clean, np.random.default_rng(0)), family)
    found = pose_of_square(CAMERA, seen.corners, SIDE)
    assert np.linalg.norm(pin.log3(found.T_camera_object.rotation.T @ T.rotation)) < np.deg2rad(0.5)


def test_a_sheet_says_where_up_is(monkeypatch):
    pages = []
    monkeypatch.setattr(sheets, "_write", lambda _path, made, *_: pages.extend(made))
    sheets.print_markers("sheet.pdf", [1], side=0.08, dictionary="apriltag_36h11")
    ((tile,),) = pages
    assert np.array_equal(tile.cells, official("apriltag_36h11", 1))
    assert tile.caption.startswith("\u25b2 up")


@pytest.mark.parametrize("doubt", [0.005, 0.02])
def test_a_side_that_is_not_certain_is_in_the_covariance(doubt):
    rng, within, blind = np.random.default_rng(4), [], []
    for _ in range(150):
        T = facing(rng.uniform(-0.6, 0.6, 3), [*rng.uniform(-0.15, 0.15, 2), rng.uniform(0.5, 1.2)])
        true = SIDE * (1.0 + doubt * rng.standard_normal())
        pixels = CAMERA.project(square_corners(true) @ T.rotation.T + T.translation)
        for side_sigma, inside in ((doubt * SIDE, within), (0.0, blind)):
            found = pose_of_square(CAMERA, pixels, SIDE, side_sigma=side_sigma)
            away = found.T_camera_object.translation - T.translation
            inside.append(away @ np.linalg.solve(found.covariance[:3, :3], away) <= 9.0)
    assert np.mean(within) >= 0.95
    assert np.mean(blind) < 0.8


def two(rng, *, side=1.0, doubt=0.0, true=CAMERA, believed=CAMERA):
    """A sighting of two markers of known places whose sides are another, and how far off it is in its covariance."""
    T = facing(rng.uniform(-0.4, 0.4, 3), [*rng.uniform(-0.1, 0.1, 2), rng.uniform(0.6, 1.0)])
    places = (place.act for place in APART)
    corners = [np.array([place(p) for p in square_corners(SIDE)]) for place in places]
    seen = []
    for number, each in enumerate(corners):
        pixels = true.project(each @ T.rotation.T + T.translation) + 0.02 * rng.standard_normal((4, 2))
        seen.append(SeenMarker("4x4_50", number, pixels, 1.0, SPREAD))
    markers = tuple(MountedMarker(k, side * SIDE, place, doubt * SIDE) for k, place in enumerate(APART))
    found = sighting(believed, MarkedObject("step", "target", markers), seen)
    away = found.pose.T_camera_object.translation - T.translation
    return found, away @ np.linalg.solve(found.pose.covariance[:3, :3], away)


def several(count=60, **how):
    rng = np.random.default_rng(8)
    found = [two(rng, **how) for _ in range(count)]
    refused = [each.refused for each, _ in found]
    return np.mean([bool(each) for each in refused]), np.mean([square <= 9.0 for _, square in found]), refused


def test_two_markers_that_agree_are_taken_and_such_whose_sides_are_wrong_are_refused():
    refused, within, _ = several()
    assert refused == 0.0
    assert within >= 0.95
    refused, _, reasons = several(side=1.02)
    assert refused == 1.0
    assert "contradict each other" in reasons[0]
    assert "side_sigma" in reasons[0]


def test_a_wrong_focal_length_contradicts_two_markers_of_different_distance():
    matrix = CAMERA.matrix.copy()
    matrix[[0, 1], [0, 1]] *= 1.05
    wrong = Camera(matrix, 640, 480, CAMERA.distortion)
    assert several(believed=wrong)[0] >= 0.9


@pytest.mark.parametrize("off", [np.array([0.01, 0.01, 0.0]), np.array([0.0, 0.0, 0.03])], ids=["focal", "lens"])
def test_what_another_focal_length_or_lens_would_explain_is_told_as_such(off):
    matrix, lens = CAMERA.matrix.copy(), CAMERA.distortion.copy()
    matrix[[0, 1], [0, 1]] *= 1.0 + off[:2]
    lens[0] += off[2]
    refused, _, reasons = several(believed=Camera(matrix, 640, 480, lens))
    blunt = np.mean(["each other" in each for each in reasons])
    assert refused > max(1.2 * blunt, 0.3)
    assert any("focal length or lens" in each for each in reasons)


def test_what_is_stated_is_no_contradiction_and_in_the_covariance():
    refused, within, _ = several(side=1.02, doubt=0.015)
    assert refused == 0.0
    assert within >= 0.95
    matrix, sigmas = CAMERA.matrix.copy(), np.zeros(9)
    matrix[[0, 1], [0, 1]] *= 1.01
    sigmas[:2] = 0.008 * matrix[0, 0]
    refused, within, _ = several(believed=Camera(matrix, 640, 480, CAMERA.distortion, sigmas=sigmas))
    assert refused == 0.0
    assert within >= 0.95


def test_a_map_states_the_uncertainty_of_a_side(tmp_path):
    text = "version: 1\ndictionary: 4x4_50\ncamera_pose: {xyz: [0, 0, 0]}\nobjects:\n- name: a\n  role: target\n"
    file = tmp_path / "map.yaml"
    file.write_text(text + "  markers:\n  - {id: 1, side: 0.08, side_sigma: 0.0004}\n")
    assert MarkerMap.load(file).objects[0].markers[0].side_sigma == 0.0004
    file.write_text(text + "  markers:\n  - {id: 1, side: 0.08, side_sigma: 0.1}\n")
    with pytest.raises(InputError, match=r"side_sigma.*below side"):
        MarkerMap.load(file)


def test_what_the_markers_of_a_picture_share_does_not_become_less_by_their_number():
    """Outlines that are all too large, markers that are all displaced alike: as sharpening and fringes make them."""
    rng = np.random.default_rng(5)
    places = [pose([x, y, z]) for x, z in ((-0.075, 0.0), (0.075, -0.2)) for y in (-0.1, 0.0, 0.1)]
    markers = tuple(MountedMarker(k, SIDE, place) for k, place in enumerate(places))
    step = MarkedObject("step", "target", markers)
    squares = {"shared": [], "independent": []}
    for _ in range(200):
        T = facing(rng.uniform(-0.4, 0.4, 3), [*rng.uniform(-0.1, 0.1, 2), rng.uniform(0.6, 1.0)])
        causes = rng.standard_normal(3)
        seen = []
        for marker in markers:
            true = CAMERA.project(marker.corners @ T.rotation.T + T.translation)
            outwards = (true - true.mean(axis=0)).ravel()
            common = 0.05 * np.column_stack([2.0 * outwards / np.linalg.norm(outwards), np.tile(np.eye(2), (4, 1))])
            pixels = true + (common @ causes + 0.02 * rng.standard_normal(8)).reshape(4, 2)
            seen.append(SeenMarker("4x4_50", marker.number, pixels, 1.0, SPREAD + common @ common.T, None, common))
        for name, each in (("shared", seen), ("independent", [replace(one, common=None) for one in seen])):
            pose_found = sighting(CAMERA, step, each).pose
            turn = pin.log3(pose_found.T_camera_object.rotation @ T.rotation.T)
            off = np.concatenate([pose_found.T_camera_object.translation - T.translation, turn])
            squares[name].append(off @ np.linalg.solve(pose_found.covariance, off))
    assert 4.8 < np.mean(squares["shared"]) < 7.2  # honest: 6
    assert np.mean(squares["independent"]) > 9.0


def test_two_markers_in_a_plane_have_the_two_poses_of_a_plane():
    """Small ones far away: where the nearest pose is turned, two are nearly always said to fit: the other is right."""
    rng = np.random.default_rng(2)
    markers = tuple(MountedMarker(k, 0.04, pose([x, 0.0, 0.0])) for k, x in enumerate((-0.026, 0.026)))
    panel = MarkedObject("panel", "target", markers)
    turned, flagged = 0, 0
    for _ in range(200):
        T = facing(rng.uniform(-0.3, 0.3, 3), [*rng.uniform(-0.1, 0.1, 2), rng.uniform(1.2, 1.8)])
        seen = []
        for marker in markers:
            true = CAMERA.project(marker.corners @ T.rotation.T + T.translation)
            pixels = true + 0.15 * rng.standard_normal((4, 2))
            seen.append(SeenMarker("4x4_50", marker.number, pixels, 1.0, 56.0 * SPREAD))
        found = sighting(CAMERA, panel, seen).pose
        wrong = np.linalg.norm(pin.log3(found.T_camera_object.rotation.T @ T.rotation)) > 4.0 * found.rotation_sigma
        if wrong:
            turned += 1
            other = np.inf if found.other is None else np.linalg.norm(pin.log3(found.other.rotation.T @ T.rotation))
            flagged += found.ambiguous and other < 4.0 * found.rotation_sigma
    assert turned > 5
    assert flagged >= 0.9 * turned
