"""Pictures that are coded by a tone curve: poses, their covariance, light that falls off, white that is cut off."""

import cv2
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rrtik_bench.sensing.synthetic_camera import Print, clean_picture, marker_print, published_camera
from rrtik_ompl.sensing.markers.corner_pose import pose_of_square, square_corners
from rrtik_ompl.sensing.markers.detection import find_markers
from rrtik_ompl.sensing.markers.dictionaries import marker_cells
from rrtik_ompl.sensing.markers.lighting import coded, light_of
from rrtik_tests.marker_views import SIDE, facing

CAMERA = published_camera()
BENT = published_camera((-0.12, 0.06, 0.0005, -0.0003, 0.0))
PLACES = [
    ([0.5, 0.4, 0.2], [0.1, -0.05, 0.7]),
    ([-0.4, 0.5, 0.1], [0.05, 0.1, 1.0]),
    ([0.6, -0.2, 0.3], [-0.1, 0.0, 1.4]),
]
OPENCV_5 = pytest.mark.skipif(int(cv2.__version__.split(".")[0]) < 5, reason="OpenCV 4 finds fewer of spoilt markers")


def taken(T, seed, tone, *, light=1.0, falling=0.0, camera=CAMERA):
    clean = clean_picture(camera, [(T, marker_print(marker_cells("4x4_50", 7), SIDE))], rays=6)
    clean = cv2.GaussianBlur(clean, (0, 0), 0.6) * np.linspace(light, light * (1.0 - falling), 640, dtype=np.float32)
    noisy = coded(clean, tone) + np.float32(0.008) * np.random.default_rng(seed).standard_normal(clean.shape)
    return np.clip(np.rint(255.0 * noisy), 0, 255).astype(np.uint8)


def looked(T, seed, tone, camera=CAMERA, **how):
    (marker,) = find_markers(taken(T, seed, tone, camera=camera, **how), "4x4_50")
    return marker, pose_of_square(camera, marker.corners, SIDE, spread=marker.spread)


@given(st.floats(-0.25, 1.25))
def test_a_tone_curve_and_its_inverse_agree(tone):
    grey = np.arange(256)
    assert 255.0 * coded(light_of(tone) / np.float32(255.0), tone) == pytest.approx(grey, abs=0.15)


def test_the_curve_of_srgb_is_the_published_one():
    assert coded(np.float32([0.0, 0.0031308, 0.214041, 1.0]), 1.0) == pytest.approx([0.0, 0.04045, 0.5, 1.0], abs=1e-4)


@pytest.mark.parametrize("how", [{}, {"falling": 0.7}, {"light": 1.6}], ids=["even", "falling", "cut off"])
@pytest.mark.parametrize("tone", [0.0, 1.0])
def test_poses_of_coded_and_linear_pictures_are_as_good_as_they_say(tone, how):
    squares = []
    for seed, (turn, at) in enumerate(PLACES):
        T = facing(turn, at)
        marker, found = looked(T, seed, tone, **how)
        away = found.T_camera_object.translation - T.translation
        assert np.linalg.norm(away) < 2.5e-3 * T.translation[2] ** 2
        squares.append(float(away @ np.linalg.solve(found.covariance[:3, :3], away)))
        assert marker.likeness > 0.99
    assert max(squares) < 14.2  # 0.3 % of honest ones are larger


def test_ink_that_has_spread_is_taken_out():
    T = facing(*PLACES[0])
    sheet = marker_print(marker_cells("4x4_50", 7), SIDE)
    fine = np.kron(sheet.cells, np.ones((20, 20), dtype=np.uint8))
    spread = cv2.erode(fine, np.ones((3, 3), dtype=np.uint8))  # by 0.7 mm, which moves corners by as many pixels
    light = cv2.GaussianBlur(clean_picture(CAMERA, [(T, Print(spread, sheet.cell / 20))], rays=6), (0, 0), 0.6)
    gray = np.rint(255.0 * coded(light, 1.0)).astype(np.uint8)
    (marker,) = find_markers(gray, "4x4_50")
    found = pose_of_square(CAMERA, marker.corners, SIDE, spread=marker.spread)
    away = found.T_camera_object.translation - T.translation
    assert np.linalg.norm(away) < 1e-3
    assert away @ np.linalg.solve(found.covariance[:3, :3], away) < 14.2


