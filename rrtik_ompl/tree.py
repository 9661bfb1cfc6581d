"""Links and joints as plain values, the checks that make them a tree, and the Pinocchio models of that tree.

Every description of a robot (URDF, DH table, a planar arm) becomes links and joints first, so that all of them pass the
same checks in Python and no C++ parser meets a file that nobody has checked.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.arrays import Vector, finite_array, frozen
from rrtik_ompl.errors import InputError, UnknownNameError
from rrtik_ompl.shapes import Box, Capsule, Cylinder, Sphere
from rrtik_ompl.solids import pieces

KINDS = ("revolute", "continuous", "prismatic", "fixed")
GREY = (0.7, 0.7, 0.7, 1.0)


@dataclass(frozen=True, slots=True)
class MeshFile:
    """A mesh in a file, with a scale per axis (URDF allows three numbers, a negative one mirrors)."""

    path: Path
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class Solid:
    """A shape fixed to a link: ``T_link_solid`` is a ``pinocchio.SE3``, ``colour`` is red, green, blue, opacity."""

    shape: Box | Sphere | Cylinder | Capsule | MeshFile
    T_link_solid: Any = field(default_factory=pin.SE3.Identity)
    colour: tuple[float, float, float, float] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Link:
    """A rigid body. ``inertia`` is a ``pinocchio.Inertia`` in the link's frame, if known."""

    name: str
    collision: tuple[Solid, ...] = ()
    visual: tuple[Solid, ...] = ()
    inertia: Any | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Joint:
    """What lets ``child`` move against ``parent``.

    Attributes:
        kind: One of ``KINDS``.
        T_parent_joint: Joint frame (and child frame, at zero) in the parent link, ``pinocchio.SE3``.
        axis: Unit axis in the joint frame, shape (3,).
        lower, upper: Position limits [rad or m]; without meaning for continuous and fixed joints.
        velocity: Limit [rad/s or m/s], inf if unknown.
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

    def __init__(
        self,
        name: str,
        kind: str,
        parent: str,
        child: str,
        T_parent_joint: Any | None = None,
        axis: ArrayLike = (0.0, 0.0, 1.0),
        lower: float = -np.pi,
        upper: float = np.pi,
        velocity: float = np.inf,
    ) -> None:
        direction = finite_array(axis, (3,), f"joint '{name}': axis")
        length = float(np.linalg.norm(direction))
        if length < 1e-9:
            raise InputError(f"joint '{name}': axis is the zero vector; give a direction such as 0 0 1")
        values = {"name": name, "kind": kind, "parent": parent, "child": child, "lower": lower, "upper": upper}
        values |= {"T_parent_joint": pin.SE3.Identity() if T_parent_joint is None else pin.SE3(T_parent_joint)}
        values |= {"axis": frozen(direction / length), "velocity": velocity}
        for key, value in values.items():
            object.__setattr__(self, key, value)


@dataclass(frozen=True, slots=True, eq=False)
class Tree:
    """Links and joints that are known to form one tree.

    Attributes:
        where: File or name put in front of error messages.
        links, joints: In the order of the description.
    """

    where: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]

    def __init__(self, where: str, links: Sequence[Link], joints: Sequence[Joint]) -> None:
        object.__setattr__(self, "where", where)
        object.__setattr__(self, "links", tuple(links))
        object.__setattr__(self, "joints", tuple(joints))
        _check_names(self)
        _check_connected(self)

    @property
    def root(self) -> Link:
        """The link that is no joint's child."""
        children = {joint.child for joint in self.joints}
        return next(link for link in self.links if link.name not in children)

    def walk(self) -> Iterator[Joint]:
        """All joints, parents before children, each branch to its end before the next one begins."""
        below: dict[str, list[Joint]] = {link.name: [] for link in self.links}
        for joint in self.joints:
            below[joint.parent].append(joint)
        stack = below[self.root.name][::-1]
        while stack:
            joint = stack.pop()
            yield joint
            stack += below[joint.child][::-1]

    def chain(self, tip: str, base: str | None = None) -> tuple[Joint, ...]:
        """Joints from ``base`` (the root if None) to the link ``tip``, in that order.

        Raises:
            UnknownNameError: If one of the two is no link.
            InputError: If ``tip`` does not hang on ``base``.
        """
        names = [link.name for link in self.links]
        above = {joint.child: joint for joint in self.joints}
        for link in (tip, base):
            if link is not None and link not in names:
                raise UnknownNameError("link", link, names, where=self.where)
        joints: list[Joint] = []
        link = tip
        while link != base and link in above:
            joints.append(above[link])
            link = above[link].parent
        if base is not None and link != base:
            raise InputError(f"{self.where}: link '{tip}' does not hang on link '{base}'; swap them or choose others")
        return tuple(reversed(joints))


    def hold(self, values: Mapping[str, float]) -> Tree:
        """The same tree with the named joints fixed at the given values [rad or m]."""
        joints = [_held(joint, values[joint.name]) if joint.name in values else joint for joint in self.joints]
        return Tree(self.where, self.links, joints)


def _held(joint: Joint, value: float) -> Joint:
    axis = np.array(joint.axis)
    motion = pin.SE3(np.eye(3), value * axis) if joint.kind == "prismatic" else pin.SE3(pin.exp3(value * axis), 0 * axis)
    return Joint(joint.name, "fixed", joint.parent, joint.child, joint.T_parent_joint * motion, axis)


