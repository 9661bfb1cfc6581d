"""Depth pictures become the points that the camera saw."""

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.depth import cloud_from_depth

CAMERA = Camera([[80.0, 0.0, 20.0], [0.0, 90.0, 15.0], [0.0, 0.0, 1.0]], 40, 30, (0.05, -0.02, 0.001, 0.002, 0.0))


def test_points_are_seen_at_their_own_pixels():
    depth = np.random.default_rng(1).uniform(0.5, 3.0, (30, 40))
    cloud = cloud_from_depth(depth, CAMERA, radius=0.02)
    pixels = CAMERA.project(cloud.points.astype(np.float64))
    row, column = np.indices(depth.shape)
    assert np.allclose(pixels, np.column_stack([column.ravel(), row.ravel()]), atol=1e-3)
    assert np.allclose(cloud.points[:, 2], depth.ravel(), rtol=1e-6)


def test_every_so_many_pixels_of_millimetres_from_where_the_camera_is():
    depth = np.full((30, 40), 2000)
    place = pin.SE3(pin.exp3(np.array([0.3, -0.2, 0.5])), np.array([1.0, 2.0, 3.0]))
    cloud = cloud_from_depth(depth, CAMERA, place, scale=1e-3, every=5)
    own = (cloud.points - place.translation) @ place.rotation
    assert len(own) == 6 * 8
    assert np.allclose(own[:, 2], 2.0, atol=1e-5)
    assert np.allclose(CAMERA.project(own)[1], [5.0, 0.0], atol=1e-2)


def test_pixels_without_a_depth_are_left_out():
    depth = np.full((30, 40), np.nan)
    depth[3, 4], depth[5, 6], depth[7, 8], depth[9, 10] = 1.0, 0.0, 99.0, np.inf
    assert len(cloud_from_depth(depth, CAMERA).points) == 1


@pytest.mark.parametrize(
    ("depth", "options", "message"),
    [
        (np.ones((40, 30)), {}, "the camera has 30 rows of 40 pixels"),
        (np.zeros((30, 40)), {}, "no pixel has a depth"),
        (np.ones((30, 40)), {"every": 0}, "every"),
        (np.ones((30, 40)), {"scale": 0.0}, "scale"),
        ([["a"]], {}, "expected numbers"),
    ],
)
def test_bad_pictures_are_refused_in_one_line(depth, options, message):
    with pytest.raises(InputError, match=message) as caught:
        cloud_from_depth(depth, CAMERA, **options)
    assert "\n" not in str(caught.value)
