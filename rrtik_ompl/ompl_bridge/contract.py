"""The contract of :class:`SafePlanner`, as a check that anybody can run on their own planner.

Each clause solves a small problem with plain OMPL and a Python validity checker, without a World. The last clauses try
a planner in many spaces: units, numbers of coordinates, seeds, starts. An exact path has to pass OMPL's own
``PathGeometric.check()``, which checks every edge again.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from inspect import signature
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from ompl import base as ob
from ompl import geometric as og
from ompl import tools as ot

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.errors import InputError, PlannerError
from rrtik_ompl.model.transitions import single_joint
from rrtik_ompl.ompl_bridge.states import StateIO

Factory = Callable[..., ob.Planner]  # factory(si) and factory(si, seed=...) make a planner
Clause = Callable[[Factory], None]

# The small problem: a box of three coordinates.
DOF = 3
START, GOAL = (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)
INSIDE_OBSTACLE, OUTSIDE_BOUNDS = (0.0, 0.0, 0.0), (9.0, 0.0, 0.0)
SECONDS = 10.0  # [s] for problems that take milliseconds
SHORT = 0.2  # [s] for problems without a solution

# Many spaces.
SEEDS = 200
UNITS = (1e-3, 1.0, 1e3)  # half the extent of a space
COORDINATES = (1, 2, 7, 60)
ALWAYS_SOLVED = 2  # largest number of coordinates in which any planner has to succeed, even an undirected single tree
SPACE_SECONDS = 5.0  # [s] for problems that take milliseconds
BRIEF = 0.3  # [s] for problems for which no path has to be found
# Two configurations of two coordinates and an angle, on different sides of a wall.
TURNED = (-0.5, 0.0, 0.3), (0.5, 0.0, -0.3)
COARSE = 0.02  # resolution of OMPL's checks of an edge, as a share of the extent


def check_planner(factory: Factory, *, single_joint_moves: bool = False) -> None:
    """Check that a planner keeps the contract of :class:`SafePlanner`.

    Args:
        factory: Makes a planner: ``factory(si)`` and ``factory(si, seed=7)``.
        single_joint_moves: Require that every edge of a path moves exactly one coordinate.

    Raises:
        InputError: If the factory cannot be called.
        PlannerError: At the first clause that is broken; its text names the clause.
    """
    if not callable(factory):
        raise InputError(f"planner to check: expected a function or class that makes it, got {factory!r}")
    with suppress(ValueError):  # OMPL's own classes state no signature
        try:
            signature(factory).bind(None, seed=7)
        except TypeError as error:
            raise InputError(f"planner to check: it is called as factory(si, seed=7): {error}") from None

    clauses = (*CONTRACT, moves_one_joint_at_a_time) if single_joint_moves else CONTRACT
    for clause in clauses:
        clause(factory)


def solves_and_ends_exactly(factory: Factory) -> None:
    """A plain SimpleSetup is solved with EXACT_SOLUTION; the path has exactly the given ends, every edge is free."""
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
    """Of several starts and goals, invalid ones are ignored, and a path joins two of the valid ones."""
    starts = (INSIDE_OBSTACLE, START, (-1.5, 0.0, 0.0))
    goals = (INSIDE_OBSTACLE, OUTSIDE_BOUNDS, GOAL, (1.5, 0.0, 0.0))
    setup, status, _ = attempt(factory, starts=starts, goals=goals)
    require_status(status, "Exact solution", "several starts and goals")

    rows = solution_rows(setup)
    ends = None if rows is None else (tuple(rows[0].tolist()), tuple(rows[-1].tolist()))
    require(ends is not None and ends[0] in starts[1:] and ends[1] in goals[2:], "the path has other ends", ends)


def survives_a_broken_checker(factory: Factory) -> None:
    """An exception in the validity checker gives CRASH with its text in ``error``; the planner is usable afterwards."""
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
    """OMPL's Benchmark runs the planner, as an object and through a planner allocator."""
    setup = small_problem()
    benchmark = ot.Benchmark(setup, "contract")
    benchmark.addPlanner(factory(setup.getSpaceInformation()))
    benchmark.addPlannerAllocator(lambda si: factory(si))

    benchmark.benchmark(ot.Request(SECONDS, 4096.0, 2, 0.05, False, False, False))
    planners = benchmark.getRecordedExperimentData().planners
    solved = [run["solved BOOLEAN"] for planner in planners for run in planner.runs]

    require(solved == ["1"] * 4, "not every benchmark run is solved", solved)


def asks_for_every_edge(factory: Factory) -> None:
    """Each edge of an exact path has been checked as a whole, among discs that a coarse check can miss, for 200 seeds.

    A planner that often fails there is tried with fewer seeds.
    """
    begun = time.monotonic()
    for seed in range(SEEDS):
        setup = box_problem(2.0, _between_discs, [(-2.0, -2.0)], [(2.0, 2.0)], dof=2)
        setup.getSpaceInformation().setStateValidityCheckingResolution(COARSE)
        setup.setPlanner(factory(setup.getSpaceInformation(), seed=seed))

        if str(setup.solve(BRIEF)) == "Exact solution":
            require(bool(setup.getSolutionPath().check()), f"seed {seed}: an edge of an exact path is not valid", seed)
        elif time.monotonic() > begun + SPACE_SECONDS:
            break


