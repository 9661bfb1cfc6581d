"""The call that people make: a short, proven path by a few calls of kernels, before any planner is asked.

To each goal configuration, the nearest first, there is one search in coarse steps. Its route jumps from waypoint to
waypoint, and is pulled taut for a moment if there are others to compare with; the shortest one is pulled on. A
configuration whose straight line is no shorter than the best route so far is left out. Every motion that is kept is
proven, so neither the search nor the result is checked again. A route that cannot be proven means the next seed.

All of it is bounded by counts: the same seed gives the same path. Where it finds nothing, the planners take their turns
(:mod:`rrtik_ompl.planning.portfolio`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.values import dataclass
from rrtik_ompl.description.joint_weights import weights_of
from rrtik_ompl.kernels.layout import SOLID_INTS
from rrtik_ompl.kernels.proof.rows import PROOF_KERNELS
from rrtik_ompl.kernels.search.connect import ConnectSearch, kept_search, solve_each
from rrtik_ompl.kernels.search.connect_layout import KERNELS as SEARCH_KERNELS
from rrtik_ompl.kernels.search.contacts.layout import KERNELS as PULL_KERNELS
from rrtik_ompl.kernels.search.contacts.pulling import Pulling
from rrtik_ompl.kernels.search.motions.motion_table import FastMotions
from rrtik_ompl.kernels.warming import load_together
from rrtik_ompl.model.goal import has_continuous
from rrtik_ompl.model.path import JointPath, path_of
from rrtik_ompl.model.transitions import length_of
from rrtik_ompl.planning.members import members
from rrtik_ompl.planning.outcome import Plan, Request
from rrtik_ompl.world.clearances import CLEARANCE
from rrtik_ompl.world.problem import Problem, planning_bounds
from rrtik_ompl.world.proven_motions import KERNELS as PROVEN_KERNELS
from rrtik_ompl.world.proven_motions import ProvenMotions, kept_motions
from rrtik_ompl.world.weighted_motions import WeightedMotions
from rrtik_ompl.world.world import World, form_of

SEARCHED_AS = "fastrrtconnect"  # the planner whose search this is; no planner is imported to know that
MOST_GOALS = 4  # goal configurations that are tried
TRIES = 8  # searches to each, until one of them has led to a proven route
SEARCHES = 2  # to each goal configuration, where its route is long
LONG = 1.5  # times the straight line
SAMPLES = 2000  # of each search
COARSE = 4.0  # times the usual steps
BRIEF_WORK = 40  # of the pull of a route that is compared with others, in proofs of free motions
CUTS = 6  # random cuts of the route
WORTH = 0.98  # a straight line of more than this share of the best length is left out
SPARE = 2.5e-4  # [m] that motions keep beyond the clearance of the path, as those of `shorten()` do
PULLED_AT_ONCE = 8  # routes of many queries in one call of a kernel, so that Ctrl-C is heard
MANY_PIECES = 250  # convex pieces of an arm whose motions take less to prove than to check in steps


class Tools(NamedTuple):
    """What searches and proves in a world.

    Searches and pulls work in coordinates in which Euclidean lengths are those that count: joint values, or their
    products with the joints' weights.

    Attributes:
        search: Searches in the box of configurations.
        motions: Motions that are proven to keep a clearance.
        weighted: The same between weighted configurations; ``motions`` itself where weights make no difference.
        table: What kernels read of these.
        lower, upper: The box of weighted configurations, shapes (dof,).
        clearance: What is said of proven paths, a little less than motions keep [m].
    """

    search: ConnectSearch
    motions: ProvenMotions
    weighted: ProvenMotions | WeightedMotions
    table: FastMotions
    lower: Vector
    upper: Vector
    clearance: float

    def weighted_rows(self, rows: Matrix) -> Matrix:
        """Return configurations, shape (..., dof), as weighted ones."""
        return rows if isinstance(self.weighted, ProvenMotions) else self.weighted.weighted_rows(rows)

    def proven_rows(self, rows: Matrix, ends: Matrix) -> Matrix | None:
        """Return a weighted route that is proven, shape (k, dof), in joint values; None if rounding breaks the proof.

        Args:
            rows: The route.
            ends: Configurations that are restored bit for bit, shape (m, dof).
        """
        if isinstance(self.weighted, ProvenMotions):
            return rows
        joint_rows = self.motions.robot.clamp(self.weighted.joint_rows(rows, ends))
        return joint_rows if self.motions.motion_valid_batch(joint_rows[:-1], joint_rows[1:]).all() else None


@dataclass(slots=True, eq=False)
class Shortest:
    """The best route so far.

    Attributes:
        route: What is pulled taut; None before any route is proven.
        found: The route as it was before that, shape (k, dof).
        length: How long it is [unit of the space].
        counts: Statistics of the plan.
    """

    route: Pulling | None
    found: Matrix
    length: float
    counts: dict[str, int | float]


def short_path(problem: Problem, request: Request, *, pull: bool) -> Plan | None:
    """Return the plan of a problem, or None where this finds no path or does not apply.

    Where it applies, :func:`loaded_for` says.

    Args:
        problem: The problem to solve.
        request: What is asked for.
        pull: Whether the path is shortened; otherwise it is what the plan of a shortened one has as ``unshortened``.
    """
    if not loaded_for(problem, request):
        return None
    if problem.goal.q is None:
        from rrtik_ompl.ik.methods import load_kernels  # with inverse kinematics, which other goals do without

        load_kernels(problem.robot)
    budget = request.budget.begun_now()
    goals = _goals(problem, budget)
    if goals is None:
        return None

    with tools_for(problem, request, goals) as tools:
        ends = np.concatenate([problem.start[None], goals])
        free = tools.motions.motion_valid_batch(ends, ends)
        if not free[0] or not free[1:].any():
            return None
        best = _best_route(tools.weighted_rows(problem.start), tools.weighted_rows(goals[free[1:]]), tools, budget)
        if best.route is None:
            return None
        searched = budget.elapsed
        if pull:
            with suppress(*request.survived):
                best.route.run(stop=budget.over)
        rows = best.route.waypoints

    if pull and len(best.found) > 2:
        best.counts["shortening_seconds"] = budget.elapsed - searched
    pulled = rows if pull else None
    return plan_of(problem, goals, best.found, pulled, tools, budget.elapsed, budget.seed, best.counts)


def plan_of(
    problem: Problem,
    goals: Matrix,
    found: Matrix,
    pulled: Matrix | None,
    tools: Tools,
    seconds: float,
    seed: int,
    counts: Mapping[str, int | float],
) -> Plan | None:
    """Return the plan of a proven weighted route; None if rounding breaks its proof in joint values.

    Args:
        problem: The problem that it solves.
        goals: Goal configurations, one of which it leads to, shape (m, dof).
        found: The route as it was found, shape (k, dof).
        pulled: The same after a pull, shape (m, dof); None for none.
        tools: What has proven both.
        seconds: How long it has taken [s].
        seed: What its random numbers depend on.
        counts: Statistics of the plan.
    """

    def proved(route: Matrix) -> JointPath | None:
        rows = tools.proven_rows(route, np.vstack([problem.start, goals]))
        return None if rows is None else path_of(problem.robot, rows, tools.motions.proof(rows, tools.clearance))

    own = proved(found)
    shortened = pulled is not None and len(found) > 2
    path = proved(pulled) if pulled is not None and shortened else own
    if own is None or path is None:
        return None
    return Plan(
        True,
        path,
        "",
        seconds,
        SEARCHED_AS,
        seed,
        MappingProxyType(counts),
        member=problem.goal.member_at(problem.robot, own.end),
        unshortened=own if shortened else None,
        problem=problem,
    )


def loaded_for(problem: Problem, request: Request) -> bool:
    """Check whether a problem may have a short path, and load the kernels for it.

    That is so for straight motions without path constraints, in worlds with kernels, where proofs are wanted and the
    planner that "auto" begins with is the search of these kernels.
    """
    if not _applies(problem, request) or members(problem)[:1] != (SEARCHED_AS,):
        return False
    load_together((SEARCH_KERNELS, PULL_KERNELS, PROVEN_KERNELS, PROOF_KERNELS))
    return True


@contextmanager
def tools_for(problem: Problem, request: Request, goals: Matrix) -> Iterator[Tools]:
    """Yield what searches and proves in the world of a problem.

    Args:
        problem: One that :func:`loaded_for` accepts.
        request: What is asked for.
        goals: Goal configurations, shape (k, dof).
    """
    world = problem.world
    clearance = max(CLEARANCE if request.clearance is None else request.clearance, world.settings.required_clearance)
    lower, upper = planning_bounds(problem, goals)
    lower = np.maximum(lower, world.robot.lower)  # Kernels prove nothing beyond the limits.
    upper = np.minimum(upper, world.robot.upper)
    motions = kept_motions(world, clearance + min(clearance, SPARE))
    checks = world.motions
    assert checks is not None  # as _applies() has found
    weights = weights_of(world.robot)
    if len(set(weights.tolist())) == 1:
        weights = np.ones(len(weights))
        weighted: ProvenMotions | WeightedMotions = motions
    else:
        weighted = _weighted(motions, weights)
    table = weighted.motions
    assert table is not None  # as there are kernels
    lower = lower * weights
    upper = upper * weights
    key = ("short path", lower.tobytes(), upper.tobytes())
    with kept_search(checks, key, lambda: _search_in(world, lower, upper, weights)) as search:
        yield Tools(search, motions, weighted, table, lower, upper, clearance)


def _weighted(motions: ProvenMotions, weights: Vector) -> WeightedMotions:
    """Return motions between weighted configurations, the same for the same motions; these are of one robot."""
    kept = motions.motions.spare.get("weighted")
    if kept is None:
        asked: Any = motions  # It has the parts of a world that are needed.
        motions.motions.spare["weighted"] = kept = WeightedMotions(asked, weights)
    known: WeightedMotions = kept
    return known


def _applies(problem: Problem, request: Request) -> bool:
    """Check whether a problem is of the kind that :func:`short_path` solves."""
    world = problem.world
    if request.proof == "off" or request.parameters or request.budget.iterations is not None:
        return False
    if type(world) is not World or world.settings.proving is not None:
        return False
    return world.motions is not None and not problem.constraints


def _goals(problem: Problem, budget: Budget) -> Matrix | None:
    """Return goal configurations, the nearest first, shape (k, dof); None if the start is one or none is known."""
    q = problem.goal.q
    at_goal = problem.reached(problem.start) if q is None else bool((problem.start == q).all())
    if at_goal:
        return None
    if q is not None and not has_continuous(problem.robot):
        return q[None]

    from rrtik_ompl.ik.goal_configurations import GoalSearch
    from rrtik_ompl.planning.goal_choice import nearest_rows

    found = GoalSearch(problem, budget.seed, seconds_left=lambda: budget.left).first()
    if len(found) == 0:
        return None
    return problem.robot.onto_limits(nearest_rows(problem, found)[:MOST_GOALS])


def _search_in(world: World, lower: Vector, upper: Vector, weights: Vector) -> ConnectSearch:
    coarse = form_of(world, accuracy="conservative", motion_resolution=COARSE * world.motion_resolution).motions
    assert coarse is not None
    looks = len(coarse.fast.table.moving_solids.solids) > MANY_PIECES * SOLID_INTS
    return ConnectSearch(coarse if (weights == 1.0).all() else coarse.scaled(weights), lower, upper, looks=looks)


def _best_route(start: Vector, goals: Matrix, tools: Tools, budget: Budget) -> Shortest:
    """Return the shortest of the routes to some goal configurations, as far as it is pulled taut to compare them.

    Args:
        start: Weighted, shape (dof,).
        goals: Weighted, the nearest first, shape (k, dof).
        tools: What searches and proves.
        budget: The seed, and when to end.
    """
    best = Shortest(None, goals[:0], np.inf, {"attempts": 0, "rejected": 0, "iterations": 0, "checked_motions": 0})
    lines = np.linalg.norm(goals - start, axis=1).tolist()
    for turn in range(TRIES):
        if turn >= SEARCHES and best.route is not None:
            break
        for k, line in enumerate(lines):
            enough = line / WORTH if turn == 0 else LONG * line
            if best.length <= max(enough, line / WORTH) or budget.over():
                continue
            _search(start, goals[k], 1000 * budget.seed + 100 * turn + k, tools, budget, best)
    return best


def _search(start: Vector, goal: Vector, seed: int, tools: Tools, budget: Budget, best: Shortest) -> None:
    """Search for a route, and keep it if it is proven and the best one."""
    search = tools.search
    rows = search.solve(
        start[None], goal[None], seed, ask=tools.weighted.motion_valid_batch, stop=budget.over, max_iterations=SAMPLES
    )
    counts = best.counts
    counts["attempts"] += 1
    counts["iterations"] += search.table.iterations
    counts["checked_motions"] += search.table.checked
    if rows is None:
        return

    route = Pulling(tools.table, rows, tools.lower, tools.upper, seed=seed, cuts=CUTS)
    if not route.jump():
        counts["rejected"] += 1
        return
    found = route.waypoints
    length = length_of(found)
    if len(found) > 2:
        route.run(work=BRIEF_WORK, stop=_at_once)
        length = length_of(route.waypoints)
    if length < best.length:
        best.route = route
        best.found = found
        best.length = length


class Route(NamedTuple):
    """A proven weighted route.

    Attributes:
        found: As it was found, shape (k, dof).
        pulled: The same after a pull, shape (m, dof).
        counts: Statistics of its search.
    """

    found: Matrix
    pulled: Matrix
    counts: Mapping[str, int | float]


def short_routes(ends: Matrix, seeds: Sequence[int], tools: Tools, *, whole: bool) -> list[Route | None]:
    """Make many routes in a few calls, each as :func:`short_path` does it; None for those that take more than a search.

    Args:
        ends: A proven start and a proven goal each, weighted, shape (m, 2, dof).
        seeds: Of each.
        tools: What searches and proves.
        whole: Whether routes are pulled to the end; otherwise as far as they are to be compared with others.
    """
    search_seeds = [1000 * seed for seed in seeds]
    searched = solve_each(tools.search, ends, search_seeds, SAMPLES)
    paths: dict[int, Matrix] = {}
    counts: dict[int, Mapping[str, int | float]] = {}
    for k, each in enumerate(searched):
        # What is asked there is answered by no, so a search that has asked is not the one of `short_path`.
        if each is not None and each.path is not None and each.questions == 0:
            paths[k] = each.path
            counts[k] = {
                "attempts": 1,
                "rejected": 0,
                "iterations": each.iterations,
                "checked_motions": each.motions,
            }

    routes: list[Route | None] = [None] * len(ends)
    longest = LONG * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    numbers = list(paths)
    for first in range(0, len(numbers), PULLED_AT_ONCE):
        some = numbers[first : first + PULLED_AT_ONCE]
        rows = [paths[k] for k in some]
        pull = Pulling(tools.table, max(rows, key=len), tools.lower, tools.upper, cuts=CUTS)
        own_seeds = [search_seeds[k] for k in some]
        found = pull.run_each(rows, own_seeds, longest[some], brief=BRIEF_WORK, whole=whole)
        for k, both in zip(some, found, strict=True):
            if both is not None:
                routes[k] = Route(*both, counts[k])
    return routes


def _at_once() -> bool:
    """Stop after the first call of a kernel."""
    return True
