"""Certificates beside all shapes, and what cuts, models and insides cannot be used for."""

import json
from dataclasses import replace

import numpy as np
import pytest

import rrtik_ompl as rrtik
from bench.proofs.tampering import with_model_of
from rrtik_ompl.geometry.collision.elements import (
    DIRECTIONS,
    _extents,
    compared_pairs,
    elements_of,
    named_bodies,
)
from rrtik_ompl.model.certificate import from_document
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.motion.trajectory.splines import Splines
from rrtik_ompl.world.certificate_intervals import Known, Open, Rows
from rrtik_ompl.world.certificate_making import _known_cover, _Table
from rrtik_ompl.world.certificate_parts import Parts, _known_parts, enclosed, inside_mesh
from rrtik_ompl.world.world import World

pytestmark = pytest.mark.kernels
RNG = np.random.default_rng(0)
WALL = np.column_stack([np.full(4000, 0.62), RNG.uniform(-0.5, 0.5, 4000), RNG.uniform(0.0, 0.8, 4000)])
CELLS = np.unique(np.floor(WALL / 0.02), axis=0) * 0.02 + 0.01
NEAR = CELLS[(np.abs(CELLS[:, 1]) < 0.2) & (CELLS[:, 2] > 0.2) & (CELLS[:, 2] < 0.5)]
GROUND = 0.05 * RNG.random((12, 15)) - 0.1
L_SHAPE = [[0.0, -0.4], [0.1, -0.4], [0.1, 0.3], [0.3, 0.3], [0.3, 0.4], [0.0, 0.4]]
ROWS = np.array(
    [
        [-0.4, 0.3, 0.0, -2.2, 0.0, 2.5, 0.8],
        [0.4, 0.3, 0.0, -2.2, 0.0, 2.5, 0.8],
        [0.4, 0.0, 0.2, -2.1, 0.0, 2.5, 1.3],
    ]
)
INTO_THE_WAY = np.array([-0.25, 0.0, 0.1])
SHAPES = {
    "cloud": (rrtik.PointCloud(WALL, 0.01), [0.0, 0.0, 0.0]),
    "octree of many cells": (rrtik.Octree(CELLS, np.full(len(CELLS), 0.02)), [0.0, 0.0, 0.0]),
    "octree of few cells": (rrtik.Octree(NEAR, np.full(len(NEAR), 0.02)), [0.0, 0.0, 0.0]),
    "height field": (rrtik.HeightField(GROUND, 0.1, floor=-0.3), [0.9, 0.0, 0.0]),
    "prism": (rrtik.Prism(L_SHAPE, 0.8), [0.62, 0.0, 0.3]),
    "half-space": (rrtik.HalfSpace([-1.0, 0.0, 0.0], -0.7), [0.0, 0.0, 0.0]),
}


@pytest.fixture(scope="module")
def arm():
    return rrtik.load_robot("panda")


def beside(arm, name):
    """A world with one shape, and a path along it that is proven."""
    shape, place = SHAPES[name]
    world = World(arm, Scene([Obstacle("thing", shape, rrtik.pose(place))]))
    assert world.prove(ROWS).proven
    return world, ROWS


@pytest.fixture(scope="module")
def cloudy(arm):
    """A world with a cloud, a path and its certificate."""
    world, rows = beside(arm, "cloud")
    return world, rows, world.certificate(rows)


@pytest.mark.parametrize("name", SHAPES)
def test_a_path_beside_any_shape_has_a_certificate_that_holds_there_and_not_where_it_is_in_the_way(arm, name):
    world, rows = beside(arm, name)
    certificate = from_document(json.loads(json.dumps(world.certificate(rows).document())))
    assert world.verify(certificate, rows) == ""

    shape, place = SHAPES[name]
    shift = np.array([0.0, 0.0, 0.45]) if name == "height field" else INTO_THE_WAY
    nearer = World(arm, Scene([Obstacle("thing", shape, rrtik.pose(place + shift))]))
    assert not nearer.prove(rows).proven
    assert nearer.verify(certificate, rows) == "it is for another scene: 'thing' differs"
    assert "not shown apart" in nearer.verify(with_model_of(certificate, nearer), rows)


