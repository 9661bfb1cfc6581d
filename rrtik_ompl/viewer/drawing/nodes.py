"""A tree of named nodes; operations on them are recorded as the commands that meshcat's viewer replays in the page.

Solids and materials are in the format of three.js's ObjectLoader. They are written here because ``import meshcat``
takes a second and loads a notebook and a server, while the page needs only the script of its viewer.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np
import umsgpack
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.model.shapes.surfaces import Faces

ROOT = "/meshcat"  # root of the viewer's own tree

BOTH_SIDES = 2  # three.js's DoubleSide
IDENTITY = np.eye(4).ravel().tolist()
# [m]; vertices are rounded to this, because the trailing zeros compress well.
GRAIN = 2.0**-14
# Three.js's array types with meshcat's msgpack extensions.
FLOATS, INDICES = ("Float32Array", 0x17), ("Uint32Array", 0x16)


class Recording:
    """A recording of the last command of each kind for each node, in order.

    Attributes:
        drawn: The solid at each node that has one, by its path.
        places: Pose, or pose and scale, of each node that has one relative to its parent, shape (4, 4).
    """

    def __init__(self) -> None:
        self._commands: dict[tuple[str, str], bytes] = {}
        self.drawn: dict[str, tuple[Geometry, Material]] = {}
        self.places: dict[str, NDArray[np.float64]] = {}

    def set(self, kind: str, path: str, **parts: Any) -> None:
        """Record a command; it replaces an earlier one of the same kind for the same node."""
        self._commands.pop((kind, path), None)
        self._commands[kind, path] = umsgpack.packb({"type": kind, "path": path, **parts})

    def pose(self, path: str) -> NDArray[np.float64]:
        """Return the pose, or pose and scale, of a node in the world, shape (4, 4)."""
        pose = np.eye(4)
        steps = path.split("/")
        for count in range(2, len(steps) + 1):
            pose = pose @ self.places.get("/".join(steps[:count]), np.eye(4))
        return pose

    @property
    def root(self) -> Node:
        """The node above all others."""
        return Node(self, ROOT)

    @property
    def commands(self) -> tuple[bytes, ...]:
        """The recorded commands, packed for the page's ``Viewer.handle_command_bytearray``."""
        return tuple(self._commands.values())

    @property
    def paths(self) -> tuple[str, ...]:
        """Paths of the nodes that hold an object, in the order in which they were set."""
        return tuple(path for kind, path in self._commands if kind == "set_object")


class Node:
    """A node of the tree: ``node["name"]`` is its child, whose pose is relative to it."""

    def __init__(self, recording: Recording, path: str) -> None:
        self._recording = recording
        self._path = path

    def __getitem__(self, name: str) -> Node:
        """Return the child of this name, which must not contain ``/``."""
        return Node(self._recording, f"{self._path}/{name}")

    def set_object(self, geometry: Geometry, material: Material) -> None:
        """Place a solid at this node."""
        self._recording.drawn[self._path] = geometry, material
        self._recording.set("set_object", self._path, object=described_object(self._path, geometry, material))

    def set_transform(self, matrix: NDArray[Any]) -> None:
        """Set the pose, or pose and scale, relative to the parent node, shape (4, 4)."""
        self._recording.places[self._path] = np.asarray(matrix, dtype=np.float64)
        self._recording.set("set_transform", self._path, matrix=matrix.T.ravel().tolist())


class Geometry(Protocol):
    """A solid in its own frame."""

    def described(self) -> dict[str, Any]:
        """Return kind and sizes in three.js's format."""


@dataclass(frozen=True, slots=True)
class SphereGeometry:
    """A sphere; its radius [m]."""

    radius: float

    def described(self) -> dict[str, Any]:
        """Return kind and sizes in three.js's format."""
        return {"type": "SphereGeometry", "radius": self.radius, "widthSegments": 20, "heightSegments": 20}


@dataclass(frozen=True, slots=True)
class CylinderGeometry:
    """A cylinder or cone about y: its length, its radii above and below [m]."""

    length: float
    above: float
    below: float

    def described(self) -> dict[str, Any]:
        """Return kind and sizes in three.js's format."""
        radii = {"radiusTop": self.above, "radiusBottom": self.below}
        return {"type": "CylinderGeometry", **radii, "height": self.length, "radialSegments": 50}


@dataclass(frozen=True, slots=True)
class BoxGeometry:
    """A box; its sides along x, y and z [m]."""

    sides: tuple[float, float, float]

    def described(self) -> dict[str, Any]:
        """Return kind and sizes in three.js's format."""
        return {"type": "BoxGeometry", **dict(zip(("width", "height", "depth"), self.sides, strict=True))}


@dataclass(frozen=True, slots=True, eq=False)
class TriangleGeometry:
    """Triangles: vertices, shape (n, 3) [m], and the three vertex indices of each triangle, shape (m, 3)."""

    vertices: Matrix
    faces: Faces

    def described(self) -> dict[str, Any]:
        """Return kind, vertices and triangles in three.js's format."""
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
        """Return kind and points in three.js's format."""
        return {"type": "BufferGeometry", "data": {"attributes": {"position": _packed(self.points, FLOATS)}}}


def _packed(rows: NDArray[Any], kind: tuple[str, int]) -> dict[str, Any]:
    name, number = kind
    return {"itemSize": 3, "type": name, "array": umsgpack.Ext(number, rows.tobytes()), "normalized": False}


@dataclass(frozen=True, slots=True)
class Material:
    """Appearance of a surface.

    Attributes:
        color: 0xRRGGBB.
        opacity: From 0 to 1.
        shininess: Shininess of its highlights; None for the default of three.js.
        hides: Whether it hides what is drawn behind it later (depth writing); None for the default of three.js.
    """

    color: int
    opacity: float = 1.0
    shininess: float | None = None
    hides: bool | None = None

    _FIXED: ClassVar[dict[str, Any]] = {"wireframe": False, "wireframeLinewidth": 1.0, "vertexColors": 0}

    def described(self) -> dict[str, Any]:
        """Return kind and properties in three.js's format."""
        look = {"color": self.color, "reflectivity": 0.5, "side": BOTH_SIDES}
        seen = {"transparent": self.opacity != 1.0, "opacity": self.opacity, "linewidth": 1.0}
        chosen = {"shininess": self.shininess, "depthWrite": self.hides}
        own = {name: value for name, value in chosen.items() if value is not None}
        return {"type": "MeshPhongMaterial", **look, **seen, **self._FIXED, **own}


def described_object(path: str, geometry: Geometry, material: Material) -> dict[str, Any]:
    """Return a solid with its material; parts are named after the path, so that equal pictures give equal bytes."""
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
