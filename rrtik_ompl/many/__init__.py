"""Many plans: `plan_many()`, in threads, in processes that may be lost, or on a cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeAlias, cast, overload

from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import positive, seed_of, whole_number
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.choices import ProofMode, ShorteningMethod, one_of
from rrtik_ompl.base.errors import InputError, ProblemError, require
from rrtik_ompl.description.catalog import AUTO, is_auto
from rrtik_ompl.many import spread
from rrtik_ompl.many.guard import PARCEL
from rrtik_ompl.many.one_plan import DONE, job_of
from rrtik_ompl.many.parcels import packed
from rrtik_ompl.many.queries import Asked, Ends, Named, Problems, queries_in, queries_of
from rrtik_ompl.ompl_bridge.planner_names import is_planner_file, planner_in_folder
from rrtik_ompl.ompl_bridge.planner_options import check_options
from rrtik_ompl.ompl_bridge.planner_traits import PlannerFactory
from rrtik_ompl.planning.many import Answer, Query, no_plan, plans_in_threads
from rrtik_ompl.planning.outcome import Plan, Request
from rrtik_ompl.planning.plan import PROOF_MODES, shortening_method, time_limit
from rrtik_ompl.planning.searching import named_planner
from rrtik_ompl.problem_files.problem import load_problem
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

Planner: TypeAlias = str | PlannerFactory

MEMORY_MB = 4096.0  # limit of a query in a process, if none is given
PATIENCE = (3.0, 30.0)  # a query in a process is killed after so many times its time limit, and so many seconds more


@overload
def plan_many(
    world: World,
    /,
    starts: ArrayLike,
    goals: Ends,
    planner: Planner | None = None,
    *,
    seconds: float = 5.0,
    seed: int | None = 0,
    parameters: Mapping[str, Any] | None = None,
    shorten: ShorteningMethod | bool = "auto",
    proof: ProofMode = "preferred",
    threads: int | None = None,
    processes: int | None = None,
    scheduler: str | None = None,
    memory_mb: float | None = None,
) -> list[Plan]: ...
@overload
def plan_many(
    problems: Problems,
    /,
    planner: Planner | None = None,
    *,
    seconds: float = 5.0,
    seed: int | None = 0,
    parameters: Mapping[str, Any] | None = None,
    shorten: ShorteningMethod | bool = "auto",
    proof: ProofMode = "preferred",
    threads: int | None = None,
    processes: int | None = None,
    scheduler: str | None = None,
    memory_mb: float | None = None,
) -> list[Plan]: ...
def plan_many(  # type: ignore[misc]  # the second argument is `planner` after problems
    given: World | Problems,
    /,
    starts: ArrayLike | Planner | None = None,
    goals: Ends | None = None,
    planner: Planner | None = None,
    *,
    seconds: float = 5.0,
    seed: int | None = 0,
    parameters: Mapping[str, Any] | None = None,
    shorten: ShorteningMethod | bool = "auto",
    proof: ProofMode = "preferred",
    threads: int | None = None,
    processes: int | None = None,
    scheduler: str | None = None,
    memory_mb: float | None = None,
) -> list[Plan]:
    """Plan many queries: in one world, ``plan_many(world, starts, goals)``, or many problems, ``plan_many(problems)``.

    Each path is the one of ``plan(problem, planner, seed=...)`` with the seed that its plan names, however the queries
    are spread, unless a time limit ends a query. By default they are planned in threads of this process, those in one
    world together where that is possible. With ``processes`` or ``scheduler`` each query is planned in a process that
    may be lost: if it crashes, hangs or takes too much memory, this query alone has no path.

    Args:
        given: The world of all queries, or the problems: each a :class:`Problem`, a shipped name or a file.
        starts: In one world: shape (m, dof), or (dof,) for one start of all queries [rad; m]. (With problems, the
            second argument is the planner.)
        goals: In one world: shape (m, dof), or m goals.
        planner: As for :func:`rrtik_ompl.plan`; None for the one that a problem names, or else "auto". OMPL's planners,
            and third-party ones in Python, share one generator of random numbers among all threads, so in threads they
            plan one query after the other.
        seconds: Limit of wall time for each query [s]. A query in a process is killed 30 s after three times this.
        seed: Seed of all queries; the k-th query has a seed of its own that depends on this and k alone. None draws
            one.
        parameters: Options of the planner.
        shorten: As for :func:`rrtik_ompl.plan`; False leaves the planners' own paths, which by named planners is many
            times as quick where queries are planned together.
        proof: As for :func:`rrtik_ompl.plan`.
        threads: Number of queries at a time in this process; None for the number of cores.
        processes: Number of processes of this machine that plan instead.
        scheduler: Address of a Dask scheduler whose workers plan instead. They need the same files where problems are
            files.
        memory_mb: Memory of a query in a process in addition to robot, scene and library [MB]; None for 4096.

    Returns:
        One plan for each query, in their order. Where a query cannot be asked, its planner broke or its process was
        lost, the plan has no path and its ``reason`` says why, such as "crash: SIGSEGV". Plans from processes also have
        ``memory_mb`` among their statistics.

    Raises:
        UnknownNameError: If there is no planner, parameter or problem of that name.
        InputError: If starts or goals have the wrong shape, a number or a parameter is invalid, a file is not there, or
            the scheduler cannot be used.
        RrtikError: The first of all, if no query can be asked with these arguments or the planner broke in each.

    Example:
        >>> problem = rrtik.load_problem("planar3_boxes")
        >>> plans = rrtik.plan_many(problem.world, problem.start, [problem.goal] * 3, "fastrrtconnect")
        >>> [each.found for each in plans]
        [True, True, True]
        >>> [each.found for each in rrtik.plan_many(["planar3_boxes", "titan4_prisms"], "fastrrtconnect")]
        [True, True]
    """
    _check_way(threads, processes, scheduler, memory_mb)
    if isinstance(given, World):
        asked = queries_in(given, cast(ArrayLike, starts), goals, seed_of(seed))
    else:
        planner = _second_argument(starts, goals, planner)
        asked = queries_of(given, seed_of(seed))

    require(parameters, Mapping | None, "parameters of a planner", "use {name of an option: value}")
    parameters = dict(parameters or {})
    _check_planner(planner, parameters)
    one_of(PROOF_MODES, proof, "proof")
    method = shortening_method(shorten)
    limit = time_limit(seconds)

    if processes is None and scheduler is None:
        load = lru_cache(maxsize=4)(load_problem)  # consecutive queries are often about one problem
        queries = [partial(_loaded, load, each) if isinstance(each, Named) else each for each in asked]
        request = Request(Budget(seconds=limit), parameters=parameters, proof=proof, among_many=True)
        answers = plans_in_threads(queries, planner, request, method, threads)
    else:
        options = {"seconds": limit, "parameters": parameters, "shorten": shorten, "proof": proof}
        memory = MEMORY_MB if memory_mb is None else positive(memory_mb, "memory_mb")
        jobs = _jobs(asked, planner, options, memory, absolute=scheduler is not None)
        finished = spread.local(jobs, processes or 1) if scheduler is None else spread.cluster(jobs, scheduler)
        answers = _answers(asked, planner, finished)
    return _plans(asked, planner, answers)


def _check_way(threads: int | None, processes: int | None, scheduler: str | None, memory_mb: float | None) -> None:
    """Refuse more than one way to spread queries, and a limit of memory for threads."""
    ways = {"threads": threads, "processes": processes, "scheduler": scheduler}
    given = [f"{name}={value!r:.40}" for name, value in ways.items() if value is not None]
    if len(given) > 1:
        raise InputError(f"plan_many: give one of {', '.join(ways)}, got {' and '.join(given)}")
    for name in ("threads", "processes"):
        if ways[name] is not None:
            whole_number(ways[name], name, 1)
    require(scheduler, str | None, "scheduler", "use its address, such as tcp://host:8786")
    if memory_mb is not None and processes is None and scheduler is None:
        raise InputError("memory_mb: threads share the memory of this process; give processes= or scheduler= too")


def _second_argument(second: object, goals: Ends | None, planner: Planner | None) -> Planner | None:
    """Return the planner of many problems, which may be the second argument."""
    if goals is not None:
        raise InputError("plan_many: goals belong to one world, which is then the first argument")
    if second is None:
        return planner
    if planner is not None or not isinstance(second, str | Callable):
        raise InputError(
            f"plan_many: after problems comes the planner, a name or a class, got {type(second).__name__}; starts and "
            "goals belong to one world, which is then the first argument"
        )
    return cast(Planner, second)


def _check_planner(planner: Planner | None, parameters: Mapping[str, Any]) -> None:
    """Refuse a planner that does not exist, and parameters that it does not have."""
    require(planner, str | Callable | None, "planner", "use a name of list_planners() or a planner class")
    if planner is None or (isinstance(planner, str) and is_auto(planner)):
        return  # each problem may name another; "auto" refuses parameters by itself
    named = named_planner(planner)
    check_options(named.factory, named.name, parameters)


def _loaded(load: Callable[[str], Problem], asked: Named) -> Query | Answer:
    """Return the query about a problem that is loaded now, or why it cannot be asked."""
    try:
        return Query.of(load(asked.name), asked.seed)
    except ProblemError as error:
        return no_plan(str(error), AUTO, asked.seed)
    except InputError as error:
        return error


def _jobs(
    asked: Sequence[Asked], planner: Planner | None, options: Mapping[str, Any], memory_mb: float, *, absolute: bool
) -> Iterator[dict[str, Any]]:
    """Return the jobs for other processes.

    Args:
        asked: The queries.
        planner: The planner, or None.
        options: Further arguments of `plan()`.
        memory_mb: Limit of memory [MB].
        absolute: Whether these processes may be in another folder.
    """
    if absolute and isinstance(planner, str) and is_planner_file(planner):
        planner = planner_in_folder(planner, Path.cwd())
    times, more = PATIENCE
    limits = {"patience": times * options["seconds"] + more, "memory_mb": memory_mb}
    # Nothing may be refused later on, when some of them are at work.
    jobs = [job_of(each, planner, options, k) | limits for k, each in enumerate(asked)]
    return _with_worlds(asked, jobs)


def _with_worlds(asked: Sequence[Asked], jobs: Sequence[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """Yield the jobs with their worlds; consecutive queries in one world share its bytes."""
    world = None
    parcel = None
    for query, job in zip(asked, jobs, strict=True):
        if isinstance(query, Query) and query.world is not world:
            world = query.world
            parcel = packed(world)
        yield job if isinstance(query, Named) else {**job, PARCEL: parcel}


def _answers(asked: Sequence[Asked], planner: Planner | None, records: Iterator[dict[str, Any]]) -> list[Answer]:
    """Return what has come of the queries in other processes, in their order."""
    answers: dict[int, Answer] = {}
    for record in records:
        k = record["number"]
        query = asked[k]
        if record["status"] != DONE:  # the process was lost
            reason = f"{record['status']}: {record['reason']}"
            answers[k] = no_plan(reason, planner or AUTO, query.seed, seconds=record.get("seconds", 0.0))
            continue

        answer: Answer = record["answer"]
        if isinstance(answer, Plan):
            problem = query.problem if isinstance(query, Query) else None
            statistics = MappingProxyType({**answer.statistics, "memory_mb": record["memory_mb"]})
            answer = replace(answer, problem=problem, statistics=statistics)
        answers[k] = answer
    return [answers[k] for k in range(len(asked))]


def _plans(asked: Sequence[Asked], planner: Planner | None, answers: Sequence[Answer]) -> list[Plan]:
    """Return the plans; an error becomes the reason of a plan without a path, unless every query has ended in one.

    Raises:
        RrtikError: The first error, in that case.
    """
    errors = [each for each in answers if not isinstance(each, Plan)]
    if errors and len(errors) == len(answers):
        raise errors[0]
    return [
        each if isinstance(each, Plan) else no_plan(str(each), planner or AUTO, query.seed)
        for each, query in zip(answers, asked, strict=True)
    ]
