"""Build Pinocchio's model, collision geometry and visual geometry from a tree of links and joints."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from rrtik_ompl.base.copies import Once
from rrtik_ompl.base.errors import EmptyMeshError, InputError, MeshWarning, few
from rrtik_ompl.description.shapes.materials import Colour, parts_by_colour
from rrtik_ompl.description.shapes.mesh import shared_surface
from rrtik_ompl.description.tree import Joint, Link, MeshFile, Solid, Tree
from rrtik_ompl.geometry.collision.shape_table import pieces
from rrtik_ompl.model.shapes import Shape

MOST_UNDRAWN = 2  # most meshes in one line that are not drawn
GREY = (0.7, 0.7, 0.7, 1.0)


class Looks(Once[pin.GeometryModel]):
    """The visual geometry of a robot, which is most of its data, and is only loaded when it is used for the first time.

    Attributes:
        files: The mesh files.
    """

    def __init__(self, make: Callable[[], pin.GeometryModel], files: tuple[str, ...] = ()) -> None:
        super().__init__(make)
        self.files = files


def build_models(tree: Tree, T_world_base: pin.SE3 | None = None) -> tuple[Any, Any, Looks]:
    """Return the Pinocchio model, collision geometry and visual geometry of a tree.

    Args:
        tree: Links and joints.
        T_world_base: Pose of the root link, ``pinocchio.SE3``; identity if None.

    Raises:
        InputError: If a mesh file of the collision geometry cannot be read.
    """
    model = pin.Model()
    model.name = tree.where

    links = {link.name: link for link in tree.links}
    # Parts of Pinocchio find frames by name alone, so a joint with the name of a link gets no frame.
    framed = {joint.name for joint in tree.joints} - set(links)
    places = {tree.root.name: _Place(0, pin.SE3.Identity() if T_world_base is None else T_world_base, 0)}
    _add_link(model, tree.root, places)

    for joint in tree.walk():
        place = places[joint.child] = _add_joint(model, joint, places[joint.parent])
        if joint.name in framed:
            kind = pin.FrameType.JOINT if joint.moves else pin.FrameType.FIXED_JOINT
            frame = pin.Frame(joint.name, place.joint, place.frame, place.T_joint_link, kind)
            place.frame = model.addFrame(frame, False)
        _add_link(model, links[joint.child], places)

    meshes: dict[MeshFile, Any] = {}
    hard = _collision(tree, places, meshes)
    drawn = (solid.shape for link in tree.links for solid in link.visual)
    files = tuple(str(shape.path) for shape in drawn if isinstance(shape, MeshFile))
    return model, hard, Looks(partial(_looks, tree, places, meshes), files)


@dataclass(slots=True, eq=False)
class _Place:
    """Where a link is attached: number of its Pinocchio joint, pose in that joint's frame, and number of its frame."""

    joint: int
    T_joint_link: Any
    frame: int


def _add_joint(model: pin.Model, joint: Joint, parent: _Place) -> _Place:
    """Add a joint to a model and return where its child link is attached; a fixed joint adds nothing."""
    placement = parent.T_joint_link * joint.T_parent_joint
    if not joint.moves:
        return _Place(parent.joint, placement, parent.frame)

    kind, rotation = JOINT_MODELS[joint.kind](joint)
    turn = pin.SE3(rotation, np.zeros(3))
    size = kind.nq
    lower, upper = (-1.01, 1.01) if joint.endless else (joint.lower, joint.upper)
    number = model.addJoint(
        parent.joint,
        kind,
        placement * turn,
        joint.name,
        np.full(1, joint.effort),
        np.full(1, joint.velocity),
        np.full(size, lower),
        np.full(size, upper),
    )
    return _Place(number, turn.inverse(), parent.frame)


def _letter(joint: Joint) -> str:
    """Return the axis of its frame about or along which a joint moves: "X", "Y" or "Z"; "" if it is another one."""
    return next((name for name, unit in zip("XYZ", np.eye(3), strict=True) if np.array_equal(unit, joint.axis)), "")


def _along_axis(short: str, long: str, joint: Joint) -> tuple[Any, Any]:
    """Return Pinocchio's joint model for a joint with limits, and the rotation of its frame."""
    letter = _letter(joint)
    if letter:
        return getattr(pin, f"JointModel{short}{letter}")(), np.eye(3)
    return getattr(pin, f"JointModel{long}Unaligned")(np.array(joint.axis)), np.eye(3)


def _unbounded(joint: Joint) -> tuple[Any, Any]:
    """Return Pinocchio's joint model for a continuous joint, and the rotation of its frame."""
    letter = _letter(joint)
    if letter:
        return getattr(pin, f"JointModelRUB{letter}")(), np.eye(3)
    # From Python, the axis of Pinocchio's unaligned unbounded joint cannot be set, so the frame is rotated instead.
    x_axis = np.eye(3)[0]
    return pin.JointModelRUBX(), pin.Quaternion.FromTwoVectors(x_axis, np.array(joint.axis)).matrix()


