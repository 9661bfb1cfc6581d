"""From detected objects to a planning problem: their solids in the scene, the approach to a grasp as the goal."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import pose
from rrtik_ompl.model.goal import PoseGoal
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.sensing.scene_from_view import SeenObject
from rrtik_ompl.world.problem import Problem


def scene_with(scene: Scene, solids: Iterable[Obstacle]) -> Scene:
    """A scene with more solids, which take the place of those of the same names."""
    more = tuple(solids)
    names = {solid.name for solid in more}
    other_obstacles = tuple(obstacle for obstacle in scene.obstacles if obstacle.name not in names)
    return replace(scene, obstacles=(*other_obstacles, *more))


def grasp_problem(problem: Problem, seen: Iterable[SeenObject], name: str, kind: str, level: int) -> Problem:
    """From the start of a problem to where the approach to a grasp of a seen object begins.

    From there the tip goes straight along its own z axis, by the ``approach`` of the grasp type; that is not part of
    the problem, so nothing may touch the object along the path. Solids of detected objects have their margins.

    Args:
        problem: Its robot, start and scene are kept.
        seen: Objects in the frame of the base.
        name: Of the object to be grasped.
        kind: Grasp type.
        level: From 1.

    Raises:
        InputError: If the object was not seen, or has no such grasp.
        ProblemError: If the start touches something.
    """
    objects = tuple(seen)
    target = next((object_seen for object_seen in objects if object_seen.object.name == name), None)
    if target is None:
        names = ", ".join(object_seen.object.name for object_seen in objects) or "nothing"
        raise InputError(f"object '{name}' was not seen; {names} was")

    levels = len(target.object.grasp(kind).levels)
    if not 1 <= level <= levels:
        raise InputError(f"grasp type '{kind}' of '{name}' has levels 1 to {levels}, not {level}")

    solids = [solid for object_seen in objects for solid in object_seen.solids()]
    scene = scene_with(problem.world.scene, solids)
    world = problem.world.with_accuracy("exact").with_scene(scene)

    approach_pose = target.grasp_pose(kind, level - 1) * pose([0.0, 0.0, -target.object.grasp(kind).approach])
    return Problem(world, problem.start, PoseGoal(approach_pose), name=f"{name}_{kind}_{level}")
