"""One query as a job for another process: what is sent there, and what is done with it there."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Mapping
from functools import lru_cache, partial
from typing import Any

from rrtik_ompl.base.errors import InputError, PlannerError, ProblemError
from rrtik_ompl.description.catalog import AUTO
from rrtik_ompl.many.guard import PARCEL, out_of_memory
from rrtik_ompl.many.parcels import Parcel, unpacked
from rrtik_ompl.many.queries import Asked, Named
from rrtik_ompl.ompl_bridge.planner_traits import PlannerFactory
from rrtik_ompl.planning.many import Answer, no_plan
from rrtik_ompl.planning.plan import plan
from rrtik_ompl.problem_files.problem import load_problem
from rrtik_ompl.world.problem import Problem, known_problem
from rrtik_ompl.world.world import World

DONE, ERROR = "done", "error"  # statuses of runs that were not lost
_load = lru_cache(maxsize=4)(load_problem)  # consecutive queries are often about one problem


def job_of(
    asked: Asked, planner: str | PlannerFactory | None, options: Mapping[str, Any], number: int
) -> dict[str, Any]:
    """Return a query as plain values, without its world and the limits of time and memory.

    Args:
        asked: The query.
        planner: The planner; None for that of the problem.
        options: Further arguments of `plan()`.
        number: Number of the query, by which its record is known.

    Raises:
        InputError: If a goal, the planner or an option cannot be sent to another process.
    """
    if isinstance(asked, Named):
        sent: object = asked.name
    else:
        problem = asked.problem
        known = None if problem is None else {"name": problem.name, "planner": problem.planner}
        sent = asked.start, asked.goal, known
    try:
        content = pickle.dumps((sent, planner, {**options, "seed": asked.seed}))
    except Exception as error:  # whatever a class of the user's raises
        said = f"{type(error).__name__}: {error}"
        raise InputError(f"plan_many: query {number} cannot be sent to another process: {said}") from None

    label = planner if isinstance(planner, str) else None
    return {"run": {"number": number}, "module": __name__, "planner": label, "content": content}


def prepared(job: Mapping[str, Any]) -> Callable[[], dict[str, Any]]:
    """Make the problem of a job, and return what plans it; see `many.child.guarded`."""
    try:
        sent, planner, options = pickle.loads(job["content"])
    except Exception as error:  # whatever a class of the user's raises
        remedy = "define its classes in a module, not in a script"
        said = f"{type(error).__name__}: {error}"
        return partial(_done, InputError(f"a query cannot be read in another process: {said}; {remedy}"))

    try:
        problem = _problem(sent, job[PARCEL])
    except ProblemError as error:
        return partial(_done, no_plan(str(error), planner or AUTO, options["seed"]))
    except InputError as error:
        return partial(_done, error)
    return partial(_run, job, problem, planner, options)


def _problem(sent: Any, parcel: Parcel) -> Problem:  # noqa: ANN401 - what `job_of` has pickled
    """Return the problem of a query; made already if another query has had the same name or world."""
    if isinstance(sent, str):
        return _load(sent)
    start, goal, known = sent
    world: World = unpacked(parcel)
    return Problem(world, start, goal) if known is None else known_problem(world, start, goal, **known)


def _run(
    job: Mapping[str, Any], problem: Problem, planner: str | PlannerFactory | None, options: Mapping[str, Any]
) -> dict[str, Any]:
    """Plan, and return the record: the plan, or what `plan()` has raised."""
    try:
        return _done(plan(problem, planner, **options))
    except (InputError, PlannerError) as error:
        return _done(error)
    except MemoryError as error:
        return out_of_memory(job, error)
    except Exception as error:  # whatever another package's planner raises
        return {"status": ERROR, "reason": f"{type(error).__name__}: {error}"}


def _done(answer: Answer) -> dict[str, Any]:
    return {"status": DONE, "answer": answer}
