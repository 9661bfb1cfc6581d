"""Runs of generated problems with path constraints: planned, timed, and judged densely."""

from __future__ import annotations

import time
from dataclasses import dataclass

import rrtik_ompl as rrtik
from bench.constraints.judge import judged
from bench.constraints.problems import generated
from rrtik_ompl.constraints.held_regions import held_regions
from rrtik_ompl.fast.search.constrained.search import ConstrainedSearch
from rrtik_ompl.ik.held_tables import held_tables

ROUNDS = 3  # of which the quickest counts
LIMIT = 1.0  # [s]
LONG = 3.0  # [s] for what was not solved, to see whether there is a path
EXPLORED = 2000  # samples of a search without collisions


@dataclass(frozen=True)
class Outcome:
    """Of one problem.

    Attributes:
        solids: How many there are around the arm.
        found: Whether there is a path within the limit.
        apart: Whether the reason is a proof that the constraint keeps start and goal apart.
        solvable: Whether a path was found, by a long search if need be.
        search: Processor time of `plan()` with "cbirrt" [s].
        whole: Likewise of "auto", which shortens too [s].
        proven: Whether that path is proven.
        rows: Its waypoints.
        metres, degrees, tilt, contacts: What the judge saw, the worse of both paths.
    """

    solids: int
    found: bool
    apart: bool
    solvable: bool
    search: float
    whole: float
    proven: bool
    rows: int
    metres: float
    degrees: float
    tilt: float
    contacts: int


def measured(name: str, kind: str, seed: int) -> Outcome:
    """One problem, planned in several rounds and judged."""
    problem = generated(name, kind, seed)
    rrtik.plan(problem, "cbirrt", seconds=LIMIT, seed=seed)  # kernels and the tables of the world
    times: dict[str, list[float]] = {"cbirrt": [], "auto": []}
    plans = {}
    for _ in range(ROUNDS):
        for planner, spent in times.items():
            begin = time.process_time()
            plans[planner] = rrtik.plan(problem, planner, seconds=LIMIT, seed=seed)
            spent.append(time.process_time() - begin)
        if not plans["cbirrt"].found:
            break
    search, whole = plans["cbirrt"], plans["auto"]
    found = search.found and whole.found
    apart = not search.found and "keeps start and goal apart" in search.reason
    solvable = found or rrtik.plan(problem, "cbirrt", seconds=LONG, seed=seed + 1).found
    seen = [judged(problem, plan.path.waypoints) for plan in (search, whole) if plan.path is not None]
    return Outcome(
        len(problem.world.scene.obstacles),
        found,
        apart,
        solvable,
        min(times["cbirrt"]),
        min(times["auto"]),
        bool(whole.proven),
        0 if whole.path is None else len(whole.path.waypoints),
        max((each.metres for each in seen), default=0.0),
        max((each.degrees for each in seen), default=0.0),
        max((each.tilt for each in seen), default=0.0),
        sum(each.contacts for each in seen),
    )


@dataclass(frozen=True)
class Branches:
    """Of a problem whose goal may lie on another branch.

    Attributes:
        found: Whether `plan()` finds a path in a second.
        apart: Whether it says that there is none, by a proof.
        joined: Whether a search without obstacles connects start and goal.
        seconds: Processor time [s].
    """

    found: bool
    apart: bool
    joined: bool
    seconds: float


def branches(name: str, kind: str, seed: int) -> Branches:
    """A problem whose goal is drawn from all branches, without obstacles."""
    crowded = generated(name, kind, seed, joined_ends=False)
    world = rrtik.World(crowded.robot)
    problem = rrtik.Problem(world, crowded.start, crowded.goal, constraints=crowded.constraints)
    begin = time.process_time()
    plan = rrtik.plan(problem, "cbirrt", seconds=LIMIT, seed=seed)
    spent = time.process_time() - begin
    apart = not plan.found and "keeps start and goal apart" in plan.reason
    tables = held_tables(problem.robot, held_regions(problem.robot, world.scene, problem.constraints, None))
    motions = world.motions
    assert tables is not None
    assert motions is not None
    search = ConstrainedSearch(motions, tables.address, *problem.robot.finite_range())
    ends = problem.start[None], crowded.goal.q[None]  # type: ignore[union-attr]
    way = search.solve(*ends, seed, max_iterations=EXPLORED, unchecked=True)
    return Branches(plan.found, apart, way is not None, spent)
