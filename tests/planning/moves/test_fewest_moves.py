"""Fewest moves as a planner and as a method of shortening: optima, bad input, interruption, time."""

from __future__ import annotations

import signal
import time
from itertools import count, pairwise

import numpy as np
import pytest

from bench.moves.oracles import least_moves
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.errors import InputError, PathWarning
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.scene import Scene
from rrtik_ompl.model.transitions import route_length, single_joint, transitions
from rrtik_ompl.ompl_bridge import SearchResult
from rrtik_ompl.planning.moves.axis_cut import double_axis_cut
from rrtik_ompl.planning.moves.search import MoveSearch
from rrtik_ompl.planning.moves.staircase import one_joint_moves
from rrtik_ompl.planning.plan import plan
from rrtik_ompl.planning.shortening import shorten
from rrtik_ompl.planning.shortening.fewest_moves import fewest_moves
from rrtik_ompl.problem_files.problem import load_problem
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World
from rrtik_planners import FewestMoves
from rrtik_tests.mazes import OPTIMA


@pytest.mark.parametrize("name", OPTIMA)
def test_planner_meets_the_proven_optimum(name: str) -> None:
    problem = load_problem(name)
    found = plan(problem, FewestMoves, seed=3, seconds=60.0, shorten=False)
    assert found.path is not None
    assert found.path.transitions == found.statistics["lower_bound"] == OPTIMA[name]
    assert found.statistics["gap"] == 0
    assert single_joint(found.path.waypoints)
    np.testing.assert_array_equal(found.path.waypoints[[0, -1]], [problem.start, problem.goal.q])
    again = plan(problem, FewestMoves, seed=3, seconds=60.0, shorten=False)
    assert again.path is not None
    np.testing.assert_array_equal(found.path.waypoints, again.path.waypoints)


def test_theta6_rests_at_the_subsea_unit() -> None:
    found = plan(load_problem("titan4_sdu"), FewestMoves, seed=5, seconds=60.0, shorten=False)
    assert found.path is not None
    assert np.ptp(found.path.waypoints[:, 5]) == 0.0


@pytest.mark.parametrize("name", ["titan4_prisms", "planar3_c"])
def test_shortening_keeps_ends_and_validity_and_is_never_worse(name: str) -> None:
    problem = load_problem(name)
    for seed in range(3):
        path = plan(problem, "bicrdt", seed=seed, shorten=False).path
        assert path is not None
        shorter = shorten(path, problem, method="fewest-moves")
        assert (shorter.transitions, shorter.length) <= (path.transitions, path.length)
        assert shorter.transitions == OPTIMA[name]
        assert not shorter.violations(problem.world)
        assert single_joint(shorter.waypoints)
        np.testing.assert_array_equal(shorter.waypoints[[0, -1]], path.waypoints[[0, -1]])
        again = shorten(path, problem, method="fewest-moves")
        np.testing.assert_array_equal(shorter.waypoints, again.waypoints)


def test_a_path_that_moves_several_joints_at_once_stays_as_it_is_with_the_remedy() -> None:
    problem = open_problem()
    path = JointPath.of(problem.world.robot, [problem.start, problem.goal.q])
    with pytest.warns(PathWarning, match="one_joint_moves"):
        kept = shorten(path, problem, method="fewest-moves")
    np.testing.assert_array_equal(kept.waypoints, path.waypoints)


def open_problem() -> Problem:
    return Problem(World(load_robot("planar3"), Scene()), [0.0, 0.0, 0.0], [1.0, 0.5, -0.5])


def test_without_obstacles_the_bound_is_the_number_of_joints_that_differ_and_is_met() -> None:
    problem = open_problem()
    assert least_moves(problem) == 3
    rows = np.array([[0.0, 0, 0], [0, 2, 0], [1, 2, 0], [1, 2, -0.5], [1, 0.5, -0.5]])
    found = fewest_moves(rows, problem.world)
    assert (found.moves, found.bound) == (3, 3)
    assert route_length(found.route) == pytest.approx(2.0)


def test_a_direct_route_needs_no_further_question() -> None:
    ends = np.array([[0.0, 0, 0], [1, 0.5, -0.5]])
    search = MoveSearch(ends[:1], ends[1:], -np.ones(3), np.ones(3), lambda tails, _: np.ones(len(tails), dtype=bool))
    search.try_corner_routes()
    asked = search.motions
    search.improve(100)
    assert search.direct
    assert (search.moves, search.motions) == (3, asked)


