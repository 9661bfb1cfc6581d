"""Outer covers contain the solid, inner balls lie inside it, and the cache never makes a difference."""

import itertools
import os

import coal
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from rrtik_ompl.catalog import load_robot
from rrtik_ompl.collision.enclosure import enclosure
from rrtik_ompl.collision.shape_table import pieces
from rrtik_ompl.collision.solids import bvh, hull, inside_mesh, is_closed, is_mesh, mesh_arrays, robot_solids
from rrtik_ompl.covers import cache as cover_cache
from rrtik_ompl.covers import spheres as covers
from rrtik_ompl.covers.cache import cached_inner_spheres, cached_outer_cover
from rrtik_ompl.covers.solids import distance_to_triangles, rim_caps
from rrtik_ompl.covers.spheres import inner_spheres, outer_cover, protrusion_bound
from rrtik_ompl.fast import COLLIDING, FREE, FastWorld, needs_covers
from rrtik_ompl.files.cache import FOLDER_VARIABLE
from rrtik_ompl.scene import Obstacle, Scene
from rrtik_ompl.shapes import Mesh, Prism
from rrtik_ompl.world import World

TOLERANCE = 1e-9
LETTER_L = [(0.0, 0.0), (0.3, 0.0), (0.3, 0.1), (0.1, 0.1), (0.1, 0.4), (0.0, 0.4)]
FEW = settings(max_examples=8, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)
SOLIDS = {
    "box": coal.Box(0.3, 0.2, 0.1),
    "thin box": coal.Box(0.5, 0.4, 1e-4),
    "long box": coal.Box(1.0, 0.02, 0.02),
    "sphere": coal.Sphere(0.1),
    "capsule": coal.Capsule(0.05, 0.4),
    "capsule of no length": coal.Capsule(0.05, 0.0),
    "rod": coal.Capsule(1e-4, 1.0),
    "cylinder": coal.Cylinder(0.1, 0.2),
    "disc": coal.Cylinder(0.2, 0.01),
    "pipe": coal.Cylinder(0.02, 0.8),
}


def _hollow_box(size=0.2, wall=0.02):
    """A closed mesh with a cavity."""
    corners = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
    faces = _outward(corners, ConvexHull(corners).simplices)
    inner = corners * (size - 2 * wall)
    return np.concatenate([corners * size, inner]), np.concatenate([faces, faces[:, ::-1] + 8])


def _outward(points, faces):
    a, b, c = (points[faces[:, k]] for k in range(3))
    turned = np.einsum("ij,ij->i", np.cross(b - a, c - a), a + b + c - 3 * points.mean(axis=0)) < 0
    return np.where(turned[:, None], faces[:, ::-1], faces)


def _torus(big=0.2, small=0.06, n=24, m=14):
    u, v = np.meshgrid(np.arange(n) * 2 * np.pi / n, np.arange(m) * 2 * np.pi / m, indexing="ij")
    rho = big + small * np.cos(v)
    vertices = np.stack([rho * np.cos(u), rho * np.sin(u), small * np.sin(v)], axis=-1).reshape(-1, 3)
    faces = []
    for i, j in itertools.product(range(n), range(m)):
        a, b = i * m + j, (i + 1) % n * m + j
        c, d = (i + 1) % n * m + (j + 1) % m, i * m + (j + 1) % m
        faces += [(a, b, c), (a, c, d)]
    return vertices, np.array(faces)


def _with_hole(share=0.9):
    vertices, faces = _torus()
    return vertices, faces[: int(share * len(faces))]


def _soup():
    return np.random.default_rng(3).uniform(-0.2, 0.2, (60, 3)), np.arange(60).reshape(-1, 3)


def _turned_over():
    vertices, faces = _torus()
    return vertices, np.where((np.arange(len(faces)) % 2 == 0)[:, None], faces, faces[:, ::-1])


