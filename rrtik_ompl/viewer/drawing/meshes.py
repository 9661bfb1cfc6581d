"""Convert shapes and coal geometries to drawable geometries with their placement and bounding box."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import coal
import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.errors import InputError, few
from rrtik_ompl.geometry.collision.shape_table import shape_of
from rrtik_ompl.geometry.collision.solids import is_mesh, once_per_geometry
from rrtik_ompl.model.scene import AttachedObject, Obstacle, Scene
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

# Meshes with more triangles are simplified for drawing; collision checks use the original mesh.
MAX_OBSTACLE_TRIANGLES = 30_000
MOST_POINTS = 200_000  # largest number of points drawn of a cloud, limited because each adds 16 bytes to the page
# Radius of the bead that represents a point robot, in units of the thickness of a line.
BEAD = 0.9
_Y_TO_Z = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])  # cylinders of three.js are along y


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """The drawable form of one solid.

    Attributes:
        geometry: The geometry that three.js draws.
        placement: Pose (or pose and scale) of that geometry in the solid's frame, shape (4, 4).
        corners: Corners of a box around the solid in its frame, shape (8, 3) [m].
    """

    geometry: Geometry
    placement: NDArray[np.float64]
    corners: Matrix


def look_of_shape(shape: Shape, limit: int = MAX_OBSTACLE_TRIANGLES) -> Look:
    """Return the look of a bounded shape; a mesh is simplified to at most ``limit`` triangles.

    Raises:
        InputError: For a half-space, which is unbounded: see :func:`half_space_plate`.
    """
    own = OWN_LOOKS.get(type(shape))
    if own is not None:
        return own(shape)

    surface = shape.surface()
    if shape.smooth:
        return look_of_triangles(*surface)

    return look_of_triangles(*split_creases(*(thin_out(*surface, limit) if shape.fine else surface)))


def drawn_coarser(scene: Scene) -> str:
    """Return in words which obstacles and held objects are drawn with fewer triangles or points than they have."""
    told = []
    things: list[Obstacle | AttachedObject] = [*scene.obstacles, *scene.attached]
    for each in things:
        if isinstance(each.shape, PointCloud):
            count = len(each.shape.points)
            most = MOST_POINTS
            elements = "points"
        else:
            count = len(each.shape.surface()[1]) if each.shape.fine else 0
            most = MAX_OBSTACLE_TRIANGLES
            elements = "triangles"
        if count > most:
            told.append(f"'{each.name}' with at most {most:,} of its {count:,} {elements}")

    return f"drawn coarser than it is: {few(told)}; checks and plans use all of them" if told else ""


def look_of_margin(shape: Shape, margin: float) -> Look | None:
    """Return the look of everything within a margin [m] of a shape; None if the shape cannot compute it."""
    grown = shape.grown(margin)
    if grown is None:
        return None
    return look_of_shape(grown) if isinstance(grown, Shape) else look_of_triangles(*grown)


def look_of_triangles(vertices: Matrix, faces: Faces) -> Look:
    """Return the look of a triangle mesh, unchanged."""
    return Look(TriangleGeometry(vertices, faces), np.eye(4), box_corners(vertices))


def half_space_plate(shape: HalfSpace, centre: ArrayLike, size: float) -> tuple[Look, NDArray[np.float64]]:
    """Return a thin plate whose upper side is in the plane of a half-space.

    Args:
        shape: The half-space.
        centre: Point in the half-space's frame near which the plate is placed, shape (3,) [m].
        size: Side length of the plate [m].

    Returns:
        The look of the plate, and its pose in the half-space's frame, shape (4, 4).
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
    """Return a rotation whose z axis is ``normal``, shape (3, 3)."""
    aside = np.eye(3)[int(np.argmin(np.abs(normal)))]
    x = np.cross(aside, normal)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(normal, x), normal], 1)


def thickened(look: Look, least: float) -> Look:
    """Return a visible look: a rod of thickness ``least`` [m] for a thinner solid, a bead for a point."""
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
    """Return the number of triangles of a coal mesh; 0 for every other geometry."""
    return int(geometry.num_tris) if is_mesh(geometry) else 0


def look_of_coal(geometry: coal.CollisionGeometry, limit: int = MAX_OBSTACLE_TRIANGLES) -> Look | None:
    """Return the look of a coal geometry, with at most ``limit`` triangles; None if it is unbounded (a plane)."""
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
    except InputError:  # the mesh of a link has no area: nothing to draw
        return None


def _primitive(geometry: Geometry, placement: NDArray[np.float64], half: ArrayLike) -> Look:
    sides = np.asarray(half, dtype=np.float64)
    return Look(geometry, placement, box_corners([-sides, sides]))


@once_per_geometry
def _shape_of(geometry: coal.CollisionGeometry) -> Shape | None:
    """Return the shape of a coal geometry; cached, because an arm and its ghosts ask for the same."""
    return shape_of(geometry)


def _points(cloud: PointCloud) -> PointGeometry:
    """Return the points of a cloud; of a very large cloud only some of them."""
    return PointGeometry(cloud.points[:: -(-len(cloud.points) // MOST_POINTS)], cloud.radius)


# Shapes that three.js draws by itself, smoother and in fewer bytes than triangles.
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
