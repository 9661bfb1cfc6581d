"""Convert shapes to coal geometries and back: one table with a row for each kind of shape.

Everything in the library that depends on the kind of a coal geometry starts here. Kinds without a row (cones,
ellipsoids and planes, which URDF files may contain) are checked by coal alone.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector, frozen
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
from rrtik_ompl.model.shapes.octree import FEW_CELLS
from rrtik_ompl.model.shapes.polygons import convex_parts

BOX_CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))


@dataclass(frozen=True, slots=True, eq=False)
class Core:
    """A solid described as all points within a radius of its core: a point, a segment of the z axis, a disc or a box.

    Attributes:
        corners: Corners of the core, centred on the origin, shape (n, 3) [m]: one for a point, two on the z axis
            (the upper one first) for a segment or a cylinder, eight for a box, the one with the largest coordinates
            last.
        disc: Radius of the disc perpendicular to z around each corner [m]; None if there is no disc.
        radius: Radius of the ball around every point of the core [m].
    """

    corners: Matrix
    disc: float | None = None
    radius: float = 0.0

    @property
    def rounded(self) -> bool:
        """Check whether the solid is a ball or a capsule, which stay a ball or a capsule when they grow."""
        return self.disc is None and len(self.corners) <= 2

    @property
    def half_length(self) -> float:
        """Return half the length along z of a point, a segment or a cylinder [m]."""
        return float(self.corners[0, 2])

    @property
    def half_sides(self) -> Vector | None:
        """Return the half sides of a box, shape (3,) [m]; None for other cores."""
        return self.corners[-1] if len(self.corners) == len(BOX_CORNERS) else None


@dataclass(frozen=True, slots=True, eq=False)
class CoalSolid:
    """The coal geometry that represents one kind of shape.

    Attributes:
        geometry: The class of the coal geometry.
        sizes: Function that returns the sizes of such a geometry, in coal's own measures.
        shape: Function that makes the shape from these sizes.
        core: Function that makes the `Core` from these sizes; None if the solid has no simple core.
    """

    geometry: type
    sizes: Callable[[Any], Vector]
    shape: Callable[..., Shape]
    core: Callable[..., Core] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class ShapeRow:
    """One row of the table: how coal checks one kind of shape.

    Attributes:
        shape: The class of the shape.
        solids: Function that returns the coal geometries whose union is the shape.
        coal: The coal geometry of this kind; None if the shape becomes convex solids or a mesh.
        places: Function that returns the poses of the geometries in the shape's frame (``pinocchio.SE3``); None if all
            are at its origin.
    """

    shape: type[Shape]
    solids: Callable[[Any], Sequence[Any]]
    coal: CoalSolid | None = None
    places: Callable[[Any], Sequence[Any]] | None = None


def box_corners(half: Vector) -> Matrix:
    """Return the corners of a box about the origin, shape (8, 3), from its half sides, shape (3,)."""
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
    """Return the closed parts of a mesh, which have an inside, as one coal geometry, and the open ones as another."""
    if mesh.closed:
        return [convexified(bvh(mesh.vertices, mesh.triangles))]
    is_closed_part = mesh.in_closed_parts
    solid = [convexified(_surface(mesh, is_closed_part))] if is_closed_part.any() else []
    return [*solid, _surface(mesh, ~is_closed_part)]


def _surface(mesh: Mesh, chosen: Mask) -> coal.BVHModelBase:
    """Return the chosen triangles of a mesh, and the vertices that they use, as a coal mesh."""
    used, renumbered = np.unique(mesh.triangles[chosen], return_inverse=True)
    return bvh(mesh.vertices[used], np.asarray(renumbered).reshape(-1, 3))


def _solids_of_pile(pile: BoxPile) -> list[Any]:
    """Return one coal box for each box of the pile; boxes of equal size share one object."""
    sizes = pile.boxes[1].tolist()
    box_of_size = {tuple(size): coal.Box(*size) for size in sizes}
    return [box_of_size[tuple(size)] for size in sizes]


def _solids_of_octree(octree: Octree) -> list[Any]:
    """Return a coal box for each of a few cells, or the clouds that many are."""
    few = len(octree.sides) <= FEW_CELLS
    return _solids_of_pile(octree) if few else [cloud_solid(cells) for cells in octree.clouds]


def _places_of_octree(octree: Octree) -> list[Any]:
    few = len(octree.sides) <= FEW_CELLS
    return _places_of_pile(octree) if few else [pin.SE3.Identity()] * len(octree.clouds)


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
    ShapeRow(Octree, _solids_of_octree, places=_places_of_octree),
)
_BY_SHAPE: dict[type, ShapeRow] = {}
_BY_GEOMETRY: dict[type, CoalSolid] = {}


def add_row(row: ShapeRow) -> None:
    """Add a kind of shape to the table, in addition to those of ``ROWS``."""
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
    """Return the coal geometries whose union is the shape; shapes with equal measures share them.

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
    """A cache key for a shape: equal for shapes of the same kind and measures."""

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
    """Return the sizes that define a coal geometry, in the order of its row; None if its kind has no row."""
    row = _BY_GEOMETRY.get(type(geometry))
    return None if row is None else row.sizes(geometry)


