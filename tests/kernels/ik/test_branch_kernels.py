"""Closed forms in kernels: the same branches, in the same order, with the same flags, as in numpy."""

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.poses import pose_from_rpy
from rrtik_ompl.ik.analytic import branches as module
from rrtik_ompl.ik.analytic.analytic_solver import wrapped
from rrtik_ompl.ik.analytic.branches import kernel_branches, reference_branches
from rrtik_ompl.ik.analytic.closed_form import form_of, solutions
from rrtik_ompl.kernels.ik.branch_layout import KERNELS
from rrtik_ompl.kernels.simd.compiled import WIDTH, kernel
from rrtik_ompl.kernels.simd.lanes import set_wide_lanes, wide_lanes_at
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.kernels.simd.wide_angles import arc_sine, arc_tangent, opposite, wide_sine_and_cosine, within_half_turn
from rrtik_ompl.kernels.tables.memory import aligned
from rrtik_robots.puma560 import singular_samples as puma_samples
from rrtik_robots.titan4 import singular_samples as titan_samples
from rrtik_tests.sizes import how_many

pytestmark = pytest.mark.kernels

ARMS = ("titan4", "puma560", "ur5")
ROUNDING = 1e-12
COUNT = how_many(100_000, 20_000)
BASE = pose_from_rpy([1.0, -2.0, 0.5], [0.4, -0.7, 2.0])
ULP = np.finfo(np.float64).eps


@kernel
def angles(first, second, out):
    y, x = wide_lanes_at(first, 0), wide_lanes_at(second, 0)
    sine, cosine = wide_sine_and_cosine(10.0 * y)
    set_wide_lanes(out, 0, arc_tangent(y, x))
    set_wide_lanes(out, 1, sine)
    set_wide_lanes(out, 2, cosine)
    set_wide_lanes(out, 3, within_half_turn(10.0 * y))


@kernel
def inverse(sines, out):
    set_wide_lanes(out, 0, arc_sine(wide_lanes_at(sines, 0)))
    set_wide_lanes(out, 1, opposite(wide_lanes_at(sines, 0) - 0.5))


def called(function, *rows):
    out = aligned(np.zeros(4 * WIDTH))
    function(*(row.ctypes.data for row in rows), out.ctypes.data)
    return out.reshape(4, WIDTH)


def test_sines_cosines_and_arc_tangents_are_those_of_numpy_to_the_last_bits():
    rng = np.random.default_rng(0)
    for scale in (1.0, 1e-3, 1e-9, 1e-200, 1e3):
        y, x = aligned(scale * rng.normal(size=WIDTH)), aligned(rng.normal(size=WIDTH))
        arc, sine, cosine, inside = called(angles, y, x)
        np.testing.assert_allclose(arc, np.arctan2(y, x), rtol=2 * ULP, atol=0)
        np.testing.assert_allclose(sine, np.sin(10.0 * y), rtol=0, atol=2 * ULP)
        np.testing.assert_allclose(cosine, np.cos(10.0 * y), rtol=0, atol=2 * ULP)
        np.testing.assert_allclose(inside, wrapped(10.0 * y), rtol=0, atol=max(1.0, scale) * 20 * ULP)


def test_arc_tangents_on_the_axes_and_diagonals_are_exact():
    places = np.array([(0, 0), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1)], dtype=float)
    y, x = (aligned(np.resize(column, WIDTH)) for column in places[:8].T)
    np.testing.assert_array_equal(called(angles, y, x)[0], np.arctan2(y, x))


def test_arc_sines_and_opposite_angles_are_those_of_numpy():
    sines = aligned(np.concatenate([[0.0, 1.0, 0.5], np.random.default_rng(1).uniform(0, 1, WIDTH - 3)]))
    arcs, turned = called(inverse, sines)[:2]
    np.testing.assert_allclose(arcs, np.arcsin(sines), rtol=8 * ULP, atol=0)
    np.testing.assert_array_equal(turned, np.where(sines > 0.5, sines - 0.5 - np.pi, sines - 0.5 + np.pi))


