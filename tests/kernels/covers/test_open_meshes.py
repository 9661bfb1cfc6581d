"""Meshes that are open, huge or broken: their inside is never left out."""

import itertools

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial import ConvexHull

from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.geometry.collision.solids import bvh, inside_mesh, mesh_arrays, robot_solids
from rrtik_ompl.kernels import COLLIDING, FREE, FastWorld, needs_covers
from rrtik_ompl.kernels.covers import spheres as covers
from rrtik_ompl.kernels.covers.solids import rim_caps
from rrtik_ompl.kernels.covers.spheres import inner_spheres, outer_cover
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Mesh
from rrtik_ompl.world.world import World
from rrtik_tests.covered_solids import TOLERANCE, facing_outward, gap_outside, torus, torus_with_hole


def test_open_edges_are_found_and_closed():
    assert len(rim_caps(*torus())) == 0
    vertices, faces = torus_with_hole()
    caps = rim_caps(vertices, faces)
    assert len(caps) > 0
    corners = np.concatenate([vertices[faces], caps]).reshape(-1, 3)
    points, number = np.unique(corners, axis=0, return_inverse=True)
    assert len(rim_caps(points, number.reshape(-1, 3))) == 0


def _fine_torus(n, m):
    vertices, _ = torus(n=n, m=m)
    i, j = (k.ravel() for k in np.meshgrid(np.arange(n), np.arange(m), indexing="ij"))
    a, b, c, d = (p % n * m + q % m for p, q in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)))
    return vertices, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def test_a_huge_mesh_is_taken_as_its_box(monkeypatch):
    vertices, faces = _fine_torus(120, 60)
    fine, few = bvh(vertices, faces), outer_cover(bvh(vertices, faces))
    assert len(inner_spheres(fine)) > 0
    monkeypatch.setattr(covers, "MAX_TRIANGLES", len(faces) - 1)
    fine = bvh(vertices, faces)  # another one, for the solid of a geometry is made once
    coarse = outer_cover(fine)
    assert not np.array_equal(coarse, few)
    corners = np.array(list(itertools.product(*np.stack([vertices.min(axis=0), vertices.max(axis=0)], axis=1))))
    assert gap_outside(np.concatenate([vertices, corners]), coarse) <= TOLERANCE
    assert len(inner_spheres(fine)) == 0


@pytest.mark.slow
@pytest.mark.parametrize("shared", [False, True])
def test_a_mesh_of_open_edges_only_is_taken_as_its_box(shared):
    rng = np.random.default_rng(1)
    faces = rng.integers(0, 300, (4200, 3)) if shared else np.arange(4200).reshape(-1, 3)
    faces = faces[(np.diff(np.sort(faces, axis=1), axis=1) > 0).all(axis=1)]
    vertices = rng.uniform(-0.2, 0.2, (faces.max() + 1, 3))
    solid = bvh(vertices, faces)
    cover = outer_cover(solid)
    assert len(cover) > 4
    assert gap_outside(np.concatenate([vertices, rng.uniform(-0.199, 0.199, (2000, 3))]), cover) <= 1e-3
    assert gap_outside(vertices, cover) <= TOLERANCE
    assert len(inner_spheres(solid)) == 0


def _worst_near_half(geometry, cover, rng):
    """Largest distance from the balls of points that World takes as inside a mesh: few, so many are tried."""
    vertices, faces = mesh_arrays(geometry)
    tried = rng.uniform(vertices.min(axis=0), vertices.max(axis=0), (6000, 3))
    away = (np.linalg.norm(tried[:, None] - cover[:, :3], axis=2) - cover[:, 3]).min(axis=1)
    outside = tried[away > 0.0]
    return [p for p in outside[:1500] if inside_mesh(vertices, faces, p)]


@pytest.mark.parametrize("share", [0.95, 0.9, 0.75, 0.5, 0.3])
def test_no_point_inside_an_open_mesh_is_left_out(share):
    solid = bvh(*torus_with_hole(share))
    assert _worst_near_half(solid, outer_cover(solid), np.random.default_rng(0)) == []


@pytest.mark.slow
def test_no_point_inside_the_open_links_of_robots_is_left_out():
    solids = robot_solids(load_robot("ur10"))[3], robot_solids(load_robot("ur3"))[4]
    for solid in solids:
        assert _worst_near_half(solid, outer_cover(solid), np.random.default_rng(0)) == []
        assert len(inner_spheres(solid)) == 0


def _two_cubes():
    """Two cubes with one edge in common: no edge is open, yet four triangles meet at one."""
    cube = np.array(list(itertools.product((0.0, 0.1), repeat=3)))
    faces = facing_outward(cube, ConvexHull(cube).simplices)
    corners = np.concatenate([cube[faces], (cube + np.array([0.1, 0.1, 0.0]))[faces]]).reshape(-1, 3)
    points, number = np.unique(corners, axis=0, return_inverse=True)
    return points, number.reshape(-1, 3)


@pytest.mark.kernels
def test_kernels_and_world_agree_about_the_inside_of_cubes_that_share_an_edge():
    robot = load_robot("point2d")
    cubes = _two_cubes()[0] * 30.0 - [1.5, 1.5, 1.5], _two_cubes()[1]
    scene = Scene([Obstacle("cubes", Mesh(*cubes), pin.SE3.Identity())])
    world = World(robot, scene)
    outer = [outer_cover(b.geometry) for b in world.bodies]
    inner = [inner_spheres(b.geometry) if needs_covers(b)[1] else np.empty((0, 4)) for b in world.bodies]
    fast = FastWorld(robot.chain, world.bodies, world.pairs, outer=outer, inner=inner, compiled=False)
    Q = np.random.default_rng(0).uniform(robot.lower, robot.upper, (300, robot.dof))
    judged = fast.classify(Q @ robot.chain.gain.T + robot.chain.offset)
    valid = world.valid_batch(Q)
    assert not valid[judged == COLLIDING].any()
    assert valid[judged == FREE].all()
