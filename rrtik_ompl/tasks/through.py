"""Plan one path through several goals in order: `plan_through()`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from numbers import Real

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import dimensions
from rrtik_ompl.base.errors import InputError, listed
from rrtik_ompl.model.goal_kind import TaskRegion
from rrtik_ompl.model.path import JointPath, path_through
from rrtik_ompl.tasks import SECONDS, MoveTo, Task
from rrtik_ompl.world.clearances import proved
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World


@dataclass(frozen=True, slots=True, eq=False)
class PlanThrough:
    """A path through several goals.

    Attributes:
        found: Whether all goals can be reached, in their order.
        path: The whole path, or None.
        reached: Index of the waypoint at which each goal is reached.
        reason: "" if found, otherwise which goal could not be reached, how often and why.

    Example:
        >>> import rrtik_ompl as rrtik
        >>> world = rrtik.World(rrtik.load_robot("titan4"))
        >>> tour = rrtik.plan_through(world, "zero", ["ready", "zero"], seed=1)
        >>> bool((tour.path.waypoints[tour.reached[0]] == world.robot.posture("ready")).all())
        True
    """

    found: bool
    path: JointPath | None
    reached: tuple[int, ...]
    reason: str


def placed_constraints(
    world: World, start: ArrayLike | str, constraints: Iterable[TaskRegion]
) -> tuple[TaskRegion, ...]:
    """Return path constraints with regions placed as seen from a start, for stages that begin elsewhere.

    Raises:
        ProblemError: If the start violates them, or cannot be used.
    """
    regions = listed(constraints, "path constraints")
    return Problem(world, start, start, constraints=regions).constraints if regions else ()


def plan_through(
    world: World,
    start: ArrayLike | str,
    goals: Sequence[object],
    *,
    constraints: Iterable[TaskRegion] = (),
    seconds: float = SECONDS,
    seed: int | None = 0,
) -> PlanThrough:
    """Plan a path that reaches one goal after the other, with configurations chosen such that all can be reached.

    Args:
        world: Robot and scene.
        start: Configuration, shape (dof,), or the name of a posture.
        goals: Each is a goal, the name of a posture, a configuration, shape (dof,), or a pose of the tip as ``SE3`` or
            matrix.
        constraints: Regions that a frame must not leave on the whole path; those ``from_start`` refer to the start.
        seconds: Time limit [s].
        seed: The same seed gives the same path, unless the time limit ends the search. None draws one.

    Raises:
        InputError: If there are no goals, or one is not valid; the message gives its number.
        ProblemError: If the start is in collision, outside the limits or outside the region of a constraint.

    Example:
        >>> import rrtik_ompl as rrtik
        >>> world = rrtik.World(rrtik.load_robot("titan4"))
        >>> tour = rrtik.plan_through(world, "zero", ["ready", rrtik.PositionGoal([1.0, 0.4, 0.2]), "zero"], seed=1)
        >>> tour.found, len(tour.reached), tour.reached[-1] == len(tour.path.waypoints) - 1
        (True, 3, True)
    """
    goal_list = listed(goals, "goals to be reached in order")
    if not goal_list:
        raise InputError(
            "goals to be reached in order: there is none; give at least one, such as PoseGoal(T_world_tip)"
        )
    placed = placed_constraints(world, start, constraints)
    if dimensions(goals) == 1 and all(isinstance(goal, Real) for goal in goal_list):
        raise InputError("goals to be reached in order: this is one configuration; put it into a list: [q]")

    stages = [MoveTo(goal, constraints=placed) for goal in goal_list]
    plan = Task(stages).plan(world, start, seconds=seconds, seed=seed)
    if not plan.found:
        return PlanThrough(False, None, (), plan.reason)

    rows = [plan.paths[0].waypoints, *(path.waypoints[1:] for path in plan.paths[1:])]
    reached = np.cumsum([len(part) for part in rows]) - 1
    path = path_through(plan.paths[0], np.vstack(rows))
    judge = Problem(world, path.start, path.end, constraints=placed).world if placed else world
    return PlanThrough(True, proved(path, judge), tuple(reached.tolist()), "")
