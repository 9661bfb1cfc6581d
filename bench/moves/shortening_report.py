"""Measure the ways of [1, ch. 5.3] to shorten a path against the exact shortest route of the same class.

Run: ``python bench/moves/shortening_report.py`` (some minutes). Writes ``bench/reports/shortening.md``; exit code 0
if every bar holds, else 1.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from bench.shared.pages import add_out
from rrtik_bench.report.page import Report
from rrtik_bench.shortening.plane_worlds import PUBLISHED, Plane, generated, sampled_route
from rrtik_ompl import load_problem, plan, shorten
from rrtik_ompl.model.transitions import route_length
from rrtik_ompl.planning.shortening import METHODS, Task
from rrtik_ompl.planning.shortening.corners import snap_corners
from rrtik_ompl.planning.shortening.random_cut import random_cut
from rrtik_ompl.planning.shortening.retraction import retract
from rrtik_ompl.planning.shortening.sequential import sequential_cut

STEP = 1.0  # of the planner in the worlds of 26 x 20
METHODS_MEASURED: dict[str, Callable[[np.ndarray, Task], np.ndarray]] = {
    "raw": lambda route, task: route,
    "sequential": sequential_cut,
    "random 50": lambda route, task: random_cut(route, task, tries=50),
    "random 100": lambda route, task: random_cut(route, task, tries=100),
    "random 200": lambda route, task: random_cut(route, task, tries=200),
    "random 400": lambda route, task: random_cut(route, task, tries=400),
    "retraction": lambda route, task: retract(route, task, step=STEP),
    "retraction / 10": lambda route, task: retract(route, task, step=0.1 * STEP),
    "retraction twice": lambda route, task: retract(retract(route, task, step=STEP)[::-1], task, step=STEP)[::-1],
    "corners": snap_corners,
}
REPEATABLE = ("sequential", "retraction", "corners")
CONFIRMED = ("retraction", "retraction / 10", "retraction twice", "corners")  # their last check counts as questions
PROTOTYPE = (148, 66, 147)  # questions of retraction / 10, measured on other routes by the page's own prototype
LONG_RANDOM = 800  # tries, to find the questions at which random cut is as good as retraction


@dataclass(eq=False)
class Measured:
    """Outcomes in one world: for each method ratios to the class optimum, questions and seconds of every route."""

    plane: Plane
    ratios: dict[str, np.ndarray]
    asked: dict[str, np.ndarray]
    seconds: dict[str, np.ndarray]
    faults: int
    questions_of_equal_random: float
    global_hits: float


def measure(plane: Plane, count: int, *, compare: bool) -> Measured:
    """Run every method on ``count`` sampled routes; ``compare`` also looks for a random cut as good as retraction."""
    routes = [sampled_route(plane, seed, STEP) for seed in range(count)]
    optima = np.array([plane.class_optimum(route) for route in routes])
    ratios, asked, seconds, faults = {}, {}, {}, 0
    for name, method in METHODS_MEASURED.items():
        lengths, questions, times = [], [], []
        for seed, route in enumerate(routes):
            task, begin = Task(plane, seed=seed), time.process_time()
            found = method(route, task)
            times.append(time.process_time() - begin)
            lengths.append(route_length(found))
            questions.append(task.asked + (task.confirmed_again if name in CONFIRMED else 0))
            faults += not _sound(plane, route, found)
            if name in REPEATABLE:
                faults += not np.array_equal(found, method(route, Task(plane, seed=seed + 1)))
        ratios[name], asked[name], seconds[name] = np.array(lengths) / optima, np.array(questions), np.array(times)
    equal = _questions_of_equal_random(plane, routes, optima, ratios["retraction"].mean()) if compare else np.nan
    hits = _global_hits(ratios["retraction"] * optima, plane) if compare else np.nan
    return Measured(plane, ratios, asked, seconds, faults, equal, hits)


def _sound(plane: Plane, route: np.ndarray, found: np.ndarray) -> bool:
    """Whether ends are the same to the bit, no section collides, and the route has not become longer."""
    ends = np.array_equal(found[[0, -1]], route[[0, -1]])
    return ends and route_length(found) <= route_length(route) and all(plane.free(a, b) for a, b in pairwise(found))


def _questions_of_equal_random(plane: Plane, routes: list[np.ndarray], optima: np.ndarray, wanted: float) -> float:
    """Questions per route after which the mean of random cut is as good as ``wanted``, or that were not enough."""
    budget = np.arange(0, LONG_RANDOM + 1)
    total = np.zeros(len(budget))
    for seed, route in enumerate(routes):
        task = Task(plane, seed=seed)
        steps = [(0, route_length(route))]
        task._on_better = lambda rows, task=task, steps=steps: steps.append((task.asked, route_length(rows)))
        random_cut(route, task, tries=LONG_RANDOM)
        questions, lengths = (np.array(column) for column in zip(*steps, strict=True))
        total += lengths[np.searchsorted(questions, budget, side="right") - 1] / optima[seed]
    good = np.flatnonzero(total / len(routes) <= wanted)
    return float(good[0]) if len(good) else float(LONG_RANDOM)


def _global_hits(lengths: np.ndarray, plane: Plane, inputs: int = 10, draws: int = 200) -> float:
    """How often the best of several retracted routes is within 1 % of the best known class."""
    best = min(plane.shortest.values())
    rng = np.random.default_rng(0)
    return float(np.mean([lengths[rng.choice(len(lengths), inputs)].min() < 1.01 * best for _ in range(draws)]))


def bars(worlds: list[Measured], others: list[Measured]) -> list[tuple[str, str, str, bool]]:
    """The acceptance rows: what, the bar, what was measured, whether it holds."""
    everything = worlds + others

    def column(name: str, source: list[Measured], of: str = "ratios") -> list[np.ndarray]:
        return [getattr(world, of)[name] for world in source]

    plain, fine = column("retraction", worlds), column("retraction / 10", worlds)
    cut = column("sequential", worlds)
    hundred = column("random 100", worlds)
    worse_cut = np.concatenate([c > r for c, r in zip(cut, plain, strict=True)])
    worse_random = [float(np.mean(h > r)) for h, r in zip(hundred, plain, strict=True)]
    shares = [float(w.asked["retraction"].mean() / w.questions_of_equal_random) for w in worlds]
    taut = [(w.ratios["corners"].mean(), w.asked["corners"].mean()) for w in worlds]
    to_beat = [w.asked["retraction / 10"].mean() for w in worlds]
    seconds = max(float(w.seconds["retraction"].mean()) for w in worlds)
    all_plain = np.concatenate(column("retraction", everything))
    faults = sum(world.faults for world in everything)
    return [
        ("valid, ends kept, never longer, repeatable", "no fault", f"{faults} faults", faults == 0),
        ("retraction, mean", "1.02", _list(r.mean() for r in plain), max(r.mean() for r in plain) <= 1.02),
        ("retraction / 10, mean", "1.003", _list(r.mean() for r in fine), max(r.mean() for r in fine) <= 1.003),
        ("retraction, worst", "1.06", _list(r.max() for r in plain), max(r.max() for r in plain) <= 1.06),
        ("retraction, generated worlds, mean", "1.02", f"{all_plain.mean():.4f}", all_plain.mean() <= 1.02),
        (
            "sequential, mean",
            "1.02 to 1.15",
            _list(r.mean() for r in cut),
            all(1.02 <= r.mean() <= 1.15 for r in cut),
        ),
        ("sequential worse than retraction", "90 %", f"{worse_cut.mean():.0%}", worse_cut.mean() >= 0.9),
        (
            "random 100 worse than retraction",
            "75 % each, 85 % of all",
            ", ".join(f"{share:.0%}" for share in worse_random),
            min(worse_random) >= 0.75 and np.mean(worse_random) >= 0.85,
        ),
        ("questions, of those of an equally good random cut", "0.5", _list(shares), max(shares) <= 0.5),
        (
            "mean of corners beside retraction, with its questions",
            f"1.0005 with fewer than retraction / 10: {', '.join(f'{asked:.0f}' for asked in to_beat)}",
            ", ".join(f"{mean:.5f} ({asked:.0f})" for mean, asked in taut),
            all(mean <= 1.0005 and asked < most for (mean, asked), most in zip(taut, to_beat, strict=True)),
        ),
        (
            "best of 10 inputs within 1 % of the best class",
            "90 %",
            ", ".join(f"{w.global_hits:.0%}" for w in worlds),
            min(w.global_hits for w in worlds) >= 0.9,
        ),
        ("50 times as fast as the published 2.14 s", "43 ms", f"{1e3 * seconds:.0f} ms", seconds <= 2.14 / 50),
    ]


def arm_rows(name: str, count: int) -> tuple[list[list[str]], int]:
    """A scene with a 6R arm: mean length and seconds of every method on RRT-Connect's paths, and the faults."""
    problem = load_problem(name)
    found = [plan(problem, "RRTConnect", seconds=5.0, seed=seed).path for seed in range(count)]
    paths = [path for path in found if path is not None]
    lines, faults = [["raw", f"{np.mean([path.length for path in paths]):.3f}", "", ""]], 0
    for method, details in METHODS.items():
        if details.moves_only:
            continue  # these paths move all joints at once
        begin = time.perf_counter()
        short = [shorten(path, problem, method=method) for path in paths]
        seconds = (time.perf_counter() - begin) / len(paths)
        wrong = sum(
            bool(new.violations(problem.world))
            or not np.array_equal(new.waypoints[[0, -1]], old.waypoints[[0, -1]])
            or (new.length > old.length and not details.keeps_moves)
            for new, old in zip(short, paths, strict=True)
        )
        faults += wrong
        length = np.mean([path.length for path in short])
        lines.append([method, f"{length:.3f}", f"{1e3 * seconds:.0f}", str(wrong)])
    return lines, faults


