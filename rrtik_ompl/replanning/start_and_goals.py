"""Start and goals of a run of replanning, accepted or refused."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import TAU, Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.ik.goal_configurations import goal_configurations
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.world.moving_world import MovingWorld
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

GoalFeed = Callable[[float], ArrayLike]


def refuse_constraints(problem: Problem, verb: str) -> None:
    """Refuse a problem with path constraints, which replanning does not keep.

    Args:
        problem: The problem.
        verb: What was to be done, which begins the message.

    Raises:
        InputError: If the problem has path constraints.
    """
    if problem.constraints:
        raise InputError(f"{verb}: path constraints are not kept there; leave them out, or use plan()")


def check_start(q: Vector, world: World, moving: MovingWorld) -> None:
    """Refuse a run that begins in contact, or nearer to contact than the margin.

    Args:
        q: The start configuration, shape (n,).
        world: The world at the begin of the run, which checks for contact.
        moving: The world that checks for the margins of the run too.

    Raises:
        InputError: If it does; the message names the pair of bodies.
    """
    if not world.valid(q):
        fault = f"scene feed: at its begin the robot is in collision: {world.explain(q)}"
        raise InputError(f"{fault}; move the obstacle or lower its margin")
    if not moving.valid(q):
        nearest = world.closest(q)
        pair = "" if nearest is None else f" ('{nearest.first}' to '{nearest.second}': {nearest.distance:.3g} m)"
        remedy = "lower margin, clearance or speed_bound, or raise rate"
        raise InputError(f"start: nearer to contact than the margin{pair}; {remedy}")


def arm_alone(world: World) -> World:
    """Return the conservative world of the arm and what it holds, without obstacles."""
    obstacles = (o.name for o in world.scene.obstacles)
    return world.with_accuracy("conservative").with_scene(world.scene.without(*obstacles))


def every_goal(problem: Problem, world_of_arm: World, rng: np.random.Generator) -> Matrix:
    """Return every configuration that may be the goal, also those that obstacles block now, shape (g, n).

    Args:
        problem: Its goal is a configuration or a goal region.
        world_of_arm: The world without obstacles, in which configurations of a region are looked for.
        rng: Source of random numbers for this search.

    Raises:
        InputError: If there is no such configuration.
    """
    if problem.goal.q is not None:
        return problem.goal.q[None]
    search = goal_configurations(Problem(world_of_arm, problem.start, problem.goal), rng)
    if len(search.rows) == 0:
        raise InputError(f"goal: {search.reason}")
    return search.rows


def goal_now(robot: Robot, goal_feed: GoalFeed, now: float) -> Matrix:
    """Return the configuration of a moving goal at a time [s], shape (1, n).

    Raises:
        InputError: If it is no configuration of the robot, or outside the limits.
    """
    q = robot.configuration(goal_feed(now), f"goal at {now:g} s")
    if fault := robot.limit_fault(q):
        raise InputError(f"goal at {now:g} s: {fault}")
    return robot.onto_limits(q)[None]


def sampling_box(robot: Robot, ends: Matrix) -> tuple[Vector, Vector]:
    """Return the lower and upper corner of the box to sample in, shape (n,) each.

    A joint without a limit is sampled up to one turn beyond the given configurations.

    Args:
        robot: The robot whose limits bound the box.
        ends: Configurations that must be inside the box, shape (k, n).
    """
    lower = np.where(np.isfinite(robot.lower), robot.lower, ends.min(axis=0) - TAU)
    upper = np.where(np.isfinite(robot.upper), robot.upper, ends.max(axis=0) + TAU)
    return lower, upper
