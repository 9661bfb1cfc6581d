"""Define links and joints as plain values, and check that they form a tree.

Every description of a robot (URDF, DH table, planar arm) is first converted to links and joints, so that all of them
pass the same checks in Python, and no C++ parser reads an unchecked file.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Vector, bounded_array, frozen
from rrtik_ompl.base.errors import InputError, UnknownNameError, at_most, name_of
from rrtik_ompl.base.poses import rigid
from rrtik_ompl.model.shapes import Shape

MOST_JOINTS = 1001  # most joints of a tree: a thousand of an arm, and one that fixes its tip


@dataclass(frozen=True, slots=True)
class JointKind:
    """The properties of a type of joint; ``tree_model`` has its kinematics.

    Attributes:
        moves: Whether it has a value.
        slides: Whether the value is a displacement along its axis [m]; otherwise it is an angle about it [rad].
        endless: Whether it has no limits of position.
    """

    moves: bool = True
    slides: bool = False
    endless: bool = False


JOINT_KINDS = {
    "revolute": JointKind(),
    "continuous": JointKind(endless=True),
    "prismatic": JointKind(slides=True),
    "fixed": JointKind(moves=False),
}


@dataclass(frozen=True, slots=True)
class MeshFile:
    """A mesh in a file, with a scale for each axis; a negative scale mirrors.

    If ``painted``, its own materials are drawn where it has some, as RViz does; MuJoCo ignores them.
    """

    path: Path
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    painted: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Solid:
    """A shape fixed to a link.

    The shape must be a single solid for coal, as all shapes of URDF are (a polygon that is not convex would be
    several).

    Attributes:
        shape: The shape or mesh file.
        T_link_solid: Pose of the shape in the link's frame, ``pinocchio.SE3``.
        colour: Red, green, blue and opacity, from 0 to 1; None if not stated.
    """

    shape: Shape | MeshFile
    T_link_solid: Any = field(default_factory=pin.SE3.Identity)
    colour: tuple[float, float, float, float] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_link_solid", rigid(self.T_link_solid, "pose of a solid in its link"))


@dataclass(frozen=True, slots=True, eq=False)
class Link:
    """A rigid body with collision and visual solids; ``inertia`` is a ``pinocchio.Inertia`` in its frame, or None."""

    name: str
    collision: tuple[Solid, ...] = ()
    visual: tuple[Solid, ...] = ()
    inertia: Any | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Joint:
    """A joint by which ``child`` moves relative to ``parent``.

    Attributes:
        kind: One of ``JOINT_KINDS``.
        T_parent_joint: Pose of the joint frame (and of the child, at zero) in the parent link, ``pinocchio.SE3``.
        axis: Unit axis in the joint frame, shape (3,).
        lower, upper: Position limits [rad or m]; without meaning for continuous and fixed joints.
        velocity: Velocity limit [rad/s or m/s], inf if unknown.
        effort: Limit of torque or force [N m or N], inf if unknown.
    """

    name: str
    kind: str
    parent: str
    child: str
    T_parent_joint: Any
    axis: Vector
    lower: float
    upper: float
    velocity: float
    effort: float

    def __init__(
        self,
        name: str,
        kind: str,
        parent: str,
        child: str,
        T_parent_joint: pin.SE3 | None = None,
        axis: ArrayLike = (0.0, 0.0, 1.0),
        *,
        lower: float = -np.pi,
        upper: float = np.pi,
        velocity: float = np.inf,
        effort: float = np.inf,
    ) -> None:
        if kind not in JOINT_KINDS:
            raise UnknownNameError("joint type", kind, JOINT_KINDS, where=f"joint '{name}'")

        direction = bounded_array(axis, (3,), f"joint '{name}': axis")
        length = float(np.linalg.norm(direction))
        if length < 1e-9:
            raise InputError(f"joint '{name}': axis is the zero vector; give a direction such as 0 0 1")

        where = f"joint '{name}': pose in its parent"
        values = {
            "name": name,
            "kind": kind,
            "parent": parent,
            "child": child,
            "T_parent_joint": pin.SE3.Identity() if T_parent_joint is None else rigid(T_parent_joint, where),
            "axis": frozen(direction / length),
            "lower": lower,
            "upper": upper,
            "velocity": velocity,
            "effort": effort,
        }
        for key, value in values.items():
            object.__setattr__(self, key, value)

    @property
    def moves(self) -> bool:
        """Return whether the joint has a value."""
        return JOINT_KINDS[self.kind].moves

    @property
    def slides(self) -> bool:
        """Return whether the joint's value is a displacement [m]; otherwise it is an angle [rad]."""
        return JOINT_KINDS[self.kind].slides

    @property
    def endless(self) -> bool:
        """Return whether the joint has no limits of position."""
        return JOINT_KINDS[self.kind].endless


