"""RRT-Connect of VAMP (C++, spheres), which has no wheel for this platform: measured where somebody has built it."""

from __future__ import annotations

from collections.abc import Callable

import pinocchio as pin

from rrtik_ompl import Problem
from rrtik_ompl.model.shapes import Box, Capsule, Sphere

SAMPLES = 100_000  # its default, a million, costs 0.5 ms of allocation in every call


def search(problem: Problem) -> Callable[[], tuple[bool, float]]:
    """RRT-Connect of VAMP on the same obstacles: whether solved, and the seconds that it says it took."""
    import vamp

    module, plan, settings, _ = vamp.configure_robot_and_planner_with_kwargs("panda", "rrtc")
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
    start, goal = problem.start, problem.goal.q

    def solve() -> tuple[bool, float]:
        result = plan(start, goal, scene, settings, module.halton())
        return bool(result.solved), 1e-9 * float(result.nanoseconds)

    return solve
