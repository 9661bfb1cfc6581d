"""The planner "auto": planners with complementary strengths take turns until one finds a path."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from types import MappingProxyType

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.description.catalog import AUTO
from rrtik_ompl.ompl_bridge.planner_names import find_planner, refuse_options
from rrtik_ompl.planning.attempts import Turn, no_path_within, walk
from rrtik_ompl.planning.members import members
from rrtik_ompl.planning.outcome import NamedPlanner, Plan, Request
from rrtik_ompl.world.problem import Problem

SHARE = 0.5  # share of the time left for each planner but the last


def run_portfolio(problem: Problem, request: Request) -> Plan:
    """Let planners search one after the other until one finds a path, preferably a proven one.

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
    turns: list[Turn] = []
    for turn in walk(_turns(problem, request)):
        turns.append(turn)
        if turn.path is not None and turn.plan().proven is not False:
            break

    best = _best(turns)
    totals = _totals(turns)
    reason = "" if best.found else _most_telling(turns, request.budget.seconds, totals["attempts"])
    seconds = sum(turn.seconds for turn in turns)
    return replace(best, reason=reason, seconds=seconds, statistics=MappingProxyType(totals))


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


def _most_telling(turns: Sequence[Turn], seconds: float, attempts: float) -> str:
    """Return one line that says why there is no path: a fault of the goal, or why a turn ended early, or the time."""
    whole = [turn for turn in turns if turn.error is None]
    faults = [turn.goal_fault for turn in whole if turn.goal_fault]
    others = [turn.reason for turn in whole if not turn.out_of_time]
    names = [turn.planner.name if turn.error is None else f"{turn.planner.name}, which broke" for turn in turns]
    return next(iter(faults + others), no_path_within(seconds, attempts, " and ".join(names)))


def _totals(turns: Sequence[Turn]) -> dict[str, int | float]:
    """Add up the counts of all planners that did not break."""
    totals: dict[str, int | float] = {}
    for turn in turns:
        if turn.error is not None:
            continue
        for key, value in turn.totals.items():
            totals[key] = totals.get(key, 0) + value
    return totals
