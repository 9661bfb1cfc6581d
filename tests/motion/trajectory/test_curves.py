"""Rounded corners and their timing: judged by toppra and ruckig, and by what a drive accepts."""

import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rrtik_ompl.base.poses import pose
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Sphere
from rrtik_ompl.motion.trajectory import RateLimits, Trajectory, checks, time_parameterize
from rrtik_ompl.motion.trajectory.blending import blended, joined, stops_at_corners
from rrtik_ompl.motion.trajectory.corners import COINCIDENCE, Polyline, first_radii, vertices
from rrtik_ompl.motion.trajectory.curve import Curve
from rrtik_ompl.motion.trajectory.fastest import Bounds, fastest
from rrtik_ompl.motion.trajectory.runs import PERIOD, along_curve, along_lines
from rrtik_ompl.world.world import World

PANDA = RateLimits(
    [2.175] * 4 + [2.61] * 3, [15, 7.5, 10, 12.5, 15, 20, 20], [7500, 3750, 5000, 6250, 7500, 10000, 10000]
)
seeds = st.integers(0, 2**32 - 1)


def random_corners(seed, count=6, n=7):
    return np.cumsum(0.3 * np.random.default_rng(seed).normal(size=(count, n)), axis=0)


def curve_of(corners, blend):
    line = Polyline.of(corners)
    return Curve.of(line, np.maximum(first_radii(line, blend), 1e-3 * blend))


def without_jerk(limits):
    return RateLimits(limits.velocity, limits.acceleration)


def sign_changes(motion):
    """The most changes of sign of the acceleration of a joint a second, above 2 % of that joint's largest."""
    rates = motion(np.arange(0.0, motion.duration, 2.5e-4)).accelerations
    most = 0
    for column in rates.T:
        signs = np.sign(column[np.abs(column) > 0.02 * np.abs(column).max()])
        most = max(most, int((np.diff(signs) != 0).sum()))
    return most / motion.duration


# The curve ----------------------------------------------------------------------------------------------------------


@settings(max_examples=30)
@given(seeds, st.floats(0.02, 1.0))
def test_a_curve_is_smooth_to_its_second_derivative_and_near_the_path(seed, blend):
    curve = curve_of(random_corners(seed), blend)
    grid = np.linspace(0.0, curve.length, 20001)
    shape, step = curve.at(grid), grid[1]
    steepest = 4.0 / curve.radii[1:-1].min() ** 2  # of the second derivative
    for lower, upper in ((shape.positions, shape.slopes), (shape.slopes, shape.bends)):
        assert np.abs(np.diff(lower, axis=0) / step - 0.5 * (upper[1:] + upper[:-1])).max() <= steepest * step
    assert np.abs(np.diff(shape.bends, axis=0)).max() <= steepest * step * (1 + 1e-9)
    assert np.allclose(shape.positions[[0, -1]], curve.vertices[[0, -1]], atol=1e-12)
    apart = np.linalg.norm(shape.positions - curve.path_at(grid), axis=1)
    assert apart.max() <= curve.radii.max() / 3.0 * (1 + 1e-9)  # whatever overlaps: the mean distance in the window


@given(st.lists(st.lists(st.integers(-2, 2).map(float), min_size=2, max_size=2), min_size=1, max_size=12))
def test_the_vertices_are_what_is_left_when_one_after_the_other_is_taken_out(rows):
    found = vertices(np.array(rows))
    slow = [rows[0]]
    for row in rows[1:]:
        if row != slow[-1]:
            slow.append(row)
    k = 1
    while k < len(slow) - 1:
        a, b, c = (np.array(row) for row in slow[k - 1 : k + 2])
        share = (b - a) @ (c - a) / max((c - a) @ (c - a), 1e-300)
        if np.abs(b - a - share * (c - a)).max() < 1e-12 and 0.0 < share < 1.0:
            slow.pop(k)
            k = max(k - 1, 1)
        else:
            k += 1
    assert found.tolist() == slow


def test_a_hundred_thousand_points_are_timed_at_once():
    turn = np.linspace(0.0, 3.0, 100_000)
    world = World(load_robot("planar3"))
    path = JointPath.of(world.robot, np.stack([np.sin(turn), 0.3 * turn, np.cos(turn)], axis=1))
    motion = time_parameterize(path, RateLimits([1.0] * 3, [2.0] * 3, [20.0] * 3), blend=0.1, world=world)
    assert len(motion.times) < 3000
    straight = np.linspace([0.0, 0.0], [1.0, 2.0], 100_000)
    assert len(vertices(straight)) == 2
    assert (np.linalg.norm(np.diff(vertices(straight), axis=0), axis=1) > COINCIDENCE).all()


