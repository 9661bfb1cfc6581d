"""From where the arm is to a grasp, one joint at a time: to the pose before it, then on to the object.

Source: shared-control tool, section 6: BiCRDT with post-processing in place of RRT-Connect.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from rrtik_ompl.arrays import Vector
from rrtik_ompl.errors import ProblemError
from rrtik_ompl.ik.batch import solve_ik_batch
from rrtik_ompl.path import JointPath
from rrtik_ompl.pilot.clearance import tightest
from rrtik_ompl.planning import plan
from rrtik_ompl.problem import Problem
from rrtik_ompl.shortening import shorten
from rrtik_ompl.world import World

SECONDS = 2.0
LOOKS = 100  # along a route, for its clearance


@dataclass(frozen=True, slots=True, eq=False)
class Route:
    """A path of single-joint moves and what heads its list.

    Attributes:
        path: The path.
        grasp_from: Number of the first move that leads from the pose before the object to the object.
        travel: Sum of all moves [rad and m].
        seconds: Sum of all moves' times at the joints' rates.
        clearance: Least distance to anything, at some looks along it [m].
        joints: Names of the joints that move.
    """

    path: JointPath
    grasp_from: int
    travel: float
    seconds: float
    clearance: float
    joints: tuple[str, ...]


def route_to(world: World, q: Vector, goal: Vector, rates: Vector, seed: int) -> Route | str:
    """A route to a configuration, or the reason why there is none."""
    try:
        found = _moves(world, q, goal, seed)
    except ProblemError as error:
        return str(error)
    if isinstance(found, str):
        return found
    return _route(world, found, len(found.moves()), rates)


def route_to_grasp(
    world: World, holding: World, q: Vector, stages: tuple[Any, Any, Any], near: Vector, rates: Vector, seed: int
) -> Route | str:
    """A route to a grasp by way of the pose before it, or the reason why there is none.

    Args:
        world: In which nothing may be touched, for the first part.
        holding: In which the gripper may touch the object, for the second.
        q: Where the arm is, shape (dof,).
        stages: ``T_base_tip`` of approach, grasp and lift.
        near: Configuration near which the approach is wanted, shape (dof,).
        rates: Of the joints, shape (dof,).
        seed: Of the random numbers.
    """
    before = solve_ik_batch(world.robot, [stages[0].homogeneous], near=near, world=world, seed=seed)
    if not before.found[0]:
        return f"the pose before the object: {before.reasons[0] or 'not to be reached'}"
    at = solve_ik_batch(world.robot, [stages[1].homogeneous], near=before.q[0], world=holding, seed=seed)
    if not at.found[0]:
        return f"the grasp: {at.reasons[0] or 'not to be reached'}"
    try:
        first, second = _moves(world, q, before.q[0], seed), _moves(holding, before.q[0], at.q[0], seed)
    except ProblemError as error:
        return str(error)
    if isinstance(first, str) or isinstance(second, str):
        return first if isinstance(first, str) else f"from before the object to it: {second}"
    rows = np.vstack([first.waypoints, second.waypoints[1:]])
    return _route(holding, first.with_waypoints(rows), len(first.moves()), rates)


def _moves(world: World, q: Vector, goal: Vector, seed: int) -> JointPath | str:
    if np.abs(goal - q).max() < 1e-9:
        return JointPath.of(world.robot, np.vstack([q, q]))
    problem = Problem(world, q, goal)
    found = plan(problem, "bicrdt", seconds=SECONDS, seed=seed)
    if found.path is None:
        return found.reason
    return shorten(found.path, problem, method="axis-rounds", seed=seed)


def _route(world: World, path: JointPath, grasp_from: int, rates: Vector) -> Route:
    moves, names = path.moves(), list(path.joint_names)
    looks = path.resample(max(path.length / LOOKS, 1e-3)).waypoints
    nearest = tightest(world, looks)
    clearance = np.inf if nearest is None else nearest.distance
    seconds = sum(abs(move.change) / rates[names.index(move.joint)] for move in moves)
    used = tuple(name for name in names if any(move.joint == name for move in moves))
    return Route(path, grasp_from, sum(abs(m.change) for m in moves), float(seconds), float(clearance), used)
