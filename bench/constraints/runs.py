"""Runs of generated problems with path constraints: planned, timed, and judged densely."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import rrtik_ompl as rrtik
from bench.constraints.judge import judged
from bench.constraints.problems import generated
from bench.shared.clocks import spent
from bench.shared.problems import goal_joints
from rrtik_ompl.constraints.held_regions import held_regions
from rrtik_ompl.ik.held_tables import held_tables
from rrtik_ompl.kernels.search.constrained.search import ConstrainedSearch

ROUNDS = 3  # of which the quickest counts
LIMIT = 1.0  # [s] of processor time
WALL = 3.0  # times the limit, by the clock: a busy machine is no reason to be out of time
LONG = 3.0  # [s] for what was not solved, to see whether there is a path
EXPLORED = 2000  # samples of a search without obstacles
EXPLORED_LONG = 20_000  # likewise, for what was not solved


@dataclass(frozen=True)
class Outcome:
    """Of one problem.

    Attributes:
        scenes: How many were drawn until there was a problem.
        made: Whether there is a problem; all else is nothing if not.
        solids: How many there are around the arm.
        found: Whether there is a path within the limit.
        apart: Whether the reason is a proof that the constraint keeps start and goal apart.
        solvable: Whether a path was found, by a long search with another seed if need be.
        joined: Whether a path was found, or a long search without obstacles connects start and goal.
        search: Processor time of `plan()` with "cbirrt" [s].
        whole: Likewise of "auto", which shortens too [s].
        proven: Whether that path is proven.
        rows: Its waypoints.
        metres, degrees, tilt, contacts: What the judge saw, the worse of both paths.
    """

    scenes: int
    made: bool
    solids: int
    found: bool
    apart: bool
    solvable: bool
    joined: bool
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
    drawn = generated(name, kind, seed)
    problem = drawn.problem
    if problem is None:
        return Outcome(drawn.scenes, False, 0, False, False, False, False, 0.0, 0.0, False, 0, 0.0, 0.0, 0.0, 0)
    # Loads the kernels and makes the tables of the world too.
    first = rrtik.plan(problem, "cbirrt", seconds=WALL * LIMIT, seed=seed, shorten=False)
    times: dict[str, list[float]] = {"cbirrt": [], "auto": []}
    plans = {"cbirrt": first, "auto": first}
    for _ in range(ROUNDS if first.found else 0):
        for planner, taken in times.items():
            finished = planner == "auto"
            call = partial(rrtik.plan, problem, planner, seconds=WALL * LIMIT, seed=seed, shorten=finished)
            seconds, plans[planner] = spent(call)
            taken.append(seconds)
    search, whole = plans["cbirrt"], plans["auto"]
    found = search.found and whole.found and max(min(taken) for taken in times.values()) <= LIMIT
    apart = not search.found and "keeps start and goal apart" in search.reason
    solvable = search.found or rrtik.plan(problem, "cbirrt", seconds=LONG, seed=seed + 1, shorten=False).found
    seen = [judged(problem, plan.path.waypoints) for plan in (search, whole) if plan.path is not None]
    return Outcome(
        drawn.scenes,
        True,
        len(problem.world.scene.obstacles),
        found,
        apart,
        solvable,
        solvable or joined_without_obstacles(problem, seed, EXPLORED_LONG),
        min(times["cbirrt"], default=0.0),
        min(times["auto"], default=0.0),
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
    crowded = generated(name, kind, seed, joined_ends=False).problem
    if crowded is None:
        return Branches(False, False, False, 0.0)
    world = rrtik.World(crowded.robot)
    problem = rrtik.Problem(world, crowded.start, crowded.goal, constraints=crowded.constraints)
    seconds, plan = spent(lambda: rrtik.plan(problem, "cbirrt", seconds=LIMIT, seed=seed, shorten=False))
    apart = not plan.found and "keeps start and goal apart" in plan.reason
    return Branches(plan.found, apart, joined_without_obstacles(problem, seed, EXPLORED), seconds)


def joined_without_obstacles(problem: rrtik.Problem, seed: int, samples: int) -> bool:
    """Whether a search that sees neither obstacles nor the arm itself connects start and goal along the constraint."""
    world = rrtik.World(problem.robot)
    tables = held_tables(problem.robot, held_regions(problem.robot, world.scene, problem.constraints, None))
    motions = world.motions
    assert tables is not None
    assert motions is not None
    search = ConstrainedSearch(motions, tables.held, *problem.robot.finite_range())
    ends = problem.start[None], goal_joints(problem)[None]
    return search.solve(*ends, seed, max_iterations=samples, unchecked=True) is not None
