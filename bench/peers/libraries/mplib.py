"""RRT-Connect of MPlib (C++, OMPL and FCL). How densely it checks cannot be set: OMPL's 1 % of the space's extent."""

from __future__ import annotations

import numpy as np

from bench.peers.serve import serve
from bench.peers.task import RANGE, TIP, Rows, Search, Solid, Task


def search(task: Task) -> Search:
    """From a seed to a path."""
    from mplib import Planner, set_global_seed

    planner = Planner(task.urdf, TIP, srdf=task.srdf)
    for item in task.obstacles:
        planner.planning_world.add_object(item.name, _object(item))
    start, goal = np.array(task.start), np.array(task.goal)
    planner.robot.set_qpos(start, True)

    def solve(seed: int) -> Rows | None:
        set_global_seed(seed)
        status, path = planner.planner.plan(start, [goal], time=task.seconds, range=RANGE, simplify=False)
        return np.array(path) if status == "Exact solution" else None

    return solve


def _object(item: Solid) -> object:
    from mplib import Pose
    from mplib.collision_detection import fcl

    shape = {"box": fcl.Box, "sphere": fcl.Sphere, "cylinder": fcl.Cylinder}[item.kind](*item.size)
    return fcl.CollisionObject(shape, Pose(np.array(item.pose)))


if __name__ == "__main__":
    serve(("mplib", "numpy"), search)
