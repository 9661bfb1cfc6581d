"""A MoveIt configuration folder: which files describe the robot, and which group of its joints is the arm."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from rrtik_ompl.description.moveit.parameters import parameters
from rrtik_ompl.description.moveit.srdf import Srdf, read_srdf
from rrtik_ompl.description.package_path import package_folder
from rrtik_ompl.description.urdf import URDF_OPTIONS, package_roots, robot_from_urdf
from rrtik_ompl.description.urdf_read import read_urdf
from rrtik_ompl.description.xacro_text import robot_text
from rrtik_ompl.errors import InputError, UnknownNameError
from rrtik_ompl.files.strict_yaml import read_yaml
from rrtik_ompl.robot import Robot

ASSISTANT = ".setup_assistant"  # where MoveIt's setup assistant writes which URDF a folder is for
CONFIG_OPTIONS = tuple(sorted({*URDF_OPTIONS, "urdf"}))
FilePath = str | os.PathLike[str]


def robot_from_moveit(folder: FilePath, **options: Any) -> Robot:
    """Load a robot from a folder that MoveIt's setup assistant wrote.

    Read are the SRDF (groups, postures, allowed collisions, end effectors), ``joint_limits.yaml``, ``kinematics.yaml``
    (which groups have inverse kinematics; the solver is ours), and the URDF: one in the folder, that of the package
    which ``.setup_assistant`` names, or a ``.urdf.xacro`` in the folder. Robots of several groups need ``group``.

    Args:
        folder: With the files, or with a folder ``config`` that has them.
        **options: As of `rrtik_ompl.description.urdf.robot_from_urdf_text`, and ``urdf``; a file that is given is read
            in place of the folder's.

    Raises:
        InputError: If a file is missing or cannot be used; one line names it and the remedy.
    """
    found = {**options, **config_files(folder, options)}
    return robot_from_urdf(found.pop("urdf"), **found)


def config_files(folder: FilePath, given: Mapping[str, Any]) -> dict[str, Any]:
    """The files of a folder, ``urdf, srdf, joint_limits``, and the ``group``; what is given stays so.

    Raises:
        InputError: See :func:`robot_from_moveit`.
    """
    home = Path(folder)
    config = home / "config" if os.path.isdir(home / "config") else home
    if not os.path.isdir(config):
        raise InputError(f"{folder}: no such folder; give a MoveIt configuration folder")
    packages = package_roots(given.get("packages", ()))
    named = _assistant(home, config)
    srdf = given.get("srdf") or _srdf(home, config, named)
    urdf = given.get("urdf") or _urdf(home, config, named, packages)
    found: dict[str, Any] = {"urdf": Path(urdf), "srdf": Path(srdf)}
    limits = given.get("joint_limits") or config / "joint_limits.yaml"
    if given.get("joint_limits") or os.path.isfile(limits):
        found["joint_limits"] = Path(limits)
    if given.get("group") is None and given.get("joints") is None:
        found["group"] = _group(home, config, found, packages, given.get("xacro_args"))
    return found


def _assistant(home: Path, config: Path) -> Mapping[str, Any]:
    """What the setup assistant wrote about the URDF and the SRDF: ``{"urdf": {..}, "srdf": {..}}``."""
    file = next((each for each in (home / ASSISTANT, config.parent / ASSISTANT) if os.path.isfile(each)), None)
    if file is None:
        return {}
    document = read_yaml(file)
    top = document.data.get("moveit_setup_assistant_config")
    if not isinstance(top, Mapping):
        raise document.error(("moveit_setup_assistant_config",), "expected a group of keys of MoveIt's setup assistant")
    return {str(key).lower(): value for key, value in top.items() if isinstance(value, Mapping)}


def _srdf(home: Path, config: Path, named: Mapping[str, Any]) -> Path:
    relative = named.get("srdf", {}).get("relative_path")
    if isinstance(relative, str) and os.path.isfile(home / relative):
        return home / relative
    return _only(config, ("*.srdf", "*.srdf.xacro"), "SRDF", "srdf") or _missing(config, "SRDF", "srdf")


def _urdf(home: Path, config: Path, named: Mapping[str, Any], packages: Iterable[Path]) -> Path:
    own = _only(config, ("*.urdf",), "URDF", "urdf")
    if own is not None:
        return own
    package, relative = (named.get("urdf", {}).get(key) for key in ("package", "relative_path"))
    where = package_folder(package, home.resolve(), packages) if isinstance(package, str) else None
    if where is not None and isinstance(relative, str) and os.path.isfile(where / relative):
        return where / relative
    own = _only(config, ("*.urdf.xacro",), "URDF", "urdf")
    if own is None and isinstance(package, str):
        raise InputError(
            f"{home / ASSISTANT}: the URDF {relative} of package '{package}' is not found; "
            f"give packages=[the folder that holds '{package}'], or urdf=FILE"
        )
    return own or _missing(config, "URDF", "urdf")


def _missing(config: Path, kind: str, option: str) -> Path:
    raise InputError(f"{config}: no {kind} in this folder; is it of MoveIt? give {option}=FILE")


def _only(config: Path, patterns: Iterable[str], kind: str, option: str) -> Path | None:
    """The only file of the first pattern that any file has; None if none has."""
    for pattern in patterns:
        found = sorted(config.glob(pattern))
        if len(found) > 1:
            names = ", ".join(each.name for each in found)
            raise InputError(f"{config}: {len(found)} files are an {kind}: {names}; choose one by {option}=FILE")
        if found:
            return found[0]
    return None


def _group(home: Path, config: Path, files: Mapping[str, Any], packages: list[Path], words: Any) -> str:
    """The group that is the arm: the only one that moves and is no gripper's, or the only one that has a solver."""
    semantics = read_srdf(robot_text(files["srdf"], packages), str(files["srdf"]))
    urdf = files["urdf"]
    text = robot_text(urdf, packages, words)
    tree = read_urdf(text, where=str(urdf), folder=urdf.resolve().parent, packages=packages).tree
    moving = [name for name in semantics.groups if semantics.movable(name, tree)]
    solved = _solved(config, semantics)
    held = {end.group for end in semantics.end_effectors if end.group != end.parent_group}
    arms = [name for name in moving if name not in held] or moving
    for names in (arms, [name for name in arms if name in solved]):
        if len(names) == 1:
            return names[0]
    choice = ", ".join(arms) or "none that moves"
    raise InputError(f"{home}: which group is the arm? choose one by group=, of {choice}")


def _solved(config: Path, semantics: Srdf) -> set[str]:
    """Groups for which ``kinematics.yaml`` names a solver."""
    file = config / "kinematics.yaml"
    if not os.path.isfile(file):
        return set()
    document = read_yaml(file)
    top, found = parameters(document, "robot_description_kinematics")
    for name in found:
        if name not in semantics.groups:
            raise UnknownNameError("group", name, semantics.groups, where=document.place((*top, name)))
    return set(found)
