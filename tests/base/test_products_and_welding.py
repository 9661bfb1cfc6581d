"""Products of many points, and points at the same place: the answers are those of numpy's own functions."""

import numpy as np

from rrtik_ompl.base import arrays
from rrtik_ompl.base.arrays import products, welded
from rrtik_ompl.geometry.collision.solids import farthest_along, principal_axes

RNG = np.random.default_rng(5)


def test_products_in_parts_are_the_whole_product(monkeypatch):
    points, vectors = RNG.normal(size=(500, 3)), RNG.normal(size=(70, 3))
    monkeypatch.setattr(arrays, "QUIET_PRODUCT", 3 * 70 * 9)
    np.testing.assert_allclose(products(points, vectors), points @ vectors.T, rtol=0.0, atol=1e-14)
    assert products(points[:0], vectors).shape == (0, 70)


def test_equal_points_are_welded_and_no_others():
    points = RNG.integers(-2, 3, size=(400, 3)) * 0.1
    points[::7] *= -1.0  # has zeros of both signs
    first, place = welded(points)
    distinct, number = np.unique(points, axis=0, return_inverse=True)
    assert len(first) == len(distinct)
    np.testing.assert_array_equal(points[first][place], points)
    assert len(np.unique(np.column_stack([place, number.ravel()]), axis=0)) == len(distinct)
    assert all(first[k] == np.flatnonzero(place == k).min() for k in range(len(first)))


def test_places_whose_keys_are_the_same_are_not_welded(monkeypatch):
    monkeypatch.setattr(arrays, "_HASH_FACTORS", np.zeros(3, dtype=np.uint64))
    points = np.repeat(RNG.normal(size=(20, 3)), 2, axis=0)
    first, place = welded(points)
    assert len(first) == 20
    np.testing.assert_array_equal(points[first][place], points)


def test_the_farthest_points_are_found_through_their_boxes():
    points = RNG.normal(size=(3000, 3)) * (1.0, 0.3, 0.01)
    normals = RNG.normal(size=(400, 3))
    np.testing.assert_allclose(farthest_along(points, normals), (points @ normals.T).max(axis=0), rtol=1e-14)


def test_thin_sets_of_points_have_the_axes_of_the_whole_decomposition():
    points = RNG.normal(size=(300, 3)) * (1.0, 1e-4, 1e-9) @ np.linalg.qr(RNG.normal(size=(3, 3)))[0]
    sizes, axes = principal_axes(points)
    _, expected, rows = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    np.testing.assert_allclose(sizes, expected, rtol=1e-6)
    np.testing.assert_allclose(np.abs(np.einsum("ij,ij->i", axes, rows)), 1.0, atol=1e-9)
