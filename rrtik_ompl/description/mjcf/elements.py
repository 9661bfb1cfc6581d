"""Read elements of MJCF: default classes, angles, orientations in MuJoCo's five forms; geoms and meshes as solids."""

from __future__ import annotations

import os
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.errors import InputError, MissingFileError, UnknownNameError
from rrtik_ompl.base.poses import pose_from_xyzw, turned_z
from rrtik_ompl.description.package_path import MESH_SUFFIXES
from rrtik_ompl.description.tree import MeshFile, Solid
from rrtik_ompl.description.urdf_read import attribute, numbers
from rrtik_ompl.model.shapes import Box, Capsule, Cylinder, HalfSpace, Mesh, Shape, Sphere

MAIN = "main"  # the default class from which all others inherit
OF_THE_SCENE = ("plane", "hfield")
KINDS = ("box", "capsule", "cylinder", "mesh", "sphere")
_COUNTS = {"sphere": 1, "capsule": 2, "cylinder": 2, "box": 3}  # how many numbers a size has
Attributes = Mapping[str, str]
Rgba = tuple[float, float, float, float]
Meshes = Mapping[str, tuple[MeshFile | Mesh, Any]]  # by name, each with its pose in its geom (pinocchio.SE3)
COMPILER = "with the package mujoco installed, its compiler reads the file (pip install mujoco)"
_UNITS = dict(zip("xyz", np.eye(3), strict=True))
_ORIENTATIONS = ("quat", "axisangle", "euler", "xyaxes", "zaxis")


@dataclass(slots=True, eq=False)
class Settings:
    """Settings that apply to a whole file.

    Attributes:
        degrees: Whether angles are in degrees.
        sequence: Sequence of Euler angles; capital letters are fixed axes.
        limited: Whether a joint with a range has limits.
        meshes: Folder of meshes, as the file names it.
        classes: Default attributes by class and tag.
        colours: Red, green, blue and opacity of materials, by name.
    """

    degrees: bool = True
    sequence: str = "xyz"
    limited: bool = True
    meshes: str = ""
    classes: dict[str, dict[str, Attributes]] = field(default_factory=lambda: {MAIN: {}})
    colours: dict[str, Rgba] = field(default_factory=dict)

    def read(self, root: Element, where: str) -> None:
        """Take over the settings of ``<compiler>`` and ``<default>``, and the colours of materials, in place.

        Raises:
            InputError: If a value is not valid.
        """
        for compiler in root.findall("compiler"):
            self.degrees = compiler.get("angle", "degree" if self.degrees else "radian") == "degree"
            self.sequence = compiler.get("eulerseq", self.sequence)
            self.limited = compiler.get("autolimits", "true" if self.limited else "false") == "true"
            self.meshes = compiler.get("meshdir", compiler.get("assetdir", self.meshes))

        if len(self.sequence) != 3 or set(self.sequence.lower()) - set("xyz"):
            raise InputError(f"{where}: eulerseq '{self.sequence}' must be three of the letters x, y, z")

        stack = [(element, MAIN) for element in root.findall("default")]
        while stack:
            element, parent_class = stack.pop()
            name = element.get("class", MAIN)
            inherited = self.classes.get(name, self.classes[parent_class])
            defaults = {
                item.tag: {**inherited.get(item.tag, {}), **item.attrib} for item in element if item.tag != "default"
            }
            self.classes[name] = {**inherited, **defaults}
            stack += [(item, name) for item in element.findall("default")]

        for material in root.findall("asset/material"):
            rgba = _rgba(self.filled(material, MAIN, where), where)
            if rgba is not None:
                self.colours[material.get("name", "")] = rgba

    def filled(self, element: Element, parent_class: str, where: str) -> Element:
        """Return the element with the defaults of its class, or of the class of the body that it is in.

        Raises:
            UnknownNameError: If the class does not exist.
        """
        name = element.get("class", parent_class)
        if name not in self.classes:
            raise UnknownNameError("default class", name, self.classes, where=where)

        filled = ElementTree.Element(element.tag, {**self.classes[name].get(element.tag, {}), **element.attrib})
        for key in _ORIENTATIONS:  # The element's own orientation replaces a default one of another form.
            if key in element.attrib:
                for orientation in (orientation for orientation in _ORIENTATIONS if orientation not in element.attrib):
                    filled.attrib.pop(orientation, None)
        return filled

    def angle(self, value: float) -> float:
        """Convert an angle of the file to radians."""
        return float(np.radians(value)) if self.degrees else value

    def placement(self, element: Element, where: str) -> pin.SE3:
        """Return the pose (``pinocchio.SE3``) of an element with a position and one of five forms of orientation."""
        position = numbers(element, "pos", 3, (0.0, 0.0, 0.0), where)
        written = [key for key in _ORIENTATIONS if element.get(key) is not None]
        if len(written) > 1:
            raise InputError(f"{where}: <{element.tag}> has {' and '.join(written)}; leave one")
        rotation = getattr(self, f"_{written[0]}")(element, where) if written else np.eye(3)
        return pin.SE3(rotation, np.array(position))

    def _quat(self, element: Element, where: str) -> Matrix:
        w, x, y, z = numbers(element, "quat", 4, None, where)
        length = float(np.linalg.norm([w, x, y, z]))
        if length < 1e-9:
            raise InputError(f"{where}: <{element.tag} quat> is zero; 1 0 0 0 turns nothing")
        turn: Matrix = pose_from_xyzw(np.zeros(3), np.array([x, y, z, w]) / length).rotation
        return turn

    def _axisangle(self, element: Element, where: str) -> Matrix:
        *axis, angle = numbers(element, "axisangle", 4, None, where)
        turn: Matrix = pin.exp3(self.angle(angle) * _unit(axis, element, where))
        return turn

    def _euler(self, element: Element, where: str) -> Matrix:
        turn = np.eye(3)
        for letter, angle in zip(self.sequence, numbers(element, "euler", 3, None, where), strict=True):
            step = pin.exp3(self.angle(angle) * _UNITS[letter.lower()])
            turn = turn @ step if letter.islower() else step @ turn
        return turn

    def _xyaxes(self, element: Element, where: str) -> Matrix:
        values = np.array(numbers(element, "xyaxes", 6, None, where))
        x = _unit(values[:3], element, where)
        y = _unit(values[3:] - values[3:] @ x * x, element, where)
        return np.column_stack([x, y, np.cross(x, y)])

    def _zaxis(self, element: Element, where: str) -> Matrix:
        return turned_z(_unit(numbers(element, "zaxis", 3, None, where), element, where))


