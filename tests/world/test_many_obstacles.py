"""Among thousands of obstacles, whose neighbours are looked at together first, answers are those of each for itself."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Box, Capsule, Cylinder, HalfSpace, Prism, Sphere
from rrtik_ompl.world.moving_world import MovingWorld
from rrtik_ompl.world.world import World
from rrtik_tests.by_coal import free_by_coal

pytestmark = pytest.mark.kernels

COUNT = 300


def crowd(rng, count):
    """Small obstacles of every kind about a robot, beside a floor that is everywhere and one that is far away."""
    kinds = [
        lambda size: Box(rng.uniform(0.5, 1.0, 3) * size),
        lambda size: Sphere(0.5 * size),
        lambda size: Cylinder(0.3 * size, size),
        lambda size: Capsule(0.3 * size, size),
        lambda size: Prism(size * np.array([(0, 0), (1, 0), (1, 0.4), (0.4, 0.4), (0.4, 1), (0, 1)]), size),
    ]
    found = [
        Obstacle("floor", HalfSpace((0.0, 0.0, 1.0), -0.4)),
        Obstacle("far", Sphere(1.0), pin.SE3(np.eye(3), np.array([100.0, 0.0, 0.0]))),
    ]
    for k in range(count):
        way = rng.normal(size=3)
        place = way / np.linalg.norm(way) * rng.uniform(0.5, 1.3) + [0.0, 0.0, 0.3]
        pose = pin.SE3(pin.exp3(rng.normal(size=3)), place)
        found.append(Obstacle(f"{k}", kinds[k % len(kinds)](rng.uniform(0.03, 0.08)), pose))
    return Scene(found)


@pytest.fixture(scope="module")
def world():
    return World(load_robot("ur5"), crowd(np.random.default_rng(3), COUNT))


def test_configurations_are_free_exactly_if_coal_says_so(world):
    Q = np.random.default_rng(4).uniform(*world.robot.finite_range(), (150, 6))
    ours = world.valid_batch(Q)
    assert 0.02 < ours.mean() < 0.98
    np.testing.assert_array_equal(ours, free_by_coal(world, Q))


def proven_by_parts(world, starts, ends):
    """The same question among each few of the obstacles, too few to be looked at together."""
    obstacles = world.scene.obstacles
    parts = [World(world.robot, Scene(obstacles[k : k + 20])) for k in range(0, len(obstacles), 20)]
    proven = np.all([part.motions_proven(starts, ends) for part in parts], axis=0)
    assert 0.1 < proven.mean() < 0.95
    return proven


def short_motions(world, rng):
    Q = rng.uniform(*world.robot.finite_range(), (3_000, 6))
    starts = Q[world.valid_batch(Q)][:80]
    assert len(starts) > 20
    return starts, starts + rng.uniform(-0.06, 0.06, starts.shape)


def test_motions_are_proven_exactly_if_they_are_among_each_part_of_the_obstacles(world):
    motions = short_motions(world, np.random.default_rng(5))
    np.testing.assert_array_equal(world.motions_proven(*motions), proven_by_parts(world, *motions))


def test_each_obstacle_keeps_its_own_margin(world):
    wide = Scene([replace(each, margin=0.02 * (k % 3)) for k, each in enumerate(world.scene.obstacles[2:])])
    mixed = World(world.robot, wide)
    motions = short_motions(mixed, np.random.default_rng(6))
    np.testing.assert_array_equal(mixed.motions_proven(*motions), proven_by_parts(mixed, *motions))


def test_obstacles_that_are_moved_are_proven_where_they_are(world):
    others = crowd(np.random.default_rng(7), COUNT).obstacles
    moved = Scene([replace(each, pose=other.pose) for each, other in zip(world.scene.obstacles, others, strict=True)])
    moving = MovingWorld(world)
    moving.move(moved)
    motions = short_motions(World(world.robot, moved), np.random.default_rng(8))
    np.testing.assert_array_equal(moving.motions_proven(*motions), World(world.robot, moved).motions_proven(*motions))