MESHES = {
    "torus": _torus(),
    "cavity": _hollow_box(),
    "inside out": (_torus()[0], _torus()[1][:, ::-1]),
    "hole": _with_hole(),
    "half": _with_hole(0.5),
    "soup": _soup(),
    "turned over": _turned_over(),
    "sheet": (np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]])),
    "three sheets": (
        np.concatenate([[[0.0, 0, z], [1, 0, z], [0, 1, z]] for z in (0.0, 0.01, 0.02)]),
        np.arange(9).reshape(3, 3),
    ),
    "doubled": (_torus()[0], np.concatenate([_torus()[1]] * 2)),
    "with slivers": (_torus()[0], np.concatenate([_torus()[1], [[0, 0, 1], [5, 5, 5]]])),
}


def _mesh(name):
    vertices, faces = MESHES[name]
    return bvh(np.asarray(vertices, dtype=float), faces)


def _in_triangles(corners, count, rng):
    share = rng.dirichlet((0.6, 0.6, 0.6), (count, 1))
    pick = rng.integers(len(corners), size=count)
    return (share @ corners[pick])[:, 0]


def _points_of(geometry, rng, count=6000):
    """Points of a solid: surface, edges, corners and interior."""
    if isinstance(geometry, (coal.Sphere, coal.Capsule)):
        half = geometry.halfLength if isinstance(geometry, coal.Capsule) else 0.0
        way = rng.normal(size=(count, 3))
        way *= geometry.radius * rng.uniform(0.9, 1.0, (count, 1)).round(1) / np.linalg.norm(way, axis=1)[:, None]
        return way + np.outer(rng.uniform(-half, half, count), (0, 0, 1))
    if isinstance(geometry, coal.Cylinder):
        turn = rng.uniform(0, 2 * np.pi, count)
        rho = geometry.radius * np.maximum(rng.uniform(size=count) ** 0.3, rng.integers(2, size=count))
        z = geometry.halfLength * np.clip(rng.uniform(-1.5, 1.5, count), -1, 1)
        return np.column_stack([rho * np.cos(turn), rho * np.sin(turn), z])
    if isinstance(geometry, coal.Box):
        return np.clip(rng.uniform(-1.4, 1.4, (count, 3)), -1, 1) * np.array(geometry.halfSide)
    if is_mesh(geometry):
        return _points_of_mesh(geometry, rng, count)
    points = np.array(geometry.points())
    mixed = [rng.dirichlet(np.full(len(points), a), count // 3) @ points for a in (0.02, 0.1, 1.0)]
    return np.concatenate([points, *mixed])


def _points_of_mesh(geometry, rng, count):
    vertices, faces = mesh_arrays(geometry)
    corners = vertices[faces]
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    work = max(20, min(1500, 3_000_000 // len(faces)))
    some = rng.uniform(low, high, (work, 3))
    if is_closed(geometry):
        inside = [p for p in some if inside_mesh(vertices, faces, p)]
    else:
        inside = [p for p in some if enclosure(geometry).holds(p[None])]
    return np.concatenate([vertices[faces.ravel()], _in_triangles(corners, count, rng), np.reshape(inside, (-1, 3))])


def _outside(points, spheres):
    """Largest distance of a point from the union of balls (negative: all are inside)."""
    worst = -np.inf
    for some in np.array_split(points, max(1, len(points) // 2000)):
        away = np.linalg.norm(some[:, None] - spheres[:, :3], axis=2) - spheres[:, 3]
        worst = max(worst, away.min(axis=1).max())
    return worst


def _assert_inside(spheres, geometry):
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


def _check(geometry, count=6000):
    cover = outer_cover(geometry)
    assert cover.dtype == np.float64
    assert cover.shape == (len(cover), 4)
    few = not is_mesh(geometry) or is_closed(geometry)
    assert 1 <= len(cover) <= covers.MOST * (1 if few else covers.BALLS_OF_OPEN)
    assert _outside(_points_of(geometry, np.random.default_rng(1), count), cover) <= TOLERANCE
    _assert_inside(inner_spheres(geometry), geometry)


@pytest.mark.parametrize("name", SOLIDS)
def test_primitives_are_covered_and_hold_their_inner_balls(name):
    _check(SOLIDS[name])
    assert len(inner_spheres(SOLIDS[name])) >= 1


@pytest.mark.parametrize("name", MESHES)
def test_meshes_of_every_sort_are_covered_and_hold_their_inner_balls(name):
    _check(_mesh(name))


@pytest.mark.parametrize("name", ["torus", "inside out", "cavity"])
def test_closed_meshes_have_inner_balls(name):
    assert len(inner_spheres(_mesh(name))) >= 3


@pytest.mark.parametrize("name", ["hole", "half", "soup", "turned over", "sheet", "three sheets"])
def test_open_meshes_have_no_inner_balls(name):
    assert inner_spheres(_mesh(name)).shape == (0, 4)


@pytest.mark.parametrize("robot", ["titan4", "panda", "ur5"])
def test_links_of_real_robots_are_covered_and_hold_their_inner_balls(robot):
    for solid in robot_solids(load_robot(robot)):
        _check(solid)


def test_links_with_many_triangles_are_covered_and_hold_their_inner_balls():
    for solid in robot_solids(load_robot("kinova"))[:7:3]:
        _check(solid, count=20000)


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
    sample = _points_of(solid, rng, 3000)
    assert _outside(sample, cover) <= TOLERANCE


@FEW
@given(st.tuples(*[st.floats(-4, 1)] * 3))
def test_random_boxes_are_covered_and_hold_their_inner_balls(sides):
    solid = coal.Box(*(10.0 ** np.array(sides)))
    assert _outside(_points_of(solid, np.random.default_rng(0), 3000), outer_cover(solid)) <= TOLERANCE
    _assert_inside(inner_spheres(solid), solid)


@FEW
@given(st.floats(-3, 0.5), st.integers(3, 9))
def test_prisms_are_covered_and_hold_their_inner_balls(height, corners):
    turn = np.arange(corners) * 2 * np.pi / corners
    for polygon in (LETTER_L[::-1], np.column_stack([np.cos(turn), 0.4 * np.sin(turn)])):
        for piece in pieces(Prism(polygon=np.array(polygon), height=10.0**height)):
            solid = piece.geometry
            assert _outside(_points_of(solid, np.random.default_rng(0), 1500), outer_cover(solid)) <= TOLERANCE
            _assert_inside(inner_spheres(solid, count=8), solid)


@pytest.mark.parametrize("shift", [0.0, 1e3])
@pytest.mark.parametrize("size", [1e-5, 1.0, 1e3])
def test_covers_follow_size_and_place(size, shift):
    points = np.random.default_rng(5).normal(size=(30, 3)) * size + shift
    solid = hull(points)
    cover = outer_cover(solid)
    assert _outside(_points_of(solid, np.random.default_rng(0)), cover) <= TOLERANCE * size
    assert protrusion_bound(solid, cover) < size * 3


@pytest.mark.parametrize("name", ["box", "capsule", "cylinder", "disc", "thin box"])
@pytest.mark.parametrize("protrusion", [0.1, 0.03, 0.02])
def test_the_protrusion_that_is_asked_for_holds(name, protrusion):
    cover = outer_cover(SOLIDS[name], protrusion=protrusion)
    assert _outside(_points_of(SOLIDS[name], np.random.default_rng(2)), cover) <= TOLERANCE
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


def test_the_same_solid_gets_the_same_balls():
    for solid in (SOLIDS["box"], SOLIDS["cylinder"], _mesh("torus"), _mesh("hole")):
        assert np.array_equal(outer_cover(solid), outer_cover(solid))
        assert np.array_equal(inner_spheres(solid), inner_spheres(solid))


@pytest.mark.parametrize("solid", [coal.Ellipsoid(0.1, 0.2, 0.3), coal.Cone(0.1, 0.3), coal.Box(0.0, 0.0, 0.0)])
def test_an_unknown_kind_gets_one_ball_and_no_inner_balls(solid):
    cover = outer_cover(solid)
    assert len(cover) == 1
    solid.computeLocalAABB()
    box = solid.aabb_local
    corners = np.array(list(itertools.product(*zip(box.min_, box.max_, strict=True))))
    assert _outside(corners, cover) <= TOLERANCE
    assert len(inner_spheres(solid)) == 0


def test_what_has_no_bounds_gets_a_ball_without_bounds():
    assert np.isinf(outer_cover(coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0))[0, 3])
    vertices, faces = _torus()
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


def test_open_edges_are_found_and_closed():
    assert len(rim_caps(*_torus())) == 0
    vertices, faces = _with_hole()
    caps = rim_caps(vertices, faces)
    assert len(caps) > 0
    corners = np.concatenate([vertices[faces], caps]).reshape(-1, 3)
    points, number = np.unique(corners, axis=0, return_inverse=True)
    assert len(rim_caps(points, number.reshape(-1, 3))) == 0


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
    assert _outside(_in_triangles(corners, 2000, np.random.default_rng(0)), cover) <= TOLERANCE * np.abs(points).max()
    assert len(inner_spheres(solid)) == 0


@pytest.mark.parametrize(
    "scale", [(1e-6, 1e-6, 1e-6), (1e-3, 1e-3, 1e-3), (500, 500, 500), (4, 1e-6, 1e-6), (1, 1, 1e-5)]
)
def test_meshes_of_any_size_and_slenderness_are_covered(scale):
    vertices, faces = _torus()
    solid = bvh(vertices * scale, faces)
    size = float(np.max(scale))
    sample = _in_triangles((vertices * scale)[faces], 4000, np.random.default_rng(0))
    assert _outside(sample, outer_cover(solid)) <= TOLERANCE * size
    _assert_inside(inner_spheres(solid), solid)


def _fine_torus(n, m):
    vertices, _ = _torus(n=n, m=m)
    i, j = (k.ravel() for k in np.meshgrid(np.arange(n), np.arange(m), indexing="ij"))
    a, b, c, d = (p % n * m + q % m for p, q in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)))
    return vertices, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def test_a_huge_mesh_is_taken_as_its_box(monkeypatch):
    vertices, faces = _fine_torus(120, 60)
    fine, few = bvh(vertices, faces), outer_cover(bvh(vertices, faces))
    assert len(inner_spheres(fine)) > 0
    monkeypatch.setattr(covers, "MOST_TRIANGLES", len(faces) - 1)
    coarse = outer_cover(fine)
    assert not np.array_equal(coarse, few)
    corners = np.array(list(itertools.product(*np.stack([vertices.min(axis=0), vertices.max(axis=0)], axis=1))))
    assert _outside(np.concatenate([vertices, corners]), coarse) <= TOLERANCE
    assert len(inner_spheres(fine)) == 0


@pytest.mark.parametrize("shared", [False, True])
def test_a_mesh_of_open_edges_only_is_taken_as_its_box(shared):
    rng = np.random.default_rng(1)
    faces = rng.integers(0, 300, (6000, 3)) if shared else np.arange(6000).reshape(-1, 3)
    faces = faces[(np.diff(np.sort(faces, axis=1), axis=1) > 0).all(axis=1)]
    vertices = rng.uniform(-0.2, 0.2, (faces.max() + 1, 3))
    solid = bvh(vertices, faces)
    cover = outer_cover(solid)
    assert len(cover) > 4
    assert _outside(np.concatenate([vertices, rng.uniform(-0.199, 0.199, (2000, 3))]), cover) <= 1e-3
    assert _outside(vertices, cover) <= TOLERANCE
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
    solid = bvh(*_with_hole(share))
    assert _worst_near_half(solid, outer_cover(solid), np.random.default_rng(0)) == []


def test_no_point_inside_the_open_links_of_robots_is_left_out():
    solids = robot_solids(load_robot("ur10"))[3], robot_solids(load_robot("ur3"))[4]
    for solid in solids:
        assert _worst_near_half(solid, outer_cover(solid), np.random.default_rng(0)) == []
        assert len(inner_spheres(solid)) == 0


def _two_cubes():
    """Two cubes with one edge in common: no edge is open, yet four triangles meet at one."""
    cube = np.array(list(itertools.product((0.0, 0.1), repeat=3)))
    faces = _outward(cube, ConvexHull(cube).simplices)
    corners = np.concatenate([cube[faces], (cube + np.array([0.1, 0.1, 0.0]))[faces]]).reshape(-1, 3)
    points, number = np.unique(corners, axis=0, return_inverse=True)
    return points, number.reshape(-1, 3)


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


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path))
    return tmp_path / "covers"


def test_the_cache_gives_back_what_was_made(folder, monkeypatch):
    first = cached_outer_cover(SOLIDS["box"]), cached_inner_spheres(SOLIDS["box"])
    monkeypatch.setattr(covers, "outer_cover", None)
    monkeypatch.setattr(covers, "inner_spheres", None)
    again = cached_outer_cover(SOLIDS["box"]), cached_inner_spheres(SOLIDS["box"])
    assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))
    assert len(list(folder.iterdir())) == 2


