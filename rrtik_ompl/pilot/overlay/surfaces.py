"""What a rasteriser takes: triangles with normals and colours, grouped by the frame that they move with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.geometry.collision.shape_table import shape_of
from rrtik_ompl.geometry.collision.solids import is_mesh
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Obstacle
from rrtik_ompl.model.shapes import Shape
from rrtik_ompl.model.shapes.surfaces import Faces
from rrtik_ompl.viewer.drawing import palette
from rrtik_ompl.viewer.drawing.triangles import split_creases, thin_out

ROBOT_TRIANGLES = 20_000
OBSTACLE_TRIANGLES = 5_000
MAX_SHAPES = 4_000  # whose surfaces are kept


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """Triangles of one colour in one frame.

    Attributes:
        vertices: Shape (n, 3) [m].
        normals: Unit vectors out of the solid, shape (n, 3).
        faces: Counter-clockwise seen from outside, shape (m, 3).
        color: Red, green, blue from 0 to 1, shape (3,).
        frame: Number of the frame that carries it: Pinocchio's joint for a link.
    """

    vertices: Matrix
    normals: Matrix
    faces: Faces
    color: NDArray[np.float64]
    frame: int = 0


def surface_of_shape(shape: Shape, color: str, frame: int = 0, triangles: int = OBSTACLE_TRIANGLES) -> Surface:
    """The surface of a bounded shape.

    Raises:
        InputError: For a half-space, which has no end.
    """
    vertices, faces = split_creases(*_triangles(shape, triangles))
    return Surface(vertices, _normals(vertices, faces), faces, np.array(palette.fractions(color)), frame)


def robot_surfaces(robot: Robot, triangles: int = ROBOT_TRIANGLES) -> tuple[Surface, ...]:
    """The links in at most about so many triangles: what is to be seen of them, else what collides."""
    drawn = _link_surfaces(robot.visual.geometryObjects, triangles)
    return drawn or _link_surfaces(robot.collision.geometryObjects, triangles)


class ShapeSurfaces:
    """Surfaces of obstacles' shapes, each made once: what moves from picture to picture keeps its shape."""

    def __init__(self) -> None:
        self._made: dict[int, tuple[Shape, Surface]] = {}  # with the shape, so that no other gets its identity

    def of(self, shape: Shape) -> Surface:
        """The surface of a bounded shape in the colour of obstacles."""
        shape_and_surface = self._made.get(id(shape))
        if shape_and_surface is None:
            if len(self._made) >= MAX_SHAPES:
                self._made.clear()
            shape_and_surface = self._made[id(shape)] = (
                shape,
                surface_of_shape(shape, palette.OBSTACLE),
            )
        return shape_and_surface[1]


def obstacle_surfaces(obstacles: Sequence[Obstacle], made: ShapeSurfaces | None = None) -> tuple[Surface, ...]:
    """Bounded obstacles in the frame of the world, by surfaces that may be made already; half-spaces are left out."""
    surfaces = ShapeSurfaces() if made is None else made
    bounded = [obstacle for obstacle in obstacles if obstacle.shape.bounded]
    return tuple(
        moved(surfaces.of(obstacle.shape), obstacle.pose.rotation, obstacle.pose.translation) for obstacle in bounded
    )


def moved(surface: Surface, rotation: NDArray[np.float64], translation: NDArray[np.float64]) -> Surface:
    """The same surface elsewhere."""
    vertices = surface.vertices @ rotation.T + translation
    return Surface(vertices, surface.normals @ rotation.T, surface.faces, surface.color, surface.frame)


def _link_surfaces(bodies: Sequence[object], triangles: int) -> tuple[Surface, ...]:
    counts = [int(b.geometry.num_tris) if is_mesh(b.geometry) else 0 for b in bodies]  # type: ignore[attr-defined]
    surfaces = []
    for body, count in zip(bodies, counts, strict=True):
        surface = _link_surface(body, max(triangles * count // max(sum(counts), 1), 200))
        if surface is not None:
            surfaces.append(surface)
    return tuple(surfaces)


def _link_surface(body: object, limit: int) -> Surface | None:
    geometry = body.geometry  # type: ignore[attr-defined]
    joint = body.parentJoint  # type: ignore[attr-defined]
    placement = body.placement  # type: ignore[attr-defined]

    color = palette.ROBOT_ALTERNATE if joint % 2 else palette.ROBOT
    if body.overrideMaterial:  # type: ignore[attr-defined]
        color = palette.hexadecimal(body.meshColor[:3])  # type: ignore[attr-defined]

    try:
        shape = shape_of(geometry)
    except InputError:  # a mesh without area: nothing to see
        return None
    if shape is None or not shape.bounded:
        return None
    return moved(surface_of_shape(shape, color, joint, limit), placement.rotation, placement.translation)


def _triangles(shape: Shape, limit: int) -> tuple[Matrix, Faces]:
    surface = shape.surface()
    if shape.fine:
        return thin_out(*surface, limit)
    return _welded(*surface) if shape.smooth else surface


def _welded(vertices: Matrix, faces: Faces) -> tuple[Matrix, Faces]:
    """The same with vertices at one place made one, and without triangles that lose their area by that."""
    _, first_rows, merged_number = np.unique(np.round(vertices, 12), axis=0, return_index=True, return_inverse=True)
    merged = np.asarray(merged_number).reshape(-1)[faces]

    has_area = (merged != np.roll(merged, 1, axis=1)).all(axis=1)
    return vertices[first_rows], merged[has_area].astype(np.int64)


def _normals(vertices: Matrix, faces: Faces) -> Matrix:
    """Means of the normals of the triangles at each vertex, weighted by their area."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)

    total = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(total, faces[:, k], across)

    unit: Matrix = total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-300)
    return unit
