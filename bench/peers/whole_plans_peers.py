"""Whole `plan()` calls beside roboplan's `plan()` on the MotionBenchMaker problems, in turns.

Ours is the call that a user makes: exact meshes, with proofs of every motion, in a world that has planned before.
roboplan's is its `plan()` alone, in a planner and a scene that are ready: 32 checks per radian, and no second check.
Both read the same files, each in a process of its own; processor time.
"""

from __future__ import annotations

import sys
import warnings
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import numpy as np
from typer import Option

from bench.peers.description import task_of
from bench.peers.host import Host
from bench.shared.run import Roboplan, Run, Sets
from bench.speed.machine import machine
from bench.whole_calls.report import scene_files, three
from bench.whole_calls.search_calls import problem_of, spent
from rrtik_bench.report.page import Report
from rrtik_ompl import JointPath, Problem, plan
from rrtik_ompl.base.errors import InputError

PLANNER, SECONDS = "fastrrtconnect", 10.0
WANTED = 0.15  # of roboplan's time


def compared(problem: Problem, host: Host, seeds: int) -> list[tuple[float, float, bool, bool]]:
    """For each seed our time and theirs [s], and whether each found a path, judged by our second check."""
    call, found = partial(plan, problem, PLANNER, seconds=SECONDS), []
    call(seed=0)  # what a world keeps is made
    with TemporaryDirectory() as folder:
        task = task_of(problem, Path(folder), SECONDS)
        for seed in range(1, seeds + 1):
            taken, ours = spent(partial(call, seed=seed))
            theirs = host.ask(task, seed)
            path = None if theirs.rows is None else JointPath.of(problem.robot, theirs.rows)
            valid = path is not None and not path.violations(problem.world)
            found.append((taken, theirs.cpu, ours.found, valid))
    return found


def main(
    run: Run,
    folder: Sets,
    *,
    python: Roboplan = sys.executable,
    problems: Annotated[int, Option(help="Of each family.")] = 5,
    seeds: int = 2,
) -> Report:
    """Measure."""
    warnings.simplefilter("ignore")
    report = run.report("Whole plans beside roboplan")
    rows = []
    with Host("roboplan", python) as host:
        if host.absent:
            raise InputError(f"roboplan is absent: {host.absent}; see --python")
        for arm in ("panda", "ur5"):
            runs = []
            for file in scene_files(folder, arm, problems):
                problem = problem_of(file, balls=False)
                assert problem is not None
                runs += compared(problem, host, seeds)
            ours, theirs, found, valid = (np.array(column) for column in zip(*runs, strict=True))
            ratio = float(np.exp(np.log(ours / theirs).mean()))
            report.bar(f"plan() over roboplan's, {arm}: geometric mean", f"{WANTED:g}", f"{ratio:.3f}", ratio <= WANTED)
            for name, seconds, good in (("ours, with proofs", ours, found), ("roboplan", theirs, valid)):
                rows.append([arm, name, str(len(runs)), str(int(good.sum())), *three(1e3 * seconds)])
        versions = host.versions
    head = ["", "", "runs", "found and valid", "median [ms]", "mean [ms]", "95 % [ms]"]
    report.table("`plan()`", head, rows, text="Valid: our second check finds nothing.")
    report.note("Where", f"{machine()} roboplan's environment: {versions}.")
    return report
