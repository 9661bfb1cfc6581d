"""The face of the closed forms: bases, tips, limits, planar arms, bad input; and the fast forward kinematics."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import pose_from_rpy
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.description.dh import DhRow, robot_from_dh
from rrtik_ompl.ik.analytic.analytic_solver import two_links, wrapped
from rrtik_ompl.ik.analytic.closed_form import form_of, has_closed_form, solutions
from rrtik_ompl.ik.tip_columns import tip_columns

BASE = pose_from_rpy([1.0, -2.0, 0.5], [0.4, -0.7, 2.0])


def sampled(robot, count, seed=0):
    return np.random.default_rng(seed).uniform(*robot.finite_range(), (count, robot.dof))


def closest(found, Q):
    errors = np.abs(wrapped(found.branches - Q[:, None])).max(axis=2)
    return np.where(found.real, errors, np.inf).min(axis=1)


@pytest.mark.parametrize(
    ("name", "options"),
    [("titan4", {}), ("titan4", {"tip": "gripper"}), ("puma560", {}), ("puma560_3dof", {}), ("planar3", {}),
     ("planar", {"parameters": {"lengths": [0.7, 0.4]}})],
)  # fmt: skip
def test_the_base_may_stand_anywhere_and_the_tip_be_any_frame_of_the_last_link(name, options):
    robot = load_robot(name, base_pose=BASE, **options)
    Q = sampled(robot, 300)
    found = solutions(robot, robot.fk_batch(Q))
    assert closest(found, Q).max() < 1e-7
    assert found.residuals[found.real].max() < 1e-9


def test_a_tip_that_the_last_joint_does_not_carry_is_refused():
    robot = load_robot("titan4", tip="wrist")
    with pytest.raises(InputError, match=r"'grip_point'.*'wrist'"):
        solutions(robot, robot.fk_batch(np.zeros((1, 6))))


@pytest.mark.parametrize("name", ["panda", "kinova", "planar6", "point2d"])
def test_a_robot_without_a_closed_form_is_told_what_fits(name):
    robot = load_robot(name)
    assert not has_closed_form(robot)
    with pytest.raises(InputError, match=f"'{name}'.*closed-form.*'numeric'"):
        solutions(robot, np.eye(4)[None])


def test_a_planar_arm_of_three_links_reaches_a_pose_in_two_ways():
    robot = load_robot("planar3")
    Q = sampled(robot, 20_000)
    found = solutions(robot, robot.fk_batch(Q))
    assert found.branches.shape == (20_000, 2, 3)
    assert found.real.all()
    assert found.residuals.max() < 1e-9
    errors = np.where(found.valid, np.abs(found.branches - Q[:, None]).max(axis=2), np.inf)
    assert (errors.min(axis=1) < 1e-7).all()


def test_a_planar_arm_of_two_links_reaches_a_point_in_two_ways():
    robot = load_robot("planar", parameters={"lengths": [1.0, 0.6]})
    found = solutions(robot, [[1.0, 0.5, 0.0], [1.6, 0.0, 0.0], [0.0, 1.7, 0.0], [1.0, 0.5, 0.1]])
    assert found.real.tolist() == [[True, True], [True, True], [False, False], [False, False]]
    np.testing.assert_allclose(found.residuals[2:, :, 0], 0.1, atol=1e-12)
    np.testing.assert_allclose(found.branches[1], 0.0, atol=1e-7)


def test_a_pose_that_leans_out_of_the_plane_has_no_real_branch():
    robot = load_robot("planar3")
    pose = robot.fk(np.array([0.3, 0.4, 0.5])) * pin.SE3(pin.rpy.rpyToMatrix(0.01, 0, 0), np.zeros(3))
    found = solutions(robot, pose.homogeneous[None])
    assert not found.real.any()
    assert found.residuals[..., 1].min() == pytest.approx(0.01, abs=1e-9)


def test_an_arm_with_offsets_in_its_plane_is_planar_too():
    rows = [DhRow(a=0.5, theta=0.3, d=0.2), DhRow(a=0.4, theta=-1.0, d=-0.1), DhRow(a=0.2, theta=2.0)]
    robot = robot_from_dh("bent", rows, convention="standard")
    Q = sampled(robot, 500)
    found = solutions(robot, robot.fk_batch(Q))
    assert closest(found, Q).max() < 1e-7


def test_an_arm_whose_axes_are_not_parallel_is_no_planar_arm():
    robot = robot_from_dh("two", [DhRow(a=0.5, alpha=0.1), DhRow(a=0.5)], convention="standard")
    assert not has_closed_form(robot)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda T: T.__setitem__((1, 0, 0), np.nan), r"targets: every number must be finite, but entry \[1, 0, 0\]"),
        (lambda T: T.__setitem__((2, slice(3), slice(3)), 1.1 * np.eye(3)), "entry 2 is no rotation: .* 0.21 away"),
        (
            lambda T: T.__setitem__((1, slice(3), slice(3)), [[1e200, 1e200, 0], [1e200, -1e200, 0], [0, 0, 1]]),
            "entry 1",
        ),
        (lambda T: T.__setitem__((2, slice(3), 0), -T[2, :3, 0]), "entry 2 mirrors"),
    ],
)
def test_bad_targets_are_refused_in_one_line(spoil, message):
    robot = load_robot("titan4")
    poses = robot.fk_batch(sampled(robot, 4))
    spoil(poses)
    with pytest.raises(InputError, match=message):
        solutions(robot, poses)


@pytest.mark.parametrize(("targets", "near"), [(np.eye(4), None), (np.eye(4)[None], np.zeros(5)), (np.eye(3), None)])
def test_arrays_of_another_shape_are_refused(targets, near):
    with pytest.raises(InputError):
        solutions(load_robot("titan4"), targets, near=near)


def test_no_targets_have_no_solutions():
    found = solutions(load_robot("titan4"), np.zeros((0, 4, 4)))
    assert (found.branches.shape, found.valid.shape) == ((0, 8, 6), (0, 8))


def test_many_blocks_of_targets_give_the_answers_of_one():
    robot = load_robot("titan4")
    poses = robot.fk_batch(sampled(robot, 5_000))
    together, tail = solutions(robot, poses), solutions(robot, poses[4_000:])
    np.testing.assert_array_equal(together.branches[4_000:], tail.branches)
    np.testing.assert_array_equal(together.valid[4_000:], tail.valid)


def test_answers_are_read_only():
    found = solutions(load_robot("planar3"), load_robot("planar3").fk_batch(np.zeros((1, 3))))
    with pytest.raises(ValueError, match="read-only"):
        found.branches[0, 0, 0] = 1.0


def test_a_form_names_each_of_its_branches():
    for name in ("titan4", "puma560", "puma560_3dof", "planar3"):
        form = form_of(load_robot(name))
        assert len(set(form.branches)) == len(form.branches)


@given(st.floats(0.1, 2.0), st.floats(0.1, 2.0), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
@settings(max_examples=200, deadline=None)
def test_two_links_end_at_the_point_or_point_at_it(first, second, x, y):
    outer, turn, real = two_links(first, second, np.array([x]), np.array([y]))
    end = first * np.exp(1j * outer) + second * np.exp(1j * (outer + turn))
    distance = np.hypot(x, y)
    short = max(distance - first - second, abs(first - second) - distance, 0.0)
    assert np.abs(end - (x + 1j * y)).max() == pytest.approx(short, abs=1e-6)
    assert real[0] == (short < 1e-9) or short < 1e-6


@given(st.floats(-100.0, 100.0))
def test_wrapped_angles_are_the_same_angle_in_one_turn(angle):
    turned = float(wrapped(np.array(angle)))
    assert -np.pi < turned <= np.pi + 1e-12
    assert np.exp(1j * turned) == pytest.approx(np.exp(1j * angle), abs=1e-9)


@pytest.mark.parametrize("name", ["titan4", "puma560", "puma560_5dof", "planar6", "ur5", "panda", "point2d", "kinova"])
def test_forward_kinematics_by_columns_is_that_of_the_robot(name):
    robot = load_robot(name, base_pose=BASE)
    Q = sampled(robot, 200)
    columns = tip_columns(robot).poses(np.ascontiguousarray(Q.T))
    np.testing.assert_allclose(columns.transpose(2, 1, 0), robot.fk_batch(Q)[:, :3], atol=1e-12)
