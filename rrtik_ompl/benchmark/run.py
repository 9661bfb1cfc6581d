"""One run of a benchmark: build the problem, plan, shorten, measure; the result is plain and fits on one line."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np

from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.choices import ShorteningMethod, SuiteShortening
from rrtik_ompl.base.errors import RrtikError
from rrtik_ompl.benchmark.sources import build, from_plain
from rrtik_ompl.benchmark.suite import BY_KIND, NONE
from rrtik_ompl.description.catalog import AUTO
from rrtik_ompl.many.guard import CRASH, HANG, OUT_OF_MEMORY, out_of_memory
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.world_settings import FINEST_RESOLUTION
from rrtik_ompl.planning.outcome import Request
from rrtik_ompl.planning.plan import planned
from rrtik_ompl.planning.shortening import shorten
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

SOLVED, NOT_FOUND, INVALID, ERROR = "solved", "not found", "invalid", "error"
STRICT = 4.0  # factor of checks over a planner's; OMPL's own value for "strictly correct"
LOOKED_AT = 8  # largest number of waypoints whose clearance is measured
STATUSES = (SOLVED, NOT_FOUND, INVALID, ERROR, OUT_OF_MEMORY, CRASH, HANG)


def prepared(job: Mapping[str, Any]) -> Callable[[], dict[str, Any]]:
    """Build the problem of a job, which is not part of the run, and return what runs the job."""
    with suppress(RrtikError, MemoryError):  # the run will report why the problem cannot be built
        build(from_plain(job["source"]))
    return partial(execute, job)


def execute(job: Mapping[str, Any]) -> dict[str, Any]:
    """Run a job; every error in Python becomes a status.

    Args:
        job: As :func:`rrtik_ompl.benchmark.campaign.all_jobs` returns it.

    Returns:
        Status, reason, and measured values: seconds, lengths [rad, m], moves, clearance [m], counts of the planner,
        waypoints.
    """
    try:
        return _measured(job, build(from_plain(job["source"])))
    except RrtikError as error:
        return {"status": ERROR, "reason": str(error)}
    except MemoryError as error:
        return out_of_memory(job, error)
    except Exception as error:  # errors of other packages' planners must not end the campaign
        return {"status": ERROR, "reason": f"{type(error).__name__}: {error}"}


def _measured(job: Mapping[str, Any], problem: Problem) -> dict[str, Any]:
    """Plan, shorten and check a path, and return the record of the run."""
    request = Request(Budget(job["seed"], job["seconds"]), parameters=job["parameters"])
    found = planned(problem, job["planner"] or problem.planner or AUTO, request)
    record: dict[str, Any] = {
        "status": SOLVED if found.found else NOT_FOUND,
        "reason": found.reason,
        "plan_seconds": found.seconds,
        "counts": dict(found.statistics),
    }

    if found.path is None:
        return record

    begin = time.perf_counter()
    path = _shortened(found.path, problem, job["shorten"], found.seed)
    record |= {"shorten_seconds": time.perf_counter() - begin}

    faults = () if path is found.path else path.violations(problem.world)  # plan() has already checked its own path
    if faults or not problem.reached(path.end) or not (path.start == problem.start).all():
        reason = faults[0].reason if faults else "the path does not lead from the start to the goal"
        record |= {"status": INVALID, "reason": reason}

    final = _sizes(path, problem.world)
    initial = final if path is found.path else _sizes(found.path, problem.world)
    record |= {f"initial_{key}": value for key, value in initial.items()}
    return record | final | {"waypoints": path.waypoints.tolist()}


def _shortened(path: JointPath, problem: Problem, method: SuiteShortening, seed: int) -> JointPath:
    if method == NONE or len(path.waypoints) < 2:
        return path
    by_kind: ShorteningMethod = "axis" if path.one_joint_at_a_time else "auto"
    chosen = by_kind if method == BY_KIND else method
    return shorten(path, problem, method=chosen, seed=seed)


def _sizes(path: JointPath, world: World) -> dict[str, float | bool | None]:
    strict = world.with_resolution(max(world.motion_resolution / STRICT, FINEST_RESOLUTION))
    return {
        "length": path.length,
        "transitions": path.transitions,
        "segments": len(path.waypoints) - 1,
        "smoothness": smoothness(path),
        "clearance": clearance(path, world),
        "strict": bool(strict.motion_valid_batch(path.waypoints[:-1], path.waypoints[1:]).all()),
    }


def clearance(path: JointPath, world: World) -> float | None:
    """Return OMPL's clearance of a path [m]: the mean distance to contact at its waypoints; None without obstacles."""
    rows = path.waypoints
    some = rows[np.unique(np.linspace(0, len(rows) - 1, LOOKED_AT).round().astype(int))]
    mean = float(np.mean([world.clearance(q) for q in some]))
    return mean if np.isfinite(mean) else None


def smoothness(path: JointPath) -> float:
    """Return OMPL's smoothness of a path, 0 for a straight line.

    It is the sum over the waypoints of the squared turning angle divided by the mean length of both edges.
    """
    rows = path.waypoints
    sides = np.linalg.norm(np.diff(rows, axis=0), axis=1)
    before = sides[:-1]
    after = sides[1:]
    across = np.linalg.norm(rows[2:] - rows[:-2], axis=1)

    some = (before > 0.0) & (after > 0.0)
    before = before[some]
    after = after[some]
    across = across[some]

    cosines = np.clip((before**2 + after**2 - across**2) / (2.0 * before * after), -1.0, 1.0)
    return float((((np.pi - np.arccos(cosines)) * 2.0 / (before + after)) ** 2).sum())
