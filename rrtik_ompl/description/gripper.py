"""Model the joints of a gripper, which are held fixed while the arm moves; tasks change their values."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import coal
import pinocchio as pin

from rrtik_ompl.base.arrays import finite_number
from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.description.robot_build import Mimic
from rrtik_ompl.description.srdf import Srdf
from rrtik_ompl.description.tree import Tree
from rrtik_ompl.description.tree_model import build_models

STATES = ("open", "closed")
NAMES = {"open": ("open", "opened"), "closed": ("closed", "close")}  # names of states, in lower case


@dataclass(frozen=True, slots=True)
class GripperJoints:
    """The joints of a gripper, and how far it opens.

    The methods return joint values that `rrtik_ompl.load_robot` takes as ``locked``.

    Attributes:
        joints: Names of the joints, without those that mimic them.
        opened, closed: Their values in the open and in the closed state [rad or m].
        width: Distance between the fingers in the open state minus that in the closed state [m]; in between, it is
            taken as proportional; 0 if it is not known.

    Example:
        >>> import rrtik_ompl as rrtik
        >>> hand = rrtik.load_robot("panda").gripper
        >>> hand.close_on(0.05)
        {'panda_finger_joint1': 0.025}
        >>> holding = rrtik.load_robot("panda", locked=hand.close_on(0.05))
    """

    joints: tuple[str, ...]
    opened: tuple[float, ...]
    closed: tuple[float, ...]
    width: float

    def posture(self, state: str) -> dict[str, float]:
        """Return the joint values by name in the state "open" or "closed" ("close" is the same).

        Raises:
            UnknownNameError: If the state is another one.
        """
        if state not in (*STATES, "close"):
            raise UnknownNameError("state of a gripper", state, STATES)
        return dict(zip(self.joints, self.opened if state == "open" else self.closed, strict=True))

    def close_on(self, width: float) -> dict[str, float]:
        """Return the joint values by name at which the fingers are a width [m] apart.

        Raises:
            InputError: If the gripper does not open so far.
        """
        wanted = finite_number(width, "width of a gripper")
        if self.width == 0.0:
            raise InputError("width of a gripper: how far this one opens is not known; use its states open and closed")
        if not 0.0 <= wanted <= self.width:
            raise InputError(f"width of a gripper: it opens from 0 to {self.width:g} m, got {wanted:g}")

        share = wanted / self.width
        values = (shut + share * (wide - shut) for shut, wide in zip(self.closed, self.opened, strict=True))
        return dict(zip(self.joints, values, strict=True))


def srdf_gripper(semantics: Srdf, tree: Tree, mimics: Iterable[Mimic], actuated: Iterable[str]) -> GripperJoints | None:
    """Return the gripper at the end of the actuated joints; None if there is none, or more than one.

    Its width is the distance of the fingers' solids in the open state minus that in the closed state.

    Args:
        semantics: The SRDF.
        tree: Links and joints of the robot.
        mimics: Joints that follow others.
        actuated: Names of the actuated joints.
    """
    mimics_read = tuple(mimics)
    arm = set(actuated)
    followers = {tie.joint for tie in mimics_read}
    gripper_by_joints: dict[tuple[str, ...], GripperJoints] = {}

    for end in semantics.end_effectors:
        if end.group not in semantics.groups or not _carries(tree, end.parent_link, arm):
            continue
        try:
            joints = tuple(joint for joint in semantics.movable(end.group, tree) if joint not in followers)
        except InputError:  # The SRDF may be for several variants of a robot, of which this one lacks the hand.
            continue

        states = [_named_state(semantics, end.group, joints, names) for names in NAMES.values()]
        if joints and not arm & set(joints) and None not in states:
            opened, closed = (dict(zip(joints, state or (), strict=True)) for state in states)
            width = max(_finger_distance(tree, mimics_read, opened) - _finger_distance(tree, mimics_read, closed), 0.0)
            gripper_by_joints[joints] = GripperJoints(joints, tuple(opened.values()), tuple(closed.values()), width)

    return next(iter(gripper_by_joints.values())) if len(gripper_by_joints) == 1 else None


def _carries(tree: Tree, link: str, arm: set[str]) -> bool:
    """Check whether a link exists and is moved by one of the joints."""
    return any(link == candidate.name for candidate in tree.links) and any(
        joint.name in arm for joint in tree.chain(link)
    )


def _named_state(
    semantics: Srdf, group: str, joints: tuple[str, ...], names: tuple[str, ...]
) -> tuple[float, ...] | None:
    """Return the joint values in a group's state of one of the names, or in the only state that contains one of them.

    States that do not have values for all joints are ignored; None if no state fits.
    """
    complete_states = {
        state.lower(): values
        for (owner, state), values in semantics.states.items()
        if owner == group and all(joint in values for joint in joints)
    }
    similar_names = [state for state in complete_states if names[-1] in state or names[0] in state]
    state = next(
        (name for name in names if name in complete_states), similar_names[0] if len(similar_names) == 1 else None
    )
    return None if state is None else tuple(complete_states[state][joint] for joint in joints)


def _finger_distance(tree: Tree, mimics: tuple[Mimic, ...], values: Mapping[str, float]) -> float:
    """Return the least distance between solids of different fingers at given joint values [m]; 0 if it is unknown."""
    joint_values = dict(values) | {
        tie.joint: tie.multiplier * values[tie.source] + tie.offset for tie in mimics if tie.source in values
    }

    carrying_joint: dict[str, str] = {}  # for each link of a finger, the joint that moves the whole finger
    for joint in tree.walk():
        if joint.parent in carrying_joint or joint.name in joint_values:
            carrying_joint[joint.child] = carrying_joint.get(joint.parent, joint.name)

    links = [link if link.name in carrying_joint else replace(link, collision=()) for link in tree.links]
    fingers_only = Tree(tree.where, links, tree.joints)
    all_values = {joint.name: joint_values.get(joint.name, 0.0) for joint in tree.joints if joint.moves}
    model, solids, _ = build_models(fingers_only.hold(all_values))

    fingers: dict[str, list[Any]] = {}
    for solid in solids.geometryObjects:
        fingers.setdefault(carrying_joint[model.frames[solid.parentFrame].name], []).append(solid)

    pairs = [(a, b) for first, second in combinations(fingers.values(), 2) for a in first for b in second]
    return max(min((_distance(a, b) for a, b in pairs), default=0.0), 0.0)


def _distance(first: pin.GeometryObject, second: pin.GeometryObject) -> float:
    poses = [coal.Transform3s(each.placement.rotation, each.placement.translation) for each in (first, second)]
    result = coal.DistanceResult()
    return float(coal.distance(first.geometry, poses[0], second.geometry, poses[1], coal.DistanceRequest(), result))
