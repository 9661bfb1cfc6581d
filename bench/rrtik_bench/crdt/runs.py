"""One problem, many seeds: BiCRDT, then each stage of the post-processing, with everything that the bars ask for."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np

import rrtik_ompl as rrtik
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.transitions import route_length, single_joint, transitions
from rrtik_ompl.planning.moves.axis_cut import axis_cut, axis_cut_rounds, double_axis_cut
from rrtik_ompl.world.problem import Problem

STAGES = ("raw", "pass 1", "pass 2", "extra rounds")


@dataclass(frozen=True)
class RouteRun:
    """One plan and its post-processing; the lists follow STAGES."""

    iterations: int
    routes: list[np.ndarray]
    search_seconds: float  # plan() with its own second check
    post_seconds: float  # the double pass
    search_motions: int
    post_motions: int
    sound: bool  # every stage: one joint at a time, valid at half resolution, ends exact
    withdrawn: int  # stages that the second check rejected; as in shorten(), the raw route stands for them

    @property
    def moves(self) -> list[int]:
        """Transitions of each stage."""
        return [transitions(route) for route in self.routes]

    @property
    def lengths(self) -> list[float]:
        """Length of each stage [rad]."""
        return [route_length(route) for route in self.routes]


class CountedMotions:
    """Counts the motions that the post-processing asks for."""

    def __init__(self, world: Any) -> None:
        self.world = world
        self.count = 0

    def __call__(self, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
        """Which motions are free."""
        self.count += len(starts)
        free: np.ndarray = self.world.motion_valid_batch(starts, ends)
        return free


def route_run(problem: Problem, seed: int) -> RouteRun:
    """Plan with BiCRDT and cut."""
    plan = rrtik.plan(problem, planner="bicrdt", seconds=60.0, seed=seed, shorten=False)
    if plan.path is None:
        raise SystemExit(f"{problem.name}, seed {seed}: {plan.reason}")
    motions, raw, begin = CountedMotions(problem.world), plan.path.waypoints, perf_counter()
    twice = double_axis_cut(raw, motions)
    post_seconds = perf_counter() - begin
    test = problem.world.motion_valid_batch
    stages = [raw, axis_cut(raw, test), twice, axis_cut_rounds(raw, test, budget=Budget(seed))]
    passed = [sound(problem, route) for route in stages]
    routes = [route if ok else raw for route, ok in zip(stages, passed, strict=True)]
    return RouteRun(
        int(plan.statistics["iterations"]),
        routes,
        plan.seconds,
        post_seconds,
        int(plan.statistics["checked_motions"]),
        motions.count,
        all(sound(problem, route) for route in routes),
        passed.count(False),
    )


def sound(problem: Problem, route: np.ndarray) -> bool:
    """Whether a route moves one joint at a time, is valid at half resolution and has the ends of the problem."""
    ends = (route[0] == problem.start).all() and problem.goal.distance(problem.robot, route[-1:]).max() == 0.0
    valid = not JointPath.of(problem.world.robot, route).violations(problem.world)
    return bool(ends and valid and single_joint(route))


def share(items: list[Any], wanted: Callable[[Any], bool]) -> float:
    """Share of the items for which ``wanted`` is true."""
    return sum(bool(wanted(item)) for item in items) / max(len(items), 1)


def joints_of(route: np.ndarray) -> tuple[int, ...]:
    """Which joint each edge of a route moves, counted from 1."""
    return tuple((np.diff(route, axis=0) != 0.0).argmax(axis=1) + 1)


def histogram(values: list[int]) -> str:
    """``3: 60 %, 5: 40 %``."""
    counts = Counter(values)
    return ", ".join(f"{value}: {100 * counts[value] / len(values):.0f} %" for value in sorted(counts))
