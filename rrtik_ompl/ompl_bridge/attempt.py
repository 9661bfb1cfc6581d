"""OMPL at work, arrays in and out: one attempt of one planner at one problem, one shortening by its PathSimplifier.

A planner of ours works on arrays. For any other one every OMPL object lives and dies inside the call.
"""

from __future__ import annotations

import signal
import threading
import time
import traceback
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.errors import PlannerError, RrtikError
from rrtik_ompl.ompl_bridge.ownership import foreign_code
from rrtik_ompl.ompl_bridge.planner_options import is_safe, other_planner, safe_planner
from rrtik_ompl.ompl_bridge.planner_traits import OMPL_TRAITS, PlannerFactory, traits_of
from rrtik_ompl.ompl_bridge.safe_planner import SafePlanner
from rrtik_ompl.ompl_bridge.setup import (
    ValidityCallback,
    exact_path,
    planning_bounds,
    problem_definition,
    shared_space,
    space_information,
)
from rrtik_ompl.ompl_bridge.states import StateIO
from rrtik_ompl.ompl_bridge.weighted import WeightedProblem, has_weights
from rrtik_ompl.world.problem import Problem

NO_PARAMETERS: Mapping[str, Any] = MappingProxyType({})
ITERATION_LIMIT = "max_iterations"  # the option of our planners
MOTIONS_PER_ITERATION = 5  # checked motions of OMPL's planners that count as one iteration of ours

INVALID = (ob.PlannerStatus.INVALID_START, ob.PlannerStatus.INVALID_GOAL)
MAX_SECONDS = 1e9  # [s]


def attempt_seeds(seed: int, restarts: int) -> list[int]:
    """Of the first attempt and of each that begins anew."""
    seeds: list[int] = np.random.SeedSequence(seed).generate_state(restarts + 1, np.uint32).tolist()
    return seeds


@dataclass(frozen=True, slots=True, eq=False)
class Attempt:
    """What came out: rows of the path, shape (k, n), or None; OMPL's status in words; plain counts; a reason if any.

    ``counting`` is how long it took to count the vertices and edges of an OMPL planner [s], which is no planning.
    """

    rows: Matrix | None
    status: str
    statistics: Mapping[str, int | float]
    reason: str = ""
    counting: float = 0.0


def attempt(
    problem: Problem,
    factory: PlannerFactory,
    goals: Matrix,
    budget: Budget,
    *,
    parameters: Mapping[str, Any] = NO_PARAMETERS,
    checked: bool = False,
) -> Attempt:
    """Let a planner work from the start of a problem to any of ``goals``, shape (k, n), within a budget.

    There may be no goals if the planner finds some itself; one that takes one goal gets the first. Where the budget
    limits iterations (for planners that support it) the attempt ends after so many, or after five times as many checked
    motions of a planner of OMPL, so that what it finds does not depend on the computer's speed. Where joints have
    weights, distances are weighted.

    Args:
        problem: What to solve.
        factory: Makes the planner.
        goals: Shape (k, n).
        budget: Time from now on, iterations and the seed.
        parameters: Options of the planner.
        checked: Whether start and goals are known to be free, so that a planner of ours does not check them again.

    Raises:
        InputError: If the planner does not take a parameter.
        PlannerError: If the planner refused its options for this problem, or broke.
        KeyboardInterrupt: After a planner of OMPL has stopped in good order; one of ours is left at once.
    """
    traits = traits_of(factory)
    goals = goals[:1] if traits.one_goal else goals
    if len(goals) and not traits.one_joint and has_weights(problem):
        weighted = WeightedProblem(problem)
        aims = weighted.weighted_rows(goals)
        found = attempt(weighted.problem, factory, aims, budget, parameters=parameters, checked=checked)
        return replace(found, rows=weighted.joint_path(found.rows, goals))

    with quiet():
        seed_ompl(budget.seed)
        if is_safe(factory):
            return _on_arrays(problem, factory, goals, budget, parameters, checked=checked)
        return _in_ompl(problem, factory, goals, budget, parameters)


