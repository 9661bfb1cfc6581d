"""One attempt of one planner at one problem, or one run of OMPL's PathSimplifier, with arrays in and out.

Array planners (derived from SafePlanner) work on arrays. For any other planner, all OMPL objects are created and
destroyed inside the call.
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

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.errors import PlannerError, RrtikError
from rrtik_ompl.ompl_bridge.bindings import ob, og, ou
from rrtik_ompl.ompl_bridge.ownership import foreign_code
from rrtik_ompl.ompl_bridge.planner_options import is_safe, other_planner, safe_planner
from rrtik_ompl.ompl_bridge.planner_traits import OMPL_TRAITS, PlannerFactory, traits_of
from rrtik_ompl.ompl_bridge.results import PlannerGraph, graph_of
from rrtik_ompl.ompl_bridge.safe_planner import SafePlanner
from rrtik_ompl.ompl_bridge.setup import (
    ValidityCallback,
    exact_path,
    one_by_one,
    problem_definition,
    shared_space,
    space_information,
)
from rrtik_ompl.ompl_bridge.states import StateIO
from rrtik_ompl.ompl_bridge.weighted import WeightedProblem, has_weights
from rrtik_ompl.world.problem import Problem, planning_bounds

NO_PARAMETERS: Mapping[str, Any] = MappingProxyType({})
ITERATION_LIMIT = "max_iterations"  # option of array planners
MOTIONS_PER_ITERATION = 5  # checked motions of an OMPL planner that count as one iteration

INVALID = (ob.PlannerStatus.INVALID_START, ob.PlannerStatus.INVALID_GOAL)
MAX_SECONDS = 1e9  # [s]


def attempt_seeds(seed: int, restarts: int) -> list[int]:
    """Return the seeds of the first attempt and of each restart."""
    seeds: list[int] = np.random.SeedSequence(seed).generate_state(restarts + 1, np.uint32).tolist()
    return seeds


@dataclass(frozen=True, slots=True, eq=False)
class Attempt:
    """The result of one attempt.

    Attributes:
        rows: Waypoints of the path, shape (k, n), or None.
        status: OMPL's status in words.
        statistics: Plain counts.
        reason: Why there is no path, if the planner says so; else "".
        counting: Time spent on counting the vertices and edges of an OMPL planner [s], which is not planning time.
        graph: What the planner has grown, if that was wanted and the planner keeps it.
    """

    rows: Matrix | None
    status: str
    statistics: Mapping[str, int | float]
    reason: str = ""
    counting: float = 0.0
    graph: PlannerGraph | None = None


def attempt(
    problem: Problem,
    factory: PlannerFactory,
    goals: Matrix,
    budget: Budget,
    *,
    parameters: Mapping[str, Any] = NO_PARAMETERS,
    checked: bool = False,
    keep_graph: bool = False,
) -> Attempt:
    """Let a planner search from the start of a problem to any of ``goals``, within a budget.

    There may be no goals if the planner finds some itself; a planner with the trait ``one_goal`` gets the first goal
    alone. If the budget limits iterations (for planners that support it), the attempt ends after that many iterations
    of an array planner, or after five times as many checked motions of an OMPL planner, so that the result does not
    depend on the computer's speed. If joints have weights, the planner works with weighted distances.

    Args:
        problem: The problem to solve.
        factory: Makes the planner.
        goals: Shape (k, n).
        budget: Time from now on, iterations and the seed.
        parameters: Options of the planner.
        checked: Whether start and goals are known to be free, so that an array planner does not check them again.
        keep_graph: Whether to keep what the planner has grown.

    Raises:
        InputError: If the planner does not take a parameter.
        PlannerError: If the planner refused its options for this problem, or broke.
        KeyboardInterrupt: After an OMPL planner has stopped properly; an array planner is interrupted at once.
    """
    traits = traits_of(factory)
    goals = goals[:1] if traits.one_goal else goals
    if len(goals) and not traits.one_joint and has_weights(problem):
        weighted = WeightedProblem(problem)
        aims = weighted.weighted_rows(goals)
        found = attempt(
            weighted.problem, factory, aims, budget, parameters=parameters, checked=checked, keep_graph=keep_graph
        )
        graph = found.graph
        if graph is not None:
            graph = replace(graph, vertices=weighted.joint_rows(graph.vertices, goals))
        return replace(found, rows=weighted.joint_path(found.rows, goals), graph=graph)

    with quiet():
        seed_ompl(budget.seed)
        if is_safe(factory):
            return _on_arrays(problem, factory, goals, budget, parameters, checked=checked, keep_graph=keep_graph)
        return _in_ompl(problem, factory, goals, budget, parameters, keep_graph=keep_graph)


def seed_ompl(seed: int) -> None:
    """Seed OMPL's random numbers, before any object that draws from them is made; OMPL does not accept 0."""
    ou.RNG.setSeed(1 + seed % (2**31 - 2))


