from __future__ import annotations

import gc
import re
import time
import weakref
from typing import Any

import numpy as np
import pytest
from ompl import base as ob

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.ompl_bridge import SafePlanner, SearchResult, SpaceChecker, WorldChecker
from rrtik_ompl.ompl_bridge.contract import GOAL, START, outside_bar, small_problem, solution_rows
from rrtik_tests.waiting import until

pytestmark = pytest.mark.usefixtures("quiet_ompl")


class Recorder(SafePlanner):
    """Remembers what it was given and answers with a result made beforehand."""

    def __init__(self, si: Any, answer: Any = None, **options: Any) -> None:
        super().__init__(si, "Recorder", **options)
        self.answer = answer
        self.starts = np.empty((0, 3))
        self.goals = np.empty((0, 3))

    def search(self, starts: Any, goals: Any, checker: Any, ptc: Any) -> SearchResult:
        self.starts, self.goals = starts, goals
        checker.valid(starts[0])
        checker.motion_valid(starts[0], goals[0])
        return SearchResult(None) if self.answer is None else self.answer


class World:
    """Stands for a World: free left of x = 0 alone."""

    def valid(self, q: np.ndarray) -> bool:
        return bool(q[0] < 0.0)

    def motion_valid(self, a: np.ndarray, b: np.ndarray) -> bool:
        return self.valid(a) and self.valid(b)

    def motion_valid_batch(self, A: np.ndarray, B: np.ndarray) -> np.ndarray:
        return (A[:, 0] < 0.0) & (B[:, 0] < 0.0)


def solve(setup: Any, *arguments: Any, **options: Any) -> tuple[str, Recorder]:
    planner = Recorder(setup.getSpaceInformation(), *arguments, **options)
    setup.setPlanner(planner)
    return str(setup.solve(5.0)), planner


def test_the_rows_of_a_result_become_the_solution_of_ompl() -> None:
    setup = small_problem()
    rows = np.array([START, (-1.0, 1.0, 0.0), GOAL])
    status, planner = solve(setup, SearchResult(rows, {"iterations": 3}))
    assert status == "Exact solution"
    np.testing.assert_array_equal(solution_rows(setup), rows)
    assert planner.statistics == {"iterations": 3, "checked_states": 3, "checked_motions": 1}


def test_a_result_short_of_the_goal_is_an_approximate_solution_with_its_distance() -> None:
    setup = small_problem()
    status, _ = solve(setup, SearchResult(np.array([START, (0.0, 1.0, 1.0)]), difference=1.0))
    assert status == "Approximate solution"
    assert setup.getProblemDefinition().getSolutionDifference() == 1.0
    assert not setup.getProblemDefinition().hasExactSolution()


def test_no_path_is_a_timeout_without_an_error() -> None:
    status, planner = solve(small_problem())
    assert (status, planner.error) == ("Timeout", None)


def test_all_valid_starts_and_goals_reach_the_search_once_each() -> None:
    goals = [(1.0, 1.0, 0.01 * k) for k in range(100)]
    _, planner = solve(small_problem(starts=[START, START, (0.0, 0.0, 0.0), (-1.0, 1.0, 0.0)], goals=[*goals, GOAL]))
    assert planner.starts.tolist() == [list(START), [-1.0, 1.0, 0.0]]
    assert planner.goals.tolist() == [[1.0, 1.0, 0.01 * k] for k in range(100)] + [list(GOAL)]


class Sampled(ob.GoalSampleableRegion):  # type: ignore[misc]
    """Gives goals one after the other, the first few of them in the obstacle."""

    def __init__(self, si: Any, bad: int) -> None:
        super().__init__(si)
        self.bad, self.given = bad, 0

    def distanceGoal(self, state: Any) -> float:
        return abs(float(state[0]) - 1.0)

    def sampleGoal(self, state: Any) -> None:
        self.given += 1
        state[0:3] = [0.0, 0.0, 0.0] if self.given <= self.bad else [1.0, 0.001 * self.given, 1.0]

    def maxSampleCount(self) -> int:
        return 100_000


