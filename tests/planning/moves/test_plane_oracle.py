"""Arms of few joints beside exact plane geometry: fine grids find fewer moves, and bounds stay below them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.moves.fewest_moves_oracle import drawn_case
from rrtik_bench.shortening.plane_arms import PlaneArm, PlaneGrid
from rrtik_ompl.base.budget import Budget, no_stop
from rrtik_ompl.planning.moves.clearance_levels import clearance_levels
from rrtik_ompl.planning.moves.fine_grids import FineGrids
from rrtik_ompl.planning.moves.lower_bounds import reach_bound
from rrtik_ompl.planning.plan import plan
from rrtik_ompl.planning.shortening import shorten
from rrtik_ompl.problem_files.problem import load_problem
from rrtik_planners import FewestMoves
from rrtik_tests.sizes import how_many

WINDING = 26  # a case of two joints with 8 moves


@pytest.mark.parametrize("number", [WINDING, 3])
def test_the_exact_geometry_agrees_with_a_world(number: int) -> None:
    case, rng = drawn_case(number), np.random.default_rng(0)
    world = case.problem.world
    rows = rng.uniform(-3.1, 3.1, (1000, world.robot.dof))
    room = case.arm.room(rows)
    np.testing.assert_array_equal((room > 0.0)[abs(room) > 1e-6], world.valid_batch(rows)[abs(room) > 1e-6])
    tails = rows[room > 0.0][: how_many(300, 100)]
    heads, joints = tails.copy(), rng.integers(world.robot.dof, size=len(tails))
    heads[np.arange(len(tails)), joints] = rng.uniform(-3.1, 3.1, len(tails))
    exact = np.array([case.arm.free(np.array(ends)) for ends in zip(tails, heads, strict=True)])
    proven = world.proving(0.0).motion_valid_batch(tails, heads)
    assert not (proven & ~exact).any()
    assert (exact & ~proven).mean() < 0.01
    assert 0.1 < exact.mean() < 0.95


def test_a_disc_between_start_and_goal_costs_two_moves_on_a_grid() -> None:
    arm = PlaneArm(np.array([1.0, 0.5]), 0.0, np.array([[1.3, 0.0, 0.1]]), np.zeros((0, 4, 2)))
    values = [np.linspace(-3.0, 3.0, 61)] * 2
    moves = PlaneGrid(arm, values).moves_from(np.array([-1.0, values[1][30]]))
    assert moves[40, 30] == 3
    assert not arm.free(np.array([[-1.0, 0.0], [1.0, 0.0]]))
    assert arm.free(np.array([[-1.0, 0.0], [-1.0, 2.8], [1.0, 2.8], [1.0, 0.0]]))


def test_a_winding_route_has_as_few_moves_as_the_oracle_and_a_bound_close_to_them() -> None:
    case = drawn_case(WINDING)
    found = plan(case.problem, FewestMoves, seed=WINDING, seconds=60.0, shorten=False)
    assert found.path is not None
    assert case.arm.free(found.path.waypoints)
    assert found.path.transitions == case.moves == 8
    assert found.statistics["lower_bound"] == 7
    raw = plan(case.problem, "bicrdt", seed=2, shorten=False).path
    assert raw is not None
    short = shorten(raw, case.problem, method="fewest-moves")
    assert short.transitions == 8
    assert case.arm.free(short.waypoints)


def test_a_grid_has_nothing_to_add_to_a_route_that_is_proven_or_when_time_is_up() -> None:
    problem = load_problem("env_e")
    ends = np.array([problem.start, problem.goal.q])
    robot = problem.world.robot
    levels = clearance_levels(problem.world, ends, None)
    grids = FineGrids(range(2), robot.lower, robot.upper, np.ones(2), np.zeros(2), levels, Budget(seed=1))
    known = np.zeros((11, 2))  # as if ten moves were known
    found = grids.route([(ends[0], ends[1])], known, 4)
    assert found is not None
    assert len(found[0]) == 5
    assert grids.route([(ends[0], ends[1])], known, 10) is None
    late = replace(grids, budget=Budget(seed=1, stop=lambda: True))
    assert late.route([(ends[0], ends[1])], known, 4) is None


def test_the_bound_by_reach_is_for_two_joints_with_time() -> None:
    problem = load_problem("env_e")
    ends = problem.start, problem.goal.q
    assert 2 <= reach_bound(problem.world, range(2), *ends, 99, no_stop) <= 4
    assert reach_bound(problem.world, range(2), *ends, 1, no_stop) == 1
    assert reach_bound(problem.world, range(2), *ends, 99, lambda: True) == 0
    assert reach_bound(problem.world, [0], *ends, 99, no_stop) == 0
