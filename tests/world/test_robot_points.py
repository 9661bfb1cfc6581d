"""The arm's own points are left out of a cloud, and no others."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.geometry.collision.bodies import link_bodies
from rrtik_ompl.geometry.collision.solids import is_mesh, mesh_arrays
from rrtik_ompl.model.shapes import PointCloud
from rrtik_ompl.world import robot_points
from rrtik_ompl.world.arm_cache import arm_cache
from rrtik_ompl.world.world import World


def skin(robot, q, rng, count=15):
    """Corners of the links at a configuration, in the world."""
    frames, found = robot.joint_frames(np.array(q)[None])[0], []
    for body in link_bodies(robot):
        if is_mesh(body.geometry):
            corners = mesh_arrays(body.geometry)[0]
        elif hasattr(body.geometry, "points"):
            corners = np.array(body.geometry.points()).reshape(-1, 3)
        else:
            corners = np.array(body.geometry.aabb_center)[None]
        pose = pin.SE3(frames[body.joint]) * body.placement
        some = corners[rng.integers(len(corners), size=count)]
        found.append(some @ pose.rotation.T + pose.translation)
    return np.concatenate(found)


@pytest.mark.parametrize("name", ["panda", "ur5", "titan4"])
def test_points_on_the_links_go_and_all_others_stay(name):
    robot, rng = rrtik.load_robot(name), np.random.default_rng(3)
    q = robot.clamp(np.full(robot.dof, 0.2))
    own, around = skin(robot, q, rng), rng.uniform(-1.5, 1.5, (300, 3))
    place = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3))
    seen = (np.concatenate([own, around]) - place.translation) @ place.rotation
    left = rrtik.sensing.without_robot(PointCloud(seen, 0.005), robot, q, 0.01, pose=place)
    kept = {tuple(point) for point in left.points.tolist()}
    given = PointCloud(seen, 0.005).points
    assert not any(tuple(point) in kept for point in given[: len(own)].tolist())
    points = {f"p{k}": point for k, point in enumerate(given[len(own) :].tolist())}
    alone = [rrtik.Obstacle(p, PointCloud([point], 0.005), place, margin=0.01) for p, point in points.items()]
    touching = {name for c in World(robot, rrtik.Scene(alone)).contacts(q) for name in (c.first, c.second)}
    for name in touching & set(points):  # one way only: a base that stands still keeps no margin
        assert tuple(points[name]) not in kept, name
    assert len(left.points) > 200


def test_bad_input_is_one_line():
    robot = rrtik.load_robot("planar3")
    cloud = PointCloud([[0.5, 0.0, 0.0]], 0.01)
    with pytest.raises(InputError, match="none of the 1 points is left"):
        rrtik.sensing.without_robot(cloud, robot, np.zeros(3), 0.5)
    with pytest.raises(InputError, match="margin must not be negative"):
        rrtik.sensing.without_robot(cloud, robot, np.zeros(3), -0.5)


@pytest.mark.parametrize("name", ["panda", "ur5_gripper", "so101", "titan4"])
def test_what_balls_inside_of_a_link_decide_is_what_its_surface_decides(name):
    robot = rrtik.load_robot(name)
    rng = np.random.default_rng(5)
    decided = 0
    for body, (_, inner) in zip(link_bodies(robot), arm_cache(robot).covers, strict=True):
        box = body.geometry.aabb_local
        points = rng.uniform(np.array(box.min_) - 0.05, np.array(box.max_) + 0.05, (80, 3))
        near = robot_points._near(points, body.geometry, inner, 0.01, 0.02)
        by_surface = robot_points._near(points, body.geometry, np.empty((0, 4)), 0.01, 0.02)
        np.testing.assert_array_equal(near, by_surface, err_msg=body.name)
        decided += robot_points._by_balls(points, inner, 0.03).sum()
    assert decided > 0


def test_points_near_a_box_are_those_that_coal_finds():
    box = coal.Box(0.2, 0.1, 0.3)
    points = np.random.default_rng(6).uniform(-0.2, 0.2, (300, 3))
    by_coal = [robot_points._touches(point, box, 0.01, 0.03) for point in points]
    np.testing.assert_array_equal(robot_points._near_solid(points, box, 0.01, 0.03), by_coal)
    assert 0.1 < np.mean(by_coal) < 0.9
