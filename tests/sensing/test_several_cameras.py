"""Two cameras at once, and a camera that pans, tilts and zooms."""

from dataclasses import replace

import cv2
import numpy as np
import pinocchio as pin
import pytest

from rrtik_bench.sensing.synthetic_camera import clean_picture, marker_print, photograph
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import pose, pose_from_rpy
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.cameras.pan_tilt_zoom import Encoder, PanTiltZoom
from rrtik_ompl.sensing.markers.corner_pose import pose_of_square, square_corners
from rrtik_ompl.sensing.markers.dictionaries import marker_cells
from rrtik_ompl.sensing.markers.marker_map import MarkedObject, MarkerMap, MountedMarker
from rrtik_ompl.sensing.rig import Rig, detect_in_rig
from rrtik_ompl.sensing.sight import detect_objects
from rrtik_tests.marker_views import CAMERA, SIDE, facing

MAP = MarkerMap("4x4_50", (MarkedObject("thing", "target", (MountedMarker(7, SIDE),)),), pin.SE3.Identity())
ASIDE = pose_from_rpy([0.35, 0.0, 0.05], [0.0, -0.3, 0.0])


def taken(T_camera_marker, seed):
    clean = clean_picture(CAMERA, [(T_camera_marker, marker_print(marker_cells("4x4_50", 7), SIDE))], rays=4)
    return photograph(cv2.GaussianBlur(clean, (0, 0), 0.6), np.random.default_rng(seed), noise=0.01)


def both(T, seed):
    return [taken(T, seed), taken(ASIDE.actInv(T), seed + 100)]


def test_two_cameras_are_better_than_one_and_say_by_how_much():
    rig, alone, together, squares, flat = Rig((CAMERA, CAMERA), (pin.SE3.Identity(), ASIDE)), [], [], [], 0
    for seed in range(6):
        T = facing([0.08 * np.cos(seed), 0.08 * np.sin(seed), 0.2], [0.1, 0.02, 1.2])  # nearly frontal
        pictures = both(T, seed)
        (one,), (two,) = detect_objects(pictures[0], CAMERA, MAP), detect_in_rig(pictures, rig, MAP)
        flat += one.pose.ambiguous
        assert not two.refused
        away = two.pose.T_camera_object.translation - T.translation
        squares.append(float(away @ np.linalg.solve(two.pose.covariance[:3, :3], away)))
        alone.append(one.pose.position_sigma)
        together.append(two.pose.position_sigma)
    assert np.median(together) < 0.6 * np.median(alone)
    assert max(squares) < 16.0


def test_a_wrong_focal_length_of_one_camera_is_refused():
    rig = Rig((CAMERA, CAMERA), (pin.SE3.Identity(), ASIDE))
    wrong = Camera(np.diag([1.02, 1.02, 1.0]) @ CAMERA.matrix, 640, 480)
    T = facing([0.4, 0.2, 0.1], [0.1, 0.0, 1.1])
    pictures = both(T, 3)
    assert not detect_in_rig(pictures, rig, MAP)[0].refused
    (sight,) = detect_in_rig(pictures, replace(rig, cameras=(CAMERA, wrong)), MAP)
    assert "contradict each other" in sight.refused


def test_what_one_camera_alone_sees_is_in_the_frame_of_the_first():
    rig = Rig((CAMERA, CAMERA), (pin.SE3.Identity(), ASIDE), position_sigma=1e-3)
    T = facing([0.4, 0.2, 0.1], [0.1, 0.0, 1.1])
    black = np.full((480, 640), 90, dtype=np.uint8)
    (sight,) = detect_in_rig([black, both(T, 1)[1]], rig, MAP)
    assert np.linalg.norm(sight.pose.T_camera_object.translation - T.translation) < 4.0 * sight.pose.position_sigma
    assert sight.pose.position_sigma > 1e-3


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Rig((CAMERA,), (pin.SE3.Identity(),)), "two cameras or more"),
        (lambda: Rig((CAMERA, CAMERA), (ASIDE, ASIDE)), "first camera"),
        (lambda: detect_in_rig([], Rig((CAMERA, CAMERA), (pin.SE3.Identity(), ASIDE)), MAP), "as many pictures"),
        (lambda: PanTiltZoom([CAMERA, CAMERA], [1.0, 1.0], ASIDE, ASIDE), "which increase"),
        (lambda: PanTiltZoom([CAMERA], [0.0], ASIDE, ASIDE).camera(2.0), "outside of what was calibrated"),
    ],
)
def test_what_is_no_rig_or_head_is_refused(make, said):
    with pytest.raises(InputError, match=said) as refused:
        make()
    assert "\n" not in str(refused.value)


def test_what_stands_still_does_so_for_a_head_that_pans_tilts_and_zooms():
    long = Camera(np.diag([2.0, 2.0, 1.0]) @ CAMERA.matrix * [[1, 1, 0.5], [1, 1, 0.5], [1, 1, 1]], 640, 480)
    look = pin.SE3(np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]), np.array([0.05, 0.0, 0.02]))
    head = PanTiltZoom(
        [CAMERA, long], [0.0, 1000.0], pose([0.1, 0.2, 0.4]), look,
        pan=Encoder(512.0, 1e-3), tilt=Encoder(0.0, -1e-3),
    )  # fmt: skip
    thing = pose([1.4, 0.3, 0.2]) * pin.SE3(look.rotation, np.zeros(3)) * facing([0.5, 0.2, 0.0], [0.0, 0.0, 0.0])
    for pan, tilt, zoom in ((560.0, -150.0, 0.0), (650.0, -80.0, 400.0), (520.0, -250.0, 1000.0)):
        camera, T = head.camera(zoom), head.pose(pan, tilt)
        seen = T.actInv(thing)
        pixels = camera.project(square_corners(SIDE) @ seen.rotation.T + seen.translation)
        found = T * pose_of_square(camera, pixels, SIDE).T_camera_object
        assert np.linalg.norm(found.translation - thing.translation) < 1e-7
    assert head.camera(500.0).matrix[0, 0] == pytest.approx(np.sqrt(2.0) * CAMERA.matrix[0, 0])
