"""C-RDT and BiC-RDT keep what they promise: the smallest move, frozen and last joints, costs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.errors import InputError, PlannerError, UnknownNameError
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.model.transitions import merge_moves, single_joint
from rrtik_ompl.ompl_bridge.attempt import attempt
from rrtik_ompl.ompl_bridge.contract import small_problem
from rrtik_ompl.world.problem import Problem
from rrtik_planners import CRDT, BiCRDT
from rrtik_tests.slider_arm import NAMES, Plain, shipped


def solved(problem: Problem, planner: Any, seed: int, world: Any = None, **options: Any) -> Any:
    """Rows and statistics, in the problem's world or another."""
    aims, parameters = problem.goal.q[None], {"max_iterations": 4000, **options}
    factory = planner if world is None else lambda si, seed, **more: planner(si, world=world, seed=seed, **more)
    if world is None:
        found = attempt(problem, factory, aims, Budget(seed, seconds=20.0), parameters=parameters)
        return found.rows, dict(found.statistics)

    class InAnotherWorld(planner):  # type: ignore[misc]
        def __init__(self, si: Any, **given: Any) -> None:
            super().__init__(si, **{**given, **parameters, "world": world})

    found = attempt(problem, InAnotherWorld, aims, Budget(seed, seconds=20.0))
    return found.rows, dict(found.statistics)


@pytest.mark.parametrize("name", ["planar3_a", "titan4_sdu", "titan4_prisms"])
@pytest.mark.parametrize("planner", [BiCRDT, CRDT])
def test_a_planner_gives_the_same_path_and_counts_without_kernels(name: str, planner: Any) -> None:
    problem = shipped(name)
    for seed in range(4):
        rows, counts = solved(problem, planner, seed)
        plain_rows, plain_counts = solved(problem, planner, seed, Plain(problem.world))
        np.testing.assert_array_equal(rows, plain_rows)
        assert counts == plain_counts


@pytest.mark.parametrize("name", NAMES)
def test_paths_keep_what_the_planner_promises(name: str) -> None:
    problem = shipped(name)
    for seed in range(10):
        rows, counts = solved(problem, BiCRDT, seed)
        assert single_joint(rows)
        assert problem.world.motion_valid_batch(rows[:-1], rows[1:]).all()
        np.testing.assert_array_equal(rows[0], problem.start)
        np.testing.assert_array_equal(rows[-1], problem.goal.q)
        assert counts["vertices"] >= 2
        assert counts["checked_motions"] >= len(rows) - 1


@pytest.mark.parametrize("planner", [BiCRDT, CRDT])
@pytest.mark.parametrize("kernels", [True, False])
def test_no_move_is_shorter_than_the_smallest(planner: Any, kernels: bool) -> None:
    problem, smallest = shipped("titan4_sdu"), np.radians(8.0)
    for seed in range(8):
        world = None if kernels else Plain(problem.world)
        rows, _ = solved(problem, planner, seed, world, smallest_move=smallest)
        moves = np.abs(np.diff(merge_moves(rows, 0.0), axis=0)).max(axis=1)
        assert moves.min() >= smallest
    rows = [solved(problem, planner, seed)[0] for seed in range(8)]
    assert min(np.abs(np.diff(merge_moves(r, 0.0), axis=0)).max(axis=1).min() for r in rows) < smallest


@pytest.mark.parametrize("kernels", [True, False])
def test_a_goal_nearer_than_the_smallest_move_is_reached_by_going_round(kernels: bool) -> None:
    problem = shipped("titan4_axis1")
    nearby = Problem(problem.world, problem.start, problem.start + np.array([0.02, 0, 0, 0, 0, 0]))
    world = None if kernels else Plain(problem.world)
    rows, _ = solved(nearby, BiCRDT, 1, world, smallest_move=[0.1, 0.1, 0.1, 0.1, 0.1, 0.1])
    moves = np.abs(np.diff(merge_moves(rows, 0.0), axis=0)).max(axis=1)
    assert moves.min() >= 0.1
    np.testing.assert_array_equal(rows[-1], nearby.goal.q)


@pytest.mark.parametrize("planner", [BiCRDT, CRDT])
@pytest.mark.parametrize("kernels", [True, False])
@pytest.mark.parametrize("joint", [5, "theta6"])
def test_a_frozen_joint_does_not_move(planner: Any, kernels: bool, joint: Any) -> None:
    problem = shipped("titan4_sdu")
    names = load_robot("titan4").joint_names
    frozen = [names[5] if isinstance(joint, str) else joint]
    for seed in range(3):
        rows, _ = solved(problem, planner, seed, None if kernels else Plain(problem.world), frozen_joints=frozen)
        assert (rows[:, 5] == problem.start[5]).all()
        assert problem.world.motion_valid_batch(rows[:-1], rows[1:]).all()


