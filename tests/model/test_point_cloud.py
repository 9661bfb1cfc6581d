"""Clouds of points as values: what is refused, thinned out and cropped, and the tree of their points."""

import copy
import pickle
import warnings

import numpy as np
import pytest

from rrtik_ompl.base.errors import CloudWarning, InputError
from rrtik_ompl.model.shapes import PointCloud, same_shape


def scattered(count, seed=0, size=1.0):
    return np.random.default_rng(seed).uniform(-size, size, (count, 3))


def rows(points):
    return {tuple(point) for point in np.asarray(points, dtype=np.float32).tolist()}


@pytest.mark.parametrize("count", [1, 2, 15, 16, 17, 255, 256, 257, 5000])
def test_the_tree_has_every_point_and_boxes_around_them(count):
    cloud = PointCloud(scattered(count), 0.01)
    tree = cloud.tree
    assert rows(tree.blocks.transpose(0, 2, 1).reshape(-1, 3)) == rows(cloud.points)
    for _ in range(20):
        low = scattered(1, count)[0]
        high = low + np.abs(scattered(1, count + 1)[0])
        found = rows(tree.within(low, high))
        inside = ((cloud.points >= low) & (cloud.points <= high)).all(axis=1)
        assert rows(cloud.points[inside]) <= found
    assert rows(tree.within(*tree.bounds)) == rows(cloud.points)


def test_points_that_are_equal_or_in_a_plane_have_a_tree():
    for points in (np.ones((100, 3)), scattered(100) * [1.0, 1.0, 0.0], scattered(100) * [0.0, 0.0, 1.0]):
        cloud = PointCloud(points, 0.5)
        assert rows(cloud.tree.within(*cloud.bounds)) == rows(cloud.points)


def test_the_tree_of_a_large_cloud_finds_few_points_beside_those_asked_for():
    cloud = PointCloud(scattered(100_000), 0.01)
    found = cloud.tree.within(np.full(3, -0.1), np.full(3, 0.1))
    assert len(found) < 10 * (np.abs(cloud.points) <= 0.1).all(axis=1).sum()


def test_thinning_out_covers_every_ball():
    cloud = PointCloud(scattered(3000, size=0.5), 0.01)
    thin = cloud.voxel(0.1)
    assert len(thin.points) <= 10**3
    away = np.linalg.norm(cloud.points[:, None].astype(float) - thin.points.astype(float), axis=2).min(axis=1)
    assert (away + cloud.radius <= thin.radius + 1e-7).all()
    assert thin.radius <= cloud.radius + 0.1 * np.sqrt(3.0)


def test_cropping_keeps_what_is_inside():
    cloud = PointCloud(scattered(1000), 0.01)
    part = cloud.cropped([-0.5, -0.5, -0.5], [0.5, 0.5, 0.5])
    assert rows(part.points) == rows(cloud.points[(np.abs(cloud.points) <= 0.5).all(axis=1)])
    assert part.radius == cloud.radius
    with pytest.raises(InputError, match="none of the 1000"):
        cloud.cropped([5.0, 5.0, 5.0], [6.0, 6.0, 6.0])


@pytest.mark.parametrize(
    ("points", "radius", "message"),
    [
        (np.zeros((0, 3)), 0.01, "it has no point"),
        ([[np.nan, 0.0, 0.0], [np.inf, 0.0, 0.0]], 0.01, "it has no finite point"),
        ([[0.0, 0.0]], 0.01, r"expected points of shape \(any, 3\)"),
        (np.zeros((2, 3, 1)), 0.01, r"expected points of shape"),
        ([[0.0, 0.0, "a"]], 0.01, "expected numbers"),
        ([[0.0, 0.0, 1e9]], 0.01, "check units"),
        ([[0.0, 0.0, 0.0]], 0.0, "radius"),
        ([[0.0, 0.0, 0.0]], np.nan, "radius"),
    ],
)
def test_bad_points_are_refused_in_one_line(points, radius, message):
    with pytest.raises(InputError, match=message) as caught:
        PointCloud(points, radius)
    assert "\n" not in str(caught.value)


def test_points_that_are_not_finite_can_be_dropped_and_are_counted():
    points = scattered(10)
    points[[2, 5, 6], [0, 1, 2]] = np.nan, np.inf, -np.inf
    cloud = PointCloud(points, 0.01, invalid="drop")
    assert (len(cloud.points), cloud.dropped) == (7, 3)
    with pytest.raises(InputError, match="no finite point"):
        PointCloud(np.full((4, 3), np.nan), 0.01, invalid="drop")
    with pytest.raises(InputError, match="invalid must be"):
        PointCloud(points, 0.01, invalid="keep")


def test_millimetres_are_noticed():
    with pytest.warns(CloudWarning, match=r"2000 x.*0.001"):
        PointCloud(1000.0 * np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]]), 0.01)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        PointCloud([[-90.0, 0.0, 0.0], [90.0, 0.0, 0.0]], 0.01)


def test_a_cloud_is_a_value():
    cloud = PointCloud(scattered(50), 0.02)
    assert cloud.tree is cloud.tree
    for other in (copy.deepcopy(cloud), pickle.loads(pickle.dumps(cloud))):
        assert same_shape(cloud, other)
        assert not other.points.flags.writeable
        assert rows(other.tree.within(*other.bounds)) == rows(cloud.points)
    assert not same_shape(cloud, PointCloud(scattered(50), 0.03))
    assert cloud.grown(0.01).radius == pytest.approx(0.03)
