"""A tree of named nodes; what is set at them is recorded as the commands that meshcat's viewer replays in the page.

Solids and materials are in the format of three.js's ObjectLoader. They are written here because ``import meshcat``
takes a second and brings a notebook and a server along, and the page needs its viewer's script alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np
import umsgpack
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.model.shapes.surfaces import Faces

ROOT = "/meshcat"  # of the viewer's own tree

BOTH_SIDES = 2  # three.js's DoubleSide
IDENTITY = np.eye(4).ravel().tolist()
GRAIN = 2.0**-14  # [m], to which corners of triangles are rounded: the zeros that follow take no room
FLOATS, INDICES = ("Float32Array", 0x17), ("Uint32Array", 0x16)  # meshcat's numbers of msgpack extensions


class Recording:
    """The last command of each kind for each node, in order."""

    def __init__(self) -> None:
        self._commands: dict[tuple[str, str], bytes] = {}

    def set(self, kind: str, path: str, **parts: Any) -> None:
        """Record a command, in place of an earlier one of the same kind for the same node."""
        self._commands.pop((kind, path), None)
        self._commands[kind, path] = umsgpack.packb({"type": kind, "path": path, **parts})

    @property
    def root(self) -> Node:
        """The node above all others."""
        return Node(self, ROOT)

    @property
    def commands(self) -> tuple[bytes, ...]:
        """The recorded commands, packed as the page's ``Viewer.handle_command_bytearray`` takes them."""
        return tuple(self._commands.values())

    @property
    def paths(self) -> tuple[str, ...]:
        """Nodes that hold an object, in the order in which they were set."""
        return tuple(path for kind, path in self._commands if kind == "set_object")


class Node:
    """A place in the tree: ``node["name"]`` is a node below it, whose pose is relative to it."""

    def __init__(self, recording: Recording, path: str) -> None:
        self._recording = recording
        self._path = path

    def __getitem__(self, name: str) -> Node:
        """The node of this name below this one; a name without ``/``."""
        return Node(self._recording, f"{self._path}/{name}")

    def set_object(self, geometry: Geometry, material: Material) -> None:
        """Put a solid here."""
        self._recording.set("set_object", self._path, object=described_object(self._path, geometry, material))

    def set_transform(self, matrix: NDArray[Any]) -> None:
        """Set the pose, or pose and scale, relative to the node above, shape (4, 4)."""
        self._recording.set("set_transform", self._path, matrix=matrix.T.ravel().tolist())


class Geometry(Protocol):
    """A solid in its own frame."""

    def described(self) -> dict[str, Any]:
        """Its kind and sizes."""


@dataclass(frozen=True, slots=True)
class SphereGeometry:
    """A sphere; its radius [m]."""

    radius: float

    def described(self) -> dict[str, Any]:
        """Its kind and sizes."""
        return {"type": "SphereGeometry", "radius": self.radius, "widthSegments": 20, "heightSegments": 20}


@dataclass(frozen=True, slots=True)
class CylinderGeometry:
    """A cylinder or cone about y: its length, its radii above and below [m]."""

    length: float
    above: float
    below: float

    def described(self) -> dict[str, Any]:
        """Its kind and sizes."""
        radii = {"radiusTop": self.above, "radiusBottom": self.below}
        return {"type": "CylinderGeometry", **radii, "height": self.length, "radialSegments": 50}


@dataclass(frozen=True, slots=True)
class BoxGeometry:
    """A box; its sides along x, y and z [m]."""

    sides: tuple[float, float, float]

    def described(self) -> dict[str, Any]:
        """Its kind and sizes."""
        return {"type": "BoxGeometry", **dict(zip(("width", "height", "depth"), self.sides, strict=True))}


@dataclass(frozen=True, slots=True, eq=False)
class TriangleGeometry:
    """Triangles: corners, shape (n, 3) [m], and the numbers of each triangle's three, shape (m, 3)."""

    vertices: Matrix
    faces: Faces

    def described(self) -> dict[str, Any]:
        """Its kind, corners and triangles."""
        corners = np.round(np.asarray(self.vertices, dtype=np.float64) / GRAIN) * GRAIN
        position = _packed(corners.astype(np.float32), FLOATS)
        index = _packed(np.asarray(self.faces, dtype=np.uint32), INDICES)
        return {"type": "BufferGeometry", "data": {"attributes": {"position": position}, "index": index}}


@dataclass(frozen=True, slots=True, eq=False)
class PointGeometry:
    """Points, shape (n, 3) [m], each drawn as a square as wide as its ball."""

    points: NDArray[np.float32]
    radius: float

    def described(self) -> dict[str, Any]:
        """Its kind and points."""
        return {"type": "BufferGeometry", "data": {"attributes": {"position": _packed(self.points, FLOATS)}}}


def _packed(rows: NDArray[Any], kind: tuple[str, int]) -> dict[str, Any]:
    name, number = kind
    return {"itemSize": 3, "type": name, "array": umsgpack.Ext(number, rows.tobytes()), "normalized": False}


@dataclass(frozen=True, slots=True)
class Material:
    """How a surface looks.

    Attributes:
        color: 0xRRGGBB.
        opacity: 0 to 1.
        shininess: Of its highlights; three.js's own if None.
        hides: Whether it hides what is drawn behind it later; three.js's own choice if None.
    """

    color: int
    opacity: float = 1.0
    shininess: float | None = None
    hides: bool | None = None

    _FIXED: ClassVar[dict[str, Any]] = {"wireframe": False, "wireframeLinewidth": 1.0, "vertexColors": 0}

    def described(self) -> dict[str, Any]:
        """Its kind and properties."""
        look = {"color": self.color, "reflectivity": 0.5, "side": BOTH_SIDES}
        seen = {"transparent": self.opacity != 1.0, "opacity": self.opacity, "linewidth": 1.0}
        chosen = {"shininess": self.shininess, "depthWrite": self.hides}
        own = {name: value for name, value in chosen.items() if value is not None}
        return {"type": "MeshPhongMaterial", **look, **seen, **self._FIXED, **own}


def described_object(path: str, geometry: Geometry, material: Material) -> dict[str, Any]:
    """A solid with its material; all parts are named after its path, so that the same picture gives the same bytes."""
    names = {part: f"{path}/{part}" for part in ("geometry", "material")}
    kind = "Mesh"
    look = material.described()

    if isinstance(geometry, PointGeometry):
        seen = {name: look[name] for name in ("color", "opacity", "transparent")}
        kind = "Points"
        look = {"type": "PointsMaterial", "size": 2.0 * geometry.radius, **seen}

    return {
        "metadata": {"version": 4.5, "type": "Object"},
        "geometries": [{"uuid": names["geometry"], **geometry.described()}],
        "materials": [{"uuid": names["material"], **look}],
        "object": {"uuid": f"{path}/object", "type": kind, **names, "matrix": IDENTITY},
    }
