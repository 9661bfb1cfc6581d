"""Many planning queries at once: in threads, in processes of this machine that may be lost, or on a Dask cluster."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from rrtik_ompl.base.arrays import positive, whole_number
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
    seed: int = 0,
    parameters: Mapping[str, Any] | None = None,
    shorten: SuiteShortening = NONE,
    memory_mb: float = 4096.0,
    jobs: int = 1,
    scheduler: str | None = None,
) -> list[dict[str, Any]]:
    """Plan for many problems.

    Planners of ours, which end in time and run side by side, work in threads of this process, so that nobody waits for
    others to begin. Those of OMPL, and shortening, work in processes: a query there that crashes, hangs or takes too
    much memory is lost alone. Workers of a cluster are sent names of problems or files, not worlds: each makes the
    world of a problem once, as long as its queries follow each other.

    The same seed gives the same paths however the queries are spread, as long as no time limit cuts in.

    Args:
        problems: Names of shipped problems, or files.
        planner: Name of one of :func:`rrtik_ompl.list_planners`; None: as of :func:`rrtik_ompl.plan`.
        seconds: Wall time for planning, each [s]; a query that takes 30 s more than thrice as long is killed.
        seed: Of all of them.
        parameters: Options of the planner.
        shorten: A method of shortening, "none", or "by-kind": axis for single-joint moves.
        memory_mb: That a query in a process may take beside robot, scene and library [MB].
        jobs: Queries at a time on this machine.
        scheduler: Address of a Dask scheduler whose workers do them instead.

    Returns:
        One record for each problem, in their order: status ("solved", "not found", ...), reason, and what was
        measured, as in the file of a campaign; ``waypoints`` is the path, shape (k, n), if it was solved.

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
        require(each, str | os.PathLike, f"problems[{k}]", "give a name or a file; save_problem() writes one")
    require(parameters, Mapping | None, "parameters of a planner", "use {name of an option: value}")

    named = [file_source(os.fspath(each), Path.cwd()) for each in problems]
    limit = positive(seconds, "seconds")

    suite = Suite(
        name="batch",
        title="batch",
        sources=tuple(replace(source, name=str(k)) for k, source in enumerate(named)),  # two may be of one name
        entrants=(_entrant(planner, dict(parameters or {}), shorten),),
        runs=1,
        seconds=limit,
        patience=3.0 * limit + 30.0,
        memory_mb=positive(memory_mb, "memory_mb"),
        seed=whole_number(seed, "seed"),
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
    """Whether a job may be done in a thread: its planner is one of ours, and nothing of OMPL shortens its path."""
    if job["shorten"] != NONE:
        return False
    try:
        name = job["planner"] or build(from_plain(job["source"])).planner or AUTO
        return is_auto(name) or is_safe(find_planner(name))
    except (RrtikError, MemoryError):  # a process will say what is wrong with the problem
        return False
