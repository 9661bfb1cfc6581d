"""The contract of our planners, as a function that anybody can run on a planner of their own.

Each clause solves a small problem with plain OMPL and a Python validity checker, no World.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from ompl import base as ob
from ompl import tools as ot

from rrtik_ompl.base.errors import PlannerError
from rrtik_ompl.model.transitions import single_joint
from rrtik_ompl.ompl_bridge.contract.problems import (
    GOAL,
    SECONDS,
    START,
    Clause,
    Factory,
    attempt,
    outside_bar,
    outside_wall,
    require,
    require_status,
    small_problem,
    solution_rows,
    solved,
)
from rrtik_ompl.ompl_bridge.contract.spaces import SPACES
from rrtik_ompl.ompl_bridge.states import StateIO

SHORT = 0.2  # [s] for problems without a solution
INSIDE_OBSTACLE, OUTSIDE_BOUNDS = (0.0, 0.0, 0.0), (9.0, 0.0, 0.0)


def check_planner(factory: Factory, *, single_joint_moves: bool = False) -> None:
    """Check that a planner keeps the contract of :class:`SafePlanner`.

    Args:
        factory: Makes a planner: ``factory(si)`` and ``factory(si, seed=7)``.
        single_joint_moves: Require that every edge of a path moves exactly one coordinate.

    Raises:
        PlannerError: At the first clause that is broken; its text names the clause.
    """
    clauses = (*CONTRACT, moves_one_joint_at_a_time) if single_joint_moves else CONTRACT
    for clause in clauses:
        clause(factory)


def solves_and_ends_exactly(factory: Factory) -> None:
    """A plain SimpleSetup is solved: EXACT_SOLUTION, from the start to the goal to the bit, every edge free."""
    setup, rows, _ = solved(factory)
    require(np.array_equal(rows[0], START) and np.array_equal(rows[-1], GOAL), "the path does not end exactly", rows)

    si = setup.getSpaceInformation()
    io = StateIO(si)
    a = si.allocState()
    b = si.allocState()

    for one, two in pairwise(rows):
        io.write(a, one)
        io.write(b, two)
        require(bool(si.checkMotion(a, b)), "an edge of the path is not free", (one, two))


def moves_one_joint_at_a_time(factory: Factory) -> None:
    """Every edge moves exactly one coordinate (C-RDT family only)."""
    for seed in range(20):
        _, rows, _ = solved(factory, seed=seed)
        require(single_joint(rows), "an edge moves several coordinates or none", rows)


def solves_again(factory: Factory) -> None:
    """The same planner solves again, with and without clear() in between."""
    setup, _, _ = solved(factory)
    for clear in (False, True, False, True):
        if clear:
            setup.clear()
        require_status(setup.solve(SECONDS), "Exact solution", "a repeated solve")
        rows = solution_rows(setup)
        require(rows is not None and np.array_equal(rows[-1], GOAL), "a repeated solve lost the goal", rows)


def repeats_with_the_same_seed(factory: Factory) -> None:
    """Two planners made with the same seed find the same path; another seed finds another one."""
    paths = [solved(factory, seed=seed)[1] for seed in (7, 7, 8, 9, 10)]
    require(np.array_equal(paths[0], paths[1]), "the same seed gives another path", paths[:2])
    require(any(not np.array_equal(paths[0], p) for p in paths[2:]), "the seed has no effect", paths[0])


def takes_seconds(factory: Factory) -> None:
    """``planner.solve(0.2)`` called from Python takes a number, and time that runs out is not an error."""
    setup = small_problem(outside_wall)
    planner = factory(setup.getSpaceInformation())
    setup.setPlanner(planner)
    setup.setup()

    status = planner.solve(SHORT)
    require(str(status) in ("Timeout", "Approximate solution"), "a problem without solution", status)
    require(planner.error is None, "running out of time is no error", planner.error)


def refuses_bad_starts_and_goals(factory: Factory) -> None:
    """Starts and goals in collision or outside the bounds give INVALID_START and INVALID_GOAL, and a reason."""
    for bad in (INSIDE_OBSTACLE, OUTSIDE_BOUNDS):
        for place, wanted in (("starts", "Invalid start"), ("goals", "Invalid goal")):
            ends = {"starts": (START,), "goals": (GOAL,), place: (bad,)}
            setup, status, planner = attempt(factory, starts=ends["starts"], goals=ends["goals"])
            require_status(status, wanted, f"{place} at {bad}")
            require(bool(planner.error), f"no reason is given for {wanted.lower()}", planner.error)
            require(not setup.haveSolutionPath(), "there is a path all the same", bad)


def takes_several_starts_and_goals(factory: Factory) -> None:
    """Of several starts and goals, invalid ones are passed over and a path joins two of the others."""
    starts = (INSIDE_OBSTACLE, START, (-1.5, 0.0, 0.0))
    goals = (INSIDE_OBSTACLE, OUTSIDE_BOUNDS, GOAL, (1.5, 0.0, 0.0))
    setup, status, _ = attempt(factory, starts=starts, goals=goals)
    require_status(status, "Exact solution", "several starts and goals")

    rows = solution_rows(setup)
    ends = None if rows is None else (tuple(rows[0].tolist()), tuple(rows[-1].tolist()))
    require(ends is not None and ends[0] in starts[1:] and ends[1] in goals[2:], "the path has other ends", ends)


def survives_a_broken_checker(factory: Factory) -> None:
    """An exception in the validity checker gives CRASH with its text in ``error``; the planner is usable again."""
    calls = [0]
    broken = [True]

    def valid(state: ob.State) -> bool:
        calls[0] += 1
        if broken[0] and calls[0] > 10:
            raise ValueError("the checker broke")
        return outside_bar(state)

    setup, status, planner = attempt(factory, valid=valid)
    require_status(status, "Crash", "an exception in the validity checker")
    require("ValueError: the checker broke" in (planner.error or ""), "the error is not kept", planner.error)

    broken[0] = False
    setup.clear()
    require_status(setup.solve(SECONDS), "Exact solution", "the solve after a crash")
    require(planner.error is None, "the error outlived its solve", planner.error)


def lets_interrupts_pass(factory: Factory) -> None:
    """KeyboardInterrupt and SystemExit leave solve."""
    for interrupt in (KeyboardInterrupt, SystemExit):
        calls = [0]

        def valid(state: ob.State, calls: list[int] = calls, interrupt: type[BaseException] = interrupt) -> bool:
            calls[0] += 1
            if calls[0] > 10:
                raise interrupt
            return outside_bar(state)

        try:
            _, status, _ = attempt(factory, valid=valid)
        except interrupt:
            continue
        raise PlannerError(f"check_planner: {interrupt.__name__} did not leave solve; it returned {status}")


def reports_plain_numbers(factory: Factory) -> None:
    """``statistics`` holds plain ints and floats after a solve."""
    _, _, planner = solved(factory)
    statistics = planner.statistics
    plain = all(isinstance(k, str) and type(v) in (int, float) for k, v in statistics.items())
    require(bool(statistics) and plain, "statistics must be a dict of plain ints and floats", statistics)


def runs_in_benchmark(factory: Factory) -> None:
    """OMPL's Benchmark runs it, as an object and through a planner allocator."""
    setup = small_problem()
    benchmark = ot.Benchmark(setup, "contract")
    benchmark.addPlanner(factory(setup.getSpaceInformation()))
    benchmark.addPlannerAllocator(lambda si: factory(si))

    benchmark.benchmark(ot.Request(SECONDS, 4096.0, 2, 0.05, False, False, False))
    planners = benchmark.getRecordedExperimentData().planners
    solved = [run["solved BOOLEAN"] for planner in planners for run in planner.runs]

    require(solved == ["1"] * 4, "not every benchmark run is solved", solved)


CONTRACT: tuple[Clause, ...] = (
    solves_and_ends_exactly,
    solves_again,
    repeats_with_the_same_seed,
    takes_seconds,
    refuses_bad_starts_and_goals,
    takes_several_starts_and_goals,
    survives_a_broken_checker,
    lets_interrupts_pass,
    reports_plain_numbers,
    runs_in_benchmark,
    *SPACES,
)
