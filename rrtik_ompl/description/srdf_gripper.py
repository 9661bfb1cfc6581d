"""The gripper that an SRDF describes: an end effector whose group of joints has states called open and closed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from itertools import combinations
from typing import Any

import coal
import pinocchio as pin

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.description.gripper import GripperJoints
from rrtik_ompl.description.robot_build import Mimic
from rrtik_ompl.description.srdf import Srdf
from rrtik_ompl.description.tree import Tree
from rrtik_ompl.description.tree_model import build_models

NAMES = {"open": ("open", "opened"), "closed": ("closed", "close")}  # of states, in lower case


def srdf_gripper(semantics: Srdf, tree: Tree, mimics: Iterable[Mimic], actuated: Iterable[str]) -> GripperJoints | None:
    """The gripper at the end of the actuated joints, if there is one and no more.

    Its width is how much farther its fingers' solids are apart where it is open than where it is closed.
    """
    ties = tuple(mimics)
    arm = set(actuated)
    followers = {tie.joint for tie in ties}
    found: dict[tuple[str, ...], GripperJoints] = {}

    for end in semantics.end_effectors:
        if end.group not in semantics.groups or not _carries(tree, end.parent_link, arm):
            continue
        try:
            joints = tuple(joint for joint in semantics.movable(end.group, tree) if joint not in followers)
        except InputError:  # an SRDF for several forms of a robot, of which this one has no such hand
            continue

        states = [_state(semantics, end.group, joints, names) for names in NAMES.values()]
        if joints and not arm & set(joints) and None not in states:
            opened, closed = (dict(zip(joints, state or (), strict=True)) for state in states)
            width = max(_apart(tree, ties, opened) - _apart(tree, ties, closed), 0.0)
            found[joints] = GripperJoints(joints, tuple(opened.values()), tuple(closed.values()), width)

    return next(iter(found.values())) if len(found) == 1 else None


def _carries(tree: Tree, link: str, arm: set[str]) -> bool:
    """Whether a link is there and any of some joints moves it."""
    return any(link == each.name for each in tree.links) and any(joint.name in arm for joint in tree.chain(link))


def _state(semantics: Srdf, group: str, joints: tuple[str, ...], names: tuple[str, ...]) -> tuple[float, ...] | None:
    """Values of the joints in the state of a group that has one of the names, or the only one with a name inside its.

    A state that does not have all joints counts for none.
    """
    whole = {
        state.lower(): values
        for (owner, state), values in semantics.states.items()
        if owner == group and all(joint in values for joint in joints)
    }
    inside = [state for state in whole if names[-1] in state or names[0] in state]
    named = next((name for name in names if name in whole), inside[0] if len(inside) == 1 else None)
    return None if named is None else tuple(whole[named][joint] for joint in joints)


def _apart(tree: Tree, mimics: tuple[Mimic, ...], values: Mapping[str, float]) -> float:
    """Least distance of the solids of different fingers where the gripper's joints have values [m]; 0 if unknown."""
    held = dict(values) | {
        tie.joint: tie.multiplier * values[tie.source] + tie.offset for tie in mimics if tie.source in values
    }

    above: dict[str, str] = {}  # for each link of a finger the joint that carries the finger
    for joint in tree.walk():
        if joint.parent in above or joint.name in held:
            above[joint.child] = above.get(joint.parent, joint.name)

    links = [link if link.name in above else replace(link, collision=()) for link in tree.links]
    bare = Tree(tree.where, links, tree.joints)
    still = {joint.name: held.get(joint.name, 0.0) for joint in tree.joints if joint.moves}
    model, solids, _ = build_models(bare.hold(still))

    fingers: dict[str, list[Any]] = {}
    for solid in solids.geometryObjects:
        fingers.setdefault(above[model.frames[solid.parentFrame].name], []).append(solid)

    pairs = [(a, b) for one, other in combinations(fingers.values(), 2) for a in one for b in other]
    return max(min((_distance(a, b) for a, b in pairs), default=0.0), 0.0)


def _distance(first: pin.GeometryObject, second: pin.GeometryObject) -> float:
    ends = [coal.Transform3s(each.placement.rotation, each.placement.translation) for each in (first, second)]
    found = coal.DistanceResult()
    return float(coal.distance(first.geometry, ends[0], second.geometry, ends[1], coal.DistanceRequest(), found))
