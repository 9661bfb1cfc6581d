"""The planner "auto": planners with complementary strengths take turns, and the path found is shortened a little."""

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

SHARE = 0.5  # share of the time left for each planner but the last
SHORTENING_CHECKS = 600  # motions, about 10 ms; a count, so that the result depends on the seed alone


def run_portfolio(problem: Problem, request: Request) -> Plan:
    """Let planners search one after the other until one finds a path, preferably a proven one, and shorten that path.

    Args:
        problem: The problem to solve.
        request: Time, seed and the rest; options of planners are refused.

    Returns:
        The plan of the planner that found the path, with the time and the counts of all planners that tried.

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
    """Return the names of the planners that try a problem, in their order.

    Planners for a goal of the tip are included only if the goal is one. With path constraints only the planners that
    keep them are included.
    """
    if problem.constraints:
        wanted = {"path constraints"}
    elif isinstance(problem.goal, TipGoal):
        wanted = {"any goal", "goal of the tip"}
    else:
        wanted = {"any goal"}
    return tuple(name for name, solves in portfolio().items() if solves in wanted)


def _load_kernels(problem: Problem) -> None:
    """Load the kernels of the first planner and of the shortening; compiling them takes a while once per machine."""
    if problem.world.fast is not None:
        first = [traits_of(find_planner(name)).kernels for name in members(problem)[:1]]
        load_together((*chain.from_iterable(first), PROOF_KERNELS, SHORTCUT_KERNELS, PROVEN_KERNELS, TAUT_KERNELS))


def _turns(problem: Problem, request: Request) -> Iterator[Turn]:
    """Yield the turns of the planners, each with a share of the time that is left then, while there is any."""
    names = members(problem)
    left = request.budget.seconds
    for name in names:
        if left <= 0.0:
            return
        share = 1.0 if name == names[-1] else SHARE
        planner = NamedPlanner(name, find_planner(name))
        turn = Turn(problem, planner, request, replace(request.budget, seconds=share * left))
        yield turn  # `walk` asks for the next turn when this one is over
        left -= turn.seconds


def _best(turns: Sequence[Turn]) -> Plan:
    """Return the plan of the first turn with a proven path, else of the first with any path, else of the last turn.

    Turns whose planner broke do not count; if all planners broke, the last error is raised.
    """
    plans = [turn.plan() for turn in turns if turn.error is None]
    if not plans:
        broken = turns[-1].error if turns else None
        raise broken or InputError(f"planner '{AUTO}': no planner is installed; name one of OMPL's, such as RRTConnect")

    found = [plan for plan in plans if plan.found]
    return min(found, key=lambda plan: plan.proven is False, default=plans[-1])


def _reason(turn: Turn) -> str:
    return f"{turn.planner.name}: {turn.reason}" if turn.error is None else str(turn.error)


def _totals(turns: Sequence[Turn]) -> dict[str, int | float]:
    """Add up the counts of all planners that did not break."""
    totals: dict[str, int | float] = {}
    for turn in turns:
        if turn.error is not None:
            continue
        for key, value in turn.totals.items():
            totals[key] = totals.get(key, 0) + value
    return totals


def _shortened(path: JointPath, problem: Problem, request: Request, budget: Budget) -> JointPath:
    """Shorten a path with a fixed number of checked motions, as far as there is time."""
    if len(path.waypoints) < 3 or budget.over():
        return path

    clearance = possible_clearance(problem.world, request.clearance, path.waypoints)
    counted = replace(budget, iterations=SHORTENING_CHECKS)
    shorter = shortened(path, problem, Wishes(counted, clearance=clearance))
    return shorter.with_waypoints(shorter.waypoints) if request.proof == "off" else shorter
