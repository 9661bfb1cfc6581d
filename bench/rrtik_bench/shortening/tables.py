"""Sequential cut, random cut and retraction [1, ch. 5.3], and the route of the pilot's tool [1, ch. 6]."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

import rrtik_ompl as rrtik
from rrtik_bench.report.rows import Bar, Row, exactly, judged
from rrtik_bench.shortening.plane_worlds import PUBLISHED, Plane, sampled_route
from rrtik_bench.tables import Table
from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.model.transitions import part_counts, route_length, subdivided
from rrtik_ompl.planning.shortening.cuts import random_cut, sequential_cut
from rrtik_ompl.planning.shortening.retraction import retract
from rrtik_ompl.planning.shortening.task import Task, Wishes

STEP = 1.0  # of the planner
Method: TypeAlias = Callable[[Matrix, Task], Matrix]
METHODS: dict[str, Method] = {
    "sequential": sequential_cut,
    "sequential, from the goal": lambda route, task: sequential_cut(route[::-1], task)[::-1],
    "sequential, points between": lambda route, task: sequential_cut(dense(route, STEP / 4.0), task),
    "random 100": lambda route, task: random_cut(route, task, tries=100),
    "random 400": lambda route, task: random_cut(route, task, tries=400),
    "retraction": lambda route, task: retract(route, task, step=STEP),
}
OLD = "an interpreted program on an old machine was printed"
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
        task = Task(plane, Wishes(Budget(seed)))
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
    back, fine = (found[name] for name in ("sequential, from the goal", "sequential, points between"))
    times = f"{1e3 * cut.seconds:.1f} ms", f"{1e3 * hundred.seconds:.1f} ms", f"{1e3 * pulled.seconds:.1f} ms"
    quality = long.ratio >= pulled.ratio
    return [
        Row("sequential: time", "0.94 s", times[0], None, OLD),
        Row("retraction: time", "2.14 s", times[2], None, OLD),
        _ratio("random cut, n = 100: questions over those of sequential", "about the same time",
               hundred.questions / cut.questions, Bar((0.0, 100.0), held=(0.5, 2.0), differs=(2.0, 4.0)),
               f"{times[1]} beside {times[0]}; {hundred.questions:.0f} beside {cut.questions:.0f} questions"),
        _ratio("sequential: length", "not optimal", cut.ratio, Bar((0.9, 10.0), (1.02, 1.3), differs=(1.005, 1.02))),
        _ratio("random cut, n = 100: length", "far from optimal", hundred.ratio,
               Bar((0.9, 10.0), held=(1.02, 1.3), differs=(1.01, 1.02))),
        _ratio("random cut, larger n: length", "near the shortest", long.ratio, Bar((0.9, 10.0), held=(0.97, 1.03)),
               f"the values of n are lost, 400 here; {WORLDS}"),
        _ratio("retraction: length", "near the shortest", pulled.ratio, Bar((0.9, 10.0), held=(1.0, 1.02))),
        _ratio("retraction: questions over those of a random cut of equal quality", "faster",
               pulled.questions / long.questions if quality else np.nan, Bar((0.0, 100.0), held=(0.0, 1.0)),
               f"n = 400: {pulled.questions:.0f} beside {long.questions:.0f}, lengths {pulled.ratio:.4f} and "
               f"{long.ratio:.4f}"),
        _ratio("sequential from the goal: length over that from the start", "no evidence that it helps",
               back.ratio / cut.ratio, Bar((0.0, 10.0), held=(0.95, 1.05), differs=(0.8, 0.95)), WORLDS),
        _ratio("sequential with points between: length over that without", "better", fine.ratio / cut.ratio,
               Bar((0.0, 10.0), held=(0.5, 0.999)), "points every quarter of the planner's step"),
        _ratio("the same: questions", "a cost", fine.questions / cut.questions, Bar((0.0, 100.0), held=(1.5, 10.0)),
               f"{fine.questions:.0f} beside {cut.questions:.0f}"),
        *_constant(cases[0]),
    ]  # fmt: skip


def dense(route: Matrix, step: float) -> Matrix:
    """A route with further points, none farther than ``step`` from the next."""
    points, _ = subdivided(route, part_counts(route, step))
    return points


def _ratio(name: str, published: str, value: float, bar: Bar, reading: str = WORLDS) -> Row:
    return judged(name, published, f"{value:.4g}", value, bar, reading)


def _constant(case: tuple[Plane, Matrix]) -> list[Row]:
    """How much the work on one route varies with the seed."""
    plane, route = case
    asked: dict[str, list[int]] = {"retraction": [], "random 100": []}
    for name, counts in asked.items():
        for seed in range(10):
            task = Task(plane, Wishes(Budget(seed)))
            METHODS[name](route, task)
            counts.append(task.asked + task.confirmed_again)
    spread = {name: max(counts) - min(counts) for name, counts in asked.items()}
    texts = {name: f"{min(counts)} to {max(counts)} questions" for name, counts in asked.items()}
    reading = "one route, ten seeds; questions, of which the time consists"
    return [
        judged("retraction: time for one route", "constant", texts["retraction"], spread["retraction"],
               exactly(0, 1000), reading),
        judged("random cut: time for one route", "varies", texts["random 100"], spread["random 100"],
               Bar((0.0, 1000.0), held=(1.0, 1000.0)), reading),
    ]  # fmt: skip


def pilots_route(quick: bool) -> list[Row]:
    """The time of one route of the pilot's tool of [1, ch. 6]: RRT-Connect, then sequential cut."""
    problem = rrtik.load_problem("titan4_sdu")
    search, cut = [], []
    for seed in range(5 if quick else 25):
        plan = rrtik.plan(problem, "RRTConnect", seconds=10.0, seed=seed, shorten=False)
        if plan.path is None:
            continue
        begin = time.perf_counter()
        rrtik.shorten(plan.path, problem, method="sequential")
        cut.append(time.perf_counter() - begin)
        search.append(plan.seconds)
    ours = float(np.median(search)), float(np.median(cut))
    reading = "another machine; the scene is not known: TITAN-4 at the subsea unit; median, with the second check"
    return [
        Row("search", "0.556 s", f"{ours[0]:.3f} s", None, reading),
        Row("shortening", "0.519 s", f"{ours[1]:.3f} s", None, reading),
        judged("shortening over search", "0.93", f"{ours[1] / ours[0]:.2f}", ours[1] / ours[0],
               Bar((0.0, 1e3), held=(0.3, 3.0), differs=(0.01, 10.0)), "shares of one run, on one machine"),
    ]  # fmt: skip


TABLES = (
    Table("shortening-4", "Sequential cut, random cut, retraction", "[1, ch. 5.3], table of the three methods",
          shortening, 20, 4),
    Table("pilot-route", "Time of a route in the pilot's tool of [1, ch. 6]", "[1, ch. 6]",
          pilots_route, 1, 1),
)  # fmt: skip
