"""A disc in the plane among boxes that move: what the tests of replanning share."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.model.scene import ConstantVelocity, Obstacle, Scene
from rrtik_ompl.model.shapes import Box
from rrtik_ompl.motion.trajectory.limits import RateLimits
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

FAST = RateLimits([1e3, 1e3], [1e3, 1e3])
OPTIONS = {"step": 0.5, "rate": 10.0, "max_edge": 1.0, "repair_budget": 30.0, "limits": FAST}
LOW, HIGH = np.zeros(2), np.full(2, 20.0)


def place(x, y):
    return pin.SE3(np.eye(3), np.array([x, y, 0.0]))


def box(name, x, y, wide=4.0, high=4.0, motion=None):
    return Obstacle(name, Box([wide, high, 1.0]), place(x, y), motion)


def plane(*obstacles, start=(1.0, 10.0), goal=(19.0, 10.0)):
    robot = load_robot("point2d", parameters={"radius": 0.0, "bounds": [[0, 20], [0, 20]]})
    return Problem(World(robot, Scene(obstacles), motion_resolution=0.05), start, goal, name="plane")


def crossing(speed=3.0):
    """A box that crosses the straight way."""
    return plane(box("lift", 10.0, 16.0, 3.0, 3.0, ConstantVelocity([0.0, -speed, 0.0])))
