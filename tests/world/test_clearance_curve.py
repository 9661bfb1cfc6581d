"""The clearance along a path, against coal's distances."""

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.geometry.collision.distances import measured
from rrtik_ompl.model.judgement import FARTHEST
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Sphere
from rrtik_ompl.world.clearance_curve import clearance_along


def true_distance(world, q):
    """Distance to the nearest obstacle less its margin by coal, and the pair."""
    pairs = [pair for pair in world.pairs if any(world.bodies[k].kind == "obstacle" for k in pair)]
    pairs = [pair for pair in pairs if any(world.bodies[k].joint > 0 for k in pair)]
    frames = world.robot.joint_frames(q[None])[0]
    nearest = min(measured(world.bodies, pairs, frames, near_only=False), key=lambda c: c.clearance)
    return nearest.clearance, {nearest.first, nearest.second}


@pytest.mark.parametrize("name", ["titan4_sdu", "planar3_boxes"])
def test_distances_are_never_too_large_and_hardly_too_small(name):
    problem = rrtik.load_problem(name)
    world, path = problem.world, rrtik.plan(problem, "RRTConnect", seed=1, shorten=False).path
    curve = clearance_along(world.checks, path.waypoints)
    for k in range(0, len(curve.distances), 9):
        a, b = path.waypoints[curve.motions[k]], path.waypoints[curve.motions[k] + 1]
        distance, pair = true_distance(world, (1.0 - curve.shares[k]) * a + curve.shares[k] * b)
        if curve.distances[k] >= FARTHEST:
            assert distance >= 0.95 * FARTHEST
            continue
        assert curve.distances[k] <= distance + 1e-6
        assert curve.distances[k] >= 0.94 * distance - 1e-6
        if curve.distances[k] < 0.9 * distance:
            assert set(curve.pairs[k]) == pair
    assert curve.distances[curve.least] == curve.distances.min()
    assert curve.unproven == ()
    assert f"{1e3 * curve.distances.min():.3g} mm" in str(curve)


def test_motions_that_are_not_proven_are_named():
    problem = rrtik.load_problem("titan4_sdu")
    path = rrtik.plan(problem, "RRTConnect", seed=1, shorten=False).path
    through = np.vstack([path.waypoints, path.start])  # straight back, through the shelf
    curve = clearance_along(problem.world.checks, through)
    assert curve.unproven == (len(path.waypoints) - 1,)
    assert curve.distances.min() == 0.0
    assert curve.motions[curve.least] == len(path.waypoints) - 1


def test_nothing_near_is_said():
    robot = rrtik.load_robot("planar3")
    world = rrtik.World(robot, Scene((Obstacle("far", Sphere(0.1), rrtik.pose([50.0, 0.0, 0.0])),)))
    curve = clearance_along(world.checks, np.zeros((1, 3)))
    assert (curve.distances == FARTHEST).all()
    assert str(curve) == "no obstacle within 2 m"