def test_a_sampled_goal_is_asked_until_it_gives_a_free_configuration() -> None:
    setup = small_problem()
    goal = Sampled(setup.getSpaceInformation(), bad=200)
    setup.setGoal(goal)
    _, planner = solve(setup)
    assert len(planner.goals) == 1
    assert goal.given == 201


def test_a_sampled_goal_is_asked_for_several_configurations() -> None:
    setup = small_problem()
    setup.setGoal(Sampled(setup.getSpaceInformation(), bad=0))
    _, planner = solve(setup)
    assert 2 <= len(planner.goals) <= 100


def test_a_lazy_goal_is_waited_for() -> None:
    stopped = [False]

    def sample(_: Any, state: Any) -> bool:
        time.sleep(0.02)
        state[0:3] = list(GOAL)
        return not stopped[0]

    setup = small_problem()
    goal = ob.GoalLazySamples(setup.getSpaceInformation(), sample, False, 1e-3)
    setup.setGoal(goal)
    setup.setup()
    goal.startSampling()
    _, planner = solve(setup)
    stopped[0] = True
    until(lambda: not goal.isSampling())
    goal.stopSampling()
    assert planner.goals.tolist() == [list(GOAL)]


class Measured(ob.GoalRegion):  # type: ignore[misc]
    """A goal that can be recognised but not sampled."""

    def distanceGoal(self, state: Any) -> float:
        return abs(float(state[0]) - 1.0)


def test_a_goal_that_cannot_be_sampled_is_an_unrecognized_goal() -> None:
    setup = small_problem()
    setup.setGoal(Measured(setup.getSpaceInformation()))
    status, planner = solve(setup)
    assert status == "Unrecognized goal type"
    assert "cannot be sampled" in str(planner.error)


def test_a_world_is_asked_instead_of_the_space_information() -> None:
    status, planner = solve(small_problem(goals=[GOAL, (-1.0, 1.0, 1.0)]), world=World())
    assert planner.goals.tolist() == [[-1.0, 1.0, 1.0]]
    assert status == "Timeout"


def test_a_checker_that_does_not_return_a_bool_is_explained() -> None:
    calls = [0]

    def valid(_: Any) -> Any:
        calls[0] += 1
        return np.True_ if calls[0] > 3 else True

    status, planner = solve(small_problem(valid))
    assert status == "Crash"
    assert "must return a Python bool" in str(planner.error)


def test_a_planner_without_a_problem_says_so() -> None:
    planner = Recorder(small_problem().getSpaceInformation())
    assert str(planner.solve(0.1)) == "Crash"
    assert "no problem definition" in str(planner.error)
    assert len(str(planner.error).splitlines()) == 1


def test_the_time_may_be_a_number_of_numpy_but_no_text() -> None:
    setup = small_problem()
    _, planner = solve(setup)
    for seconds in (np.float32(0.1), np.int64(1), np.float64(0.1)):
        assert (str(planner.solve(seconds)), planner.error) == ("Timeout", None)
    assert str(planner.solve("soon")) == "Crash"
    assert re.match("solve: .*seconds.*got str", planner.error)


def test_a_problem_without_start_or_goal_says_so() -> None:
    without_start = small_problem(starts=[])
    status, planner = solve(without_start)
    assert (status, "none is given" in str(planner.error)) == ("Invalid start", True)
    without_goal = small_problem()
    without_goal.getProblemDefinition().clearGoal()
    status, planner = solve(without_goal)
    assert (status, "none is given" in str(planner.error)) == ("Invalid goal", True)


@pytest.mark.parametrize("what", ["goal", "objective"])
def test_a_goal_or_an_objective_of_another_space_is_refused_in_a_line(what: str) -> None:
    other = ob.SpaceInformation(ob.RealVectorStateSpace(7))
    setup = small_problem()
    if what == "goal":
        setup.setGoal(ob.GoalStates(other))
    else:
        setup.setOptimizationObjective(ob.PathLengthOptimizationObjective(other))
    status, planner = solve(setup)
    assert status == "Crash"
    assert planner.failure is not None
    assert planner.failure.refused
    assert re.match(f"{what}: .*7 coordinates.* 3", planner.failure.summary)


