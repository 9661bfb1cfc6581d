"""Whole calls beside `plan()` by name: the default planner, shortening, inverse kinematics, loading, first plans.

Lengths are compared with the shortest known ones (`best_known.py`). Processor time of this version.
"""

from __future__ import annotations

import os
import resource
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

from bench.shared.run import Run, Sets
from bench.speed.machine import machine
from bench.whole_calls.best_known import best_lengths, the_70, title
from bench.whole_calls.report import scene_files, three
from bench.whole_calls.search_calls import problem_of, spent
from rrtik_bench.report.page import Report
from rrtik_ompl import (
    Box,
    Obstacle,
    PoseGoal,
    Problem,
    Scene,
    World,
    load_robot,
    plan,
    pose,
    shorten,
    solve_ik,
)

PLANNER, BUSY = "fastrrtconnect", 20.0  # [s]: no clock ends a search on a busy machine
WANTED_SHORTEN = 8.0, 40.0  # [ms] median, 95 %
WANTED_IK, WANTED_LOAD, WANTED_FIRST = 25.0, 3.0, 2.0  # [us], [ms], [s]
WANTED_MANY = 20.0, 5.0  # [ms]: World() of a thousand boxes, a plan in it
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


def kinematics(report: Report) -> None:
    """`solve_ik` of one pose after the other."""
    rows = []
    for name in ("ur5", "panda", "titan4"):
        robot, rng = load_robot(name), np.random.default_rng(1)
        lower, upper = robot.finite_range()
        goals = [PoseGoal(robot.fk(q)) for q in rng.uniform(lower, upper, (300, robot.dof))]
        for goal in goals[:20]:
            solve_ik(robot, goal)
        runs = [spent(partial(solve_ik, robot, goal)) for goal in goals]
        times = 1e6 * np.array([taken for taken, _ in runs])
        rows.append([name, runs[0][1].method, f"{sum(r.found for _, r in runs)} of {len(runs)}", *three(times)])
        middle = float(np.median(times))
        report.bar(f"solve_ik, one pose, {name}: median", f"{WANTED_IK:g} us", f"{middle:.0f} us", middle <= WANTED_IK)
    head = ["", "method", "found", "median [us]", "mean [us]", "95 % [us]"]
    report.table("`solve_ik(robot, PoseGoal(T))`", head, rows)


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


def thousand_boxes(report: Report) -> None:
    """A UR5 among a thousand small boxes."""
    robot, rng = load_robot("ur5"), np.random.default_rng(1)
    away = rng.normal(size=(1000, 3))
    away *= (np.cbrt(rng.uniform(0.03, 1.0, 1000)) * 1.5 / np.linalg.norm(away, axis=1))[:, None]  # not in the base
    boxes = tuple(Obstacle(f"box{k}", Box([0.02] * 3), pose(p)) for k, p in enumerate(away))
    made = [spent(partial(World, robot, Scene(boxes))) for _ in range(6)][1:]
    world = made[0][1]
    rows = rng.uniform(*robot.finite_range(), (4000, robot.dof))
    free = rows[world.valid_batch(rows)]
    free = free[world.certify(free)][:40]
    problems = [Problem(world, a, b) for a, b in zip(free[::2], free[1::2], strict=False)]
    runs = [spent(partial(plan, p, PLANNER, seed=1, seconds=BUSY)) for p in problems]
    built, planned = (1e3 * float(np.median([taken for taken, _ in each])) for each in (made, runs))
    found = sum(result.found for _, result in runs)
    report.table(
        "A UR5 among 1,000 boxes",
        ["`World()` [ms]", "`plan()` [ms]", "found"],
        [[f"{built:.1f}", f"{planned:.1f}", f"{found} of {len(runs)}"]],
    )
    for what, wanted, measured in (("World()", WANTED_MANY[0], built), ("plan()", WANTED_MANY[1], planned)):
        report.bar(f"1,000 boxes, UR5: {what}, median", f"{wanted:g} ms", f"{measured:.1f} ms", measured <= wanted)


def first_plans(report: Report) -> None:
    """The first plan of a new process on a machine that never planned, and of one that did.

    Python's bytecode is there, as pip leaves it; so must be the kernels' bitcode, which wheels bring.
    """
    rows = []
    usual = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    _process([sys.executable, "-c", FIRST, "ur5"], usual)
    for name in ("titan4_sdu", "puma560", "ur5", "panda", "kinova"):
        with tempfile.TemporaryDirectory() as folder:
            surroundings = {**usual, "RRTIK_CACHE": folder}
            cold, warm = (_process([sys.executable, "-c", FIRST, name], surroundings) for _ in range(2))
        rows.append([name, f"{cold:.2f}", f"{warm:.2f}"])
        report.bar(f"first plan, empty cache, {name}", f"{WANTED_FIRST:g} s", f"{cold:.2f} s", cold <= WANTED_FIRST)
    report.table("First plan of a process: processor time [s]", ["", "empty cache", "second process"], rows)


def _process(command: list[str], surroundings: dict[str, str]) -> float:
    """Processor time [s] of a whole process."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, env=surroundings, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main(run: Run, folder: Sets, *, problems: Annotated[int, Option(help="Of each family.")] = 50) -> Report:
    """Measure."""
    warnings.simplefilter("ignore")
    files = {arm: scene_files(folder, arm, problems) for arm in ("panda", "ur5")}
    known = {file for arm in files for file in the_70(folder, arm)}
    cases = {arm: loaded(them) for arm, them in files.items()}
    report = run.report("Whole calls: the others")
    default_plans(report, cases, known)
    shortenings(report, cases)
    kinematics(report)
    loading(report, {arm: them[::5] for arm, them in files.items()})
    thousand_boxes(report)
    first_plans(report)
    report.note("Where", machine())
    return report
