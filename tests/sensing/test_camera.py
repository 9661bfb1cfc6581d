"""The pinhole with its distortion: rays, pixels, their derivatives."""

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.markers.corner_pose import pose_of_square, square_corners
from rrtik_tests.marker_views import CAMERA, SIDE, facing


def test_rays_of_projected_points_go_through_them():
    points = np.random.default_rng(0).uniform([-0.3, -0.2, 0.5], [0.3, 0.2, 2.0], (50, 3))
    assert CAMERA.rays(CAMERA.project(points)) == pytest.approx(points[:, :2] / points[:, 2:], abs=1e-9)


def test_the_jacobian_of_pixels_agrees_with_differences():
    T, h = facing([0.4, -0.3, 0.2], [0.1, 0.05, 0.9]), 1e-6
    points = square_corners(SIDE) @ T.rotation.T
    slopes = CAMERA.jacobian(points, T.translation)
    for k in range(6):
        step = np.zeros(6)
        step[k] = h
        moved = [points @ pin.exp3(s * step[3:]).T + T.translation + s * step[:3] for s in (1.0, -1.0)]
        difference = (CAMERA.project(moved[0]) - CAMERA.project(moved[1])) / (2.0 * h)
        assert slopes[:, k] == pytest.approx(difference.ravel(), rel=1e-5, abs=1e-4)


@pytest.mark.parametrize("matrix", [np.eye(3) * 2, np.zeros((3, 3)), [[800, 0.2, 320], [0, 800, 240], [0, 0, 1]]])
def test_what_is_no_pinhole_is_refused(matrix):
    with pytest.raises(InputError, match="camera matrix"):
        Camera(matrix, 640, 480)


def test_what_a_calibration_is_not_sure_of_is_in_the_covariance_of_poses():
    rng, within = np.random.default_rng(3), []
    sigmas = np.array([9.0, 9.0, 4.0, 4.0, 0.02, 0.05, 1e-3, 1e-3, 0.02])  # the focal length by 1 %
    believed = Camera(CAMERA.matrix, 640, 480, CAMERA.distortion, sigmas=sigmas)
    for _ in range(150):
        off = sigmas * rng.standard_normal(9)
        matrix = CAMERA.matrix + np.array([[off[0], 0, off[2]], [0, off[1], off[3]], [0, 0, 0]])
        true = Camera(matrix, 640, 480, CAMERA.distortion + off[4:])
        T = facing(rng.uniform(-0.6, 0.6, 3), [*rng.uniform(-0.15, 0.15, 2), rng.uniform(0.5, 1.2)])
        pixels = true.project(square_corners(SIDE) @ T.rotation.T + T.translation)
        found = pose_of_square(believed, pixels, SIDE)
        away = found.T_camera_object.translation - T.translation
        within.append(away @ np.linalg.solve(found.covariance[:3, :3], away) <= 9.0)
    assert np.mean(within) >= 0.95


def test_a_negative_deviation_is_refused():
    with pytest.raises(InputError, match=r"sigmas.*-1"):
        Camera(CAMERA.matrix, 640, 480, sigmas=(-1.0, *(0.0,) * 8))
