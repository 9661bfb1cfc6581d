"""Outer covers contain the solid, and inner balls lie inside it."""

import itertools

import coal
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.geometry.collision.shape_table import pieces
from rrtik_ompl.geometry.collision.solids import bvh, hull, inside_mesh, is_closed, is_mesh, mesh_arrays, robot_solids
from rrtik_ompl.kernels.covers import spheres as covers
from rrtik_ompl.kernels.covers.points import distance_to_triangles
from rrtik_ompl.kernels.covers.spheres import inner_spheres, outer_cover, protrusion_bound
from rrtik_ompl.model.shapes import Prism
from rrtik_tests.covered_solids import (
    MESHES,
    SOLIDS,
    TOLERANCE,
    gap_outside,
    mesh_solid,
    points_in_triangles,
    points_of,
    torus,
)
from rrtik_tests.sizes import how_many

LETTER_L = [(0.0, 0.0), (0.3, 0.0), (0.3, 0.1), (0.1, 0.1), (0.1, 0.4), (0.0, 0.4)]
FEW = settings(max_examples=8, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)


def assert_inside(spheres, geometry):
    """Every ball lies in the solid: by planes, formulas, or the distance to every triangle."""
    centres, radii = spheres[:, :3], spheres[:, 3]
    assert (radii > 0).all()
    if isinstance(geometry, (coal.Sphere, coal.Capsule)):
        half = geometry.halfLength if isinstance(geometry, coal.Capsule) else 0.0
        beyond = np.maximum(np.abs(centres[:, 2]) - half, 0)
        assert (np.hypot(np.hypot(*centres[:, :2].T), beyond) + radii <= geometry.radius + TOLERANCE).all()
    elif isinstance(geometry, coal.Cylinder):
        assert (np.hypot(*centres[:, :2].T) + radii <= geometry.radius + TOLERANCE).all()
        assert (np.abs(centres[:, 2]) + radii <= geometry.halfLength + TOLERANCE).all()
    elif isinstance(geometry, coal.Box):
        assert (np.abs(centres) + radii[:, None] <= np.array(geometry.halfSide) + TOLERANCE).all()
    elif is_mesh(geometry):
        vertices, faces = mesh_arrays(geometry)
        for centre, radius in zip(centres, radii, strict=True):
            assert inside_mesh(vertices, faces, centre)
            spot = np.broadcast_to(centre, (len(faces), 3))
            assert radius <= distance_to_triangles(spot, vertices[faces]).min() + TOLERANCE
    else:
        points = np.array(geometry.points())
        planes = ConvexHull(points / np.ptp(points, axis=0)).equations
        normals = planes[:, :3] / np.ptp(points, axis=0)
        depth = -(centres @ normals.T + planes[:, 3]) / np.linalg.norm(normals, axis=1)
        assert (radii <= depth.min(axis=1) + TOLERANCE).all()


POINTS = how_many(6_000, 2_000)


def check_covers(geometry, count=POINTS):
    cover = outer_cover(geometry)
    assert cover.dtype == np.float64
    assert cover.shape == (len(cover), 4)
    few = not is_mesh(geometry) or is_closed(geometry)
    assert 1 <= len(cover) <= covers.MAX_BALLS * (1 if few else covers.BALLS_OF_OPEN)
    assert gap_outside(points_of(geometry, np.random.default_rng(1), count), cover) <= TOLERANCE
    assert_inside(inner_spheres(geometry), geometry)


@pytest.mark.parametrize("name", SOLIDS)
def test_primitives_are_covered_and_hold_their_inner_balls(name):
    check_covers(SOLIDS[name])
    assert len(inner_spheres(SOLIDS[name])) >= 1


@pytest.mark.parametrize("name", MESHES)
def test_meshes_of_every_sort_are_covered_and_hold_their_inner_balls(name):
    check_covers(mesh_solid(name))


@pytest.mark.parametrize("name", ["torus", "inside out", "cavity"])
def test_closed_meshes_have_inner_balls(name):
    assert len(inner_spheres(mesh_solid(name))) >= 3


@pytest.mark.parametrize("name", ["hole", "half", "soup", "turned over", "sheet", "three sheets"])
def test_open_meshes_have_no_inner_balls(name):
    assert inner_spheres(mesh_solid(name)).shape == (0, 4)


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["titan4", "panda", "ur5"])
def test_links_of_real_robots_are_covered_and_hold_their_inner_balls(robot):
    for solid in robot_solids(load_robot(robot))[:: how_many(1, 3)]:
        check_covers(solid)


@pytest.mark.slow
def test_links_with_many_triangles_are_covered_and_hold_their_inner_balls():
    for solid in robot_solids(load_robot("kinova"))[:7:3]:
        check_covers(solid, count=how_many(20_000, 6_000))


@pytest.mark.slow
@FEW
@given(st.integers(0, 10**6), st.integers(4, 60), st.floats(-7, 0), st.floats(-3, 3))
def test_random_hulls_are_covered(seed, count, flatness, size):
    rng = np.random.default_rng(seed)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    points = (rng.normal(size=(count, 3)) * (1.0, 0.5, 2.0 * 10**flatness)) @ turn
    try:
        solid = hull(points + rng.normal(size=3))
    except Exception as error:
        assert "flat" in str(error)  # noqa: PT017
        return
    cover = outer_cover(solid)
    sample = points_of(solid, rng, 3000)
    assert gap_outside(sample, cover) <= TOLERANCE


