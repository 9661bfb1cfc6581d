"""Numbers of many bodies at once are those of each body alone."""

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.geometry.collision.bodies import by_motion, kept_apart
from rrtik_ompl.geometry.collision.body_arrays import body_arrays
from rrtik_ompl.geometry.collision.containment import Containment
from rrtik_ompl.geometry.collision.solids import is_mesh
from rrtik_ompl.kernels.tables.solid_tables import convex_solids, placed_bodies
from rrtik_ompl.model.scene import AttachedObject, Obstacle, Scene
from rrtik_ompl.model.shapes import Box, Capsule, Cylinder, HalfSpace, Prism, Sphere
from rrtik_ompl.world.world import World

SHAPES = [
    Box([0.1, 0.2, 0.3]),
    Sphere(0.1),
    Capsule(0.05, 0.3),
    Cylinder(0.1, 0.4),
    Prism([[0, 0], [0.2, 0], [0, 0.3]], 0.1),
    HalfSpace([0, 0.6, 0.8], -2.0),
]


@pytest.fixture(scope="module")
def world():
    rng = np.random.default_rng(0)
    poses = [pin.SE3(pin.exp3(rng.normal(size=3)), rng.uniform(0.6, 1.5, 3)) for _ in SHAPES]
    solids = [Obstacle(f"o{k}", s, T, margin=0.01 * k) for k, (s, T) in enumerate(zip(SHAPES, poses, strict=True))]
    rod = AttachedObject("rod", "panda_hand", Capsule(0.01, 0.2), pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.3])))
    return World(load_robot("panda"), Scene(tuple(solids), (rod,)), self_margin=0.003)


def test_pairs_are_kept_apart_as_one_by_one(world):
    wanted = [kept_apart(world.bodies[i], world.bodies[j]) for i, j in world.pairs]
    found = body_arrays(world.bodies).kept_apart(np.array(world.pairs))
    assert found.tolist() == wanted
    assert len(set(wanted)) == len(SHAPES) + 1  # nothing or the obstacle's own, and the arm's to itself


def test_boxes_and_places_are_those_of_each_body(world):
    own = body_arrays(world.bodies)
    for k, body in enumerate(world.bodies):
        np.testing.assert_array_equal(own.placements[k], body.placement.homogeneous)
        if not own.half_spaces[k]:
            box = body.geometry.aabb_local
            np.testing.assert_allclose(own.centres[k], box.center(), atol=1e-15)
            np.testing.assert_allclose(2.0 * own.halves[k], [box.width(), box.height(), box.depth()], atol=1e-15)
    assert [b.name for b, endless in zip(world.bodies, own.half_spaces, strict=True) if endless] == ["o5"]


def test_pairs_are_parted_by_whether_a_body_moves(world):
    moving, standing = by_motion(world.bodies, world.pairs)
    assert sorted(moving + standing) == sorted(world.pairs)
    assert all(any(world.bodies[k].joint for k in pair) for pair in moving)
    assert not any(world.bodies[k].joint for pair in standing for k in pair)


def test_a_body_may_be_inside_a_mesh_that_is_large_enough():
    world = World(load_robot("ur5"), Scene([Obstacle("o", Sphere(0.02), pin.SE3(np.eye(3), np.array([1.0, 0, 0])))]))
    found = Containment(world.bodies, world.pairs)
    own = body_arrays(world.bodies)
    for place, (i, j) in enumerate(world.pairs):
        for way, (outer, inner) in enumerate(((i, j), (j, i))):
            geometry = world.bodies[outer].geometry
            fits = is_mesh(geometry) and own.halves[inner].max() <= geometry.aabb_radius
            assert (found.rows_of_pairs[place, way] >= 0) == fits
            assert not fits or found.pairs[found.rows_of_pairs[place, way]] == (outer, inner)
    assert (found.rows_of_pairs >= 0).any()


def test_solids_are_placed_as_their_points_are(world):
    solids = [convex_solids(body.geometry) for body in world.bodies]
    margins = np.array([body.margin for body in world.bodies])
    placed = placed_bodies(solids, body_arrays(world.bodies).placements, margins=margins)
    for body, before, after in zip(world.bodies, solids, placed, strict=True):
        turn, origin = body.placement.rotation, body.placement.translation
        assert (len(after.around), len(after.inside)) == (len(before.around), len(before.inside))
        for old, new in zip(before.around, after.around, strict=True):
            np.testing.assert_allclose(new.axis, turn @ old.axis, atol=1e-12)
            if body.name == "o5":
                assert new.disc == pytest.approx(old.disc + new.axis @ origin + body.margin)
            else:
                np.testing.assert_allclose(new.corners, old.corners @ turn.T + origin, atol=1e-12)
                assert (new.disc, new.radius) == (old.disc, pytest.approx(old.radius + body.margin))
