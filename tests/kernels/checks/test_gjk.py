"""Kernels compare convex solids, and what they prove is what coal says, close to contact above all."""

import coal
import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.geometry.collision.certificate import Certificate
from rrtik_ompl.geometry.collision.solids import hull
from rrtik_ompl.kernels import COLLIDING, FREE, UNDECIDED, FastWorld
from rrtik_ompl.kernels.tables.solid_tables import NO_SOLIDS, convex_solids
from rrtik_ompl.model.robot import Robot
from rrtik_tests.bent_meshes import KINDS

pytestmark = pytest.mark.kernels

ROWS = 300  # configurations of a case
NOTHING = np.empty((0, 4))


def measured(geometry):
    geometry.computeLocalAABB()
    return geometry


def convex(rng):
    return hull(rng.normal(size=(30, 3)) * 0.06)


def swept(geometry):
    geometry.setSweptSphereRadius(0.03)
    return geometry


CONVEX = {
    "box": lambda rng: coal.Box(*rng.uniform(0.05, 0.3, 3)),
    "ball": lambda rng: coal.Sphere(rng.uniform(0.05, 0.15)),
    "capsule": lambda rng: coal.Capsule(rng.uniform(0.02, 0.1), rng.uniform(0.05, 0.3)),
    "cylinder": lambda rng: coal.Cylinder(rng.uniform(0.02, 0.1), rng.uniform(0.05, 0.3)),
    "hull": convex,
    "swept box": lambda rng: swept(coal.Box(*rng.uniform(0.05, 0.2, 3))),
}


def near_contact(robot, moving, other, joint, rng):
    """Bodies ``moving`` (on the last joint) and ``other``, and configurations in which they are close. Three values."""
    lower, upper = robot.finite_range()
    middle = rng.uniform(lower, upper)
    rows = np.clip(middle + rng.normal(size=(ROWS, robot.dof)) * 0.1, lower, upper)
    frames = robot.joint_frames(middle[None])[0]
    place = pin.SE3(frames[joint]).inverse() * pin.SE3(frames[-1])
    away = rng.normal(size=3)
    shift = away / np.linalg.norm(away) * 0.7 * (moving.aabb_radius + other.aabb_radius)
    if isinstance(other, coal.Halfspace):
        shift = np.zeros(3)
    pose = pin.SE3(pin.exp3(rng.uniform(-2.0, 2.0, 3)), place.translation + shift)
    hand = Body("hand", len(frames) - 1, pin.SE3.Identity(), moving, "link")
    return (hand, Body("other", joint, pose, other, "link" if joint else "obstacle")), rows


def compared(robot: Robot, moving, other, joint, rng):
    """Answers of the kernels, coal's, and coal's distances are asked for where the two contradict each other."""
    bodies, rows = near_contact(robot, measured(moving), measured(other), joint, rng)
    solids = [convex_solids(body.geometry) for body in bodies]
    nothing = [NOTHING] * len(bodies)
    world = FastWorld(robot.chain, bodies, [(0, 1)], outer=nothing, inner=nothing, solids=solids)
    answers = world.classify(robot.joint_values(rows))
    free = Certificate(robot, bodies, ((0, 1),)).free(rows)
    assert not (answers[~free] == FREE).any()
    assert not (answers[free] == COLLIDING).any()
    return answers, world, rows


@pytest.mark.parametrize("joint", [0, 2])
@pytest.mark.parametrize("moving", CONVEX)
@pytest.mark.parametrize("name", ["panda", "titan4"])
def test_what_is_proven_of_convex_solids_is_what_coal_says(name, moving, joint):
    robot, rng = load_robot(name), np.random.default_rng([joint, *moving.encode()])
    half_space = {"half-space": lambda rng: coal.Halfspace(rng.normal(size=3), 0.0)} if joint == 0 else {}
    seen = []
    for other in {**CONVEX, **half_space}.values():
        for _ in range(2):
            seen.append(compared(robot, CONVEX[moving](rng), other(rng), joint, rng)[0])
    seen = np.concatenate(seen)
    assert set(seen.tolist()) >= {FREE, COLLIDING}
    assert (seen == UNDECIDED).mean() < 0.01


@pytest.mark.parametrize("joint", [0, 2])
@pytest.mark.parametrize("kind", KINDS)
def test_what_is_proven_of_meshes_is_what_coal_says(bent_meshes, kind, joint):
    robot, rng = load_robot("panda"), np.random.default_rng([7, joint])
    seen = []
    convex = [make for name, make in CONVEX.items() if name != "swept box"]  # which coal does not compare with meshes
    for other in (*convex, lambda rng: bent_meshes["angle"]):
        for _ in range(2):
            seen.append(compared(robot, bent_meshes[kind], other(rng), joint, rng)[0])
    seen = np.concatenate(seen)
    assert (seen == FREE).mean() > 0.1
    assert (seen == UNDECIDED).mean() < {"angle": 0.2, "two shells": 0.2}.get(kind, 0.7)


def test_of_unknown_kinds_nothing_is_proven():
    robot, rng = load_robot("panda"), np.random.default_rng(6)
    floor = swept(coal.Halfspace(np.array([0.0, 0.0, 1.0]), -0.3))
    for other in (coal.Cone(0.1, 0.2), coal.Ellipsoid(0.1, 0.2, 0.05), floor):
        assert (compared(robot, CONVEX["box"](rng), other, 0, rng)[0] == UNDECIDED).any()
        assert convex_solids(other) is NO_SOLIDS


def test_motions_are_judged_as_their_configurations_are():
    robot, rng = load_robot("panda"), np.random.default_rng(2)
    _, world, rows = compared(robot, CONVEX["hull"](rng), CONVEX["cylinder"](rng), 0, rng)
    V = robot.joint_values(rows)
    starts, ends, steps = V[:100], V[100:200], np.full(100, 21)
    shares = (np.arange(22) / 21.0)[:, None]
    each = [world.classify((1.0 - shares) * a + shares * b) for a, b in zip(starts, ends, strict=True)]
    expected = [COLLIDING if (e == COLLIDING).any() else int(e.max()) for e in each]
    assert len(set(expected)) > 1
    np.testing.assert_array_equal(world.classify_edges(starts, ends, steps), expected)
    assert (world.classify_edges(starts, ends, steps, resolve=False) >= np.minimum(expected, UNDECIDED)).all()


def test_pairs_that_are_proven_apart_are_not_handed_on():
    robot, rng = load_robot("panda"), np.random.default_rng(4)
    answers, world, rows = compared(robot, CONVEX["box"](rng), CONVEX["hull"](rng), 0, rng)
    V = robot.joint_values(rows)
    assert all(pairs == [] for pairs in world.undecided_pairs(V[answers == FREE]))
    assert all(pairs == [(0, 1)] for pairs in world.undecided_pairs(V[answers != FREE]))


def test_without_solids_nothing_is_proven_by_them():
    robot, rng = load_robot("panda"), np.random.default_rng(4)
    bodies, rows = near_contact(robot, measured(CONVEX["box"](rng)), measured(CONVEX["hull"](rng)), 0, rng)
    nothing, V = [NOTHING] * 2, robot.joint_values(rows)
    bare = FastWorld(robot.chain, bodies, [(0, 1)], outer=nothing, inner=nothing)
    one = [convex_solids(bodies[0].geometry), NO_SOLIDS]
    half = FastWorld(robot.chain, bodies, [(0, 1)], outer=nothing, inner=nothing, solids=one, like=[bare.arm])
    assert (bare.classify(V) == UNDECIDED).any()
    np.testing.assert_array_equal(bare.classify(V), half.classify(V))
