"""Every result of a search answers the same questions, whether it has found something or not."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from typing import Any, TypeVar

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.lazy import public_values
from rrtik_ompl.model.result import PathResult, Result

Kind = TypeVar("Kind")
QUESTIONS = ("found", "reason", "seconds", "statistics", "require")
ARRAYS = {"ik.IkBatch"}  # arrays of results, whose ``found`` is a mask
HERE = np.array([0.0, -1.6, 1.8, -0.2, 1.6, 0.0])
FAR = rrtik.PositionGoal([9.0, 0.0, 0.0])
UR5 = rrtik.load_robot("ur5")
WORLD = rrtik.World(UR5)
SCENARIO = rrtik.replanning.Scenario.load("replan_planar_arm")


def tip_motion(found: bool) -> rrtik.tip.TipMotion:
    return rrtik.tip.straight(WORLD, HERE, [0.45, 0.11, 0.6] if found else [2.0, 0.1, 0.6])


def ik_result(found: bool) -> rrtik.ik.IkResult:
    return rrtik.solve_ik(UR5, UR5.fk(HERE) if found else FAR)


def ik_trajectory(found: bool) -> rrtik.ik.IkTrajectory:
    end = [0.4, 0.3, 0.4] if found else [0.4, 3.0, 0.4]
    return rrtik.ik.solve_trajectory(UR5, np.linspace([0.4, 0.1, 0.4], end, 4), seconds=2.0)


def task_plan(found: bool) -> rrtik.TaskPlan:
    goals = [HERE + 0.1, HERE if found else FAR]
    return rrtik.Task([rrtik.MoveTo(goal) for goal in goals]).plan(WORLD, HERE, seed=1)


def plan(found: bool) -> rrtik.Plan:
    if found:
        return rrtik.plan(rrtik.Problem(WORLD, HERE, HERE + 0.1))
    return rrtik.plan(rrtik.load_problem("planar3_boxes"), "mbrrt", seconds=1e-3, restarts=0)


def run(found: bool) -> rrtik.replanning.ReplanRun:
    return SCENARIO.run(seconds=20.0 if found else 0.1, speed_bound=3.5, repair_budget=30.0)


def timed_plan(found: bool) -> rrtik.replanning.TimedPlan:
    horizon = 30.0 if found else 0.4
    return rrtik.replanning.plan_in_time(SCENARIO.problem, rate=5.0, speed=1.6, horizon=horizon, seed=1)


MAKERS: dict[str, Callable[[bool], Any]] = {
    "Plan": plan,
    "replanning.ReplanRun": run,
    "replanning.TimedPlan": timed_plan,
    "TaskPlan": task_plan,
    "ik.IkResult": ik_result,
    "ik.IkTrajectory": ik_trajectory,
    "tip.TipMotion": tip_motion,
}


def names_of(kind: type) -> set[str]:
    """The attributes that a class answers: fields, properties and methods."""
    return set(dir(kind)) | ({each.name for each in fields(kind)} if is_dataclass(kind) else set())


def results() -> set[str]:
    """The public classes with ``found`` or ``require``."""
    classes = {name: value for name, value in public_values(rrtik).items() if isinstance(value, type)}
    return {name for name, kind in classes.items() if {"found", "require"} & names_of(kind)}


def test_every_public_result_is_examined_here() -> None:
    assert results() == set(MAKERS) | ARRAYS


@pytest.mark.parametrize("name", sorted(MAKERS))
def test_a_class_of_results_answers_every_question(name: str) -> None:
    assert set(QUESTIONS) <= names_of(public_values(rrtik)[name])


@pytest.mark.parametrize("found", [True, False])
@pytest.mark.parametrize("name", sorted(MAKERS))
def test_a_result_gives_what_was_asked_for_or_raises_its_reason_in_one_line(name: str, found: bool) -> None:
    result = MAKERS[name](found)
    assert isinstance(result, Result)
    assert result.found is found
    assert isinstance(result.reason, str)
    assert type(result.seconds) is float
    assert result.seconds > 0.0
    assert isinstance(result.statistics, Mapping)
    assert all(isinstance(key, str) for key in result.statistics)
    assert "\n" not in repr(result)
    if isinstance(result, PathResult):
        assert result.path is None or isinstance(result.path, rrtik.JointPath)
        assert result.proven in ((True, False, None) if found else (True, None))
    if found:
        assert result.require() is not None
        return
    assert result.reason
    with pytest.raises(rrtik.NotFoundError) as raised:
        result.require()
    assert "\n" not in str(raised.value)
    assert getattr(result, "detail", "") or result.reason in str(raised.value)


def test_an_array_of_results_gives_all_or_says_how_many_are_missing() -> None:
    poses = UR5.fk_batch(np.array([HERE, HERE + 0.1]))
    assert rrtik.solve_ik_many(UR5, poses).require().shape == (2, 6)
    poses[1, 0, 3] = 9.0
    with pytest.raises(rrtik.NotFoundError, match="1 of 2 poses have no configuration; pose 1: unreachable: "):
        rrtik.solve_ik_many(UR5, poses).require()


def wanted(result: Result[Kind]) -> Kind:
    """What a function of any result returns, as type checkers see it."""
    return result.require()


def test_type_checkers_know_what_a_result_gives() -> None:
    path: rrtik.JointPath = wanted(tip_motion(True))
    q: np.ndarray[Any, np.dtype[np.float64]] = wanted(ik_result(True))
    rows: np.ndarray[Any, np.dtype[np.float64]] = wanted(ik_trajectory(True))
    moves: list[PathResult[rrtik.JointPath]] = [plan(True), tip_motion(True), task_plan(True), run(True)]
    assert all(each.path is not None for each in moves)
    timed: PathResult[rrtik.replanning.ReplanRun] = timed_plan(True)
    assert timed.require().found
    assert (path.waypoints.shape[1], q.shape, rows.shape) == (6, (6,), (4, 6))