def _unit(values: ArrayLike, element: Element, where: str) -> Vector:
    """Return a direction as a unit vector, shape (3,); raise an error if its length is 0."""
    length = float(np.linalg.norm(values))
    if length < 1e-9:
        raise InputError(f"{where}: <{element.tag}> has an axis of length 0; give a direction such as 0 0 1")
    unit: Vector = np.asarray(values) / length
    return unit


def masks(geom: Element, where: str) -> tuple[int, int]:
    """Return ``contype`` and ``conaffinity`` of a geom, which determine the geoms that it may collide with."""
    kind, affinity = (int(numbers(geom, key, 1, (1.0,), where)[0]) for key in ("contype", "conaffinity"))
    return kind, affinity


def _rgba(element: Element, where: str) -> Rgba | None:
    """Return the colour that an element states, from 0 to 1, or None."""
    if element.get("rgba") is None:
        return None
    red, green, blue, opacity = (min(max(part, 0.0), 1.0) for part in numbers(element, "rgba", 4, None, where))
    return red, green, blue, opacity


def solid_of(geom: Element, settings: Settings, meshes: Meshes, where: str) -> Solid:
    """Return the solid of a geom that is neither a plane nor a height field (see :func:`ground_of`).

    Args:
        geom: The element, with defaults filled in.
        settings: Settings of the file.
        meshes: Meshes by name, with the pose of each in its geom.
        where: File and body, put in front of error messages.

    Raises:
        InputError: If its kind cannot be read, or its numbers are not valid.
    """
    kind = geom.get("type", "sphere")
    rgba = _rgba(geom, where) or settings.colours.get(geom.get("material", ""))
    if kind not in KINDS:
        raise InputError(f"{where}: geom of type '{kind}' cannot be read; {COMPILER}")
    place = settings.placement(geom, where)

    if kind == "mesh":
        name = attribute(geom, "geom", "mesh", where)
        if name not in meshes:
            raise UnknownNameError("mesh", name, meshes, where=where)
        mesh, T_mesh = meshes[name]
        return Solid(mesh, place * T_mesh, rgba)

    if geom.get("mesh") is not None:
        raise InputError(f"{where}: a {kind} fitted to a mesh cannot be read; {COMPILER}")

    length = None
    if geom.get("fromto") is not None and kind in ("capsule", "cylinder", "box"):
        ends = np.array(numbers(geom, "fromto", 6, None, where)).reshape(2, 3)
        direction = ends[1] - ends[0]
        length = float(np.linalg.norm(direction))
        if length == 0.0:
            raise InputError(f"{where}: <geom fromto> is from a point to itself; give two points")
        place = pin.SE3(turned_z(direction / length), ends.mean(axis=0))
    return Solid(_shape(kind, geom, length, where), place, rgba)


class UnreadableFieldError(InputError):
    """A height field is stored in a way that only MuJoCo's compiler reads."""


