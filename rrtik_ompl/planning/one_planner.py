"""One planner at one problem, within a time limit: attempts, second check, and an outcome in words."""

from __future__ import annotations

import time
from types import MappingProxyType

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.ik.methods import load_kernels
from rrtik_ompl.kernels.warming import load_together
from rrtik_ompl.ompl_bridge.attempt import attempt_seeds
from rrtik_ompl.ompl_bridge.planner_options import check_options
from rrtik_ompl.ompl_bridge.planner_traits import PlannerFactory, planners_with, traits_of
from rrtik_ompl.planning.attempts import Search
from rrtik_ompl.planning.outcome import Plan, Request
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.proof import PROOF_KERNELS


def run_planner(problem: Problem, name: str, factory: PlannerFactory, request: Request) -> Plan:
    """Let a planner search for a path that the second check accepts.

    Args:
        problem: What to solve.
        name: Of the planner, for messages.
        factory: Makes the planner.
        request: Time, seed and the rest.

    Raises:
        InputError: If the planner does not take a parameter.
        PlannerError: If the planner broke.
    """
    if problem.constraints:
        _refuse_if_it_breaks_constraints(name, factory)
    load_kernels_for(problem, factory)
    begin = time.perf_counter()
    search = Search(
        problem,
        factory,
        name,
        begin + request.seconds,
        attempt_seeds(request.seed, request.restarts),
        request.parameters,
        request.proof,
        request.clearance,
        iterations=request.iterations,
    )
    if _nothing_to_do(problem):  # some planners would find a detour
        check_options(factory, name, request.parameters)
        path = search.still()
    else:
        path = search.run()
    elapsed, reason = time.perf_counter() - begin - search.counting, search.reason
    if path is None and elapsed >= request.seconds:
        attempts = search.totals["attempts"]
        tried = f"{attempts} attempt{'s' * (attempts != 1)}"
        reason = f"no path within {request.seconds:g} s of wall time ({tried}; the last one: {reason or 'out of time'})"
    counts = MappingProxyType(search.totals)
    return Plan(path is not None, path, reason, elapsed, name, request.seed, counts, problem=problem)


def load_kernels_for(problem: Problem, factory: PlannerFactory) -> None:
    """Load what the search will use: compiling it for the first time is no part of planning."""
    if problem.goal.q is None:
        load_kernels(problem.robot)
    if problem.world.fast is not None or problem.constraints:
        load_together((*traits_of(factory).kernels, PROOF_KERNELS))


def _refuse_if_it_breaks_constraints(name: str, factory: PlannerFactory) -> None:
    """Refuse a planner whose paths would leave the regions of a problem's path constraints."""
    traits = traits_of(factory)
    if traits.keeps_constraints:
        return
    able = ", ".join(planners_with(lambda traits: traits.keeps_constraints)) or "none is installed"
    why = "moves one joint at a time, which leaves their regions" if traits.one_joint else "does not keep them"
    raise InputError(f"planner {name}: the problem has path constraints, and it {why}; use {able}")


def _nothing_to_do(problem: Problem) -> bool:
    """Whether the start is the goal, to the bit if that is a configuration; a `Problem` has checked its start."""
    if problem.goal.q is not None:
        return bool((problem.start == problem.goal.q).all())
    return problem.reached(problem.start)
