"""Contract cases drawn by hypothesis over spaces, goals, checkers and conditions, for every planner of ours, no World.

Usage: ``python bench/planning/contract_cases.py [--cases 100000]``. Cases come in blocks, one seed each; what is done
is kept in ``contract_cases.jsonl`` beside the page, so that a later run goes on there.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from time import monotonic

import numpy as np
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from bench.shared.pages import add_out
from rrtik_bench.report.page import Report
from rrtik_planners import CRDT, IKURT, MBRRT, BiCRDT, CBiRRT, DRRTCon, FastRRTConnect, FewestMoves, RoadmapPlanner

PLANNERS = (BiCRDT, CBiRRT, CRDT, DRRTCon, FastRRTConnect, FewestMoves, IKURT, MBRRT, RoadmapPlanner)
BLOCK, ALL = 200, 100_000
GOALS = ("state", "states", "sampled", "no samples", "region", "none")
CHECKERS = ("bool", "numpy", "raises")
CONDITIONS = ("seconds", "function", "no time")
UNITS = (1e-3, 1.0, 1e3)
MOST = 0.05  # [s] a search
LATE = 2.0  # [s] after its end a search is called late, on a busy machine


@dataclass(frozen=True)
class Case:
    """One question to a planner: what is drawn."""

    planner: int
    dof: int
    unit: float
    balls: int
    starts: int
    goal: str
    checker: str
    condition: str
    seed: int


CASES = st.builds(
    Case,
    planner=st.integers(0, len(PLANNERS) - 1),
    dof=st.integers(1, 8) | st.sampled_from([20, 60]),
    unit=st.sampled_from(UNITS),
    balls=st.integers(0, 12),
    starts=st.sampled_from((0, 1, 1, 1, 2, 3)),
    goal=st.sampled_from(GOALS),
    checker=st.sampled_from(("bool",) * 4 + CHECKERS[1:]),
    condition=st.sampled_from(CONDITIONS),
    seed=st.integers(0, 10_000),
)


class Sampled(ob.GoalSampleableRegion):  # type: ignore[misc]  # OMPL has no types
    """Goals from rows, one after the other; there may be none."""

    def __init__(self, si: ob.SpaceInformation, rows: np.ndarray) -> None:
        super().__init__(si)
        self.rows, self.next = rows, 0

    def maxSampleCount(self) -> int:
        """How many there are; called by OMPL."""
        return len(self.rows)

    def couldSample(self) -> bool:
        """Whether there is any; called by OMPL."""
        return len(self.rows) > 0

    def sampleGoal(self, state: ob.State) -> None:
        """The next one; called by OMPL."""
        row = self.rows[self.next % len(self.rows)]
        self.next += 1
        state[0 : len(row)] = row.tolist()

    def distanceGoal(self, state: ob.State) -> float:
        """To the nearest one; called by OMPL."""
        q = np.array(state[0 : self.rows.shape[1]])
        return float(np.linalg.norm(self.rows - q, axis=1).min()) if len(self.rows) else 1.0


class Region(ob.GoalRegion):  # type: ignore[misc]  # OMPL has no types
    """A goal that nothing can be sampled from."""

    def distanceGoal(self, state: ob.State) -> float:
        """Far; called by OMPL."""
        return 1.0


def asked(case: Case) -> tuple[str, str]:
    """The status of a case in OMPL's words, and what is wrong, or ""."""
    rng = np.random.default_rng(case.seed)
    setup = _setup(case)
    si = setup.getSpaceInformation()
    middles = rng.uniform(-case.unit, case.unit, (case.balls, case.dof))
    square, count = (0.3 * case.unit) ** 2, [0]

    def free(state: ob.State) -> object:
        count[0] += 1
        if case.checker == "raises" and count[0] > 20:
            raise ValueError("the checker broke")
        free_here = (((middles - state[0 : case.dof]) ** 2).sum(axis=1) > square).all()
        return free_here if case.checker == "numpy" else bool(free_here)

    setup.setStateValidityChecker(free)
    starts = rng.uniform(-case.unit, case.unit, (case.starts, case.dof))
    goals = rng.uniform(-case.unit, case.unit, (int(rng.integers(1, 5)), case.dof))
    state = si.allocState()
    for row in starts:
        state[0 : case.dof] = row.tolist()
        setup.addStartState(state)
    if case.goal != "none":
        setup.setGoal(_goal(case, si, goals))
    planner = PLANNERS[case.planner](si, seed=case.seed)
    planner.setProblemDefinition(setup.getProblemDefinition())
    planner.setup()
    begun = monotonic()
    wanted = {"seconds": MOST, "function": lambda: monotonic() > begun + MOST, "no time": 0.0}[case.condition]
    status = str(planner.solve(wanted))
    if monotonic() > begun + MOST + LATE:
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
    ends = [np.array(path.getState(k)[0 : case.dof]) for k in (0, path.getStateCount() - 1)]
    if not (starts == ends[0]).all(axis=1).any():
        return "a path from elsewhere"
    there = bool((goals == ends[1]).all(axis=1).any())
    return "" if there == (status == "Exact solution") else f"{status}, but its end is {'' if there else 'not '}a goal"


