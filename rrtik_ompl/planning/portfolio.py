"""The planner "auto": planners that make up for each other's weaknesses, by turns, and a little shortening."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain
from types import MappingProxyType

from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.description.catalog import portfolio
from rrtik_ompl.kernels.search.shortcut_layout import KERNELS as SHORTCUT_KERNELS
from rrtik_ompl.kernels.search.taut.layout import KERNELS as TAUT_KERNELS
from rrtik_ompl.kernels.warming import load_together
from rrtik_ompl.model.goal import TipGoal
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.ompl_bridge.planner_names import AUTO, find_planner, refuse_options
from rrtik_ompl.ompl_bridge.planner_traits import traits_of
from rrtik_ompl.planning.attempts import Turn, walk
from rrtik_ompl.planning.outcome import NamedPlanner, Plan, Request
from rrtik_ompl.planning.shortening import Wishes, shortened
from rrtik_ompl.world.clearances import possible_clearance
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
    turns: list[Turn] = []
    for turn in walk(_turns(problem, request)):
        turns.append(turn)
        if turn.path is not None and turn.plan().proven is not False:
            break

    best = _best(turns)
    reason = "" if best.found else "; ".join(_reason(turn) for turn in turns if turn.path is None)
    counts = MappingProxyType(_totals(turns))

    spent = sum(turn.seconds for turn in turns)
    left = replace(request.budget, seconds=request.budget.seconds - spent).begun_now()
    path = None if best.path is None else _shortened(best.path, problem, request, left)
    return replace(best, path=path, reason=reason, seconds=spent + left.elapsed, statistics=counts)


def members(problem: Problem) -> tuple[str, ...]:
    """Names of the planners that try a problem, in their order: those that seek the tip only if the goal is one.

    With path constraints those that keep them.
    """
    if problem.constraints:
        wanted = {"path constraints"}
    elif isinstance(problem.goal, TipGoal):
        wanted = {"any goal", "goal of the tip"}
    else:
        wanted = {"any goal"}
    return tuple(name for name, solves in portfolio().items() if solves in wanted)


def _load_kernels(problem: Problem) -> None:
    """Load what the first planner and the shortening will use: the first time on a machine that takes a while."""
    if problem.world.fast is not None:
        first = [traits_of(find_planner(name)).kernels for name in members(problem)[:1]]
        load_together((*chain.from_iterable(first), PROOF_KERNELS, SHORTCUT_KERNELS, PROVEN_KERNELS, TAUT_KERNELS))


def _turns(problem: Problem, request: Request) -> Iterator[Turn]:
    """The turns of the planners, each with a share of the time that is left then, as long as there is any."""
    names = members(problem)
    left = request.budget.seconds
    for name in names:
        if left <= 0.0:
            return
        share = 1.0 if name == names[-1] else SHARE
        planner = NamedPlanner(name, find_planner(name))
        turn = Turn(problem, planner, request, replace(request.budget, seconds=share * left))
        yield turn  # `walk` asks for the next one when this one is over
        left -= turn.seconds


def _best(turns: Sequence[Turn]) -> Plan:
    """Of the first turn with a proven path, or else with any, or else of the last one whose planner did not break."""
    plans = [turn.plan() for turn in turns if turn.error is None]
    if not plans:
        broken = turns[-1].error if turns else None
        raise broken or InputError(f"planner '{AUTO}': no planner is installed; name one of OMPL's, such as RRTConnect")

    found = [plan for plan in plans if plan.found]
    return min(found, key=lambda plan: plan.proven is False, default=plans[-1])


def _reason(turn: Turn) -> str:
    return f"{turn.planner.name}: {turn.reason}" if turn.error is None else str(turn.error)


def _totals(turns: Sequence[Turn]) -> dict[str, int | float]:
    """The counts of all planners that did not break."""
    totals: dict[str, int | float] = {}
    for turn in turns:
        if turn.error is not None:
            continue
        for key, value in turn.totals.items():
            totals[key] = totals.get(key, 0) + value
    return totals


def _shortened(path: JointPath, problem: Problem, request: Request, budget: Budget) -> JointPath:
    """The path after a fixed number of checks, as far as there is time."""
    if len(path.waypoints) < 3 or budget.over():
        return path

    clearance = possible_clearance(problem.world, request.clearance, path.waypoints)
    counted = replace(budget, iterations=SHORTENING_CHECKS)
    shorter = shortened(path, problem, Wishes(counted, clearance=clearance))
    return shorter.with_waypoints(shorter.waypoints) if request.proof == "off" else shorter
