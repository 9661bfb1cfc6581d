"""Shapes as coal solids, and back: one table with a row for each kind of shape.

All that the library does by the kind of a coal geometry starts here. Kinds that are in no row (cones, ellipsoids,
planes, which URDF files may bring) are checked by coal alone.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector, frozen
from rrtik_ompl.geometry.collision.cloud_solid import CloudSolid, cloud_solid
from rrtik_ompl.geometry.collision.solids import (
    bvh,
    convex_arrays,
    convexified,
    hull,
    is_mesh,
    measured,
    mesh_arrays,
    once_per_geometry,
    vertices_of,
)
from rrtik_ompl.model.shapes import (
    Box,
    Capsule,
    Cylinder,
    HalfSpace,
    HeightField,
    Mesh,
    Octree,
    PointCloud,
    Prism,
    Shape,
    Sphere,
)
from rrtik_ompl.model.shapes.box_pile import BoxPile
from rrtik_ompl.model.shapes.polygons import convex_parts

if TYPE_CHECKING:
    pass

BOX_CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))


@dataclass(frozen=True, slots=True, eq=False)
class Core:
    """A solid as all that is no farther than a radius from a core: a point, a segment of the z axis, a disc, a box.

    Attributes:
        corners: Of the core, centred on the origin: one, two on the z axis (the upper one first), or the eight of a
            box, the one of the largest coordinates last; shape (n, 3) [m].
        disc: Radius of the disc across z around each corner [m], None if there is no disc.
        radius: Of the ball around every point of the core [m].
    """

    corners: Matrix
    disc: float | None = None
    radius: float = 0.0

    @property
    def rounded(self) -> bool:
        """Whether it is a ball or a capsule, which stay one when they grow."""
        return self.disc is None and len(self.corners) <= 2

    @property
    def half_length(self) -> float:
        """Half the length of a point, a segment or a cylinder [m]."""
        return float(self.corners[0, 2])

    @property
    def half_sides(self) -> Vector | None:
        """Half sides of a box, shape (3,) [m]; None if it is no box."""
        return self.corners[-1] if len(self.corners) == len(BOX_CORNERS) else None


@dataclass(frozen=True, slots=True, eq=False)
class CoalSolid:
    """What coal has for one kind of shape.

    Attributes:
        geometry: Its class.
        sizes: Sizes of such a geometry, in coal's own measures.
        shape: The shape from these sizes.
        core: Its core from these sizes; None if it has none of the simple ones.
    """

    geometry: type
    sizes: Callable[[Any], Vector]
    shape: Callable[..., Shape]
    core: Callable[..., Core] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class ShapeRow:
    """How coal checks one kind of shape.

    Attributes:
        shape: Its class.
        solids: Coal geometries whose union is the shape.
        coal: What coal has for it; None if it becomes convex solids or a mesh.
        places: Where in the shape's frame each of these geometries is (``pinocchio.SE3``); all at its origin if None.
    """

    shape: type[Shape]
    solids: Callable[[Any], Sequence[Any]]
    coal: CoalSolid | None = None
    places: Callable[[Any], Sequence[Any]] | None = None


def box_corners(half: Vector) -> Matrix:
    """Corners of a box about the origin with these half sides, shape (8, 3)."""
    return frozen(BOX_CORNERS * half)


def _radius_and_half_length(geometry: coal.CollisionGeometry) -> Vector:
    return np.array([geometry.radius, geometry.halfLength])


def _ends(half_length: float) -> Matrix:
    return frozen([[0.0, 0.0, half_length], [0.0, 0.0, -half_length]])


def _extruded(polygon: Matrix, height: float) -> Matrix:
    low = np.column_stack([polygon, np.full(len(polygon), -0.5 * height)])
    high = np.column_stack([polygon, np.full(len(polygon), 0.5 * height)])
    return np.vstack([low, high])


def _mesh(mesh: Mesh) -> list[Any]:
    surface = bvh(mesh.vertices, mesh.triangles)
    return [convexified(surface) if mesh.closed else surface]


def _solids_of_pile(pile: BoxPile) -> list[Any]:
    """A box of coal for each box; those of one size share it."""
    sizes = pile.boxes[1].tolist()
    box_of_size = {tuple(size): coal.Box(*size) for size in sizes}
    return [box_of_size[tuple(size)] for size in sizes]


def _places_of_pile(pile: BoxPile) -> list[Any]:
    upright = np.eye(3)
    return [pin.SE3(upright, centre) for centre in pile.boxes[0]]


ROWS = (
    ShapeRow(
        Box,
        lambda box: [coal.Box(*box.size)],
        CoalSolid(
            coal.Box,
            sizes=lambda geometry: np.array(geometry.halfSide, dtype=np.float64),
            shape=lambda *half: Box(2.0 * np.array(half)),
            core=lambda *half: Core(box_corners(np.array(half))),
        ),
    ),
    ShapeRow(
        Sphere,
        lambda ball: [coal.Sphere(ball.radius)],
        CoalSolid(
            coal.Sphere,
            sizes=lambda geometry: np.array([geometry.radius]),
            shape=Sphere,
            core=lambda radius: Core(frozen(np.zeros((1, 3))), radius=radius),
        ),
    ),
    ShapeRow(
        Cylinder,
        lambda solid: [coal.Cylinder(solid.radius, solid.length)],
        CoalSolid(
            coal.Cylinder,
            sizes=_radius_and_half_length,
            shape=lambda radius, half: Cylinder(radius, 2.0 * half),
            core=lambda radius, half: Core(_ends(half), disc=radius),
        ),
    ),
    ShapeRow(
        Capsule,
        lambda solid: [coal.Capsule(solid.radius, solid.length)],
        CoalSolid(
            coal.Capsule,
            sizes=_radius_and_half_length,
            shape=lambda radius, half: Capsule(radius, 2.0 * half),
            core=lambda radius, half: Core(_ends(half), radius=radius),
        ),
    ),
    ShapeRow(HalfSpace, lambda plane: [coal.Halfspace(np.array(plane.normal), plane.offset)]),
    ShapeRow(Prism, lambda prism: [hull(_extruded(part, prism.height)) for part in convex_parts(prism.polygon)]),
    ShapeRow(Mesh, _mesh),
    ShapeRow(PointCloud, lambda cloud: [cloud_solid(cloud)]),
    ShapeRow(HeightField, _solids_of_pile, places=_places_of_pile),
    ShapeRow(Octree, _solids_of_pile, places=_places_of_pile),
)
_BY_SHAPE: dict[type, ShapeRow] = {}
_BY_GEOMETRY: dict[type, CoalSolid] = {}


def add_row(row: ShapeRow) -> None:
    """Make a kind of shape known, beside those of ``ROWS``."""
    _BY_SHAPE[row.shape] = row
    if row.coal is not None:
        _BY_GEOMETRY[row.coal.geometry] = row.coal


for _row in ROWS:
    add_row(_row)


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """One coal geometry of a shape and its placement in the shape's frame (``pinocchio.SE3``)."""

    geometry: Any
    placement: Any