def test_a_marker_in_haze_is_found_at_the_second_try():
    T = facing(*PLACES[1])
    clean = clean_picture(CAMERA, [(T, marker_print(marker_cells("4x4_50", 7), SIDE))], rays=4)
    light = 0.03 * cv2.GaussianBlur(clean, (0, 0), 0.6) + np.float32(0.4)
    noisy = light + np.float32(0.003) * np.random.default_rng(0).standard_normal(light.shape)
    (marker,) = find_markers(np.rint(255.0 * noisy).astype(np.uint8), "4x4_50")
    true = CAMERA.project(square_corners(SIDE) @ T.rotation.T + T.translation)
    assert marker.number == 7
    assert np.abs(marker.corners - true).max() < 0.5


@OPENCV_5
@pytest.mark.parametrize(("family", "spoilt", "found"), [("apriltag_36h11", 4, True), ("apriltag_36h11", 6, False),
                                                         ("4x4_50", 1, False)])  # fmt: skip
def test_all_that_a_code_corrects_is_corrected_at_a_second_look_if_codes_are_far_apart(family, spoilt, found):
    cells = marker_cells(family, 19).copy()
    inner = cells[1:-1, 1:-1]
    for k in range(spoilt):
        inner[divmod(5 * k, len(inner))] ^= 255
    gray = np.full((480, 640), 230, dtype=np.uint8)
    drawn = np.kron(cells, np.ones((15, 15), dtype=np.uint8))
    gray[100 : 100 + len(drawn), 200 : 200 + len(drawn)] = 20 + (0.8 * drawn).astype(np.uint8)
    assert [each.number for each in find_markers(gray, family, align=False)] == ([19] if found else [])


def test_nothing_is_seen_in_noise():
    noise = np.random.default_rng(3).normal(128.0, 40.0, (480, 640)).clip(0, 255).astype(np.uint8)
    assert find_markers(noise, "apriltag_36h11") == ()


@OPENCV_5
def test_a_blurred_marker_is_found_at_the_third_try():
    T = facing([0.8, 0.0, 0.4], [0.1, 0.05, 2.1])
    clean = clean_picture(CAMERA, [(T, marker_print(marker_cells("apriltag_36h11", 7), SIDE))], rays=6)
    noisy = cv2.GaussianBlur(clean, (0, 0), 1.9) + 0.008 * np.random.default_rng(0).standard_normal(clean.shape)
    gray = np.clip(np.rint(255.0 * noisy), 0, 255).astype(np.uint8)
    assert find_markers(gray, "apriltag_36h11", near=True, turn=0) == ()  # a part of a film's work is too little
    assert len(find_markers(gray, "apriltag_36h11", near=True, turn=1)) == 1  # the turn of the close search
    (marker,) = find_markers(gray, "apriltag_36h11")
    assert marker.number == 7
    found = pose_of_square(CAMERA, marker.corners, SIDE, spread=marker.spread)
    assert np.linalg.norm(found.T_camera_object.translation - T.translation) < 3.0 * found.position_sigma


def test_the_tone_of_a_picture_is_found():
    T = facing(*PLACES[0])
    assert looked(T, 0, 0.0)[0].look.tone == 0.0
    assert 0.7 < looked(T, 0, 1.0)[0].look.tone < 1.2


def test_more_noise_is_more_uncertainty():
    T = facing(*PLACES[1])
    gray = taken(T, 0, 1.0)
    grain = np.random.default_rng(1).normal(0.0, 15.0, gray.shape)
    rough = np.clip(gray + grain, 0, 255).astype(np.uint8)
    sigmas = [
        pose_of_square(CAMERA, m.corners, SIDE, spread=m.spread).position_sigma
        for picture in (gray, rough)
        for m in find_markers(picture, "4x4_50")
    ]
    assert sigmas[1] > 1.5 * sigmas[0]


def test_what_the_lens_bends_within_a_marker_is_known():
    T = pin.SE3(facing([0.5, 0.3, 0.1], [0.1, 0.06, 0.55]))
    true = BENT.project(square_corners(SIDE) @ T.rotation.T + T.translation)
    gray = taken(T, 0, 0.0, camera=BENT)
    before, after = (np.abs(find_markers(gray, "4x4_50", camera=c)[0].corners - true).max() for c in (None, BENT))
    assert after < 0.2 * before
