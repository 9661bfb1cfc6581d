"""`plan_many()`: plan many queries in one world, on all cores of this machine.

For each query `plan()` makes a brief attempt on what the kernels can prove, and accepts its path if all of it is proven
with the clearance of its ends. :func:`plans_together` does this for many queries in a few calls: the ends of all
queries, and then the paths of all queries, go to the kernels together. A query that needs any further step gets no plan
there; `plan()` then plans it from the beginning.
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

from rrtik_ompl.base.arrays import Mask, Matrix, Vector, dimensions, finite_array, seed_of
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
    seed: int | None = 0,
    parameters: Mapping[str, Any] | None = None,
    proof: ProofMode = "preferred",
    threads: int | None = None,
) -> list[Plan]:
    """Plan from starts to goals in one world, in threads; the paths do not depend on the number of threads.

    Args:
        world: Robot and scene.
        starts: Shape (m, dof), or (dof,) for one start of all queries [rad; m].
        goals: Shape (m, dof), or m goals.
        planner: As for :func:`rrtik_ompl.plan`. OMPL's planners, and third-party ones in Python, share one generator of
            random numbers among all threads, so they plan one query after the other.
        seconds: Limit of wall time for each query [s].
        seed: Seed of all queries; the k-th query has a seed of its own that depends on this and k alone. None draws
            one.
        parameters: Options of the planner.
        proof: As for :func:`rrtik_ompl.plan`.
        threads: Number of queries at a time; None for the number of cores.

    Returns:
        One plan for each query, in their order. If a start or goal cannot be used, the plan has no path, and its
        ``reason`` says why.

    Raises:
        UnknownNameError: If there is no planner of that name.
        InputError: If starts or goals have the wrong shape, or a number or a parameter is invalid.
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

    # Bring starts and goals into the form of one row and one goal for each query.
    dof = world.robot.dof
    wanted = _goals(goals, world.robot)
    rows = finite_array(starts, (dof,) if dimensions(starts) == 1 else (None, dof), "starts")
    rows = np.broadcast_to(rows, (len(wanted), dof)) if rows.ndim == 1 else rows
    if len(rows) != len(wanted):
        raise InputError(f"plan_many: as many starts as goals are needed, got {len(rows)} and {len(wanted)}")

    # Give each query its own seed.
    seeds = np.random.SeedSequence(seed_of(seed)).generate_state(max(len(rows), 1), np.uint32).tolist()
    queries = list(zip(rows, wanted, seeds[: len(rows)], strict=True))

    # Plan in batches of a fixed size, so that the results do not depend on the number of threads.
    alone = planner is not None and not is_auto(planner) and not is_safe(find_planner(planner))
    batches = [queries[first : first + TOGETHER] for first in range(0, len(queries), TOGETHER)]
    made = in_threads(partial(_batch, world, planner, request), batches, 1 if alone else threads)
    return [each for batch in made for each in batch]


def _goals(given: Ends, robot: Robot) -> list[Goal]:
    """Return goals as they are given; rows of configurations, shape (m, dof), become joint goals."""
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
    """Plan some queries: together where that is possible, the others one after the other.

    Args:
        world: Where they are.
        planner: Name of the planner; None for "auto".
        request: What is asked for each query, but for the seed.
        queries: Start, shape (dof,), goal and seed of each query.
    """
    known: dict[int, Plan | None] = {}
    if planner is not None and not is_auto(planner) and request.proof != "off":
        joints = {k: Query(q, goal, seed) for k, (q, goal, seed) in enumerate(queries) if isinstance(goal, JointGoal)}
        found = plans_together(world, named_planner(planner), list(joints.values()), request)
        known = dict(zip(joints, found, strict=True))

    return [known.get(k) or _planned(world, planner or AUTO, request, query) for k, query in enumerate(queries)]


def _planned(world: World, planner: str, request: Request, query: tuple[Vector, Goal, int]) -> Plan:
    """Plan one query as `plan()` does; an unusable start or goal becomes the reason of a plan without path."""
    start, goal, seed = query
    try:
        problem = Problem(world, start, goal)
    except ProblemError as error:
        return Plan(False, None, str(error), 0.0, planner, seed, MappingProxyType({}))
    return planned(problem, planner, replace(request, budget=replace(request.budget, seed=seed)))


@dataclass(frozen=True, slots=True, eq=False)
class Query:
    """One query: start configuration, shape (dof,), goal, and the seed of all random numbers."""

    start: Matrix
    goal: JointGoal
    seed: int


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    """A path that a search has found, with the counts of the search."""

    query: Query
    path: JointPath
    counts: Mapping[str, int | float]


