"""Without kernels numpy gives the same answers: what is proven, certified and planned, judged by coal."""

import warnings

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl import Obstacle, Scene, World, pose
from rrtik_ompl.geometry.collision.certificate import Certificate
from rrtik_ompl.kernels.proof import rows as proofs
from rrtik_ompl.kernels.proof.in_numpy import nearest_on_triangles
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.model.scene import ConstantVelocity
from rrtik_ompl.replanning.in_time import plan_in_time
from rrtik_ompl.world.certificate_check import certificate_fault
from rrtik_ompl.world.proof import FEW_AT_ONCE

SHARES = (1.0, 0.2, 0.0)  # of random motions
EDGE_SOLIDS = {
    "ball": rrtik.Sphere(0.1),
    "plate": rrtik.Box([0.4, 0.4, 1e-4]),
    "disc": rrtik.Cylinder(0.2, 0.02),
    "needle": rrtik.Capsule(2e-3, 0.6),
    "ground": rrtik.HalfSpace([0.1, 0.0, 1.0], -0.2),
    "cloud": rrtik.PointCloud(np.random.default_rng(3).normal(size=(400, 3)) * 0.15, radius=0.01),
    "cubes": rrtik.Octree(np.random.default_rng(5).integers(-9, 9, (1500, 3)) * 0.03, np.full(1500, 0.03)),
    "bed": rrtik.HeightField([[0.1, 0.2, 0.05], [0.1, 0.05, 0.2]], cell=0.2, floor=-0.1),
}


def random_motions(world, count, seed=0):
    """Random motions that begin where the world is free, shapes (m, dof)."""
    lower, upper = world.robot.finite_range()
    A, B = np.random.default_rng(seed).uniform(lower, upper, (2, count, world.robot.dof))
    free = world.valid_batch(A)
    return A[free], B[free]


def compared(world, monkeypatch, count=60, clearance=0.001):
    """What kernels and numpy prove of random motions of several lengths, shapes (m,)."""
    A, B = random_motions(world, count)
    starts = np.tile(A, (len(SHARES), 1))
    ends = np.concatenate([A + share * (B - A) for share in SHARES])
    by_kernels = world.motions_proven(starts, ends, clearance=clearance)
    monkeypatch.setattr(proofs, "library", lambda name: None)
    in_numpy = world.motions_proven(starts, ends, clearance=clearance)
    return by_kernels, in_numpy


@pytest.mark.kernels
@pytest.mark.parametrize("name", ["planar3_boxes", "titan4_prisms", "panda_shelf", "two_titan4"])
def test_numpy_proves_what_the_kernels_prove(name, monkeypatch):
    by_kernels, in_numpy = compared(rrtik.load_problem(name).world, monkeypatch)
    assert 0.2 < by_kernels.mean() < 1.0
    np.testing.assert_array_equal(in_numpy, by_kernels)


@pytest.mark.kernels
@pytest.mark.parametrize("kind", EDGE_SOLIDS)
def test_numpy_proves_motions_beside_each_kind_of_solid(kind, monkeypatch):
    robot = rrtik.load_robot("titan4")
    place = pose([0.0, 0.0, -0.4]) if kind == "ground" else pose([0.9, 0.1, 0.2], rpy=[0.3, 0.5, 0.1])
    scene = Scene([Obstacle(kind, EDGE_SOLIDS[kind], place)])
    by_kernels, in_numpy = compared(World(robot, scene), monkeypatch)
    assert by_kernels.any()
    assert not by_kernels.all()
    np.testing.assert_array_equal(in_numpy, by_kernels)


def cut(world, A, B, samples=60):
    """Which motions, shapes (m, dof), coal sees collide at one of some samples, shape (m,)."""
    shares = np.linspace(0.0, 1.0, samples)[:, None]
    judge = Certificate(world.robot, world.bodies, world.pairs)
    return np.array([not judge.free(a + shares * (b - a)).all() for a, b in zip(A, B, strict=True)])


@pytest.fixture
def problem(without_kernels):
    assert library("proof.proof_kernels") is None
    problem = rrtik.load_problem("titan4_prisms")
    world = World(problem.robot, problem.world.scene)  # of its own: worlds share their kernels
    assert world.fast is None
    return rrtik.Problem(world, problem.start, problem.goal)


def test_no_motion_that_coal_sees_collide_is_proven_or_free_and_all_proven_ones_are_free(problem):
    world = problem.world
    A, B = random_motions(world, 60, seed=4)
    proven = world.motions_proven(A, B)
    assert 0.2 < proven.mean() < 0.95
    assert not (proven & cut(world, A, B)).any()
    assert world.motion_valid_batch(A, B)[proven].all()
    assert world.with_accuracy("conservative").motion_valid_batch(A, B)[proven].all()


def test_plans_are_proven_short_and_certified(problem):
    plan = rrtik.plan(problem, seed=1, proof="required")
    assert plan.proven
    assert plan.reason == ""
    rows = plan.path.waypoints
    assert not cut(problem.world, rows[:-1], rows[1:]).any()
    certificate = problem.world.certificate(plan.path)
    assert certificate_fault(certificate, problem.world, rows) == ""