def does_not_depend_on_the_unit(factory: Factory) -> None:
    """The way round a wall is found whether the coordinates are thousandths, ones or thousands."""
    for extent in UNITS:

        def valid(state: ob.State, extent: float = extent) -> bool:
            return bool(abs(state[0] / extent) >= 0.1 or state[1] / extent >= 0.2)

        for seed in range(3):
            ends = (-0.5 * extent, -0.5 * extent), (0.5 * extent, -0.5 * extent)
            setup = box_problem(extent, valid, ends[:1], ends[1:], dof=2)
            setup.setPlanner(factory(setup.getSpaceInformation(), seed=seed))

            what = f"a space from {-extent:g} to {extent:g}, seed {seed}"
            require_status(str(setup.solve(SPACE_SECONDS)), "Exact solution", what)
            require(bool(setup.getSolutionPath().check()), f"{what}: the path is not valid", seed)


def works_in_any_dimension(factory: Factory) -> None:
    """Spaces of 1, 2, 7 and 60 coordinates never give a crash or an invalid path; up to 2 are solved exactly."""
    for dof in COORDINATES:
        seconds = SPACE_SECONDS if dof <= ALWAYS_SOLVED else BRIEF
        setup = box_problem(1.0, lambda _: True, [np.full(dof, -0.8)], [np.full(dof, 0.8)], dof=dof)
        planner = factory(setup.getSpaceInformation(), seed=1)
        setup.setPlanner(planner)

        status = str(setup.solve(seconds))
        require(getattr(planner, "error", None) is None, f"{dof} coordinates", getattr(planner, "error", None))
        if dof <= ALWAYS_SOLVED:
            require_status(status, "Exact solution", f"{dof} coordinates")
        if status == "Exact solution":
            require(bool(setup.getSolutionPath().check()), f"{dof} coordinates: the path is not valid", status)


def takes_starts_that_lead_nowhere(factory: Factory) -> None:
    """A start that is enclosed does not keep a planner from finding a path from another one, whichever comes first."""
    for starts in ((START, (1.5, 1.5, 1.5)), ((1.5, 1.5, 1.5), START)):
        setup = small_problem(outside_wall, starts=starts)
        setup.setPlanner(factory(setup.getSpaceInformation(), seed=1))
        require_status(str(setup.solve(SPACE_SECONDS)), "Exact solution", "several starts, one of them shut in")
        require(bool(setup.getSolutionPath().check()), "several starts: the path is not valid", starts)


def says_when_there_was_no_time(factory: Factory) -> None:
    """A solve without time gives TIMEOUT, not INVALID_GOAL; the condition may be a function with an interval."""
    setup = small_problem()
    planner = factory(setup.getSpaceInformation(), seed=1)
    setup.setPlanner(planner)
    setup.setup()

    require_status(str(planner.solve(0.0)), "Timeout", "a solve without time")
    begun = time.monotonic()
    status = str(planner.solve(lambda: time.monotonic() > begun + SPACE_SECONDS, 0.01))
    require_status(status, "Exact solution", "a solve with a function and an interval")


def turns_either_way(factory: Factory) -> None:
    """In SE(2) and in a compound with SO(2), a path turns through half a turn if the shorter way is blocked."""
    for space, write in ((_plane(), _write_plane), (_arm(), _write_arm)):
        setup = og.SimpleSetup(space)
        setup.setStateValidityChecker(_past_half_a_turn)

        si = setup.getSpaceInformation()
        ends = si.allocState(), si.allocState()
        for state, q in zip(ends, TURNED, strict=True):
            write(state, q)
        setup.setStartAndGoalStates(*ends)

        # Solve it, and check the status, the edges and the ends of the path.
        planner = factory(si, seed=1)
        setup.setPlanner(planner)

        status = str(setup.solve(SPACE_SECONDS))
        what = f"a {type(space).__name__} with an angle"
        require(getattr(planner, "error", None) is None, what, getattr(planner, "error", None))
        require_status(status, "Exact solution", what)

        path = setup.getSolutionPath()
        require(bool(path.check()), f"{what}: the path is not valid", status)
        for state, k in zip(ends, (0, path.getStateCount() - 1), strict=True):
            require(bool(space.equalStates(path.getState(k), state)), f"{what}: the path does not end exactly", k)


SPACES: tuple[Clause, ...] = (
    asks_for_every_edge,
    does_not_depend_on_the_unit,
    works_in_any_dimension,
    takes_starts_that_lead_nowhere,
    says_when_there_was_no_time,
    turns_either_way,
)


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


def _between_discs(state: ob.State) -> bool:
    x = (3.0 * state[0]) % 1.0 - 0.5
    y = (3.0 * state[1]) % 1.0 - 0.5
    return bool(x * x + y * y > 0.09)


def _plane() -> ob.StateSpace:
    space = ob.SE2StateSpace()
    space.setBounds(_square())
    return space


