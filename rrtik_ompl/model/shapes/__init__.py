"""Shapes of obstacles and attached bodies: immutable solids in their own frame, in metres, without collision checks.

This module defines the shapes that a few numbers describe, and ``SHAPES``, which holds every kind by its key in files.
A kind that is added to it and to ``rrtik_ompl.geometry.collision.shape_table`` before files are read can be used like
the others.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import (
    TAU,
    Matrix,
    Vector,
    bounded_array,
    finite_number,
    frozen,
    length,
    not_negative,
    whole_number,
)
from rrtik_ompl.base.copies import as_value
from rrtik_ompl.base.errors import InputError, at_most
from rrtik_ompl.model.shapes.height_field import HeightField
from rrtik_ompl.model.shapes.mesh import Mesh
from rrtik_ompl.model.shapes.octree import Octree
from rrtik_ompl.model.shapes.point_cloud import PointCloud
from rrtik_ompl.model.shapes.polygons import check_simple, without_repeats
from rrtik_ompl.model.shapes.shape import Measure, Shape, same_shape
from rrtik_ompl.model.shapes.surfaces import Triangles, extruded, round_ended, rounded

__all__ = [
    "SHAPES",
    "Box",
    "Capsule",
    "Cylinder",
    "HalfSpace",
    "HeightField",
    "Measure",
    "Mesh",
    "Octree",
    "PointCloud",
    "Prism",
    "Shape",
    "Sphere",
    "same_shape",
]

SIDES = 32  # number of sides of a drawn cylinder
SEGMENTS = 24  # number of segments of a drawn ball or capsule
MOST_SEGMENTS = 2_000  # largest number of segments, which gives half a million vertices


@dataclass(frozen=True, slots=True, eq=False)
class Box(Shape):
    """A box centred on its frame: ``Box(x, y, z)`` or ``Box([x, y, z])``, full side lengths in metres.

    Attributes:
        size: Full side lengths [m], shape (3,).

    Example:
        >>> rrtik.Box(0.1, 0.2, 0.3).size
        array([0.1, 0.2, 0.3])
    """

    key = "box"
    measures = (Measure("size", "three lengths", "full side lengths [m]"),)
    grouped = False
    in_urdf = True
    moveit = ("size",)

    size: Vector

    __reduce__ = as_value

    call = "Box(x, y, z) or Box([x, y, z])"

    @overload
    def __init__(self, size: ArrayLike) -> None: ...
    @overload
    def __init__(self, size: float, y: float, z: float) -> None: ...
    def __init__(self, size: ArrayLike, y: float | None = None, z: float | None = None) -> None:
        given: list[Any] = [each for each in (size, y, z) if each is not None]
        if len(given) == 2 or (len(given) == 1 and isinstance(size, int | float)):
            raise InputError(f"box size: three lengths are needed, write {self.call}, got {given}")
        sides = bounded_array(given[0] if len(given) == 1 else given, (3,), "box size")
        if (sides <= 0.0).any():
            raise InputError(f"box size must be three numbers greater than 0, got {sides.tolist()}")
        object.__setattr__(self, "size", frozen(sides))

    @property
    def bounding_radius(self) -> float:
        """Half of its diagonal [m]."""
        return float(np.linalg.norm(0.5 * self.size))

    def surface(self) -> Triangles:
        """Return its six sides as triangles."""
        x, y, z = self.size
        return extruded(0.5 * np.array([[-x, -y], [x, -y], [x, y], [-x, y]]), z)

    def grown(self, margin: float) -> Triangles:
        """Return the surface of all points within a margin [m] of the box, which has rounded edges."""
        turn = np.concatenate([np.linspace(0.0, 0.5 * np.pi, 7) + 0.5 * np.pi * k for k in range(4)])
        corners = np.repeat(0.5 * self.size[:2] * [[1, 1], [-1, 1], [-1, -1], [1, -1]], 7, axis=0)
        return rounded(corners, turn, float(self.size[2]), not_negative(margin, "margin"))


@dataclass(frozen=True, slots=True)
class Sphere(Shape):
    """A ball centred on its frame. ``radius`` in metres.

    Example:
        >>> rrtik.Sphere(0.1).radius
        0.1
    """

    key = "sphere"
    measures = (Measure("radius", text="radius [m]"),)
    grouped = False
    in_urdf = True
    moveit = ("radius",)
    smooth = True

    radius: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", length(self.radius, "sphere radius"))

    @property
    def bounding_radius(self) -> float:
        """Its radius [m]."""
        return self.radius

    def surface(self, segments: int = SEGMENTS) -> Triangles:
        """Return its surface as triangles, in rings of ``segments`` each from pole to pole."""
        return round_ended(self.radius, 0.0, _segments(segments))

    def grown(self, margin: float) -> Sphere:
        """Return the ball with its radius enlarged by a margin [m]."""
        return Sphere(self.radius + not_negative(margin, "margin"))


@dataclass(frozen=True, slots=True)
class Cylinder(Shape):
    """A cylinder along z, centred on its frame. ``radius`` and full ``length`` in metres.

    Example:
        >>> rrtik.Cylinder(0.05, 0.2).length
        0.2
    """

    key = "cylinder"
    measures = (Measure("radius"), Measure("length"))
    in_urdf = True
    moveit = ("length", "radius")

    radius: float
    length: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", length(self.radius, "cylinder radius"))
        object.__setattr__(self, "length", length(self.length, "cylinder length"))

    @property
    def bounding_radius(self) -> float:
        """Distance of its edges from its centre [m]."""
        return float(np.hypot(self.radius, 0.5 * self.length))

    def surface(self) -> Triangles:
        """Return the surface of the prism over a regular polygon inscribed in its base."""
        return extruded(self.radius * _circle(SIDES)[1], self.length)

    def grown(self, margin: float) -> Triangles:
        """Return the surface of all points within a margin [m] of the cylinder, which has rounded edges."""
        turn, circle = _circle(48)
        return rounded(self.radius * circle, turn, self.length, not_negative(margin, "margin"))

    def capped(self) -> Capsule:
        """Return the capsule of the cylinder with a half ball at either end."""
        return Capsule(self.radius, self.length)


@dataclass(frozen=True, slots=True)
class Capsule(Shape):
    """A capsule along z, centred on its frame. ``length`` is the distance between the two cap centres, in metres.

    Example:
        >>> rrtik.Capsule(0.05, 0.2).radius
        0.05
    """

    key = "capsule"
    measures = (Measure("radius"), Measure("length"))
    in_urdf = True
    smooth = True

    radius: float
    length: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", length(self.radius, "capsule radius"))
        object.__setattr__(self, "length", length(self.length, "capsule length"))

    @property
    def bounding_radius(self) -> float:
        """Distance of its poles from its centre [m]."""
        return self.radius + 0.5 * self.length

    def surface(self, segments: int = SEGMENTS) -> Triangles:
        """Return its surface as triangles, in rings of ``segments`` each from pole to pole."""
        return round_ended(self.radius, self.length, _segments(segments))

    def grown(self, margin: float) -> Capsule:
        """Return the capsule with its radius enlarged by a margin [m]."""
        return Capsule(self.radius + not_negative(margin, "margin"), self.length)


@dataclass(frozen=True, slots=True, eq=False)
class HalfSpace(Shape):
    """The filled side of a plane: points with ``normal . x <= offset``; the free side is ``normal . x > offset``.

    ``normal`` is stored with unit length, and ``offset`` [m] is scaled with it.

    Example:
        >>> floor = rrtik.HalfSpace([0.0, 0.0, 2.0], offset=0.2)
        >>> floor.normal, floor.offset
        (array([0., 0., 1.]), 0.1)
    """

    key = "half_space"
    measures = (Measure("normal", "vector", None), Measure("offset", "number", default=0.0))
    bounded = False
    movable = False

    normal: Vector
    offset: float

    __reduce__ = as_value

    def __init__(self, normal: ArrayLike, offset: float = 0.0) -> None:
        direction = bounded_array(normal, (3,), "half-space normal")
        norm = float(np.linalg.norm(direction))
        if norm < 1e-9:
            raise InputError("half-space normal must not be the zero vector")
        scaled = finite_number(offset, "half-space offset") / norm
        object.__setattr__(self, "normal", frozen(direction / norm))
        object.__setattr__(self, "offset", float(bounded_array(scaled, (), "half-space offset")))

    @property
    def bounding_radius(self) -> float:
        """Infinite."""
        return float("inf")

    def surface(self) -> Triangles:
        """Refuse to draw; a viewer uses :func:`rrtik_ompl.viewer.drawing.meshes.half_space_plate`.

        Raises:
            InputError: Always.
        """
        raise InputError("a HalfSpace cannot be drawn as a bounded solid")


@dataclass(frozen=True, slots=True, eq=False)
class Prism(Shape):
    """A simple polygon in the xy-plane, extruded along z and centred about z = 0.

    Attributes:
        polygon: Vertices in order (either sense), shape (k, 2), metres; convex or not, without self-crossings and
            without places where two sides touch.
        height: Full extent along z [m].

    Example:
        >>> rrtik.Prism([[0.0, 0.0], [0.4, 0.0], [0.0, 0.3]], height=0.1).polygon.shape
        (3, 2)
    """

    key = "polygon"
    measures = (
        Measure("polygon", "points", "vertices in the xy-plane [m], in order; extruded along z, centred about z = 0"),
        Measure("height", "length", "of a polygon, along z [m]; 1 if absent", 1.0),
    )
    grouped = False

    polygon: Matrix
    height: float

    __reduce__ = as_value

    def __init__(self, polygon: ArrayLike, height: float = 1.0) -> None:
        vertices = without_repeats(bounded_array(polygon, (None, 2), "polygon"))
        if len(vertices) < 3:
            raise InputError(f"polygon needs at least 3 different vertices, got {len(vertices)}")
        check_simple(vertices)
        object.__setattr__(self, "polygon", frozen(vertices))
        object.__setattr__(self, "height", length(height, "polygon height"))

    @property
    def bounding_radius(self) -> float:
        """Distance of its farthest corner from its origin [m]."""
        return float(np.hypot(np.linalg.norm(self.polygon, axis=1).max(), 0.5 * self.height))

    def surface(self) -> Triangles:
        """Return its side walls and both polygons as triangles."""
        return extruded(self.polygon, self.height)


def _segments(given: int) -> int:
    """Validate the number of segments of a drawn ball, at least 4."""
    segments = whole_number(given, "segments", least=4)
    at_most(segments, MOST_SEGMENTS, "segments")
    return segments


def _circle(sides: int) -> tuple[Vector, Matrix]:
    """Return evenly spaced angles [rad], shape (sides,), and their points on the unit circle, shape (sides, 2)."""
    turn = np.linspace(0.0, TAU, sides, endpoint=False)
    return turn, np.stack([np.cos(turn), np.sin(turn)], 1)


_SIMPLE: tuple[type[Shape], ...] = (Box, Sphere, Cylinder, Capsule, HalfSpace, Prism)
_OF_FILES: tuple[type[Shape], ...] = (Mesh, PointCloud, HeightField, Octree)
SHAPES: dict[str, type[Shape]] = {kind.key: kind for kind in (*_SIMPLE, *_OF_FILES)}
