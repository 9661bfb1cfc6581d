"""Run many planning queries: in threads, in replaceable processes of this machine, or on a Dask cluster."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from rrtik_ompl.base.arrays import positive, seed_of, whole_number
from rrtik_ompl.base.choices import SuiteShortening, one_of
from rrtik_ompl.base.errors import InputError, RrtikError, UnknownNameError, listed, require
from rrtik_ompl.benchmark import spread
from rrtik_ompl.benchmark.campaign import all_jobs
from rrtik_ompl.benchmark.sources import build, file_source, from_plain
from rrtik_ompl.benchmark.suite import NONE, SHORTENINGS, Entrant, Suite
from rrtik_ompl.ompl_bridge.planner_names import AUTO, find_planner, is_auto, options_of, refuse_options
from rrtik_ompl.ompl_bridge.planner_options import is_safe

MOST_PROBLEMS = 100_000


def plan_batch(
    problems: Sequence[str | os.PathLike[str]],
    planner: str | None = None,
    *,
    seconds: float = 5.0,
    seed: int | None = 0,
    parameters: Mapping[str, Any] | None = None,
    shorten: SuiteShortening = NONE,
    memory_mb: float = 4096.0,
    jobs: int = 1,
    scheduler: str | None = None,
) -> list[dict[str, Any]]:
    """Plan for many problems.

    Our own planners, which respect their time limit and can run concurrently, work in threads of this process, which
    saves the start of processes. OMPL's planners, and shortening, work in processes: if a query there crashes, hangs or
    takes too much memory, only this query is lost. Workers of a cluster receive names of problems or files, not worlds:
    each builds the world of a problem once, as long as its queries are consecutive.

    The same seed gives the same paths however the queries are distributed, unless the time limit ends a query.

    Args:
        problems: Names of shipped problems, or files.
        planner: Name of one of :func:`rrtik_ompl.list_planners`; None for the default of :func:`rrtik_ompl.plan`.
        seconds: Time limit of each query [s]; a query in a process is killed 30 s after three times this limit.
        seed: Seed of all queries; None draws one.
        parameters: Options of the planner.
        shorten: A shortening method, "none", or "by-kind": axis for single-joint moves.
        memory_mb: Memory of a query in a process in addition to robot, scene and library [MB].
        jobs: Number of concurrent queries on this machine.
        scheduler: Address of a Dask scheduler whose workers run the queries instead.

    Returns:
        One record for each problem, in their order: status ("solved", "not found", ...), reason, and measured values,
        as in the file of a campaign; ``waypoints`` is the path, shape (k, n), if the problem was solved.

    Raises:
        UnknownNameError: If there is no such problem, planner, parameter or method of shortening.
        InputError: If a number makes no sense, a file is not there, or the scheduler cannot be used.

    Example:
        >>> [row["status"] for row in rrtik.plan_batch(["planar3_boxes", "titan4_prisms"], "bicrdt", seed=1)]
        ['solved', 'solved']
    """
    if isinstance(problems, str | os.PathLike) or not isinstance(problems, Iterable):
        raise InputError(f"problems must be a list of names or files, got {problems!r:.80}")
    problems = listed(problems, "problems", MOST_PROBLEMS)
    for k, each in enumerate(problems):
        require(each, str | os.PathLike, f"problems[{k}]", "give a name or a file; Problem.save() writes one")
    require(parameters, Mapping | None, "parameters of a planner", "use {name of an option: value}")

    named = [file_source(os.fspath(each), Path.cwd()) for each in problems]
    limit = positive(seconds, "seconds")

    suite = Suite(
        name="batch",
        title="batch",
        # Numbers, because names may repeat.
        sources=tuple(replace(source, name=str(k)) for k, source in enumerate(named)),
        entrants=(_entrant(planner, dict(parameters or {}), shorten),),
        runs=1,
        seconds=limit,
        patience=3.0 * limit + 30.0,
        memory_mb=positive(memory_mb, "memory_mb"),
        seed=seed_of(seed),
    )

    left = all_jobs(suite)
    count = whole_number(jobs, "jobs", 1)
    finished = spread.local(left, count, _beside) if scheduler is None else spread.cluster(left, scheduler)
    records = {int(record["problem"]): record for record in finished}
    return [{**records[k], "problem": source.name} for k, source in enumerate(named)]


def _entrant(planner: str | None, parameters: dict[str, Any], shorten: SuiteShortening) -> Entrant:
    label = planner or AUTO
    options = options_of(label)

    if is_auto(label):
        refuse_options(parameters)
    for key in parameters:
        if key not in options:
            raise UnknownNameError(f"parameter of planner {label}", key, options)

    return Entrant(label, planner, parameters, one_of(SHORTENINGS, shorten, "shortening method"))


def _beside(job: Mapping[str, Any]) -> bool:
    """Check whether a job can run in a thread: the planner must be our own, without shortening."""
    if job["shorten"] != NONE:
        return False
    try:
        name = job["planner"] or build(from_plain(job["source"])).planner or AUTO
        return is_auto(name) or is_safe(find_planner(name))
    except (RrtikError, MemoryError):  # the process will report what is wrong with the problem
        return False
