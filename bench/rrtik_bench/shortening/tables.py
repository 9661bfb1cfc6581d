"""Sequential cut, random cut and retraction [1, ch. 5.3], and the route of the pilot's tool [1, ch. 6]."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

import rrtik_ompl as rrtik
from rrtik_bench.report.rows import Row, verdict
from rrtik_bench.shortening.plane_worlds import PUBLISHED, Plane, sampled_route
from rrtik_bench.tables import Table
from rrtik_ompl.arrays import Matrix
from rrtik_ompl.shortening.random_cut import random_cut
from rrtik_ompl.shortening.retraction import retract
from rrtik_ompl.shortening.sequential import sequential_cut
from rrtik_ompl.shortening.task import Task
from rrtik_ompl.transitions import route_length

STEP = 1.0  # of the planner
Method: TypeAlias = Callable[[Matrix, Task], Matrix]
METHODS: dict[str, Method] = {
    "sequential": sequential_cut,
    "random 100": lambda route, task: random_cut(route, task, tries=100),
    "random 400": lambda route, task: random_cut(route, task, tries=400),
    "retraction": lambda route, task: retract(route, task, step=STEP),
}
WORLDS = "three worlds with known coordinates in place of the lost one; length over the shortest of the same class"


@dataclass(frozen=True, slots=True)
class Outcome:
    """Of one method: mean ratio to the shortest route of the class, mean questions, and CPU time [s] of a route."""

    ratio: float
    questions: float
    seconds: float


def _outcome(method: Method, cases: list[tuple[Plane, Matrix]]) -> Outcome:
    ratios, questions, begin = [], [], time.process_time()
    for seed, (plane, route) in enumerate(cases):
        task = Task(plane, seed=seed)
        ratios.append(route_length(method(route, task)) / plane.class_optimum(route))
        questions.append(task.asked + task.confirmed_again)
    took = (time.process_time() - begin) / len(cases)
    return Outcome(float(np.mean(ratios)), float(np.mean(questions)), took)


def shortening(quick: bool) -> list[Row]:
    """Sequential, random cut and retraction on the same routes."""
    planes: list[Plane] = [make() for make in PUBLISHED.values()]
    cases = [(plane, sampled_route(plane, seed, STEP)) for plane in planes for seed in range(5 if quick else 40)]
    for plane, route in cases:
        plane.class_optimum(route)  # known from here on, so that no method's time holds its search
    found = {name: _outcome(method, cases) for name, method in METHODS.items()}
    cut, hundred, long, pulled = (found[name] for name in ("sequential", "random 100", "random 400", "retraction"))
    times = f"{1e3 * cut.seconds:.1f} ms", f"{1e3 * hundred.seconds:.1f} ms", f"{1e3 * pulled.seconds:.1f} ms"
    faster = "an interpreted program on an old machine was printed"
    return [
        Row("sequential: time", "0.94 s", times[0], verdict(cut.seconds < 0.94), faster),
        Row("random cut, n = 100: time", "about the same as sequential", times[1],
            verdict(hundred.questions < 4.0 * cut.questions, True), "in questions: "
            f"{hundred.questions:.0f} beside {cut.questions:.0f}"),
        Row("retraction: time", "2.14 s", times[2], verdict(pulled.seconds < 2.14), faster),
        Row("sequential: length", "not optimal", f"{cut.ratio:.4f}", verdict(cut.ratio > 1.02), WORLDS),
        Row("random cut, n = 100: length", "far from optimal", f"{hundred.ratio:.4f}", verdict(hundred.ratio > 1.02),
            WORLDS),
        Row("random cut, larger n: length", "near the shortest", f"{long.ratio:.4f} (n = 400)",
            verdict(long.ratio < 1.03), "the values of n are lost; " + WORLDS),
        Row("retraction: length", "near the shortest", f"{pulled.ratio:.4f}", verdict(pulled.ratio <= 1.02), WORLDS),
        Row("retraction faster than random cut of equal quality", "yes",
            f"{pulled.questions:.0f} questions beside {long.questions:.0f} (n = 400)",
            verdict(pulled.questions < long.questions)),
    ]  # fmt: skip


def pilots_route(quick: bool) -> list[Row]:
    """The time of one route of the pilot's tool of [1, ch. 6]: RRT-Connect, then sequential cut."""
    problem = rrtik.load_problem("titan4_sdu")
    search, cut = [], []
    for seed in range(5 if quick else 25):
        plan = rrtik.plan(problem, "RRTConnect", seconds=10.0, seed=seed)
        if plan.path is None:
            continue
        begin = time.perf_counter()
        rrtik.shorten(plan.path, problem, method="sequential")
        cut.append(time.perf_counter() - begin)
        search.append(plan.seconds)
    ours = float(np.median(search)), float(np.median(cut))
    reading = "the scene is not known: TITAN-4 at the subsea unit; median; with the library's second check"
    return [
        Row("search", "0.556 s", f"{ours[0]:.3f} s", verdict(ours[0] <= 0.556, True), reading),
        Row("shortening", "0.519 s", f"{ours[1]:.3f} s", verdict(ours[1] <= 0.519, True), reading),
        Row("search and shortening", "1.08 s", f"{sum(ours):.3f} s", verdict(sum(ours) <= 1.08, True), reading),
    ]


TABLES = (
    Table("shortening-4", "Sequential cut, random cut, retraction", "[1, ch. 5.3], table of the three methods",
          shortening, 20, 4),
    Table("pilot-route", "Time of a route in the pilot's tool of [1, ch. 6]", "[1, ch. 6]",
          pilots_route, 1, 1),
)  # fmt: skip
