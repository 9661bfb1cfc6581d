"""DRRT-Con as a planner of OMPL goes on from the path of its last solve."""

from __future__ import annotations

import numpy as np
import pytest
from ompl import base as ob

from rrtik_ompl.ompl_bridge.contract import GOAL, small_problem, solution_rows
from rrtik_planners import DRRTCon


@pytest.fixture
def kept(quiet_ompl):
    """A problem in plain OMPL whose obstacle can be switched, solved once."""
    where = {"bar": (0.0, 0.0), "wall": False}

    def valid(state):
        away = max(abs(state[0] - where["bar"][0]), abs(state[1] - where["bar"][1]))
        return bool(away > 0.5 and not (where["wall"] and abs(state[0]) < 0.2))

    setup = small_problem(valid)
    planner = DRRTCon(setup.getSpaceInformation(), seed=2, range=0.4)
    setup.setPlanner(planner)
    assert str(setup.solve(10.0)) == "Exact solution"
    return setup, planner, where


def test_a_second_solve_starts_from_the_path_of_the_first(kept):
    setup, planner, where = kept
    first = solution_rows(setup)
    middle = 0.5 * (first[0] + first[1])
    where["bar"] = tuple(0.5 * (first[-2] + first[-1])[:2] * 0.6 + 0.4 * middle[:2])
    setup.getProblemDefinition().clearSolutionPaths()
    assert str(setup.solve(10.0)) == "Exact solution"
    second = solution_rows(setup)
    assert planner.statistics["reused"] == 1
    assert (second[[0, -1]] == first[[0, -1]]).all()


def test_a_path_that_is_still_free_is_given_back_without_a_sample(kept):
    setup, planner, where = kept
    first = solution_rows(setup)
    drawn = planner.statistics["iterations"]
    where["bar"] = (9.0, 9.0)
    setup.getProblemDefinition().clearSolutionPaths()
    assert str(setup.solve(10.0)) == "Exact solution"
    assert planner.statistics["iterations"] == drawn
    assert (solution_rows(setup) == first).all()


def test_a_path_that_nothing_leads_round_is_kept_for_later(kept):
    setup, planner, where = kept
    first = solution_rows(setup)
    where["wall"] = True
    setup.getProblemDefinition().clearSolutionPaths()
    assert str(setup.solve(0.3)) != "Exact solution"
    where["wall"] = False
    setup.getProblemDefinition().clearSolutionPaths()
    assert str(setup.solve(10.0)) == "Exact solution"
    assert planner.statistics["reused"] == 1
    assert (solution_rows(setup) == first).all()


def test_the_start_may_walk_and_clear_forgets(kept):
    setup, planner, _ = kept
    first = solution_rows(setup)
    si = setup.getSpaceInformation()
    state, definition, goal = si.allocState(), ob.ProblemDefinition(si), ob.GoalState(si)
    here = first[0] + 0.3 * (first[1] - first[0])
    state[0:3] = [float(x) for x in here]
    definition.addStartState(state)
    state[0:3] = list(GOAL)
    goal.setState(state)
    definition.setGoal(goal)
    planner.setProblemDefinition(definition)
    assert str(planner.solve(10.0)) == "Exact solution"
    assert planner.statistics["reused"] == 1
    path = definition.getSolutionPath()
    assert np.array(path.getState(0)[0:3]) == pytest.approx(here)
    planner.clear()
    assert str(planner.solve(10.0)) == "Exact solution"
    assert planner.statistics["reused"] == 0
