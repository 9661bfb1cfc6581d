"""Numeric inverse kinematics."""

import numpy as np
import pytest

from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.ik.goal_configurations import goal_configurations
from rrtik_ompl.ik.numeric.restarts import numeric_ik
from rrtik_ompl.ik.targets import targets
from rrtik_ompl.model.goal import GoalSet, PoseGoal, PositionGoal
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

ARMS = ["titan4", "puma560", "panda", "ur5", "kinova", "planar6"]


def finite_limits(robot):
    return np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)


@pytest.mark.parametrize("name", ARMS)
def test_reachable_poses_are_found_and_every_answer_is_one(name):
    robot, rng = load_robot(name), np.random.default_rng(0)
    low, high = finite_limits(robot)
    for _ in range(5):
        goal = PoseGoal(robot.fk(rng.uniform(low, high)))
        found = numeric_ik(robot, goal, rng.uniform(low, high, (32, robot.dof)))
        assert len(found) > 0
        position, angle = goal.errors(robot, found)
        assert position.max() <= goal.position_tolerance
        assert angle.max() <= goal.orientation_tolerance
        assert robot.within_limits(found, 0.0).all()


def test_a_position_out_of_reach_has_no_answer():
    robot = load_robot("titan4")
    starts = np.random.default_rng(0).uniform(robot.lower, robot.upper, (32, 6))
    assert numeric_ik(robot, PositionGoal([3.0, 0.0, 0.0]), starts).shape == (0, 6)


@pytest.mark.parametrize("name", ARMS)
def test_batched_jacobians_agree_with_finite_differences(name):
    robot, rng = load_robot(name), np.random.default_rng(1)
    low, high = finite_limits(robot)
    Q, h = rng.uniform(low, high, (4, robot.dof)), 1e-6
    for q, jacobian in zip(Q, robot.jacobian_batch(Q), strict=True):
        steps = h * np.eye(robot.dof)
        after, before = robot.fk_batch(q + steps), robot.fk_batch(q - steps)
        linear = (after[:, :3, 3] - before[:, :3, 3]) / (2 * h)
        spin = after[:, :3, :3] @ np.swapaxes(before[:, :3, :3], 1, 2) / (2 * h)
        angular = 0.5 * np.stack(
            [spin[:, 2, 1] - spin[:, 1, 2], spin[:, 0, 2] - spin[:, 2, 0], spin[:, 1, 0] - spin[:, 0, 1]]
        )
        assert np.allclose(jacobian, np.vstack([linear.T, angular]), atol=1e-6)


def test_a_region_gives_different_poses_that_all_satisfy_it():
    robot = load_robot("panda")
    tip = robot.fk(robot.posture("default"))
    region = GoalSet([PoseGoal(tip)], free_rotation_axis="z", box=[0.1, 0.0, 0.0])
    drawn = targets(region, 8, np.random.default_rng(0))
    assert len({tuple(g.T_world_tip.translation) for g in drawn}) == 8
    starts = np.random.default_rng(1).uniform(robot.lower, robot.upper, (16, 7))
    for goal in drawn:
        assert region.satisfied(robot, numeric_ik(robot, goal, starts)).all()


def test_goal_configurations_are_free_different_and_nearest_first():
    robot = load_robot("puma560")
    world = World(robot)
    start = robot.posture("ready")
    goal = PoseGoal(robot.fk(start + 0.3))
    found = goal_configurations(Problem(world, start, goal), np.random.default_rng(0)).rows
    assert len(found) >= 2
    assert world.valid_batch(found).all()
    assert goal.satisfied(robot, found).all()
    distances = np.linalg.norm(found - start, axis=1)
    assert (np.diff(distances) >= 0).all()
    gaps = np.abs(found[:, None] - found[None]).max(axis=2) + np.eye(len(found))
    assert gaps.min() > 1e-3
