"""The kinds of files: which value each of them holds, which function reads it, and how to tell.

Values know nothing of the modules that read them, so those are named here, as entry points name them, and imported when
a file is read. A new kind of file is a new row.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeAlias, TypeVar

from rrtik_ompl.base.errors import InputError, in_file
from rrtik_ompl.files.named_arrays import NamedArrays
from rrtik_ompl.files.tables import json_value
from rrtik_ompl.files.text import file_name, read_text

FilePath: TypeAlias = str | os.PathLike[str]
Value = TypeVar("Value")
MAX_BYTES = 512 * 1024 * 1024  # the largest file of all kinds that tell what they are by their words: a record of a run


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of file.

    Attributes:
        what: What messages call it, with its article.
        value: Class of the value, "module:name".
        reader: Function that reads it, "module:name"; its arguments are those of ``load`` of the class.
        writer: Function that takes a value and a file and writes it; "" if the class does that itself, or nothing does.
        kind: What a file of this kind states as its "kind".
        words: Keys (or arrays) of a file that states none, one of which is sufficient.
        without: A key that such a file does not have.
        endings: Endings that only this kind has.
        also: Names of other classes whose ``load`` accepts such a file, or says best what it lacks.
        needs: Arguments without which ``load`` cannot read the file.
        command: Command that takes such a file.
    """

    what: str
    value: str
    reader: str
    writer: str = ""
    kind: str = ""
    words: tuple[str, ...] = ()
    without: str = ""
    endings: tuple[str, ...] = ()
    also: tuple[str, ...] = ()
    needs: str = ""
    command: str = ""


PLY_FACES = "element face"
PLY_HEAD = 4096  # [bytes]

