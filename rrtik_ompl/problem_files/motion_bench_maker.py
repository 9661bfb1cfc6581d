"""MotionBenchMaker problems: ``sceneNNNN.yaml`` (a PlanningScene) and ``requestNNNN.yaml`` (a MotionPlanRequest)."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.base.errors import InputError, UnknownNameError, few
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.description.faults import nearest_name
from rrtik_ompl.description.variants import narrowed, padded, scaled
from rrtik_ompl.files.sections import parse
from rrtik_ompl.files.strict_yaml import Location, YamlDocument, read_yaml
from rrtik_ompl.model.goal import Goal, JointGoal
from rrtik_ompl.model.robot import LIMIT_TOLERANCE, Robot
from rrtik_ompl.problem_files.moveit_messages import JointConstraint, RequestMessage, RobotState, SceneMessage
from rrtik_ompl.problem_files.moveit_regions import held_regions_of, tip_goal
from rrtik_ompl.problem_files.moveit_scene import WORLD, Frames, SceneReader, passed_over, tell
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

FilePath = str | os.PathLike[str]
DESCRIBING = ("urdf", "srdf", "joint_limits", "packages", "xacro_args")  # options that describe a robot's files
SAME_BASE = 1e-9  # largest difference of the entries of two poses that count as equal [m; 1]


def load_motion_bench_maker(
    scene_path: FilePath, request_path: FilePath | None = None, robot: Robot | FilePath | None = None
) -> Problem:
    """Read a scene and its request as a problem.

    Joints outside the group (the fingers) are held at their values in the start state, or else in the state of the
    scene; objects attached by either state are held by their links. If there is no SRDF beside the URDF, the joints of
    the goal are taken as the group. Paddings and scales of links become those of the robot; a padding also counts
    between links. Path constraints on joints narrow the limits of the robot, others become regions of the problem.
    Frames may be the world, links, attached objects, objects, and the fixed frames of the scene. For frames of the
    scene the arm stands as in the state of the scene, for those of the request as at the start of the path.

    Which links may touch each other is defined by the robot (its SRDF). Of the scene's allowed collisions, those with
    an obstacle or an attached object are used; those between links only if the robot defines none.

    Args:
        scene_path: The scene, or the request; the other file is beside it under the corresponding name.
        request_path: The request, if its name does not correspond.
        robot: A robot, its name, or its URDF (an SRDF of the same name beside it is used); None for the robot that the
            scene names.

    Raises:
        InputError: If a file cannot be used, or contains something that is not supported; one line with file, line, key
            and remedy.
        ProblemError: If start or goal is in collision or outside the limits.

    Warns:
        SceneWarning: If a name is unknown (a link that may be touched, an entry of the allowed collisions, a joint), if
            the robot is not the one that the scene names or moves other joints than the group, or if the scene forbids
            links to touch that the robot never compares.
    """
    # Read both files.
    scene_file, request_file = _pair(Path(scene_path), None if request_path is None else Path(request_path))
    scene_document = read_yaml(scene_file)
    request_document = read_yaml(request_file)
    message = parse(scene_document, SceneMessage)
    request = parse(request_document, RequestMessage)

    with scene_document.at(("robot_state", "joint_state")):
        own_states = message.robot_state.values()
    with request_document.at(("start_state", "joint_state")):
        states = own_states | request.start_state.values()

    # Load the robot, and apply what the scene and the path constraints say of it.
    arm = _arm(scene_document, message, request_document, request, robot, states)
    if robot is not None and message.robot_model_name and message.robot_model_name not in _names_of(arm):
        line = f"the scene is of robot '{message.robot_model_name}', and is read with robot '{arm.name}'"
        tell(scene_document, ("robot_model_name",), line)

    arm = _as_the_scene_says(scene_document, message, request_document, request, arm)
    _tell_misspelt_joints(request_document, request, arm)

    # Determine the start, the configuration in which the scene is given, and the frames.
    with request_document.at(("start_state", "joint_state")):
        start = _configuration(arm, states, "start")
    with scene_document.at(("robot_state", "joint_state")):
        shown = _configuration(arm, states | own_states, "robot_state")
    with scene_document.at(("fixed_frame_transforms",)):
        frames = Frames(arm, shown, message.fixed_frame_transforms)

    # Read the scene; objects are attached before and after the arm moves to the start.
    reader = SceneReader(arm, frames, message)
    reader.read_world(scene_document)
    reader.hold(scene_document, ("robot_state",), message.robot_state)
    frames = reader.start_at(start)
    reader.hold(request_document, ("start_state",), request.start_state)
    scene = reader.scene(scene_document)

    if over := passed_over(message.allowed_collision_matrix, arm):
        tell(scene_document, ("allowed_collision_matrix",), over)

    # Build the world, the goal and the path constraints.
    with scene_document.at(("world",)):
        world = World(arm, scene)
    with request_document.at(("goal_constraints", 0)):
        goal = _goal(arm, request, states, frames)
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


def _arm(
    scene_document: YamlDocument,
    scene: SceneMessage,
    request_document: YamlDocument,
    request: RequestMessage,
    robot: Robot | FilePath | None,
    states: Mapping[str, float],
) -> Robot:
    """Return the given robot or that of the scene, with base and fingers as at the start."""
    moved = bool(request.start_state.multi_dof_joint_state.transforms)
    document, key = (request_document, "start_state") if moved else (scene_document, "robot_state")
    with document.at((key, "multi_dof_joint_state")):
        base = _base_pose(request.start_state if moved else scene.robot_state)

    if robot is None and not scene.robot_model_name:
        with scene_document.at(("robot_model_name",)):
            raise InputError("is empty; give the robot")

    if not isinstance(robot, Robot):
        with _said_where(scene_document, request_document, scene, request):
            name = scene.robot_model_name if robot is None else robot
            return _robot(name, request_document, request, states, base)

    with document.at((key, "multi_dof_joint_state")):
        _refuse_another_base(robot, base)
    if fault := _another_group(robot, request.group_name):
        tell(request_document, ("group_name",), fault)
    if fault := _held_elsewhere(robot, states):
        tell(request_document, ("start_state", "joint_state"), fault)
    return robot


def _base_pose(state: RobotState) -> pin.SE3:
    """Return ``T_world_base`` of a state.

    Raises:
        InputError: If it is given in another frame than the world.
    """
    moved = state.multi_dof_joint_state
    frame = moved.header.frame_id.removeprefix("/")
    placed = moved.transforms[0].build() if moved.transforms else pin.SE3.Identity()
    if frame not in ("", WORLD) and not np.array_equal(placed.homogeneous, np.eye(4)):
        raise InputError(f"the base is given in frame '{frame}'; give it in the frame '{WORLD}'")
    return placed


@contextmanager
def _said_where(
    scene_document: YamlDocument, request_document: YamlDocument, scene: SceneMessage, request: RequestMessage
) -> Iterator[None]:
    """Add file, line and key to an error about a name that the robot does not have, inside a ``with`` block.

    The place is the one at which the scene or the request uses the name.
    """
    try:
        yield
    except UnknownNameError as error:
        goal = request.goal_constraints[0]
        asked: dict[str, Location] = {link: ("goal_constraints", 0) for link in goal.links}
        for k, each in enumerate(goal.joint_constraints):
            asked[each.joint_name] = ("goal_constraints", 0, "joint_constraints", k)
        asked[request.group_name] = ("group_name",)

        if error.name == scene.robot_model_name:
            with scene_document.at(("robot_model_name",)):
                raise
        if error.name in asked:
            with request_document.at(asked[error.name]):
                raise
        raise


def _robot(
    name: FilePath,
    document: YamlDocument,
    request: RequestMessage,
    states: Mapping[str, float],
    base: pin.SE3,
) -> Robot:
    """Load the robot by name or file, with base and held joints as at the start.

    If there is no SRDF, the group is taken to be the joints of the goal, or those that move its link.

    Raises:
        InputError: If, without an SRDF, a goal of joints leaves out a joint between two that it names.
    """
    options: dict[str, Any] = {}
    joints = [c.joint_name for c in request.goal_constraints[0].joint_constraints]
    guessed = False

    if os.path.isdir(name):
        options = {"group": request.group_name}
    elif Path(name).suffix.lower() == ".urdf":
        semantics = Path(name).with_suffix(".srdf")
        guessed = bool(joints) and not os.path.isfile(semantics)
        options = {"joints": joints} if guessed else {}
        if os.path.isfile(semantics):
            options = {"srdf": str(semantics), "group": request.group_name}

    links = request.goal_constraints[0].links
    if links:
        options["tip"] = links[0]
    if not np.array_equal(base.homogeneous, np.eye(4)):
        options["base_pose"] = base

    free = load_robot(name, **options)
    if guessed:
        _tell_held_joints(free, document, request.group_name)

    held = free.movable.difference(free.joint_names)  # the start state may name fixed joints, too
    locked = {joint: value for joint, value in states.items() if joint in held}
    return load_robot(name, locked=locked, **options)


def _tell_held_joints(robot: Robot, document: YamlDocument, group: str) -> None:
    """Warn of joints above those of a goal that are held because the goal does not name them.

    Raises:
        InputError: If one is between two that the goal names, because the arm would be a different one.
    """
    frames = robot.model.frames
    above: list[str] = []
    for joint in robot.joint_names:
        # Go up from the joint to the base or to the next joint of the arm, and collect the held joints on the way.
        number = robot.model.getFrameId(joint)
        below_another = False
        held = []
        while number > 0:
            number = frames[number].parentFrame
            name = frames[number].name
            if name in robot.joint_names:
                below_another = True
                break
            if name in robot.movable:
                held.append(name)

        if below_another and held:
            with document.at(("goal_constraints", 0, "joint_constraints")):
                raise InputError(
                    f"it leaves out joint '{held[0]}' above '{joint}', and without an SRDF the joints of group "
                    f"'{group}' are not known; put the SRDF beside the URDF, or name the joint in the goal"
                )
        above += [name for name in held if name not in above]

    if above:
        line = f"without an SRDF its joints are taken to be those of the goal; held still: {few(above)}"
        tell(document, ("group_name",), line)


def _refuse_another_base(robot: Robot, base: pin.SE3) -> None:
    """Raise an InputError if the given robot has another base pose than the state."""
    wanted = base.homogeneous
    if np.array_equal(wanted, np.eye(4)):
        return
    stands = robot.fk(np.clip(np.zeros(robot.dof), robot.lower, robot.upper), robot.link_names[0]).homogeneous
    if np.abs(wanted - stands).max() > SAME_BASE:
        raise InputError("it moves the base, and the robot that was given stands elsewhere; give its name or its URDF")


def _another_group(robot: Robot, group: str) -> str:
    """Return a warning if the joints of the given robot are not those of the group of its SRDF; "" if they are.

    It is also "" if the group is not known.
    """
    source = dict(robot.source)
    kind = next((key for key in ("moveit", "urdf") if key in source), "")
    if not kind or source.get("group") == group or not {"moveit", "srdf"} & source.keys():
        return ""

    of_files = {key: source[key] for key in DESCRIBING if key in source and key != kind}
    try:
        moving = load_robot(source[kind], group=group, **of_files).joint_names
    # Only a missing group is reported: everything else could be loaded before, or there would be no robot.
    except InputError as error:
        return str(error) if getattr(error, "name", "") == group else ""

    if set(moving) == set(robot.joint_names):
        return ""
    return f"group '{group}' moves {few(moving)}, and the robot that was given {few(robot.joint_names)}"


def _held_elsewhere(robot: Robot, states: Mapping[str, float]) -> str:
    """Return a warning if the given robot holds a joint at another value than the start; "" if it does not."""
    own = robot.source.get("locked", {})
    for joint in sorted(robot.movable.difference(robot.joint_names).intersection(states)):
        value = states[joint]
        # A joint that mimics a held one has no entry of its own.
        known = own.get(joint, value if own else 0.0)
        if abs(value - known) > LIMIT_TOLERANCE:
            return f"joint '{joint}' is at {value:g}, and the robot that was given was not loaded with that in locked="
    return ""


def _names_of(robot: Robot) -> set[str]:
    """Return the names that a scene may use for a robot: its own name, or that of its file."""
    files = {Path(str(robot.source[kind])).stem for kind in ("urdf", "mjcf", "dh") if kind in robot.source}
    return {robot.name, str(robot.source.get("name", robot.name)), *files}


def _as_the_scene_says(
    scene_document: YamlDocument,
    scene: SceneMessage,
    request_document: YamlDocument,
    request: RequestMessage,
    robot: Robot,
) -> Robot:
    """Return the robot with the scales and paddings of its links, and with limits narrowed by path constraints."""
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
    """Return the range of each joint that satisfies all of its constraints, [lowest, highest], by name."""
    ranges: dict[str, list[float]] = {}
    for each in wanted:
        low = each.position - each.tolerance_below
        high = each.position + each.tolerance_above
        first, last = ranges.get(each.joint_name, (low, high))
        ranges[each.joint_name] = [max(low, first), min(high, last)]
    return ranges


def _tell_misspelt_joints(document: YamlDocument, request: RequestMessage, robot: Robot) -> None:
    """Warn of unknown joint names in the start state that resemble a joint without a value."""
    names = request.start_state.joint_state.name
    unnamed = robot.movable.difference(names)
    for k, name in enumerate(names):
        if name not in robot.movable and (near := nearest_name(name, unnamed)):
            line = f"no joint '{name}' of robot '{robot.name}'; it is left out{near}"
            tell(document, ("start_state", "joint_state", "name", k), line)


def _configuration(robot: Robot, values: Mapping[str, float], what: str) -> Vector:
    missing = [joint for joint in robot.joint_names if joint not in values]
    if missing:
        raise InputError(f"{what}: no value for joint '{missing[0]}' of robot '{robot.name}'; have {', '.join(values)}")
    return np.array([values[joint] for joint in robot.joint_names])


def _goal(robot: Robot, request: RequestMessage, states: Mapping[str, float], frames: Frames) -> Goal:
    """Returns the goal of a request: joint values for every joint of the arm, or a goal of a link."""
    wanted = request.goal_constraints[0]
    if not wanted.joint_constraints or wanted.links:
        return tip_goal(wanted, frames)

    # Collect the joint values; joints outside the arm must already be there.
    values: dict[str, float] = {}
    for each in wanted.joint_constraints:
        name = each.joint_name
        if values.setdefault(name, each.position) != each.position:
            raise InputError(f"joint '{name}' has two positions; leave one of them out")
        if name not in robot.joint_names:
            _refuse_unmoved(robot, each, states.get(name), request.group_name)

    missing = [joint for joint in robot.joint_names if joint not in values]
    if missing:
        raise InputError(
            f"no value for joint '{missing[0]}' of group '{request.group_name}'; a goal that leaves joints free "
            f"is not read: give one for each of {', '.join(robot.joint_names)}"
        )

    return JointGoal(_configuration(robot, values, "goal"))


def _refuse_unmoved(robot: Robot, wanted: JointConstraint, value: float | None, group: str) -> None:
    """Raise an error if a goal names a joint that the arm does not move and that is not at that value already."""
    name = wanted.joint_name
    if name not in robot.movable:
        raise UnknownNameError(f"joint of robot '{robot.name}'", name, robot.movable)

    low = wanted.position - wanted.tolerance_below
    high = wanted.position + wanted.tolerance_above
    if value is None or not low - LIMIT_TOLERANCE <= value <= high + LIMIT_TOLERANCE:
        raise InputError(
            f"joint '{name}' is none of group '{group}', so that no path brings it to {wanted.position:g}; "
            "take it out, or choose another group"
        )