@pytest.mark.parametrize("name", ["octree of few cells", "height field"])
def test_a_second_certificate_leaves_nothing_behind_that_the_first_has_not_left(arm, name):
    world, rows = beside(arm, name)
    remembered = []
    for _ in range(2):
        assert world.verify(world.certificate(rows), rows) == ""
        remembered.append([known.cache_info().misses for known in (_known_parts, _known_cover)])
    assert remembered[0] == remembered[1]


def test_a_point_more_in_a_cloud_is_found_whatever_the_model_says(arm, cloudy):
    _, rows, certificate = cloudy
    tip = arm.fk(0.5 * (rows[0] + rows[1])).translation
    more = rrtik.PointCloud(np.vstack([WALL, tip]), 0.01)
    dirty = World(arm, Scene([Obstacle("thing", more)]))
    assert dirty.verify(certificate, rows) == "it is for another scene: 'thing' differs"
    assert "not shown apart" in dirty.verify(with_model_of(certificate, dirty), rows)


def test_extents_are_the_farthest_corners_in_each_direction():
    rng = np.random.default_rng(3)
    points, half = rng.normal(size=(50, 3)), rng.uniform(0.0, 0.5, (50, 3))
    corners = (points[:, None] + half[:, None] * (2.0 * np.indices((2, 2, 2)).reshape(3, -1).T - 1.0)).reshape(-1, 3)
    np.testing.assert_allclose(_extents(points, half), (corners @ DIRECTIONS.T).max(axis=0), atol=1e-9)
    np.testing.assert_allclose(_extents(points), (points @ DIRECTIONS.T).max(axis=0), atol=1e-9)


