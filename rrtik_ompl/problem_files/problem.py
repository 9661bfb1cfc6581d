"""Problem files (YAML, ``version: 1``): robot, scene, start and goal <-> `Problem`, and the JSON schema of the format.

A MotionBenchMaker file (scene or request) is recognised by its keys and read as well.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from pydantic import Field

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.base.errors import InputError, ProblemError, UnknownNameError, require
from rrtik_ompl.description.catalog import find_problem, list_planners, load_robot, robot_from_entry, task_files
from rrtik_ompl.description.xacro_text import expanding
from rrtik_ompl.files.sections import Version, parse, without_null
from rrtik_ompl.files.strict_yaml import YamlDocument, read_yaml, write_yaml
from rrtik_ompl.files.text import file_name
from rrtik_ompl.model.goal import Goal
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.world_settings import WorldSettings
from rrtik_ompl.problem_files.goal import GoalSection, StartSection, build_goal, goal_data
from rrtik_ompl.problem_files.path_constraints import ConstraintSection, build_constraints, constraint_data
from rrtik_ompl.problem_files.robot import RobotEntry, robot_data
from rrtik_ompl.problem_files.run import RunSection
from rrtik_ompl.problem_files.scene import SceneEntry, scene_data
from rrtik_ompl.problem_files.world import WorldKeys, world_data
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

FilePath = str | os.PathLike[str]


ONLY_PATHS = (".csv", ".txt")  # endings; a .json may be either
NO_GOAL = "it has stages and no goal"
OF_TASKS = {"task": NO_GOAL, "goals": "it has several goals, to be reached in order"}  # by keys
OF_PATHS = ("waypoints", "points")  # keys of files of paths and of trajectories


class ProblemFile(WorldKeys):
    """A motion planning problem. Lengths in metres; angles in radians, in degrees where a key ends in _deg."""

    version: Version
    robot: RobotEntry
    scene: SceneEntry = Field(default=SceneEntry())
    start: StartSection
    goal: GoalSection
    planner: str | None = Field(None, description="planner that is used where none is named (rrtik list planners)")
    path_constraints: list[ConstraintSection] = Field(
        default=[], description="regions that a frame of the arm must not leave on the whole path"
    )
    run: RunSection | None = Field(None, description="how to replan while the obstacles move (rrtik replan)")


def load_problem(
    name_or_file: FilePath, *, robot: Robot | FilePath | None = None, trust_xacro: bool = False
) -> Problem:
    """Load a shipped problem by name, a problem file, or a MotionBenchMaker pair by one of its two files.

    Args:
        name_or_file: A name without ending and folder, or a path.
        robot: Plan for this robot (or its name, or its URDF) in place of the one that the file names.
        trust_xacro: Whether the macros of a robot's file are trusted, see `load_robot`.

    Raises:
        InputError: If the file cannot be used; one line with file, line, key, what was found and the remedy.
        ProblemError: If start or goal is in collision or outside the limits.

    Example:
        >>> problem = rrtik.load_problem("titan4_sdu")
        >>> problem.planner, problem.robot.dof
        ('bicrdt', 6)
    """
    with expanding(trusted=trust_xacro):
        return _problem(name_or_file, robot)


def _problem(name_or_file: FilePath, robot: Robot | FilePath | None) -> Problem:
    path = problem_path(name_or_file)
    document = _read(path)
    if _is_motion_bench_maker(document.data):
        from rrtik_ompl.problem_files.motion_bench_maker import load_motion_bench_maker  # takes long, and few need it

        return load_motion_bench_maker(path, robot=robot)
    entry = parse(document, ProblemFile)
    settings = _settings(document, entry, robot)
    with document.at(("scene",)):
        world = World.of(settings)  # refuses a scene that does not fit the robot
    start, goal = _ends(document, entry, settings.robot)
    planner = _planner(document, entry.planner)
    constraints = build_constraints(document, entry.path_constraints, settings.robot)
    with document.at(("path_constraints",)) if constraints else nullcontext():
        try:
            return Problem(world, start, goal, name=path.stem, planner=planner, constraints=constraints)
        except ProblemError as error:
            line = document.lines[(error.part,)]
            error.args = (f"{path}:{line}: {error}",)
            raise


def load_unchecked(name_or_file: FilePath) -> tuple[WorldSettings, Vector, Goal]:
    """What a problem file says, as values: settings of the world, start and goal. No world is asked about them.

    Raises:
        InputError: As for :func:`load_problem`, but for what only a world can say.
    """
    document = _read(problem_path(name_or_file))
    entry = parse(document, ProblemFile)
    settings = _settings(document, entry, None)
    return settings, *_ends(document, entry, settings.robot)


def _ends(document: YamlDocument, entry: ProblemFile, robot: Robot) -> tuple[Vector, Goal]:
    with document.at(("start",)):
        start = entry.start.configuration(robot)
    with document.at(("goal",)):
        return start, build_goal(entry.goal, robot)


def _is_motion_bench_maker(data: Mapping[str, Any]) -> bool:
    """Whether the top level of a YAML file has the keys of a PlanningScene or of a MotionPlanRequest."""
    return "version" not in data and any(key in data for key in ("robot_model_name", "goal_constraints"))


def _read(path: Path) -> YamlDocument:
    """The content of a problem file; whoever names a path alone is told what is missing."""
    document = None if path.suffix.lower() in ONLY_PATHS and os.path.isfile(path) else read_yaml(path)
    if document is None or (isinstance(document.data, dict) and not document.data.keys().isdisjoint(OF_PATHS)):
        name = path.name
        raise InputError(f"{path}: a path, not a problem; name its problem before it: rrtik check PROBLEM {name}")
    if isinstance(document.data, dict) and "goal" not in document.data:
        for key, what in OF_TASKS.items():
            if key in document.data:
                raise InputError(f"{path}: a task, not a problem: {what}; use rrtik task {path.name}")
    return document


def save_problem(problem: Problem, path: FilePath) -> None:
    """Write a problem as YAML, whole or not at all; numbers read back bit for bit, rotations to the last digit or two.

    Angles are written in radians. Files (meshes, URDF) are named relative to the new file's folder.

    Raises:
        InputError: If the file cannot be written, or the format has no words for something in the problem.

    Example:
        >>> rrtik.save_problem(rrtik.load_problem("planar3_boxes"), "boxes.yaml")
        >>> rrtik.load_problem("boxes.yaml").world.scene.names == rrtik.load_problem("planar3_boxes").world.scene.names
        True
    """
    require(problem, Problem, "problem to save")
    write_yaml(path, problem_data(problem, file_name(path).parent))


def problem_data(problem: Problem, folder: Path) -> dict[str, Any]:
    """What the file of a problem in a folder holds.

    Raises:
        InputError: If the format has no words for something in the problem.
    """
    settings = problem.settings
    data: dict[str, Any] = {"version": 1, "robot": robot_data(settings.robot.source, folder)}
    scene = scene_data(settings.scene, folder)
    data |= {"scene": scene} if scene else {}
    data |= {"start": {"joints": problem.start.tolist()}, "goal": goal_data(problem.goal)}
    data |= world_data(settings)
    held = [constraint_data(region) for region in problem.constraints]
    data |= {"path_constraints": held} if held else {}
    return data if problem.planner is None else data | {"planner": problem.planner}


def problem_schema() -> dict[str, Any]:
    """JSON schema of the problem file, made from the same models that check it."""
    schema = without_null(ProblemFile.model_json_schema())
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def problem_path(name_or_file: FilePath) -> Path:
    """The file of a problem: a bare word is the name of a shipped one, or a file if there is no such name.

    Raises:
        UnknownNameError: If it is a bare word, and neither.
    """
    path = file_name(name_or_file)
    if not isinstance(name_or_file, str) or path.suffix or len(path.parts) > 1:
        return path
    try:
        return Path(find_problem(name_or_file))
    except UnknownNameError:
        if os.path.isfile(path):
            return path
        if name_or_file in task_files():
            raise InputError(f"'{name_or_file}' is a task, not a problem: {NO_GOAL}; use rrtik task {path}") from None
        raise


def _planner(document: YamlDocument, name: str | None) -> str | None:
    """The name of a planner, if there is such a planner."""
    if name is not None and name.lower() not in list_planners():
        from rrtik_ompl.ompl_bridge.planner_files import is_planner_file  # loads OMPL, which few files need
        from rrtik_ompl.ompl_bridge.planner_names import options_of

        with document.at(("planner",)):
            if is_planner_file(name):
                raise InputError(f"'{name}': a problem file runs no code; give it with --planner")
            options_of(name)
    return name


def _settings(document: YamlDocument, entry: ProblemFile, robot: Robot | FilePath | None) -> WorldSettings:
    if robot is None:
        with document.at(("robot",)):
            robot = robot_from_entry(document.data["robot"], document.path.parent)
    elif not isinstance(robot, Robot):
        robot = load_robot(robot)
    scene = entry.scene.build(document)
    with document.at(("scene",)):
        return entry.settings(robot, scene)
