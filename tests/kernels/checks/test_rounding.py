"""The margin covers rounding: near contact, far from the origin, and for numbers of any size."""

import coal
import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.description.urdf import robot_from_urdf_text
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.kernels import COLLIDING, FREE, UNDECIDED, FastWorld
from rrtik_ompl.kernels.tables import robot_tables as tables
from rrtik_tests.random_cases import ARMS, KINDS, SLIDER, Case, arm, configurations, joint_values, kernel_frames
from rrtik_tests.sizes import how_many

pytestmark = pytest.mark.kernels


@pytest.mark.slow
@pytest.mark.parametrize("name", ARMS)
def test_rounding_never_decides_at_the_very_contact(name):
    at_contact = 0
    for seed in range(how_many(4, 2)):
        case = Case(name, seed, most_balls=8)
        for covers, inner, wrong in ((case.outer, False, FREE), (case.inner, True, COLLIDING)):
            A, B = (case.sample(how_many(200, 100)) for _ in range(2))
            first = case.meetings(A, covers, inner=inner).any(axis=1)
            crossing = first != case.meetings(B, covers, inner=inner).any(axis=1)
            clear, touching = (np.where(first[:, None] == flag, A, B)[crossing] for flag in (False, True))
            for _ in range(50 if crossing.any() else 0):
                middle = 0.5 * (clear + touching)
                met = case.meetings(middle, covers, inner=inner).any(axis=1)[:, None]
                clear, touching = np.where(met, clear, middle), np.where(met, middle, touching)
            for Q in (clear, touching):
                assert (case.world.classify(joint_values(case.robot, Q)) != wrong).all()
            at_contact += len(clear)
    assert at_contact > how_many(50, 25)


@pytest.mark.parametrize("away", [0.0, 100.0, 1e4])
def test_the_margin_covers_the_rounding_of_frames_far_from_the_origin(away):
    base = pin.SE3(np.eye(3), np.array([away, -away, 0.3]))
    robot = robot_from_urdf_text(SLIDER, base_pose=base)
    Q = configurations(robot, 500, np.random.default_rng(0))
    body = Body("hand", 5, pin.SE3.Identity(), coal.Sphere(0.1), "link")
    wall = Body("wall", 0, pin.SE3.Identity(), coal.Sphere(0.1), "obstacle")
    spheres = [np.array([[0.0, 0.0, 0.0, 0.1]])] * 2
    margin = FastWorld(robot.chain, [body, wall], [(0, 1)], outer=spheres, inner=spheres).margin
    error = kernel_frames(robot, joint_values(robot, Q)) - robot.joint_frames(Q)
    assert np.linalg.norm(error[..., :3, 3], axis=-1).max() < 0.25 * margin


@pytest.mark.slow
@pytest.mark.parametrize("name", ["titan4", "slider"])
def test_only_a_band_of_a_few_margins_is_left_undecided(name):
    for seed in range(how_many(6, 2)):
        case = Case(name, seed, kinds=[k for k in KINDS if k != "round convex"])  # that one has planes left out
        Q = case.sample(4000)
        answers = case.world.classify(joint_values(case.robot, Q))
        band = 3.0 * case.world.margin + 1e-4
        clear = ~case.meetings(Q, case.outer, inner=False, grow=band).any(axis=1)
        hit = case.meetings(Q, case.inner, inner=True, grow=-band).any(axis=1)
        assert (answers[clear] == FREE).all()
        assert (answers[hit] != FREE).all()
        assert (answers[hit] == COLLIDING).all()


def test_values_beyond_what_the_margin_covers_are_undecided():
    case = Case("slider", 2)
    V = joint_values(case.robot, case.sample(20))
    V[4, 0], V[7, 1] = 5.0, 1e9
    answers = case.world.classify(V)
    assert answers[4] == answers[7] == UNDECIDED
    np.testing.assert_array_equal(np.delete(answers, [4, 7]), case.world.classify(np.delete(V, [4, 7], axis=0)))
    assert case.world.classify_edges(V[3:5], V[4:6], [3, 3]).tolist() == [UNDECIDED, UNDECIDED]
    assert set(case.world.undecided_pairs(V[4:5])[0]) == set(case.pairs) - set(standing_pairs(case))


def test_obstacles_of_any_size_and_place_are_right():
    chain = arm("titan4").chain
    ball = Body("link", 6, pin.SE3.Identity(), coal.Sphere(0.1), "link")
    spheres = np.array([[0.0, 0.0, 0.0, 0.1]])
    cases = [(1e-9, 2.0, {FREE}), (1e5, 0.0, {COLLIDING}), (1e5, 1.5e5, {FREE}), (1e14, 0.0, {UNDECIDED})]
    for size, away, allowed in cases:
        for solid in (coal.Box(size, size, size), coal.Cylinder(size, size), coal.Capsule(size, size)):
            solid.computeLocalAABB()
            wall = Body("wall", 0, pin.SE3(np.eye(3), np.array([3.0 * away, 0.0, 0.0])), solid, "obstacle")
            none = np.zeros((0, 4))
            world = FastWorld(chain, [ball, wall], [(0, 1)], outer=[spheres, none], inner=[spheres, none])
            assert set(world.classify(np.zeros((1, 6))).tolist()) <= allowed, solid


def standing_pairs(case):
    return [p for p in case.pairs if all(case.bodies[k].joint == 0 for k in p)]


@pytest.mark.slow
def test_large_worlds_get_a_larger_margin_and_stay_right():
    for seed in range(how_many(3, 1)):
        case = Case("slider", seed, size=40.0)
        Q = case.sample(3000)
        answers = case.world.classify(joint_values(case.robot, Q))
        assert case.world.margin > tables.SMALLEST_MARGIN
        assert not (case.meetings(Q, case.outer, inner=False).any(axis=1) & (answers == FREE)).any()
        assert not (~case.meetings(Q, case.inner, inner=True).any(axis=1) & (answers == COLLIDING)).any()