def _setup(case: Case) -> og.SimpleSetup:
    space, bounds = ob.RealVectorStateSpace(case.dof), ob.RealVectorBounds(case.dof)
    bounds.setLow(-case.unit)
    bounds.setHigh(case.unit)
    space.setBounds(bounds)
    return og.SimpleSetup(space)


def _goal(case: Case, si: ob.SpaceInformation, goals: np.ndarray) -> ob.Goal:
    state = si.allocState()
    if case.goal == "state":
        goal = ob.GoalState(si)
        state[0 : case.dof] = goals[0].tolist()
        goal.setState(state)
        return goal
    if case.goal == "states":
        several = ob.GoalStates(si)
        for row in goals:
            state[0 : case.dof] = row.tolist()
            several.addState(state)
        return several
    return Region(si) if case.goal == "region" else Sampled(si, goals if case.goal == "sampled" else goals[:0])


def block(number: int, count: int = BLOCK) -> tuple[Counter[str], list[str]]:
    """The cases of a block: how often each status came, and what was wrong with which case."""
    statuses: Counter[str] = Counter()
    wrong: list[str] = []

    @seed(number)
    @settings(max_examples=count, database=None, deadline=None, phases=[Phase.generate],
              suppress_health_check=list(HealthCheck))  # fmt: skip
    @given(CASES)
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


def page(file: Path, cases: int) -> Report:
    """Ask until so many cases are done, and say what came out."""
    done = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
    while sum(sum(each["statuses"].values()) for each in done) < cases:
        statuses, wrong = block(len(done))
        done.append({"statuses": dict(statuses), "wrong": wrong})
        with file.open("a") as kept:
            kept.write(json.dumps(done[-1]) + "\n")
    total = sum((Counter(each["statuses"]) for each in done), Counter())
    faults = [line for each in done for line in each["wrong"]]
    report = Report("Contract cases", f"python bench/planning/contract_cases.py --cases {cases}")
    report.bar("cases", f"{ALL}", f"{total.total()}", total.total() >= ALL)
    report.bar("with a fault: a crash, an exception, a path that is none, an end too late", "0", f"{len(faults)}",
               not faults)  # fmt: skip
    report.table("What `solve` said", ["status", "cases"], [[name, str(count)] for name, count in total.most_common()])
    if faults:
        report.note("The first faults", "\n".join(f"- {line}" for line in faults[:20]))
    report.note(
        "What was drawn",
        f"Planners ({len(PLANNERS)}), 1 to 8, 20 and 60 coordinates, units of 1e-3, 1 and 1e3, up to 12 balls, up to "
        f"3 starts, goals ({', '.join(GOALS)}), checkers ({', '.join(CHECKERS)}: a Python bool, a NumPy one, an "
        f"exception after 20 calls), conditions ({', '.join(CONDITIONS)}); {1e3 * MOST:g} ms a search. A crash is "
        "right where the checker is not.",
    )
    return report


def main() -> int:
    """Ask and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=ALL)
    add_out(parser, "contract_cases.md")
    options = parser.parse_args()
    ou.setLogLevel(ou.LogLevel.LOG_NONE)
    return page(options.out.with_suffix(".jsonl"), options.cases).finish(options.out)


if __name__ == "__main__":
    raise SystemExit(main())
