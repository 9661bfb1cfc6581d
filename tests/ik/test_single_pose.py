"""One pose after the other: memory of kernels that outlives a call, and forward kinematics of one configuration."""

from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.ik.analytic import branches
from rrtik_ompl.ik.analytic.closed_form import branches_of, form_of
from rrtik_ompl.ik.kernel_tables import seeded_limb_of, spare_calls
from rrtik_ompl.ik.method_interface import mid_range_configuration
from rrtik_ompl.ik.numeric.descent import Search, SearchOfOne
from rrtik_ompl.ik.residual import error_of_one
from rrtik_ompl.ik.solve import solve_ik
from rrtik_ompl.ik.targets import goal_rows
from rrtik_ompl.kernels.ik import ik_layout
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.world.row_checks import RowChecks

ARMS = ("ur5", "panda", "titan4")
ROUNDING = 1e-12  # [m] and [rad]


def drawn(robot, count, seed=0):
    return np.random.default_rng(seed).uniform(*robot.finite_range(), (count, robot.dof))


def poses(robot, count, seed=0):
    return [rrtik.PoseGoal(robot.fk(q)) for q in drawn(robot, count, seed)]


def answers(robot, goals):
    return np.concatenate([solve_ik(robot, goal).solutions for goal in goals])


@pytest.mark.kernels
@pytest.mark.parametrize("name", ARMS)
def test_threads_at_once_get_the_answers_of_one_alone(name):
    robot, threads = rrtik.load_robot(name), 4
    goals = [poses(robot, 150, seed) for seed in range(threads)]
    alone = [answers(robot, each) for each in goals]
    together = Barrier(threads)

    def work(each):
        together.wait()
        return [answers(robot, each) for _ in range(5)]

    with ThreadPoolExecutor(threads) as pool:
        for expected, rounds in zip(alone, pool.map(work, goals), strict=True):
            for found in rounds:
                np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("name", ["titan4", "ur5", "planar3"])
def test_what_was_solved_before_changes_no_answer(name):
    robot = rrtik.load_robot(name)
    goals = poses(robot, 20)
    first = answers(robot, goals)
    away = rrtik.PoseGoal(rrtik.pose([9.0, 0.0, 0.0]))
    assert not solve_ik(robot, away).found
    np.testing.assert_array_equal(answers(robot, goals[::-1]), first[::-1])


@pytest.mark.kernels
def test_a_search_in_kept_memory_finds_what_a_new_one_finds():
    robot = rrtik.load_robot("panda")
    kernels, limb, near = library(ik_layout.KERNELS), seeded_limb_of(robot), mid_range_configuration(robot)
    for goal in poses(robot, 20):
        aim = goal_rows(goal)
        kept, new = SearchOfOne(kernels, limb, aim, near), Search(robot, aim, near)
        for _ in range(4):
            found = kept.advance()
            assert new.advance(np.arange(1))[0] == (len(found) == 1)
            np.testing.assert_array_equal(found, new.q[: len(found)])
        assert kept.steps == new.steps
        kept.close()
    calls = spare_calls(limb)
    assert len(calls) > 0
    assert all(call.intact() for call in calls)


@pytest.mark.kernels
@pytest.mark.parametrize("name", ["titan4", "puma560", "ur5"])
def test_branches_in_kept_memory_are_those_of_a_new_call(name):
    robot = rrtik.load_robot(name)
    form, near = form_of(robot), drawn(robot, 1, 1)
    for goal in poses(robot, 50):
        matrix = goal.T_world_tip.homogeneous
        rows, new = branches.valid_branches(robot, form, matrix, near[0]), branches_of(robot, matrix[None], near)
        np.testing.assert_array_equal(rows, new.branches[new.valid])
    spare = branches._arm_of(robot, form).spare
    assert len(spare) > 0
    assert all(call.intact() for call in spare)


@pytest.mark.kernels
@pytest.mark.parametrize("name", ["titan4", "ur5"])
def test_a_pose_is_solved_while_another_is_being_accepted(name, monkeypatch):
    """What judges a solution may ask for solutions itself: the memory in use is not given to it."""
    robot = rrtik.load_robot(name)
    first, second = poses(robot, 2)
    expected = [solve_ik(robot, goal).solutions for goal in (first, second)]
    world, inner = rrtik.World(robot), []

    def judged(self, Q):
        inner.append(solve_ik(robot, second).solutions)
        return np.ones(len(Q), dtype=bool)

    monkeypatch.setattr(RowChecks, "free", judged)
    monkeypatch.setattr(RowChecks, "certified", lambda self, Q: np.ones(len(Q), dtype=bool))
    found = solve_ik(robot, first, world=world).solutions
    np.testing.assert_allclose(found, expected[0], rtol=0, atol=ROUNDING)  # a world is another kernel's, or the same
    assert len(inner) > 0
    for found in inner:
        np.testing.assert_array_equal(found, expected[1])


@pytest.mark.parametrize("name", rrtik.list_robots())
def test_the_error_of_one_configuration_is_that_of_many(name):
    robot = rrtik.load_robot(name)
    Q = drawn(robot, 10)
    near, half_turn = robot.fk(Q[0]), robot.fk(Q[1]) * rrtik.pose(rpy=[np.pi, 0.0, 0.0])
    goals = [rrtik.PoseGoal(near), rrtik.PoseGoal(half_turn), rrtik.PositionGoal(near.translation)]
    for goal in goals:
        one = [error_of_one(robot, goal, q) for q in Q]
        np.testing.assert_allclose(one, np.transpose(goal.errors(robot, Q)), rtol=0, atol=ROUNDING)


@pytest.mark.kernels
def test_an_answer_that_misses_the_goal_is_not_returned(monkeypatch):
    """The solver's own word is not enough: the tip is placed anew, by Pinocchio."""
    robot = rrtik.load_robot("panda")
    advance = SearchOfOne.advance
    monkeypatch.setattr(SearchOfOne, "advance", lambda self: advance(self) + 0.1)
    assert not solve_ik(robot, poses(robot, 1)[0], method="numeric").found
