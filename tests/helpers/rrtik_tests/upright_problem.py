"""A UR5 that carries a cup past a post."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import rrtik_ompl as rrtik

DOWN = pin.rpy.rpyToMatrix(np.pi, 0.0, 0.0)


def cup_problem() -> rrtik.Problem:
    """From one side of a post to the other, the tool pointing down within 5 degrees."""
    robot = rrtik.load_robot("ur5_limited")
    post = rrtik.Obstacle("post", rrtik.Box([0.1, 0.1, 0.9]), rrtik.pose([0.5, 0.0, 0.45]))
    world = rrtik.World(robot, rrtik.Scene([post]))
    places = (pin.SE3(DOWN, np.array([0.45, side, 0.35])) for side in (-0.35, 0.35))
    ends = []
    for place in places:
        rows = rrtik.solve_ik(robot, rrtik.PoseGoal(place), all=True).solutions
        rows = rows[world.valid_batch(rows) & (rows[:, 4] < 0.0)]
        ends.append(rows[np.abs(rows).max(axis=1).argmin()])
    return rrtik.Problem(world, ends[0], ends[1], constraints=[rrtik.constraints.upright(robot)])
