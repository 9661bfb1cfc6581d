"""`plan_many()`: many queries in one world, by all cores of this machine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Vector, dimensions, finite_array, positive, whole_number
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.choices import ProofMode, one_of
from rrtik_ompl.base.errors import InputError, ProblemError, require
from rrtik_ompl.kernels.threads import in_threads
from rrtik_ompl.model.goal import Goal, JointGoal
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.ompl_bridge.planner_names import AUTO, find_planner, is_auto
from rrtik_ompl.ompl_bridge.planner_options import is_safe
from rrtik_ompl.planning.batches import Query, plans_together
from rrtik_ompl.planning.outcome import NamedPlanner, Plan, Request
from rrtik_ompl.planning.plan import PROOF_MODES, plan
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

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

    dof = world.robot.dof
    wanted = _goals(goals, world.robot)
    rows = finite_array(starts, (dof,) if dimensions(starts) == 1 else (None, dof), "starts")
    rows = np.broadcast_to(rows, (len(wanted), dof)) if rows.ndim == 1 else rows
    if len(rows) != len(wanted):
        raise InputError(f"plan_many: as many starts as goals are needed, got {len(rows)} and {len(wanted)}")

    seeds = np.random.SeedSequence(whole_number(seed, "seed")).generate_state(max(len(rows), 1), np.uint32).tolist()
    options = {"seconds": seconds, "parameters": parameters, "proof": proof}
    queries = list(zip(rows, wanted, seeds[: len(rows)], strict=True))

    alone = planner is not None and not is_auto(planner) and not is_safe(find_planner(planner))
    batches = [queries[first : first + TOGETHER] for first in range(0, len(queries), TOGETHER)]
    made = in_threads(partial(_batch, world, planner, options), batches, 1 if alone else threads)
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
    world: World, planner: str | None, options: Mapping[str, Any], queries: Sequence[tuple[Vector, Goal, int]]
) -> list[Plan]:
    """The plans of some queries: together as far as that goes, the others one after the other."""
    known: dict[int, Plan | None] = {}
    if planner is not None and not is_auto(planner) and options["proof"] != "off":
        budget = Budget(seconds=positive(options["seconds"], "seconds"))
        request = Request(budget, parameters=options["parameters"] or {})
        joints = {k: Query(q, goal, seed) for k, (q, goal, seed) in enumerate(queries) if isinstance(goal, JointGoal)}
        found = plans_together(world, NamedPlanner(planner, find_planner(planner)), list(joints.values()), request)
        known = dict(zip(joints, found, strict=True))

    return [known.get(k) or _planned(world, planner, options, query) for k, query in enumerate(queries)]


def _planned(world: World, planner: str | None, options: Mapping[str, Any], query: tuple[Vector, Goal, int]) -> Plan:
    """The plan of one query."""
    start, goal, seed = query
    try:
        problem = Problem(world, start, goal)
    except ProblemError as error:
        return Plan(False, None, str(error), 0.0, planner or AUTO, seed, MappingProxyType({}))
    return plan(problem, planner, seed=seed, **options)
