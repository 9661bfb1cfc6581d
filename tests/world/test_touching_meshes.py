"""Where meshes just touch, what is said of their distance is what it is: nothing."""

import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_tests.sizes import how_many

TOUCHES, WITHIN = how_many(4, 2), 5e-6  # how many, and [m] of what is said


def ring(radius=0.12, tube=0.03, parts=24):
    angles = 2.0 * np.pi * np.arange(parts) / parts
    u, v = (grid.ravel() for grid in np.meshgrid(angles, angles, indexing="ij"))
    far = radius + tube * np.cos(v)
    a = np.arange(parts * parts).reshape(parts, parts)
    b, c, d = np.roll(a, -1, 0), np.roll(a, (-1, -1), (0, 1)), np.roll(a, -1, 1)
    corners = [np.stack(three, axis=-1).reshape(-1, 3) for three in ((a, b, c), (a, c, d))]
    return rrtik.Mesh(np.stack([far * np.cos(u), far * np.sin(u), tube * np.sin(v)], axis=1), np.vstack(corners))


@pytest.mark.parametrize("name", ["kinova", "panda"])
def test_a_ring_that_just_touches_an_arm_is_at_no_distance(name):
    robot, rng, found = rrtik.load_robot(name), np.random.default_rng(0), 0
    while found < TOUCHES:
        q, turn, way = rng.uniform(*robot.finite_range()), pin.exp3(rng.normal(size=3)), rng.normal(size=3)
        tip = robot.fk(q).translation

        def world(away, turn=turn, tip=tip, way=way):
            pose = pin.SE3(turn, tip + away * way / np.linalg.norm(way))
            return rrtik.World(robot, rrtik.Scene([rrtik.Obstacle("ring", ring(), pose)]))

        if not rrtik.World(robot).valid(q) or world(0.0).valid(q) or not world(1.5).valid(q):
            continue
        low, high = 0.0, 1.5
        while high - low > 1e-7:
            middle = 0.5 * (low + high)
            low, high = (low, middle) if world(middle).valid(q) else (middle, high)
        found += 1
        for away in (high, low, high + 5e-7, low - 5e-7):
            assert abs(world(away).clearance(q)) < WITHIN
