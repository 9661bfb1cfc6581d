"""Depth pictures become the points that the camera saw."""

import warnings

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl import sensing
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.scene import Obstacle
from rrtik_ompl.model.shapes import Box, Sphere
from rrtik_ompl.sensing import depth as depth_pictures
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.depth import cloud_from_depth
from rrtik_tests.grey_pictures import grey_png

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
        (np.ones((30, 40)), {"mask": np.ones((40, 30))}, "mask of a depth picture: the camera has 30 rows of 40"),
        (np.ones((30, 40)), {"mask": np.zeros((30, 40))}, "its mask leaves no pixel"),
    ],
)
def test_bad_pictures_are_refused_in_one_line(depth, options, message):
    with pytest.raises(InputError, match=message) as caught:
        cloud_from_depth(depth, CAMERA, **options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("white", [True, 1, 255])
def test_a_mask_says_what_is_used(white):
    depth = np.random.default_rng(2).uniform(0.5, 3.0, (30, 40))
    used = np.random.default_rng(3).random(depth.shape) < 0.5
    expected = cloud_from_depth(np.where(used, depth, 0.0), CAMERA, every=2).points
    mask = np.where(used, white, type(white)(0))
    assert np.array_equal(cloud_from_depth(depth, CAMERA, every=2, mask=mask).points, expected)
    hidden = np.ma.masked_array(depth, mask=~used)
    assert np.array_equal(cloud_from_depth(hidden, CAMERA, every=2).points, expected)


@pytest.mark.parametrize("bits", [1, 2, 4])
def test_depths_and_masks_of_few_bits_are_those_of_a_picture_file(bits, tmp_path):
    cv2 = pytest.importorskip("cv2")
    rows = np.random.default_rng(4).integers(0, 2**bits, (30, 40))
    (tmp_path / "depth.png").write_bytes(grey_png(rows.tolist(), bits))
    read = cv2.imread(str(tmp_path / "depth.png"), cv2.IMREAD_UNCHANGED)  # readers stretch few bits to 255
    cloud = cloud_from_depth(read, CAMERA, scale=(2**bits - 1) / 255.0, farthest=20.0)
    assert np.allclose(cloud.points[:, 2], rows[rows > 0])
    masked = cloud_from_depth(np.ones((30, 40)), CAMERA, mask=read)
    assert len(masked.points) == np.count_nonzero(rows)


@pytest.mark.parametrize(
    ("distortion", "fold"),
    [
        ((-0.3, 0.0, 0.0, 0.0, 0.0), (1.0 / 0.9) ** 0.5),  # r (1 - 0.3 r^2) turns back where 0.9 r^2 is 1
        ((-0.3, 0.1, 0.0, 0.0, 0.0), np.inf),
        ((1.4, 1.2, 0.001, -0.002, 0.0), np.inf),
        ((-0.28, 0.07, 0.0003, -0.0002, -0.006), np.inf),
    ],
)
def test_only_pixels_that_a_ray_reaches_become_points(distortion, fold):
    camera = Camera([[30.0, 0.0, 32.0], [0.0, 30.0, 24.0], [0.0, 0.0, 1.0]], 64, 48, distortion)
    row, column = np.indices((48, 64))
    bent = np.hypot(column - 32.0, row - 24.0) / 30.0
    reached = bent < (fold * (1.0 - 0.3 * fold**2) if np.isfinite(fold) else np.inf)
    missed = np.count_nonzero(~reached)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        points = cloud_from_depth(np.ones((48, 64)), camera).points.astype(np.float64)
    assert [f"{missed} of {reached.size} pixels" in str(each.message) for each in caught] == [True] * bool(missed)
    assert np.allclose(camera.project(points), np.column_stack([column[reached], row[reached]]), atol=1e-4)
    assert (np.hypot(*points[:, :2].T) < fold).all()


# --- several pictures, thinned at once -------------------------------------------------------------------------------


def views_of_a_room(seed):
    """Two small pictures of random depths, with zeros, NaN and infinity in them; where their points are, by hand."""
    rng = np.random.default_rng(seed)
    views = []
    points = []
    missing = 0
    for place in ([0.0, 0.0, 0.0], [1.0, 0.2, 0.1]):
        camera = Camera([[60.0, 0.0, 15.5], [0.0, 55.0, 11.5], [0.0, 0.0, 1.0]], 32, 24)
        T = pin.SE3(pin.exp3(rng.normal(0.0, 0.4, 3)), np.array(place))
        depth = rng.uniform(0.6, 2.5, (24, 32))
        depth[rng.random(depth.shape) < 0.1] = 0.0
        depth[3, 4] = np.nan
        depth[5, 6] = np.inf
        views.append((depth, camera, T))
        for v, u in zip(*np.nonzero(np.isfinite(depth) & (depth > 0.0)), strict=True):
            ray = np.array([(u - 15.5) / 60.0, (v - 11.5) / 55.0, 1.0])
            points.append(T.act(depth[v, u] * ray))
        missing += int((~np.isfinite(depth) | (depth <= 0.0)).sum())
    return views, np.array(points), missing


@pytest.mark.parametrize("unit", [1.0, 1e-3])
def test_every_measured_point_within_is_covered_and_no_other_place(unit):
    views, points, missing = views_of_a_room(0)
    low = np.array([-1.0, -0.8, 0.5])
    high = np.array([1.5, 0.9, 2.2])
    cell = 0.03
    error = 0.004
    if unit != 1.0:  # whole millimetres, as cameras give them
        with np.errstate(invalid="ignore"):
            views = [(np.rint(np.nan_to_num(d, posinf=0.0) / unit).astype(np.uint16), c, T) for d, c, T in views]
    cloud = sensing.cloud_from_depths(views, (low, high), cell=cell, radius=error, scale=unit)
    inside = points[((points > low + 0.001) & (points < high - 0.001)).all(axis=1)]
    distances = np.linalg.norm(inside[:, None] - cloud.points[None].astype(float), axis=2)
    assert (distances.min(axis=1) <= cloud.radius - error + 0.5 * (1.0 - unit) * 2e-3).all()
    near = np.linalg.norm(points[None] - cloud.points[:, None].astype(float), axis=2).min(axis=1)
    assert (near <= cloud.radius - error + 1e-3).all()
    assert cloud.radius == pytest.approx(error + 0.5 * np.sqrt(3.0) * cell, abs=1e-4)
    assert cloud.dropped == missing


def test_what_is_to_be_grasped_is_left_out_by_a_box_or_a_mask():
    views, points, _ = views_of_a_room(1)
    everywhere = [-4.0] * 3, [4.0] * 3
    cup = Obstacle("cup", Box(0.6, 0.8, 0.5), pin.SE3(pin.exp3(np.array([0.3, -0.2, 0.5])), points[100]), margin=0.05)
    cloud = sensing.cloud_from_depths(views, everywhere, cell=0.04, without=[cup])
    local = np.array([cup.pose.actInv(point) for point in points])
    inside = (np.abs(local) <= np.array([0.35, 0.45, 0.3])).all(axis=1)
    assert inside.sum() > 10
    left = {tuple(row) for row in np.floor((points[~inside] + 4.0) / 0.04).astype(int)}
    assert len(cloud.points) == len(left)

    depth, camera, T = views[0]
    mask = np.zeros(depth.shape, dtype=np.uint8)
    mask[:, :10] = 255
    half = sensing.cloud_from_depths([(depth, camera, T, mask)], everywhere, cell=0.04)
    assert len(half.points) <= np.count_nonzero(mask & (np.nan_to_num(depth, posinf=0.0) > 0.0))
    hidden = sensing.cloud_from_depths([(np.ma.masked_array(depth, mask == 0), camera, T)], everywhere, cell=0.04)
    assert np.array_equal(hidden.points, half.points)


@pytest.mark.kernels
def test_numpy_finds_the_same_points_as_the_kernel(monkeypatch):
    views, points, _ = views_of_a_room(2)
    views = [(depth, camera, T, np.random.default_rng(3).integers(0, 3, depth.shape)) for depth, camera, T in views]
    cup = Obstacle("cup", Box(0.6, 0.8, 0.5), pin.SE3(pin.exp3(np.array([0.3, -0.2, 0.5])), points[100]))
    some = [([-1.0, -0.8, 0.5], [1.5, 0.9, 2.2]), ([-4.0] * 3, [4.0] * 3)]
    clouds = []
    for kernels in (depth_pictures.library, lambda name: None):
        monkeypatch.setattr(depth_pictures, "library", kernels)
        clouds += [sensing.cloud_from_depths(views, within, cell=0.03, without=[cup]) for within in some]
    for one, other in zip(clouds[:2], clouds[2:], strict=True):
        assert np.array_equal(one.points, other.points)
        assert one.dropped == other.dropped > 0


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"within": ([0.0] * 3, [0.0] * 3)}, "low must be below high"),
        ({"within": ([-5.0] * 3, [5.0] * 3), "cell": 1e-3}, "take a larger cell"),
        ({"within": ([50.0] * 3, [51.0] * 3)}, "no point is left"),
        ({"scale": 1e-3}, "no point is left"),
        ({"without": [Obstacle("ball", Sphere(1.0))]}, "must be a box"),
        ({"cell": 0.0}, "cell"),
    ],
)
def test_pictures_of_which_no_cloud_can_be_made_are_refused_in_one_line(options, words):
    views, _, _ = views_of_a_room(2)
    with pytest.raises(InputError, match=words) as raised:
        sensing.cloud_from_depths(views, **{"within": ([-5.0] * 3, [5.0] * 3)} | options)
    assert "\n" not in str(raised.value)