@contextmanager
def quiet() -> Iterator[None]:
    """Silence OMPL's log, which goes to standard output, inside a ``with`` block."""
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
    keep_graph: bool,
) -> Attempt:
    """Run an attempt of an array planner, which needs only a space of OMPL."""
    name = factory.__name__
    bounds = planning_bounds(problem, goals)
    limit = {} if budget.iterations is None else {ITERATION_LIMIT: budget.iterations}
    with _named(name):
        planner = safe_planner(factory, name, shared_space(*bounds), problem, budget.seed, {**limit, **parameters})
        planner.setup()

    straight = _straight_motion(problem, goals) if factory.straight_first else None
    if straight is not None:
        return Attempt(straight, "Exact solution", {})

    status, rows = planner.solve_rows(
        problem.start[None], goals, bounds, budget.over, checked=checked, keep_graph=keep_graph
    )
    _raise_failure(planner, name, status, None)
    graph = planner.kept_graph() if keep_graph else None
    return Attempt(rows, str(status), dict(planner.statistics), planner.reason, graph=graph)


def _in_ompl(
    problem: Problem,
    factory: PlannerFactory,
    goals: Matrix,
    budget: Budget,
    parameters: Mapping[str, Any],
    *,
    keep_graph: bool,
) -> Attempt:
    """Run an attempt of an OMPL planner or a third-party one; all OMPL objects are local to this function."""
    name = getattr(factory, "__name__", str(factory))
    traits = traits_of(factory)
    seconds = max(budget.left, 0.0)
    max_motions = np.inf if budget.iterations is None else budget.iterations * MOTIONS_PER_ITERATION

    # Make the problem definition and the planner.
    validity = ValidityCallback(one_by_one(problem.world), most_motions=max_motions)
    if keep_graph:
        validity.seen = {}
    si = space_information(problem, goals, validity)
    definition = problem_definition(problem, goals, si)
    with _named(name):
        planner = other_planner(factory, name, si, definition, parameters)

    # The time begins now. Both the condition and the checks can end the search.
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
    # After the deadline every check answers no, so the refusal says nothing about start or goals.
    ends_refused_for_lack_of_time = rows is None and validity.late and status in INVALID
    if ends_refused_for_lack_of_time:
        status = ob.PlannerStatus(ob.PlannerStatus.TIMEOUT)

    # Count the vertices and edges, and measure how long that takes.
    counting_began = time.perf_counter()
    counts: dict[str, int] = {}
    kept = None
    if factory in OMPL_TRAITS and traits.has_graph:
        grown = _graph(planner, si)
        counts = {"vertices": grown.numVertices(), "edges": grown.numEdges()}
        kept = None if validity.seen is None else _copied(grown, si, validity.seen)
    counting = time.perf_counter() - counting_began
    return Attempt(rows, str(status), {**validity.counts(), **counts}, counting=counting, graph=kept)


