"""MotionBenchMaker problems: ``sceneNNNN.yaml`` (a PlanningScene) beside ``requestNNNN.yaml`` (a MotionPlanRequest)."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rrtik_ompl.arrays import Vector
from rrtik_ompl.catalog import load_robot
from rrtik_ompl.errors import InputError
from rrtik_ompl.files.sections import parse
from rrtik_ompl.files.strict_yaml import YamlDocument, read_yaml
from rrtik_ompl.goal import Goal, JointGoal, PoseGoal, PositionGoal
from rrtik_ompl.poses import pose
from rrtik_ompl.problem import Problem
from rrtik_ompl.problem_files.moveit_messages import AllowedMatrix, Constraints, RequestMessage, SceneMessage
from rrtik_ompl.robot import Robot
from rrtik_ompl.scene import Scene
from rrtik_ompl.world import World

FilePath = str | os.PathLike[str]


def load_motion_bench_maker(
    scene_path: FilePath, request_path: FilePath | None = None, robot: Robot | FilePath | None = None
) -> Problem:
    """Read a scene and its request.

    The joints of the start state that the group does not move (the fingers) are held where the start state has them.
    Which links may touch each other is the robot's own business (its SRDF); of the scene's allowed collisions those
    with an obstacle are used, and all of them if the robot says nothing about its links.

    Args:
        scene_path: The scene, or the request: the other one stands beside it under the corresponding name.
        request_path: The request, if it is called otherwise.
        robot: A robot, its name, or its URDF (an SRDF of the same name beside it is used); the robot that the scene
            names if None.

    Raises:
        InputError: If a file cannot be used; one line with file, line, key and remedy.
        ProblemError: If start or goal is in collision or outside the limits.
    """
    scene_file, request_file = _pair(Path(scene_path), None if request_path is None else Path(request_path))
    scene_document, request_document = read_yaml(scene_file), read_yaml(request_file)
    message = parse(scene_document, SceneMessage)
    request = parse(request_document, RequestMessage)
    with scene_document.at(("robot_model_name",)):
        wanted = message.robot_model_name if robot is None else robot
        arm = wanted if isinstance(wanted, Robot) else _robot(wanted, request)
    scene = _scene(scene_document, message, arm)
    with scene_document.at(("world",)):
        world = World(arm, scene)
    with request_document.at(("start_state", "joint_state")):
        start = _configuration(arm, request.start_state.values(), "start")
    with request_document.at(("goal_constraints", 0)):
        goal = _goal(arm, request.goal_constraints[0])
    name = f"{scene_file.resolve().parent.name}/{scene_file.stem}"
    with request_document.at(("goal_constraints", 0)):
        return Problem(world, start, goal, name=name)


def _pair(scene: Path, request: Path | None) -> tuple[Path, Path]:
    if request is not None:
        return scene, request
    if scene.name.startswith("scene"):
        return scene, scene.with_name("request" + scene.name.removeprefix("scene"))
    if scene.name.startswith("request"):
        return scene.with_name("scene" + scene.name.removeprefix("request")), scene
    raise InputError(f"{scene}: call the two files sceneNAME.yaml and requestNAME.yaml, or give both")


def _robot(name: FilePath, request: RequestMessage) -> Robot:
    """The robot by name or URDF, base and unmoved joints where the start state has them."""
    options: dict[str, Any] = {}
    if Path(name).suffix.lower() == ".urdf":
        semantics = Path(name).with_suffix(".srdf")
        joints = [c.joint_name for c in request.goal_constraints[0].joint_constraints]
        if os.path.isfile(semantics):
            options = {"srdf": str(semantics), "group": request.group_name}
        elif joints:
            options = {"joints": joints}
    links = request.goal_constraints[0].links
    if links:
        options["tip"] = links[0]
    base = request.start_state.base_pose()
    if not np.array_equal(base.homogeneous, np.eye(4)):
        options["base_pose"] = base
    free = load_robot(name, **options)
    held = free.movable.difference(free.joint_names)  # the start state may name joints that this robot has fixed
    locked = {joint: value for joint, value in request.start_state.values().items() if joint in held}
    return load_robot(name, locked=locked, **options)


def _scene(document: YamlDocument, message: SceneMessage, robot: Robot) -> Scene:
    obstacles, frames = [], ("world", robot.name, *robot.link_names[:1])
    for k, item in enumerate(message.world.collision_objects):
        with document.at(("world", "collision_objects", k)):
            item.check_frame(frames)
            obstacles += list(item.build())
    with document.at(("world",)):
        scene = Scene(tuple(obstacles))
    with document.at(("allowed_collision_matrix",)):
        allowed = _allowed(message.allowed_collision_matrix, robot, scene)
        return Scene(scene.obstacles, allowed_collisions=allowed)


def _allowed(matrix: AllowedMatrix, robot: Robot, scene: Scene) -> tuple[tuple[str, str], ...]:
    links, names = set(robot.link_names), set(scene.names)
    found = []
    for first, second in matrix.pairs():
        both_links = first in links and second in links
        if {first, second} <= links | names and not (both_links and robot.allowed_collisions):
            found.append((first, second))
    return tuple(found)


def _configuration(robot: Robot, values: Mapping[str, float], what: str) -> Vector:
    missing = [joint for joint in robot.joint_names if joint not in values]
    if missing:
        raise InputError(f"{what}: no value for joint '{missing[0]}' of robot '{robot.name}'; have {', '.join(values)}")
    return np.array([values[joint] for joint in robot.joint_names])


def _goal(robot: Robot, wanted: Constraints) -> Goal:
    if wanted.joint_constraints and not wanted.links:
        values = {c.joint_name: c.position for c in wanted.joint_constraints}
        return JointGoal(_configuration(robot, values, "goal"))
    if len(wanted.position_constraints) != 1 or len(wanted.orientation_constraints) > 1 or wanted.joint_constraints:
        raise InputError("goal: give joint_constraints, or one position and at most one orientation constraint")
    place = wanted.position_constraints[0]
    centre, radius = place.ball()
    if not wanted.orientation_constraints:
        return PositionGoal(centre, radius)
    turn = wanted.orientation_constraints[0]
    if turn.link_name != place.link_name:
        raise InputError(f"goal: constraints on two links, '{place.link_name}' and '{turn.link_name}'; give one link")
    return PoseGoal(pose(centre, turn.orientation), radius, turn.tolerance)
