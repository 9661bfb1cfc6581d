"""Levenberg-Marquardt from many starts, in kernels and in numpy."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.description.urdf import robot_from_urdf_text
from rrtik_ompl.ik.batch import solve_ik_many
from rrtik_ompl.ik.kernel_tables import SEEDS, seeds_of
from rrtik_ompl.ik.method_interface import mid_range_configuration
from rrtik_ompl.ik.numeric import descent
from rrtik_ompl.ik.numeric.descent import Search, walk
from rrtik_ompl.ik.numeric.restarts import numeric_ik
from rrtik_ompl.ik.targets import goal_rows, pose_rows
from rrtik_ompl.kernels.ik.ik_layout import KERNELS
from rrtik_ompl.kernels.reference.descent import farness, walk_plainly
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.model.goal import GoalSet, PoseGoal, PositionGoal
from rrtik_ompl.model.shapes import Box
from rrtik_tests.inverse_kinematics import random_rows

pytestmark = pytest.mark.kernels

MIXED = """
<robot name="mixed"><link name="base"/><link name="a"/><link name="b"/><link name="c"/><link name="d"/>
  <joint name="lift" type="prismatic"><parent link="base"/><child link="a"/><origin xyz="0 0.1 0.2" rpy="0.3 0 0"/>
    <axis xyz="0.6 0 0.8"/><limit lower="-0.5" upper="0.5" velocity="1" effort="1"/></joint>
  <joint name="swing" type="continuous"><parent link="a"/><child link="b"/><origin xyz="0.3 0 0" rpy="0 0.4 1"/>
    <axis xyz="1 2 -2"/></joint>
  <joint name="nod" type="revolute"><parent link="b"/><child link="c"/><origin xyz="0 0 0.3"/><axis xyz="0 0 -1"/>
    <limit lower="-3" upper="3" velocity="1" effort="1"/><mimic joint="swing" multiplier="-0.5" offset="0.2"/></joint>
  <joint name="turn" type="revolute"><parent link="c"/><child link="d"/><origin xyz="0.2 0 0.3"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="2" velocity="1" effort="1"/></joint>