def test_without_a_look_at_all_corners_the_bound_stays_and_nothing_is_proven_on_top_of_it() -> None:
    start, goal = np.zeros(8), np.ones(8)

    def ask(tails: np.ndarray, heads: np.ndarray) -> np.ndarray:
        return (tails[:, 7] < 0.0) | (tails[:, 0] == heads[:, 0])  # the first joint moves when the last stands aside

    def prove(*_: object) -> int:
        raise AssertionError("the corners are not settled")

    search = MoveSearch(start[None], goal[None], -np.ones(8), np.ones(8), ask, most_nodes=64, prove=prove)
    corners = [np.where(np.arange(8) < k, 1.0, 0.0) for k in range(1, 9)]
    aside = np.where(np.arange(8) == 7, -1.0, start)  # nine moves: the last joint moves twice
    search.offer(np.vstack([start, aside, *[np.where(np.arange(8) == 7, -1.0, c) for c in corners[:7]], goal]))
    search.try_corner_routes()
    assert search.bound == 8
    search.improve(1)
    assert search.bound == 8


def test_a_route_of_one_configuration_stays() -> None:
    found = fewest_moves(np.zeros((1, 3)), open_problem().world)
    assert found.route.tolist() == [[0.0, 0.0, 0.0]]
    assert (found.moves, found.bound) == (0, 0)


def test_time_that_runs_out_ends_the_search_soon_with_the_best_so_far() -> None:
    problem = load_problem("titan4_sdu")
    raw = plan(problem, "bicrdt", seed=1, shorten=False).path
    assert raw is not None
    for questions in (0, 1, 5, 20):
        left = [questions]

        def stop(left: list[int] = left) -> bool:
            left[0] -= 1
            return left[0] < 0

        found = fewest_moves(raw.waypoints, problem.world, budget=Budget(stop=stop))
        assert left[0] >= -20  # a few looks at the clock after it struck, each without a question
        assert found.moves <= raw.transitions
        assert found.bound <= found.moves
        assert not raw.with_waypoints(found.route).violations(problem.world)


def test_an_interrupt_leaves_plan_and_the_next_one_works() -> None:
    problem = load_problem("cut_polygons")
    signal.setitimer(signal.ITIMER_REAL, 0.3)
    previous = signal.signal(signal.SIGALRM, lambda *_: signal.raise_signal(signal.SIGINT))
    begin = time.monotonic()
    try:
        with pytest.raises(KeyboardInterrupt):
            plan(problem, FewestMoves, seed=1, seconds=120.0, parameters={"rounds": 10_000}, shorten=False)
    finally:
        signal.signal(signal.SIGALRM, previous)
    assert time.monotonic() - begin < 60.0
    assert plan(problem, FewestMoves, seed=1, seconds=2.0, parameters={"rounds": 0}, shorten=False).found


@pytest.mark.parametrize("options", [{"rounds": -1}, {"searches": 0}, {"rounds": 1.5}, {"searches": True}])
def test_options_out_of_range_are_refused(options: dict[str, float]) -> None:
    with pytest.raises(InputError, match=next(iter(options))):
        plan(load_problem("env_e"), FewestMoves, parameters=options)


def test_frozen_joints_rest() -> None:
    problem = load_problem("titan4_prisms")
    found = plan(problem, FewestMoves, seed=1, seconds=60.0, parameters={"frozen_joints": [1, 5]}, shorten=False)
    assert found.path is not None
    assert np.ptp(found.path.waypoints[:, [1, 5]]) == 0.0
    assert found.path.transitions == 3
    assert [(a != b).sum() for a, b in pairwise(found.path.waypoints)] == [1, 1, 1]


def test_a_long_route_is_cut_before_anything_takes_long() -> None:
    problem = load_problem("titan4_sdu")
    sampled = plan(problem, "RRTConnect", seconds=10.0, seed=2, shorten=False).path
    assert sampled is not None
    route, asked = one_joint_moves(sampled, problem).waypoints, count()

    def free(tails: np.ndarray, heads: np.ndarray) -> np.ndarray:
        next(asked)
        return problem.world.motion_valid_batch(tails, heads)

    cut = double_axis_cut(route, free)
    most, looks = 6 * next(asked) + 100, count()  # looks at the clock: some for every question of the cut
    found = fewest_moves(route, problem.world, budget=Budget(stop=lambda: next(looks) > most))
    assert found.moves <= transitions(cut) < 0.5 * transitions(route)
    half = count()
    found = fewest_moves(route, problem.world, budget=Budget(stop=lambda: next(half) > most // 2))
    assert found.moves < transitions(route)  # a cut that is broken off is kept as far as it has come


@pytest.mark.parametrize("seed", range(2))
def test_where_single_joint_trees_find_nothing_a_sampled_route_is_converted(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rrtik_planners.bicrdt.BiCRDT.search", lambda *_: SearchResult(None, {}))
    problem = load_problem("titan4_sdu")
    found = plan(problem, FewestMoves, seconds=20.0, seed=seed, parameters={"rounds": 1}, shorten=False)
    assert found.path is not None
    assert found.path.one_joint_at_a_time
    assert found.path.transitions <= 8
    frozen = plan(problem, FewestMoves, seconds=0.3, seed=seed, parameters={"frozen_joints": [5]}, shorten=False)
    assert not frozen.found  # a sampled route would move the frozen joint