def seed_ompl(seed: int) -> None:
    """Seed OMPL's random numbers, before any object is made that draws from them; OMPL does not take 0."""
    ou.RNG.setSeed(1 + seed % (2**31 - 2))


@contextmanager
def quiet() -> Iterator[None]:
    """Silence OMPL's log, which goes to standard output, for the time of one attempt."""
    level = ou.getLogLevel()
    ou.setLogLevel(ou.LogLevel.LOG_NONE)
    try:
        yield
    finally:
        ou.setLogLevel(level)


def _on_arrays(
    problem: Problem,
    factory: type[SafePlanner],
    goals: Matrix,
    budget: Budget,
    parameters: Mapping[str, Any],
    *,
    checked: bool,
) -> Attempt:
    """An attempt of a planner of ours, which needs of OMPL a space alone."""
    name = factory.__name__
    bounds = planning_bounds(problem, goals)
    limit = {} if budget.iterations is None else {ITERATION_LIMIT: budget.iterations}
    with _named(name):
        planner = safe_planner(factory, name, shared_space(*bounds), problem, budget.seed, {**limit, **parameters})
        planner.setup()

    straight = _straight_motion(problem, goals) if factory.straight_first else None
    if straight is not None:
        return Attempt(straight, "Exact solution", {})

    status, rows = planner.solve_rows(problem.start[None], goals, bounds, budget.over, checked=checked)
    _raise_failure(planner, name, status, None)
    return Attempt(rows, str(status), dict(planner.statistics), planner.reason)


def _in_ompl(
    problem: Problem, factory: PlannerFactory, goals: Matrix, budget: Budget, parameters: Mapping[str, Any]
) -> Attempt:
    """An attempt of a planner of OMPL, or of anybody else's, whose objects all live in here."""
    name = getattr(factory, "__name__", str(factory))
    traits = traits_of(factory)
    seconds = max(budget.left, 0.0)
    max_motions = np.inf if budget.iterations is None else budget.iterations * MOTIONS_PER_ITERATION

    validity = ValidityCallback(problem.world, most_motions=max_motions)
    si = space_information(problem, goals, validity)
    definition = problem_definition(problem, goals, si)
    with _named(name):
        planner = other_planner(factory, name, si, definition, parameters)

    validity.deadline = time.monotonic() + seconds
    condition = ob.timedPlannerTerminationCondition(seconds)
    validity.stop = condition.terminate
    with _named(name):
        planner.setProblemDefinition(definition)
        planner.setup()
        straight = _straight_motion(problem, goals) if traits.straight_first else None
        if straight is not None:
            return Attempt(straight, "Exact solution", {})
        with interrupt_ends(condition), foreign_code(planner, definition):
            status = _status(planner.solve(condition))

    _raise_failure(planner, name, status, validity.error)
    rows = exact_path(definition, si)
    ends_refused_for_lack_of_time = rows is None and validity.late and status in INVALID  # all answers were no by then
    if ends_refused_for_lack_of_time:
        status = ob.PlannerStatus(ob.PlannerStatus.TIMEOUT)

    counting_began = time.perf_counter()
    graph = _graph(planner, si) if factory in OMPL_TRAITS and traits.has_graph else {}
    return Attempt(rows, str(status), {**validity.counts(), **graph}, counting=time.perf_counter() - counting_began)


@contextmanager
def _named(name: str) -> Iterator[None]:
    """Whatever leaves the code of a planner, C++'s exceptions or those of a file of anybody, in one line with its name.

    Raises:
        PlannerError: If anything does but an error of ours, a lack of memory and Ctrl-C.
    """
    try:
        yield
    except (RrtikError, MemoryError):  # a campaign has a status of its own for the latter
        raise
    except (Exception, SystemExit) as error:
        innermost_frame = traceback.extract_tb(error.__traceback__)[-1]
        error.__traceback__ = None  # its frames would keep OMPL's objects alive
        message = str(error) if type(error) is RuntimeError else f"{type(error).__name__}: {error}".removesuffix(": ")
        place = ""
        if innermost_frame.filename != __file__:
            place = f" ({Path(innermost_frame.filename).name}, line {innermost_frame.lineno})"
        raise PlannerError(f"planner {name} broke: {message}{place}") from None


