"""The search by planners, by one that is named or by those of "auto", where `short_path` finds or does nothing."""

from __future__ import annotations

from dataclasses import replace

from rrtik_ompl.description.catalog import is_auto
from rrtik_ompl.ompl_bridge.planner_names import find_planner
from rrtik_ompl.ompl_bridge.planner_traits import PlannerFactory, traits_of
from rrtik_ompl.planning.attempts import run_planner
from rrtik_ompl.planning.outcome import NamedPlanner, Plan, Request
from rrtik_ompl.planning.portfolio import run_portfolio
from rrtik_ompl.world.problem import Problem

ANYTIME_SHARE = 0.8  # share of the time for a planner that would use all of it, where its path is shortened


def searched(
    problem: Problem, planner: str | PlannerFactory, request: Request, *, finish_follows: bool = False
) -> Plan:
    """Return a plan with the planner's own path, and the member of a goal set that it reaches.

    Args:
        problem: The problem to solve.
        planner: The planner.
        request: What is asked for.
        finish_follows: Whether some time has to be left by planners that would use all of it.
    """
    if isinstance(planner, str) and is_auto(planner):
        found = run_portfolio(problem, request)
    else:
        named = named_planner(planner)
        share = ANYTIME_SHARE if finish_follows and traits_of(named.factory).anytime else 1.0
        budget = replace(request.budget, seconds=share * request.budget.seconds)
        found = run_planner(problem, named, request, budget)
    if found.path is None:
        return found
    return replace(found, member=problem.goal.member_at(problem.robot, found.path.end))


def named_planner(planner: str | PlannerFactory) -> NamedPlanner:
    """Return a planner with its name; a name is looked up, a class goes by its own name.

    Raises:
        UnknownNameError: If there is no planner class of that name; "auto" has none.
    """
    if isinstance(planner, str):
        return NamedPlanner(planner, find_planner(planner))
    return NamedPlanner(planner.__name__, planner)
