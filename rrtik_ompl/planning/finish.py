"""What follows a search: its path is shortened, by the same rule whoever planned."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from types import MappingProxyType
from typing import Any

from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.choices import ShorteningMethod
from rrtik_ompl.kernels.search.contacts.layout import KERNELS as PULL_KERNELS
from rrtik_ompl.kernels.warming import load_together
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.planning.moves.rules import OPTIONS, MoveRules
from rrtik_ompl.planning.outcome import Plan, Request
from rrtik_ompl.planning.shortening import Wishes, shorten, shortened
from rrtik_ompl.world.clearances import possible_clearance
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.proven_motions import KERNELS as PROVEN_KERNELS


def finished(problem: Problem, found: Plan, request: Request, method: ShorteningMethod) -> Plan:
    """Return a plan whose path is shortened and proven, with the path of the planner as ``unshortened``.

    The path keeps the rules of single-joint moves among the options of the planner, and the clearance of the request as
    far as its ends allow. The seed decides on the result unless the time of the request cuts in.

    Args:
        problem: The problem that was planned.
        found: The plan; it is returned as it is without a path, without a bend in it, or without time left.
        request: Its request.
        method: The method of shortening.

    Returns:
        The plan with the shorter path. Its statistics also have ``shortening_seconds``, which ``seconds`` contains.
        Ctrl-C ends the work and leaves the path that was found, unless there are many requests.
    """
    path = found.path
    if path is None or len(path.waypoints) < 3:
        return found
    budget = _time_left(problem, found, request)
    if budget.over():
        return found

    shorter = path
    with suppress(*request.survived):
        shorter = shorten(
            path,
            problem,
            method=method,
            seed=request.budget.seed,
            rules=rules_among(request.parameters, problem.robot) if path.one_joint_at_a_time else None,
            clearance=possible_clearance(problem.world, request.clearance, path.waypoints),
            stop=budget.over,
        )

    seconds = budget.elapsed
    return replace(
        found,
        path=_as_proven_as_asked(shorter, request),
        unshortened=path,
        seconds=found.seconds + seconds,
        statistics=MappingProxyType({**found.statistics, "shortening_seconds": seconds}),
    )


def briefly_shortened(problem: Problem, found: Plan, request: Request) -> Plan:
    """Return a plan whose path is shortened by "auto", as far as there is time, without the care of ``shorten()``."""
    path = found.path
    if path is None or len(path.waypoints) < 3:
        return found
    budget = _time_left(problem, found, request)
    if budget.over():
        return found

    clearance = possible_clearance(problem.world, request.clearance, path.waypoints)
    shorter = shortened(path, problem, Wishes(Budget(budget.seed, stop=budget.over), clearance=clearance))
    return replace(found, path=_as_proven_as_asked(shorter, request), seconds=found.seconds + budget.elapsed)


def rules_among(options: Mapping[str, Any], robot: Robot) -> MoveRules | None:
    """Return the rules of single-joint moves that are among the options of a planner; None if there are none."""
    rules = {name: value for name, value in options.items() if name in OPTIONS}
    return MoveRules.of_robot(robot, **rules) if rules else None


def _time_left(problem: Problem, found: Plan, request: Request) -> Budget:
    """Return the budget of what follows a search, which begins when the kernels of shortening are loaded."""
    if problem.world.fast is not None:
        load_together((PULL_KERNELS, PROVEN_KERNELS))
    return replace(request.budget, seconds=request.budget.seconds - found.seconds).begun_now()


def _as_proven_as_asked(path: JointPath, request: Request) -> JointPath:
    """Return a shortened path; without its proof if no proofs are asked for."""
    return path.with_waypoints(path.waypoints) if request.proof == "off" else path
