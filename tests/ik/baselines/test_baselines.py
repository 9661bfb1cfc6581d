"""The field's own methods of inverse kinematics, behind the face of all others."""

import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import pose_from_rpy
from rrtik_ompl.description.dh import DhRow, robot_from_dh
from rrtik_ompl.ik.baselines.one_joint import Swing, ccd, fabrik
from rrtik_ompl.ik.residual import twist
from rrtik_ompl.model.shapes import Sphere

OF_POSES = ("numeric", "genetic", "damped", "pinocchio", "ccd", "pso", "pso-resampled")
OF_POINTS = (*OF_POSES, "fabrik")
LIMITED = pytest.mark.parametrize("method", OF_POINTS)


def reachable(robot, seed):
    return np.random.default_rng(seed).uniform(*robot.finite_range())


@pytest.mark.parametrize("method", OF_POSES)
@pytest.mark.parametrize("name", ["ur5", "puma560"])
def test_a_pose_is_reached_inside_the_limits(name, method):
    robot = rrtik.load_robot(name)
    goal = rrtik.PoseGoal(robot.fk(reachable(robot, 2)))
    result = rrtik.solve_ik(robot, goal, method=method, seconds=60.0)
    assert (result.found, result.reason, result.method) == (True, "", method)
    assert goal.satisfied(robot, result.solutions).all()
    assert robot.within_limits(result.solutions, 0.0).all()
    assert result.iterations > 0


@LIMITED
@pytest.mark.parametrize("name", ["planar6", "puma560_5dof", "panda"])
def test_a_point_is_reached_inside_the_limits(name, method):
    robot = rrtik.load_robot(name)
    for seed in range(3):
        goal = rrtik.PositionGoal(robot.fk(reachable(robot, seed)).translation)
        result = rrtik.solve_ik(robot, goal, method=method, seconds=60.0)
        assert result.found, seed
        assert goal.satisfied(robot, result.solutions).all()
        assert robot.within_limits(result.solutions, 0.0).all()


@pytest.mark.slow
@LIMITED
def test_a_point_out_of_reach_says_by_how_much(method):
    robot = rrtik.load_robot("planar3")
    far = rrtik.PositionGoal([5.0, 0.0, 0.0])
    result = rrtik.solve_ik(robot, far, method=method, seconds=30.0)
    assert result.reason == "unreachable"
    reach = robot.fk(np.zeros(3)).translation[0]
    assert f"{5.0 - reach:.4g} m" in result.detail


@LIMITED
def test_solutions_in_collision_are_no_solutions(method):
    robot = rrtik.load_robot("puma560_3dof")
    tip = robot.fk(np.radians([20.0, -40.0, 20.0]))
    world = rrtik.World(robot, rrtik.Scene([rrtik.Obstacle("ball", Sphere(0.1), tip)]))
    result = rrtik.solve_ik(robot, rrtik.PositionGoal(tip.translation), method=method, world=world, seconds=1.0)
    assert not result.found
    assert result.reason == "collision"
    assert "ball" in result.detail


@LIMITED
def test_the_same_seed_gives_the_same_solution(method):
    robot = rrtik.load_robot("puma560_5dof")
    goal = rrtik.PositionGoal(robot.fk(reachable(robot, 5)).translation)
    first, again = (rrtik.solve_ik(robot, goal, method=method, seed=4, seconds=60.0) for _ in range(2))
    np.testing.assert_array_equal(first.solutions, again.solutions)


@pytest.mark.parametrize("method", ["pso", "pso-resampled"])
def test_a_method_that_gives_up_on_a_goal_in_reach_does_not_blame_the_limits(method):
    robot = rrtik.load_robot("titan4")
    goal = rrtik.PoseGoal(robot.fk(np.radians([20, 30, -70, 20, 30, 40])), 1e-9, 1e-9)
    result = rrtik.solve_ik(robot, goal, method=method, seconds=0.1)
    assert result.reason == "time"


def test_fabrik_says_what_it_cannot_do():
    robot = rrtik.load_robot("ur5")
    with pytest.raises(InputError, match="knows no orientation"):
        rrtik.solve_ik(robot, rrtik.PoseGoal(pose_from_rpy([0.3, 0, 0.3], [0, 0, 0])), method="fabrik")
    slider = rrtik.load_robot("point2d")
    with pytest.raises(InputError, match="sliding joints"):
        rrtik.solve_ik(slider, rrtik.PositionGoal([1.0, 1.0, 0.0]), method="fabrik")


def test_ccd_moves_sliding_joints_too():
    rows = [DhRow(d=0.2), DhRow(alpha=np.pi / 2), DhRow(kind="prismatic", limits=(0.1, 0.9))]
    robot = robot_from_dh("crane", rows, convention="standard")
    goal = rrtik.PositionGoal(robot.fk([0.4, 0.5, 0.6]).translation)
    assert rrtik.solve_ik(robot, goal, method="ccd").found


@pytest.mark.parametrize("walk", [ccd, fabrik])
def test_every_pass_in_the_plane_comes_nearer(walk):
    robot = rrtik.load_robot("planar10")
    goal = rrtik.PositionGoal(robot.fk(np.full(10, 0.15)).translation, 1e-6)
    starts = np.random.default_rng(0).uniform(-0.3, 0.3, (20, 10))
    before = goal.distance(robot, starts)
    after = goal.distance(robot, walk(robot, goal, starts, **{"sweeps" if walk is ccd else "iterations": 20})[0])
    assert (after <= before + 1e-12).all()
    assert np.median(after) < 0.2 * np.median(before)


def test_a_swing_turns_as_a_rotation_does_and_finds_its_best_angle():
    rng = np.random.default_rng(0)
    axis = rng.normal(size=(50, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    vectors, angle = rng.normal(size=(50, 4, 3)), rng.uniform(-3.0, 3.0, 50)
    swing = Swing.about(axis, vectors)
    turned = swing.turned(angle)
    for k in range(50):
        np.testing.assert_allclose(turned[k], vectors[k] @ pin.exp3(angle[k] * axis[k]).T, atol=1e-12)
    np.testing.assert_allclose(swing.best(turned, np.full(50, -np.pi), np.full(50, np.pi)), angle, atol=1e-9)
    held = swing.best(turned, np.full(50, -0.5), np.full(50, 0.7))
    grid = np.linspace(-0.5, 0.7, 400)
    cost = np.array([((swing.turned(np.full(50, g)) - turned) ** 2).sum(axis=(1, 2)) for g in grid])
    assert (((swing.turned(held) - turned) ** 2).sum(axis=(1, 2)) <= cost.min(axis=0) + 1e-9).all()


def test_the_twist_to_a_goal_is_pinocchios_logarithm_up_to_half_a_turn():
    rng = np.random.default_rng(1)
    target = pin.SE3.Random()
    vectors = rng.normal(size=(60, 3))
    vectors *= (np.r_[rng.uniform(0.0, 3.1, 50), np.pi - 1e-9, np.pi - 1e-5, [0.0] * 4, [1e-9] * 4])[
        :, None
    ] / np.linalg.norm(vectors, axis=1, keepdims=True)
    tips = np.array([pin.SE3(pin.exp3(-v) @ target.rotation, target.translation).homogeneous for v in vectors])
    found = twist(rrtik.PoseGoal(target), tips)
    rotations = np.array([pin.exp3(v) for v in found[:, 3:]])
    np.testing.assert_allclose(rotations, [pin.exp3(v) for v in vectors], atol=1e-7)
    np.testing.assert_allclose(found[:50, 3:], vectors[:50], atol=1e-9)