# The first row whose words a file says is its kind: a problem with a section "run" is a scenario.
KINDS = MappingProxyType(
    {
        "Certificate": Kind(
            "a certificate of a path",
            "model.certificate:Certificate",
            "model.certificate:read_certificate",
            kind="path_certificate",
            words=("motions",),
        ),
        "TaskCertificate": Kind(
            "a certificate of a task",
            "model.certificate:TaskCertificate",
            "model.certificate:read_task_certificate",
            kind="task_certificate",
        ),
        "JointPath": Kind(
            "a path",
            "model.path:JointPath",
            "model.path:read_path",
            kind="joint_path",
            words=("waypoints",),
            endings=(".txt",),
            also=("Certificate", "HeightField"),
            command="rrtik check PROBLEM {}",
        ),
        "Trajectory": Kind(
            "a timed motion",
            "motion.trajectory:Trajectory",
            "motion.trajectory.load:read_trajectory",
            kind="joint_trajectory",
            words=("points",),
            command="rrtik show PROBLEM {}",
        ),
        "ReplanRun": Kind(
            "a record of a run",
            "replanning.record:ReplanRun",
            "replanning.record:read_run",
            kind="replan_run",
            words=("ticks",),
            command="rrtik check PROBLEM {}",
        ),
        "TaskPlan": Kind(
            "a plan of a task",
            "tasks:TaskPlan",
            "tasks.plan_file:read_task_plan",
            "tasks.plan_file:write_task_plan",
            kind="task_plan",
            command="rrtik check {}",
        ),
        "Task": Kind(
            "a task",
            "tasks:Task",
            "tasks.task_file:read_task",
            "tasks.task_file:write_task",
            words=("task", "goals"),
            command="rrtik task {}",
        ),
        "Scenario": Kind(
            "a scenario",
            "replanning.scenario:Scenario",
            "replanning.scenario:read_scenario",
            words=("run",),
            also=("Problem", "Scene"),
            command="rrtik replan {}",
        ),
        "Problem": Kind(
            "a problem",
            "world.problem:Problem",
            "problem_files.problem:load_problem",
            "problem_files.problem:write_problem",
            words=("goal", "goal_constraints", "robot_model_name"),
            also=("Scene", "Scenario"),
            command="rrtik plan {}",
        ),
        "Scene": Kind(
            "a scene",
            "model.scene:Scene",
            "problem_files.scene:load_scene",
            "problem_files.scene:write_scene",
            words=("scene",),
            without="robot",
            endings=(".scene",),
        ),
        "Robot": Kind(
            "a robot",
            "model.robot:Robot",
            "description.catalog:load_robot",
            words=("dh",),
            endings=(".urdf", ".xacro", ".mjcf", ".xml"),
            also=("Camera",),
            command="rrtik show {}",
        ),
        "Roadmap": Kind(
            "a roadmap",
            "planning.search.roadmap:Roadmap",
            "planning.search.roadmap:read_roadmap",
            words=("edges",),
            needs="world",
        ),
        "ReachMap": Kind("a map of reach", "ik.reach:ReachMap", "ik.reach:read_reach_map", words=("measure",)),
        "PointCloud": Kind(
            "a point cloud",
            "model.shapes:PointCloud",
            "description.shapes.cloud:read_cloud",
            "description.shapes.cloud:write_cloud",
            endings=(".ply", ".pcd", ".xyz", ".npy"),
            also=("HeightField", "Scene"),
        ),
        "Octree": Kind(
            "an octree",
            "model.shapes:Octree",
            "description.shapes.octree:read_octree",
            endings=(".bt", ".ot"),
            also=("PointCloud", "Scene"),
        ),
        "Mesh": Kind(
            "a mesh",
            "model.shapes:Mesh",
            "description.shapes.mesh:read_mesh",
            words=(PLY_FACES,),
            endings=(".stl", ".obj", ".dae", ".glb", ".gltf"),
            also=("Scene",),
        ),
        "HeightField": Kind(
            "a grid of heights",
            "model.shapes:HeightField",
            "description.shapes.heights:read_heights",
            endings=(".tif", ".tiff", ".pgm", ".png"),
            needs="cell=[m]",
        ),
        "Camera": Kind(
            "a camera",
            "sensing.cameras.camera:Camera",
            "sensing.camera_file:read_camera",
            "sensing.camera_file:write_camera",
            words=("camera", "camera_matrix"),
        ),
        "Rig": Kind(
            "a rig of cameras",
            "sensing.rig:Rig",
            "sensing.rig_file:read_rig",
            "sensing.rig_file:write_rig",
            words=("cameras",),
        ),
        "MarkerMap": Kind(
            "a marker map",
            "sensing.markers.marker_map:MarkerMap",
            "sensing.markers.marker_map_file:read_marker_map",
            words=("dictionary",),
        ),
    }
)


def load(file: FilePath) -> Any:  # noqa: ANN401 - whatever the file holds
    """Read a file of any kind, as ``load`` of the class of its value does.

    What a file is, is told by the kind or the keys that it states (JSON, YAML, NPZ), by its columns (CSV), or else by
    its ending; a folder is a MoveIt configuration. For options, and for type checkers, call ``load`` of the class.

    Args:
        file: Name of the file.

    Returns:
        A `Robot`, `Problem`, `Scene`, `JointPath`, `Trajectory`, `Certificate`, `Task`, `TaskPlan`, `Mesh`,
        `PointCloud`, `Octree`, ``rrtik.replanning.Scenario``, ``rrtik.replanning.ReplanRun``, ``rrtik.ik.ReachMap``,
        ``rrtik.sensing.Camera``, ``rrtik.sensing.Rig`` or ``rrtik.sensing.MarkerMap``.

    Raises:
        InputError: If the file cannot be read, its kind cannot be told, or it needs further arguments, as a `Roadmap`
            needs its world; one line.

    Example:
        >>> rrtik.JointPath([[0.0], [1.0]]).save("path.json")
        >>> rrtik.load("path.json")
        JointPath(2 waypoints of 1 joints, 1 transitions, length 1 rad)
    """
    name = kind_of(file)
    if name is None:
        if not os.path.exists(file):
            raise InputError(f"{file}: no such file; load_robot and load_problem take names that are shipped")
        raise InputError(f"{file}: is none of {', '.join(KINDS)}; name its class, such as JointPath.load(file)")
    if needs := KINDS[name].needs:
        raise InputError(f"{file}: {KINDS[name].what} is read with {name}.load(file, {needs})")
    return found(KINDS[name].value).load(file)


