"""One attempt of one planner at one problem, with every OMPL object living and dying inside the call."""

from __future__ import annotations

import inspect
import re
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from rrtik_ompl.arrays import Matrix, finite_array
from rrtik_ompl.errors import InputError, PlannerError, UnknownNameError
from rrtik_ompl.ompl_bridge.safe_planner import SafePlanner
from rrtik_ompl.ompl_bridge.setup import Judge, exact_path, problem_definition, space_information, unjudged_space
from rrtik_ompl.problem import Problem

# Those that go on improving their path until the time is up.
ANYTIME_PLANNERS = ("AORRTC", "BITstar", "FewestMoves", "InformedRRTstar", "PRMstar", "RRTstar", "SORRTstar")

# PRM and PRMstar take up further goals in a second thread. It asks Python about motions under a lock of the roadmap,
# for which the first thread waits while it holds Python's lock: with more than one goal they hang. AORRTC gives up when
# it is led from one goal to another: with 16 goals of a UR5 its paths were thrice as long as with one.
ONE_GOAL_PLANNERS = ("AORRTC", "PRM", "PRMstar")

# AORRTC answers with a path from the goal to the goal if a straight motion from the start to it is free. SORRTstar
# finds that motion, then draws from what could be shorter, which is nothing, and does not look at its time meanwhile.
STRAIGHT_FIRST_PLANNERS = ("AORRTC", "SORRTstar")

# AORRTC hands out an empty graph; BITstar's is never freed again (60 kB a run).
GRAPHLESS_PLANNERS = ("AORRTC", "BITstar")

# Options of our planners that `attempt` itself sets.
GIVEN_OPTIONS = ("world", "seed", "goal")

# What an attempt of effort 1 may take: iterations of our planners, questions about motions of OMPL's.
ITERATION_LIMIT = "max_iterations"
EFFORT_ITERATIONS = 1000
EFFORT_MOTIONS = 5000

REFUSAL = f"{InputError.__module__}.{InputError.__name__}: "  # how a planner's error begins if it refused its options

PlannerFactory = Callable[..., Any]


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


def ompl_planners() -> dict[str, Any]:
    """OMPL's geometric planners of the installed wheel by their names."""
    found = {key: value for key, value in vars(og).items() if isinstance(value, type) and issubclass(value, ob.Planner)}
    return {key: value for key, value in found.items() if value is not ob.Planner}


def attempt(
    problem: Problem,
    factory: PlannerFactory,
    goals: Matrix,
    *,
    seconds: float,
    seed: int,
    parameters: Mapping[str, Any],
    effort: int | None = None,
) -> Attempt:
    """Let a planner work for at most ``seconds`` from the start of a problem to any of ``goals``, shape (k, n).

    There may be none if the planner :func:`finds_goals`. ``ONE_GOAL_PLANNERS`` aim at the first one alone. With an
    ``effort`` (see :func:`can_be_brief`) the attempt ends after a number of iterations or questions, so that what it
    finds does not depend on the computer's speed.

    Raises:
        InputError: If the planner does not take a parameter.
        PlannerError: If the planner broke.
        KeyboardInterrupt: After the planner has stopped in good order.
    """
    own = issubclass(factory, SafePlanner) if isinstance(factory, type) else False
    name = getattr(factory, "__name__", str(factory))
    goals = goals[:1] if name in ONE_GOAL_PLANNERS else goals
    with quiet():
        ou.RNG.setSeed(1 + seed % (2**31 - 2))  # before any object that draws from it; OMPL does not take 0
        judge = Judge(problem.world, most_motions=np.inf if effort is None else effort * EFFORT_MOTIONS)
        si = unjudged_space(problem, goals) if own else space_information(problem, goals, judge)
        definition = problem_definition(problem, goals, si)
        if own:
            limit = {} if effort is None else {ITERATION_LIMIT: effort * EFFORT_ITERATIONS}
            planner = _own_planner(factory, name, si, problem, seed, {**limit, **parameters})
        else:
            planner = _wheel_planner(factory, name, si, definition, parameters)
        judge.deadline = time.monotonic() + seconds
        condition = ob.timedPlannerTerminationCondition(seconds)
        judge.stop = condition.terminate
        try:
            planner.setProblemDefinition(definition)
            planner.setup()
            straight = _straight_motion(problem, goals) if name in STRAIGHT_FIRST_PLANNERS else None
            if straight is not None:
                return Attempt(straight, "Exact solution", {})
            with interrupt_ends(condition):
                status = planner.solve(condition)
        except RuntimeError as error:  # what C++ throws
            raise PlannerError(f"planner {name} broke: {error}") from None
        problem_in_planner = judge.error or (getattr(planner, "error", None) if str(status) == "Crash" else None)
        if problem_in_planner is not None:
            last = str(problem_in_planner).splitlines()[-1]
            refused = last.removeprefix(REFUSAL)
            raise PlannerError(f"planner {name}: {refused}" if refused != last else f"planner {name} broke: {last}")
        rows, words = exact_path(definition, si), str(status)
        if rows is None and judge.late and words.startswith("Invalid"):  # only because all answers were no by then
            words = "Timeout"
        if own:
            return Attempt(rows, words, dict(planner.statistics), planner.reason)
        begin = time.perf_counter()
        graph = _graph(planner, si) if factory in ompl_planners().values() and name not in GRAPHLESS_PLANNERS else {}
        return Attempt(rows, words, {**judge.counts(), **graph}, counting=time.perf_counter() - begin)