def test_a_goal_without_samples_is_an_invalid_goal_at_once() -> None:
    class Empty(ob.GoalSampleableRegion):  # type: ignore[misc]  # OMPL has no types
        def maxSampleCount(self) -> int:
            return 0

        def sampleGoal(self, _: Any) -> None:
            raise AssertionError("there is nothing to sample")

        def distanceGoal(self, _: Any) -> float:
            return 1.0

    setup = small_problem()
    setup.setGoal(Empty(setup.getSpaceInformation()))
    status, planner = solve(setup)
    assert (status, "none is given" in str(planner.error)) == ("Invalid goal", True)


def test_a_checker_that_takes_longer_than_the_search_may_ends_it_after_one_call() -> None:
    calls = [0]

    def valid(_: Any) -> bool:
        calls[0] += 1
        time.sleep(0.05)
        return True

    setup = small_problem(valid)
    planner = Recorder(setup.getSpaceInformation())
    setup.setPlanner(planner)
    setup.setup()
    before = calls[0]
    assert str(planner.solve(0.01)) == "Timeout"
    assert "before a goal" in planner.reason
    assert calls[0] == before + 1  # the start; a call that never returns cannot be ended from inside its process


def test_missing_bounds_are_reported_by_solve() -> None:
    setup = small_problem()
    planner = Recorder(setup.getSpaceInformation())
    planner.setProblemDefinition(setup.getProblemDefinition())
    bounds = ob.RealVectorBounds(3)
    bounds.setLow(-np.inf)
    bounds.setHigh(np.inf)
    setup.getStateSpace().setBounds(bounds)
    assert str(planner.solve(0.1)) == "Crash"
    assert "set finite bounds" in str(planner.error)


@pytest.mark.parametrize("seed", [-1, 1.5, "one", True])
def test_a_seed_that_is_no_whole_number_is_refused(seed: Any) -> None:
    with pytest.raises(InputError, match="seed"):
        Recorder(small_problem().getSpaceInformation(), seed=seed)


def test_a_planner_is_freed_with_its_setup() -> None:
    def life() -> weakref.ref[Recorder]:
        setup = small_problem()
        _, planner = solve(setup)
        setup.solve(0.1)
        return weakref.ref(planner)

    ghost = life()
    gc.collect()
    assert ghost() is None


def test_the_frames_of_an_error_are_dropped() -> None:
    class Witness:
        pass

    ghosts: list[weakref.ref[Witness]] = []

    def valid(state: Any) -> bool:
        witness = Witness()
        ghosts.append(weakref.ref(witness))
        raise ValueError("broken")

    _, planner = solve(small_problem(valid))
    assert "broken" in str(planner.error)
    assert ghosts
    assert all(ghost() is None for ghost in ghosts)


def test_motions_are_checked_between_their_ends_even_before_setup() -> None:
    setup = small_problem()
    checker = SpaceChecker(setup.getSpaceInformation())
    through_bar = (np.array([-1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0]))
    assert not checker.motion_valid(*through_bar)
    assert checker.motion_valid(np.array(START), np.array([-1.0, 1.0, 0.0]))
    assert checker.checked_motions == 2


def test_the_space_information_knows_the_bounds() -> None:
    checker = SpaceChecker(small_problem(lambda _: True).getSpaceInformation())
    assert checker.valid(np.array([1.9, 0.0, 0.0]))
    assert not checker.valid(np.array([2.1, 0.0, 0.0]))
    assert checker.checked_states == 2


@pytest.mark.parametrize("kind", ["space", "world"])
def test_a_batch_of_motions_answers_as_one_by_one_and_counts_each(kind: str) -> None:
    rng = np.random.default_rng(0)
    A, B = rng.uniform(-2, 2, (2, 50, 3))
    checker = SpaceChecker(small_problem().getSpaceInformation()) if kind == "space" else WorldChecker(World())
    batch = checker.motion_valid_batch(A, B)
    assert checker.checked_motions == 50
    assert batch.tolist() == [checker.motion_valid(a, b) for a, b in zip(A, B, strict=True)]
    assert 0 < batch.sum() < 50


def test_the_small_problem_has_a_bar_between_start_and_goal() -> None:
    assert outside_bar([0.6, 0.0, 0.0])
    assert not outside_bar([0.0, 0.0, 1.9])