def test_start_and_goal_must_agree_in_frozen_joints() -> None:
    problem = shipped("titan4_sdu")
    name = problem.robot.joint_names[0]
    with pytest.raises(
        PlannerError,
        match=f"frozen_joints: joint '{name}'.*0.436.* start.*0.174.* goal",
    ):
        solved(problem, BiCRDT, 0, frozen_joints=[0])


def test_goals_that_differ_in_frozen_joints_are_left_out() -> None:
    problem = shipped("titan4_sdu")
    other = problem.goal.q + np.array([0, 0, 0, 0, 0, 0.2])
    goals = np.vstack([other, problem.goal.q])
    found = attempt(problem, BiCRDT, goals, Budget(1, seconds=20.0), parameters={"frozen_joints": [5]})
    np.testing.assert_array_equal(found.rows[-1], problem.goal.q)


def test_a_costly_joint_moves_less() -> None:
    problem = shipped("titan4_sdu")
    travel = []
    for costs in (None, [1.0, 1.0, 1.0, 1.0, 1.0, 10.0]):
        paths = [solved(problem, BiCRDT, seed, joint_costs=costs)[0] for seed in range(60)]
        travel.append(np.mean([np.abs(np.diff(rows[:, 5])).sum() for rows in paths]))
    assert travel[1] < 0.5 * travel[0]


@pytest.mark.parametrize("planner", [BiCRDT, CRDT])
@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"joint_costs": [1.0, 0.0, 1.0]}, InputError),
        ({"joint_costs": [1.0, 1.0]}, InputError),
        ({"joint_costs": float("nan")}, InputError),
        ({"smallest_move": -0.1}, InputError),
        ({"smallest_move": [0.1, 0.1]}, InputError),
        ({"frozen_joints": [3]}, InputError),
        ({"frozen_joints": [-1]}, InputError),
        ({"frozen_joints": [True]}, InputError),
        ({"frozen_joints": 1}, InputError),
        ({"frozen_joints": "elbow"}, InputError),
        ({"frozen_joints": ["elbow"]}, UnknownNameError),
    ],
)
def test_options_that_make_no_sense_are_refused_by_name(planner: Any, options: Any, error: Any) -> None:
    with pytest.raises(error, match=next(iter(options))):
        planner(small_problem().getSpaceInformation(), **options)


@pytest.mark.parametrize("kernels", [True, False])
def test_joints_that_move_last_stay_until_the_others_have_arrived(kernels: bool) -> None:
    problem, world = shipped("titan4_sdu"), None if kernels else Plain(shipped("titan4_sdu").world)
    name = problem.robot.joint_names[4]
    turned = problem.goal.q + np.array([0, 0, 0, 0, 0, 0.5])
    other = Problem(problem.world, problem.start, turned)
    for seed in range(5):
        rows, _ = solved(other, BiCRDT, seed, world, last_joints=[5, name])
        assert single_joint(rows)
        assert other.world.motion_valid_batch(rows[:-1], rows[1:]).all()
        np.testing.assert_array_equal(rows[0], other.start)
        np.testing.assert_array_equal(rows[-1], turned)
        assert (rows[:-2, 4:] == problem.start[4:]).all()
        assert rows[-2].tolist() == [*turned[:4], problem.start[4], turned[5]]


def test_goals_whose_last_moves_are_not_free_are_left_out() -> None:
    problem = shipped("env_e")
    goals = np.array([[15.0, 16.0], [22.0, 16.0]])  # on the way to the first along y stands the letter's middle arm
    start = np.array([15.0, 9.0])
    assert not problem.world.motion_valid(np.array([15.0, 9.0]), goals[0])
    other = Problem(problem.world, start, goals[1])
    found = attempt(other, BiCRDT, goals, Budget(1, seconds=20.0), parameters={"last_joints": [1]})
    assert found.rows.tolist()[-2:] == [[22.0, 9.0], [22.0, 16.0]]
    blocked = attempt(other, BiCRDT, goals[:1], Budget(1, seconds=20.0), parameters={"last_joints": [1]})
    assert blocked.rows is None


def test_a_last_move_shorter_than_the_smallest_is_not_made() -> None:
    problem = shipped("titan4_sdu")
    other = Problem(problem.world, problem.start, problem.goal.q + np.array([0, 0, 0, 0, 0, 0.05]))
    options = {"last_joints": [5], "smallest_move": 0.06}
    found = attempt(other, BiCRDT, other.goal.q[None], Budget(1, seconds=20.0), parameters=options)
    assert found.rows is None
    options["smallest_move"] = 0.04
    found = attempt(other, BiCRDT, other.goal.q[None], Budget(1, seconds=20.0), parameters=options)
    assert found.rows is not None
