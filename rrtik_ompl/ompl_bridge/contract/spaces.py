"""Clauses of the contract that ask a planner in many spaces: units, numbers of coordinates, seeds, starts.

An exact path has to stand OMPL's own ``PathGeometric.check()``, which asks every edge of it again.
"""

from __future__ import annotations

import time

import numpy as np
from ompl import base as ob
from ompl import geometric as og

from rrtik_ompl.ompl_bridge.contract.problems import (
    START,
    Clause,
    Factory,
    box_problem,
    outside_wall,
    require,
    require_status,
    small_problem,
)

SEEDS = 200
UNITS = (1e-3, 1.0, 1e3)  # half the extent of a space
COORDINATES = (1, 2, 7, 60)
ALWAYS_SOLVED = 2  # coordinates: a single tree without aim, which is a planner too, is lost in many more
SECONDS = 5.0  # [s] for problems that take milliseconds
BRIEF = 0.3  # [s] where no path need be found
TURNED = (-0.5, 0.0, 0.3), (0.5, 0.0, -0.3)  # two coordinates and an angle, on both sides of a wall
COARSE = 0.02  # of the extent, between two looks of OMPL at an edge


def asks_for_every_edge(factory: Factory) -> None:
    """Each edge of an exact path was asked as a whole: among discs that a coarse look can miss, 200 seeds.

    A planner that is often lost there is asked of fewer.
    """
    begun = time.monotonic()
    for seed in range(SEEDS):
        setup = box_problem(2.0, _between_discs, [(-2.0, -2.0)], [(2.0, 2.0)], dof=2)
        setup.getSpaceInformation().setStateValidityCheckingResolution(COARSE)
        setup.setPlanner(factory(setup.getSpaceInformation(), seed=seed))

        if str(setup.solve(BRIEF)) == "Exact solution":
            require(bool(setup.getSolutionPath().check()), f"seed {seed}: an edge of an exact path is not valid", seed)
        elif time.monotonic() > begun + SECONDS:
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
            require_status(str(setup.solve(SECONDS)), "Exact solution", what)
            require(bool(setup.getSolutionPath().check()), f"{what}: the path is not valid", seed)


def works_in_any_dimension(factory: Factory) -> None:
    """Spaces of 1, 2, 7 and 60 coordinates: exact where there are two at most, never a crash or a path that is none."""
    for dof in COORDINATES:
        seconds = SECONDS if dof <= ALWAYS_SOLVED else BRIEF
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
    """A start that is shut in does not keep a planner from one that sees the goal, whichever comes first."""
    for starts in ((START, (1.5, 1.5, 1.5)), ((1.5, 1.5, 1.5), START)):
        setup = small_problem(outside_wall, starts=starts)
        setup.setPlanner(factory(setup.getSpaceInformation(), seed=1))
        require_status(str(setup.solve(SECONDS)), "Exact solution", "several starts, one of them shut in")
        require(bool(setup.getSolutionPath().check()), "several starts: the path is not valid", starts)


def says_when_there_was_no_time(factory: Factory) -> None:
    """No time at all gives TIMEOUT, not a word against the goal; a condition may be a function with an interval."""
    setup = small_problem()
    planner = factory(setup.getSpaceInformation(), seed=1)
    setup.setPlanner(planner)
    setup.setup()

    require_status(str(planner.solve(0.0)), "Timeout", "a solve without time")
    begun = time.monotonic()
    status = str(planner.solve(lambda: time.monotonic() > begun + SECONDS, 0.01))
    require_status(status, "Exact solution", "a solve with a function and an interval")


def turns_either_way(factory: Factory) -> None:
    """In SE(2) and in a compound with SO(2) a path leads past half a turn where the short way round is shut."""
    for space, write in ((_plane(), _write_plane), (_arm(), _write_arm)):
        setup = og.SimpleSetup(space)
        setup.setStateValidityChecker(_past_half_a_turn)

        si = setup.getSpaceInformation()
        ends = si.allocState(), si.allocState()
        for state, q in zip(ends, TURNED, strict=True):
            write(state, q)
        setup.setStartAndGoalStates(*ends)

        planner = factory(si, seed=1)
        setup.setPlanner(planner)

        status = str(setup.solve(SECONDS))
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
    """Free but for a wall with one opening, near half a turn."""
    x, angle = (state.getX(), state.getYaw()) if hasattr(state, "getYaw") else (state[1][0], state[0].value)
    return bool(abs(x) > 0.1 or abs(angle) > 2.5)
