"""From where the arm is to a grasp, one joint at a time: to a place before the object, then on to it.

Source: shared-control tool, section 6: a list of single-joint moves in place of RRT-Connect's route.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rrtik_ompl.arrays import Vector
from rrtik_ompl.errors import ProblemError
from rrtik_ompl.ik.batch import solve_ik_batch
from rrtik_ompl.path import JointPath
from rrtik_ompl.pilot.routes.approach import approaches
from rrtik_ompl.pilot.routes.clearance import tightest
from rrtik_ompl.pilot.routes.follower import slack
from rrtik_ompl.pilot.routes.moves import planned
from rrtik_ompl.pilot.routes.route_search import STEADY, Last, WaySearch
from rrtik_ompl.transitions import SAME
from rrtik_ompl.world import World

LOOKS = 100  # along a route, for its clearance
BEGINNINGS = 6  # before the object, that are tried


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
    return _route(world, world, q, [[_settled(world, goal, q)[None]]], rates, seed)


def route_to_grasp(
    world: World, holding: World, q: Vector, stages: tuple[Any, Any, Any], near: Vector, rates: Vector, seed: int
) -> Route | str:
    """A route to a grasp by way of a place before it, or the reason why there is none.

    Args:
        world: In which nothing may be touched, for the first part.
        holding: In which the gripper may touch the object, for the second.
        q: Where the arm is, shape (dof,).
        stages: ``T_base_tip`` of approach, grasp and lift.
        near: Configuration near which the grasp is wanted, shape (dof,).
        rates: Of the joints, shape (dof,).
        seed: Of the random numbers.
    """
    try:
        lasts = _last_parts(world, holding, q, stages, near, seed)
    except ProblemError as error:
        return str(error)
    return lasts if isinstance(lasts, str) else _route(world, holding, q, lasts, rates, seed)


def _last_parts(
    world: World, holding: World, q: Vector, stages: tuple[Any, Any, Any], near: Vector, seed: int
) -> Sequence[Last] | str:
    """What may end a route to a grasp: few moves from about the pose before it, or else some from exactly there."""
    at = solve_ik_batch(world.robot, [stages[1].homogeneous], near=near, world=holding, seed=seed)
    if not at.found[0]:
        return f"the grasp: {at.details[0] or at.reasons[0] or 'not to be reached'}"
    grasp = _settled(holding, at.q[0], q)
    short = approaches(world, holding, grasp, stages, BEGINNINGS)
    if short:
        return short
    before = solve_ik_batch(world.robot, [stages[0].homogeneous], near=grasp, world=world, seed=seed)
    if not before.found[0]:
        return f"the pose before the object: {before.details[0] or before.reasons[0] or 'not to be reached'}"
    last = planned(holding, before.q[0], grasp, seed)
    return f"from before the object to it: {last}" if isinstance(last, str) else [[last]]


def _settled(world: World, goal: Vector, q: Vector) -> Vector:
    """A goal whose joints that are near enough already need not move, if that is free; else nearly so.

    Near enough is what the pilot is held to in following; inverse kinematics leaves traces of rounding.
    """
    small = slack(JointPath.of(world.robot, q[None]))
    loose, exact = (np.where(np.abs(goal - q) <= near, q, goal) for near in (small, SAME))
    return loose if world.valid(loose) else exact


def _route(world: World, holding: World, q: Vector, lasts: Sequence[Last], rates: Vector, seed: int) -> Route | str:
    search = WaySearch(world, holding, q, seed)
    try:
        way = search.find(lasts)
    except ProblemError as error:
        return str(error)
    if isinstance(way, str):
        return way
    path = JointPath.of(world.robot, way.rows)
    moves, names = path.moves(), list(path.joint_names)
    nearest = tightest(holding, path.resample(max(path.length / LOOKS, 1e-3)).waypoints)
    clearance = np.inf if nearest is None else nearest.distance
    seconds = sum(abs(move.change) / rates[names.index(move.joint)] for move in moves)
    used = tuple(name for name in names if any(move.joint == name for move in moves))
    travel = sum(abs(move.change) for move in moves)
    return Route(path, way.grasp_from, travel, float(seconds), float(clearance), used, search.steady(way))
