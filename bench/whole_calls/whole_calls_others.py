"""Whole calls beside `plan()` by name: the default planner, shortening, loading, first plans.

Lengths are compared with the shortest known ones (`best_known.py`). Processor time of this version.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from typing import Annotated

import numpy as np
from typer import Option

from bench.shared.clocks import of_children, spent
from bench.shared.run import Run, Sets
from bench.speed.machine import machine
from bench.whole_calls.best_known import best_lengths, the_70, title
from bench.whole_calls.report import scene_files, three
from bench.whole_calls.search_calls import problem_of
from rrtik_bench.report.page import Report
from rrtik_ompl import (
    Problem,
    plan,
    shorten,
)

PLANNER, BUSY = "fastrrtconnect", 20.0  # [s]: no clock ends a search on a busy machine
WANTED_SHORTEN = 8.0, 40.0  # [ms] median, 95 %
WANTED_LOAD, WANTED_FIRST = 3.0, 2.0  # [ms], [s]
FIRST = """import sys, rrtik_ompl as rrtik
problem = rrtik.load_problem(sys.argv[1]) if sys.argv[1].startswith("titan4") else None
if problem is None:
    robot = rrtik.load_robot(sys.argv[1])
    lower, upper = robot.finite_range()
    world = rrtik.World(robot)
    ends = [q for k in range(1, 99) if world.valid(q := lower + (upper - lower) * (k * 0.618 % 1))][:2]
    problem = rrtik.Problem(world, *ends)
assert rrtik.plan(problem, "fastrrtconnect", seed=1).found
"""


@dataclass(frozen=True)
class Case:
    """One problem of a set.

    Attributes:
        file: Its scene.
        problem: Loaded.
    """

    file: str
    problem: Problem


def loaded(files: Iterable[str]) -> list[Case]:
    """The problems of files."""
    found = [(file, problem_of(file, balls=False)) for file in files]
    return [Case(file, problem) for file, problem in found if problem is not None]


def default_plans(report: Report, cases: dict[str, list[Case]], known: set[str]) -> None:
    """`plan(problem)`, and how much longer its paths are than the shortest known ones."""
    best, rows = best_lengths(), []
    for arm, them in cases.items():
        times, ratios, found = [], [], 0
        for case in them:
            plan(case.problem, seed=0, seconds=BUSY)
            taken, made = spent(partial(plan, case.problem, seed=1, seconds=BUSY))
            times.append(1e3 * taken)
            found += made.found and taken <= 1.0
            if made.path is not None and case.file in known and title(case.file) in best:
                ratios.append(made.path.length / best[title(case.file)])
        rows.append([arm, f"{found} of {len(them)}", *three(np.array(times)), *three(np.array(ratios), ".3f")])
        report.bar(f"plan(problem), {arm}: found within 1 s", "all", f"{found} of {len(them)}", found == len(them))
        longer = float(np.median(ratios))
        text = f"{100 * (longer - 1):.1f} %"
        report.bar(f"plan(problem), {arm}: median length beyond the best known", "5 %", text, longer <= 1.05)
    head = ["", "within 1 s", "median [ms]", "mean [ms]", "95 % [ms]", "length / best, median", "mean", "95 %"]
    report.table("`plan(problem)`: the default planner", head, rows, text="Second plans in a world.")


def shortenings(report: Report, cases: dict[str, list[Case]]) -> None:
    """`shorten(path, problem)` without limits, and for 200 checks."""
    rows = []
    for arm, them in cases.items():
        whole, brief, gains, early = [], [], [], []
        for case in them:
            path = plan(case.problem, PLANNER, seed=1, seconds=BUSY).path
            if path is None or len(path.waypoints) < 3:
                continue
            taken, short = spent(partial(shorten, path, case.problem, seed=1))
            first, quick = spent(partial(shorten, path, case.problem, seed=1, checks=200))
            whole.append(1e3 * taken)
            brief.append(1e3 * first)
            gains.append(short.length / path.length)
            early.append((path.length - quick.length) / max(path.length - short.length, 1e-9))
        rows.append([arm, str(len(whole)), *three(np.array(whole)), f"{np.median(gains):.3f}"])
        rows[-1] += [f"{np.median(brief):.2f}", f"{100 * np.median(early):.0f} %"]
        middle, late = float(np.median(whole)), float(np.quantile(whole, 0.95))
        held = middle <= WANTED_SHORTEN[0] and late <= WANTED_SHORTEN[1]
        wanted = f"{WANTED_SHORTEN[0]:g} / {WANTED_SHORTEN[1]:g} ms"
        report.bar(f"shorten(), {arm}: median / 95 %", wanted, f"{middle:.1f} / {late:.1f} ms", held)
    head = ["", "paths", "median [ms]", "mean [ms]", "95 % [ms]", "length / before", "200 checks [ms]", "share of gain"]
    report.table("`shorten(path, problem)`", head, rows)


def loading(report: Report, files: dict[str, list[str]]) -> None:
    """From YAML to a problem, with the robot at hand."""
    rows = []
    for arm, them in files.items():
        problem_of(them[0], balls=False)
        times = 1e3 * np.array([spent(partial(problem_of, file, balls=False))[0] for file in them])
        rows.append([arm, str(len(them)), *three(times)])
        if arm == "panda":
            middle = float(np.median(times))
            report.bar(
                "YAML to Problem, Panda: median", f"{WANTED_LOAD:g} ms", f"{middle:.1f} ms", middle <= WANTED_LOAD
            )
    report.table("YAML to `Problem`", ["", "files", "median [ms]", "mean [ms]", "95 % [ms]"], rows)


def first_plans(report: Report) -> None:
    """The first plan of a new process on a machine that never planned, and of one that did.

    Python's bytecode is there, as pip leaves it; so must be the kernels' bitcode, which wheels bring.
    """
    rows = []
    usual = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    first("ur5", usual)
    for name in ("titan4_sdu", "puma560", "ur5", "panda", "kinova"):
        with tempfile.TemporaryDirectory() as folder:
            surroundings = {**usual, "RRTIK_CACHE": folder}
            cold, warm = (of_children(partial(first, name, surroundings))[0] for _ in range(2))
        rows.append([name, f"{cold:.2f}", f"{warm:.2f}"])
        report.bar(f"first plan, empty cache, {name}", f"{WANTED_FIRST:g} s", f"{cold:.2f} s", cold <= WANTED_FIRST)
    report.table("First plan of a process: processor time [s]", ["", "empty cache", "second process"], rows)


def first(name: str, surroundings: dict[str, str]) -> None:
    """A process that loads and plans once."""
    command = [sys.executable, "-c", FIRST, name]
    subprocess.run(command, env=surroundings, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def main(run: Run, folder: Sets, *, problems: Annotated[int, Option(help="Of each family.")] = 50) -> Report:
    """Measure."""
    warnings.simplefilter("ignore")
    files = {arm: scene_files(folder, arm, problems) for arm in ("panda", "ur5")}
    known = {file for arm in files for file in the_70(folder, arm)}
    cases = {arm: loaded(them) for arm, them in files.items()}
    report = run.report("Whole calls: the others")
    default_plans(report, cases, known)
    shortenings(report, cases)
    loading(report, {arm: them[::5] for arm, them in files.items()})
    first_plans(report)
    report.note("Where", machine())
    return report
