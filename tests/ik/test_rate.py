"""Rate control by damped least squares with null space."""

import numpy as np
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.ik.singularity import manipulability, rate, singularity_report

TITAN = np.radians([10, 20, -60, 30, 10, 0])


@pytest.mark.parametrize("name", ["titan4", "puma560", "ur5", "panda"])
def test_in_a_regular_posture_the_tip_does_what_is_asked(name):
    robot, rng = load_robot(name), np.random.default_rng(0)
    low, high = robot.finite_range()
    done = 0
    for q in rng.uniform(0.9 * low + 0.1 * high, 0.1 * low + 0.9 * high, (50, robot.dof)):
        twist = 0.01 * rng.normal(size=6)
        answer = rate(robot, q, twist)
        if answer.smallest > 0.05:
            np.testing.assert_allclose(answer.twist, answer.scale * twist, atol=1e-12)
            np.testing.assert_allclose(robot.jacobian(q) @ answer.qdot, answer.twist, atol=1e-12)
            done += 1
    assert done > 20


SINGULAR = [("titan4", (10, 20, 0.001, 30, 10, 0)), ("titan4", (10, 20, -60, 30, 89.999, 0)),
            ("puma560", (10, 30, -120, 20, 0.001, 10))]  # fmt: skip


@pytest.mark.parametrize(("name", "degrees"), SINGULAR)
def test_at_a_singular_posture_the_rates_stay_bounded(name, degrees):
    robot, q = load_robot(name), np.radians(degrees)
    twist = np.linalg.svd(robot.jacobian(q))[0][:, -1]  # the direction that is lost
    exact = np.abs(np.linalg.pinv(robot.jacobian(q), rcond=1e-15) @ twist).max()
    assert exact > 1e3
    assert np.abs(rate(robot, q, 0.1 * twist).qdot).max() < 2.0


def test_a_regular_direction_is_still_followed_at_a_singular_posture():
    robot, q = load_robot("titan4"), np.radians([10, 20, 0, 30, 10, 0])
    wanted = 0.05 * robot.jacobian(q)[:, 0]
    np.testing.assert_allclose(rate(robot, q, wanted).twist, wanted, atol=1e-9)


def test_damping_sets_in_without_a_step():
    robot = load_robot("titan4")
    Q = np.radians([10, 20, 0, 30, 10, 0]) + np.linspace(-0.4, 0.4, 401)[:, None] * np.eye(6)[2]
    answers = np.array([rate(robot, q, [0.05, 0, 0.02, 0, 0, 0]).qdot for q in Q])
    assert np.abs(np.diff(answers, axis=0)).max() < 0.05 * np.abs(answers).max()


def test_the_null_space_moves_the_joints_and_not_the_tip():
    robot = load_robot("panda")
    q = robot.posture("default")
    answer = rate(robot, q, np.zeros(6), bias=0.1 * np.ones(7))
    assert np.linalg.norm(answer.qdot) > 0.01
    np.testing.assert_allclose(answer.twist, 0.0, atol=1e-12)


def test_at_a_singular_posture_a_bias_carries_the_arm_out_while_the_tip_stays():
    robot = load_robot("titan4")
    q = np.radians([20, 30, -70, 40, 90, 10])
    null = np.linalg.svd(robot.jacobian(q))[2][-1]
    answer = rate(robot, q, np.zeros(6), bias=0.1 * null)
    np.testing.assert_allclose(answer.twist, 0.0, atol=1e-9)
    assert np.linalg.norm(answer.qdot) == pytest.approx(0.1, rel=1e-6)


def test_a_straight_line_through_the_wrist_singularity_of_a_puma_is_kept_within_a_millimetre_of_its_line():
    robot = load_robot("puma560")
    q, step = np.radians([10, 30, -120, 0, -10, 10]), 0.01
    start = robot.fk(q)
    passed = []
    for _ in range(400):
        answer = rate(robot, q, [0, 0, 0, *(0.1 * start.rotation[:, 1])])
        q = q + step * answer.qdot
        passed.append(np.linalg.norm(robot.fk(q).translation - start.translation))
    assert max(passed) < 1e-3
    assert np.isfinite(q).all()


def test_rates_keep_the_velocity_limits_and_the_direction():
    robot = load_robot("titan4")
    slow, fast = rate(robot, TITAN, [0.01, 0, 0, 0, 0, 0]), rate(robot, TITAN, [10, 0, 0, 0, 0, 0])
    assert slow.scale == 1.0
    assert fast.scale < 0.1
    assert (np.abs(fast.qdot) / robot.velocity).max() == pytest.approx(1.0)
    np.testing.assert_allclose(fast.twist[1:], 0.0, atol=1e-9)


def test_a_joint_at_its_limit_is_held_and_named():
    robot = load_robot("titan4")
    q = TITAN.copy()
    q[0] = robot.upper[0]
    outward = rate(robot, q, 0.1 * robot.jacobian(q)[:, 0])
    assert outward.stopped == ("azimuth",)
    assert outward.qdot[0] == 0.0
    assert rate(robot, q, -0.1 * robot.jacobian(q)[:, 0]).stopped == ()


@pytest.mark.parametrize(("q", "twist"), [(np.zeros(5), np.zeros(6)), (np.zeros(6), np.zeros(5)),
                                          (np.zeros(6), [np.nan] * 6)])  # fmt: skip
def test_arrays_that_do_not_fit_are_refused(q, twist):
    with pytest.raises(InputError):
        rate(load_robot("titan4"), q, twist)


def test_manipulability_is_the_determinant_of_a_square_jacobian():
    robot = load_robot("titan4")
    Q = np.random.default_rng(1).uniform(robot.lower, robot.upper, (50, 6))
    np.testing.assert_allclose(manipulability(robot, Q), np.abs(np.linalg.det(robot.jacobian_batch(Q))), atol=1e-12)
    assert singularity_report(robot, Q[0]).manipulability == pytest.approx(manipulability(robot, Q[:1])[0])


def test_an_arm_without_a_closed_form_still_has_a_rank():
    robot = load_robot("xarm7")
    report = singularity_report(robot, np.zeros(7))
    assert report.rank < 6
    assert dict(report.nearness) == {}
