"""Length over time on Panda problems: `plan(improve=)`, OMPL's AORRTC and BIT*, roboplan with its shortening.

Lengths are compared with the shortest ones known (`bench/data/mbm_best.csv`).

OMPL's planners ask our world, exactly as `plan()` does, and stop when a time of the processor has passed; so does
roboplan, in a process of its own, by its own checks (32 a radian). A path counts if our second check finds nothing.
Each time is a run of its own, with the same seed; `plan(improve=)` runs once, and its course is read.
"""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou
from typer import Option

import rrtik_ompl as rrtik
from bench.peers.description import task_of
from bench.peers.host import Host
from bench.planning.best_known import best_lengths
from bench.shared.run import PandaSet, Roboplan, Run
from rrtik_bench.report.page import Report
from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.ompl_bridge.setup import exact_path
from rrtik_ompl.problem_files.motion_bench_maker import load_motion_bench_maker

TIMES = (0.01, 0.03, 0.1, 0.3, 1.0)  # [s] of the processor
JUDGED, MEDIAN, WORST = 0.1, 0.01, 0.05  # when, and what is wanted then: over the best known
SHOWN = 10  # of our runs, those that are worst
OURS, THEIRS, PEER = "plan(improve=)", ("AORRTC", "BITstar"), "roboplan, restarted and shortened"


def chosen(count: int) -> dict[str, float]:
    """The best known lengths of the problems that are measured."""
    known = best_lengths()
    names = sorted(name for name in known if "panda" in name.split("/")[0])
    picked = []
    for family in sorted({name.split("/")[0] for name in names}):
        own = [name for name in names if name.startswith(f"{family}/")]
        picked += [own[k] for k in sorted({round(k) for k in np.linspace(0, len(own) - 1, count)})]
    return {name: known[name] for name in picked}


def ours(problem: rrtik.Problem, seed: int) -> Vector:
    """Length of the best path at each time, +inf before the first."""
    planned = rrtik.plan(problem, seed=seed, seconds=5.0, improve=TIMES[-1])
    course = planned.statistics.get("cost_over_time", ())
    return np.array([min((cost for at, cost in course if at <= moment), default=np.inf) for moment in TIMES])


def of_ompl(name: str, problem: rrtik.Problem, seed: int, seconds: float) -> Matrix | None:
    """What a planner of OMPL has found after so many seconds of the processor."""
    ou.RNG.setSeed(1 + seed)
    setup = rrtik.ompl.simple_setup(problem)
    si = setup.getSpaceInformation()
    setup.setPlanner(getattr(og, name)(si))
    setup.setup()
    end = time.process_time() + seconds
    setup.solve(ob.PlannerTerminationCondition(lambda: time.process_time() > end))
    return exact_path(setup.getProblemDefinition(), si)


def length(problem: rrtik.Problem, rows: Matrix | None) -> float:
    """Length of a path that stands the second check; +inf of any other."""
    if rows is None:
        return float(np.inf)
    path = rrtik.JointPath.of(problem.robot, rows)
    return float(np.inf) if path.violations(problem.world) else path.length


def compared(problem: rrtik.Problem, host: Host | None, seeds: int) -> dict[str, list[Vector]]:
    """Of each method and seed the lengths at all times."""
    ours(problem, 99)  # loads what is used
    found: dict[str, list[Vector]] = {}
    with TemporaryDirectory() as folder:
        asked: dict[str, Callable[[int, float], Matrix | None]] = {
            name: partial(of_ompl, name, problem) for name in THEIRS
        }
        if host is not None:
            asked[PEER] = lambda seed, seconds: host.ask(task_of(problem, Path(folder), seconds), seed).rows
        for seed in range(seeds):
            found.setdefault(OURS, []).append(ours(problem, seed))
            for name, ask in asked.items():
                lengths = [length(problem, ask(seed, moment)) for moment in TIMES]
                found.setdefault(name, []).append(np.minimum.accumulate(lengths))
    return found


def fill(report: Report, over: dict[str, Matrix], names: list[str]) -> None:
    """What came out, of lengths over the best known ones, shape (runs, times) of each method; names of our runs."""
    at = TIMES.index(JUDGED)
    middle = {name: float(np.median(each[:, at])) for name, each in over.items()}
    best = min(middle.values())
    report.bar(f"after {JUDGED:g} s: ours has the least median", "yes", f"{middle[OURS]:.2%}", middle[OURS] <= best)
    report.bar(f"after {JUDGED:g} s: our median", f"{MEDIAN:.0%}", f"{middle[OURS]:.2%}", middle[OURS] <= MEDIAN)
    worst = float(over[OURS][:, at].max())
    report.bar(f"after {JUDGED:g} s: our worst of {len(names)}", f"{WORST:.0%}", f"{worst:.1%}", worst <= WORST)
    heads = ["", *(f"{moment:g} s" for moment in TIMES)]
    kinds: dict[str, Callable[[Matrix], Vector]] = {
        "Median": lambda each: np.median(each, axis=0),
        "90 % of the runs": lambda each: np.percentile(each, 90, axis=0, method="higher"),
        "Worst": lambda each: each.max(axis=0),
    }
    for what, of in kinds.items():
        rows = [[name, *(_percent(value) for value in of(each))] for name, each in over.items()]
        report.table(f"{what}: over the best known length, after so much time of the processor", heads, rows)
    rows = [[name, *(f"{share:.0%}" for share in (each <= WORST).mean(axis=0))] for name, each in over.items()]
    report.table(f"Within {WORST:.0%} of the best known length", heads, rows)
    last = np.argsort(-over[OURS][:, at])[:SHOWN]
    rows = [[names[k], *(_percent(value) for value in over[OURS][k])] for k in last]
    report.table(f"Our worst ones after {JUDGED:g} s", ["problem", *heads[1:]], rows)
    problems = {name.partition(",")[0] for name in names}
    report.note(
        "What was done",
        f"{len(problems)} problems of MotionBenchMaker's Panda, {len(over[OURS])} runs of each. '-': no path yet that "
        "our second check takes. OMPL's planners ask our world about each motion from Python; loading and set-up are "
        "not counted for anybody. Best known: the shortest paths of all searches so far (`bench/data/mbm_best.csv`).",
    )


def _percent(value: float) -> str:
    return f"{value:.2%}" if np.isfinite(value) else "-"


def main(
    run: Run,
    folder: PandaSet,
    *,
    python: Roboplan = sys.executable,
    problems: Annotated[int, Option(help="Of each family, spread over it.")] = 3,
    seeds: int = 1,
) -> Report:
    """Measure."""
    warnings.simplefilter("ignore")
    ou.setLogLevel(ou.LogLevel.LOG_NONE)
    time.perf_counter = time.monotonic = time.process_time  # limits of `plan()` are of the processor
    over: dict[str, list[Vector]] = {}
    names = []
    with Host("roboplan improve", python) as roboplan:
        if roboplan.absent:
            print(f"roboplan is absent: {roboplan.absent}", flush=True)
        host = None if roboplan.absent else roboplan
        for name, best in chosen(problems).items():
            problem = load_motion_bench_maker(folder / "problems" / f"{name}.yaml", robot=folder / "panda.urdf")
            names += [f"{name}, seed {seed}" for seed in range(seeds)]
            for method, lengths in compared(problem, host, seeds).items():
                over.setdefault(method, []).extend(each / best - 1.0 for each in lengths)
                print(name, method, np.round(100.0 * over[method][-1], 1), flush=True)
    report = run.report("Length over time, beside others")
    fill(report, {name: np.array(each) for name, each in over.items()}, names)
    return report
