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
from rrtik_ompl.pilot.clearance import executions, free_rows, tightest
from rrtik_ompl.pilot.follower import slack
from rrtik_ompl.planning import plan
from rrtik_ompl.problem import Problem
from rrtik_ompl.shortening import shorten
from rrtik_ompl.world import World

SECONDS = 2.0
LOOKS = 100  # along a route, for its clearance
ATTEMPTS = 2  # of which the route is taken that forgives most errors, then the one of fewest moves
STEADY = 0.99
EXECUTIONS = 100  # with errors, of which the share that touches nothing is told


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
        steady: Share of executions that touch nothing although every move ends up to a degree beside its end.
    """

    path: JointPath
    grasp_from: int
    travel: float
    seconds: float
    clearance: float
    joints: tuple[str, ...]
    steady: float

    def summary(self) -> str:
        """The head of the list in one line, with a warning where a small error may touch something."""
        room = "nothing near" if np.isinf(self.clearance) else f"at least {1e3 * self.clearance:.0f} mm away"
        line = f"{len(self.path.moves())} moves, {self.seconds:.0f} s, {room}"
        if self.steady >= STEADY:
            return line
        return f"{line}; narrow: with errors of 1 deg {100 * (1 - self.steady):.0f} of 100 executions touch something"


def route_to(world: World, q: Vector, goal: Vector, rates: Vector, seed: int) -> Route | str:
    """A route to a configuration, or the reason why there is none."""
    try:
        found = _moves(world, q, goal, seed)
    except ProblemError as error:
        return str(error)
    if isinstance(found, str):
        return found
    return _route(world, world, found, len(found.moves()), rates, seed)


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
    return _route(world, holding, first.with_waypoints(rows), len(first.moves()), rates, seed)


def _moves(world: World, q: Vector, goal: Vector, seed: int) -> JointPath | str:
    if np.abs(goal - q).max() < 1e-9:
        return JointPath.of(world.robot, np.vstack([q, q]))
    problem, paths = Problem(world, q, goal), []
    rng = np.random.default_rng(seed)
    for attempt in range(ATTEMPTS):
        found = plan(problem, "bicrdt", seconds=SECONDS, seed=seed + attempt)
        if found.path is None:
            return found.reason
        path = shorten(found.path, problem, method="axis-rounds", seed=seed)
        touching = 1.0 - float(free_rows(world, executions(path, slack(path), EXECUTIONS, rng)).mean())
        paths.append((round(10.0 * touching), path.transitions, path.length, attempt, path))
    return min(paths)[-1]


def _route(world: World, holding: World, path: JointPath, grasp_from: int, rates: Vector, seed: int) -> Route:
    moves, names = path.moves(), list(path.joint_names)
    looks = path.resample(max(path.length / LOOKS, 1e-3)).waypoints
    nearest = tightest(holding, looks)
    clearance = np.inf if nearest is None else nearest.distance
    seconds = sum(abs(move.change) / rates[names.index(move.joint)] for move in moves)
    used = tuple(name for name in names if any(move.joint == name for move in moves))
    travel = sum(abs(move.change) for move in moves)
    steady = _steady(world, holding, path, grasp_from, seed)
    return Route(path, grasp_from, travel, float(seconds), float(clearance), used, steady)


def _steady(world: World, holding: World, path: JointPath, grasp_from: int, seed: int) -> float:
    made = executions(path, slack(path), EXECUTIONS, np.random.default_rng(seed))
    free = free_rows(world, made[:, : grasp_from + 1]) & free_rows(holding, made[:, grasp_from:])
    return float(free.mean())
