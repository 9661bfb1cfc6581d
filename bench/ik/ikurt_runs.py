"""Runs of IKURT and of the ways beside it for the IKURT report; times are of the processor."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from ompl import geometric as og

import rrtik_ompl as rrtik
from bench.ik import ikurt_cases as cases
from rrtik_bench.ikurt import as_published, metric_of
from rrtik_ompl.ik.ikurt.metric import TipMetric
from rrtik_ompl.ik.ikurt.published import PublishedSearch, Steps
from rrtik_ompl.ik.ikurt.search import BatchedSearch, IkurtValidity, Options
from rrtik_ompl.model.goal import PoseGoal
from rrtik_planners import IKURT, FastRRTConnect, IKURTPublished

POSE_SECONDS, PANDA_SECONDS, BLOCKED_SECONDS = 2.0, 1.0, 1.0
LITERAL, IMPROVED, PLAIN = "literal", "improved", "no Jacobian"
VARIANTS = {LITERAL: IKURTPublished, IMPROVED: IKURT}


@dataclass
class IkurtRun:
    """One plan: its processor and wall time, how far its end is from the goal in the published metric, if sound."""

    found: bool
    statistics: Mapping[str, float]
    limit: float
    seconds: float
    elapsed: float
    away: float = np.inf
    sound: bool = True

    @property
    def solved(self) -> bool:
        """Whether there is a path, within the limit of processor time."""
        return self.found and self.seconds <= self.limit

    @property
    def metres(self) -> float:
        """From the goal to the tip at the end of the path."""
        return float(self.statistics.get("position_error", np.inf))

    def count(self, name: str) -> float:
        """A count of the planner's, or its seconds."""
        return self.seconds if name == "seconds" else float(self.statistics.get(name, 0))


def run(problem: Any, planner: Any, seed: int, limit: float, stretch: float, **parameters: Any) -> IkurtRun:
    begin = time.process_time()
    plan = rrtik.plan(problem, planner, seconds=limit * stretch, seed=seed, parameters=parameters)
    taken = limit, time.process_time() - begin, plan.seconds
    if plan.path is None:
        return IkurtRun(False, dict(plan.statistics), *taken)
    sound = not plan.path.violations(problem.world) and bool((plan.path.start == problem.start).all())
    away = float(metric_of(problem).distance(plan.path.end[None])[0])
    return IkurtRun(True, dict(plan.statistics), *taken, away, sound)


def example_runs(name: str, which: str, first: int, end: int, limit: float, stretch: float) -> list[IkurtRun]:
    """An example by one variant, for the seeds from ``first`` to before ``end``."""
    problem = rrtik.load_problem(name)
    run(problem, IKURT, 0, limit, stretch)  # whatever is loaded at the first question is no part of planning
    asked = problem if which == IMPROVED else as_published(problem)
    parameters = {"jacobian": False} if which == PLAIN else {}
    return [run(asked, VARIANTS.get(which, IKURT), k, limit, stretch, **parameters) for k in range(first, end)]


def blocked_runs(which: str, stretch: float) -> list[IkurtRun]:
    """A goal that no free configuration reaches."""
    return [run(cases.blocked(), VARIANTS[which], seed, BLOCKED_SECONDS, stretch) for seed in range(5)]


def literal_falls() -> tuple[bool, int]:
    """Whether every vertex that CONNECT has added is nearer than the one before it, and how many these are."""
    problem = as_published(rrtik.load_problem("planar6_c_pose"))
    metric, until = metric_of(problem), time.monotonic() + 2.0
    (lower, upper), rng = problem.robot.finite_range(), np.random.default_rng(0)
    steps = Steps(0.15, 0.5, metric.radius)
    search = PublishedSearch(
        metric, steps, lower, upper, problem.world.motion_valid, lambda: time.monotonic() > until, rng, problem.start
    )
    return falls(search)


def improved_falls() -> tuple[bool, int]:
    """The same of the improved one, without descents, which would need no CONNECT."""
    problem = rrtik.load_problem("planar6_c_pose")
    assert isinstance(problem.goal, PoseGoal)
    metric, until = TipMetric(problem.robot, [problem.goal]), time.monotonic() + 2.0
    (lower, upper), rng = problem.robot.finite_range(), np.random.default_rng(0)
    validity = IkurtValidity(
        problem.world.valid_batch, problem.world.motion_valid_batch, lambda: time.monotonic() > until
    )
    options = Options(0.15, 0.6, jacobian=False, most_vertices=10_000)
    return falls(BatchedSearch(metric, options, lower, upper, validity, rng, problem.start[None]))


def falls(search: Any) -> tuple[bool, int]:
    held, added, connect = [], [0], search._connect

    def watched(vertex: int) -> Any:
        before = search.tree.size
        outcome = connect(vertex)
        new = search.tree.distance[before:]
        held.append(bool((np.diff(np.append(search.tree.distance[vertex], new)) < 0.0).all()))
        added[0] += len(new)
        return outcome

    search._connect = watched
    search.run()
    return all(held), added[0]


def two_steps(problem: Any, seconds: float, seed: int) -> bool:
    """The nearest free solution of inverse kinematics, then RRT-Connect to that one alone."""
    ik = rrtik.solve_ik(
        problem.robot, problem.goal, near=problem.start, world=problem.world, seconds=seconds, seed=seed
    )
    if not ik.found:
        return False
    joints = rrtik.Problem(problem.world, problem.start, ik.solutions[0])
    return rrtik.plan(joints, og.RRTConnect, seconds=seconds, seed=seed).found


WAYS = {
    "IKURT": IKURT,
    "RRT-Connect to goals from IK (OMPL's)": og.RRTConnect,
    "FastRRTConnect (kernel) to goals from IK": FastRRTConnect,
    "two steps: IK, then RRT-Connect (OMPL's)": None,
}


def beside(problems: Iterable[Any], limit: float, stretch: float) -> tuple[int, list[list[str]]]:
    """How many problems, and solved share and times of each way; one problem after the other, each by all."""
    outcomes: dict[str, list[float]] = {name: [] for name in WAYS}
    for number, problem in enumerate(problems):
        for world in (problem.world, problem.world.with_accuracy("conservative")):
            world.motion_valid(problem.start, problem.start + 1e-3)  # loads covers and kernels
        for name, planner in WAYS.items():
            begin = time.process_time()
            if planner is None:
                found = two_steps(problem, limit * stretch, number)
            else:
                found = rrtik.plan(problem, planner, seconds=limit * stretch, seed=number).found
            taken = time.process_time() - begin
            outcomes[name].append(taken if found and taken <= limit else np.inf)
    rows = []
    for name, each in outcomes.items():
        solved = int(np.isfinite(each).sum())
        share = f"{solved} of {len(each)} ({100 * solved / len(each):.1f} %)"
        capped = np.minimum(each, limit)
        rows.append([name, share, f"{np.median(capped):.3f}", f"{capped.mean():.3f}"])
    return len(next(iter(outcomes.values()))), rows


def generated(arm: str, count: int, stretch: float) -> tuple[int, list[list[str]]]:
    """All ways on generated poses of an arm."""
    return beside(cases.generated(arm, count), POSE_SECONDS, stretch)


def panda(folder: Path, count: int, stretch: float) -> tuple[int, list[list[str]]]:
    """All ways on problems of MotionBenchMaker."""
    return beside(cases.panda_problems(folder, count), PANDA_SECONDS, stretch)
