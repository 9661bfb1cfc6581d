"""The batched checks never contradict a slow, obvious computation in float64, whatever the arm and the surroundings."""

import coal
import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.kernels import COLLIDING, FREE, FastWorld
from rrtik_ompl.kernels.tables import robot_tables as tables
from rrtik_tests.random_cases import (
    ARMS,
    KINDS,
    Case,
    arm,
    configurations,
    distance,
    joint_values,
    kernel_frames,
    random_pose,
    random_solid,
)
from rrtik_tests.sizes import how_many

pytestmark = pytest.mark.kernels


@pytest.mark.parametrize("name", ARMS)
def test_joint_frames_are_the_robots_own_far_within_the_margin(name):
    robot = arm(name)
    Q = configurations(robot, 1000, np.random.default_rng(0))
    error = np.abs(kernel_frames(robot, joint_values(robot, Q)) - robot.joint_frames(Q))
    assert error.max() < 0.25 * tables.SMALLEST_MARGIN
    assert error[..., :3, :3].max() < 5e-6


@pytest.mark.slow
@pytest.mark.parametrize("name", ARMS)
def test_a_free_or_colliding_answer_never_contradicts_the_slow_computation(name):
    for seed in range(how_many(8, 1)):
        case = Case(name, seed, most_balls=8)
        Q = case.sample(4200)
        answers = case.world.classify(joint_values(case.robot, Q))
        touching = case.meetings(Q, case.outer, inner=False).any(axis=1)
        proven = case.meetings(Q, case.inner, inner=True).any(axis=1)
        assert not (touching & (answers == FREE)).any()
        assert not (~proven & (answers == COLLIDING)).any()
        assert {FREE, COLLIDING} & set(answers.tolist())


def apart(solid, pose, point, radius):
    """Whether coal finds a gap between a solid and a ball."""
    ends = (coal.Transform3s(pose.rotation, pose.translation), coal.Transform3s(np.eye(3), point))
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    return coal.distance(solid, ends[0], coal.Sphere(radius), ends[1], request, result) > 0.0


def single_answer(world, values):
    return world.classify(values[None])[0]


@pytest.mark.parametrize("kind", [k for k in KINDS if k != "mesh"])
def test_the_distance_from_every_kind_of_solid_is_exact(kind):
    robot = arm("free point")
    for seed in range(8):
        rng = np.random.default_rng(seed)
        pose, solid, radius = random_pose(rng, 0.5), random_solid(kind, rng, 1.0), rng.uniform(0.01, 0.3)
        solid.computeLocalAABB()
        body = Body("ball", 3, pin.SE3.Identity(), coal.Sphere(radius), "link")
        spheres = np.array([[0.0, 0.0, 0.0, radius]])
        wall = Body("wall", 0, pose, solid, "obstacle")
        none = np.zeros((0, 4))
        world = FastWorld(robot.chain, [body, wall], [(0, 1)], outer=[spheres, none], inner=[spheres, none])
        points = pose.translation + rng.uniform(-1.0, 1.0, (20000, 3))
        answers = world.classify(points)
        gap = distance(solid, (points - pose.translation) @ pose.rotation)
        band = 4.0 * world.margin + 2e-5
        assert all(apart(solid, pose, p, radius) for p in points[(gap < radius) & (answers == FREE)])  # off a corner
        if kind != "round convex":
            assert (answers[gap > radius + band] == FREE).all()
        for k in np.flatnonzero(np.abs(gap - radius) < 0.02)[:300]:  # alone, so that no other lane widens the search
            alone = single_answer(world, points[k])
            assert alone == answers[k] or (alone == FREE and apart(solid, pose, points[k], radius))
        reach = 0.0 if isinstance(solid, coal.ConvexBase) else radius
        assert (answers[gap > reach] != COLLIDING).all()
        assert (answers[gap < reach - band] == COLLIDING).all()
        assert (answers == FREE).any()
        assert (answers == COLLIDING).any()
