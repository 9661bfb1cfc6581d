"""Convert solids to triangles, place them in front of a camera, and draw them with OpenCV's rasteriser, or in numpy.

A `Surface` holds the triangles of one solid. A `Figure` joins many surfaces in one set of arrays, sorted by the frame
that carries them. `placed` transforms a figure to the frame of a camera in a few array operations; this is the work of
every picture. A `Canvas` holds the colours and depths of a picture. OpenCV's rasteriser accepts only an opening angle:
focal lengths, the principal point and half a pixel are folded into the view matrix.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.colors import fractions, hexadecimal
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.geometry.collision.shape_table import shape_of
from rrtik_ompl.geometry.collision.solids import is_mesh
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Obstacle
from rrtik_ompl.model.shapes import Shape
from rrtik_ompl.model.shapes.surfaces import Faces
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.viewer.drawing import palette
from rrtik_ompl.viewer.drawing.triangle_raster import rasterize
from rrtik_ompl.viewer.drawing.triangles import split_creases, thin_out, vertex_normals

ROBOT_TRIANGLES = 20_000
OBSTACLE_TRIANGLES = 5_000
MAX_SHAPES = 4_000  # number of shapes whose surfaces are cached
AMBIENT = 0.35  # share of ambient light; the rest comes from the camera
NEAREST_DRAWN = 0.05  # [m]
FARTHEST_DRAWN = 50.0  # [m]


# --- solids as triangles ---------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """Triangles of one colour in one frame.

    Attributes:
        vertices: Shape (n, 3) [m].
        normals: Unit vectors at the vertices that point out of the solid, shape (n, 3).
        faces: Vertex indices, counter-clockwise seen from outside, shape (m, 3).
        color: Red, green, blue from 0 to 1, shape (3,).
        frame: Number of the frame that carries it: Pinocchio's joint for a link.
    """

    vertices: Matrix
    normals: Matrix
    faces: Faces
    color: NDArray[np.float64]
    frame: int = 0


def surface_of_shape(shape: Shape, color: str, frame: int = 0, triangles: int = OBSTACLE_TRIANGLES) -> Surface:
    """Return the surface of a bounded shape.

    Raises:
        InputError: For a half-space, which has no boundary.
    """
    vertices, faces = split_creases(*_triangles(shape, triangles))
    return Surface(vertices, vertex_normals(vertices, faces), faces, np.array(fractions(color)), frame)


def robot_surfaces(
    robot: Robot, triangles: int = ROBOT_TRIANGLES, frames: Sequence[int] | None = None
) -> tuple[Surface, ...]:
    """Return the surfaces of the links with about ``triangles`` triangles at most.

    The visual geometry is used; a robot without it is drawn by its collision geometry. ``frames`` has the number of the
    frame that carries each of these solids in place of its joint's.
    """
    drawn = _link_surfaces(robot.visual.geometryObjects, triangles, frames)
    return drawn or _link_surfaces(robot.collision.geometryObjects, triangles, frames)


class ShapeSurfaces:
    """Cache of the surfaces of obstacles' shapes: an obstacle that moves from picture to picture keeps its shape."""

    def __init__(self) -> None:
        # Keyed by the id of the shape. The shape is stored, too, because Python reuses ids of deleted objects.
        self._made: dict[int, tuple[Shape, Surface]] = {}

    def of(self, shape: Shape) -> Surface:
        """Return the surface of a bounded shape in the colour of obstacles."""
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
    """Return the surfaces of the bounded obstacles in the base frame; half-spaces are left out.

    Args:
        obstacles: The obstacles.
        made: Cache of their surfaces; None for a new one.
    """
    surfaces = ShapeSurfaces() if made is None else made
    bounded = [obstacle for obstacle in obstacles if obstacle.shape.bounded]
    return tuple(
        moved(surfaces.of(obstacle.shape), obstacle.pose.rotation, obstacle.pose.translation) for obstacle in bounded
    )


def moved(surface: Surface, rotation: NDArray[np.float64], translation: NDArray[np.float64]) -> Surface:
    """Return a surface after a rotation, shape (3, 3), and a translation, shape (3,) [m]."""
    vertices = surface.vertices @ rotation.T + translation
    return Surface(vertices, surface.normals @ rotation.T, surface.faces, surface.color, surface.frame)


