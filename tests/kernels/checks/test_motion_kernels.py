"""A motion is judged by its configurations, and none of them is left out."""

import coal
import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.kernels import COLLIDING, FREE, UNDECIDED, FastWorld
from rrtik_tests.random_cases import KINDS, Case, arm, joint_values

pytestmark = pytest.mark.kernels


@pytest.mark.parametrize("name", ["panda", "slider"])
def test_a_motion_is_judged_by_its_configurations(name):
    seen = set()
    for seed in range(4):
        case = Case(name, seed, kinds=KINDS[:4], most_balls=3)
        A, B = case.sample(100), case.sample(100)
        VA, VB = joint_values(case.robot, A), joint_values(case.robot, A + 0.3 * (B - A))
        counts = case.rng.integers(1, 70, 100)
        answers = case.world.classify_edges(VA, VB, counts)
        for answer, a, b, count in zip(answers, VA, VB, counts, strict=True):
            share = (np.arange(count + 1) / count)[:, None]
            assert answer == case.world.classify((1.0 - share) * a + share * b).max()
        cautious = case.world.classify_edges(VA, VB, counts, resolve=False)
        np.testing.assert_array_equal(cautious, np.minimum(answers, UNDECIDED))
        seen |= set(answers.tolist())
    assert seen == {FREE, UNDECIDED, COLLIDING}


def test_every_step_of_a_motion_and_both_its_ends_are_checked():
    robot = arm("free point")
    spheres = np.array([[0.0, 0.0, 0.0, 0.01]])
    ball = Body("ball", 3, pin.SE3.Identity(), coal.Sphere(0.01), "link")
    wall = Body("wall", 0, pin.SE3.Identity(), coal.Sphere(0.01), "obstacle")
    world = FastWorld(robot.chain, [ball, wall], [(0, 1)], outer=[spheres] * 2, inner=[spheres] * 2)
    counts, steps = np.array([(count, k) for count in range(1, 70) for k in range(count + 1)]).T
    pitch = 0.05 * np.array([[0.6, 0.0, 0.8]])
    starts, ends = -steps[:, None] * pitch, (counts - steps)[:, None] * pitch
    assert (world.classify_edges(starts, ends, counts) == COLLIDING).all()
    aside = np.array([0.0, 0.0201, 0.0])
    assert (world.classify_edges(starts + aside, ends + aside, counts) == FREE).all()
    between = 0.5 * pitch
    assert (world.classify_edges(starts + between, ends + between, counts) == FREE).all()


def test_long_motions_of_continuous_joints_lose_no_precision():
    case = Case("slider", 3)
    a = case.sample(1)
    b = a + np.array([[0.0, 40.0, 0.0]])
    V = joint_values(case.robot, np.concatenate([a, b]))
    share = (np.arange(2001) / 2000)[:, None]
    samples = (1.0 - share) * a + share * b
    samples[:, 1] = np.remainder(samples[:, 1], 4.0 * np.pi)  # the joint that follows it turns half as far
    turned = joint_values(case.robot, samples)
    expected = case.world.classify(turned)
    assert case.world.classify_edges(V[:1], V[1:], [2000]) == expected.max()
    np.testing.assert_array_equal(case.world.classify((1.0 - share) * V[0] + share * V[1]), expected)