@pytest.mark.usefixtures("without_kernels")
def test_what_moves_the_tip_needs_no_kernels():
    robot = rrtik.load_robot("ur5")
    start = [0.0, -1.5, 1.5, -1.57, -1.57, 0.0]
    tip = robot.fk(start).translation
    world = World(robot, Scene([Obstacle("box", rrtik.Box([0.1] * 3), pose(tip + np.array([0.0, 0.0, 0.5])))]))
    straight = rrtik.tip.straight(world, start, tip + np.array([0.0, 0.0, 0.02]))
    assert straight.fraction > 0.99
    assert straight.proven
    rates = rrtik.following.Servo(world).step(start, [0.0, 0.0, 0.02, 0.0, 0.0, 0.0], 0.01)
    assert np.abs(rates).max() > 0.0
    near = World(robot, Scene([Obstacle("box", rrtik.Box([0.1] * 3), pose(tip + np.array([0.0, 0.0, 0.25])))]))
    slowed = rrtik.following.Servo(near, near=0.3).step(start, [0.0, 0.0, 0.5, 0.0, 0.0, 0.0], 0.01)
    freely = rrtik.following.Servo(world).step(start, [0.0, 0.0, 0.5, 0.0, 0.0, 0.0], 0.01)
    assert 0.0 < np.linalg.norm(slowed) < 0.8 * np.linalg.norm(freely)


@pytest.mark.usefixtures("without_kernels")
def test_paths_keep_constraints_and_are_shortened_along_them_without_kernels():
    problem = rrtik.load_problem("ur5_upright")
    plan = rrtik.plan(problem, seed=1, seconds=60.0, shorten=False)
    assert plan.proven
    path = rrtik.shorten(plan.path, problem)
    assert path.proof.proven
    assert path.length < 0.5 * plan.path.length
    A, B = path.waypoints[:-1], path.waypoints[1:]
    assert problem.world.constraints.motions_held(A, B).all()
    assert not cut(problem.world, A, B).any()


@pytest.mark.usefixtures("without_kernels")
@pytest.mark.parametrize(("name", "is_slow"), [("so101_bin", True), ("titan4_prisms", False)])
def test_proofs_that_take_minutes_say_so_before(name, is_slow):
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        rrtik.load_problem(name).world.prover.prepare()
    minutes = [str(each.message) for each in said if issubclass(each.category, RuntimeWarning)]
    assert ["proofs for an arm" in line for line in minutes] == [True] * is_slow


@pytest.mark.usefixtures("without_kernels")
def test_roadmaps_and_reachability_maps_say_before_that_they_take_minutes():
    world = World(rrtik.load_robot("planar3"))
    with pytest.warns(RuntimeWarning, match="300 vertices of a roadmap take minutes in numpy; Ctrl-C ends them"):
        rrtik.Roadmap(world, vertices=0).grow(300, seconds=0.01)
    with pytest.warns(RuntimeWarning, match="60000 samples of a reachability map take minutes"):
        rrtik.ik.reach_map(world.robot, world=world, samples=60_000, cell=1.0)


@pytest.mark.usefixtures("without_kernels")
def test_proofs_in_numpy_look_at_the_clock_after_a_few_motions(monkeypatch):
    asked = []
    prove = proofs.in_numpy.prove

    def counted(packed, starts, *more):
        asked.append(len(starts))
        return prove(packed, starts, *more)

    monkeypatch.setattr(proofs.in_numpy, "prove", counted)
    world = World(rrtik.load_robot("planar3"), Scene([Obstacle("ball", rrtik.Sphere(0.1), pose([9.0, 0.0, 0.0]))]))
    rows = np.random.default_rng(0).uniform(-0.1, 0.1, (200, 3))
    proof = world.prove(rows, seconds=1e-6)
    assert asked == [FEW_AT_ONCE]
    assert len(proof.unproven) == 199 - FEW_AT_ONCE


@pytest.mark.usefixtures("without_kernels")
def test_motions_in_time_need_no_kernels():
    robot = rrtik.load_robot("planar3")
    ball = Obstacle("ball", rrtik.Sphere(0.1), pose([2.9, 0.6, 0.0]), motion=ConstantVelocity([0.0, -0.3, 0.0]))
    problem = rrtik.Problem(World(robot, Scene([ball])), [0.6, 0.2, 0.0], [0.9, 0.2, 0.0])
    found = plan_in_time(problem, seed=0, horizon=10.0, rate=5.0)
    assert found.found, found.reason


def test_the_nearest_point_of_a_triangle_is_the_nearest_of_many():
    rng = np.random.default_rng(0)
    triangles = rng.normal(size=(300, 3, 3)) + rng.normal(size=(300, 1, 3))
    triangles[::5, 1] = triangles[::5, 0]  # corners that coincide
    nearest = np.linalg.norm(nearest_on_triangles(triangles), axis=1)
    means = np.einsum("kw,nwc->nkc", rng.dirichlet([0.5] * 3, size=2000), triangles)
    sampled = np.linalg.norm(means, axis=2).min(axis=1)
    assert (nearest <= sampled + 1e-12).all()
    assert (sampled - nearest).max() < 0.1
