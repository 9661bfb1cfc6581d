"""Which route is proposed: to the grasp that is chosen, or else to the goal of the problem.

The postures at the grasp are those of its lamp, so that a lamp promises what the search for a route begins with.
"""

from __future__ import annotations

import numpy as np

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.model.goal import joint_difference
from rrtik_ompl.pilot.routes.lamps import Lamp, stage_poses
from rrtik_ompl.pilot.routes.no_route import NoRoute
from rrtik_ompl.pilot.routes.route import Route, route_to, route_to_grasp
from rrtik_ompl.pilot.surroundings import Surroundings
from rrtik_ompl.world.problem import Problem


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
