"""Load robots from URDF files or text, with SRDF (groups, postures, allowed collisions) and ``joint_limits.yaml``."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rrtik_ompl.base.errors import InputError, MeshWarning, UnknownNameError
from rrtik_ompl.description.arm import arms_of
from rrtik_ompl.description.faults import not_read, postures_outside, tell
from rrtik_ompl.description.gripper import gripper_of
from rrtik_ompl.description.robot_build import JointLimits, build_robot, drivers_of, merge_limits
from rrtik_ompl.description.robot_source import source_entry
from rrtik_ompl.description.srdf import Srdf, read_srdf
from rrtik_ompl.description.tree import Tree
from rrtik_ompl.description.urdf_read import UrdfDescription, located, read_urdf
from rrtik_ompl.description.xacro_text import robot_text
from rrtik_ompl.model.gripper import GripperJoints
from rrtik_ompl.model.robot import LIMIT_TOLERANCE, Robot

if TYPE_CHECKING:
    from rrtik_ompl.description.joint_limits import LimitsFile
    from rrtik_ompl.description.robot_source import BasePose


FilePath = str | os.PathLike[str]
URDF_OPTIONS = (
    "base_pose",
    "gripper",
    "group",
    "joint_limits",
    "joints",
    "locked",
    "packages",
    "srdf",
    "strict",
    "tip",
    "xacro_args",
)


def robot_from_urdf(
    path: FilePath, *, name: str | None = None, xacro_args: Mapping[str, object] | None = None, **options: Any
) -> Robot:
    """Load a robot from a URDF file.

    Args:
        path: The URDF; one named ``.xacro`` is expanded by the package xacro.
        name: Name for messages; the URDF's own if None.
        xacro_args: Arguments of its macros by name.
        **options: Options of `robot_from_urdf_text`.

    Raises:
        InputError: If anything in the files or options cannot be used; one line names file, element and remedy.
    """
    text = robot_text(Path(path), package_roots(options.get("packages", ())), xacro_args)
    file = Path(path).resolve()
    options = {"source": {"urdf": str(file)} | source_entry(options | {"xacro_args": xacro_args})} | options
    return robot_from_urdf_text(text, name=name, where=str(path), folder=file.parent, **options)


def robot_from_urdf_text(
    text: str,
    *,
    name: str | None = None,
    where: str = "URDF text",
    folder: FilePath | None = None,
    srdf: FilePath | None = None,
    group: str | None = None,
    joints: Iterable[str] | None = None,
    tip: str | None = None,
    joint_limits: FilePath | None = None,
    packages: FilePath | Iterable[FilePath] = (),
    locked: Mapping[str, float] | None = None,
    gripper: Mapping[str, Mapping[str, float]] | None = None,
    base_pose: BasePose = None,
    limits: Mapping[str, JointLimits] | None = None,
    postures: Mapping[str, Mapping[str, float]] | None = None,
    allowed_collisions: Iterable[Iterable[str]] = (),
    self_collision: bool = True,
    closed_form: Callable[..., Any] | None = None,
    source: Mapping[str, Any] | None = None,
    strict: bool = False,
) -> Robot:
    """Load a robot from URDF text.

    The actuated joints are, in this order of precedence: ``joints``; those of ``group``; those between the base and
    ``tip``; those that move the tip of an arm (`rrtik_ompl.description.arm`). Every other joint is held fixed. Soft
    limits (``safety_controller``) are not used: put the limits you want into ``joint_limits``.

    Args:
        text: The XML.
        name: Name for messages; the URDF's own if None.
        where: What error messages call the text (its file name).
        folder: Folder relative to which meshes are named.
        srdf: SRDF file; one named ``.xacro`` is expanded. It also describes the robot's gripper: an end effector whose
            group has states called open and closed.
        group: Group of the SRDF whose joints are actuated; its end is the default tip.
        joints: Actuated joints, in the order wanted.
        tip: Link that goals refer to.
        joint_limits: File in the format of MoveIt's ``joint_limits.yaml``.
        packages: Folders in which ``package://`` names are sought first.
        locked: Values of joints that are held fixed [rad or m]; by default 0, moved into the limits.
        gripper: Joint values at which it is open and closed [rad or m]: ``{"open": {joint: 0.04}, "closed": {..}}``; by
            default those of the SRDF, or else what follows from the shape of the fingers.
        base_pose: ``pinocchio.SE3`` T_world_base.
        limits: Limits that replace those of the URDF and of ``joint_limits``, by joint name.
        postures: Further named postures.
        allowed_collisions: Pairs of links that are never checked, in addition to those of the SRDF.
        self_collision: Whether links are checked against each other.
        closed_form: The robot's own inverse kinematics.
        source: The entry ``robot`` of a problem file for this robot.
        strict: Whether what is otherwise a warning becomes an error: names in the SRDF that the robot does not have,
            postures outside the limits, and statements about shapes, joints or limits that are not read.

    Raises:
        InputError: If anything in the text, the files or the options cannot be used.
    """
    roots = package_roots(packages)
    home = None if folder is None else Path(folder)
    description = read_urdf(text, where=where, folder=home, packages=roots)
    tree = description.tree
    if description.undrawn:
        warnings.warn(MeshWarning(description.undrawn), stacklevel=2)

    semantics = Srdf(where) if srdf is None else read_srdf(robot_text(Path(srdf), roots), str(srdf))
    if group is not None and srdf is None:
        raise InputError(f"{where}: group '{group}' needs an SRDF file; give srdf=FILE, or joints=[...] in its place")

    actuated = _actuated(description, semantics, group, joints)
    fingers = semantics.fingers(tree)
    end = tip
    if tip is None and group is not None and not _several_arms(description, actuated or (), fingers):
        end = semantics.group_tip(group, tree)
    limits_file = None if joint_limits is None else _limits_of_file(joint_limits, tree)

    with located(where):
        robot = build_robot(
            name or description.name or Path(where).stem,
            tree,
            joints=actuated,
            mimics=description.mimics,
            locked=locked,
            tip=end,
            base_pose=base_pose,
            limits=merge_limits({} if limits_file is None else limits_file.limits, limits or {}),
            postures=semantics.postures(group) | {key: dict(value) for key, value in (postures or {}).items()},
            allowed_collisions=[*semantics.allowed_pairs(tree), *allowed_collisions],
            checked_collisions=semantics.checked,
            fingers=fingers,
            self_collision=self_collision,
            closed_form=closed_form,
            source=source,
        )
        robot = replace(robot, gripper=gripper_of(gripper, semantics, tree, description.mimics, robot))

    tell(
        [
            *semantics.of_another(description.name, where),
            *semantics.unknown_names(tree),
            *semantics.moved_passive(robot.joint_names if joints is None else ()),
            *semantics.short_states(group, robot.joint_names),
            *_outside(robot, postures or {}, semantics, group),
            *_hand_outside(robot.gripper, tree, semantics),
            *description.mended,
            *not_read(where, description.unread),
            *(() if limits_file is None else limits_file.faults),
        ],
        strict,
    )
    return robot


def package_roots(packages: FilePath | Iterable[FilePath]) -> list[Path]:
    """Return the folders of packages, given as one or several, as a list."""
    return [Path(each) for each in ([packages] if isinstance(packages, (str, os.PathLike)) else packages)]


def _actuated(
    description: UrdfDescription, semantics: Srdf, group: str | None, joints: Iterable[str] | None
) -> tuple[str, ...] | None:
    """Return the names of the actuated joints if they are given, or are those of a group; else None."""
    tree = description.tree
    followers = {tie.joint for tie in description.mimics}

    if joints is not None:
        chosen = tuple(joints)
        movable = tuple(j.name for j in tree.walk() if j.moves and j.name not in followers)
        for joint in chosen:
            if joint not in movable and joint not in followers:
                raise UnknownNameError("movable joint", joint, movable, where=tree.where)
        return chosen

    if group is not None:
        members = semantics.group_joints(group, tree)
        return tuple(joint for joint in members if joint not in followers)
    return None


def _several_arms(description: UrdfDescription, joints: Iterable[str], fingers: Collection[str]) -> bool:
    """Check whether joints move more than one arm, so that their group has no single tip."""
    drivers = drivers_of(description.mimics)
    return len(arms_of(description.tree, drivers, fingers=fingers).moved_by(set(joints))) > 1


def _limits_of_file(file: FilePath, tree: Tree) -> LimitsFile:
    """Return what a file says of the limits of a robot's joints."""
    from rrtik_ompl.description.joint_limits import read_joint_limits  # Most robots need no YAML.

    return read_joint_limits(file, [joint.name for joint in tree.joints])


def _outside(robot: Robot, others: Collection[str], semantics: Srdf, group: str | None) -> Iterator[str]:
    """Yield a line for each posture of an SRDF, except those in ``others``, that is outside the robot's limits."""
    own_postures = {name: values for name, values in semantics.postures(group).items() if name not in others}
    for name, fault in postures_outside(robot, own_postures):
        yield f"{semantics.place_of(name, group)}: posture '{name}': {fault}"


def _hand_outside(gripper: GripperJoints | None, tree: Tree, semantics: Srdf) -> Iterator[str]:
    """Yield a line for each joint of a gripper that one of its states puts outside its limits."""
    if gripper is None:
        return
    ranges = {joint.name: (joint.lower, joint.upper) for joint in tree.joints if not joint.endless}
    for name, *values in zip(gripper.joints, gripper.opened, gripper.closed, strict=True):
        low, high = ranges.get(name, (-np.inf, np.inf))
        for value in values:
            if not low - LIMIT_TOLERANCE <= value <= high + LIMIT_TOLERANCE:
                yield (
                    f"{semantics.where}: a state of the gripper: joint '{name}' is at {value:g}, outside its limits "
                    f"{low:g} .. {high:g}"
                )
