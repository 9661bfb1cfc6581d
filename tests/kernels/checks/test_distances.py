"""The batched distances bound the true ones from both sides, and are as near to them as the covers allow."""

import coal
import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.kernels import COLLIDING, FREE, FastWorld
from rrtik_tests.random_cases import ARMS, KINDS, Case, arm, distance, joint_values, random_pose, random_solid

pytestmark = pytest.mark.kernels

NEARLY = 1e-4  # [m] of margins and rounding


def uncompiled(case):
    return FastWorld(case.robot.chain, case.bodies, case.pairs, outer=case.outer, inner=case.inner, compiled=False)


def slow_gaps(case, Q):
    """For each pair the distance between the outer spheres and what they are checked against, shape (m, pairs)."""
    frames = case.robot.joint_frames(Q)
    placed = {}
    for k, body in enumerate(case.bodies):
        if body.joint:
            local = case.outer[k][:, :3] @ body.placement.rotation.T + body.placement.translation
            pose = frames[:, body.joint]
            placed[k] = local @ pose[:, :3, :3].transpose(0, 2, 1) + pose[:, None, :3, 3], case.outer[k][:, 3]
    found = np.full((len(Q), len(case.pairs)), np.inf)
    for number, pair in enumerate(case.pairs):
        carried = [k for k in pair if k in placed]
        if len(carried) == 2:
            (points, radii), (others, reaches) = placed[pair[0]], placed[pair[1]]
            gaps = np.linalg.norm(points[:, :, None] - others[:, None], axis=3) - radii[:, None] - reaches
            found[:, number] = gaps.min(axis=(1, 2))
        elif carried:
            points, radii = placed[carried[0]]
            body, spheres = (source[pair[0] + pair[1] - carried[0]] for source in (case.bodies, case.outer))
            local = (points - body.placement.translation) @ body.placement.rotation
            if isinstance(body.geometry, coal.BVHModelBase):
                gaps = np.min([np.linalg.norm(local - s[:3], axis=-1) - s[3] for s in spheres], axis=0)
            else:
                gaps = distance(body.geometry, local)
            found[:, number] = (gaps - radii).min(axis=1)
    return found


@pytest.mark.parametrize("name", ARMS)
def test_the_lower_bound_is_the_distance_of_the_outer_spheres_less_the_margins(name):
    clear = 0
    for seed in range(4):
        case = Case(name, seed, kinds=[k for k in KINDS if k != "round convex"], most_balls=6, size=0.5)
        Q = case.sample(400)
        found = case.world.clearance(joint_values(case.robot, Q))
        slow = slow_gaps(case, Q)
        nearest = slow.min(axis=1)
        apart = nearest > NEARLY
        assert (found.lower <= np.maximum(nearest, 0.0)).all()
        assert (found.lower[apart] > nearest[apart] - NEARLY - 2.0 * case.world.margin).all()
        number = {pair: k for k, pair in enumerate(case.pairs)}
        at = [number[tuple(pair)] for pair in found.pairs[apart].tolist()]
        assert (slow[apart][np.arange(len(at)), at] < nearest[apart] + NEARLY + 2.0 * case.world.margin).all()
        clear += int(apart.sum())
    assert clear > 20 or name not in ("titan4", "slider")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("away", [1.0, 300.0])
def test_both_bounds_hold_against_coal_for_every_kind_of_solid(kind, away):
    robot = arm("free point")
    for seed in range(6):
        rng = np.random.default_rng(seed)
        pose, solid, radius = random_pose(rng, 0.5 * away), random_solid(kind, rng, 1.0), rng.uniform(0.01, 0.3)
        solid.computeLocalAABB()
        ball = np.array([[0.0, 0.0, 0.0, radius]])
        reach = float(np.linalg.norm(solid.aabb_center)) + solid.aabb_radius
        around = np.array([[0.0, 0.0, 0.0, reach]])  # of use to the mesh alone
        bodies = [
            Body("ball", 3, pin.SE3.Identity(), coal.Sphere(radius), "link"),
            Body("wall", 0, pose, solid, "obstacle"),
        ]
        none = np.zeros((0, 4))
        world = FastWorld(
            robot.chain, bodies, [(0, 1)], outer=[ball, around], inner=[0.9 * ball, none], strokes=2.0 * away
        )
        points = pose.translation + rng.uniform(-1.0, 1.0, (300, 3))
        found = world.clearance(points, upper=True)
        exact = np.array([coal_distance(solid, pose, point, radius) for point in points])
        apart = exact > 0.0
        assert (found.lower[apart] <= exact[apart] + 1e-9).all()
        assert (found.lower[~apart] <= 0.0).all()
        if kind not in ("convex", "round convex", "mesh"):
            assert (found.upper[apart] >= exact[apart]).all()
            assert (found.upper[apart] <= exact[apart] + 0.1 * radius + NEARLY + 4.0 * world.margin).all()
            assert (found.lower[apart] >= exact[apart] - NEARLY - 4.0 * world.margin).all()
        assert (found.upper[apart] > 0.0).all()