def _check_names(tree: Tree) -> None:
    if not tree.links:
        raise InputError(f"{tree.where}: no link; a robot needs at least one")
    for what, names in (("link", [x.name for x in tree.links]), ("joint", [x.name for x in tree.joints])):
        twice = [name for name, count in Counter(names).items() if count > 1]
        if twice:
            raise InputError(f"{tree.where}: {what} name '{twice[0]}' stands there twice; rename one")
    known = [link.name for link in tree.links]
    for joint in tree.joints:
        for role, link in (("parent", joint.parent), ("child", joint.child)):
            if link not in known:
                raise UnknownNameError(f"{role} link", link, known, where=f"{tree.where}: joint '{joint.name}'")


def _check_connected(tree: Tree) -> None:
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


def build_models(tree: Tree, T_world_base: Any | None = None) -> tuple[Any, Any, Any]:
    """Pinocchio model, collision geometry and visual geometry of a tree.

    Args:
        tree: Links and joints.
        T_world_base: Pose of the root link, ``pinocchio.SE3``; identity if None.

    Raises:
        InputError: If a mesh file cannot be read.
    """
    model = pin.Model()
    model.name = tree.where
    links = {link.name: link for link in tree.links}
    places = {tree.root.name: _Place(0, pin.SE3.Identity() if T_world_base is None else T_world_base, 0)}
    _add_link(model, tree.root, places)
    for joint in tree.walk():
        places[joint.child] = _add_joint(model, joint, places[joint.parent])
        _add_link(model, links[joint.child], places)
    meshes: dict[MeshFile, Any] = {}
    hard = _geometry(tree, places, meshes, "collision")
    return model, hard, _geometry(tree, places, meshes, "visual")


@dataclass(slots=True, eq=False)
class _Place:
    """Where a link hangs: on which Pinocchio joint, with which offset, and its frame number."""

    joint: int
    T_joint_link: Any
    frame: int


def _add_joint(model: Any, joint: Joint, parent: _Place) -> _Place:
    placement = parent.T_joint_link * joint.T_parent_joint
    if joint.kind == "fixed":
        frame = pin.Frame(joint.name, parent.joint, parent.frame, placement, pin.FrameType.FIXED_JOINT)
        return _Place(parent.joint, placement, model.addFrame(frame, False))
    kind, rotation = _joint_model(joint)
    turn = pin.SE3(rotation, np.zeros(3))
    size = kind.nq
    lower, upper = (joint.lower, joint.upper) if joint.kind != "continuous" else (-1.01, 1.01)
    number = model.addJoint(
        parent.joint,
        kind,
        placement * turn,
        joint.name,
        np.full(1, np.inf),
        np.full(1, joint.velocity),
        np.full(size, lower),
        np.full(size, upper),
    )
    return _Place(number, turn.inverse(), model.addJointFrame(number, parent.frame))


def _joint_model(joint: Joint) -> tuple[Any, Any]:
    """Pinocchio's joint, and the rotation of its frame (identity but for continuous joints about a slanted axis)."""
    identity = np.eye(3)
    letter = next((name for name, unit in zip("XYZ", identity, strict=True) if np.array_equal(unit, joint.axis)), "")
    if joint.kind == "continuous":
        # Pinocchio offers no way to give its unaligned unbounded joint an axis from Python.
        if letter:
            return getattr(pin, f"JointModelRUB{letter}")(), identity
        return pin.JointModelRUBX(), pin.Quaternion.FromTwoVectors(identity[0], np.array(joint.axis)).matrix()
    short, long = ("R", "Revolute") if joint.kind == "revolute" else ("P", "Prismatic")
    if letter:
        return getattr(pin, f"JointModel{short}{letter}")(), identity
    return getattr(pin, f"JointModel{long}Unaligned")(np.array(joint.axis)), identity


def _add_link(model: Any, link: Link, places: dict[str, _Place]) -> None:
    place = places[link.name]
    place.frame = model.addBodyFrame(link.name, place.joint, place.T_joint_link, place.frame)
    if link.inertia is not None:
        model.appendBodyToJoint(place.joint, link.inertia, place.T_joint_link)


def _geometry(tree: Tree, places: dict[str, _Place], meshes: dict[MeshFile, Any], which: str) -> Any:
    geometry = pin.GeometryModel()
    for link in tree.links:
        place = places[link.name]
        for number, solid in enumerate(getattr(link, which)):
            shape = solid.shape
            is_file = isinstance(shape, MeshFile)
            item = pin.GeometryObject(
                f"{link.name}_{number}",
                place.joint,
                place.frame,
                place.T_joint_link * solid.T_link_solid,
                _load(shape, meshes, f"{tree.where}: link '{link.name}'") if is_file else pieces(shape)[0].geometry,
                str(shape.path) if is_file else "",
                np.array(shape.scale if is_file else (1.0, 1.0, 1.0)),
                solid.colour is not None,
                np.array(solid.colour or GREY),
            )
            geometry.addGeometryObject(item)
    return geometry


def _load(mesh: MeshFile, meshes: dict[MeshFile, Any], where: str) -> Any:
    if mesh not in meshes:
        try:
            geometry = coal.MeshLoader().load(str(mesh.path), np.array(mesh.scale))
        except (ValueError, RuntimeError) as error:
            raise InputError(
                f"{where}: mesh {mesh.path} cannot be read as triangles; export it again as STL, OBJ or DAE"
            ) from error
        if not np.isfinite(np.asarray(geometry.vertices())).all():
            raise InputError(f"{where}: mesh {mesh.path} holds numbers that are not finite; export it again")
        meshes[mesh] = geometry
    return meshes[mesh]
