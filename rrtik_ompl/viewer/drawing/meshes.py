"""What a shape or a coal geometry looks like: its geometry, its placement, and the box around it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import coal
import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.geometry.collision.shape_table import shape_of
from rrtik_ompl.geometry.collision.solids import is_mesh, once_per_geometry
from rrtik_ompl.model.shapes import Box, Cylinder, HalfSpace, PointCloud, Shape, Sphere
from rrtik_ompl.model.shapes.surfaces import Faces
from rrtik_ompl.viewer.drawing.nodes import (
    BoxGeometry,
    CylinderGeometry,
    Geometry,
    PointGeometry,
    SphereGeometry,
    TriangleGeometry,
)
from rrtik_ompl.viewer.drawing.triangles import box_corners, split_creases, thin_out, tube

MAX_OBSTACLE_TRIANGLES = 30_000  # a drawn mesh above this is thinned out; the one that is checked stays as it is
MOST_POINTS = 200_000  # drawn of a cloud; a page has 16 bytes for each, and has to open soon
BEAD = 0.9  # radius of the bead that stands for a robot that is a mere point, in thicknesses of a line
_Y_TO_Z = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])  # three.js has its cylinders along y


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """How one solid is drawn.

    Attributes:
        geometry: The solid that three.js draws.
        placement: Pose (or pose and scale) of that geometry in the solid's frame, shape (4, 4).
        corners: Corners of a box around the solid in its frame, shape (8, 3) [m].
    """

    geometry: Geometry
    placement: NDArray[np.float64]
    corners: Matrix


def look_of_shape(shape: Shape, limit: int = MAX_OBSTACLE_TRIANGLES) -> Look:
    """How a bounded shape is drawn; a mesh with at most ``limit`` triangles.

    Raises:
        InputError: For a half-space, which has no end: see :func:`half_space_plate`.
    """
    own = OWN_LOOKS.get(type(shape))
    if own is not None:
        return own(shape)

    surface = shape.surface()
    if shape.smooth:
        return look_of_triangles(*surface)

    return look_of_triangles(*split_creases(*(thin_out(*surface, limit) if shape.fine else surface)))


def look_of_margin(shape: Shape, margin: float) -> Look | None:
    """How everything within a margin [m] of a shape is drawn; None if the shape does not know it."""
    grown = shape.grown(margin)
    if grown is None:
        return None
    return look_of_shape(grown) if isinstance(grown, Shape) else look_of_triangles(*grown)


def look_of_triangles(vertices: Matrix, faces: Faces) -> Look:
    """How a triangle mesh is drawn, as it is."""
    return Look(TriangleGeometry(vertices, faces), np.eye(4), box_corners(vertices))


def half_space_plate(shape: HalfSpace, centre: ArrayLike, size: float) -> tuple[Look, NDArray[np.float64]]:
    """A thin plate whose upper side lies in the plane of a half-space, and its pose in the half-space's frame.

    Args:
        shape: The half-space.
        centre: Point in the half-space's frame near which the plate is wanted, shape (3,) [m].
        size: Side length of the plate [m].
    """
    thickness = 0.002 * size
    near = np.asarray(centre, dtype=np.float64)
    # The plate lies half its thickness below the plane, so that its upper side is in it.
    foot = near - (shape.normal @ near - shape.offset + 0.5 * thickness) * shape.normal

    pose = np.eye(4)
    pose[:3, :3] = _frame_along(shape.normal)
    pose[:3, 3] = foot

    return look_of_shape(Box([size, size, thickness])), pose


def _frame_along(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """A rotation whose z axis is ``normal``, shape (3, 3)."""
    aside = np.eye(3)[int(np.argmin(np.abs(normal)))]
    x = np.cross(aside, normal)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(normal, x), normal], 1)


def thickened(look: Look, least: float) -> Look:
    """The same, or for what is too thin to be seen a rod of thickness ``least`` [m], or for a point a larger bead."""
    sides = np.ptp(look.corners, axis=0)
    if np.median(sides) >= least:
        return look

    middle = look.corners.mean(axis=0)
    half = 0.5 * np.where(sides == sides.max(), sides, 0.0)
    if sides.max() >= 2.0 * least:
        return look_of_triangles(*tube(np.stack([middle - half, middle + half]), 0.5 * least))

    place = np.eye(4)
    place[:3, 3] = middle
    return Look(SphereGeometry(BEAD * least), place, look.corners)


def triangle_count(geometry: coal.CollisionGeometry) -> int:
    """Triangles of a coal mesh; 0 for every other geometry."""
    return int(geometry.num_tris) if is_mesh(geometry) else 0


def look_of_coal(geometry: coal.CollisionGeometry, limit: int = MAX_OBSTACLE_TRIANGLES) -> Look | None:
    """How a coal geometry is drawn, with at most ``limit`` triangles; None if it has no bounded surface (a plane)."""
    if isinstance(geometry, coal.Ellipsoid):
        stretch = np.diag([*geometry.radii, 1.0])
        return Look(SphereGeometry(1.0), stretch, box_corners([-geometry.radii, geometry.radii]))

    if isinstance(geometry, coal.Cone):
        half = [geometry.radius, geometry.radius, geometry.halfLength]
        cone = CylinderGeometry(2.0 * geometry.halfLength, 0.0, geometry.radius)
        return _primitive(cone, _Y_TO_Z, half)

    try:
        shape = _shape_of(geometry)
        return None if shape is None else look_of_shape(shape, limit)
    except InputError:  # a link's mesh without area: nothing to see
        return None


def _primitive(geometry: Geometry, placement: NDArray[np.float64], half: ArrayLike) -> Look:
    sides = np.asarray(half, dtype=np.float64)
    return Look(geometry, placement, box_corners([-sides, sides]))


@once_per_geometry
def _shape_of(geometry: coal.CollisionGeometry) -> Shape | None:
    """The shape of a coal geometry; an arm and its ghosts, which have fewer triangles, ask for the same."""
    return shape_of(geometry)


def _points(cloud: PointCloud) -> PointGeometry:
    """Points of a cloud, of a very large one some of them."""
    return PointGeometry(cloud.points[:: -(-len(cloud.points) // MOST_POINTS)], cloud.radius)


# What three.js draws by itself, smoother and in fewer bytes than triangles.
OWN_LOOKS: dict[type[Shape], Callable[[Any], Look]] = {
    Sphere: lambda ball: _primitive(SphereGeometry(ball.radius), np.eye(4), np.full(3, ball.radius)),
    Cylinder: lambda solid: _primitive(
        CylinderGeometry(solid.length, solid.radius, solid.radius),
        _Y_TO_Z,
        [solid.radius, solid.radius, 0.5 * solid.length],
    ),
    Box: lambda box: _primitive(BoxGeometry(tuple(box.size.tolist())), np.eye(4), 0.5 * box.size),
    PointCloud: lambda cloud: Look(_points(cloud), np.eye(4), box_corners(np.stack(cloud.bounds))),
}