def coal_distance(solid, pose, point, radius):
    ends = (coal.Transform3s(pose.rotation, pose.translation), coal.Transform3s(np.eye(3), point))
    return coal.distance(solid, ends[0], coal.Sphere(radius), ends[1], coal.DistanceRequest(), coal.DistanceResult())


@pytest.mark.parametrize("name", ["titan4", "panda", "slider"])
def test_distances_agree_with_the_answers_of_the_checks(name):
    for seed in range(4):
        case = Case(name, seed, most_balls=6)
        V = joint_values(case.robot, case.sample(1000))
        answers, found = case.world.classify(V), case.world.clearance(V, upper=True)
        assert (answers[found.lower > 1e-6] == FREE).all()
        assert (answers[found.upper < -1e-6] == COLLIDING).all()
        assert (found.upper[answers == COLLIDING] < 1e-6).all()
        assert (found.lower <= found.upper).all()


@pytest.mark.parametrize("name", ["titan4", "panda", "slider"])
def test_plain_numpy_measures_the_same(name):
    for seed in range(3):
        case = Case(name, seed, most_balls=6)
        V = joint_values(case.robot, case.sample(100))
        ours, theirs = (world.clearance(V, upper=True) for world in (case.world, uncompiled(case)))
        np.testing.assert_allclose(ours.lower, theirs.lower, atol=1e-5)
        np.testing.assert_allclose(ours.upper, theirs.upper, atol=1e-5)
        assert (ours.pairs == theirs.pairs).all(axis=1).mean() > 0.98


@pytest.mark.parametrize("count", [0, 1, 15, 16, 17, 100])
def test_every_row_is_measured_as_if_it_were_alone(count):
    case = Case("titan4", 2)
    V = joint_values(case.robot, case.sample(count))
    found = case.world.clearance(V, upper=True)
    assert found.lower.shape == found.upper.shape == (count,)
    assert found.pairs.shape == (count, 2)
    for k, v in enumerate(V):
        alone = case.world.clearance(v[None], upper=True)
        np.testing.assert_allclose(alone.lower[0], found.lower[k], atol=1e-6)
        np.testing.assert_allclose(alone.upper[0], found.upper[k], atol=1e-6)


@pytest.mark.parametrize("compiled", [True, False])
def test_where_nothing_can_collide_the_distance_is_infinite(compiled):
    world = FastWorld(arm("titan4").chain, [], [], outer=[], inner=[], compiled=compiled)
    found = world.clearance(np.ones((20, 6)), upper=True)
    assert (found.lower == np.inf).all()
    assert (found.upper == np.inf).all()
    assert (found.pairs == -1).all()


def test_values_beyond_what_the_margin_covers_prove_nothing():
    case = Case("slider", 2)
    V = joint_values(case.robot, case.sample(20))
    V[4, 0], V[7, 1] = 5.0, 1e9
    found = case.world.clearance(V, upper=True)
    assert (found.lower[[4, 7]] == -np.inf).all()
    assert (found.upper[[4, 7]] == np.inf).all()
    assert (found.pairs[[4, 7]] == -1).all()
    assert np.isfinite(np.delete(found.lower, [4, 7])).all()


@pytest.mark.parametrize("V", [np.full((2, 6), np.nan), np.zeros((3, 5)), np.zeros(6), [["a"] * 6]])
def test_bad_joint_values_are_refused(V):
    with pytest.raises(InputError):
        Case("titan4", 2).world.clearance(V)