def configurations(name, count):
    """Half of them random, the others of every singular family."""
    robot, rng, parts = rrtik.load_robot(name), np.random.default_rng(5), []
    if name == "ur5":
        Q = rng.uniform(robot.lower, robot.upper, (count, 6))
        Q[-count // 200 :, 4] = 0.0  # few, as numpy alone answers these
        return robot, Q
    samples = titan_samples if name == "titan4" else puma_samples
    for case in samples.CASES:
        share = count // 2 if case == "generic" else -(-count // 2 // (len(samples.CASES) - 1))
        parts.append(
            titan_samples.singular_configurations(case, share, rng)
            if name == "titan4"
            else puma_samples.singular_configurations(robot, case, share, rng)
        )
    return robot, np.concatenate(parts)


def apart(fast, plain):
    """Between angles of both, full turns aside, where they are real."""
    return np.where(plain[1], np.abs(wrapped(fast[0] - plain[0])), 0.0)


def conditioning(robot, fast):
    """By how much branches, shape (dof, 8, m), magnify the rounding of their poses: the nearest singularity's."""
    named = form_of(robot).nearness(np.concatenate(fast[0].transpose(1, 2, 0)))
    least = np.min([named["elbow"], named["wrist"], named["shoulder"]], axis=0)
    return 1.0 / np.clip(least, 1e-9, 1.0).reshape(fast[1].shape)


@pytest.mark.parametrize("hinted", [False, True])
@pytest.mark.parametrize("name", ARMS)
def test_kernels_give_the_branches_of_numpy(name, hinted):
    robot, Q = configurations(name, COUNT)
    poses, hints = robot.fk_batch(Q), Q if hinted else None
    fast = kernel_branches(robot, form_of(robot), poses, hints, 0.0, True)
    plain = reference_branches(robot, form_of(robot), poses, hints, 0.0, True)
    assert fast is not None
    assert (apart(fast, plain) <= ROUNDING * conditioning(robot, plain)).all()
    for ours, theirs in zip(fast[1:4], plain[1:4], strict=True):
        np.testing.assert_array_equal(ours, theirs)
    np.testing.assert_allclose(fast[4], plain[4], rtol=0, atol=1e-9)
    assert fast[4][:, plain[1]].max() < 1e-9


def test_regular_poses_are_answered_by_the_kernel_alone(monkeypatch):
    robot = rrtik.load_robot("titan4")
    poses = robot.fk_batch(np.random.default_rng(0).uniform(robot.lower, robot.upper, (500, 6)))
    monkeypatch.setattr(module, "reference_branches", lambda *rest: pytest.fail("numpy was asked"))
    assert solutions(robot, poses).valid.any(axis=1).all()


@pytest.mark.parametrize("count", [0, 1, WIDTH - 1, WIDTH, WIDTH + 1])
@pytest.mark.parametrize("name", ARMS)
def test_blocks_need_not_be_full(name, count):
    robot = rrtik.load_robot(name, base_pose=BASE)
    poses = robot.fk_batch(np.random.default_rng(1).uniform(robot.lower, robot.upper, (WIDTH + 1, 6)))
    fast = kernel_branches(robot, form_of(robot), poses[:count], None, 0.0, True)
    whole = kernel_branches(robot, form_of(robot), poses, None, 0.0, True)
    for part, all_of_it in zip(fast, whole, strict=True):
        np.testing.assert_array_equal(part, all_of_it[..., :count])
    assert len(kernel_branches(robot, form_of(robot), poses[:count], None, 0.0, False)[4]) == 0


@pytest.mark.parametrize(
    ("name", "options"), [("titan4", {"tip": "gripper"}), ("puma560", {"parameters": {"base_height": 0.2}})]
)
def test_a_base_elsewhere_another_tip_and_slack_change_nothing(name, options):
    robot = rrtik.load_robot(name, base_pose=BASE, **options)
    Q = np.random.default_rng(2).uniform(robot.lower, robot.upper, (3_000, 6))
    Q[::3, 4] = np.pi / 2 - 1e-4 if name == "titan4" else 1e-4  # nearly singular: with slack, it counts as that
    poses = robot.fk_batch(Q)
    for slack in (0.0, 1e-3):
        fast = kernel_branches(robot, form_of(robot), poses, Q, slack, True)
        plain = reference_branches(robot, form_of(robot), poses, Q, slack, True)
        assert (apart(fast, plain) <= 10 * ROUNDING * conditioning(robot, plain)).all()
        np.testing.assert_array_equal(fast[2], plain[2])
        np.testing.assert_array_equal(fast[3], plain[3])
        assert (fast[3] > 0).mean() > 0.3 or slack == 0.0


def test_a_target_beyond_all_squares_is_out_of_reach():
    robot = rrtik.load_robot("titan4")
    pose = np.eye(4)
    pose[:3, 3] = 1e200, -1e250, 3.0
    found = solutions(robot, pose[None])
    assert not found.real.any()
    assert found.residuals[..., 0].min() > 1e8


@pytest.mark.parametrize("name", ARMS)
def test_without_kernels_numpy_answers_the_same(name, monkeypatch):
    robot = rrtik.load_robot(name)
    assert library(KERNELS) is not None
    q = np.random.default_rng(3).uniform(robot.lower, robot.upper)
    goal = rrtik.PoseGoal(robot.fk(q))
    with_kernels = rrtik.solve_ik(robot, goal, near=q, all=True)
    monkeypatch.setattr(module, "library", lambda name: None)
    without = rrtik.solve_ik(robot, goal, near=q, all=True)
    np.testing.assert_allclose(with_kernels.solutions, without.solutions, rtol=0, atol=1e-10)
    np.testing.assert_allclose(with_kernels.solutions[0], q, rtol=0, atol=1e-8)
