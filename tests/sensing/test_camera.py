"""The pinhole with its distortion: rays, pixels, their derivatives."""

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.errors import InputError
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.markers.corner_pose import square_corners
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
