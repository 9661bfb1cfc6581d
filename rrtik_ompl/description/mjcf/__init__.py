"""Load robots from MuJoCo's MJCF: bodies, hinges and slides, collision geometry, limits, sites, excluded pairs."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from rrtik_ompl.base.errors import InputError, few
from rrtik_ompl.description.faults import not_read, postures_outside, tell
from rrtik_ompl.description.gripper import gripper_of
from rrtik_ompl.description.joint_limits import LimitsFile, read_joint_limits
from rrtik_ompl.description.mjcf.read import WORLD, Mjcf, read_mjcf
from rrtik_ompl.description.robot_build import build_robot
from rrtik_ompl.description.robot_source import BasePose, source_entry
from rrtik_ompl.description.urdf_read import located
from rrtik_ompl.files.text import read_text
from rrtik_ompl.model.robot import Robot

MJCF_OPTIONS = ("base_pose", "gripper", "joint_limits", "joints", "locked", "strict", "tip")
BEGINNING = 65536  # characters at the beginning of a file among which the top element is sought


def is_mjcf(path: Path) -> bool:
    """Check whether a file is named ``.mjcf``, or is an ``.xml`` whose top element is ``<mujoco>``."""
    if path.suffix.lower() == ".xml":
        try:
            return "<mujoco" in read_text(path)[:BEGINNING]
        except InputError:  # Reading the file later reports this.
            return False
    return path.suffix.lower() == ".mjcf"


def robot_from_mjcf(
    path: str | os.PathLike[str],
    *,
    joints: Iterable[str] | None = None,
    tip: str | None = None,
    joint_limits: str | os.PathLike[str] | None = None,
    locked: Mapping[str, float] | None = None,
    gripper: Mapping[str, Mapping[str, float]] | None = None,
    base_pose: BasePose = None,
    strict: bool = False,
) -> Robot:
    """Load a robot from an MJCF file.

    Bodies and sites become links. Geoms that may collide (``contype``, ``conaffinity``) are collision geometry; meshes
    are used themselves, not their hulls. Solids of the world, and bodies on it that no hinge or slide moves, belong to
    the scene, which `load_scene` reads of the same file. ``<exclude>`` gives pairs of links that are never checked, the
    masks give such pairs of solids; what is welded to the world is checked against everything that moves, as in MuJoCo.
    ``<equality><joint>`` gives joints that follow others, keyframes give postures. Free joints are held where the file
    puts them. One warning names what is left out. MJCF has no limits of velocity: give ``joint_limits``.

    Args:
        path: The file; files that it includes are read too.
        joints: Actuated joints, in order; those that move ``tip``, or the tip of an arm, if None.
        tip: A body or site; that of the first arm if None.
        joint_limits: File in the format of MoveIt's ``joint_limits.yaml``.
        locked: Values of joints that are held fixed [rad or m].
        gripper: Joint values [rad or m] at which it is open and closed: ``{"open": {joint: value}, "closed": {..}}``.
        base_pose: ``pinocchio.SE3`` T_world_base.
        strict: Whether it is an error if anything is left out, or a keyframe is outside the limits.

    Raises:
        InputError: If anything in the file cannot be used; one line names file, element and remedy.
    """
    mjcf = read_mjcf(Path(path))
    options = {
        "joints": joints,
        "tip": tip,
        "joint_limits": joint_limits,
        "locked": locked,
        "gripper": gripper,
        "base_pose": base_pose,
    }
    joint_names = [joint.name for joint in mjcf.tree.joints]
    limits_file = LimitsFile() if joint_limits is None else read_joint_limits(joint_limits, joint_names)

    with located(str(path)):
        robot = build_robot(
            mjcf.name or Path(path).stem,
            mjcf.tree,
            joints=joints,
            mimics=mjcf.mimics,
            locked=locked,
            tip=tip,
            base_pose=base_pose,
            limits=limits_file.limits,
            postures=mjcf.postures,
            allowed_collisions=mjcf.excluded,
            checked_collisions=mjcf.touchable,
            unchecked_solids=mjcf.apart,
            loops=mjcf.loops,
            source={"mjcf": str(Path(path).resolve())} | source_entry(options),
        )
        robot = replace(robot, gripper=gripper_of(gripper, None, mjcf.tree, mjcf.mimics, robot, mjcf.loops))

    tell(
        [
            *(f"{path}: key '{name}': {fault}" for name, fault in postures_outside(robot, mjcf.postures)),
            *not_read(
                str(path),
                [*mjcf.unread, *([] if joints is None else _other_trees(mjcf, robot.joint_names, locked or {}))],
            ),
            *limits_file.faults,
        ],
        strict,
    )
    return robot


def _other_trees(mjcf: Mjcf, actuated: Sequence[str], locked: Mapping[str, float]) -> list[str]:
    """Return a line about held joints in trees without an actuated joint, which stand beside the robot, if any."""
    joint_above = {joint.child: joint for joint in mjcf.tree.joints}
    roots: dict[str, str] = {}  # for each joint, the body on the world that carries it
    for joint in mjcf.tree.walk():
        link = joint.child
        while joint_above[link].parent != WORLD:
            link = joint_above[link].parent
        roots[joint.name] = link

    robot_roots = {roots[joint] for joint in actuated if joint in roots}
    followers = {tie.joint for tie in mjcf.mimics if tie.source in actuated}
    held_joints = [
        f"'{joint.name}'"
        for joint in mjcf.tree.walk()
        if joint.moves and roots[joint.name] not in robot_roots and joint.name not in {*locked, *followers}
    ]
    return [f"joints beside the robot, held: {few(held_joints)}"] if held_joints else []
