"""OMPL's environments in plain OMPL, no World: our planners beside its RRTConnect, at equal processor time.

Usage: ``python bench/planning/ompl_environments.py FOLDER [--runs 3]``. FOLDER has the files of OMPL's tests and demos:
``env1.txt``, ``circle_obstacles.txt``, ``circle_queries.txt`` and ``normal.ppm``.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import monotonic, process_time

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from bench.planning.environments import Environment, environments
from bench.shared.pages import add_out
from rrtik_bench.report.page import Report
from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_planners import CRDT, IKURT, MBRRT, BiCRDT, CBiRRT, DRRTCon, FastRRTConnect, FewestMoves, RoadmapPlanner

LIMIT = 3.0  # [s] of processor time
OURS = (BiCRDT, CBiRRT, CRDT, DRRTCon, FastRRTConnect, FewestMoves, IKURT, MBRRT, RoadmapPlanner)
SLOWER = 3.0  # times the median of RRTConnect are wanted at most
CLOCK = 1e-3  # [s] below which medians are taken for equal: the processor's clock is no finer


@dataclass(frozen=True)
class Runs:
    """Runs of a planner in an environment: seconds of each, whether it was exact, how many paths fail OMPL's check.

    ``asked``: how many states of each run the checker was asked about.
    """

    seconds: Vector
    exact: Mask
    refused: int
    asked: Vector


def setup_of(environment: Environment, query: Matrix) -> og.SimpleSetup:
    """A SimpleSetup of an environment and a query, shape (2, n)."""
    dof = query.shape[1]
    space, bounds = ob.RealVectorStateSpace(dof), ob.RealVectorBounds(dof)
    bounds.setLow(environment.lower)
    bounds.setHigh(environment.upper)
    space.setBounds(bounds)
    setup = og.SimpleSetup(space)
    setup.setStateValidityChecker(environment.free)
    si = setup.getSpaceInformation()
    si.setStateValidityCheckingResolution(environment.resolution)
    ends = [si.allocState() for _ in query]
    for state, row in zip(ends, query, strict=True):
        state[0:dof] = row.tolist()
    setup.setStartAndGoalStates(*ends)
    return setup


def counted(setup: og.SimpleSetup, free: Callable[[ob.State], bool]) -> list[int]:
    """Have a setup count the states that its checker is asked about; the count is the only item."""
    count = [0]

    def checked(state: ob.State) -> bool:
        count[0] += 1
        return free(state)

    setup.setStateValidityChecker(checked)
    return count


def made(planner: type[ob.Planner], si: ob.SpaceInformation, seed: int, reach: float | None) -> ob.Planner:
    """A planner with a seed, and with the range of the environment if it takes one."""
    if planner in OURS:
        fresh = planner(si, seed=seed)
        if reach is not None and "range" in fresh.parameters():
            fresh.set("range", reach)
        return fresh
    ou.RNG.setSeed(seed + 1)
    fresh = planner(si)
    if reach is not None:
        fresh.setRange(reach)
    return fresh


def limit(end: float) -> Callable[[], bool]:
    """Whether the clock of the processor has passed `end`; it is read each 2 ms, for that costs as much as a check."""
    state = [False, 0.0]

    def passed() -> bool:
        now = monotonic()
        if now > state[1]:
            state[:] = process_time() > end, now + 2e-3
        return bool(state[0])

    return passed


def measured(environment: Environment, planner: type[ob.Planner], runs: int) -> Runs:
    """All queries of an environment, each so many times."""
    seconds, exact, refused, asked = [], [], 0, []
    for seed in range(runs):
        for query in environment.queries:
            setup = setup_of(environment, query)
            count = counted(setup, environment.free)
            setup.setPlanner(made(planner, setup.getSpaceInformation(), seed, environment.range))
            setup.setup()
            begin = process_time()
            condition = ob.PlannerTerminationCondition(limit(begin + LIMIT))
            status = str(setup.getPlanner().solve(condition))
            seconds.append(process_time() - begin)
            asked.append(count[0])
            exact.append(status == "Exact solution")
            refused += exact[-1] and not setup.getSolutionPath().check()
    return Runs(np.array(seconds), np.array(exact), refused, np.array(asked))


def page(folder: Path, runs: int) -> Report:
    """Measure, and say what came out."""
    report = Report("OMPL's environments, without a World", "python bench/planning/ompl_environments.py FOLDER")
    planners = (og.RRTConnect, *OURS)
    rows, questions, late, slow, refused = [], [], [], [], 0
    for environment in environments(folder):
        found = {planner: measured(environment, planner, runs) for planner in planners}
        mark = found[og.RRTConnect]
        allowed = SLOWER * max(float(np.median(mark.seconds)), CLOCK)
        row = [environment.name]
        for planner, each in found.items():
            middle = float(np.median(each.seconds))
            row.append(f"{int(each.exact.sum())}/{len(each.exact)} {1e3 * middle:.1f}")
            if planner is og.RRTConnect:
                continue
            refused += each.refused
            late += [f"{planner.__name__} in {environment.name}"] if (mark.exact & ~each.exact).any() else []
            slow += [f"{planner.__name__} in {environment.name}"] if middle > allowed else []
        rows.append(row)
        questions.append([environment.name, *(f"{np.median(each.asked):.0f}" for each in found.values())])
        print(" | ".join(row), flush=True)
    cells = (len(planners) - 1) * len(rows)
    report.bar("planner and environment: no time-out where RRTConnect solves", f"{cells} of {cells}",
               f"{cells - len(late)} of {cells}", not late)  # fmt: skip
    report.bar(f"median at most {SLOWER:g} times that of RRTConnect", f"{cells} of {cells}",
               f"{cells - len(slow)} of {cells}", not slow)  # fmt: skip
    report.bar("exact paths that OMPL's own check refuses", "0", str(refused), refused == 0)
    heads = ["environment", *(planner.__name__ for planner in planners)]
    report.table(f"Solved and median [ms of the processor], at most {LIMIT:g} s a run", heads, rows)
    text = "Where a planner of ours asks no more than RRTConnect and takes longer, the rest is its own loop in Python."
    report.table("States that the checker was asked about, median", heads, questions, text=text)
    report.note("Time-outs where RRTConnect solves", "; ".join(late) or "none.")
    report.note("Slower than wanted", "; ".join(slow) or "none.")
    report.note(
        "What was done",
        f"{runs} seeds a query; validity checkers in Python, no World, so that our searches are loops in Python beside "
        f"OMPL's in C++. Medians below {1e3 * CLOCK:g} ms count as that. FewestMoves goes on improving its path as "
        "long as it can, and C-RDT is a single tree without aim; both are measured as the others.",
    )
    return report


def main() -> int:
    """Measure and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--runs", type=int, default=3)
    add_out(parser, "ompl_environments.md")
    options = parser.parse_args()
    ou.setLogLevel(ou.LogLevel.LOG_NONE)
    return page(options.folder, options.runs).finish(options.out)


if __name__ == "__main__":
    raise SystemExit(main())
