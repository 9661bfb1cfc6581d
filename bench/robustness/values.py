"""Values that arguments are drawn from: good ones of every kind, and odd ones."""

from __future__ import annotations

import re
from functools import cache
from inspect import Parameter
from pathlib import Path
from typing import Any

import numpy as np

import rrtik_ompl as rrtik
from rrtik_ompl.replanning.settings import ReplanSettings

SECONDS = 0.05  # of a search: where nothing is to be found, all of them pass
GOOD_SHARE = 0.6  # of the arguments that fit their parameter, so that calls get further than their first check


def anything(*_args: object, **_options: object) -> None:
    """A function that takes whatever it is given."""


@cache
def good() -> tuple[Any, ...]:
    """Values that are of use somewhere."""
    robot = rrtik.load_robot("planar3")
    ball = rrtik.Obstacle("far", rrtik.Sphere(0.1), rrtik.pose([9, 9, 9]))
    world = rrtik.World(robot, rrtik.Scene((ball,)))
    problem = rrtik.Problem(world, [0, 0, 0], [0.5, 0.2, 0])
    path = rrtik.JointPath.of(robot, np.array([[0, 0, 0], [0.5, 0.2, 0]]))
    limits = rrtik.RateLimits([1, 1, 1], [2, 2, 2], [20, 20, 20])
    motion, position = rrtik.time_parameterize(path, limits), rrtik.PositionGoal([1, 1, 0])
    task = rrtik.Task([rrtik.MoveTo([0.2, 0.1, 0])])
    scenario = rrtik.replanning.Scenario(problem, ReplanSettings(step=0.1, rate=5.0, seconds=2.0))
    points = np.array([[2.0, 2.0, 0.0], [2.1, 2.0, 0.0]])
    return (
        *(robot, world, problem, path, world.scene, ball, rrtik.pose([1, 0, 0]), position, limits, motion, task),
        *(rrtik.TaskRegion([1, 1, 0], np.zeros((6, 2))), rrtik.MoveRules(["a", "b", "c"]), rrtik.GoalSet([position])),
        *(rrtik.PoseGoal(rrtik.pose([1, 1, 0])), rrtik.JointGoal([0, 0, 0]), rrtik.MultiGoal({"planar3": position})),
        *(scenario, rrtik.Sphere(0.1), rrtik.Box([0.1, 0.1, 0.1]), rrtik.Capsule(0.1, 0.2), rrtik.HalfSpace([0, 0, 1])),
        *(rrtik.PointCloud(points), rrtik.HeightField(np.zeros((3, 3)), 0.1), rrtik.Octree(points, [0.1, 0.1])),
        *(rrtik.plan(problem, "bicrdt", seed=1), task.plan(world, [0, 0, 0]), world.certificate(path)),
        *(rrtik.following.SimulatedLink(robot, [0, 0, 0]), rrtik.following.Servo(world)),
        rrtik.replanning.ConstantVelocity([0, 0, 0.1]),
        *(rrtik.Roadmap(world, vertices=20), rrtik.ik.reach_map(robot, samples=100), rrtik.MoveTo([0.2, 0.1, 0])),
        *(rrtik.Attach("far", robot.tip), rrtik.Detach("far"), rrtik.Gripper("open"), rrtik.Straight([0.1, 0, 0])),
        *("planar3", "planar3_a", "joint1", "auto", "RRTConnect", "far", "z", robot.tip, ["planar3_a"], ["joint1"]),
        *([0, 0, 0], [1.0, 0.5, 0.1], np.zeros((2, 3)), np.eye(4), np.zeros((6, 2)), [rrtik.pose([1, 1, 0])] * 2),
        *(Path("out.json"), anything, 1, 2, 0.5, 0.1, 1.0, True, world.scene.obstacles, {"range": 0.1}, "out.csv"),
    )  # fmt: skip


ODD: tuple[Any, ...] = (
    *(None, -1, 0, 10**400, float("nan"), float("inf"), 1e300, -1e300, 5e-324, 1j, "", "\x00", "\ud800", "a" * 5000),
    *(b"x", [], {}, [[]], [[1, 2], [3]], "\ud7ff\udc00", [None], ["a"], {"a": 1}, {1: 2}, object(), anything, ...),
    *(np.zeros(0), np.zeros((0, 3)), np.full(3, np.nan), np.array(["a"]), np.array([None]), np.zeros((2, 3, 4))),
    *(-np.eye(4), iter([1]), range(3), Path("/none"), np.array(True), [True, False, True], np.zeros((2, 3), complex)),
    *(np.broadcast_to(0.0, (10**9, 3)), np.broadcast_to(np.eye(4), (10**8, 4, 4)), range(10**12), 2**63, np.int8(3)),
    *(
        np.float32(0.1),
        np.timedelta64(1),
        np.ma.array([1.0], mask=True),
        memoryview(b"abc"),
        {0.1, 0.2},
        slice(1),
    ),
)
NUMBERS = {"float": (0.5, 0.1, 1.0, 0.05), "int": (1, 2, 3), "bool": (True, False)}
BY_NAME: dict[str, tuple[Any, ...]] = {
    **dict.fromkeys(("q", "near", "start", "a", "b"), ([0, 0, 0], [0.5, 0.2, 0], np.array([0.1, 0.2, 0.3]))),
    **dict.fromkeys(
        ("Q", "A", "B", "waypoints", "starts", "goals", "ghosts", "route"), (np.zeros((2, 3)), [[0, 0, 0]])
    ),
    **dict.fromkeys(("xyz", "point", "normal", "direction", "sides", "velocity", "size"), ([1.0, 0.5, 0.1],)),
    "seconds": (SECONDS, 0.01),
}


@cache
def every() -> tuple[Any, ...]:
    """All values; good ones twice as often."""
    return (*good(), *good(), *ODD)


@cache
def _fitting(name: str, annotation: str) -> tuple[Any, ...]:
    words = set(re.findall(r"\w+", annotation))
    fitting = [value for value in good() if words & {kind.__name__ for kind in type(value).__mro__[:-1]}]
    for kind in words & set(NUMBERS):
        fitting += NUMBERS[kind]
    fitting += BY_NAME.get(name, ())
    if "AnyPart" in words or "TipGoal" in words or "Goal" in words:
        fitting += [value for value in good() if hasattr(value, "satisfied")]
    if "Shape" in words:
        fitting += [value for value in good() if hasattr(value, "bounding_radius")]
    return tuple(fitting)


def drawn(rng: np.random.Generator, parameter: Parameter) -> Any:
    """A value for a parameter: one that fits it, or any."""
    fitting = _fitting(parameter.name, str(parameter.annotation))
    values = fitting if fitting and rng.random() < GOOD_SHARE else every()
    return values[rng.integers(len(values))]