def _arm() -> ob.StateSpace:
    space = ob.CompoundStateSpace()
    sliding = ob.RealVectorStateSpace(2)
    sliding.setBounds(_square())
    space.addSubspace(ob.SO2StateSpace(), 1.0)
    space.addSubspace(sliding, 0.5)
    return space


def _square() -> ob.RealVectorBounds:
    bounds = ob.RealVectorBounds(2)
    bounds.setLow(-1.0)
    bounds.setHigh(1.0)
    return bounds


def _write_plane(state: ob.State, q: tuple[float, float, float]) -> None:
    state.setXY(*q[:2])
    state.setYaw(q[2])


def _write_arm(state: ob.State, q: tuple[float, float, float]) -> None:
    state[0].value = q[2]
    state[1][0:2] = list(q[:2])


def _past_half_a_turn(state: ob.State) -> bool:
    """Check a state against a wall with one opening, at angles near half a turn."""
    x, angle = (state.getX(), state.getYaw()) if hasattr(state, "getYaw") else (state[1][0], state[0].value)
    return bool(abs(x) > 0.1 or abs(angle) > 2.5)


def small_problem(
    valid: Callable[[ob.State], bool] | None = None,
    starts: Iterable[ArrayLike] = (START,),
    goals: Iterable[ArrayLike] = (GOAL,),
) -> og.SimpleSetup:
    """Return a SimpleSetup in three dimensions with an upright bar as obstacle and a Python validity checker.

    Args:
        valid: Replaces the validity checker.
        starts: Configurations, shape (3,) each.
        goals: Configurations, shape (3,) each.
    """
    return box_problem(2.0, valid or outside_bar, starts, goals, dof=DOF)


def box_problem(
    extent: float,
    valid: Callable[[ob.State], bool],
    starts: Iterable[ArrayLike],
    goals: Iterable[ArrayLike],
    *,
    dof: int,
) -> og.SimpleSetup:
    """Return a SimpleSetup with coordinates from minus ``extent`` to ``extent`` and a Python validity checker.

    Args:
        extent: Above 0 [unit of the space].
        valid: The validity checker.
        starts: Configurations, shape (n,) each.
        goals: Configurations, shape (n,) each.
        dof: Number of coordinates, n.
    """
    space = ob.RealVectorStateSpace(dof)
    bounds = ob.RealVectorBounds(dof)
    bounds.setLow(-extent)
    bounds.setHigh(extent)
    space.setBounds(bounds)

    setup = og.SimpleSetup(space)
    setup.setStateValidityChecker(valid)
    si = setup.getSpaceInformation()

    io = StateIO(si)
    state = si.allocState()
    goal = ob.GoalStates(si)

    for start in starts:
        io.write(state, np.asarray(start, dtype=np.float64))
        setup.addStartState(state)
    for end in goals:
        io.write(state, np.asarray(end, dtype=np.float64))
        goal.addState(state)

    setup.setGoal(goal)
    return setup


def outside_bar(state: ob.State) -> bool:
    """Check a state of :func:`small_problem` against a bar whose axis is the third coordinate axis."""
    return bool(abs(state[0]) > 0.5 or abs(state[1]) > 0.5)


def outside_wall(state: ob.State) -> bool:
    """Check a state of :func:`small_problem` against a wall between START and GOAL that no path avoids."""
    return bool(abs(state[0]) > 0.5)


def solution_rows(setup: og.SimpleSetup) -> Matrix | None:
    """Return the path of a SimpleSetup, shape (k, n), or None."""
    path = setup.getProblemDefinition().getSolutionPath()
    if path is None:
        return None
    io = StateIO(setup.getSpaceInformation())
    return np.array([io.read(path.getState(i)) for i in range(path.getStateCount())])


def attempt(factory: Factory, *, seed: int = 1, **problem: Any) -> tuple[og.SimpleSetup, ob.PlannerStatus, ob.Planner]:
    """Solve the small problem, and return the setup, the status and the planner."""
    setup = small_problem(**problem)
    planner = factory(setup.getSpaceInformation(), seed=seed)
    setup.setPlanner(planner)
    return setup, setup.solve(SECONDS), planner


def solved(factory: Factory, *, seed: int = 1) -> tuple[og.SimpleSetup, Matrix, ob.Planner]:
    """Solve the small problem, which must succeed, and return the setup, the path, shape (k, n), and the planner."""
    setup, status, planner = attempt(factory, seed=seed)
    require_status(status, "Exact solution", "the small problem")

    rows = solution_rows(setup)
    if rows is None:
        raise PlannerError("check_planner: EXACT_SOLUTION without a path")
    return setup, rows, planner


def require_status(status: ob.PlannerStatus | str, wanted: str, what: str) -> None:
    """Raise a PlannerError unless the status, in OMPL's words, is the wanted one."""
    if str(status) != wanted:
        raise PlannerError(f"check_planner: {what}: expected the status '{wanted}', got '{status}'")


def require(condition: bool, what: str, found: object) -> None:
    """Raise a PlannerError with a text and the found value unless the condition holds."""
    if not condition:
        raise PlannerError(f"check_planner: {what}: {found}")
