"""RRT-Connect of VAMP (C++, spheres), which has no wheel for this platform: measured where somebody has built it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from rrtik_ompl import Problem
from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.model.shapes import Box, Capsule, Sphere

SAMPLES = 100_000  # its default, a million, costs 0.5 ms of allocation in every call


def search(problem: Problem, arm: str = "panda") -> Callable[[], tuple[bool, float]]:
    """RRT-Connect of VAMP on the same obstacles: whether solved, and the seconds that it says it took."""
    module, plan, settings, _, scene = _ready(problem, arm)
    start, goal = problem.start, problem.goal.q

    def solve() -> tuple[bool, float]:
        result = plan(start, goal, scene, settings, module.halton())
        return bool(result.solved), 1e-9 * float(result.nanoseconds)

    return solve


def simplified(problem: Problem, arm: str) -> Callable[[], Any]:
    """RRT-Connect and simplifying, both with the settings of VAMP for the arm; VAMP's path, or None."""
    module, plan, settings, simplifying, scene = _ready(problem, arm)
    start, goal = problem.start, problem.goal.q

    def solve() -> Any:
        sampler = module.halton()
        found = plan(start, goal, scene, settings, sampler)
        return module.simplify(found.path, scene, simplifying, sampler).path if found.solved else None

    return solve


def waypoints(path: Any) -> Matrix:
    """Waypoints of a path of VAMP, shape (k, dof)."""
    return np.array([path[k] for k in range(len(path))], dtype=float)


def _ready(problem: Problem, arm: str) -> tuple[Any, Any, Any, Any, Any]:
    """VAMP's module of an arm, its planner, the settings of planner and simplifying, and the scene of a problem."""
    import vamp

    module, plan, settings, simplifying = vamp.configure_robot_and_planner_with_kwargs(arm, "rrtc")
    settings.max_samples = SAMPLES
    scene = vamp.Environment()
    for item in problem.world.scene.obstacles:
        place, turn, shape = item.pose.translation, pin.rpy.matrixToRpy(item.pose.rotation), item.shape
        if isinstance(shape, Box):
            scene.add_cuboid(vamp.Cuboid(place, turn, 0.5 * shape.size))
        elif isinstance(shape, Capsule):
            scene.add_capsule(vamp.Cylinder(place, turn, shape.radius, shape.length))
        elif isinstance(shape, Sphere):
            scene.add_sphere(vamp.Sphere(place, shape.radius))
        else:
            raise TypeError(f"VAMP has no {type(shape).__name__}")
    return module, plan, settings, simplifying, scene