def _link_surfaces(
    bodies: Sequence[object], triangles: int, frames: Sequence[int] | None = None
) -> tuple[Surface, ...]:
    counts = [int(b.geometry.num_tris) if is_mesh(b.geometry) else 0 for b in bodies]  # type: ignore[attr-defined]
    surfaces = []
    numbers: Sequence[int | None] = [None] * len(counts) if frames is None else frames
    for body, count, frame in zip(bodies, counts, numbers, strict=True):
        surface = _link_surface(body, max(triangles * count // max(sum(counts), 1), 200))
        if surface is not None:
            surfaces.append(surface if frame is None else replace(surface, frame=frame))
    return tuple(surfaces)


def _link_surface(body: object, limit: int) -> Surface | None:
    """Return a body's surface in the frame of its joint; None if nothing can be drawn."""
    geometry = body.geometry  # type: ignore[attr-defined]
    joint = body.parentJoint  # type: ignore[attr-defined]
    placement = body.placement  # type: ignore[attr-defined]

    color = palette.ROBOT_ALTERNATE if joint % 2 else palette.ROBOT
    if body.overrideMaterial:  # type: ignore[attr-defined]
        color = hexadecimal(body.meshColor[:3])  # type: ignore[attr-defined]

    try:
        shape = shape_of(geometry)
    except InputError:  # the mesh has no area: nothing to draw
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
    """Merge vertices at the same position, and drop triangles that lose their area by this."""
    _, first_rows, merged_number = np.unique(np.round(vertices, 12), axis=0, return_index=True, return_inverse=True)
    merged = np.asarray(merged_number).reshape(-1)[faces]

    has_area = (merged != np.roll(merged, 1, axis=1)).all(axis=1)
    return vertices[first_rows], merged[has_area].astype(np.int64)


# --- many surfaces before a camera -----------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class Figure:
    """Several surfaces in one set of arrays, sorted by frame.

    Attributes:
        vertices: In the frames that carry them [m], shape (n, 3).
        normals: Unit vectors that point out of the solids, in the same frames, shape (n, 3).
        faces: Vertex indices, shape (m, 3).
        colors: Colours of the vertices: red, green, blue from 0 to 1, shape (n, 3).
        frames: Numbers of the frames.
        bounds: The vertices of ``frames[k]`` are the rows from ``bounds[k]`` to ``bounds[k + 1]``.
    """

    vertices: NDArray[np.float32]
    normals: NDArray[np.float32]
    faces: NDArray[np.int32]
    colors: NDArray[np.float32]
    frames: tuple[int, ...]
    bounds: tuple[int, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """A figure in the frame of a camera, ready to be drawn.

    Attributes:
        points: Vertices in the frame of the camera [m], shape (n, 3).
        faces: Vertex indices, shape (m, 3).
        colors: Shaded colours of the vertices: red, green, blue from 0 to 1, shape (n, 3).
    """

    points: NDArray[np.float32]
    faces: NDArray[np.int32]
    colors: NDArray[np.float32]


def figure_of(surfaces: Sequence[Surface]) -> Figure:
    """Join surfaces in one figure."""
    ranked = sorted(surfaces, key=lambda surface: surface.frame)
    counts = [len(surface.vertices) for surface in ranked]
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(int)
    frames = sorted({surface.frame for surface in ranked})
    ends = [max(starts[k + 1] for k, s in enumerate(ranked) if s.frame == frame) for frame in frames]

    empty = np.zeros((0, 3))
    return Figure(
        np.concatenate([empty, *(s.vertices for s in ranked)]).astype(np.float32),
        np.concatenate([empty, *(s.normals for s in ranked)]).astype(np.float32),
        np.concatenate([empty, *(s.faces + start for s, start in zip(ranked, starts, strict=False))]).astype(np.int32),
        np.concatenate([empty, *(np.tile(s.color, (len(s.vertices), 1)) for s in ranked)]).astype(np.float32),
        tuple(frames),
        (0, *(int(end) for end in ends)),
    )


def placed(figure: Figure, T_camera_frames: Sequence[ArrayLike] | NDArray[np.float64]) -> Placed:
    """Transform a figure to the frame of a camera, and shade it by a lamp at the camera.

    Args:
        figure: What is drawn.
        T_camera_frames: Pose of frame k in the frame of the camera, shape (frames, 4, 4).
    """
    poses = np.asarray(T_camera_frames, dtype=np.float32)
    points = np.empty_like(figure.vertices)
    normals = np.empty_like(figure.normals)

    for frame, low, high in zip(figure.frames, figure.bounds, figure.bounds[1:], strict=False):
        turn = poses[frame, :3, :3].T
        np.matmul(figure.vertices[low:high], turn, out=points[low:high])
        points[low:high] += poses[frame, :3, 3]
        np.matmul(figure.normals[low:high], turn, out=normals[low:high])

    lengths = np.sqrt(np.einsum("ij,ij->i", points, points))
    facing = np.abs(np.einsum("ij,ij->i", normals, points)) / np.maximum(lengths, 1e-9)
    colors = figure.colors * (AMBIENT + (1.0 - AMBIENT) * facing)[:, None]
    return Placed(points, figure.faces, colors.astype(np.float32))


def tinted(figure: Placed, color: Sequence[float]) -> Placed:
    """Return a figure in shades of one colour, given as red, green, blue from 0 to 1; bright parts stay bright."""
    shades = AMBIENT + (1.0 - AMBIENT) * figure.colors.max(axis=1)
    return Placed(figure.points, figure.faces, np.outer(shades, color).astype(np.float32))


# --- drawn into a picture --------------------------------------------------------------------------------------------


class Canvas:
    """A picture from the view of a camera, into which figures are drawn.

    Attributes:
        colors: Red, green, blue from 0 to 1, shape (height, width, 3); undefined where nothing was drawn.
        depths: Depth along the optical axis [m], shape (height, width); `FARTHEST_DRAWN` where nothing was drawn.
    """

    def __init__(self, camera: Camera) -> None:
        self.camera = camera
        self._view, self._angle = _matrix(camera)
        self.colors: NDArray[np.float32] = np.zeros((camera.height, camera.width, 3), dtype=np.float32)
        self.depths: NDArray[np.float32] = np.full((camera.height, camera.width), FARTHEST_DRAWN, dtype=np.float32)

    def clear(self) -> None:
        """Erase the picture."""
        self.depths.fill(FARTHEST_DRAWN)

    @property
    def drawn(self) -> NDArray[np.bool_]:
        """Mask of the pixels that were drawn, shape (height, width)."""
        return np.asarray(self.depths < 0.999 * FARTHEST_DRAWN)

    def draw(self, figure: Placed, both_sides: bool = False) -> None:
        """Draw a figure; parts that are behind what was drawn before stay hidden.

        Args:
            figure: What to draw.
            both_sides: Whether to draw triangles seen from inside, too: for surfaces that are not closed.
        """
        if len(figure.faces) == 0:
            return

        points = np.ascontiguousarray(_bent(figure.points, self.camera), dtype=np.float32)
        if not hasattr(cv2, "triangleRasterize"):  # before OpenCV 5
            picture = self.colors, self.depths
            depth_range = NEAREST_DRAWN, FARTHEST_DRAWN
            rasterize(
                points, figure.faces, figure.colors, picture, self.camera.matrix, depth_range, both_sides=both_sides
            )
            return

        culling = cv2.RASTERIZE_CULLING_NONE if both_sides else cv2.RASTERIZE_CULLING_CW
        settings: Any = cv2.TriangleRasterizeSettings()
        settings = settings.setShadingType(cv2.RASTERIZE_SHADING_SHADED).setCullingMode(culling)

        rasterizer: Any = cv2.triangleRasterize
        self.colors, self.depths = rasterizer(
            points,
            figure.faces,
            figure.colors,
            self.colors,
            self.depths,
            self._view,
            self._angle,
            NEAREST_DRAWN,
            FARTHEST_DRAWN,
            settings,
        )


def half_as_fine(camera: Camera) -> Camera:
    """Return a camera with the same view and half as many pixels along each side."""
    matrix = np.array(camera.matrix)
    matrix[:2, :2] *= 0.5
    matrix[:2, 2] = 0.5 * (matrix[:2, 2] + 0.5) - 0.5
    return replace(camera, matrix=matrix, width=(camera.width + 1) // 2, height=(camera.height + 1) // 2)


def _matrix(camera: Camera) -> tuple[NDArray[np.float64], float]:
    """Return the view matrix and the opening angle for OpenCV's rasteriser.

    Returns:
        The transformation from the camera's frame to OpenGL's (y up, looking along -z) with the intrinsics folded in,
        shape (4, 4), and the vertical opening angle [rad].
    """
    (fx, _, cx), (_, fy, cy), _ = camera.matrix

    fold = np.eye(4)
    fold[0, 0] = fx / fy
    fold[0, 2] = (cx + 0.5 - 0.5 * camera.width) / fy
    fold[1, 2] = (cy + 0.5 - 0.5 * camera.height) / fy
    return np.diag([1.0, -1.0, -1.0, 1.0]) @ fold, float(2.0 * np.arctan(0.5 * camera.height / fy))


def _bent(points: NDArray[np.float32], camera: Camera) -> NDArray[np.float32]:
    """Shift points so that a pinhole camera shows them where the lens does; edges between them stay straight."""
    if camera.is_pinhole:
        return points
    if camera.lens != "brown":
        in_front = np.column_stack([points[:, :2], np.maximum(points[:, 2], NEAREST_DRAWN)])
        return np.column_stack([in_front[:, 2:] * camera.distorted(in_front), points[:, 2]]).astype(np.float32)

    k1, k2, p1, p2, k3 = camera.distortion.astype(np.float32)
    depth = np.maximum(points[:, 2], NEAREST_DRAWN)
    x = points[:, 0] / depth
    y = points[:, 1] / depth
    # Limited, because far outside the picture the distortion polynomial is no longer monotonic.
    square = np.minimum(x * x + y * y, 4.0)
    radial = 1.0 + square * (k1 + square * (k2 + square * k3))

    bent = points.copy()
    bent[:, 0] = depth * (x * radial + 2.0 * p1 * x * y + p2 * (square + 2.0 * x * x))
    bent[:, 1] = depth * (y * radial + p1 * (square + 2.0 * y * y) + 2.0 * p2 * x * y)
    return bent
