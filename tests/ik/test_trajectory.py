"""Inverse kinematics of whole trajectories."""

import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.base.poses import pose_from_rpy
from rrtik_ompl.ik.genetic.options import GeneticOptions
from rrtik_ompl.ik.trajectory import list_ik_trajectory_methods
from rrtik_ompl.model.shapes import Sphere

METHODS_OF = {
    "titan4": ("closed-form", "numeric", "genetic"),
    "puma560": ("closed-form", "numeric", "genetic"),
    "ur5": ("closed-form", "numeric", "genetic"),
    "panda": ("numeric", "genetic"),
}
CASES = [(name, method) for name, methods in METHODS_OF.items() for method in methods]


def line(robot, seed=0, count=30):
    """Poses of a straight line in joint space, and that line."""
    rng = np.random.default_rng(seed)
    lower, upper = robot.finite_range()
    middle = 0.5 * (lower + upper) + 0.2 * rng.uniform(-1.0, 1.0, robot.dof) * (upper - lower)
    q = middle + np.linspace(-0.2, 0.2, count)[:, None] * rng.uniform(-1.0, 1.0, robot.dof)
    return robot.fk_batch(robot.clamp(q)), robot.clamp(q)


@pytest.mark.parametrize(("name", "method"), CASES)
def test_poses_are_followed_without_a_jump(name, method):
    robot = rrtik.load_robot(name)
    poses, q = line(robot)
    answer = rrtik.ik.solve_trajectory(robot, poses, method=method, near=q[0])
    assert (answer.found, answer.jumps, answer.detail, answer.method) == (True, (), "", method)
    assert robot.within_limits(answer.q, 0.0).all()
    assert (answer.residuals <= [1e-3, 1e-2]).all()
    np.testing.assert_allclose(robot.fk_batch(answer.q)[:, :3, 3], poses[:, :3, 3], atol=1e-3)


@pytest.mark.parametrize("method", ["closed-form", "numeric", "genetic"])
def test_points_are_followed_by_three_joints(method):
    robot = rrtik.load_robot("puma560_3dof")
    poses, _ = line(robot, seed=1)
    answer = rrtik.ik.solve_trajectory(robot, poses[:, :3, 3], method=method, position_tolerance=1e-4)
    assert (answer.found, answer.jumps) == (True, ())
    assert answer.residuals[:, 0].max() <= 1e-4
    assert np.abs(np.diff(answer.q, axis=0)).max() < 0.2


@pytest.mark.parametrize("name", ["puma560_3dof", "planar6", "puma560_5dof"])
def test_a_population_makes_no_jumps_at_the_end_of_the_reach_either(name):
    robot = rrtik.load_robot(name)
    lower, upper = robot.finite_range()
    for seed in range(3):
        middle = 0.5 * (lower + upper) + 0.1 * (upper - lower) * np.random.default_rng(seed).uniform(-1, 1, robot.dof)
        points = robot.fk_batch(middle + np.linspace(0.0, 0.3, 20)[:, None])[:, :3, 3]
        answer = rrtik.ik.solve_trajectory(robot, points, method="genetic", jump=0.15)
        assert (answer.found, answer.jumps) == (True, ())


def test_poses_that_may_be_turned_about_an_axis_are_followed_by_an_arm_of_five_joints():
    robot = rrtik.load_robot("so100")
    poses, q = line(robot)
    spin = np.array(
        [pin.SE3(pin.exp3(np.array([0.0, 0.0, a])), np.zeros(3)).homogeneous for a in np.arange(len(poses))]
    )
    assert not rrtik.ik.solve_trajectory(robot, poses @ spin, near=q[0]).found
    answer = rrtik.ik.solve_trajectory(robot, poses @ spin, near=q[0], free_rotation_axis="z")
    assert (answer.found, answer.jumps, answer.method) == (True, (), "numeric")
    assert (answer.residuals <= [1e-3, 1e-2]).all()
    tips = robot.fk_batch(answer.q)
    np.testing.assert_allclose(tips[:, :3, 3], poses[:, :3, 3], atol=1e-3)
    assert np.einsum("ki,ki->k", tips[:, :3, 2], poses[:, :3, 2]).min() > np.cos(1e-2)


