"""`plan_many()`: many queries in one world, by all cores of this machine.

For each query `plan()` makes a brief attempt on what kernels prove, and accepts its path if all of it is proven with
the clearance that its ends have. :func:`plans_together` does that for many queries in a few calls: the ends of all, and
then the paths of all, go to the kernels together. A query that takes any other turn gets no plan there; `plan()` then
does all of it.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Mask, Matrix, Vector, dimensions, finite_array, whole_number
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.choices import ProofMode, one_of
from rrtik_ompl.base.errors import InputError, ProblemError, require
from rrtik_ompl.kernels.threads import in_threads
from rrtik_ompl.model.goal import Goal, JointGoal
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.proof import Proof
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.ompl_bridge.attempt import ITERATION_LIMIT, attempt_seeds
from rrtik_ompl.ompl_bridge.planner_names import AUTO, find_planner, is_auto
from rrtik_ompl.ompl_bridge.planner_options import is_safe, reseed, safe_planner
from rrtik_ompl.ompl_bridge.planner_traits import PlannerFactory, traits_of
from rrtik_ompl.ompl_bridge.results import SearchResult
from rrtik_ompl.ompl_bridge.safe_planner import SafePlanner
from rrtik_ompl.ompl_bridge.setup import shared_space
from rrtik_ompl.planning.attempts import EFFORT_ITERATIONS, load_kernels_for
from rrtik_ompl.planning.outcome import NamedPlanner, Plan, Request
from rrtik_ompl.planning.plan import PROOF_MODES, named_planner, planned, time_limit
from rrtik_ompl.world.clearances import Clearances, clearances_of_pairs
from rrtik_ompl.world.problem import Problem, known_problem, problem_in
from rrtik_ompl.world.world import World, form_of

Ends = ArrayLike | Sequence[Goal]
TOGETHER = 32  # queries at a time, whatever the number of threads


def plan_many(
    world: World,
    starts: ArrayLike,
    goals: Ends,
    planner: str | None = None,
    *,
    seconds: float = 5.0,
    seed: int = 0,
    parameters: Mapping[str, Any] | None = None,
    proof: ProofMode = "preferred",
    threads: int | None = None,
) -> list[Plan]:
    """Plans from starts to goals in one world, in threads; what is found does not depend on how many there are.

    Args:
        world: Robot and scene.
        starts: Shape (m, dof), or (dof,) for one start of all of them, rad or m.
        goals: Shape (m, dof), or m goals.
        planner: As for :func:`rrtik_ompl.plan`. OMPL's, and those in Python of others, have one generator of random
            numbers for all threads, so they do one query after the other.
        seconds: Limit of wall time for each [s].
        seed: Of all of them; the k-th query has a seed of its own that depends on this and k alone.
        parameters: Options of the planner.
        proof: As for :func:`rrtik_ompl.plan`.
        threads: Queries at a time; as many as there are cores if None.

    Returns:
        One plan a query, in their order. A start or goal that cannot be used is the ``reason`` of a plan without path.

    Raises:
        UnknownNameError: If there is no planner of that name.
        InputError: If starts and goals are no such arrays, or a number or a parameter makes no sense.
        PlannerError: If the planner broke.

    Example:
        >>> problem = rrtik.load_problem("planar3_boxes")
        >>> plans = rrtik.plan_many(problem.world, problem.start, [problem.goal] * 3, "fastrrtconnect")
        >>> [each.found for each in plans]
        [True, True, True]
    """
    require(world, World, "world of plan_many", "use World(robot, scene)")
    one_of(PROOF_MODES, proof, "proof")
    require(parameters, Mapping | None, "parameters of a planner", "use {name of an option: value}")
    request = Request(Budget(seconds=time_limit(seconds)), parameters=parameters or {}, proof=proof)

    dof = world.robot.dof
    wanted = _goals(goals, world.robot)
    rows = finite_array(starts, (dof,) if dimensions(starts) == 1 else (None, dof), "starts")
    rows = np.broadcast_to(rows, (len(wanted), dof)) if rows.ndim == 1 else rows
    if len(rows) != len(wanted):
        raise InputError(f"plan_many: as many starts as goals are needed, got {len(rows)} and {len(wanted)}")

    seeds = np.random.SeedSequence(whole_number(seed, "seed")).generate_state(max(len(rows), 1), np.uint32).tolist()
    queries = list(zip(rows, wanted, seeds[: len(rows)], strict=True))

    alone = planner is not None and not is_auto(planner) and not is_safe(find_planner(planner))
    batches = [queries[first : first + TOGETHER] for first in range(0, len(queries), TOGETHER)]
    made = in_threads(partial(_batch, world, planner, request), batches, 1 if alone else threads)
    return [each for batch in made for each in batch]


def _goals(given: Ends, robot: Robot) -> list[Goal]:
    """Goals as they are given, or rows of configurations as goals."""
    if not isinstance(given, Sequence) or not all(isinstance(goal, Goal) for goal in given):
        rows: Any = given
        return [JointGoal(row) for row in finite_array(rows, (None, robot.dof), "goals")]

    goals = [goal for goal in given if isinstance(goal, Goal)]
    for number, goal in enumerate(goals):
        if goal.q is not None:
            robot.configuration(goal.q, f"goals[{number}]")
    return goals


def _batch(
    world: World, planner: str | None, request: Request, queries: Sequence[tuple[Vector, Goal, int]]
) -> list[Plan]:
    """The plans of some queries: together as far as that goes, the others one after the other."""
    known: dict[int, Plan | None] = {}
    if planner is not None and not is_auto(planner) and request.proof != "off":
        joints = {k: Query(q, goal, seed) for k, (q, goal, seed) in enumerate(queries) if isinstance(goal, JointGoal)}
        found = plans_together(world, named_planner(planner), list(joints.values()), request)
        known = dict(zip(joints, found, strict=True))

    return [known.get(k) or _planned(world, planner or AUTO, request, query) for k, query in enumerate(queries)]


def _planned(world: World, planner: str, request: Request, query: tuple[Vector, Goal, int]) -> Plan:
    """The plan of one query."""
    start, goal, seed = query
    try:
        problem = Problem(world, start, goal)
    except ProblemError as error:
        return Plan(False, None, str(error), 0.0, planner, seed, MappingProxyType({}))
    return planned(problem, planner, replace(request, budget=replace(request.budget, seed=seed)))


@dataclass(frozen=True, slots=True, eq=False)
class Query:
    """What is asked: a start, shape (dof,), a goal, and the seed of everything random."""

    start: Matrix
    goal: JointGoal
    seed: int


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    """A path that a search has found, and its counts."""

    query: Query
    path: JointPath
    counts: Mapping[str, int | float]


def plans_together(
    world: World, planner: NamedPlanner, queries: Sequence[Query], request: Request
) -> list[Plan | None]:
    """The plans of queries by one planner; None for each that is to be planned alone.

    Args:
        world: Where they are.
        planner: Searches for each.
        queries: Configurations inside the limits, or not.
        request: What is asked for each, but for the seed.
    """
    plans: list[Plan | None] = [None] * len(queries)
    if not (queries and serves(world, planner.factory)):
        return plans
    ends = np.array([[query.start, query.goal.q] for query in queries])
    any_problem = known_problem(world, *ends[0])
    load_kernels_for(any_problem, planner.factory)

    began = time.perf_counter()
    usable = _usable(world, ends)
    clearances_of = dict(
        zip(np.flatnonzero(usable).tolist(), clearances_of_pairs(world, ends[usable], None), strict=True)
    )
    searcher = _Searcher(any_problem, planner, request)
    found = searcher.paths({k: queries[k] for k, clearances in clearances_of.items() if clearances is not None})
    proofs = _proofs(world, {k: (found_path.path.waypoints, clearances_of[k]) for k, found_path in found.items()})
    seconds_per_query = (time.perf_counter() - began) / len(queries)

    for k, proof in proofs.items():
        query = found[k].query
        path = found[k].path.with_proof(proof)
        counts = {"attempts": 1, "rejected": 0, **found[k].counts}
        counts["rejected"] = 0  # paths, whatever a planner counts by that name
        problem = known_problem(world, path.start, query.goal)
        plans[k] = Plan(
            True, path, "", seconds_per_query, planner.name, query.seed, MappingProxyType(counts), problem=problem
        )
    return plans


def serves(world: World, factory: PlannerFactory) -> bool:
    """Whether queries may be planned together: by a planner of ours in an exact world whose kernels suffice."""
    robot = world.robot
    kernels_suffice = type(world) is World and world.accuracy == "exact" and world.fast is not None
    joints_are_bounded = bool(np.isfinite([robot.lower, robot.upper]).all()) and not robot.continuous.any()
    planner_is_reseeded = traits_of(factory).reseeded and is_safe(factory)
    return kernels_suffice and joints_are_bounded and not robot.joint_weights and planner_is_reseeded


def _usable(world: World, ends: Matrix) -> Mask:
    """Which starts and goals, shape (m, 2, dof), are two configurations inside the limits that kernels prove free."""
    rows = ends.reshape(-1, world.robot.dof)
    inside_limits: Mask = np.logical_and.reduce((rows >= world.robot.lower) & (rows <= world.robot.upper), axis=1)
    conservative = form_of(world, accuracy="conservative")
    is_free: Mask = conservative.checks.free(np.where(inside_limits[:, None], rows, 0.0)) & inside_limits
    usable: Mask = is_free[::2] & is_free[1::2] & np.logical_or.reduce(ends[:, 0] != ends[:, 1], axis=1)
    return usable


@runtime_checkable
class SolvesEach(Protocol):
    """A planner that searches for many queries in one call."""

    def solve_each(
        self, ends: Matrix, seeds: Sequence[int], bounds: tuple[Vector, Vector]
    ) -> Sequence[SearchResult | None]:
        """What `SafePlanner.solve_rows` does with each seed between free ends, shape (m, 2, dof), and its statistics.

        None for those that are to be searched for one after the other.
        """


class _Searcher:
    """One planner that searches for one query after the other."""

    def __init__(self, problem: Problem, planner: NamedPlanner, request: Request) -> None:
        self._robot = problem.world.robot
        self._request = request
        self._bounds = self._robot.lower, self._robot.upper
        options = {ITERATION_LIMIT: EFFORT_ITERATIONS, **request.parameters}
        brief = problem_in(problem, form_of(problem.world, accuracy="conservative"))
        assert is_safe(planner.factory)  # as `serves` has seen
        space = shared_space(*self._bounds)
        self._planner: SafePlanner = safe_planner(planner.factory, planner.name, space, brief, 0, options)

    def paths(self, queries: Mapping[int, Query]) -> dict[int, _Found]:
        """What the first attempts of `plan()` find, by the numbers of the queries."""
        seeds = [attempt_seeds(query.seed, self._request.restarts)[0] for query in queries.values()]
        quick: Sequence[SearchResult | None] = [None] * len(seeds)
        if isinstance(self._planner, SolvesEach) and queries:
            ends = np.array([(query.start, query.goal.q) for query in queries.values()])
            quick = self._planner.solve_each(ends, seeds, self._bounds)

        made = dict[int, _Found]()
        for (k, query), seed, result in zip(queries.items(), seeds, quick, strict=True):
            found = self._checked_path(query, result or self._search_one(query, seed))
            if found is not None:
                made[k] = found
        return made

    def _search_one(self, query: Query, seed: int) -> SearchResult:
        """What a search for one query finds."""
        reseed(self._planner, seed)
        ends = query.start[None], query.goal.q[None]
        budget = self._request.budget.begun_now()
        _, rows = self._planner.solve_rows(*ends, self._bounds, budget.over, checked=True)
        return SearchResult(rows, self._planner.statistics)

    def _checked_path(self, query: Query, result: SearchResult) -> _Found | None:
        """What was found, if it is a path from the start to the goal."""
        if result.path is None:
            return None
        path = JointPath.of(self._robot, result.path)
        if len(path.waypoints) < 2 or (path.start != query.start).any() or (path.end != query.goal.q).any():
            return None
        return _Found(query, path, result.statistics)


def _proofs(world: World, routes: Mapping[int, tuple[Matrix, Clearances | None]]) -> dict[int, Proof]:
    """Proofs of those routes that are proven to keep what their ends do, by their numbers."""
    proofs: dict[int, Proof] = {}
    clearances_wanted = {clearances.proven_clearance for _, clearances in routes.values() if clearances is not None}
    for clearance in sorted(clearances_wanted):
        routes_of_clearance = {
            k: rows
            for k, (rows, clearances) in routes.items()
            if clearances is not None and clearances.proven_clearance == clearance
        }
        proven = world.motions_proven(
            np.concatenate([rows[:-1] for rows in routes_of_clearance.values()]),
            np.concatenate([rows[1:] for rows in routes_of_clearance.values()]),
            clearance=clearance,
        )

        ends = np.cumsum([len(rows) - 1 for rows in routes_of_clearance.values()])
        for (k, rows), is_proven in zip(routes_of_clearance.items(), np.split(proven, ends[:-1]), strict=True):
            if is_proven.all():
                proofs[k] = Proof(len(rows) - 1, clearance, (), world.prover.margin, maker=world.prover)
    return proofs