def ground_of(geom: Element, settings: Settings, fields: Mapping[str, Element], where: str) -> Solid:
    """Return the solid of a plane, below which all is filled, or of a height field.

    Args:
        geom: The element, with defaults filled in.
        settings: Settings of the file.
        fields: Elements of height fields by name.
        where: File and body, put in front of error messages.

    Raises:
        UnreadableFieldError: If the heights are in a file.
        InputError: If anything else cannot be used.
    """
    place = settings.placement(geom, where)
    if geom.get("type") == "plane":
        return Solid(HalfSpace([0.0, 0.0, 1.0]), place)

    name = attribute(geom, "geom", "hfield", where)
    if name not in fields:
        raise UnknownNameError("height field", name, fields, where=where)
    heights = fields[name]
    rows, columns = (int(numbers(heights, key, 1, (0.0,), where)[0]) for key in ("nrow", "ncol"))
    if heights.get("elevation") is None or rows < 2 or columns < 2:
        raise UnreadableFieldError(f"height field '{name}' is in a file")
    elevation = np.reshape(numbers(heights, "elevation", rows * columns, None, where), (rows, columns))[::-1]
    low, high = elevation.min(), elevation.max()
    return Solid(
        field_mesh((elevation - low) / max(high - low, 1e-12), numbers(heights, "size", 4, None, where)), place
    )


def field_mesh(heights: Matrix, size: ArrayLike) -> Mesh:
    """Return the solid below a grid of heights, as MuJoCo has it.

    Args:
        heights: From 0 to 1, rows along y, shape (rows, columns).
        size: Half extents along x and y, the height that 1 stands for, and how far the solid reaches below 0 [m].
    """
    half_x, half_y, top, base = np.asarray(size, dtype=np.float64)
    rows, columns = heights.shape
    x, y = np.meshgrid(np.linspace(-half_x, half_x, columns), np.linspace(-half_y, half_y, rows))
    upper = np.stack([x, y, top * heights], axis=-1).reshape(-1, 3)
    lower = np.stack([x, y, np.full_like(x, -base)], axis=-1).reshape(-1, 3)

    number = np.arange(rows * columns).reshape(rows, columns)
    a = number[:-1, :-1].ravel()
    b = number[:-1, 1:].ravel()
    c = number[1:, 1:].ravel()
    d = number[1:, :-1].ravel()
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    rim = np.concatenate([number[0, :-1], number[:-1, -1], number[-1, :0:-1], number[:0:-1, 0]])
    after = np.roll(rim, -1)
    below = rows * columns
    walls = [np.stack([rim, rim + below, after + below], axis=1), np.stack([rim, after + below, after], axis=1)]
    return Mesh(np.concatenate([upper, lower]), np.concatenate([faces, faces[:, ::-1] + below, *walls]))


def _shape(kind: str, geom: Element, length: float | None, where: str) -> Shape:
    """Return the shape of a geom; ``length`` is the distance between the ends of `fromto` [m], None without."""
    # With `fromto`, the length replaces one number of the size; a box then has the same width along both other axes.
    count = _COUNTS[kind] - (length is not None) - (length is not None and kind == "box")
    written = (geom.get("size") or "").split()
    # Further numbers are ignored.
    size = numbers(Element("geom", {"size": " ".join(written[:count])}), "size", count, None, where)

    if kind == "sphere":
        return Sphere(size[0])
    if kind == "box":
        return Box([2.0 * size[0], 2.0 * size[0], length] if length is not None else 2.0 * np.array(size))
    full_length = 2.0 * size[1] if length is None else length
    return Capsule(size[0], full_length) if kind == "capsule" else Cylinder(size[0], full_length)


def meshes_of(root: Element, settings: Settings, folder: Path, where: str) -> dict[str, tuple[MeshFile, Any]]:
    """Return the meshes of ``<asset>`` by name, with the pose of each in its geom.

    Raises:
        InputError: If one cannot be read; a file is looked for only if a geom may use it.
    """
    meshes = {}
    for element in root.findall("asset/mesh"):
        mesh = settings.filled(element, MAIN, where)
        if mesh.get("file") is None:
            raise InputError(f"{where}: mesh '{mesh.get('name', '')}' has no file; save it as STL or OBJ and name that")

        path = folder / settings.meshes / attribute(mesh, "mesh", "file", where)
        x, y, z = numbers(mesh, "scale", 3, (1.0, 1.0, 1.0), where)
        if x * y * z == 0.0:
            raise InputError(f"{where}: mesh {path.name} has a scale of 0; every axis needs another number")
        if path.suffix.lower() not in MESH_SUFFIXES:
            raise InputError(f"{where}: mesh {path.name} is of no kind that can be read; export it as STL or OBJ")
        if not os.path.isfile(path):
            raise MissingFileError(f"{where}: mesh file '{path}' does not exist; check meshdir and the name")

        reference = Element("mesh", {"pos": mesh.get("refpos", "0 0 0"), "quat": mesh.get("refquat", "1 0 0 0")})
        mesh_in_geom = settings.placement(reference, where).inverse()
        meshes[mesh.get("name") or path.stem] = MeshFile(path.resolve(), (x, y, z)), mesh_in_geom
    return meshes
