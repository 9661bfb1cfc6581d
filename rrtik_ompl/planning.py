"""`plan()`: from a problem to a path that has been checked twice, or to the reason why there is none."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from rrtik_ompl import catalog
from rrtik_ompl.arrays import Matrix, finite_array, whole_number
from rrtik_ompl.errors import InputError, UnknownNameError, require
from rrtik_ompl.fast.library import library
from rrtik_ompl.goal import JointGoal
from rrtik_ompl.goal_configurations import GoalSearch
from rrtik_ompl.ik.methods import load_kernels
from rrtik_ompl.ompl_bridge.attempt import (
    ANYTIME_PLANNERS,
    ONE_GOAL_PLANNERS,
    Attempt,
    PlannerFactory,
    attempt,
    can_be_brief,
    finds_goals,
    ompl_planners,
)
from rrtik_ompl.path import SECOND_CHECK, JointPath, Violation
from rrtik_ompl.problem import Problem

DEFAULT_PLANNER = "bicrdt"
RESTARTS = 20
MAX_RESTARTS = 1_000_000
SHORTEST = 1e-3  # [s] that an attempt gets at least
MAX_SECONDS = 1e9  # thirty years; OMPL's clock overflows at about nine times as much
# What planners count of a path, not of their work.
OF_THE_PATH = ("lower_bound", "gap", "position_error", "orientation_error")
_OMPL_PREFIX, _MOVEIT_SUFFIX = "geometric::", "kConfigDefault"  # as in ompl_planning.yaml


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """The outcome of planning.

    Attributes:
        found: Whether there is a path.
        path: The path, or None.
        reason: "" if found, else a line that says why not.
        seconds: Wall time of everything: planning, restarts and re-checks [s].
        planner: Name of the planner.
        seed: The seed that repeats this plan.
        statistics: Plain counts, added up over all attempts: attempts, rejected paths, and the planner's own. Of
            "fewest-moves" also the lower bound of the moves of a path and the gap between the two; of "ikurt" the
            error of the tip at the end of the path, ``position_error`` [m] and ``orientation_error`` [rad].
    """

    found: bool
    path: JointPath | None
    reason: str
    seconds: float
    planner: str
    seed: int
    statistics: Mapping[str, int | float]


def plan(
    problem: Problem,
    planner: str | PlannerFactory = DEFAULT_PLANNER,
    *,
    seconds: float = 5.0,
    seed: int | None = None,
    restarts: int = RESTARTS,
    parameters: Mapping[str, Any] | None = None,
    accuracy: str | None = None,
) -> Plan:
    """Find a collision-free path from the start to the goal of a problem.

    A goal of the tip is first turned into free configurations by inverse kinematics, unless the planner finds them
    itself. If it does not get to them with some effort, more are drawn and it is started anew with twice the effort
    (see :class:`GoalSearch`).

    The planner first asks what the kernels can prove without coal, for a short while; where that finds no path it asks
    exactly. Either way a path is returned only if a second check agrees, which is twice as dense as the planner's and
    shares nothing with it (:meth:`JointPath.violations`). If a planner gives up before its time it is started anew with
    another random stream; if the second check rejects its path, it is started anew and checks as densely as that.

    Args:
        problem: What to solve.
        planner: Name of one of :func:`list_planners` (``geometric::`` may stand before OMPL's names), or a planner
            class that is built from a SpaceInformation alone.
        seconds: Time limit for all attempts together [s].
        seed: The same seed gives the same path, as long as the time limit does not cut in; drawn if None.
        restarts: Further attempts at most.
        parameters: Options of the planner; of OMPL's planners in snake case, such as ``range`` or ``goal_bias``.
        accuracy: "exact", or "conservative" to leave it at what can be proven without coal: faster, and blind to narrow
            passages. None: that of the problem's world.

    Raises:
        UnknownNameError: If there is no planner or no accuracy of that name.
        InputError: If a number or a parameter makes no sense.
        PlannerError: If the planner broke.
    """
    require(problem, Problem, "problem to plan", "use Problem(world, start, goal) or load_problem(name)")
    require(planner, str | Callable, "planner", "use a name of list_planners() or a planner class")
    limit = float(finite_array(seconds, (), "seconds"))
    if limit <= 0.0:
        raise InputError(f"seconds must be greater than 0, got {limit:g}")
    if limit > MAX_SECONDS:
        raise InputError(f"seconds must be {MAX_SECONDS:g} or less, got {limit:g}")
    if isinstance(restarts, bool) or not isinstance(restarts, int) or not 0 <= restarts <= MAX_RESTARTS:
        raise InputError(f"restarts must be a whole number from 0 to {MAX_RESTARTS}, got {restarts!r}")
    name, factory = (planner, find_planner(planner)) if isinstance(planner, str) else (planner.__name__, planner)
    used = _seed(seed)
    problem = problem if accuracy is None else problem.with_accuracy(accuracy)
    seeds = [int(child) for child in np.random.SeedSequence(used).generate_state(restarts + 1, np.uint32)]
    _load_kernels(problem, factory)
    begin = time.perf_counter()
    path, reason, totals = _search(problem, factory, name, begin + limit, seeds, parameters or {})
    elapsed = time.perf_counter() - begin
    if path is None and elapsed >= limit:
        reason = f"no path within {limit:g} s ({totals['attempts']} attempts; the last one: {reason or 'out of time'})"
    return Plan(path is not None, path, reason, elapsed, name, used, MappingProxyType(totals))


def _load_kernels(problem: Problem, factory: PlannerFactory) -> None:
    """Load what the search will ask for: compiling it for the first time is no part of planning."""
    if not isinstance(problem.goal, JointGoal):
        load_kernels(problem.robot)
    if problem.world.fast is not None:
        for name in getattr(factory, "kernels", ()):
            library(name)


def _search(
    problem: Problem,
    factory: PlannerFactory,
    name: str,
    deadline: float,
    seeds: list[int],
    parameters: Mapping[str, Any],
) -> tuple[JointPath | None, str, dict[str, int | float]]:
    """Attempt after attempt, one per seed: the path or None, the reason, and the counts of all of them."""
    totals: dict[str, int | float] = {"attempts": 0, "rejected": 0}
    reason = ""
    if _nothing_to_do(problem):  # some planners wander off and come back, others break
        return JointPath.of(problem.world.robot, problem.start[None]), "", totals
    turns_matter = isinstance(problem.goal, JointGoal) and bool(problem.world.robot.continuous.any())
    needless = finds_goals(factory) and not isinstance(problem.goal, JointGoal)
    # An optimal path touches what it goes round, and an anytime planner has no time left for a second attempt.
    asked = problem.refined(SECOND_CHECK) if getattr(factory, "__name__", "") in ANYTIME_PLANNERS else problem
    search = GoalSearch(problem, np.random.default_rng(seeds[0]))
    for number, seed in enumerate(seeds):
        if time.perf_counter() >= deadline:
            break
        totals["attempts"] += 1
        short_way = turns_matter and number == 0 and len(seeds) > 1
        aims = np.zeros((0, problem.robot.dof)) if needless else _aims(search, number, short_way)
        left = deadline - time.perf_counter()
        aimless = len(aims) == 0 and not needless
        if aimless and search.exhausted:
            break
        if aimless or left <= 0.0:
            continue
        if number == 0 and problem.world.accuracy == "exact" and can_be_brief(factory):
            path = _without_coal(problem, factory, name, aims, left, seed, parameters, totals)
            if path is not None:
                return path, "", totals
            left = max(deadline - time.perf_counter(), SHORTEST)
        half = 0.5 if short_way else 1.0  # of the time for the short way round, before the long one is tried too
        others = not needless and _others(search, factory, number) and number < len(seeds) - 1
        effort = 2**number if others and can_be_brief(factory) else None
        outcome = attempt(asked, factory, aims, seconds=half * left, seed=seed, parameters=parameters, effort=effort)
        _add(totals, outcome.statistics)
        path, reason = _judged(problem, outcome, name)
        if path is not None:
            return path, "", totals
        if outcome.rows is not None:
            totals["rejected"] += 1
            asked = problem.refined(SECOND_CHECK)
    return None, reason or search.reason, totals


def _aims(search: GoalSearch, number: int, short_way: bool) -> Matrix:
    """What an attempt aims at: all that is known, the newest first, for some planners heed the first alone."""
    known = len(search.rows)
    newer = number > 0 and search.more()
    rows = search.first()
    return rows[:1] if short_way else np.roll(rows, -known if newer else -number, axis=0)


def _others(search: GoalSearch, factory: PlannerFactory, number: int) -> bool:
    """Whether later attempts would aim at other configurations than this one."""
    one = getattr(factory, "__name__", "") in ONE_GOAL_PLANNERS
    return not search.exhausted or (one and number + 1 < len(search.rows))


def _without_coal(
    problem: Problem,
    factory: PlannerFactory,
    name: str,
    aims: Matrix,
    seconds: float,
    seed: int,
    parameters: Mapping[str, Any],
    totals: dict[str, int | float],
) -> JointPath | None:
    """A brief attempt on what the kernels can prove; None where it finds nothing or where an end cannot be proven."""
    proven = problem.with_accuracy("conservative")
    aims = aims[proven.world.valid_batch(aims)]
    if len(aims) == 0 or not proven.world.valid(problem.start):
        return None
    outcome = attempt(proven, factory, aims, seconds=seconds, seed=seed, parameters=parameters, effort=1)
    _add(totals, outcome.statistics)
    return _judged(problem, outcome, name)[0]


def _add(totals: dict[str, int | float], counts: Mapping[str, int | float]) -> None:
    for key, value in counts.items():
        totals[key] = value if key in OF_THE_PATH else totals.get(key, 0) + value


def _nothing_to_do(problem: Problem) -> bool:
    """Whether the start is the goal, to the bit if that is a configuration; a `Problem` has checked its start."""
    if isinstance(problem.goal, JointGoal):
        return bool((problem.start == problem.goal.q).all())
    return problem.reached(problem.start)


def list_planners() -> tuple[str, ...]:
    """Names of all planners: ours and those of other packages in lower case, OMPL's as OMPL writes them."""
    return (*catalog.list_planners(), *sorted(ompl_planners()))


def find_planner(name: str) -> PlannerFactory:
    """The planner class of a name, in upper or lower case; MoveIt's way of writing OMPL's names is understood too.

    Raises:
        UnknownNameError: If there is none; carries all names.
    """
    bare = name.removeprefix(_OMPL_PREFIX).removesuffix(_MOVEIT_SUFFIX).lower()
    wheel = {key.lower(): value for key, value in ompl_planners().items()}
    if bare in wheel:
        found: PlannerFactory = wheel[bare]
        return found
    if bare in catalog.list_planners():
        return catalog.find_planner(bare)  # type: ignore[no-any-return]
    raise UnknownNameError("planner", name, list_planners())


def _judged(problem: Problem, outcome: Attempt, name: str) -> tuple[JointPath | None, str]:
    """The path of an attempt if the second check accepts it, or the reason why there is none."""
    if outcome.rows is None:
        return None, f"{name} ended with '{outcome.status}'" + (f": {outcome.reason}" if outcome.reason else "")
    path = JointPath.of(problem.world.robot, outcome.rows)
    faults: tuple[Violation, ...] = path.violations(problem.world)
    if faults:
        return None, f"the path of {name} was rejected by the second check: {faults[0].reason}"
    if not (path.start == problem.start).all() or not problem.reached(path.end):
        return None, f"the path of {name} does not lead from the start to the goal"
    return path, ""


def _seed(seed: int | None) -> int:
    return int(np.random.default_rng().integers(2**31)) if seed is None else whole_number(seed, "seed")
