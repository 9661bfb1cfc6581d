"""Find the joints of a gripper, which are held fixed while the arm moves; tasks change their values."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import combinations
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import finite_number
from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.description.arm import arms_of
from rrtik_ompl.description.robot_build import Mimic, drivers_of
from rrtik_ompl.description.srdf import Srdf
from rrtik_ompl.description.tree import Link, Tree
from rrtik_ompl.model.gripper import STATES, GripperJoints
from rrtik_ompl.model.robot import Robot

MOST_JOINTS = 6  # most joints of a hand that opens and closes as one
NAMES = {"open": ("open", "opened"), "closed": ("closed", "close")}  # names of states, in lower case


def gripper_of(
    given: Mapping[str, Mapping[str, float]] | None,
    semantics: Srdf | None,
    tree: Tree,
    mimics: Iterable[Mimic],
    robot: Robot,
    loops: Collection[str] = (),
) -> GripperJoints | None:
    """Return the gripper that a user describes, else that of the SRDF, else the one found by its shape, if any.

    Raises:
        InputError: If what the user says cannot be.
    """
    ties = tuple(mimics)
    if given is not None:
        return given_gripper(given, tree, ties, robot)
    if semantics is None:
        return found_gripper(tree, ties, robot, loops)
    described = srdf_gripper(semantics, tree, ties, robot)
    return described or found_gripper(tree, ties, robot, loops, semantics.fingers(tree))


def srdf_gripper(semantics: Srdf, tree: Tree, mimics: Iterable[Mimic], robot: Robot) -> GripperJoints | None:
    """Return the gripper that an SRDF describes at the end of the actuated joints; None unless there is just one.

    Its width is the distance of the fingers' solids in the open state minus that in the closed state.

    Args:
        semantics: The SRDF.
        tree: Links and joints of the robot.
        mimics: Joints that follow others.
        robot: The robot that was made of them.
    """
    hand = _Hand(tree, tuple(mimics), robot)
    arm = set(robot.joint_names)
    gripper_by_joints: dict[tuple[str, ...], GripperJoints] = {}

    for end in semantics.end_effectors:
        if end.group not in semantics.groups or not _carries(tree, end.parent_link, arm):
            continue
        try:
            joints = tuple(joint for joint in semantics.movable(end.group, tree) if joint not in hand.drivers)
        except InputError:  # The SRDF may be for several variants of a robot, of which this one lacks the hand.
            continue

        states = [_named_state(semantics, end.group, joints, names) for names in NAMES.values()]
        if joints and not arm & set(joints) and None not in states:
            opened, closed = (dict(zip(joints, state or (), strict=True)) for state in states)
            gripper_by_joints[joints] = hand.gripper(opened, closed, end.group)

    return next(iter(gripper_by_joints.values())) if len(gripper_by_joints) == 1 else None


def found_gripper(
    tree: Tree, mimics: Iterable[Mimic], robot: Robot, loops: Collection[str] = (), fingers: Collection[str] = ()
) -> GripperJoints | None:
    """Return the gripper at the end of the only arm that moves, from the shape of its fingers; None if there is none.

    Each joint of a finger is open at the limit at which the fingers are further apart (the means of their solids); a
    single finger is compared with the link that carries it; without solids, at the upper limit. Hands of many joints,
    fingers without limits, and those in a loop are left out.

    Args:
        tree: Links and joints of the robot.
        mimics: Joints that follow others.
        robot: The robot that was made of them.
        loops: Joints in loops.
        fingers: Joints that are known to be those of fingers.
    """
    hand = _Hand(tree, tuple(mimics), robot)
    limbs = arms_of(tree, hand.drivers, loops, fingers=fingers).moved_by(robot.joint_names)
    if len(limbs) != 1 or not set(limbs[0].fingers).isdisjoint({*robot.joint_names, *loops}):
        return None

    ranges = {joint.name: (joint.lower, joint.upper) for joint in tree.walk() if joint.name in limbs[0].fingers}
    joints = {name: ends for name, ends in ranges.items() if np.isfinite(ends).all() and ends[0] < ends[1]}
    branches = hand.fingers(joints)
    if not joints or len(joints) > min(MOST_JOINTS, 2 * len(branches)):
        return None

    middle = {name: 0.5 * (lower + upper) for name, (lower, upper) in joints.items()}
    opened, closed = {}, {}
    for name, ends in joints.items():
        spreads = [hand.spread(middle | {name: end}, limbs[0].links) for end in ends]
        closed[name], opened[name] = ends if spreads[1] >= spreads[0] else ends[::-1]
    return hand.gripper(opened, closed)


def given_gripper(
    given: Mapping[str, Mapping[str, float]], tree: Tree, mimics: Iterable[Mimic], robot: Robot
) -> GripperJoints:
    """Return the gripper that a user describes: ``{"open": {joint: value}, "closed": {joint: value}}``.

    Raises:
        InputError: If the states do not have values of the same joints, or these are no joints that are held.
    """
    where = f"robot '{robot.name}': gripper"
    if set(given) != set(STATES) or not all(isinstance(values, Mapping) and values for values in given.values()):
        raise InputError(f"{where}: give joint values by name for open and closed: {{open: {{..}}, closed: {{..}}}}")

    hand = _Hand(tree, tuple(mimics), robot)
    opened, closed = ({str(joint): finite_number(value, where) for joint, value in given[s].items()} for s in STATES)
    choice = [joint for joint in robot.movable if joint not in hand.drivers and joint not in robot.joint_names]
    for joint in (*opened, *closed):
        if joint not in choice:
            raise UnknownNameError("joint that is held still", joint, choice, where=where)
    if set(opened) != set(closed):
        raise InputError(f"{where}: open and closed have values of different joints; give both for each joint")
    return hand.gripper(opened, closed)


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


class _Hand:
    """The solids of a robot where its fingers are moved."""

    def __init__(self, tree: Tree, mimics: Sequence[Mimic], robot: Robot) -> None:
        self.tree = tree
        self.mimics = mimics
        self.drivers = drivers_of(mimics)
        self.geometries = {item.name: item.geometry for item in robot.collision.geometryObjects}

    def gripper(self, opened: Mapping[str, float], closed: Mapping[str, float], name: str = "") -> GripperJoints:
        """Return the gripper with these states, how far it opens, and the limits of its joints."""
        width = max(self.distance(opened) - self.distance(closed), 0.0)
        by_name = {joint.name: joint for joint in self.tree.joints}
        joints = [by_name[joint] for joint in opened]
        velocity = tuple(joint.velocity for joint in joints)
        return GripperJoints(
            tuple(opened),
            tuple(opened.values()),
            tuple(closed[joint] for joint in opened),
            width,
            name,
            tuple(joint.slides for joint in joints),
            velocity if np.isfinite(velocity).all() and min(velocity) > 0.0 else (),
        )

    def fingers(self, joints: Collection[str]) -> dict[str, list[Link]]:
        """Return the links of each finger that the joints move, by its first joint."""
        first: dict[str, str] = {}  # for each link of a finger, the joint that moves the whole finger
        for joint in self.tree.walk():
            if joint.parent in first or joint.name in joints or self.drivers.get(joint.name) in joints:
                first[joint.child] = first.get(joint.parent, joint.name)

        fingers: dict[str, list[Link]] = {}
        for link in self.tree.links:
            if link.name in first:
                fingers.setdefault(first[link.name], []).append(link)
        return fingers

    def distance(self, values: Mapping[str, float]) -> float:
        """Return the least distance between solids of different fingers [m]; 0 if it is unknown."""
        poses = self._poses(values)
        fingers = [self._solids(links, poses) for links in self.fingers(values).values()]
        pairs = [(a, b) for first, second in combinations(fingers, 2) for a in first for b in second]
        return max(min((_distance(a, b) for a, b in pairs), default=0.0), 0.0)

    def spread(self, values: Mapping[str, float], palm: Collection[str]) -> float:
        """Return the mean distance of the fingers' middles [m], of a single finger that from the palm."""
        poses = self._poses(values)
        parts = list(self.fingers(values).values())
        if len(parts) == 1:
            parts.append([link for link in self.tree.links if link.name in palm])
        middles = [
            np.mean([pose.act(geometry.aabb_center) for geometry, pose in solids], axis=0)
            for solids in (self._solids(links, poses) for links in parts)
            if solids
        ]
        apart = [float(np.linalg.norm(a - b)) for a, b in combinations(middles, 2)]
        return sum(apart) / max(len(apart), 1)

    def _solids(self, links: Iterable[Link], poses: Mapping[str, pin.SE3]) -> list[tuple[Any, pin.SE3]]:
        """Return the solids of links, each with its pose."""
        found = []
        for link in links:
            for number, solid in enumerate(link.collision):
                geometry = self.geometries[f"{link.name}_{number}"]
                geometry.computeLocalAABB()
                found.append((geometry, poses[link.name] * solid.T_link_solid))
        return found

    def _poses(self, values: Mapping[str, float]) -> dict[str, pin.SE3]:
        """Return the pose of each link in the base; joints without a value are at 0."""
        followed = {t.joint: t.multiplier * values[t.source] + t.offset for t in self.mimics if t.source in values}
        poses = {self.tree.root.name: pin.SE3.Identity()}
        at_values = self.tree.hold({**dict.fromkeys(self._moving(), 0.0), **values, **followed})
        for joint in at_values.walk():
            poses[joint.child] = poses[joint.parent] * joint.T_parent_joint
        return poses

    def _moving(self) -> list[str]:
        return [joint.name for joint in self.tree.joints if joint.moves]


def _distance(first: tuple[Any, pin.SE3], second: tuple[Any, pin.SE3]) -> float:
    (a, pose_a), (b, pose_b) = first, second
    poses = [coal.Transform3s(pose.rotation, pose.translation) for pose in (pose_a, pose_b)]
    return float(coal.distance(a, poses[0], b, poses[1], coal.DistanceRequest(), coal.DistanceResult()))