@dataclass(frozen=True, slots=True, eq=False)
class Tree:
    """Links and joints that were checked to form one tree.

    Attributes:
        where: File or name put in front of error messages.
        links, joints: Links and joints, in the order of the description.
    """

    where: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]

    def __init__(self, where: str, links: Sequence[Link], joints: Sequence[Joint]) -> None:
        at_most(len(joints), MOST_JOINTS, f"{where}: joints")
        object.__setattr__(self, "where", where)
        object.__setattr__(self, "links", tuple(links))
        object.__setattr__(self, "joints", tuple(joints))
        _check_names(self)
        _check_connected(self)

    @property
    def root(self) -> Link:
        """Return the link that is no joint's child."""
        children = {joint.child for joint in self.joints}
        return next(link for link in self.links if link.name not in children)

    def walk(self) -> Iterator[Joint]:
        """Yield all joints depth first, parents before children."""
        child_joints: dict[str, list[Joint]] = {link.name: [] for link in self.links}
        for joint in self.joints:
            child_joints[joint.parent].append(joint)

        stack = child_joints[self.root.name][::-1]
        while stack:
            joint = stack.pop()
            yield joint
            stack += child_joints[joint.child][::-1]

    def chain(self, tip: str, base: str | None = None) -> tuple[Joint, ...]:
        """Return the joints from ``base`` (the root if None) to the link ``tip``, in that order.

        Raises:
            UnknownNameError: If one of the two is no link.
            InputError: If ``tip`` is not below ``base``.
        """
        names = [link.name for link in self.links]
        joint_above = {joint.child: joint for joint in self.joints}

        for link in (tip, base):
            if link is not None and link not in names:
                raise UnknownNameError("link", link, names, where=self.where)

        joints: list[Joint] = []
        link = tip
        while link != base and link in joint_above:
            joints.append(joint_above[link])
            link = joint_above[link].parent

        if base is not None and link != base:
            raise InputError(f"{self.where}: link '{tip}' does not hang on link '{base}'; swap them or choose others")
        return tuple(reversed(joints))

    def hold(self, values: Mapping[str, float]) -> Tree:
        """Return the same tree with the named joints fixed at the given values [rad or m]."""
        joints = [_fixed_at(joint, values[joint.name]) if joint.name in values else joint for joint in self.joints]
        return Tree(self.where, self.links, joints)


def _fixed_at(joint: Joint, value: float) -> Joint:
    axis = np.array(joint.axis)
    motion = pin.SE3(np.eye(3), value * axis) if joint.slides else pin.SE3(pin.exp3(value * axis), np.zeros(3))
    return Joint(joint.name, "fixed", joint.parent, joint.child, joint.T_parent_joint * motion, axis)


def _check_names(tree: Tree) -> None:
    """Raise an error if names are missing, duplicate or not valid, or a joint refers to an unknown link."""
    if not tree.links:
        raise InputError(f"{tree.where}: no link; a robot needs at least one")
    for what, names in (("link", [x.name for x in tree.links]), ("joint", [x.name for x in tree.joints])):
        duplicates = [name for name, count in Counter(names).items() if count > 1]
        if duplicates:
            raise InputError(f"{tree.where}: {what} name '{duplicates[0]}' stands there twice; rename one")
        for name in names:
            name_of(name, f"a {what} of {tree.where}")

    link_names = {link.name for link in tree.links}
    for joint in tree.joints:
        for role, link in (("parent", joint.parent), ("child", joint.child)):
            if link not in link_names:
                raise UnknownNameError(f"{role} link", link, link_names, where=f"{tree.where}: joint '{joint.name}'")


def _check_connected(tree: Tree) -> None:
    """Raise an error unless the joints connect all links to one tree."""
    above: dict[str, Joint] = {}
    for joint in tree.joints:
        if joint.child in above:
            raise InputError(
                f"{tree.where}: link '{joint.child}' is the child of two joints ('{above[joint.child].name}' and "
                f"'{joint.name}'); a robot must be a tree, cut the loop by deleting one"
            )
        above[joint.child] = joint

    roots = [link.name for link in tree.links if link.name not in above]
    if len(roots) > 1:
        raise InputError(
            f"{tree.where}: {len(roots)} links hang on nothing ({', '.join(roots[:6])}); "
            "connect all but the base by joints"
        )

    reached = {joint.child for joint in tree.walk()} if roots else set()
    lost = [joint.name for joint in tree.joints if joint.child not in reached]
    if lost:
        raise InputError(f"{tree.where}: joints {', '.join(lost[:6])} form a loop that hangs on nothing; cut the loop")
