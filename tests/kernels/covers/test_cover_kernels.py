"""The kernels that make covers give what numpy, scipy and the code without kernels give."""

import coal
import numpy as np
import pytest
from scipy.spatial import ConvexHull, cKDTree

from rrtik_ompl.geometry.collision.solids import inside_mesh
from rrtik_ompl.kernels.covers import cells, cuts, mesh_pieces, points, search, search_in_numpy, spheres
from rrtik_ompl.kernels.covers.spheres import inner_spheres, outer_cover
from rrtik_ompl.kernels.covers.surface import Places, Surface, surface_points
from rrtik_tests.covered_solids import mesh_solid

pytestmark = pytest.mark.kernels
WITH_KERNELS = (cells, cuts, points, search)  # modules that ask for them
RNG = np.random.default_rng(3)


@pytest.fixture
def known():
    return spheres._solid(mesh_solid("torus"))


def without_kernels(monkeypatch):
    for module in WITH_KERNELS:
        monkeypatch.setattr(module, "library", lambda name: None)


def test_reaches_greedy_choice_and_moved_balls(known):
    elements = cells.elements(known.solid, 200)
    candidates = search.candidates(elements, known.surface)
    reaches = search.reaches(elements, candidates.centres)
    np.testing.assert_allclose(reaches, search_in_numpy.reaches(elements, candidates.centres), atol=1e-5)

    protrusions = reaches - candidates.depth[:, None].astype(np.float32)
    allowed = 0.5 * float(protrusions.min(axis=0).max() + protrusions.max(axis=1).min())
    rows = search_in_numpy.greedy_set_cover(protrusions <= allowed)
    np.testing.assert_array_equal(search._greedy_set_cover(protrusions, allowed, len(rows)), rows)
    assert search._greedy_set_cover(protrusions, allowed, len(rows) - 1) is None

    used, owner = np.unique(protrusions[rows].argmin(axis=0), return_inverse=True)
    owner = np.repeat(owner.ravel(), np.diff(np.r_[elements.start, len(elements.points)]))
    places = Places(candidates.centres[rows[used]], candidates.depth[rows[used]])
    moved = search._recentred(elements, known.surface, places, owner)
    expected = search_in_numpy.recentred(elements, known.surface, places, owner, search.RECENTRING_STEPS)
    worst = [
        np.bincount(owner, minlength=len(used)) * 0.0 + _needed(elements, owner, each) - each.depth
        for each in (moved, expected)
    ]
    np.testing.assert_allclose(*worst, atol=5e-3)  # of a solid of size 1; ties are broken otherwise


def _needed(elements, owner, places):
    radius = np.zeros(len(places.centres))
    np.maximum.at(radius, owner, np.linalg.norm(elements.points - places.centres[owner], axis=1) + elements.radii)
    return radius


@pytest.mark.parametrize("count", [1, 31, 500, 2000])
def test_the_nearest_point_of_a_surface(count):
    data = RNG.normal(size=(count, 3))
    queries = RNG.normal(size=(50, 3)) * 3.0
    distance, index = Surface(data).query(queries)
    np.testing.assert_allclose(distance, cKDTree(data).query(queries)[0], rtol=1e-5)
    np.testing.assert_allclose(distance, np.linalg.norm(queries - data[index], axis=1), rtol=1e-5)


def test_cells_and_winding_numbers(known, monkeypatch):
    grid = cells._grid(known.solid.triangles, 150)
    surface = grid.to_cells(known.solid.triangles)
    # some triangles in the planes between cells, whose pieces belong to the cells on both sides
    flat = np.round(surface[::40])
    surface = np.concatenate([surface, flat[np.ptp(flat.reshape(len(flat), -1), axis=1) > 0.0]])
    made = cells._in_cells(surface, grid.shape), cells.winding(surface[: len(known.solid.triangles)], grid.shape)
    without_kernels(monkeypatch)
    plain = cells._in_cells(surface, grid.shape), cells.winding(surface[: len(known.solid.triangles)], grid.shape)

    for (own, own_cells), (other, other_cells) in [(made[0], plain[0]), (plain[0], made[0])]:
        assert set(own_cells) == set(other_cells)
        for cell in set(own_cells):  # the hulls are the same: the highest points along directions
            for direction in ((1.0, 0.3, -0.2), (-0.4, 1.0, 0.5), (-0.3, -0.6, -1.0)):
                heights = [
                    (each[which == cell] @ direction).max() for each, which in ((own, own_cells), (other, other_cells))
                ]
                assert heights[0] == pytest.approx(heights[1], abs=1e-8)
    for own, other in zip(made[1], plain[1], strict=True):
        np.testing.assert_array_equal(own, other)


