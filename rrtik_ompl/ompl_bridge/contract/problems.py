"""The small problems in plain OMPL by which planners are checked, and what a clause of the contract needs."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from ompl import base as ob
from ompl import geometric as og

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.errors import PlannerError
from rrtik_ompl.ompl_bridge.states import StateIO

Factory = Callable[..., ob.Planner]  # factory(si) and factory(si, seed=...) make a planner
Clause = Callable[[Factory], None]

DOF = 3
SECONDS = 10.0  # [s] for problems that take milliseconds
START, GOAL = (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)


def small_problem(
    valid: Callable[[ob.State], bool] | None = None,
    starts: Iterable[ArrayLike] = (START,),
    goals: Iterable[ArrayLike] = (GOAL,),
) -> og.SimpleSetup:
    """A SimpleSetup in three dimensions with an upright bar as the obstacle, and a Python validity checker.

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
    """A SimpleSetup whose coordinates go from minus ``extent`` to ``extent``, with a Python validity checker.

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
    """The validity checker of :func:`small_problem`: outside a bar with the third axis as its axis."""
    return bool(abs(state[0]) > 0.5 or abs(state[1]) > 0.5)


def outside_wall(state: ob.State) -> bool:
    """A validity checker for :func:`small_problem` with a wall that no path leads round, between START and GOAL."""
    return bool(abs(state[0]) > 0.5)


def solution_rows(setup: og.SimpleSetup) -> Matrix | None:
    """The path that a SimpleSetup holds, shape (k, n), or None."""
    path = setup.getProblemDefinition().getSolutionPath()
    if path is None:
        return None
    io = StateIO(setup.getSpaceInformation())
    return np.array([io.read(path.getState(i)) for i in range(path.getStateCount())])


def attempt(factory: Factory, *, seed: int = 1, **problem: Any) -> tuple[og.SimpleSetup, ob.PlannerStatus, ob.Planner]:
    """A solve of the small problem: the setup, the status, the planner."""
    setup = small_problem(**problem)
    planner = factory(setup.getSpaceInformation(), seed=seed)
    setup.setPlanner(planner)
    return setup, setup.solve(SECONDS), planner


def solved(factory: Factory, *, seed: int = 1) -> tuple[og.SimpleSetup, Matrix, ob.Planner]:
    """A solve that must succeed: the setup, the path, the planner."""
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
    """Raise a PlannerError that says what is wrong, and what was found, unless the condition holds."""
    if not condition:
        raise PlannerError(f"check_planner: {what}: {found}")
