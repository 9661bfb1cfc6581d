"""The planner "auto": planners that make up for each other's weaknesses, by turns, and a little shortening."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import cache
from itertools import chain
from types import MappingProxyType
from typing import Any

from rrtik_ompl.base.errors import InputError, PlannerError
from rrtik_ompl.kernels.search.shortcut_layout import KERNELS as SHORTCUT_KERNELS
from rrtik_ompl.kernels.search.taut.layout import KERNELS as TAUT_KERNELS
from rrtik_ompl.kernels.warming import load_together
from rrtik_ompl.model.goal import TipGoal
from rrtik_ompl.ompl_bridge.planner_names import AUTO, find_planner, refuse_options
from rrtik_ompl.ompl_bridge.planner_traits import PlannerTraits, planners_with, traits_of
from rrtik_ompl.planning.one_planner import run_planner
from rrtik_ompl.planning.outcome import Plan, Request
from rrtik_ompl.planning.shortening import shorten
from rrtik_ompl.world.kept_clearance import possible_clearance
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.proof import PROOF_KERNELS
from rrtik_ompl.world.proven_motions import KERNELS as PROVEN_KERNELS

SHARE = 0.5  # of the time left, for each planner but the last
SHORTENING_CHECKS = 600  # motions, which take some 10 ms; a count, so that the same seed gives the same path


def run_portfolio(problem: Problem, request: Request) -> Plan:
    """Let one planner after the other search until one finds a path, best a proven one, and shorten that.

    Args:
        problem: What to solve.
        request: Time, seed and the rest; options of planners make no sense here.

    Returns:
        The plan of the planner that found the path, with the time and the counts of all that tried.

    Raises:
        InputError: If there are options, or no package offers a planner for this.
        PlannerError: If every planner broke.
    """
    refuse_options(request.parameters)
    _load_kernels(problem)
    best, reasons, totals, spent = _search(problem, request)
    path, left = best.path, request.seconds - spent
    if path is not None and len(path.waypoints) > 2 and left > 0.0:
        begin = time.perf_counter()
        clearance = possible_clearance(problem.world, request.clearance, path.waypoints)
        limits: dict[str, Any] = {"seconds": left, "checks": SHORTENING_CHECKS, "clearance": clearance}
        shorter = shorten(path, problem, method="auto", one_joint=False, seed=request.seed, **limits)
        path = shorter.with_waypoints(shorter.waypoints) if request.proof == "off" else shorter
        spent += time.perf_counter() - begin
    reason = "" if best.found else reasons
    return replace(best, path=path, reason=reason, seconds=spent, statistics=MappingProxyType(totals))


def _load_kernels(problem: Problem) -> None:
    """Load what the first planner and the shortening will use: the first time on a machine that takes a while."""
    if problem.world.fast is not None:
        first = [traits_of(find_planner(name)).kernels for name in members(problem)[:1]]
        load_together((*chain.from_iterable(first), PROOF_KERNELS, SHORTCUT_KERNELS, PROVEN_KERNELS, TAUT_KERNELS))


def _search(problem: Problem, request: Request) -> tuple[Plan, str, dict[str, int | float], float]:
    """The best plan of the planners that tried, why the others found none, the counts of all, and their time [s]."""
    names, spent = members(problem), 0.0
    best: Plan | None = None
    broken: PlannerError | None = None
    reasons: list[str] = []
    totals: dict[str, int | float] = {}
    for number, name in enumerate(names):
        share = 1.0 if number == len(names) - 1 else SHARE
        left = share * (request.seconds - spent)
        if left <= 0.0:
            break
        begin = time.perf_counter()
        try:
            tried = run_planner(problem, name, find_planner(name), replace(request, seconds=left))
        except PlannerError as error:
            broken = error
            reasons.append(str(error))
            spent += time.perf_counter() - begin
            continue
        spent += tried.seconds
        for key, value in tried.statistics.items():
            totals[key] = totals.get(key, 0) + value
        reasons += [] if tried.found else [f"{name}: {tried.reason}"]
        best = tried if best is None or not best.found or _rank(tried) < _rank(best) else best
        if best.found and best.proven is not False:
            break
    if best is None:
        raise broken or InputError(f"planner '{AUTO}': no planner is installed; name one of OMPL's, such as RRTConnect")
    return best, "; ".join(reasons), totals, spent


def members(problem: Problem) -> tuple[str, ...]:
    """Names of the planners that try a problem, in their order: those that seek the tip only if the goal is one.

    With path constraints those that keep them.
    """
    if problem.constraints:
        return tuple(planners_with(lambda traits: traits.keeps_constraints))
    tip = isinstance(problem.goal, TipGoal)
    return tuple(name for name, traits in _by_turn() if tip or not traits.finds_goals)


@cache
def _by_turn() -> tuple[tuple[str, PlannerTraits], ...]:
    """The planners of the portfolio and their traits, in the order of their turns."""
    found = planners_with(lambda traits: traits.portfolio_turn)
    return tuple(sorted(found.items(), key=lambda item: item[1].portfolio_turn))


def _rank(plan: Plan) -> tuple[bool, bool]:
    """What is to be small: no path, then a path that is not proven."""
    return not plan.found, plan.proven is False
