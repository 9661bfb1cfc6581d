"""OMPL's Benchmark with planners of both, its statistics script, and the curves of Planner Arena's progress page.

Usage: ``python bench/planning/progress.py [--problem titan4_sdu] [--runs 5] [--seconds 1]``. The picture is drawn from
the database that OMPL's own script makes of the log, the one that Planner Arena reads: the median of the best cost over
the runs at each time, as its progress page shows it.
"""

from __future__ import annotations

import argparse
import sqlite3
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from ompl import geometric as og
from ompl import tools as ot
from ompl import util as ou

import rrtik_ompl as rrtik
from bench.shared.pages import add_out
from rrtik_bench.report.page import Report
from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.viewer.plots.joints import COLORS, DASHES, save_figure, tidy
from rrtik_planners import BiCRDT, FastAORRTC, FastRRTConnect, RestartShorten

OURS = (RestartShorten, FastAORRTC, FastRRTConnect, BiCRDT)
THEIRS = (og.RRTstar, og.InformedRRTstar)
PICTURE = "progress.png"
ENDLESS = 10**9  # plans in vain, so that planners go on until their time is up


def database(folder: Path, problem: rrtik.Problem, runs: int, seconds: float) -> Path:
    """Run the benchmarks, and let OMPL's script make a database of their logs."""
    logs = [_log(folder, problem, OURS, runs, seconds)]
    logs += [_log(folder, problem, (planner,), runs, seconds) for planner in THEIRS]
    made = folder / "progress.db"
    ot.readBenchmarkLog(str(made), [str(log) for log in logs], False)
    return made


def _log(folder: Path, problem: rrtik.Problem, planners: Sequence[Any], runs: int, seconds: float) -> Path:
    setup = rrtik.simple_setup(problem)
    si = setup.getSpaceInformation()
    benchmark = ot.Benchmark(setup, problem.name)
    for planner in planners:
        made = planner(si, world=problem.world, seed=1) if planner in OURS else planner(si)
        if planner in (RestartShorten, FastAORRTC):
            made.set("patience", ENDLESS)
        benchmark.addPlanner(made)
    notes = rrtik.BenchmarkNotes(benchmark)
    benchmark.benchmark(ot.Request(seconds, 8192.0, runs, 0.05, False, False, False))
    notes.write()
    log = folder / f"{planners[0].__name__}.log"
    benchmark.saveResultsToFile(str(log))
    return log


def curves(file: Path) -> dict[str, list[Matrix]]:
    """Of each planner and run, rows of time [s] and best cost, from the database."""
    query = (
        "SELECT plannerConfigs.name, runs.id, progress.time, progress.best_cost FROM progress "
        "JOIN runs ON progress.runid = runs.id JOIN plannerConfigs ON runs.plannerid = plannerConfigs.id "
        "WHERE progress.best_cost IS NOT NULL ORDER BY runs.id, progress.time"
    )
    rows: dict[str, dict[int, list[tuple[float, float]]]] = {}
    with sqlite3.connect(file) as connection:
        for name, run, at, cost in connection.execute(query):
            if np.isfinite(cost):
                rows.setdefault(name.removeprefix("geometric_"), {}).setdefault(run, []).append((at, cost))
    return {name: [np.array(run) for run in of.values()] for name, of in rows.items()}


def median(runs: list[Matrix], count: int, times: Vector) -> Vector:
    """Median of the best cost at each time, +inf where less than half of so many runs have a path."""
    costs = np.full((count, len(times)), np.inf)
    for row, run in zip(costs, runs, strict=False):
        last = np.searchsorted(run[:, 0], times, side="right") - 1
        row[last >= 0] = np.minimum.accumulate(run[:, 1])[last[last >= 0]]
    middle: Vector = np.median(costs, axis=0)
    return middle


def draw(middles: dict[str, Vector], times: Vector, file: Path, title: str) -> None:
    """The picture."""
    figure = Figure(figsize=(7.0, 4.2), layout="constrained")
    axes = figure.subplots()
    for k, (name, middle) in enumerate(sorted(middles.items(), key=lambda each: each[1][-1])):
        shown = np.isfinite(middle)
        style: dict[str, Any] = {"color": COLORS[k % len(COLORS)], "linestyle": DASHES[k // len(COLORS) % len(DASHES)]}
        if shown.any():
            axes.step(times[shown], middle[shown], where="post", label=name, **style)
    axes.set(xscale="log", yscale="log", title=title)
    axes.set(xlabel="time [s]", ylabel="best cost: length in joint space [rad]")
    tidy(axes)
    axes.legend(frameon=False)
    save_figure(figure, file, dpi=110)


def main() -> int:
    """Measure, draw and write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--problem", default="titan4_sdu")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=1.0)
    add_out(parser, "progress.md")
    given = parser.parse_args()
    ou.setLogLevel(ou.LogLevel.LOG_NONE)
    problem = rrtik.load_problem(given.problem)
    for planner in OURS:
        rrtik.plan(problem, planner, seed=1, seconds=0.5)  # loads what is used
    with TemporaryDirectory() as folder:
        found = curves(database(Path(folder), problem, given.runs, given.seconds))
    times = np.geomspace(1e-3, given.seconds, 200)
    middles = {name: median(runs, given.runs, times) for name, runs in found.items()}
    out = Path(given.out)
    draw(middles, times, out.with_name(PICTURE), f"{given.problem}: median of {given.runs} runs")
    report = Report("Progress in OMPL's Benchmark", "python bench/planning/progress.py")
    ours = [planner.__name__ for planner in OURS]
    there = sum(name in found for name in ours)
    report.bar("planners of ours with progress in the database", str(len(ours)), str(there), there == len(ours))
    moments = [moment for moment in (0.003, 0.01, 0.03, 0.1, 0.3, 1.0) if moment <= given.seconds]
    rows = []
    for name, middle in sorted(middles.items(), key=lambda each: each[1][-1]):
        at = [middle[np.searchsorted(times, moment, side="right") - 1] for moment in moments]
        rows.append([name, str(len(found[name])), *(f"{cost:.3f}" if np.isfinite(cost) else "-" for cost in at)])
    heads = ["planner", "runs with a path", *(f"{moment:g} s" for moment in moments)]
    report.table(f"Best cost over time on {given.problem}: median [rad]", heads, rows)
    report.note("Curves", f"![Best cost over time]({PICTURE})")
    report.note(
        "What was done",
        f"OMPL's Benchmark, {given.runs} runs of {given.seconds:g} s each by the clock of a busy machine; ours search "
        "in the kernels of the world, OMPL's ask it from Python. `BenchmarkNotes` writes our progress into the "
        "log, OMPL's own script makes the database of it, and the curves are drawn from its table `progress` by a plot "
        "of ours, for the web page of Planner Arena itself was not used. A run without a path counts as infinite. Each "
        "planner of OMPL has a Benchmark of its own: two in one ended the process. RRTConnect and AORRTC report no "
        "progress, and BIT* ended the process in its second run.",
    )
    return report.finish(given.out)


if __name__ == "__main__":
    raise SystemExit(main())
