"""Inverse kinematics of arrays of poses."""

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.ik.analytic.branch_choice import nearest
from rrtik_ompl.ik.batch import solve_ik_many
from rrtik_ompl.model.shapes import Box


@pytest.mark.parametrize(("name", "count"), [("titan4", 500), ("puma560", 500), ("planar3", 500), ("ur5", 5)])
def test_every_reachable_pose_has_an_answer_that_is_one(name, count):
    robot = rrtik.load_robot(name)
    poses = robot.fk_batch(np.random.default_rng(0).uniform(*robot.finite_range(), (count, robot.dof)))
    batch = solve_ik_many(robot, poses, seconds=10.0)
    assert batch.found.all()
    assert set(batch.reasons) == {""}
    assert robot.within_limits(batch.q, 0.0).all()
    np.testing.assert_allclose(robot.fk_batch(batch.q), poses, atol=2e-3)
    assert (batch.residuals <= [1e-3, 1e-2]).all()


def test_the_answers_are_the_nearest_solutions():
    robot, near = rrtik.load_robot("titan4"), np.radians([20, 30, -70, 20, 30, 40])
    poses = robot.fk_batch(np.random.default_rng(1).uniform(robot.lower, robot.upper, (300, 6)))
    np.testing.assert_allclose(solve_ik_many(robot, poses, near=near).q, nearest(robot, poses, near)[0], atol=1e-12)


def test_poses_without_a_solution_say_why():
    robot = rrtik.load_robot("titan4")
    q = np.radians([[20, 30, -70, 20, 30, 40], [20, 30, -70, 20, 30, 150], [0, 0, 0, 0, 0, 0]])
    poses = robot.fk_batch(q)
    poses[2, 0, 3] += 1.0
    batch = solve_ik_many(robot, poses)
    assert batch.reasons == ("", "limits", "unreachable")
    assert batch.found.tolist() == [True, False, False]
    assert np.isnan(batch.q[1:]).all()


def test_with_a_world_all_answers_are_free():
    robot = rrtik.load_robot("puma560")
    world = rrtik.World(robot, rrtik.Scene([rrtik.Obstacle("wall", Box([2.0, 0.1, 2.0]), rrtik.PoseGoal(
        np.array([[1, 0, 0, 0], [0, 1, 0, 0.6], [0, 0, 1, 0.6], [0, 0, 0, 1.0]])).T_world_tip)]))  # fmt: skip
    poses = robot.fk_batch(np.random.default_rng(2).uniform(robot.lower, robot.upper, (300, 6)))
    batch = solve_ik_many(robot, poses, world=world)
    assert 0.2 < batch.found.mean() < 1.0
    assert world.valid_batch(batch.q[batch.found]).all()
    assert {reason for reason in batch.reasons if reason} == {"collision"}


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (2.0 * np.eye(4), "poses: entry 1 is no rotation: its columns are 3 away from orthonormal"),
        (np.diag([1.0, 1.0, -1.0, 1.0]), "poses: entry 1 mirrors"),
        (np.diag([1.0, 1.0, 1.0, 2.0]), "poses: the last row of entry 1 must be 0 0 0 1"),
        (np.full((4, 4), np.nan), "poses: every number must be finite"),
    ],
)
def test_something_that_is_no_pose_is_refused(changed, message):
    with pytest.raises(InputError, match=message):
        solve_ik_many(rrtik.load_robot("ur5"), np.array([np.eye(4), changed]))


def test_a_goal_that_is_no_pose_is_refused_by_how_far_it_is_off():
    with pytest.raises(InputError, match=r"0\.21.*orthonormal"):
        rrtik.PoseGoal(np.diag([1.1, 1.1, 1.1, 1.0]))
    with pytest.raises(InputError, match="mirrors"):
        rrtik.PoseGoal(np.diag([1.0, 1.0, -1.0, 1.0]))


def test_a_batch_says_by_how_much_a_pose_is_out_of_reach():
    far = np.eye(4)
    far[0, 3] = 3.0
    batch = solve_ik_many(rrtik.load_robot("ur5"), far[None])
    assert batch.reasons == ("unreachable",)
    assert batch.details[0].endswith(" m away")
    assert 1.5 < float(batch.details[0].split("configuration is ")[1].split(" m")[0]) < 2.5
