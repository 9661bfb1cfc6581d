"""The robots, problems and goals of ``bench/behaviour.py``: shipped ones, and worlds with a shape of each kind."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

import numpy as np

import rrtik_ompl as rrtik

Result = tuple[str, list[Any]]  # flags and counts; arrays
Cases = Iterator[tuple[str, Callable[[], Result]]]

LONG = 60.0  # [s] a limit that no case comes near
MADE = ("panda", "panda_primitives", "ur5", "titan4", "puma560")


@cache
def robot_of(name: str) -> Any:
    return rrtik.load_robot(name)


@cache
def draws(robot: Any, count: int, seed: int) -> Any:
    """Configurations inside the limits, shape (count, dof)."""
    lower, upper = np.maximum(robot.lower, -3.0), np.minimum(robot.upper, 3.0)
    return np.random.default_rng(seed).uniform(lower, upper, (count, robot.dof))


def surroundings(robot: Any) -> Any:
    """A scene with a shape of each kind where the tip can be, and a floor."""
    places = robot.fk_batch(draws(robot, 6, 11))[:, :3, 3]
    size = 0.1 * float(np.linalg.norm(robot.fk_batch(draws(robot, 100, 5))[:, :3, 3], axis=1).max())
    turns = np.random.default_rng(2).normal(size=(6, 4))
    turns /= np.linalg.norm(turns, axis=1)[:, None]
    corners = size * np.array([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)])
    shapes = [rrtik.Box([size, 2 * size, 0.5 * size]), rrtik.Sphere(size), rrtik.Cylinder(0.5 * size, 2 * size)]
    shapes += [rrtik.Capsule(0.5 * size, size), rrtik.Prism(corners, size), rrtik.Box([size, size, size])]
    placed = enumerate(zip(shapes, map(rrtik.pose, places, turns), strict=True))
    made = [rrtik.Obstacle(f"o{k}", shape, pose, margin=0.01 * (k % 2)) for k, (shape, pose) in placed]
    return rrtik.Scene((*made, rrtik.Obstacle("floor", rrtik.HalfSpace((0, 0, 1), -8 * size))))


@cache
def problem_of(name: str) -> Any:
    """A shipped problem, or one that is made here: ``made_ROBOT``."""
    if not name.startswith("made_"):
        return rrtik.load_problem(name)
    robot = robot_of(name.removeprefix("made_"))
    world = rrtik.World(robot, surroundings(robot))
    rows = draws(robot, 500, 7)
    free = rows[world.valid_batch(rows)]
    return rrtik.Problem(world, free[0], free[2], name=name)


def goal_of(kind: str, robot: Any) -> Any:
    T = robot.fk_batch(draws(robot, 3, 3))
    centre = rrtik.pose(T[0][:3, 3])
    freedom = np.array([[-0.1, 0.1], [0, 0.05], [0, 0], [-3.2, 3.2], [-3.2, 3.2], [-3.2, 3.2]])
    goals: dict[str, Callable[[], Any]] = {
        "pose": lambda: rrtik.PoseGoal(T[0]),
        "position": lambda: rrtik.PositionGoal(T[0][:3, 3], tolerance=0.005),
        "far": lambda: rrtik.PoseGoal(rrtik.pose([9.0, 0, 0])),
        "region": lambda: rrtik.TaskRegion(centre, freedom),
        "set": lambda: rrtik.GoalSet([rrtik.PoseGoal(T[1]), rrtik.PoseGoal(T[2])]),
    }
    return goals[kind]()
