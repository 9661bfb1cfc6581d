"""Poses of single markers seen by a synthetic camera whose truth is known, and how far they can be trusted."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rrtik_bench.sensing.synthetic_camera import clean_picture, marker_print, photograph, published_camera
from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.markers.corner_pose import pose_of_square, square_corners
from rrtik_ompl.sensing.markers.detection import dictionaries_seen, find_markers
from rrtik_ompl.sensing.markers.dictionaries import DICTIONARIES, marker_cells
from rrtik_ompl.sensing.sight import as_gray
from rrtik_tests.marker_views import CAMERA, SIDE, facing, picture_of


@settings(max_examples=60, deadline=None)
@given(st.floats(0.2, 2.5), st.floats(0.0, np.radians(70.0)), st.floats(0.0, 2 * np.pi), st.floats(-0.2, 0.2))
def test_without_noise_a_pose_is_exact(distance, tilt, direction, aside):
    T = facing([tilt * np.cos(direction), tilt * np.sin(direction), 0.0], [aside * distance, 0.0, distance])
    pixels = published_camera().project(square_corners(SIDE) @ T.rotation.T + T.translation)
    found = pose_of_square(published_camera(), pixels, SIDE)
    assert np.linalg.norm(found.T_camera_object.translation - T.translation) < 1e-9  # 1e-6 mm
    assert np.linalg.norm(pin.log3(found.T_camera_object.rotation.T @ T.rotation)) < 1e-8


def test_alignment_removes_the_inward_pull_of_blur():
    T = facing([0.4, 0.2, 0.1], [0.1, -0.05, 1.2])
    errors = {align: [] for align in (True, False)}
    for seed in range(8):
        gray = picture_of([(7, T)], seed)
        for align, list_of_errors in errors.items():
            (marker,) = find_markers(gray, "4x4_50", align=align)
            found = pose_of_square(CAMERA, marker.corners, SIDE)
            list_of_errors.append(found.T_camera_object.translation[2] - T.translation[2])
    assert abs(np.mean(errors[True])) < 0.6e-3
    assert abs(np.mean(errors[False])) > 3e-3
    assert np.std(errors[True]) < 0.4 * np.std(errors[False])


@pytest.mark.parametrize("blur", [0.4, 1.1])
def test_alignment_finds_out_how_blurred_a_picture_is(blur):
    T = facing([0.5, 0.4, 0.2], [0.1, -0.05, 1.7])
    away = []
    for seed in range(10):
        (marker,) = find_markers(picture_of([(7, T)], seed, blur=blur), "4x4_50")
        away.append(pose_of_square(CAMERA, marker.corners, SIDE).T_camera_object.translation[2] - T.translation[2])
    assert abs(np.mean(away)) < 0.6e-3


def test_the_stated_uncertainty_is_neither_boast_nor_panic():
    T = facing([0.5, 0.2, 0.1], [0.05, -0.05, 1.0])
    truth, away, sigma = T.translation, [], []
    for seed in range(12):
        (marker,) = find_markers(picture_of([(7, T)], seed), "4x4_50")
        found = pose_of_square(CAMERA, marker.corners, SIDE)
        away.append(np.linalg.norm(found.T_camera_object.translation - truth))
        sigma.append(found.position_sigma)
    assert 0.3 < np.sqrt(np.mean(np.square(away))) / np.mean(sigma) < 3.0


def test_near_markers_lie_where_they_are_within_what_is_said():
    for k, distance in enumerate((0.26, 0.34, 0.42)):
        T = facing([0.3 + 0.05 * k, -0.3, 0.2 * k], [0.01 * k - 0.02, -0.01, distance])
        (marker,) = find_markers(picture_of([(7, T)], k), "4x4_50")
        true = CAMERA.project(square_corners(SIDE) @ T.rotation.T + T.translation)
        middle = (marker.corners - true).mean(axis=0)  # all corners together: what alignment did not see
        spread = np.kron(np.ones(4) / 4.0, np.eye(2)) @ marker.spread @ np.kron(np.ones(4) / 4.0, np.eye(2)).T
        assert middle @ np.linalg.solve(spread, middle) < 16.0
        found = pose_of_square(CAMERA, marker.corners, SIDE, spread=marker.spread)
        assert np.linalg.norm(found.T_camera_object.translation - T.translation) < 4.0 * found.position_sigma


@pytest.mark.parametrize("seed", range(3))
def test_a_marker_that_fills_the_picture_lies_where_it_is_within_what_is_said(seed):
    camera = Camera([[900.0, 0.0, 319.5], [0.0, 900.0, 239.5], [0.0, 0.0, 1.0]], 640, 480)
    T = facing([0.4, 0.3 - 0.2 * seed, 0.1], [0.002, -0.001, 0.2 + 0.01 * seed])
    clean = clean_picture(camera, [(T, marker_print(marker_cells("4x4_50", 7), SIDE))], rays=6)
    (marker,) = find_markers(photograph(clean, np.random.default_rng(seed)), "4x4_50")
    true = camera.project(square_corners(SIDE) @ T.rotation.T + T.translation)
    error = (marker.corners - true).ravel()
    assert marker.side > 300.0
    assert np.sqrt(np.mean(error**2)) < 0.1  # [pixels]
    assert error @ np.linalg.solve(marker.spread, error) < 20.1  # 99 % of a chi-squared variable of eight numbers


def test_a_fringe_of_colour_moves_no_marker():
    T = facing([0.4, 0.2, 0.1], [0.1, -0.1, 1.0])
    green = picture_of([(7, T)])
    red, blue = (np.roll(green, shift, axis=1) for shift in (1, -2))
    (alone,) = find_markers(as_gray(green), "4x4_50")
    (marker,) = find_markers(as_gray(np.dstack([blue, green, red])), "4x4_50")
    assert (marker.corners == alone.corners).all()
    assert (as_gray(np.dstack([0 * green, green // 8, green])) > green // 8).any()  # red light alone is enough, too


def test_a_marker_seen_from_the_front_is_ambiguous_and_a_tilted_one_is_not():
    for tilt, doubt in ((0.03, True), (0.6, False)):
        T = facing([tilt, 0.0, 0.0], [0.0, 0.0, 1.8])
        (marker,) = find_markers(picture_of([(3, T)]), "4x4_50")
        assert pose_of_square(CAMERA, marker.corners, SIDE).ambiguous is doubt


def test_a_covered_corner_shows_in_the_likeness():
    T = facing([0.3, 0.2, 0.0], [0.0, 0.0, 0.7])
    gray = picture_of([(3, T)])
    (whole,) = find_markers(gray, "4x4_50")
    x, y = np.rint(whole.corners[0]).astype(int)
    gray[y - 6 : y + 14, x - 6 : x + 14] = 128
    covered = find_markers(gray, "4x4_50")
    assert whole.likeness > 0.99
    assert all(each.likeness < whole.likeness - 0.005 for each in covered)


def test_a_marker_of_another_dictionary_is_named():
    prints = [(facing([0.3, 0, 0], [0, 0, 0.6]), marker_print(marker_cells("6x6_50", 5), SIDE))]
    gray = photograph(clean_picture(CAMERA, prints, rays=4), np.random.default_rng(0))
    assert find_markers(gray, "apriltag_36h11") == ()
    assert "6x6_50" in dictionaries_seen(gray)


def test_unknown_dictionaries_and_numbers_are_refused():
    with pytest.raises(UnknownNameError, match="4x4_50"):
        marker_cells("4x4_5", 0)
    with pytest.raises(InputError, match="0 to 49"):
        marker_cells("4x4_50", 50)


@pytest.mark.parametrize("dictionary", sorted(DICTIONARIES))
def test_every_dictionary_can_be_drawn(dictionary):
    assert set(np.unique(marker_cells(dictionary, 3))) == {0, 255}