# The judges ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(4))
def test_a_curve_takes_as_long_as_by_toppra(seed):
    pytest.importorskip("toppra")
    from toppra.algorithm import TOPPRA
    from toppra.constraint import DiscretizationType, JointAccelerationConstraint, JointVelocityConstraint
    from toppra.interpolator import AbstractGeometricPath

    curve = curve_of(random_corners(seed), 0.2)

    class Path(AbstractGeometricPath):
        dof, path_interval = 7, np.array([0.0, curve.length])

        def __call__(self, places, order=0):
            shape = curve.at(np.ascontiguousarray(np.atleast_1d(places), dtype=float))
            return (shape.positions, shape.slopes, shape.bends)[order]

    velocity, acceleration = (np.stack([-row, row], axis=1) for row in (PANDA.velocity, PANDA.acceleration))
    rules = [
        JointVelocityConstraint(velocity),
        JointAccelerationConstraint(acceleration, discretization_scheme=DiscretizationType.Interpolation),
    ]
    grid = curve.grid()[0]
    _, speeds, _ = TOPPRA(rules, Path(), gridpoints=grid, solver_wrapper="seidel").compute_parameterization(0.0, 0.0)
    theirs = float((2.0 * np.diff(grid) / (speeds[1:] + speeds[:-1])).sum())
    free = Bounds.capped(np.full(len(grid), np.inf))
    assert fastest(grid, curve.at(grid), PANDA, free).duration == pytest.approx(theirs, rel=1e-6)
    # the grid is fine enough, and what comes after it costs no time
    assert along_curve(curve, without_jerk(PANDA)).duration <= 1.005 * theirs
    finer = np.linspace(0.0, curve.length, 20001)
    free = Bounds.capped(np.full(len(finer), np.inf))
    assert theirs <= 1.01 * fastest(finer, curve.at(finer), PANDA, free).duration


lengths, tops = st.floats(1e-3, 6.0), st.floats(0.05, 20.0)


@settings(max_examples=200)
@given(lengths, tops, tops, st.one_of(st.floats(0.05, 1e4), st.just(np.inf)))
def test_a_straight_move_takes_as_long_as_by_ruckig(length, velocity, acceleration, jerk):
    ruckig = pytest.importorskip("ruckig")
    task, found = ruckig.InputParameter(1), ruckig.Trajectory(1)
    task.target_position, task.max_velocity = [length], [velocity]
    task.max_acceleration, task.max_jerk = [acceleration], [jerk]
    ruckig.Ruckig(1).calculate(task, found)
    line = Polyline.of(np.array([[0.0], [length]]))
    run = along_lines(line, RateLimits(velocity, acceleration, jerk))
    assert run.duration == pytest.approx(found.duration, rel=1e-6, abs=1e-8)


# What a drive accepts -----------------------------------------------------------------------------------------------


@settings(max_examples=20)
@given(seeds, st.floats(0.05, 0.5), st.sampled_from([PANDA, RateLimits(PANDA.velocity, PANDA.acceleration, 100.0)]))
def test_a_curve_keeps_all_limits_and_its_acceleration_never_jumps(seed, blend, limits):
    run = along_curve(curve_of(random_corners(seed, count=4), blend), limits)
    h, v, a = run.pieces.durations, run.pieces.velocities, run.pieces.accelerations
    assert (np.abs(v) <= limits.velocity * (1 + 1e-9)).all()
    assert (np.abs(a) <= limits.acceleration * (1 + 1e-9)).all()
    assert (np.abs(np.diff(a, axis=0) / h[:-1, None]) <= limits.jerk * (1 + 1e-6)).all()
    assert np.allclose(v[1:] - v[:-1], 0.5 * h[:-1, None] * (a[1:] + a[:-1]), atol=1e-9)  # no jump in between
    assert np.abs(a[0]).max() <= 1e-6
    assert h.min() >= PERIOD


@pytest.mark.parametrize("limits", [PANDA, without_jerk(PANDA)])
@pytest.mark.parametrize("count", [27, 100, 500])
def test_many_points_of_a_straight_line_of_the_tip_do_not_make_the_motion_chatter(count, limits):
    robot = load_robot("panda")
    turn = np.linspace(0.0, 1.0, count)[:, None]
    rows = robot.posture("default") + turn * [0.2, -0.3, 0.1, 0.4, 0, 0.1, 0] + np.sin(2.0 * turn) * 0.1
    motion = time_parameterize(JointPath.of(robot, rows), limits, blend=0.1, world=World(robot))
    assert sign_changes(motion) <= 20.0
    assert np.diff(motion.times).min() >= PERIOD
    assert np.isfinite(motion.peaks().jerk).all()
    assert motion.duration < 0.5 * time_parameterize(JointPath.of(robot, rows), limits).duration