def _straight_motion(problem: Problem, goals: Matrix) -> Matrix | None:
    """The straight motion from the start to the nearest goal if it is free, shape (2, n): no path is shorter."""
    nearest = goals[np.linalg.norm(goals - problem.start, axis=1).argmin()]
    if not problem.world.motion_valid(problem.start, nearest):
        return None
    return np.stack([problem.start, nearest])


@contextmanager
def interrupt_ends(condition: ob.PlannerTerminationCondition) -> Iterator[None]:
    """Ctrl-C ends the planner through its termination condition and is raised afterwards.

    Raised inside a callback it would end the process under planners that run a second thread.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    interrupted = False

    def stop(*_: object) -> None:
        nonlocal interrupted
        interrupted = True
        condition.terminate()

    previous = signal.signal(signal.SIGINT, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous)
        if interrupted:
            raise KeyboardInterrupt


def _status(answer: object) -> ob.PlannerStatus:
    """What ``solve`` returned; one that is written in Python may return anything."""
    if isinstance(answer, ob.PlannerStatus):
        return answer
    if isinstance(answer, ob.PlannerStatus.PlannerStatusType):
        return ob.PlannerStatus(answer)
    raise TypeError(f"its solve() must return an ompl.base.PlannerStatus, got {type(answer).__name__}")


def _raise_failure(planner: ob.Planner, name: str, status: ob.PlannerStatus, error: Exception | None) -> None:
    """Raise what broke a planner: an error in one of its callbacks, or a failure of its own that it has kept.

    Raises:
        PlannerError: If there is any.
    """
    if error is not None:
        raise PlannerError(f"planner {name} broke: {in_short(error)}")
    failure = getattr(planner, "failure", None)
    if failure is not None:
        raise PlannerError(f"planner {name}{'' if failure.refused else ' broke'}: {failure.summary}")
    if status == ob.PlannerStatus.CRASH and getattr(planner, "error", None):  # a planner of somebody else, in Python
        raise PlannerError(f"planner {name} broke: {planner.error}")


def in_short(error: Exception) -> str:
    """What an exception says, its type if it says nothing."""
    return str(error) or type(error).__name__


def _graph(planner: ob.Planner, si: ob.SpaceInformation) -> dict[str, int]:
    """Size of the trees or the roadmap of a planner of the wheel; one that is written in Python may end the process."""
    graph = ob.PlannerData(si)
    planner.getPlannerData(graph)
    return {"vertices": graph.numVertices(), "edges": graph.numEdges()}


def simplified(problem: Problem, route: Matrix, budget: Budget) -> tuple[Matrix, int]:
    """Let ``ompl.geometric.PathSimplifier`` shorten a route, shape (k, n); also how many motions were checked.

    Its last step checks configurations alone of what it has bent, so the result must be checked. When the time is up
    no motion counts as free, and what was found so far is returned.

    Raises:
        PlannerError: If a check raised an error.
        KeyboardInterrupt: After it has stopped in good order.
    """
    with quiet():
        seed_ompl(budget.seed)
        validity = ValidityCallback(problem.world)
        si = space_information(problem, route, validity)

        seconds = 0.0 if budget.over() else min(budget.left, MAX_SECONDS)
        validity.deadline = time.monotonic() + seconds
        condition = ob.timedPlannerTerminationCondition(seconds)
        validity.stop = condition.terminate

        states = StateIO(si)
        path = states.path(si, route)
        with interrupt_ends(condition):
            og.PathSimplifier(si).simplify(path, condition, True)

        if validity.error is not None:
            raise PlannerError(f"PathSimplifier broke: {in_short(validity.error)}")
        return states.rows(path), validity.motions