def plans_together(
    world: World, planner: NamedPlanner, queries: Sequence[Query], request: Request
) -> list[Plan | None]:
    """Plan queries by one planner together; None for each query that `plan()` has to plan alone.

    The steps are: select the queries whose start and goal the kernels prove free, determine the clearance of these
    ends, search for each query, and prove all paths with the clearances of their ends. A query that fails a step gets
    None.

    Args:
        world: Where they are.
        planner: The planner that searches for each.
        queries: Their configurations may be outside the limits.
        request: What is asked for each query, but for the seed.
    """
    plans: list[Plan | None] = [None] * len(queries)
    if not (queries and serves(world, planner.factory)):
        return plans
    ends = np.array([[query.start, query.goal.q] for query in queries])
    any_problem = known_problem(world, *ends[0])
    load_kernels_for(any_problem, planner.factory)

    # Select the queries that can be planned together, search for each, and prove the paths found.
    began = time.perf_counter()
    usable = _usable(world, ends)
    clearances_of = dict(
        zip(np.flatnonzero(usable).tolist(), clearances_of_pairs(world, ends[usable], None), strict=True)
    )
    searcher = _Searcher(any_problem, planner, request)
    found = searcher.paths({k: queries[k] for k, clearances in clearances_of.items() if clearances is not None})
    proofs = _proofs(world, {k: (found_path.path.waypoints, clearances_of[k]) for k, found_path in found.items()})
    seconds_per_query = (time.perf_counter() - began) / len(queries)

    # Only queries with a proven path get a plan.
    for k, proof in proofs.items():
        query = found[k].query
        path = found[k].path.with_proof(proof)
        counts = {"attempts": 1, "rejected": 0, **found[k].counts}
        # This counts rejected paths. Some planners count something else by that name.
        counts["rejected"] = 0
        problem = known_problem(world, path.start, query.goal)
        plans[k] = Plan(
            True, path, "", seconds_per_query, planner.name, query.seed, MappingProxyType(counts), problem=problem
        )
    return plans


def serves(world: World, factory: PlannerFactory) -> bool:
    """Check whether queries may be planned together: by an array planner in an exact world whose kernels suffice."""
    robot = world.robot
    kernels_suffice = type(world) is World and world.accuracy == "exact" and world.fast is not None
    joints_are_bounded = bool(np.isfinite([robot.lower, robot.upper]).all()) and not robot.continuous.any()
    planner_is_reseeded = traits_of(factory).reseeded and is_safe(factory)
    return kernels_suffice and joints_are_bounded and not robot.joint_weights and planner_is_reseeded


def _usable(world: World, ends: Matrix) -> Mask:
    """Return which queries have two different ends inside the limits that the kernels prove free, shape (m,).

    Args:
        world: Robot and scene.
        ends: Start and goal of each query, shape (m, 2, dof).
    """
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
        """Search for each query as `SafePlanner.solve_rows` does, and return the results with their statistics.

        Args:
            ends: Free start and goal of each query, shape (m, 2, dof).
            seeds: The seed of each query.
            bounds: Lower and upper bounds of the joints, shapes (dof,).

        Returns:
            One result for each query; None for those that have to be searched for one after the other.
        """


class _Searcher:
    """One planner object that searches for many queries, reseeded for each of them."""

    def __init__(self, problem: Problem, planner: NamedPlanner, request: Request) -> None:
        self._robot = problem.world.robot
        self._request = request
        self._bounds = self._robot.lower, self._robot.upper
        options = {ITERATION_LIMIT: EFFORT_ITERATIONS, **request.parameters}
        brief = problem_in(problem, form_of(problem.world, accuracy="conservative"))
        assert is_safe(planner.factory)  # `serves` has checked it
        space = shared_space(*self._bounds)
        self._planner: SafePlanner = safe_planner(planner.factory, planner.name, space, brief, 0, options)

    def paths(self, queries: Mapping[int, Query]) -> dict[int, _Found]:
        """Return the paths that the first attempts of `plan()` find, keyed by the numbers of the queries."""
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
        """Search for one query with its own seed."""
        reseed(self._planner, seed)
        ends = query.start[None], query.goal.q[None]
        budget = self._request.budget.begun_now()
        _, rows = self._planner.solve_rows(*ends, self._bounds, budget.over, checked=True)
        return SearchResult(rows, self._planner.statistics)

    def _checked_path(self, query: Query, result: SearchResult) -> _Found | None:
        """Return a found path if it leads from the start to the goal of the query, else None."""
        if result.path is None:
            return None
        path = JointPath.of(self._robot, result.path)
        if len(path.waypoints) < 2 or (path.start != query.start).any() or (path.end != query.goal.q).any():
            return None
        return _Found(query, path, result.statistics)


def _proofs(world: World, routes: Mapping[int, tuple[Matrix, Clearances | None]]) -> dict[int, Proof]:
    """Return proofs of the routes that are proven free with the clearance of their ends, keyed by query.

    Args:
        world: Where the routes are.
        routes: Waypoints, shape (k, dof), and clearances of the ends of each route, keyed by query. Routes with the
            same clearance are proven in one call.
    """
    proofs: dict[int, Proof] = {}
    clearances_wanted = {clearances.proven_clearance for _, clearances in routes.values() if clearances is not None}
    for clearance in sorted(clearances_wanted):
        # Prove all motions of the routes with this clearance in one call.
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

        # Split the answers by route.
        ends = np.cumsum([len(rows) - 1 for rows in routes_of_clearance.values()])
        for (k, rows), is_proven in zip(routes_of_clearance.items(), np.split(proven, ends[:-1]), strict=True):
            if is_proven.all():
                proofs[k] = Proof(len(rows) - 1, clearance, (), world.prover.margin, maker=world.prover)
    return proofs
