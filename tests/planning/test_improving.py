"""Paths that go on getting shorter after they were found."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.cli.app import run
from rrtik_ompl.model.transitions import route_length
from rrtik_ompl.planning import improving
from rrtik_ompl.planning.improving import COSTS, improved, least_time, weighted_length
from rrtik_ompl.planning.outcome import Improvement, NamedPlanner, Request
from rrtik_ompl.planning.plan import plan
from rrtik_ompl.planning.short_path import tools_for
from rrtik_ompl.problem_files.problem import load_problem
from rrtik_ompl.world.problem import Problem
from rrtik_planners import FastRRTConnect

SEEDS = range(1, 7)
LONG = 20.0  # [s] a limit that the tests do not come near to


@pytest.fixture
def few_rounds(monkeypatch):
    monkeypatch.setattr(improving, "PATIENCE", 3)


@pytest.mark.parametrize(("name", "planner"), [("titan4_prisms", "fastrrtconnect"), ("planar3_boxes", "RRTConnect")])
def test_a_path_gets_shorter_and_stays_proven(few_rounds, name, planner):
    problem = load_problem(name)
    first = plan(problem, planner, seed=1)
    better = plan(problem, planner, seed=1, seconds=LONG, improve=LONG)
    assert better.path.length < first.path.length
    assert better.proven
    assert not better.path.violations(problem.world)
    assert (better.path.waypoints[0] == problem.start).all()
    assert problem.goal.satisfied(
        problem.world.robot, better.path.waypoints[-1:]
    ).all()  # perhaps by other joint values


def test_the_course_of_the_length_only_falls_and_ends_with_the_path(few_rounds):
    problem = load_problem("titan4_prisms")
    found = plan(problem, "fastrrtconnect", seed=3, seconds=LONG, improve=LONG)
    course = np.array(found.statistics["cost_over_time"])
    assert course.shape[1] == 2
    assert (np.diff(course[:, 0]) >= 0.0).all()
    assert (np.diff(course[:, 1]) < 0.0).all()
    assert course[-1, 1] == found.path.length
    bound = found.statistics["length_bound"]
    assert bound == pytest.approx(np.linalg.norm(problem.goal.q - problem.start))
    assert bound <= found.path.length


def test_a_straight_motion_is_as_short_as_can_be_and_ends_the_work():
    problem = load_problem("titan4_prisms")
    near = Problem(problem.world, problem.start, problem.start + 1e-3)
    found = plan(near, seed=1, improve=LONG)
    assert found.statistics["improving_rounds"] == 0
    assert found.path.length == pytest.approx(found.statistics["length_bound"])


def test_single_joint_moves_stay_so_and_never_become_more(few_rounds):
    problem = load_problem("planar3_boxes")
    first = plan(problem, "bicrdt", seed=2)
    better = plan(problem, "bicrdt", seed=2, seconds=LONG, improve=2.0)
    assert better.path.one_joint_at_a_time
    assert better.path.transitions <= first.path.transitions


def ended_by(error, after):
    """A planner that raises an error in place of every search after some number of them."""
    searches = []

    class Ended(FastRRTConnect):
        def search(self, *given):
            searches.append(given)
            if len(searches) > after:
                raise error
            return super().search(*given)

    return Ended


@pytest.mark.parametrize("error", [RuntimeError("it broke"), InputError("not like this")])
def test_planners_that_break_after_the_first_path_leave_it(few_rounds, error):
    problem = load_problem("titan4_prisms")
    first = plan(problem, "fastrrtconnect", seed=1)
    kept = plan(problem, ended_by(error, after=1), seed=1, seconds=LONG, improve=LONG)
    assert kept.found
    assert kept.path.length <= first.path.length
    assert kept.statistics["improving_rounds"] >= 3


def test_ctrl_c_ends_the_work_and_keeps_the_best_path():
    problem = load_problem("titan4_prisms")
    gains = []
    for seed in SEEDS:
        first = plan(problem, "fastrrtconnect", seed=seed)
        kept = plan(problem, ended_by(KeyboardInterrupt(), after=3), seed=seed, seconds=LONG, improve=LONG)
        assert 0 < kept.statistics["improving_rounds"] <= 3  # a round may search twice
        assert kept.path.length == kept.statistics["cost_over_time"][-1][1]
        gains.append(first.path.length - kept.path.length)
    assert min(gains) >= 0.0
    assert max(gains) > 0.0  # where a path ends up differs from processor to processor


def test_no_round_begins_when_the_time_of_all_is_up():
    problem = load_problem("titan4_prisms")
    planner = NamedPlanner("fastrrtconnect", FastRRTConnect)
    first = plan(problem, planner.factory, seed=1)
    kept = improved(problem, first, planner, Request(Budget(1, first.seconds)), Improvement(LONG))
    assert kept.path is first.path
    assert kept.statistics["improving_rounds"] == 0


@pytest.mark.parametrize("bad", [-1.0, float("nan"), "long"])
def test_no_time_is_named(bad):
    with pytest.raises(InputError, match="improve"):
        plan(load_problem("titan4_prisms"), improve=bad)


def test_the_command_takes_it(capsys):
    assert run(["plan", "planar3_boxes", "--planner", "RRTConnect", "--improve", "0.2", "--json"]) == 0
    assert '"cost_over_time"' in capsys.readouterr().out


def test_the_first_path_alone_is_shortened_if_that_is_wanted():
    problem = load_problem("titan4_prisms")
    gains = []
    for seed in SEEDS:
        first = plan(problem, "fastrrtconnect", seed=seed)
        better = plan(problem, "fastrrtconnect", seed=seed, seconds=LONG, improve=LONG, strategy="shorten")
        assert better.statistics["improving_rounds"] == 0
        gains.append(first.path.length - better.path.length)
    assert min(gains) >= 0.0
    assert max(gains) > 0.0


@pytest.mark.parametrize("objective", ["time", "clearance"])
def test_another_objective_falls_and_is_that_of_the_path(few_rounds, objective):
    problem = load_problem("titan4_prisms")
    found = plan(problem, "fastrrtconnect", seed=3, seconds=LONG, improve=LONG, objective=objective)
    course = np.array(found.statistics["cost_over_time"])
    assert (np.diff(course[:, 1]) < 0.0).all()
    assert course[-1, 1] == pytest.approx(COSTS[objective](found.path, problem))
    assert course[-1, 1] >= found.statistics["cost_bound"]


def test_least_time_is_that_of_the_slowest_joint_of_each_motion():
    problem = load_problem("titan4_prisms")
    path = plan(problem, "fastrrtconnect", seed=3).path
    slowest = [max(abs(b - a) / problem.robot.velocity) for a, b in pairwise(path.waypoints)]
    assert least_time(path, problem) == pytest.approx(sum(slowest))


def test_weighted_length_is_an_integral_over_the_clearance():
    problem = load_problem("titan4_prisms")
    path = plan(problem, "fastrrtconnect", seed=3).path
    rows, world = path.waypoints, problem.world
    total = 0.0
    for a, b in pairwise(rows):
        places = a + (np.arange(40)[:, None] + 0.5) / 40 * (b - a)
        total += np.linalg.norm(b - a) * np.mean([1.0 + 0.05 / max(world.clearance(q), 1e-3) for q in places])
    assert weighted_length(path, problem) == pytest.approx(total, rel=0.1)  # clearances are told apart by 5 %
    assert weighted_length(path, problem) > path.length


def test_a_robot_without_velocity_limits_has_no_time():
    problem = load_problem("planar3_boxes")
    if np.isfinite(problem.robot.velocity).any():
        pytest.skip("it has some")
    with pytest.raises(InputError, match="no velocity limits"):
        plan(problem, "RRTConnect", seed=1, improve=0.1, objective="time")


@pytest.mark.parametrize("bad", [{"objective": "energy"}, {"strategy": "hope"}])
def test_unknown_objectives_and_strategies_are_named(bad):
    with pytest.raises(UnknownNameError, match=next(iter(bad.values()))):
        plan(load_problem("titan4_prisms"), improve=0.1, **bad)


def test_the_default_planner_goes_on_with_the_one_that_found_the_path(few_rounds):
    problem = load_problem("titan4_prisms")
    found = plan(problem, seed=2, seconds=LONG, improve=LONG)
    assert found.statistics["improving_rounds"] > 0
    assert found.proven


@pytest.mark.kernels
@pytest.mark.parametrize("name", ["planar3_boxes", "panda_shelf"])
def test_further_paths_of_the_default_are_short_paths(few_rounds, monkeypatch, name):
    monkeypatch.setattr(improving, "walk", None)  # no planner takes a turn
    problem = load_problem(name)
    first, found = plan(problem, seed=2), plan(problem, seed=2, seconds=LONG, improve=LONG)
    assert found.statistics["improving_rounds"] >= 12
    assert found.path.length <= first.path.length
    assert problem.reached(found.path.end)
    assert problem.world.prove(found.path, clearance=found.path.proof.clearance).proven
    assert found.path.violations(problem.world) == ()


@pytest.mark.kernels
def test_a_route_stays_below_the_length_that_is_asked_for():
    problem = load_problem("titan4_prisms")
    goals = problem.goal.q[None]
    line = float(np.linalg.norm(goals[0] - problem.start))
    with tools_for(problem, Request(Budget()), goals) as tools:

        def length(seed, below):
            found = tools.routes.find(problem.start, goals, seed, lambda: False, below=below)
            return route_length(tools.routes.route) if found else np.inf

        free = [length(seed, np.inf) for seed in range(6)]
        below = 0.5 * (line + max(free))
        bounded = [length(seed, below) for seed in range(6)]
        assert tools.routes.intact()
        assert length(0, np.inf) == free[0]  # the bound was that of one call
        assert length(0, 0.99 * line) == np.inf
    assert max(free) < np.inf
    assert all(each < below or each == np.inf for each in bounded)