@contextmanager
def _named(name: str) -> Iterator[None]:
    """Turn any exception that leaves a planner's code into a PlannerError of one line with the planner's name.

    Raises:
        PlannerError: For any exception but the library's own errors, MemoryError and KeyboardInterrupt.
    """
    try:
        yield
    # A campaign reports a lack of memory by a status of its own.
    except (RrtikError, MemoryError):
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
    """Return the straight motion from the start to the nearest goal if it is free, shape (2, n), else None.

    No path to any goal is shorter.
    """
    nearest = goals[np.linalg.norm(goals - problem.start, axis=1).argmin()]
    if not problem.world.motion_valid(problem.start, nearest):
        return None
    return np.stack([problem.start, nearest])


@contextmanager
def interrupt_ends(condition: ob.PlannerTerminationCondition) -> Iterator[None]:
    """Let Ctrl-C end the planner through its termination condition, and raise KeyboardInterrupt afterwards.

    If it were raised inside a callback, it would end the process with planners that run a second thread.
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
    """Return what ``solve`` returned as a PlannerStatus; a planner written in Python may have returned anything."""
    if isinstance(answer, ob.PlannerStatus):
        return answer
    if isinstance(answer, ob.PlannerStatus.PlannerStatusType):
        return ob.PlannerStatus(answer)
    raise TypeError(f"its solve() must return an ompl.base.PlannerStatus, got {type(answer).__name__}")


def _raise_failure(planner: ob.Planner, name: str, status: ob.PlannerStatus, error: Exception | None) -> None:
    """Raise the error that broke a planner: one from its callbacks, or one that the planner has kept.

    Args:
        planner: The planner after its ``solve``.
        name: Its name.
        status: Its status.
        error: The first error of a callback, or None.

    Raises:
        PlannerError: If there is such an error.
    """
    if error is not None:
        raise PlannerError(f"planner {name} broke: {in_short(error)}")
    failure = getattr(planner, "failure", None)
    if failure is not None:
        raise PlannerError(f"planner {name}{'' if failure.refused else ' broke'}: {failure.summary}")
    # A third-party planner in Python may keep its error as text.
    if status == ob.PlannerStatus.CRASH and getattr(planner, "error", None):
        raise PlannerError(f"planner {name} broke: {planner.error}")


def in_short(error: Exception) -> str:
    """Return the text of an exception, or its type if it has no text."""
    return str(error) or type(error).__name__


def _graph(planner: ob.Planner, si: ob.SpaceInformation) -> ob.PlannerData:
    """Return the graph of an OMPL planner; with planners written in Python this may end the process."""
    graph = ob.PlannerData(si)
    planner.getPlannerData(graph)
    return graph


def _copied(data: ob.PlannerData, si: ob.SpaceInformation, seen: Mapping[bytes, int]) -> PlannerGraph:
    """Return a graph of OMPL as arrays.

    OMPL lists vertices as its search structure holds them, so the order in which they came is that in which their
    configurations were checked.

    Args:
        data: The graph, of a planner that still lives.
        si: The SpaceInformation of the planner.
        seen: When each configuration was first checked, by its bytes.
    """
    io = StateIO(si)
    count = data.numVertices()
    rows = np.array([io.read(data.getVertex(k).getState()) for k in range(count)]).reshape(count, io.dof)
    edges = [(k, head) for k in range(count) for head in data.getEdges(k)]
    births = [seen.get(row.tobytes(), 0) for row in rows]
    starts = [data.getStartIndex(k) for k in range(data.numStartVertices())]
    goals = [data.getGoalIndex(k) for k in range(data.numGoalVertices())]
    return graph_of(rows, edges, starts, goals, births)


def simplified(problem: Problem, route: Matrix, budget: Budget) -> tuple[Matrix, int]:
    """Shorten a route, shape (k, n), by ``ompl.geometric.PathSimplifier``.

    Its last step only checks configurations of the parts that it has bent, so the result must be checked again. When
    the time is up no motion counts as free any more, and the best route so far is returned.

    Returns:
        The new route, shape (m, n), and the number of checked motions.

    Raises:
        PlannerError: If a check raised an error.
        KeyboardInterrupt: After the simplifier has stopped properly.
    """
    with quiet():
        seed_ompl(budget.seed)
        validity = ValidityCallback(one_by_one(problem.world))
        si = space_information(problem, route, validity)

        # Both the condition and the checks can end the work.
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