def pieces(shape: Shape) -> tuple[Piece, ...]:
    """Coal geometries whose union is the shape; shapes of the same measures have the same ones.

    Raises:
        InputError: If a part of it is too flat, too small or too large to check.
    """
    kind = type(shape)
    if kind not in _BY_SHAPE:
        raise TypeError(f"no coal geometry for {kind.__name__}")

    numbers = tuple(np.asarray(getattr(shape, measure.name)).tobytes() for measure in kind.measures)
    return _cached_pieces(_Measured(kind, numbers, shape)) if numbers else _pieces(shape)


@dataclass(frozen=True, slots=True)
class _Measured:
    """A shape as a key: equal to others of its kind and measures."""

    kind: type[Shape]
    numbers: tuple[bytes, ...]
    shape: Shape = field(compare=False)


@lru_cache(maxsize=4096)
def _cached_pieces(key: _Measured) -> tuple[Piece, ...]:
    return _pieces(key.shape)


def _pieces(shape: Shape) -> tuple[Piece, ...]:
    row = _BY_SHAPE[type(shape)]
    solids = [measured(solid) for solid in row.solids(shape)]
    places = [pin.SE3.Identity()] * len(solids) if row.places is None else row.places(shape)
    return tuple(map(Piece, solids, places))


def sizes_of(geometry: coal.CollisionGeometry) -> Vector | None:
    """The numbers that give a coal geometry; None if its kind is in no row."""
    row = _BY_GEOMETRY.get(type(geometry))
    return None if row is None else row.sizes(geometry)


def numbers_of(geometry: coal.CollisionGeometry) -> tuple[NDArray[Any], ...] | None:
    """All numbers that give a coal geometry: its sizes, the arrays of a mesh, the vertices of a convex solid.

    None if its kind has none of them: a half-space, a cloud, a kind that is in no row.
    """
    sizes = sizes_of(geometry)
    if sizes is not None:
        return (sizes,)
    if is_mesh(geometry):
        return mesh_arrays(geometry)
    vertices = vertices_of(geometry)
    return None if vertices is None else (vertices,)


def resized(geometry: coal.CollisionGeometry, factor: float) -> coal.CollisionGeometry | None:
    """A coal geometry whose sizes are a factor larger, about its own frame; None if its kind is in no row."""
    row = _BY_GEOMETRY.get(type(geometry))
    if row is None:
        return None
    shape = row.shape(*(factor * row.sizes(geometry)).tolist())
    return pieces(shape)[0].geometry


def has_core(geometry: coal.CollisionGeometry) -> bool:
    """Whether a coal geometry has one of the simple cores."""
    row = _BY_GEOMETRY.get(type(geometry))
    return row is not None and row.core is not None


def core_of(geometry: coal.CollisionGeometry) -> Core | None:
    """The core of a coal geometry; None if it has none of the simple ones."""
    return _core(geometry) if has_core(geometry) else None


@once_per_geometry  # a solid that moves keeps its own
def _core(geometry: coal.CollisionGeometry) -> Core:
    row = _BY_GEOMETRY[type(geometry)]
    assert row.core is not None
    return row.core(*row.sizes(geometry).tolist())


def shape_of(geometry: coal.CollisionGeometry) -> Shape | None:
    """The shape of a coal geometry, for whoever draws; None if there is no such shape (a plane, a cone).

    Raises:
        InputError: If it is a mesh without area.
    """
    row = _BY_GEOMETRY.get(type(geometry))
    if row is not None:
        return row.shape(*row.sizes(geometry).tolist())
    if isinstance(geometry, CloudSolid):
        return geometry.cloud
    if is_mesh(geometry):
        return Mesh(*mesh_arrays(geometry))
    if isinstance(geometry, coal.Convex):
        return Mesh(*convex_arrays(geometry))
    return None


def farthest(shape: Shape, pose: pin.SE3) -> float:
    """An upper bound of the distance of a shape's points from the origin [m]; of a half-space that is infinite.

    Args:
        shape: What it is.
        pose: Where it is, ``pinocchio.SE3``.
    """
    if not shape.bounded:
        return float("inf")
    solids = [(piece.geometry, pose * piece.placement) for piece in pieces(shape)]
    return max(float(np.linalg.norm(place.act(s.aabb_center)) + s.aabb_radius) for s, place in solids)
