"""MotionBenchMaker problems: ``sceneNNNN.yaml`` (a PlanningScene) beside ``requestNNNN.yaml`` (a MotionPlanRequest)."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from rrtik_ompl.arrays import Vector
from rrtik_ompl.catalog import load_robot
from rrtik_ompl.description.joint_ranges import narrowed
from rrtik_ompl.description.padding import padded
from rrtik_ompl.description.scaling import scaled
from rrtik_ompl.errors import InputError, SceneWarning
from rrtik_ompl.files.sections import parse
from rrtik_ompl.files.strict_yaml import YamlDocument, read_yaml
from rrtik_ompl.goal import Goal, JointGoal
from rrtik_ompl.problem import Problem
from rrtik_ompl.problem_files.moveit_frames import WORLD, Frames
from rrtik_ompl.problem_files.moveit_messages import Constraints, JointConstraint, RequestMessage, SceneMessage
from rrtik_ompl.problem_files.moveit_regions import held_regions_of, tip_goal
from rrtik_ompl.problem_files.moveit_scene import SceneReader, passed_over
from rrtik_ompl.robot import Robot
from rrtik_ompl.world import World

FilePath = str | os.PathLike[str]
SAME_BASE = 1e-9  # largest difference of two poses that are one [m, and of entries of the rotation]


def load_motion_bench_maker(
    scene_path: FilePath, request_path: FilePath | None = None, robot: Robot | FilePath | None = None
) -> Problem:
    """Read a scene and its request.

    The joints of the start state that the group does not move (the fingers) are held where the start state has them,
    and what the scene or the start state attaches is held by its link. Paddings and scales of links are those of the
    robot; a padding counts between links, too. Path constraints of joints narrow the limits of the robot, others are
    regions of the problem. Frames are the world, links and what they hold where the start state has them, objects, and
    the fixed frames of the scene.

    Which links may touch each other is the robot's own business (its SRDF); of the scene's allowed collisions those
    with an obstacle or an attached object are used, and all of them if the robot says nothing about its links.

    Args:
        scene_path: The scene, or the request: the other one stands beside it under the corresponding name.
        request_path: The request, if it is called otherwise.
        robot: A robot, its name, or its URDF (an SRDF of the same name beside it is used); the robot that the scene
            names if None.

    Raises:
        InputError: If a file cannot be used, or says something that is not read; one line with file, line, key and
            remedy.
        ProblemError: If start or goal is in collision or outside the limits.

    Warns:
        SceneWarning: If links may not touch by the scene, but are never compared by the robot's own list.
    """
    scene_file, request_file = _pair(Path(scene_path), None if request_path is None else Path(request_path))
    scene_document, request_document = read_yaml(scene_file), read_yaml(request_file)
    message = parse(scene_document, SceneMessage)
    request = parse(request_document, RequestMessage)
    with scene_document.at(("robot_model_name",)):
        wanted = message.robot_model_name if robot is None else robot
        arm = wanted if isinstance(wanted, Robot) else _robot(wanted, request)
    with request_document.at(("start_state", "multi_dof_joint_state")):
        _refuse_another_base(arm, request, isinstance(robot, Robot))
    arm = _as_the_scene_says(scene_document, message, request_document, request, arm)
    states = message.robot_state.values() | request.start_state.values()
    with request_document.at(("start_state", "joint_state")):
        start = _configuration(arm, states, "start")
    with scene_document.at(("fixed_frame_transforms",)):
        frames = Frames(arm, start, message.fixed_frame_transforms)
    reader = SceneReader(arm, frames, message)
    reader.read_world(scene_document)
    reader.hold(scene_document, ("robot_state",), message.robot_state)
    reader.hold(request_document, ("start_state",), request.start_state)
    scene = reader.scene(scene_document)
    if over := passed_over(message.allowed_collision_matrix, arm):
        warnings.warn(SceneWarning(over), stacklevel=2)
    with scene_document.at(("world",)):
        world = World(arm, scene)
    with request_document.at(("goal_constraints", 0)):
        goal = _goal(arm, request.goal_constraints[0], frames)
    with request_document.at(("path_constraints",)):
        regions = held_regions_of(request.path_constraints, frames)
    name = f"{scene_file.resolve().parent.name}/{scene_file.stem}"
    with request_document.at(("path_constraints",) if regions else ("goal_constraints", 0)):
        return Problem(world, start, goal, name=name, constraints=regions)


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
    base = _base_pose(request)
    if not np.array_equal(base.homogeneous, np.eye(4)):
        options["base_pose"] = base
    free = load_robot(name, **options)
    held = free.movable.difference(free.joint_names)  # the start state may name joints that this robot has fixed
    locked = {joint: value for joint, value in request.start_state.values().items() if joint in held}
    return load_robot(name, locked=locked, **options)


def _base_pose(request: RequestMessage) -> pin.SE3:
    """``T_world_base`` of the start state.

    Raises:
        InputError: If it is given in another frame than the world.
    """
    state = request.start_state.multi_dof_joint_state
    frame = state.header.frame_id.removeprefix("/")
    placed = state.transforms[0].build() if state.transforms else pin.SE3.Identity()
    if frame not in ("", WORLD) and not np.array_equal(placed.homogeneous, np.eye(4)):
        raise InputError(f"the base is given in frame '{frame}'; give it in the frame '{WORLD}'")
    return placed


def _refuse_another_base(robot: Robot, request: RequestMessage, given: bool) -> None:
    """Refuse a robot of the caller that stands elsewhere than the start state says."""
    if not given or not request.start_state.multi_dof_joint_state.transforms:
        return
    base = _base_pose(request).homogeneous
    stands = robot.fk(np.clip(np.zeros(robot.dof), robot.lower, robot.upper), robot.link_names[0]).homogeneous
    if np.abs(base - stands).max() > SAME_BASE and not np.array_equal(base, np.eye(4)):
        raise InputError("it moves the base, and the robot that was given stands elsewhere; give its name or its URDF")


def _as_the_scene_says(
    scene_document: YamlDocument,
    scene: SceneMessage,
    request_document: YamlDocument,
    request: RequestMessage,
    robot: Robot,
) -> Robot:
    """The robot with the scales and paddings of its links, and with the ranges to which a path keeps its joints."""
    with scene_document.at(("link_scale",)):
        factors = {each.link_name: each.scale for each in scene.link_scale if each.scale != 1.0}
        robot = scaled(robot, factors) if factors else robot
    with scene_document.at(("link_padding",)):
        thick = {each.link_name: each.padding for each in scene.link_padding if each.padding > 0.0}
        own = dict(robot.padding)
        robot = padded(robot, own | {link: max(thick[link], own.get(link, 0.0)) for link in thick}) if thick else robot
    with request_document.at(("path_constraints", "joint_constraints")):
        ranges = _ranges(request.path_constraints.joint_constraints)
        return narrowed(robot, ranges) if ranges else robot


def _ranges(wanted: Iterable[JointConstraint]) -> dict[str, list[float]]:
    """What joints keep to, by name; of several constraints of one joint what all of them allow."""
    ranges: dict[str, list[float]] = {}
    for each in wanted:
        low, high = each.position - each.tolerance_below, each.position + each.tolerance_above
        first, last = ranges.get(each.joint_name, (low, high))
        ranges[each.joint_name] = [max(low, first), min(high, last)]
    return ranges


def _configuration(robot: Robot, values: Mapping[str, float], what: str) -> Vector:
    missing = [joint for joint in robot.joint_names if joint not in values]
    if missing:
        raise InputError(f"{what}: no value for joint '{missing[0]}' of robot '{robot.name}'; have {', '.join(values)}")
    return np.array([values[joint] for joint in robot.joint_names])


def _goal(robot: Robot, wanted: Constraints, frames: Frames) -> Goal:
    if wanted.joint_constraints and not wanted.links:
        values = {c.joint_name: c.position for c in wanted.joint_constraints}
        return JointGoal(_configuration(robot, values, "goal"))
    return tip_goal(wanted, frames)