def test_a_closed_form_of_positions_is_not_asked_for_poses():
    robot = rrtik.load_robot("puma560_3dof")
    poses, _ = line(robot, seed=1)
    answer = rrtik.ik.solve_trajectory(robot, poses)
    assert (answer.found, answer.method) == (True, "numeric")
    with pytest.raises(InputError, match="positions alone"):
        rrtik.ik.solve_trajectory(robot, poses, method="closed-form")


@pytest.mark.parametrize("method", ["closed-form", "numeric", "genetic"])
def test_a_world_is_kept_clear_of(method):
    robot = rrtik.load_robot("puma560_3dof")
    poses, _ = line(robot, seed=1)
    points = poses[:, :3, 3]
    free = rrtik.ik.solve_trajectory(robot, points, method=method, seed=1)
    elbow = robot.fk_batch(free.q[15][None], "link3")[0, :3, 3]
    world = rrtik.World(robot, rrtik.Scene([rrtik.Obstacle("ball", Sphere(0.08), pin.SE3(np.eye(3), elbow))]))
    assert not world.valid_batch(free.q).all()
    answer = rrtik.ik.solve_trajectory(robot, points, method=method, world=world, seed=1)
    assert answer.found
    assert world.valid_batch(answer.q).all()
    assert answer.blocked == ()


@pytest.mark.parametrize("method", ["closed-form", "numeric"])
def test_points_out_of_reach_are_gaps_with_a_reason_and_the_rest_is_solved(method):
    robot = rrtik.load_robot("puma560_3dof")
    points = line(robot)[0][:, :3, 3].copy()
    points[10:12] += [3.0, 0.0, 0.0]
    answer = rrtik.ik.solve_trajectory(robot, points, method=method)
    assert [k for k, reason in enumerate(answer.reasons) if reason] == [10, 11]
    assert set(answer.reasons[10:12]) == {"unreachable"}
    assert answer.detail.startswith("point 10: the closest configuration is ")
    assert answer.jumps == (12,)
    assert np.isnan(answer.q[10:12]).all()
    assert not answer.found


def test_a_population_that_meets_a_point_out_of_reach_says_so_and_keeps_what_it_has():
    robot = rrtik.load_robot("puma560_3dof")
    points = line(robot)[0][:, :3, 3].copy()
    points[20:] += [3.0, 0.0, 0.0]
    options = GeneticOptions(generations=500)
    answer = rrtik.ik.solve_trajectory(robot, points, method="genetic", options=options)
    assert answer.reasons == ("",) * 20 + ("unreachable",) + ("time",) * 9
    assert answer.iterations == 500
    assert not np.isnan(answer.q[:20]).any()


@pytest.mark.parametrize("method", ["closed-form", "numeric"])
def test_points_that_only_their_tolerance_brings_into_reach_are_followed(method):
    robot = rrtik.load_robot("planar3")
    reach = robot.fk(np.zeros(3)).translation[0]
    headings = np.linspace(0.0, 0.3, 20)
    poses = np.array([pose_from_rpy([0, 0, 0], [0, 0, a]).homogeneous for a in headings])
    poses[:, :3, 3] = (reach + 5e-4 * np.sin(20.0 * headings))[:, None] * poses[:, :3, 0]
    answer = rrtik.ik.solve_trajectory(robot, poses, method=method)
    assert (answer.found, answer.jumps) == (True, ())
    assert answer.residuals[:, 0].max() > 4e-4
    assert not rrtik.ik.solve_trajectory(robot, poses, method=method, position_tolerance=1e-4).found


