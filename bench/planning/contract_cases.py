"""Contract cases drawn by hypothesis over spaces, goals, checkers and conditions, for every planner of ours, no World.

With ``--turning`` all spaces have coordinates of SO(2). Cases come in blocks, one seed each; an
interrupted run goes on where it was.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from time import monotonic, process_time
from typing import Annotated

import numpy as np
from hypothesis import HealthCheck, Phase, given, seed, settings
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou
from typer import Option

from bench.planning.contract_questions import CHECKERS, CONDITIONS, GOALS, PLANNERS, Case, cases, goal_of, setup_of
from bench.shared.parts import Parts
from bench.shared.run import Run
from rrtik_bench.report.page import Report

BLOCK, ALL, ALL_TURNING = 200, 100_000, 10_000
SPACES = (
    "spaces of reals",
    "SO(2), SE(2) and compounds of reals and SO(2), lengths and angles as parts of their ranges",
)
BALL = 0.3  # radius, of half the extent of the space
MOST = 0.05  # [s] a search
LATE = 2.0  # [s] of processor time, after which a search is called late: wall time tells of other processes too


def asked(case: Case) -> tuple[str, str]:
    """The status of a case in OMPL's words, and what is wrong, or ""."""
    rng = np.random.default_rng(case.seed)
    setup = setup_of(case)
    si = setup.getSpaceInformation()
    middles, count = rng.uniform(-case.half, case.half, (case.balls, case.dof)), [0]

    def free(state: ob.State) -> object:
        count[0] += 1
        if case.checker == "raises" and count[0] > 20:
            raise ValueError("the checker broke")
        free_here = ((case.apart(middles, case.row(state)) ** 2).sum(axis=1) > BALL**2).all()
        return free_here if case.checker == "numpy" else bool(free_here)

    setup.setStateValidityChecker(free)
    starts = rng.uniform(-case.half, case.half, (case.starts, case.dof))
    goals = rng.uniform(-case.half, case.half, (int(rng.integers(1, 5)), case.dof))
    state = si.allocState()
    for row in starts:
        case.put(state, row)
        setup.addStartState(state)
    if case.goal != "none":
        setup.setGoal(goal_of(case, si, goals))
    planner = PLANNERS[case.planner](si, seed=case.seed)
    planner.setProblemDefinition(setup.getProblemDefinition())
    planner.setup()
    begun, spent = monotonic(), process_time()
    wanted = {"seconds": MOST, "function": lambda: monotonic() > begun + MOST, "no time": 0.0}[case.condition]
    status = str(planner.solve(wanted))
    if process_time() > spent + MOST + LATE:
        return status, "it ended late"
    return status, _wrong(case, status, planner, setup, starts, goals)


def _wrong(
    case: Case, status: str, planner: ob.Planner, setup: og.SimpleSetup, starts: np.ndarray, goals: np.ndarray
) -> str:
    path = setup.getProblemDefinition().getSolutionPath()
    if status == "Crash":
        return "" if case.checker != "bool" and planner.error else f"crash: {planner.error}"
    if status not in ("Exact solution", "Approximate solution"):
        return "a path all the same" if path is not None else ""
    if path is None:
        return "no path"
    if case.checker == "bool" and not path.check():
        return "a path that OMPL's check refuses"
    ends = [case.row(path.getState(k)) for k in (0, path.getStateCount() - 1)]
    if not (starts == ends[0]).all(axis=1).any():
        return "a path from elsewhere"
    there = bool((goals == ends[1]).all(axis=1).any())
    return "" if there == (status == "Exact solution") else f"{status}, but its end is {'' if there else 'not '}a goal"


def block(number: int, turning: bool, count: int = BLOCK) -> tuple[Counter[str], list[str]]:
    """The cases of a block: how often each status came, and what was wrong with which case."""
    statuses: Counter[str] = Counter()
    wrong: list[str] = []

    @seed(number)
    @settings(max_examples=count, database=None, deadline=None, phases=[Phase.generate],
              suppress_health_check=list(HealthCheck))  # fmt: skip
    @given(cases(turning))
    def run(case: Case) -> None:
        try:
            status, fault = asked(case)
        except Exception as error:  # what leaves solve() is what this looks for
            status, fault = "raised", f"{type(error).__name__}: {error}"
        statuses[status] += 1
        if fault:
            wrong.append(f"{PLANNERS[case.planner].__name__}, {case}: {fault.splitlines()[-1]}")

    run()
    return statuses, wrong


def fill(report: Report, done: Sequence[tuple[Counter[str], list[str]]], turning: bool) -> None:
    """What came out of all blocks."""
    total = sum((statuses for statuses, _ in done), Counter[str]())
    faults = [line for _, wrong in done for line in wrong]
    size = ALL_TURNING if turning else ALL
    report.bar("cases", f"{size}", f"{total.total()}", total.total() >= size)
    report.bar("with a fault: a crash, an exception, a path that is none, an end too late", "0", f"{len(faults)}",
               not faults)  # fmt: skip
    report.table("What `solve` said", ["status", "cases"], [[name, str(count)] for name, count in total.most_common()])
    if faults:
        report.note("The first faults", "\n".join(f"- {line}" for line in faults[:20]))
    report.note(
        "What was drawn",
        f"Planners ({len(PLANNERS)}), {SPACES[turning]}, 1 to 8, 20 and 60 coordinates, units of 1e-3, 1 and 1e3, up "
        f"to 12 balls, up to 3 starts, goals ({', '.join(GOALS)}), checkers ({', '.join(CHECKERS)}: a Python bool, a "
        f"NumPy one, an exception after 20 calls), conditions ({', '.join(CONDITIONS)}); {1e3 * MOST:g} ms a search. "
        "A crash is right where the checker is not.",
    )


def main(
    run: Run,
    parts: Parts,
    *,
    cases: Annotated[int | None, Option(help="At least so many; 100,000, or 10,000 with --turning.")] = None,
    turning: Annotated[bool, Option(help="In spaces with angles.")] = False,
) -> Report:
    """Ask."""
    ou.setLogLevel(ou.LogLevel.LOG_NONE)
    count = cases or (ALL_TURNING if turning else ALL)
    done = parts(block, [(number, turning) for number in range(-(-count // BLOCK))])
    report = run.report("Contract cases with angles" if turning else "Contract cases")
    fill(report, done, turning)
    return report
