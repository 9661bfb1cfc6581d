"""`solve_ik` of one pose in one call of a kernel: the answers of the long way, verified, from any thread."""

import pickle
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from threading import Barrier

import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.ik import one_pose, solve
from rrtik_ompl.ik.method_interface import mid_range_configuration
from rrtik_ompl.model.goal import pose_errors

pytestmark = pytest.mark.kernels

ARMS = ("ur5", "titan4", "panda", "z1")
COUNT = 60


def asked(robot, seed=0):
    """Poses with hints: inside the limits, beyond them, singular, straight, out of reach."""
    rng = np.random.default_rng(seed)
    low, high = robot.finite_range()
    Q = rng.uniform(low, high, (COUNT, robot.dof))
    near = np.clip(Q + rng.normal(0.0, 0.3, Q.shape), low, high)
    Q[::5] = rng.uniform(low - 1.0, high + 1.0, Q[::5].shape)
    Q[1::10, 4] = 0.0
    Q[2::10, 2] = 0.0
    poses = robot.fk_batch(Q)
    poses[3::20, :3, 3] *= 3.0
    poses[4::20, :3, 3] *= 1.0005
    return poses, near


def told(result):
    return result.found, result.reason, len(result.solutions), result.method


@pytest.mark.parametrize("name", ARMS)
def test_the_answer_is_that_of_the_long_way(name):
    robot = rrtik.load_robot(name)
    quick = 0
    for pose, near in zip(*asked(robot), strict=True):
        goal = rrtik.PoseGoal(pose)
        for options in ({}, {"near": near}, {"near": near, "all": True}):
            if name == "panda" and "all" in options:
                continue
            short = one_pose.solve_one_pose(
                robot, goal, options.get("near"), "all" in options, 1.0, 0, solve.solve_in_any_way
            )
            long = solve.solve_in_any_way(robot, goal, **options)
            if short is None:
                continue
            quick += 1
            assert told(short) == told(long)
            np.testing.assert_allclose(short.solutions, long.solutions, atol=1e-6)
    assert quick > 2 * COUNT * 0.8


@pytest.mark.parametrize("name", ARMS)
def test_residuals_are_those_of_pinocchio(name):
    robot = rrtik.load_robot(name)
    for pose, near in zip(*asked(robot), strict=True):
        result = rrtik.solve_ik(robot, pose, near=near)
        if result.found:
            errors = np.transpose(pose_errors(robot.fk_batch(result.solutions), pin.SE3(pose)))
            np.testing.assert_allclose(result.residuals, errors, atol=1e-8)
            assert robot.within_limits(result.solutions, 0.0).all()


@pytest.mark.parametrize("name", ["ur5", "titan4", "panda"])
def test_usual_poses_take_one_call_and_the_reason_of_a_failure_is_looked_for_when_it_is_read(name, monkeypatch):
    robot = rrtik.load_robot(name)
    q = mid_range_configuration(robot) + 0.4
    far = rrtik.PoseGoal(rrtik.pose([9.0, 0.0, 0.0]))
    pose = robot.fk(q)
    expected = rrtik.solve_ik(robot, far)
    assert expected.reason == "unreachable"
    calls = []
    long = solve.solve_in_any_way
    monkeypatch.setattr(solve, "solve_in_any_way", lambda *a, **b: calls.append(a) or long(*a, **b))
    for goal in (pose, pose.homogeneous, rrtik.PoseGoal(pose)):
        for near in (None, q):
            assert rrtik.solve_ik(robot, goal, near=near).found
    failed = rrtik.solve_ik(robot, far)
    assert not failed.found
    assert failed.solutions.shape == (0, robot.dof)
    assert calls == []
    assert (failed.reason, failed.detail) == (expected.reason, expected.detail)
    assert len(calls) == 1
    assert failed.reason == "unreachable"
    assert len(calls) == 1


def test_a_reason_that_is_read_late_is_that_of_the_pose_that_was_asked_for():
    robot = rrtik.load_robot("ur5")
    pose = rrtik.pose([9.0, 0.0, 0.0]).homogeneous
    near = np.zeros(6)
    result = rrtik.solve_ik(robot, pose, near=near)
    pose[:] = robot.fk(np.full(6, 0.5)).homogeneous
    near[:] = np.nan
    assert result.reason == "unreachable"


def test_a_result_is_a_value_like_any_other():
    robot = rrtik.load_robot("ur5")
    result = rrtik.solve_ik(robot, robot.fk(np.full(6, 0.5)), all=True)
    assert type(result) is rrtik.ik.IkResult
    copy = pickle.loads(pickle.dumps(result))
    np.testing.assert_array_equal(copy.solutions, result.solutions)
    assert repr(copy) == repr(result)
    assert len(replace(result, method="numeric").nearest().solutions) == 1
    for array in (result.solutions, result.residuals):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0
    with pytest.raises(AttributeError):
        result.solution  # noqa: B018
    failed = rrtik.solve_ik(robot, rrtik.pose([9.0, 0.0, 0.0]))
    assert pickle.loads(pickle.dumps(failed)).reason == "unreachable"


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_six_threads_get_the_answers_of_one_and_leave_memory_intact(name):
    robot = rrtik.load_robot(name)
    poses, hints = asked(robot)
    together = Barrier(6)

    def answers(wait):
        if wait:
            together.wait()
        return [rrtik.solve_ik(robot, pose, near=near).solutions for pose, near in zip(poses, hints, strict=True)]

    alone = answers(False)
    with ThreadPoolExecutor(6) as pool:
        for found in pool.map(answers, [True] * 6):
            for one, other in zip(found, alone, strict=True):
                np.testing.assert_array_equal(one, other)
    arm = one_pose._arm_of(robot)
    calls = [*arm.spare, *arm.spare_near]
    assert calls
    assert all(call.intact() for call in calls)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda T: T.__setitem__((0, 3), np.nan), "finite"),
        (lambda T: T.__setitem__((slice(3), slice(3)), 1.1 * np.eye(3)), "goal pose"),
        (lambda T: T.__setitem__((slice(3), 0), -T[:3, 0]), "goal pose"),
        (lambda T: T.__setitem__(3, [0.0, 0.0, 0.1, 1.0]), "goal pose"),
    ],
)
def test_a_matrix_that_is_no_pose_is_refused_as_before(spoil, message):
    robot = rrtik.load_robot("ur5")
    pose = robot.fk(np.full(6, 0.5)).homogeneous.copy()
    spoil(pose)
    with pytest.raises(InputError, match=message):
        rrtik.solve_ik(robot, pose)
