"""Height fields and octrees: which solid they are, and what is refused."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.shapes import Mesh, Octree, octree
from rrtik_ompl.model.shapes.height_field import HeightField


def inside(pile, points):
    """Which points, shape (n, 3), are in one of the boxes."""
    centres, sizes = pile.boxes
    return (np.abs(points[:, None] - centres) < 0.5 * sizes).all(axis=2).any(axis=1)


SOME = st.sampled_from([0.0, 0.5, np.nan])
GRIDS = arrays(np.float64, array_shapes(min_dims=2, max_dims=2, max_side=6), elements=SOME)


@settings(max_examples=50, deadline=None)
@given(GRIDS, st.integers(0, 99))
def test_a_point_is_in_the_field_if_it_is_below_the_height_of_its_cell(heights, seed):
    if np.isnan(heights).all():
        return
    field = HeightField(heights, 0.2, floor=-1.0, invalid="drop")
    half = 0.1 * np.array([heights.shape[1], heights.shape[0]])
    points = np.random.default_rng(seed).uniform([*-half, -1.2], [*half, 0.7], (200, 3))
    column, row = np.floor((points[:, :2] + half) / 0.2).astype(int).T
    below = (points[:, 2] < heights[row, column]) & (points[:, 2] > -1.0)
    assert (inside(field, points) == below).all()
    assert len(field.boxes[0]) <= np.isfinite(heights).sum()
    assert Mesh(*field.surface()).vertices.max() <= field.bounding_radius


def test_columns_of_one_height_are_one_box():
    assert len(HeightField(np.ones((50, 40)), 0.1).boxes[0]) == 1
    stairs = np.repeat(np.arange(10.0), 5)[:, None] * np.ones(30)
    assert len(HeightField(stairs, 0.1).boxes[0]) == 10
    rough = HeightField(stairs + np.random.default_rng(0).uniform(-0.4, 0.0, stairs.shape), 0.1)
    assert len(rough.boxes[0]) > 1000
    assert len(rough.rounded(1.0).boxes[0]) == 10


def test_a_coarser_field_contains_the_finer_one():
    rng = np.random.default_rng(0)
    fine = HeightField(rng.uniform(0.0, 1.0, (8, 12)), 0.1, floor=-1.0)
    points = rng.uniform([-0.6, -0.4, -1.0], [0.6, 0.4, 1.0], (2000, 3))
    assert fine.coarser(4).heights.shape == (2, 3)
    for wider in (fine.coarser(2), fine.coarser(4), fine.rounded(0.25)):
        assert not (inside(fine, points) & ~inside(wider, points)).any()


@pytest.mark.parametrize(
    ("heights", "cell", "options", "message"),
    [
        ([[0.0, np.nan]], 0.1, {}, "1 of 2 heights are not finite, the first in row 0, column 1 .*; invalid='drop'"),
        ([[np.nan]], 0.1, {"invalid": "drop"}, "none of the 1 heights is finite"),
        ([[np.inf, 1e12]], 0.1, {"invalid": "drop"}, "too far away; check their unit"),
        (np.zeros((0, 3)), 0.1, {}, "expected rows of numbers"),
        ([["a"]], 0.1, {}, "expected numbers"),
        ([[0.0]], 0.0, {}, "cell"),
        ([[0.0]], 0.1, {"floor": 0.0}, "floor must be below the lowest height of 0 m, got 0"),
        (np.arange(40_000.0).reshape(200, 200), 0.1, {}, r"boxes.*take .coarser\(2\)"),
    ],
)
def test_heights_that_make_no_ground_are_one_line(heights, cell, options, message):
    with pytest.raises(InputError, match=message) as told:
        HeightField(heights, cell, **options)
    assert "\n" not in str(told.value)


def test_an_octree_without_cells_or_with_too_many_is_refused(monkeypatch):
    with pytest.raises(InputError, match="none of its cells is occupied"):
        Octree(np.zeros((0, 3)), [])
    with pytest.raises(InputError, match="sides must be greater than 0"):
        Octree(np.zeros((1, 3)), -1.0)
    monkeypatch.setattr(octree, "MOST_CELLS", 10)
    with pytest.raises(InputError, match=r"cells.*coarser resolution"):
        Octree(np.zeros((11, 3)), 0.1)


def test_an_arm_keeps_off_the_ground_as_off_a_box_and_that_is_proven():
    robot = rrtik.load_robot("ur5")
    heights = np.full((20, 20), -0.4)
    heights[:, 14:] = 0.35
    ground = rrtik.World(robot, rrtik.Scene((rrtik.Obstacle("ground", HeightField(heights, 0.1, -0.6)),)))
    low, high = ((rrtik.Box([2.0, 2.0, 0.2]), [0.0, 0.0, -0.5]), (rrtik.Box([0.6, 2.0, 0.95]), [0.7, 0.0, -0.125]))
    boxes = [rrtik.Obstacle(f"b{k}", box, rrtik.pose(at)) for k, (box, at) in enumerate((low, high))]
    same = rrtik.World(robot, rrtik.Scene(tuple(boxes)))
    rows = np.random.default_rng(2).uniform(*robot.finite_range(), (2000, 6))
    free = same.valid_batch(rows)
    assert (ground.valid_batch(rows) == free).all()
    assert 0 < free.sum() < len(rows)
    path = rrtik.plan(rrtik.Problem(ground, rows[free][0], rows[free][1]), "fastrrtconnect", seed=1)
    assert path.proven