def _list(values: object) -> str:
    return ", ".join(f"{value:.4f}" for value in values)  # type: ignore[attr-defined]


def world_table(report: Report, worlds: list[Measured]) -> None:
    rows = []
    for method in METHODS_MEASURED:
        cells = [
            f"{w.ratios[method].mean():.4f}, {w.ratios[method].max():.4f}, {w.asked[method].mean():.0f}, "
            f"{1e3 * w.seconds[method].mean():.1f}"
            for w in worlds
        ]
        rows.append([method, *cells])
    heads = ("method", *(f"{world.plane.name}: mean, worst, questions, ms" for world in worlds))
    report.table("Methods", heads, rows)
    asked, prototype = ([f"{n:.0f}" for n in row] for row in ([w.asked["corners"].mean() for w in worlds], PROTOTYPE))
    report.note(
        "",
        f"The page's prototype of retraction / 10 asked {', '.join(prototype)} times, on routes of its own; "
        f"corners ask {', '.join(asked)} times here.",
    )


def main() -> int:
    """Measure, print and write the report."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--paths", type=int, default=40, help="routes in each published world")
    parser.add_argument("--worlds", type=int, default=50, help="generated worlds, two routes each")
    parser.add_argument("--arm-paths", type=int, default=10)
    add_out(parser, "shortening.md")
    options = parser.parse_args()
    worlds = [measure(make(), options.paths, compare=True) for make in PUBLISHED.values()]
    others = [measure(generated(seed), 2, compare=False) for seed in range(options.worlds)]
    about = (
        f"{options.paths} routes of RRT-Connect (step {STEP:g}) in each of three worlds of 26 x 20, two in each of "
        f"{options.worlds} generated ones; seeds 0, 1, ... Ratio to the exact shortest route of the class; questions "
        "are motions asked about (of retraction and corners those of the last check too); CPU time."
    )
    title = "Shortening: published methods against the shortest route of the class"
    report = Report(title, "python bench/moves/shortening_report.py", intro=about)
    for row in bars(worlds, others):
        report.bar(*row)
    world_table(report, worlds)
    arm, faults = arm_rows("titan4_sdu", options.arm_paths)
    text = "Paths of RRT-Connect, `shorten()` with both checks."
    report.table("TITAN-4 at the SDU", ("method", "mean length [rad]", "ms", "faults"), arm, text=text)
    return report.finish(options.out) or int(faults > 0)


if __name__ == "__main__":
    raise SystemExit(main())
