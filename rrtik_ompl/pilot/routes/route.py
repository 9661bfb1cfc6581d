"""Routes to a grasp, one joint at a time: to a configuration in front of the object, then on to the object.

`propose` leads to the grasp that is chosen, or else to the goal of the problem. The postures at the grasp are those of
its lamp, so that a lamp promises what the search for a route begins with. `all_at_once` makes a
path of all joints of a list of moves. Source: [1, ch. 6]; the list takes the place of RRT-Connect's path.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.base.errors import ProblemError
from rrtik_ompl.base.poses import apart
from rrtik_ompl.ik.batch import solve_ik_batch
from rrtik_ompl.model.goal import joint_difference
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.scene import Touching
from rrtik_ompl.pilot.routes.approach import approaches
from rrtik_ompl.pilot.routes.follower import Track
from rrtik_ompl.pilot.routes.lamps import Lamp, stage_poses
from rrtik_ompl.pilot.routes.route_search import MIN_ROBUSTNESS, NoRoute, RouteSearch, Tail, planned, proven_clearance
from rrtik_ompl.pilot.surroundings import Surroundings
from rrtik_ompl.planning.plan import plan
from rrtik_ompl.planning.shortening import shorten
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

END_OFFSET = 2e-4  # [m] of the tip from its grasp, at the end of a route
END_TURN = np.deg2rad(0.04)
MAX_END_OFFSET = 5e-4  # [m]; the same of an arm that has followed it
MAX_END_TURN = np.deg2rad(0.1)
STAGE = "with all joints at once"
PLANNER_SECONDS = 5.0  # for all joints at once
MAX_BEGINNINGS = 6  # configurations in front of the object that are tried


@dataclass(frozen=True, slots=True, eq=False)
class Route:
    """A path of single-joint moves and its figures.

    Attributes:
        path: The path.
        grasp_from: Number of the first move that leads from the pose before the object to the object.
        travel: Sum of all moves [rad and m].
        seconds: Sum of all moves' times at the joints' rates.
        clearance: What it is proven to keep from every obstacle beside its margin, in whole millimetres [m]; 0 if it is
            not proven, +inf if no obstacle is near. What the gripper or what it holds may touch does not count.
        joints: Names of the joints that move.
        robustness: Share of executions that touch nothing although every move ends with an error of up to a degree.
        proven: Whether every move is proven free for its whole length; else some are checked in steps.
        together: Whether all joints move at once, for an arm under position control (`all_at_once`).
        contacts: Of what is held with what it has not parted from.
    """

    path: JointPath
    grasp_from: int
    travel: float
    seconds: float
    clearance: float
    joints: tuple[str, ...]
    robustness: float
    proven: bool
    together: bool = False
    contacts: tuple[Touching, ...] = ()

    def summary(self) -> str:
        """The head of the list in one line, with a warning where a small error may touch something."""
        head = "all joints at once" if self.together else f"{len(self.path.moves())} moves"

        line = ", ".join((f"{head}, {self.seconds:.0f} s, {self._clear()}", *map(str, self.contacts)))
        if self.robustness >= MIN_ROBUSTNESS or self.together:
            return line
        return (
            f"{line}; narrow: with errors of 1 deg {100 * (1 - self.robustness):.0f} of 100 executions touch something"
        )

    def _clear(self) -> str:
        """How far it stays from obstacles, as far as that is proven."""
        if not self.proven:
            return "not proven free: checked in steps"
        if np.isinf(self.clearance):
            return "nothing near"
        return f"at least {1e3 * self.clearance:.0f} mm away" if self.clearance > 0.0 else "less than 1 mm to spare"


def propose(
    problem: Problem,
    surroundings: Surroundings,
    target: str | None,
    lamp: Lamp | None,
    q: Vector,
    rates: Vector,
    seed: int,
) -> Route | NoRoute:
    """A route from where the arm is, or why there is none.

    Args:
        problem: Its goal serves where no grasp is chosen.
        surroundings: What is around.
        target: Name of the object to grasp.
        lamp: Of the grasp that is chosen; None if none is.
        q: Where the arm is, shape (dof,).
        rates: Of the joints, shape (dof,).
        seed: Of the random numbers.
    """
    world = surroundings.world_at(q, target)
    target_seen = None if target is None else surroundings.named(target)
    if target_seen is None or lamp is None:
        if problem.goal.q is None:
            return NoRoute("choose an object and a grasp first")
        return route_to(world, q, np.array(problem.goal.q), rates, seed)
    if not len(lamp.grasps):
        return NoRoute(lamp.reason)

    nearest_first = np.argsort(np.linalg.norm(joint_difference(problem.robot, lamp.grasps, q), axis=1), kind="stable")
    stages = stage_poses(target_seen.T_base_object, target_seen.object.grasp(lamp.type), lamp.level)

    holding = surroundings.holding(target_seen.object.name)
    reason_for_none = NoRoute(lamp.reason)
    for number, grasp in enumerate(lamp.grasps[nearest_first]):
        route = route_to_grasp(world, holding, q, stages, grasp, rates, seed)
        if isinstance(route, Route):
            return route
        reason_for_none = route if number == 0 else reason_for_none
    return reason_for_none


def route_to(world: World, q: Vector, goal: Vector, rates: Vector, seed: int) -> Route | NoRoute:
    """A route to a configuration."""
    return _route(world, world, q, [[_without_tiny_moves(world, goal, q)[None]]], rates, seed)


def route_to_grasp(
    world: World,
    holding: World,
    q: Vector,
    stages: tuple[pin.SE3, pin.SE3, pin.SE3],
    grasp: Vector,
    rates: Vector,
    seed: int,
) -> Route | NoRoute:
    """A route to a grasp by way of a configuration in front of it.

    Args:
        world: In which nothing may be touched, for the first part.
        holding: In which the gripper may touch the object, for the second.
        q: Where the arm is, shape (dof,).
        stages: ``T_base_tip`` of approach, grasp and lift.
        grasp: The configuration at which the route ends, free in ``holding``, shape (dof,).
        rates: Of the joints, shape (dof,).
        seed: Of the random numbers.
    """
    try:
        tails = _tails(world, holding, stages, _without_tiny_moves(holding, grasp, q), seed)
    except ProblemError as error:
        return NoRoute(str(error))
    return tails if isinstance(tails, NoRoute) else _route(world, holding, q, tails, rates, seed)


def _tails(
    world: World, holding: World, stages: tuple[pin.SE3, pin.SE3, pin.SE3], grasp: Vector, seed: int
) -> Sequence[Tail] | NoRoute:
    """The last parts of routes to a grasp: few moves from about the pose before it, or else some from exactly there."""
    few_moves = approaches(world, holding, grasp, stages, MAX_BEGINNINGS)
    if few_moves:
        return few_moves

    approach = solve_ik_batch(world.robot, [stages[0].homogeneous], near=grasp, world=world, seed=seed)
    if not approach.found[0]:
        return NoRoute(approach.details[0] or approach.reasons[0] or "not to be reached", "the pose before the object")

    last = planned(holding, approach.q[0], grasp, seed)
    return NoRoute(str(last), "from before the object to it") if isinstance(last, NoRoute) else [[last]]


def _without_tiny_moves(world: World, goal: Vector, q: Vector) -> Vector:
    """A goal whose joints that are there already need not move, as long as the tip ends where it should."""
    robot = world.robot
    goal_with_fewer_moves = goal

    goal_pose = robot.fk(goal)
    for joint in np.argsort(np.abs(goal - q)):
        tried = goal_with_fewer_moves.copy()
        tried[joint] = q[joint]
        distance, turn = apart(goal_pose, robot.fk(tried))
        if distance > END_OFFSET or turn > END_TURN or not world.valid(tried):
            break
        goal_with_fewer_moves = tried
    return goal_with_fewer_moves


def _route(world: World, holding: World, q: Vector, tails: Sequence[Tail], rates: Vector, seed: int) -> Route | NoRoute:
    search = RouteSearch(world, holding, q, seed)
    try:
        route = search.find(tails)
    except ProblemError as error:
        return NoRoute(str(error))
    if isinstance(route, NoRoute):
        return route

    path = JointPath.of(world.robot, route.rows)
    moves = path.moves()
    names = list(path.joint_names)

    seconds = sum(abs(move.change) / rates[names.index(move.joint)] for move in moves)
    moving_joints = tuple(name for name in names if any(move.joint == name for move in moves))
    travel = sum(abs(move.change) for move in moves)

    robustness = search.robustness(route)
    proven = search.proven(route)
    clearance = search.clearance(route) if proven else 0.0
    return Route(
        path, route.grasp_from, travel, float(seconds), clearance, moving_joints, robustness, proven,
        contacts=world.scene.contacts,
    )  # fmt: skip


def all_at_once(route: Route, world: World, rates: Vector, seed: int) -> Route | NoRoute:
    """The same route with all joints at once, up to its last moves to the object, which stay as they are.

    Args:
        route: Of single-joint moves.
        world: In which nothing may be touched.
        rates: Of the joints, shape (dof,).
        seed: Of the random numbers.
    """
    rows = route.path.waypoints
    before = rows[route.grasp_from]
    last = rows[route.grasp_from + 1 :]
    if route.grasp_from == 0:
        return NoRoute("only moves of single joints are left", STAGE)

    problem = Problem(world, rows[0], before)
    planned = plan(problem, "rrtconnect", seconds=PLANNER_SECONDS, seed=seed)
    if planned.path is None:
        return NoRoute(planned.reason, STAGE)

    path = shorten(planned.path, problem, seed=seed)
    whole_path = path.with_waypoints(np.vstack([path.waypoints, last]))

    moving_joints = tuple(
        name
        for name, travel in zip(whole_path.joint_names, np.ptp(whole_path.waypoints, axis=0), strict=True)
        if travel > 0
    )
    return replace(
        route, path=whole_path, grasp_from=len(path.waypoints) - 1, joints=moving_joints,
        seconds=Track(whole_path, rates).seconds,
        travel=float(np.abs(np.diff(whole_path.waypoints, axis=0)).sum()),
        clearance=min(proven_clearance([(world, path.waypoints)]), route.clearance),
        proven=bool(world.prove(path.waypoints).proven) and route.proven, together=True,
    )  # fmt: skip