@settings(max_examples=20)
@given(seeds, st.floats(0.02, 1.0))
def test_a_blend_keeps_the_jerk_limit_and_is_no_slower_than_stopping(seed, blend):
    world = World(load_robot("planar3"))
    path = JointPath.of(world.robot, np.random.default_rng(seed).uniform(-1.5, 1.5, (5, 3)))
    limits = RateLimits([1.0, 0.5, 2.0], [2.0, 3.0, 0.7], [20.0, 30.0, 7.0])
    motion = time_parameterize(path, limits, blend=blend, world=world)
    assert (motion.peaks().jerk <= limits.jerk * (1 + 1e-9)).all()
    assert motion.duration <= time_parameterize(path, limits).duration * (1 + 1e-9)


@pytest.mark.parametrize("gap", [1e-3, 5e-5, 2e-6])
def test_a_motion_that_is_nearer_to_something_than_its_chords_is_proven(gap):
    """Chords leave it by 0.1 mm; where that is too much, finer ones are tried."""
    robot = load_robot("planar3", parameters={"radius": 0.02})
    q = np.array([1.1, 0.2, 0.3])
    tip, out = robot.fk(q).translation, np.array([np.cos(1.6), np.sin(1.6), 0.0])
    ball = Obstacle("ball", Sphere(0.1), pose((tip + (0.12 + gap) * out).tolist()))
    world = World(robot, Scene([ball]))
    path = JointPath.of(robot, q + np.array([[0.0, 0.0, 0.0], [-0.8, 0.0, 0.0], [-1.6, 0.3, -0.4]]))
    assert 0.5 * gap < world.clearance(q) < 2.0 * gap
    for blend in (0.0, 0.3):
        proof = time_parameterize(path, robot, blend=blend, world=world).prove(world)
        assert proof.proven, proof
    through = Trajectory([0.0, 1.0], q + np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.0]]), np.zeros((2, 3)))
    touching = World(robot, Scene([Obstacle("ball", Sphere(0.1), pose((tip + np.array([-0.25, 0.0, 0.0])).tolist()))]))
    assert not through.prove(touching).proven


@pytest.mark.parametrize("seed", range(4))
def test_pieces_that_are_proven_together_are_those_that_are_proven_one_by_one(seed, monkeypatch):
    """A motion past a ball and into it: the same pieces are proven, by far fewer chords where nothing is near."""
    robot = load_robot("panda")
    rows = np.clip(0.4 * random_corners(seed, 5) + robot.posture("default"), robot.lower, robot.upper)
    free = World(robot, Scene([Obstacle("ball", Sphere(0.05), [0.0, 0.0, 3.0])]))
    motion = time_parameterize(JointPath(rows), without_jerk(PANDA), blend=0.2, world=free)
    beside = robot.fk(motion(0.6 * motion.duration).positions).translation + np.array([0.0, 0.0, 0.03])
    proofs = []
    for most in (checks.MOST_TOGETHER, 1):
        monkeypatch.setattr(checks, "MOST_TOGETHER", most)
        world = World(robot, Scene([Obstacle("ball", Sphere(0.05), beside)]))
        proofs.append(motion.prove(world))
    together, alone = ([gap.motion for gap in proof.unproven] for proof in proofs)
    assert together == alone != []
    assert proofs[0].motions == len(motion.times) - 1


def test_many_corners_at_many_faults_need_no_table_of_all_pairs():
    rng = np.random.default_rng(1)
    path = JointPath(np.cumsum(rng.uniform(0.05, 0.1, (200, 2)) * rng.choice([-1.0, 1.0], (200, 2)), axis=0))
    limits, refused = RateLimits([1.0, 1.0], [4.0, 4.0]), []

    def faults(motion, off_path):
        refused.append(int(off_path.sum()))
        return np.flatnonzero(off_path)

    tracemalloc.start()
    line = Polyline.of(path.waypoints)
    motion = blended(path, line, limits, 0.1, np.inf, faults)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert motion is not None
    stopping = joined(stops_at_corners(line, limits, None), path, limits)
    assert (motion.duration, refused[-1]) == (pytest.approx(stopping.duration), 0)
    assert peak < 30e6  # [bytes]; a table of the first faults and all corners would have at least as much
    assert 8 * 200 * refused[0] > 30e6
