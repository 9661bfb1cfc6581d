"""Conversion between problem files (YAML, ``version: 1``) and `Problem`, with start and goal checked by a world.

A MotionBenchMaker file (scene or request) is recognised by its keys and can be read, too.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from rrtik_ompl.base.errors import ProblemError
from rrtik_ompl.description.xacro_text import expanding
from rrtik_ompl.files.kinds import refusing_others
from rrtik_ompl.files.sections import parse
from rrtik_ompl.files.strict_yaml import read_yaml, write_yaml
from rrtik_ompl.files.text import file_name
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.problem_files.goal import goal_data
from rrtik_ompl.problem_files.path_constraints import build_constraints, constraint_data
from rrtik_ompl.problem_files.problem_values import (
    FilePath,
    ProblemFile,
    ends_of,
    planner_of,
    problem_path,
    settings_of,
    world_data,
)
from rrtik_ompl.problem_files.robot import robot_data
from rrtik_ompl.problem_files.scene import scene_data
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World


def load_problem(
    name_or_file: FilePath, *, robot: Robot | FilePath | None = None, trust_xacro: bool = False
) -> Problem:
    """Load a shipped problem by name, a problem file, or a MotionBenchMaker pair by one of its two files.

    Args:
        name_or_file: A name without ending and folder, or a path.
        robot: A robot (or its name, or its URDF) to be used in place of the one that the file names.
        trust_xacro: Whether the macros of a robot's file are trusted, see `load_robot`.

    Raises:
        InputError: If the file cannot be used; one line with file, line, key, what was found and the remedy.
        ProblemError: If start or goal is in collision or outside the limits.

    Example:
        >>> problem = rrtik.load_problem("titan4_sdu")
        >>> problem.planner, problem.robot.dof
        ('bicrdt', 6)
    """
    with expanding(trusted=trust_xacro), refusing_others(name_or_file, "Problem"):
        return _problem(name_or_file, robot)


def _problem(name_or_file: FilePath, robot: Robot | FilePath | None) -> Problem:
    """Loads a problem as `load_problem` does.

    Errors of the problem name the line of the part that is at fault.
    """
    path = problem_path(name_or_file)
    document = read_yaml(path)
    if _is_motion_bench_maker(document.data):
        # Imported late, because it takes long and is rarely needed.
        from rrtik_ompl.problem_files.motion_bench_maker import load_motion_bench_maker

        return load_motion_bench_maker(path, robot=robot)

    entry = parse(document, ProblemFile)
    settings = settings_of(document, entry, robot)
    with document.at(("scene",)):
        world = World.of(settings)  # raises an error if the scene does not fit the robot
    start, goal = ends_of(document, entry, settings.robot)
    planner = planner_of(document, entry.planner)
    constraints = build_constraints(document, entry.path_constraints, settings.robot)

    with document.at(("path_constraints",)) if constraints else nullcontext():
        try:
            return Problem(world, start, goal, name=path.stem, planner=planner, constraints=constraints)
        except ProblemError as error:
            line = document.lines[(error.part,)]
            error.args = (f"{path}:{line}: {error}",)
            raise


def _is_motion_bench_maker(data: Mapping[str, Any]) -> bool:
    """Check whether the top level of a YAML file has the keys of a PlanningScene or a MotionPlanRequest."""
    return "version" not in data and any(key in data for key in ("robot_model_name", "goal_constraints"))


def write_problem(problem: Problem, file: FilePath) -> None:
    """Write a problem as YAML; see :meth:`Problem.save`.

    Raises:
        InputError: If the file cannot be written, or the format cannot express a part of the problem.
    """
    write_yaml(file, problem_data(problem, file_name(file).parent))


def problem_data(problem: Problem, folder: Path) -> dict[str, Any]:
    """Return the content of a problem file in a folder.

    Raises:
        InputError: If the format cannot express a part of the problem.
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
