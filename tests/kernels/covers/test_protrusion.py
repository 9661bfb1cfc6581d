"""Covers reach out no farther than was asked for, with few balls, the same every time."""

import coal
import numpy as np
import pytest

from rrtik_ompl.kernels.covers.spheres import inner_spheres, outer_cover, protrusion_bound
from rrtik_tests.covered_solids import SOLIDS, TOLERANCE, gap_outside, mesh_solid, points_of
from rrtik_tests.sizes import how_many


@pytest.mark.parametrize("name", ["box", "capsule", "cylinder", "disc", "thin box"])
@pytest.mark.parametrize("protrusion", [0.1, how_many(0.02, 0.04)])
def test_the_protrusion_that_is_asked_for_holds(name, protrusion):
    cover = outer_cover(SOLIDS[name], protrusion=protrusion)
    assert gap_outside(points_of(SOLIDS[name], np.random.default_rng(2)), cover) <= TOLERANCE
    if name in ("box", "capsule", "cylinder"):
        assert protrusion_bound(SOLIDS[name], cover) <= protrusion + TOLERANCE


@pytest.mark.parametrize("name", SOLIDS)
def test_no_ball_reaches_farther_than_the_bound(name):
    solid = SOLIDS[name]
    cover = outer_cover(solid)
    way = np.random.default_rng(4).normal(size=(400, 3))
    way /= np.linalg.norm(way, axis=1)[:, None]
    reach = (cover[:, None, :3] + way * cover[:, None, 3:]).reshape(-1, 3)
    bound = protrusion_bound(solid, cover)
    assert _distance(solid, reach).max() <= bound + TOLERANCE


def _distance(solid, points):
    if isinstance(solid, coal.Box):
        return np.linalg.norm(np.maximum(np.abs(points) - np.array(solid.halfSide), 0), axis=1)
    half = getattr(solid, "halfLength", 0.0)
    if isinstance(solid, coal.Cylinder):
        gaps = np.column_stack([np.hypot(*points[:, :2].T) - solid.radius, np.abs(points[:, 2]) - half])
        return np.linalg.norm(np.maximum(gaps, 0), axis=1)
    beyond = np.maximum(np.abs(points[:, 2]) - half, 0)
    return np.linalg.norm(np.column_stack([points[:, :2], beyond]), axis=1) - solid.radius


def test_more_protrusion_takes_no_more_balls():
    counts = [len(outer_cover(SOLIDS["capsule"], protrusion=p)) for p in (0.05, 0.01, 0.002)]
    assert counts == sorted(counts)


def test_small_parts_get_few_balls():
    assert len(outer_cover(coal.Box(0.02, 0.015, 0.02))) <= 4
    assert len(inner_spheres(coal.Box(0.02, 0.015, 0.02))) <= 4


@pytest.mark.slow
def test_the_same_solid_gets_the_same_balls():
    for solid in (SOLIDS["cylinder"], mesh_solid("torus")):
        assert np.array_equal(outer_cover(solid), outer_cover(solid))
        assert np.array_equal(inner_spheres(solid), inner_spheres(solid))
