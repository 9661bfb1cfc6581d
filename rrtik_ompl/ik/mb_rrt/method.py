"""MB-RRT as a method of inverse kinematics."""

from __future__ import annotations

import numpy as np

from rrtik_ompl.ik.mb_rrt.axes import misfit
from rrtik_ompl.ik.mb_rrt.search import MAX_ROUNDS, search
from rrtik_ompl.ik.method_interface import IkRequest, IkResponse, Target
from rrtik_ompl.ik.numeric.restarts import nearest_posture
from rrtik_ompl.model.robot import Robot

ROUNDS_FOR_ALL = 8  # of the workspace tree if every solution is requested


def mb_rrt_misfit(robot: Robot, target: Target) -> str:
    """Why the tree cannot model a robot's links; "" if it can."""
    del target
    return misfit(robot)


def mb_rrt(request: IkRequest) -> IkResponse:
    """A tree in the workspace for one target after the other, until a solution will do."""
    robot = request.robot
    count = len(request.targets)
    rows = np.zeros((0, robot.dof))
    passes = 0
    for target in request.targets:
        found = search(
            robot,
            target,
            near=request.near,
            accept=request.accept,
            rng=request.rng,
            deadline=request.deadline,
            world=request.world,
            collect_all=request.all,
            rounds=max(1, (ROUNDS_FOR_ALL if request.all else MAX_ROUNDS) // count),
        )
        rows = np.vstack([rows, found.q])
        passes += found.passes
        if found.timed_out or (request.accept(found.q).any() and not request.all):
            break
    return IkResponse(rows, request.near if len(rows) else nearest_posture(request), passes, found.timed_out)