# For each kind of joint that moves, the function that returns Pinocchio's joint model and the rotation of its frame.
JOINT_MODELS: dict[str, Callable[[Joint], tuple[Any, Any]]] = {
    "revolute": partial(_along_axis, "R", "Revolute"),
    "continuous": _unbounded,
    "prismatic": partial(_along_axis, "P", "Prismatic"),
}


def _add_link(model: pin.Model, link: Link, places: dict[str, _Place]) -> None:
    place = places[link.name]
    place.frame = model.addBodyFrame(link.name, place.joint, place.T_joint_link, place.frame)
    if link.inertia is not None:
        model.appendBodyToJoint(place.joint, link.inertia, place.T_joint_link)


def _collision(tree: Tree, places: dict[str, _Place], meshes: dict[MeshFile, Any]) -> pin.GeometryModel:
    """Return the collision geometry of a tree. A mesh without triangles touches nothing, and is left out."""
    hard = pin.GeometryModel()
    empty = []
    for link in tree.links:
        for number, solid in enumerate(link.collision):
            try:
                geometry = _loaded(solid.shape, meshes, f"{tree.where}: link '{link.name}'")
            except EmptyMeshError as error:
                empty.append(str(error).removeprefix(f"{tree.where}: "))
            else:
                hard.addGeometryObject(_body(link, number, solid, places[link.name], geometry, solid.colour))

    if empty:
        warnings.warn(MeshWarning(f"{tree.where}: touches nothing: {few(empty, MOST_UNDRAWN)}"), stacklevel=2)
    return hard


def _looks(tree: Tree, places: dict[str, _Place], meshes: dict[MeshFile, Any]) -> pin.GeometryModel:
    """Return the visual geometry of a tree, with a body for each colour of a mesh.

    What cannot be read is not drawn: a link then looks like its collision.
    """
    looks = pin.GeometryModel()
    undrawn = []
    unpainted = []
    for link in tree.links:
        bodies: list[tuple[Solid, Any]] = []
        for solid in link.visual:
            try:
                bodies.append((solid, _loaded(solid.shape, meshes, f"link '{link.name}'")))
            except InputError as error:
                undrawn.append(str(error))
        for solid in () if bodies else link.collision:
            with suppress(EmptyMeshError):
                bodies.append((solid, _loaded(solid.shape, meshes, tree.where)))

        number = 0
        for solid, geometry in bodies:
            parts: list[tuple[Any, Colour | None]] = [(geometry, None)]
            try:
                parts = _painted(solid.shape, geometry)
            except InputError as error:
                unpainted.append(str(error))
            for part, colour in parts:
                looks.addGeometryObject(_body(link, number, solid, places[link.name], part, colour or solid.colour))
                number += 1

    for what, reasons in (("not drawn", undrawn), ("drawn in one colour", dict.fromkeys(unpainted))):
        if reasons:
            warnings.warn(MeshWarning(f"{tree.where}: {what}: {few(reasons, MOST_UNDRAWN)}"), stacklevel=2)
    return looks


def _painted(shape: Shape | MeshFile, geometry: coal.CollisionGeometry) -> list[tuple[Any, Colour | None]]:
    """Return the parts of a shape with the colour of each, None where its file states none."""
    if isinstance(shape, MeshFile) and shape.painted:
        return parts_by_colour(shape.path, np.array(shape.scale), geometry)
    return [(geometry, None)]


def _body(
    link: Link, number: int, solid: Solid, place: _Place, geometry: coal.CollisionGeometry, colour: Colour | None
) -> pin.GeometryObject:
    """Return a solid of a link, or a part of it, as a body of Pinocchio's geometry."""
    mesh = solid.shape if isinstance(solid.shape, MeshFile) else None
    return pin.GeometryObject(
        f"{link.name}_{number}",
        place.joint,
        place.frame,
        place.T_joint_link * solid.T_link_solid,
        geometry,
        "" if mesh is None else str(mesh.path),
        np.array((1.0, 1.0, 1.0) if mesh is None else mesh.scale),
        colour is not None,
        np.array(colour or GREY),
    )


def _loaded(shape: Shape | MeshFile, meshes: dict[MeshFile, Any], where: str) -> coal.CollisionGeometry:
    """Return a shape as a coal geometry; each mesh file is loaded, and checked, once."""
    if not isinstance(shape, MeshFile):
        return pieces(shape)[0].geometry
    mesh = shape
    if mesh in meshes:
        return meshes[mesh]

    try:
        meshes[mesh] = shared_surface(mesh.path, mesh.scale)
    except InputError as error:
        raise type(error)(f"{where}: {error}") from error
    return meshes[mesh]