def finds_goals(factory: PlannerFactory) -> bool:
    """Whether a planner needs no configurations for a goal of the tip."""
    return isinstance(factory, type) and issubclass(factory, SafePlanner) and factory.finds_goals


def can_be_brief(factory: PlannerFactory) -> bool:
    """Whether a planner can be given a limit that does not depend on time, and makes something of a short search."""
    if isinstance(factory, type) and issubclass(factory, SafePlanner):
        return ITERATION_LIMIT in inspect.signature(factory).parameters
    return getattr(factory, "__name__", "") not in ANYTIME_PLANNERS


def planner_options(factory: PlannerFactory) -> tuple[str, ...]:
    """Names of the options that a planner takes, sorted; those of OMPL's planners in snake case."""
    if isinstance(factory, type) and issubclass(factory, SafePlanner):
        names = tuple(inspect.signature(factory).parameters)[1:]  # the first one is the space information
        return tuple(sorted(set(names).difference(GIVEN_OPTIONS)))
    setters = {s for s in dir(factory) if s.startswith("set") and not hasattr(ob.Planner, s)}
    return tuple(sorted(map(_snake, setters)))


def _graph(planner: Any, si: Any) -> dict[str, int]:
    """Size of the trees or the roadmap of a planner of the wheel; one that is written in Python may end the process."""
    graph = ob.PlannerData(si)
    planner.getPlannerData(graph)
    return {"vertices": graph.numVertices(), "edges": graph.numEdges()}


def _straight_motion(problem: Problem, goals: Matrix) -> Matrix | None:
    """The straight motion from the start to the nearest goal if it is free, shape (2, n): no path is shorter."""
    nearest = goals[np.linalg.norm(goals - problem.start, axis=1).argmin()]
    return np.stack([problem.start, nearest]) if problem.world.motion_valid(problem.start, nearest) else None


def _own_planner(
    factory: PlannerFactory, name: str, si: Any, problem: Problem, seed: int, parameters: Mapping[str, Any]
) -> Any:
    options = planner_options(factory)
    for key in parameters:
        if key not in options:
            raise UnknownNameError(f"parameter of planner {name}", key, options)
    goal = {"goal": problem.goal} if "goal" in inspect.signature(factory).parameters else {}
    try:
        return factory(si, world=problem.world, seed=seed, **goal, **parameters)
    except TypeError as error:
        raise InputError(f"planner {name}: {error}") from None


def _wheel_planner(factory: PlannerFactory, name: str, si: Any, definition: Any, parameters: Mapping[str, Any]) -> Any:
    planner = factory(si)
    try:
        for key, value in parameters.items():
            _set(planner, name, key, value)
    except InputError:
        planner.setProblemDefinition(definition)  # AORRTC ends the process if it is destroyed before it was set up
        planner.setup()
        raise
    return planner


def _set(planner: Any, name: str, key: str, value: Any) -> None:
    """Set ``goal_bias`` through ``setGoalBias`` and so on."""
    options = planner_options(type(planner))
    if key not in options:
        raise UnknownNameError(f"parameter of planner {name}", key, options)
    setter = next(s for s in dir(planner) if s.startswith("set") and _snake(s) == key)
    if isinstance(value, float):
        finite_array(value, (), f"planner {name}: parameter {key}")
    try:
        getattr(planner, setter)(value)
    except TypeError:
        raise InputError(f"planner {name}: parameter {key} cannot be {value!r}") from None


def _snake(setter: str) -> str:
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", setter.removeprefix("set")).lower()


@contextmanager
def quiet() -> Iterator[None]:
    """Silence OMPL's log, which goes to standard output, for the time of one attempt."""
    level = ou.getLogLevel()
    ou.setLogLevel(ou.LogLevel.LOG_NONE)
    try:
        yield
    finally:
        ou.setLogLevel(level)


@contextmanager
def interrupt_ends(condition: Any) -> Iterator[None]:
    """Ctrl-C ends the planner through its termination condition and is raised afterwards.

    Raised inside a callback it would end the process under planners that run a second thread.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    interrupted = False

    def stop(*_: Any) -> None:
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