def numbers_of(geometry: coal.CollisionGeometry) -> tuple[NDArray[Any], ...] | None:
    """Return all numbers that define a coal geometry: its sizes, a mesh's arrays, or a convex solid's vertices.

    The answer is None for the other kinds: half-spaces, clouds, and kinds without a row.
    """
    sizes = sizes_of(geometry)
    if sizes is not None:
        return (sizes,)
    if is_mesh(geometry):
        return mesh_arrays(geometry)
    vertices = vertices_of(geometry)
    return None if vertices is None else (vertices,)


def resized(geometry: coal.CollisionGeometry, factor: float) -> coal.CollisionGeometry | None:
    """Return a coal geometry scaled by a factor about the origin of its frame; None if its kind has no row."""
    row = _BY_GEOMETRY.get(type(geometry))
    if row is None:
        return None
    shape = row.shape(*(factor * row.sizes(geometry)).tolist())
    return pieces(shape)[0].geometry


def has_core(geometry: coal.CollisionGeometry) -> bool:
    """Check whether a coal geometry has one of the simple cores."""
    row = _BY_GEOMETRY.get(type(geometry))
    return row is not None and row.core is not None


def core_of(geometry: coal.CollisionGeometry) -> Core | None:
    """Return the core of a coal geometry; None if it has none of the simple ones."""
    return _core(geometry) if has_core(geometry) else None


@once_per_geometry
def _core(geometry: coal.CollisionGeometry) -> Core:
    row = _BY_GEOMETRY[type(geometry)]
    assert row.core is not None
    return row.core(*row.sizes(geometry).tolist())


def shape_of(geometry: coal.CollisionGeometry) -> Shape | None:
    """Return the shape of a coal geometry, for drawing; None if there is no such shape (as for a plane or a cone).

    Raises:
        InputError: If it is a mesh without area.
    """
    row = _BY_GEOMETRY.get(type(geometry))
    if row is not None:
        return row.shape(*row.sizes(geometry).tolist())
    if isinstance(geometry, CloudSolid):
        cloud = geometry.cloud
        return cloud if isinstance(cloud, Shape) else Octree(cloud.points, 2.0 * cloud.half)
    if is_mesh(geometry):
        return Mesh(*mesh_arrays(geometry))
    if isinstance(geometry, coal.Convex):
        return Mesh(*convex_arrays(geometry))
    return None


def farthest(shape: Shape, pose: pin.SE3) -> float:
    """Return an upper bound on the distance of a shape's points from the origin [m]; infinite for a half-space.

    Args:
        shape: The shape.
        pose: Its pose, a ``pinocchio.SE3``.
    """
    if not shape.bounded:
        return float("inf")
    solids = [(piece.geometry, pose * piece.placement) for piece in pieces(shape)]
    return max(float(np.linalg.norm(place.act(s.aabb_center)) + s.aabb_radius) for s, place in solids)