def test_other_geometry_or_parameters_have_another_file(folder):
    for solid in (coal.Box(1, 2, 3), coal.Box(1, 2, 3.0000001), coal.Cylinder(1, 2), _mesh("torus")):
        cached_outer_cover(solid)
        cached_outer_cover(solid, protrusion=0.5)
    assert len(list(folder.iterdir())) == 8


@pytest.mark.parametrize("damage", ["empty", "noise", "cut", "shape", "nan", "other", "pickle", "flipped", "folder"])
def test_a_damaged_file_is_made_anew(folder, damage):
    true = cached_outer_cover(SOLIDS["box"])
    (file,) = folder.iterdir()
    whole = file.read_bytes()
    key = file.stem
    if damage == "empty":
        file.write_bytes(b"")
    elif damage == "noise":
        file.write_bytes(np.random.default_rng(0).bytes(500))
    elif damage == "cut":
        file.write_bytes(whole[: len(whole) // 2])
    elif damage == "shape":
        np.savez(file, spheres=true[:, :3], key=key, check=cover_cache._check(true[:, :3]))
    elif damage == "nan":
        np.savez(file, spheres=true * np.nan, key=key, check=cover_cache._check(true * np.nan))
    elif damage == "other":
        cached_outer_cover(SOLIDS["cylinder"])
        (other,) = set(folder.iterdir()) - {file}
        os.replace(other, file)
    elif damage == "pickle":
        np.savez(file, spheres=np.array([{}], dtype=object), key=key, check="")
    elif damage == "flipped":
        np.savez(file, spheres=true * 0.5, key=key, check=cover_cache._check(true))
    else:
        file.unlink()
        file.mkdir()
    assert np.array_equal(cached_outer_cover(SOLIDS["box"]), true)
    assert np.array_equal(cached_outer_cover(SOLIDS["box"]), true)


def test_every_cut_of_a_file_is_survived(folder):
    true = cached_inner_spheres(SOLIDS["box"])
    (file,) = folder.iterdir()
    whole = file.read_bytes()
    for length in range(0, len(whole), max(1, len(whole) // 40)):
        file.write_bytes(whole[:length])
        assert cover_cache._read(file, file.stem) is None
    for place in range(0, len(whole), max(1, len(whole) // 200)):
        file.write_bytes(whole[:place] + bytes([whole[place] ^ 0x5A]) + whole[place + 1 :])
        found = cover_cache._read(file, file.stem)
        assert found is None or np.array_equal(found, true)


def test_a_folder_that_cannot_be_made_is_no_error(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path / "file" / "below"))
    assert len(cached_outer_cover(SOLIDS["box"])) > 0


def test_an_empty_folder_name_switches_the_cache_off(tmp_path, monkeypatch):
    monkeypatch.setenv(FOLDER_VARIABLE, "")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    cached_outer_cover(SOLIDS["box"])
    assert not list(tmp_path.iterdir())


def test_the_users_cache_folder_is_the_default(tmp_path, monkeypatch):
    monkeypatch.delenv(FOLDER_VARIABLE, raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    cached_outer_cover(SOLIDS["box"])
    assert len(list((tmp_path / "rrtik-ompl" / "covers").glob("*.npz"))) == 1


def test_nothing_is_left_aside_after_writing(folder):
    for _ in range(2):
        cached_outer_cover(SOLIDS["disc"])
    assert [f.suffix for f in folder.iterdir()] == [".npz"]