def read(value: type[Value], file: FilePath, *arguments: Any, **options: Any) -> Value:
    """Read a file of a class, by the reader of its row.

    Raises:
        InputError: If the file cannot be read; if it holds another kind of value, the message says so.
    """
    name = value.__name__
    with refusing_others(file, name):
        read_value: Value = found(KINDS[name].reader)(file, *arguments, **options)
    return read_value


def write(value: object, file: FilePath) -> Any:  # noqa: ANN401 - what the writer returns
    """Write a value to a file, by the writer of its row.

    Raises:
        InputError: If the file cannot be written.
    """
    return found(KINDS[type(value).__name__].writer)(value, file)


@contextmanager
def refusing_others(file: FilePath, name: str) -> Iterator[None]:
    """Raise an error that says what a file is, if it cannot be read because it holds a value of another class."""
    try:
        yield
    except InputError as error:
        try:
            other = kind_of(file) if os.path.isfile(file_name(file)) else None
        except InputError:  # it is what the reader says
            other = None
        if other is None or other == name or name in KINDS[other].also:
            raise
        kind = KINDS[other]
        command = f" or {kind.command.format(file_name(file).name)}" if kind.command else ""
        raise InputError(f"{file}: {kind.what}, not {KINDS[name].what}; use {other}.load(file){command}") from error


def kind_of(file: FilePath) -> str | None:
    """Return the name of the class of the value that a file holds, or None.

    Raises:
        InputError: If the file cannot be read.
    """
    path = file_name(file)
    if os.path.isdir(file):  # which takes names of any length
        return "Robot"
    ending = path.suffix.lower()
    words = _words(path, ending)
    if "kind" in words:
        told = (name for name, kind in KINDS.items() if kind.kind and kind.kind == words["kind"])
    else:
        having = (name for name, kind in KINDS.items() if not words.keys().isdisjoint(kind.words))
        told = (name for name in having if KINDS[name].without not in words)
    ended = (name for name, kind in KINDS.items() if ending in kind.endings)
    return next(told, None) or next(ended, None)


def _words(path: Path, ending: str) -> Mapping[str, object]:
    """Return the keys of a file, with their values where it is JSON or YAML; none if its ending tells more."""
    if ending == ".csv":
        first = read_text(path).partition("\n")[0]
        return {"points" if first.startswith("time,") else "waypoints": None}
    if ending == ".npz":
        return dict.fromkeys(NamedArrays(path).names)
    if ending == ".ply":
        from rrtik_ompl.files.point_files import is_ply_mesh  # few files need it

        with open(path, "rb") as stream:
            return {PLY_FACES: None} if is_ply_mesh(stream.read(PLY_HEAD)) else {}
    if ending == ".json":
        document = _json(path)
    elif ending in (".yaml", ".yml"):
        from rrtik_ompl.files.strict_yaml import read_yaml  # loads slowly, and every value imports this module

        document = read_yaml(path).data
    else:
        return {}
    return document if isinstance(document, dict) else {}


def _json(path: Path) -> object:
    try:
        return json_value(read_text(path, MAX_BYTES))
    except InputError as error:
        raise in_file(path, error) from None


def found(name: str) -> Any:  # noqa: ANN401 - a class or a function
    """Return what stands under a name of the table, such as "model.path:JointPath"."""
    module, _, attribute = name.partition(":")
    return getattr(import_module(f"rrtik_ompl.{module}"), attribute)