def test_cuts_leave_nothing_out_whatever_they_are(arm):
    elements = next(elements_of(body.geometry) for body in World(arm).bodies if body.name == "panda_link5")
    drawn = np.random.default_rng(3)
    cuts = []
    leaves = [0]
    for k in range(30):
        leaf = leaves.pop(int(drawn.integers(len(leaves))))
        cuts.append((leaf, int(drawn.integers(3)), float(drawn.uniform(-0.3, 0.3))))
        leaves += [2 * k + 1, 2 * k + 2]
    parts = Parts(elements, cuts)
    own = [set(parts.order[slice(*parts.spans[leaf])].tolist()) for leaf in leaves]
    assert sum(map(len, own)) == len(elements.points)
    assert set.union(*own) == set(range(len(elements.points)))
    ways = drawn.normal(size=(50, 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    heights = np.max([parts.support(leaf, ways) for leaf in leaves if not parts.empty[leaf]], axis=0)
    assert np.allclose(heights, (elements.points.reshape(-1, 3) @ ways.T).max(axis=0), atol=1e-12)
    for node in np.flatnonzero(~parts.empty):
        corners = elements.points[parts.order[slice(*parts.spans[node])]].reshape(-1, 3)
        assert np.linalg.norm(corners - parts.centres[node], axis=1).max() <= parts.radii[node] + 1e-12
        assert (corners >= parts.low[node] - 1e-12).all()
        assert (corners <= parts.high[node] + 1e-12).all()


@pytest.mark.parametrize("cuts", [[(1, 0, 0.0)], [(0, 0, 0.0), (0, 1, 0.0)], [(0, 0, 0.0), (4, 1, 0.0)]])
def test_cuts_of_what_is_no_leaf_are_refused_in_one_line(cloudy, cuts):
    world, rows, certificate = cloudy
    bodies = [replace(body, cuts=tuple(cuts)) if body.name == "thing" else body for body in certificate.bodies]
    assert "no leaf" in world.verify(replace(certificate, bodies=tuple(bodies)), rows)


def test_what_a_mesh_contains_is_seen_whatever_entries_say():
    """A shell of 12 triangles around a ball is touched by nothing."""
    box = rrtik.Box(0.2, 0.2, 0.2).surface()
    corners = box.vertices[box.faces]
    assert inside_mesh(corners, np.zeros(3))
    assert inside_mesh(corners[:-1], np.zeros(3))
    assert not inside_mesh(corners, np.array([0.11, 0.0, 0.0]))
    inner = 0.1 * corners
    apart = np.concatenate([inner, inner + np.array([0.03, 0.0, 0.0]), corners + 5.0])
    within = np.abs(apart).max(axis=(1, 2)) < 0.1
    found = list(enclosed(apart, apart, within))
    assert len(found) == 2
    assert all(inside_mesh(corners, point) for point in found)


def test_pairs_that_are_not_compared_stand_in_the_file_with_a_reason(cloudy):
    world, rows, certificate = cloudy
    named = named_bodies(world.bodies)
    compared = set(compared_pairs(named, world.pairs))
    names = {frozenset(certificate.bodies[k].name for k in pair[:2]): pair[2] for pair in certificate.unchecked}
    assert names[frozenset(("panda_link1", "panda_link2"))] == "adjacent"
    assert not compared & {pair[:2] for pair in certificate.unchecked}
    fewer = replace(certificate, unchecked=(*certificate.unchecked, (*min(compared), "adjacent")))
    assert "other pairs" in world.verify(fewer, rows)


def test_a_centre_deep_in_a_box_is_not_shallow():
    """The ball of a small part says nothing of how deep it is inside a large box."""
    from rrtik_ompl.kernels.reference.separation import Bounds, Ends, Poses, ball_gaps

    def ball_at(x):
        return Poses(np.eye(3)[None], np.array([[x, 0.0, 0.0]]))

    small = Bounds(np.zeros((1, 3)), np.array([0.01]), np.eye(3)[None], np.zeros((1, 3)), np.full((1, 3), 0.01))
    large = Bounds(np.zeros((1, 3)), np.array([0.9]), np.eye(3)[None], np.zeros((1, 3)), np.full((1, 3), 0.5))
    gaps, _ = ball_gaps(small, large, Ends(ball_at(0.3), ball_at(0.3), ball_at(0.0), ball_at(0.0)), np.array([True]))
    assert gaps[0] <= -0.2


@pytest.mark.parametrize("level", [0, 12, 30])
def test_an_entry_never_stands_for_one_of_other_nodes(level):
    """Their numbers together, and those of intervals, would have more than 64 bits."""
    nodes = 1 << 18
    apart = 1 << (64 - max(level, 30))  # between keys that are the same to whole numbers of 64 bits
    first, second = divmod(apart, nodes + 1)
    shown = rows_of([(1, 0), (1 + first, second)], level, [(1 << level) - 1, 0])
    known = Known(shown, 1, 8, nodes)
    asked = Open(*shown[:4], np.full(2, level), np.full(2, (1 << level) - 1), np.arange(2))

    assert known.too_many == (level == 30)
    if not known.too_many:
        assert known.entry_of(asked).tolist() == [0, 1 if level == 0 else -1]


def rows_of(nodes, level, numbers):
    """Entries of the first pair in the first motion."""
    zeros = np.zeros(len(nodes), dtype=np.int64)
    first, second = np.array(nodes, dtype=np.int64).T
    width = 0.5**level
    return Rows(zeros, zeros, first, second, width * np.array(numbers), np.full(len(nodes), width))


def test_a_timed_motion_that_touches_has_no_certificate_before_anything_is_divided(arm, monkeypatch):
    rounds = []
    run = _Table._run
    monkeypatch.setattr(_Table, "_run", lambda table, *args: rounds.append(len(table.covers)) or run(table, *args))
    shape, place = SHAPES["prism"]
    rest = np.zeros_like(ROWS)
    route = Splines.through(np.array([0.0, 1.0, 2.0]), ROWS, rest, None).route

    free = World(arm, Scene([Obstacle("thing", shape, rrtik.pose(place))]))
    assert free.certificate(route) is not None
    rounds.clear()
    nearer = World(arm, Scene([Obstacle("thing", shape, rrtik.pose(place + INTO_THE_WAY))]))
    assert nearer.certificate(route) is None
    assert len(rounds) <= 2