def test_no_time_is_the_reason():
    robot = rrtik.load_robot("panda")
    answer = rrtik.ik.solve_trajectory(robot, line(robot)[0], seconds=0.0)
    assert set(answer.reasons) == {"time"}


@pytest.mark.parametrize("method", ["numeric", "genetic"])
def test_the_same_seed_gives_the_same_answer(method):
    robot = rrtik.load_robot("panda")
    poses, _ = line(robot, count=5)
    first, again = (rrtik.ik.solve_trajectory(robot, poses, method=method, seed=3) for _ in range(2))
    np.testing.assert_array_equal(first.q, again.q)


def test_auto_takes_the_closed_form_where_it_fits():
    for name, method in (("titan4", "closed-form"), ("panda", "numeric")):
        robot = rrtik.load_robot(name)
        assert rrtik.ik.solve_trajectory(robot, line(robot, count=3)[0]).method == method


def test_bad_input_is_refused_in_a_line():
    robot = rrtik.load_robot("panda")
    poses, _ = line(robot)
    with pytest.raises(UnknownNameError, match="closed-form, genetic, numeric"):
        rrtik.ik.solve_trajectory(robot, poses, method="guess")
    with pytest.raises(InputError, match="does not fit robot 'panda'"):
        rrtik.ik.solve_trajectory(robot, poses, method="closed-form")
    with pytest.raises(InputError, match="at least one point"):
        rrtik.ik.solve_trajectory(robot, np.zeros((0, 3)))
    with pytest.raises(InputError, match="poses"):
        rrtik.ik.solve_trajectory(robot, np.full((2, 3), np.nan))
    with pytest.raises(InputError, match="orthonormal"):
        rrtik.ik.solve_trajectory(robot, 2.0 * poses)
    for method in ("closed-form", "genetic"):
        with pytest.raises(InputError, match=r"free axis.*numeric"):
            rrtik.ik.solve_trajectory(rrtik.load_robot("titan4"), poses, method=method, free_rotation_axis="z")
    with pytest.raises(InputError, match="points leave every turn free"):
        rrtik.ik.solve_trajectory(robot, poses[:, :3, 3], free_rotation_axis="z")
    with pytest.raises(InputError, match="must be x, y or z, got 'w'"):
        rrtik.ik.solve_trajectory(robot, poses, free_rotation_axis="w")
    with pytest.raises(InputError, match="jump: must be greater than 0"):
        rrtik.ik.solve_trajectory(robot, poses, jump=0.0)
    with pytest.raises(InputError, match="another robot"):
        rrtik.ik.solve_trajectory(robot, poses, world=rrtik.World(rrtik.load_robot("ur5")))
    assert set(list_ik_trajectory_methods()) == {"closed-form", "numeric", "genetic"}


@pytest.mark.parametrize("method", ["numeric", "genetic"])
def test_joints_without_limits_go_on_from_the_posture_before_however_often_it_has_turned(method, tmp_path):
    links = "".join(
        f'<link name="l{k}"/><joint name="j{k}" type="continuous"><parent link="l{k - 1}"/><child link="l{k}"/>'
        '<origin xyz="0.5 0 0"/><axis xyz="0 0 1"/><limit velocity="1" effort="1"/></joint>'
        for k in (1, 2, 3)
    )
    (tmp_path / "arm.urdf").write_text(f'<robot name="arm"><link name="l0"/>{links}</robot>')
    robot = rrtik.load_robot(tmp_path / "arm.urdf")
    rows = [0.4, 0.6, -0.3] + np.linspace(0.0, 0.5, 8)[:, None] * [1.0, 0.3, -0.2] + 4.0 * np.pi
    found = rrtik.ik.solve_trajectory(robot, robot.fk_batch(rows), method=method, near=rows[0])
    assert found.found
    assert np.abs(found.q[0] - rows[0]).max() <= np.pi
    assert np.abs(np.diff(found.q, axis=0)).max() < 1.0
