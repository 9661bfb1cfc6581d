"""How much `plan(improve=)` leaves to the best known lengths, over time: Panda problems of MotionBenchMaker.

Lengths are compared with the shortest ones known (`bench/data/mbm_best.csv`).
"""

from __future__ import annotations

import csv
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from typer import Option

import rrtik_ompl as rrtik
from bench.shared.run import PandaSet, Run
from rrtik_bench.report.page import Report
from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.problem_files.motion_bench_maker import load_motion_bench_maker

BEST = Path(__file__).resolve().parent.parent / "data" / "mbm_best.csv"
TIMES = (0.01, 0.03, 0.1, 0.3, 1.0)  # [s] of the processor
JUDGED, MEDIAN, WORST = 0.1, 0.01, 0.05  # when, and what is wanted then: over the best known
SHOWN = 10  # of the problems, those that are worst


@dataclass(frozen=True)
class Improved:
    """A problem and a seed: length over the best known one at each time, +inf before the first path."""

    problem: str
    seed: int
    over: Matrix


def chosen(count: int) -> dict[str, float]:
    """The best known lengths of the problems that are measured."""
    with BEST.open(newline="") as file:
        known = {row["problem"]: float(row["length"]) for row in csv.DictReader(file)}
    names = sorted(name for name in known if "panda" in name.split("/")[0])
    families = sorted({name.split("/")[0] for name in names})
    picked = []
    for family in families:
        own = [name for name in names if name.startswith(f"{family}/")]
        picked += [own[k] for k in sorted({round(k) for k in np.linspace(0, len(own) - 1, count)})]
    return {name: known[name] for name in picked}


def improved(folder: Path, name: str, best: float, seeds: int) -> list[Improved]:
    """A problem by several seeds."""
    problem = load_motion_bench_maker(folder / "problems" / f"{name}.yaml", robot=folder / "panda.urdf")
    first = rrtik.plan(problem, "fastrrtconnect", seed=99)
    if first.path is not None:
        rrtik.shorten(first.path, problem)  # loads what is used
    found = []
    for seed in range(seeds):
        planned = rrtik.plan(problem, "fastrrtconnect", seed=seed, seconds=5.0, improve=TIMES[-1])
        course = np.array(planned.statistics.get("cost_over_time", ())).reshape(-1, 2)
        over = [min((cost for at, cost in course if at <= moment), default=np.inf) / best - 1.0 for moment in TIMES]
        found.append(Improved(name, seed, np.array(over)))
    return found


def fill(report: Report, results: list[Improved]) -> None:
    """What came out."""
    over, at = np.array([each.over for each in results]), TIMES.index(JUDGED)
    middle, worst = float(np.median(over[:, at])), float(over[:, at].max())
    report.bar(f"over the best known after {JUDGED:g} s, median", f"{MEDIAN:.0%}", f"{middle:.2%}", middle <= MEDIAN)
    report.bar(f"the worst of {len(over)}", f"{WORST:.0%}", f"{worst:.1%}", worst <= WORST)
    heads = ["", *(f"{moment:g} s" for moment in TIMES)]
    rows = [
        ["median", *(f"{value:.2%}" for value in np.median(over, axis=0))],
        ["90 %", *(f"{value:.1%}" for value in np.percentile(over, 90, axis=0, method="higher"))],
        ["worst", *(f"{value:.1%}" for value in over.max(axis=0))],
        ["within 5 %", *(f"{value:.0%}" for value in (over <= WORST).mean(axis=0))],
    ]
    report.table("Length over the best known one, by time of the processor", heads, rows)
    last = sorted(results, key=lambda each: -each.over[at])[:SHOWN]
    rows = [[f"{each.problem}, seed {each.seed}", *(f"{value:.1%}" for value in each.over)] for each in last]
    report.table(f"The worst ones after {JUDGED:g} s", ["problem", *heads[1:]], rows)


def main(
    run: Run,
    folder: PandaSet,
    *,
    problems: Annotated[int, Option(help="Of each family, spread over it.")] = 3,
    seeds: int = 3,
) -> Report:
    """Measure."""
    time.perf_counter = time.monotonic = time.process_time  # all limits are of the processor
    results = []
    for name, best in chosen(problems).items():
        results += improved(folder, name, best, seeds)
        print(name, np.round(100.0 * results[-1].over, 1), flush=True)
    report = run.report("Paths that go on getting shorter")
    fill(report, results)
    return report