@pytest.mark.slow
@FEW
@given(st.tuples(*[st.floats(-4, 1)] * 3))
def test_random_boxes_are_covered_and_hold_their_inner_balls(sides):
    solid = coal.Box(*(10.0 ** np.array(sides)))
    assert gap_outside(points_of(solid, np.random.default_rng(0), 3000), outer_cover(solid)) <= TOLERANCE
    assert_inside(inner_spheres(solid), solid)


@pytest.mark.slow
@settings(FEW, max_examples=how_many(8, 3))
@given(st.floats(-3, 0.5), st.integers(3, 9))
def test_prisms_are_covered_and_hold_their_inner_balls(height, corners):
    turn = np.arange(corners) * 2 * np.pi / corners
    for polygon in (LETTER_L[::-1], np.column_stack([np.cos(turn), 0.4 * np.sin(turn)])):
        for piece in pieces(Prism(polygon=np.array(polygon), height=10.0**height)):
            solid = piece.geometry
            assert gap_outside(points_of(solid, np.random.default_rng(0), 1500), outer_cover(solid)) <= TOLERANCE
            assert_inside(inner_spheres(solid, count=8), solid)


@pytest.mark.parametrize("shift", [0.0, 1e3])
@pytest.mark.parametrize("size", [1e-5, 1.0, 1e3])
def test_covers_follow_size_and_place(size, shift):
    points = np.random.default_rng(5).normal(size=(30, 3)) * size + shift
    solid = hull(points)
    cover = outer_cover(solid)
    assert gap_outside(points_of(solid, np.random.default_rng(0)), cover) <= TOLERANCE * size
    assert protrusion_bound(solid, cover) < size * 3


@pytest.mark.parametrize("solid", [coal.Ellipsoid(0.1, 0.2, 0.3), coal.Cone(0.1, 0.3), coal.Box(0.0, 0.0, 0.0)])
def test_an_unknown_kind_gets_one_ball_and_no_inner_balls(solid):
    cover = outer_cover(solid)
    assert len(cover) == 1
    solid.computeLocalAABB()
    box = solid.aabb_local
    corners = np.array(list(itertools.product(*zip(box.min_, box.max_, strict=True))))
    assert gap_outside(corners, cover) <= TOLERANCE
    assert len(inner_spheres(solid)) == 0


def test_what_has_no_bounds_gets_a_ball_without_bounds():
    assert np.isinf(outer_cover(coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0))[0, 3])
    vertices, faces = torus()
    vertices[3, 1] = np.nan
    broken = coal.BVHModelOBBRSS()
    broken.beginModel(len(faces), len(vertices))
    broken.addVertices(vertices)
    broken.addTriangles(faces)
    assert np.isinf(outer_cover(broken)[0, 3])


def test_a_padded_solid_is_covered_with_its_padding():
    padded = coal.Box(0.3, 0.2, 0.1)
    padded.setSweptSphereRadius(0.05)
    assert np.allclose(outer_cover(padded)[:, 3], outer_cover(SOLIDS["box"])[:, 3] + 0.05)


DEGENERATE = {
    "a point": np.full((3, 3), 0.3),
    "a line": np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]),
    "a triangle": np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]),
    "a far triangle": np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]) + 1e4,
    "a needle of a triangle": np.array([[0.0, 0, 0], [1, 1e-9, 0], [1, 0, 1e-9]]),
    "flat": np.column_stack([np.random.default_rng(0).uniform(size=(60, 2)), np.zeros(60)]),
    "a point and a line": np.array([[0.0, 0, 0]] * 3 + [[1, 1, 1], [1, 1, 2], [1, 1, 3]]),
}


@pytest.mark.parametrize("name", DEGENERATE)
def test_a_mesh_without_volume_is_covered_and_proves_nothing(name):
    points = DEGENERATE[name]
    solid = bvh(points, np.arange(len(points)).reshape(-1, 3))
    cover = outer_cover(solid)
    assert np.isfinite(cover).all()
    corners = points.reshape(-1, 3, 3)
    assert (
        gap_outside(points_in_triangles(corners, 2000, np.random.default_rng(0)), cover)
        <= TOLERANCE * np.abs(points).max()
    )
    assert len(inner_spheres(solid)) == 0


@pytest.mark.parametrize(
    "scale", [(1e-6, 1e-6, 1e-6), (1e-3, 1e-3, 1e-3), (500, 500, 500), (4, 1e-6, 1e-6), (1, 1, 1e-5)]
)
def test_meshes_of_any_size_and_slenderness_are_covered(scale):
    vertices, faces = torus()
    solid = bvh(vertices * scale, faces)
    size = float(np.max(scale))
    sample = points_in_triangles((vertices * scale)[faces], 4000, np.random.default_rng(0))
    assert gap_outside(sample, outer_cover(solid)) <= TOLERANCE * size
    assert_inside(inner_spheres(solid), solid)