@pytest.mark.parametrize("kind", ["cloud", "grid", "flat", "few"])
def test_volumes_of_hulls(kind):
    some = RNG.normal(size=(90, 3))
    if kind == "grid":
        some = np.unique(RNG.integers(0, 5, size=(90, 3)) * (0.1, 0.2, 0.3), axis=0)
    if kind == "flat":
        some[:, 2] = 0.0
    expected = 0.0 if kind in ("flat", "few") else ConvexHull(some).volume
    volume = cuts.hull_volume(some[:3] if kind == "few" else some)
    assert volume == pytest.approx(expected, rel=1e-3, abs=1e-4)


def test_volumes_on_both_sides_of_cuts():
    solid = spheres._solid(mesh_solid("torus")).solid
    cell = mesh_pieces._first_cell(solid.triangles, mesh_pieces.NO_BOXES)
    for axis in range(3):
        for number, share in enumerate(mesh_pieces.SHARES):
            halves = cell._cut(axis, share)
            expected = sum(ConvexHull(mesh_pieces._extreme_points(half.points)).volume for half in halves)
            assert cell._volumes[axis, number] == pytest.approx(expected, rel=0.02)


def test_extreme_points_distances_and_chosen_balls(known, monkeypatch):
    solid = known.solid
    corners = solid.triangles.reshape(-1, 3)
    queries = RNG.uniform(-0.5, 0.5, size=(40, 3))
    gaps = RNG.normal(size=(60, 30)).astype(np.float32)
    gap = np.full(30, 5.0, dtype=np.float32)

    directions = mesh_pieces._unit_directions()

    def answers():
        return (
            points.extreme_points(corners, directions) @ (1.0, 2.0, 3.0),
            solid.distance(queries),
            points.chosen_balls(gaps, gap, 12),
            points.farthest_beyond(corners, directions, 0.9 * (corners @ directions.T).max(axis=0)),
            points.farthest_beyond(corners, directions, 2.0 * (corners @ directions.T).max(axis=0)),
        )

    made = answers()
    without_kernels(monkeypatch)
    for own, other in zip(made, answers(), strict=True):
        np.testing.assert_allclose(own, other, atol=1e-9)


def test_rays_tell_what_is_inside():
    triangles = mesh_pieces._shells(*_torus_arrays())[0]
    places = RNG.uniform(triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1)), size=(60, 3))
    places = np.concatenate([places, triangles[:5].mean(axis=1) + 1e-3, triangles[:5, 0]])
    numbers = np.arange(3 * len(triangles)).reshape(-1, 3)
    expected = [inside_mesh(triangles.reshape(-1, 3), numbers, place) for place in places]
    np.testing.assert_array_equal(mesh_pieces._inside(triangles, places), expected)


def _torus_arrays():
    mesh = mesh_solid("torus")
    from rrtik_ompl.geometry.collision.solids import mesh_arrays

    return mesh_arrays(mesh)


def test_covers_without_kernels_are_as_good(monkeypatch):
    box = coal.Convex.convexHull(_vectors(RNG.normal(size=(30, 3)) * 0.05), True, "Qt")
    made = outer_cover(box), inner_spheres(box)
    spheres._latest.clear()
    without_kernels(monkeypatch)
    monkeypatch.setattr("rrtik_ompl.kernels.covers.surface.library", lambda name: None)
    plain = outer_cover(box), inner_spheres(box)
    for own, other in zip(made, plain, strict=True):
        assert abs(len(own) - len(other)) <= 1
        assert own[:, 3].mean() == pytest.approx(other[:, 3].mean(), rel=0.1)


def _vectors(rows):
    cloud = coal.StdVec_Vec3s()
    for row in rows:
        cloud.append(row)
    return cloud


def test_points_of_the_surface_are_spread_the_same_way_each_time(known):
    first, second = (surface_points(known.solid.triangles, 100) for _ in range(2))
    np.testing.assert_array_equal(first, second)