</robot>"""
ARMS = ("ur5", "panda", "puma560", "titan4")


def arm(name):
    return robot_from_urdf_text(MIXED, tip="d") if name == "mixed" else rrtik.load_robot(name)


def goals(robot, kind):
    tips = [robot.fk(q) for q in random_rows(robot, 3, seed=1)]
    if kind == "position":
        return PositionGoal(tips[0].translation)
    if kind == "pose":
        return PoseGoal(tips[0])
    return GoalSet([*map(PoseGoal, tips)], free_rotation_axis=kind, box=[0.1, 0.0, 0.05])


@pytest.mark.parametrize("kind", ["pose", "position", "x", "y", "z"])
@pytest.mark.parametrize("name", ["panda", "mixed", "planar10", "so100"])
def test_the_kernel_takes_the_same_steps_as_numpy(name, kind):
    robot = arm(name)
    aims, starts = goal_rows(goals(robot, kind)), random_rows(robot, 30, seed=2)
    aims = aims[np.arange(30) % len(aims)]
    q, reached, most = walk(robot, aims, starts, steps=6, patience=4)
    plain = walk_plainly(robot, aims, starts, 6, 4)
    assert library(KERNELS) is not None
    np.testing.assert_allclose(q, plain[0], atol=1e-7)
    assert reached.tolist() == plain[1].tolist()
    assert most == plain[2]


@pytest.mark.parametrize("kind", ["pose", "position", "x", "y", "z"])
@pytest.mark.parametrize("name", ["panda", "mixed", "so100"])
def test_starts_that_go_side_by_side_go_the_way_that_each_goes_alone(name, kind):
    """Of more starts than lanes: who ends leaves the lane to the next."""
    robot = arm(name)
    aim, starts = goal_rows(goals(robot, kind))[:1], random_rows(robot, 40, seed=3)
    together, reached, _ = walk(robot, aim, starts, patience=5)
    alone = [walk(robot, aim, start[None], patience=5) for start in starts]
    arrived = np.array([each[1][0] for each in alone])
    assert np.count_nonzero(reached != arrived) <= 1  # rounding may decide about one that hardly goes on
    both = reached & arrived
    np.testing.assert_allclose(together[both], np.concatenate([each[0] for each in alone])[both], atol=1e-8)


def test_of_seeds_side_by_side_the_nearest_that_arrives_counts():
    robot = arm("panda")
    near = mid_range_configuration(robot)
    for aim in pose_rows(robot.fk_batch(random_rows(robot, 5, seed=4))):
        seeds = seeds_of(robot)
        order = np.argsort(farness(robot, aim[None], seeds.tips)[0], kind="stable")
        ends, reached, _ = walk(robot, np.tile(aim, (SEEDS, 1)), seeds.q[order], patience=5)
        search = Search(robot, aim[None], near)
        search.advance(np.arange(1))  # from the hint, or the first seed that arrives
        numbers = 1 + np.flatnonzero(reached)
        for number in numbers[numbers >= search._num_starts[0]][:3]:
            assert search.advance(np.arange(1)).all()
            np.testing.assert_allclose(search.q[0], ends[number - 1], atol=1e-8)
            assert search._num_starts[0] == number + 1


@pytest.mark.parametrize("name", ARMS)
def test_every_reachable_pose_is_solved_inside_the_limits(name):
    robot = rrtik.load_robot(name)
    poses = robot.fk_batch(random_rows(robot, 500, seed=3))
    batch = solve_ik_many(robot, poses, method="numeric")
    assert batch.found.all()
    assert robot.within_limits(batch.q, 0.0).all()
    np.testing.assert_allclose(robot.fk_batch(batch.q), poses, atol=2e-4)
    assert (batch.residuals <= [1e-5, 1.01e-4]).all()


@pytest.mark.parametrize("name", ["mixed", "panda"])
def test_kernels_and_numpy_find_the_same_solutions(name, monkeypatch):
    robot = arm(name)
    rows = pose_rows(robot.fk_batch(random_rows(robot, 12, seed=4)))
    found, everything = [], np.arange(12)
    for kernels in (library, lambda name: None):
        monkeypatch.setattr(descent, "library", kernels)
        search = Search(robot, rows, mid_range_configuration(robot))
        found += [search.advance(everything), search.q.copy(), search.advance(everything), search.q.copy()]
    assert found[0].all()
    assert found[2].all()
    for ours, plain in zip(found[:4], found[4:], strict=True):
        np.testing.assert_allclose(ours, plain, atol=1e-6)


def test_a_search_goes_on_from_other_starts_and_comes_to_an_end():
    robot = rrtik.load_robot("planar3")
    search, found = Search(robot, goal_rows(PositionGoal([1.2, 0.6, 0.0])), np.zeros(3)), []
    while search.advance(np.arange(1))[0]:
        found.append(search.q[0].copy())
    assert 100 < len(found) <= SEEDS + 1
    assert np.ptp(found, axis=0).min() > 0.5
    np.testing.assert_allclose(robot.fk_batch(found)[:, :2, 3], np.tile([1.2, 0.6], (len(found), 1)), atol=1e-4)
    assert not search.advance(np.arange(1))[0]


@pytest.mark.parametrize("kernels", [library, lambda name: None])
def test_a_goal_out_of_reach_has_no_solution(kernels, monkeypatch):
    monkeypatch.setattr(descent, "library", kernels)
    monkeypatch.setattr(descent, "STEPS", 5)
    search = Search(rrtik.load_robot("planar3"), goal_rows(PositionGoal([9.0, 0.0, 0.0])), np.zeros(3))
    assert not search.advance(np.arange(1)).any()


def test_what_else_is_asked_changes_no_answer():
    robot = rrtik.load_robot("panda")
    rows = pose_rows(robot.fk_batch(random_rows(robot, 20, seed=5)))
    together, alone = (Search(robot, rows, mid_range_configuration(robot)) for _ in range(2))
    together.advance(np.arange(20))
    alone.advance(np.array([7, 3]))
    assert alone.q[[3, 7]].tolist() == together.q[[3, 7]].tolist()
    with ThreadPoolExecutor(2) as pool:
        searches = [Search(robot, rows, mid_range_configuration(robot)) for _ in range(8)]
        list(pool.map(lambda each: each.advance(np.arange(20)), searches))
    assert all(np.array_equal(each.q, together.q) for each in searches)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_half_a_turn_away_is_found(axis):
    robot = rrtik.load_robot("ur5")
    start = np.radians([20.0, -70.0, 80.0, -60.0, 40.0, 30.0])
    goal = robot.fk(start) * pin.SE3(pin.exp3(np.pi * np.eye(3)[axis]), np.zeros(3))
    q, reached, _ = walk(robot, goal_rows(PoseGoal(goal)), start[None], steps=200)
    assert reached.all()
    np.testing.assert_allclose(robot.fk_batch(q)[0], goal.homogeneous, atol=1e-3)


def test_an_arm_of_five_joints_reaches_poses_whose_turn_about_an_axis_is_free():
    robot = rrtik.load_robot("so100")
    for k, q in enumerate(random_rows(robot, 10, seed=6)):
        turn = pin.SE3(pin.exp3(np.array([0.0, 0.0, 1.0 + 0.1 * k])), np.zeros(3))
        goal = GoalSet([PoseGoal(robot.fk(q) * turn)], free_rotation_axis="z")
        result = rrtik.solve_ik(robot, goal)
        assert result.found
        assert goal.satisfied(robot, result.solutions).all()
        assert (result.residuals <= [1e-3, 1e-2]).all()


@pytest.mark.parametrize("kernels", [library, lambda name: None])
def test_an_arm_of_three_joints_moves_inside_a_box_to_point_where_it_is_asked_to(kernels, monkeypatch):
    monkeypatch.setattr(descent, "library", kernels)
    robot, found = rrtik.load_robot("puma560_3dof"), []
    for q in random_rows(robot, 12, seed=5):
        goal = GoalSet([PoseGoal(robot.fk(q), 1e-4, 1e-4)], free_rotation_axis="z", box=[0.05, 0.05, 0.05])
        result = rrtik.solve_ik(robot, goal, method="numeric", seconds=20.0)
        found.append(result.found)
        assert goal.satisfied(robot, result.solutions).all()
    assert all(found)


def test_residuals_of_a_region_count_what_its_freedom_does_not_cover():
    robot = rrtik.load_robot("ur5")
    q = np.radians([20.0, -70.0, 80.0, -60.0, 40.0, 30.0])
    moved = robot.fk(q) * pin.SE3(pin.exp3(np.array([0.0, 0.3, 0.0])), np.array([0.2, 0.0, 0.0]))
    region = GoalSet([PoseGoal(moved), PositionGoal([9.0, 0.0, 0.0])], "x", [0.1, 0.1, 0.1])
    errors = region.member_errors(robot, q)
    seen = moved.actInv(robot.fk(q)).translation
    np.testing.assert_allclose(errors[0, 0], [np.linalg.norm(np.maximum(np.abs(seen) - 0.05, 0.0)), 0.3], atol=1e-12)
    assert errors[1, 0, 1] == 0.0


def test_a_batch_in_a_world_takes_solutions_that_are_free():
    robot = rrtik.load_robot("panda")
    world = rrtik.World(
        robot,
        rrtik.Scene([rrtik.Obstacle("wall", Box([0.1, 2.0, 2.0]), pin.SE3(np.eye(3), np.array([-0.3, 0.0, 0.5])))]),
    )
    rows = random_rows(robot, 80, seed=7)
    poses = robot.fk_batch(rows[world.valid_batch(rows)])
    ignorant, aware = solve_ik_many(robot, poses), solve_ik_many(robot, poses, world=world)
    assert not world.valid_batch(ignorant.q).all()
    assert aware.found.all()
    assert world.valid_batch(aware.q).all()
    assert (aware.residuals <= [1e-3, 1e-2]).all()


def test_a_batch_takes_any_method_that_fits_and_refuses_the_others():
    robot = rrtik.load_robot("panda")
    poses = robot.fk_batch(random_rows(robot, 2, seed=8))
    assert solve_ik_many(robot, poses, method="damped").found.all()
    with pytest.raises(UnknownNameError, match="numeric"):
        solve_ik_many(robot, poses, method="numerical")
    with pytest.raises(InputError, match=r"closed-form.*numeric"):
        solve_ik_many(robot, poses, method="closed-form")


def test_forward_kinematics_of_few_and_of_many_agree():
    for robot in (arm("mixed"), rrtik.load_robot("panda"), rrtik.load_robot("kinova")):
        rows = random_rows(robot, 40, seed=9)
        few = np.concatenate([robot.fk_batch(rows[:1]), robot.fk_batch(rows[1:16]), robot.fk_batch(rows[16:32])])
        np.testing.assert_allclose(few, robot.fk_batch(rows)[:32], atol=1e-12)


def test_a_region_without_starts_has_no_solutions():
    goal = GoalSet((PoseGoal(pin.SE3.Identity()), PoseGoal(pin.SE3.Identity())))
    assert numeric_ik(rrtik.load_robot("puma560"), goal, np.zeros((0, 6))).shape == (0, 6)
