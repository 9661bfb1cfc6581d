"""A picture of a subject without a browser: what the page shows at first, for places where its script does not run.

The recorded scene is drawn with the triangle rasteriser in numpy: no shadows, and lines as the page has them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from io import BytesIO

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.colors import fractions
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.shapes import Box, Cylinder, Sphere
from rrtik_ompl.model.shapes.surfaces import Faces
from rrtik_ompl.viewer.drawing import palette
from rrtik_ompl.viewer.drawing.framing import Frame, overview
from rrtik_ompl.viewer.drawing.nodes import (
    ROOT,
    BoxGeometry,
    CylinderGeometry,
    Geometry,
    Recording,
    SphereGeometry,
    TriangleGeometry,
)
from rrtik_ompl.viewer.drawing.robot_picture import joint_nodes
from rrtik_ompl.viewer.drawing.triangle_raster import rasterize
from rrtik_ompl.viewer.drawing.triangles import split_creases, vertex_normals
from rrtik_ompl.viewer.story import groups_to_see
from rrtik_ompl.viewer.subject import Subject

SIZE = (800, 500)  # [px]
FINER = 1.5  # drawn so much finer, then made smaller: edges without steps
COLORS = 256  # of the file
OPENING = np.deg2rad(32.0)  # angle of view from the upper to the lower edge, as in the page
FILLED = 0.85  # share of the picture's height that is filled
GHOST = 0.55  # opacity of ghosts
NEARER = 0.998  # what is seen through must be nearer by this factor: where it coincides with the arm, the arm is seen
KEY = np.array([0.5, -0.7, 1.2]) / np.linalg.norm([0.5, -0.7, 1.2])  # direction of the light
KEY_SHARE = 0.5
SKY_SHARE = 0.53
GROUND_SHARE = 0.28
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, slots=True, eq=False)
class Solid:
    """Triangles of one colour: vertices and their normals in the world, shape (n, 3), and indices, shape (m, 3)."""

    vertices: Matrix
    normals: Matrix
    faces: Faces
    color: Vector
    opacity: float


def first_picture(
    subject: Subject, recording: Recording, frame: Frame, size: tuple[int, int] = SIZE, finer: float = FINER
) -> bytes:
    """Return the first view of a subject as a PNG.

    Args:
        subject: What is shown.
        recording: What is drawn, of :func:`rrtik_ompl.viewer.picture.draw`.
        frame: The box around it, of the same.
        size: Width and height [px].
        finer: How much finer it is drawn at first: 1 takes half of the time, and edges have steps.
    """
    width, height = (round(finer * side) for side in size)
    away = (
        UP
        if subject.robot is not None and subject.robot.planar
        else overview(groups_to_see(subject), subject.scene, frame)
    )
    T_camera_world, focal = _camera(frame, away, width, height)

    colors = _background(width, height)
    depths = np.full((height, width), np.inf, dtype=np.float32)
    matrix = np.array([[focal, 0.0, 0.5 * (width - 1)], [0.0, focal, 0.5 * (height - 1)], [0.0, 0.0, 1.0]])
    depth_range = frame.size / 200.0, 60.0 * frame.size

    def draw_solids(solids: Sequence[Solid]) -> None:
        """Draw solids over the picture; those that are seen through together, as one body."""
        opacity = solids[0].opacity if solids else 1.0
        layer = colors if opacity == 1.0 else colors.copy()
        near = depths if opacity == 1.0 else depths * NEARER
        starts = np.cumsum([0, *(len(solid.vertices) for solid in solids)])
        vertices = np.concatenate([np.empty((0, 3)), *(solid.vertices for solid in solids)])
        shades = np.concatenate([np.empty((0, 3), np.float32), *(_shaded(solid, T_camera_world) for solid in solids)])
        faces = [solid.faces + start for solid, start in zip(solids, starts, strict=False)]
        triangles = np.concatenate([np.empty((0, 3), np.int32), *faces]).astype(np.int32)
        points = (vertices @ T_camera_world[:3, :3].T + T_camera_world[:3, 3]).astype(np.float32)
        rasterize(points, triangles, shades, (layer, near), matrix, depth_range, both_sides=True)
        if opacity < 1.0:
            colors[:] = (1.0 - opacity) * colors + opacity * layer

    solids = list(_solids(recording))
    draw_solids([solid for solid in solids if solid.opacity == 1.0])
    for solid in solids:
        if solid.opacity < 1.0:
            draw_solids([solid])
    if subject.end is not None and subject.robot is not None:
        draw_solids(list(_ghost(recording, subject.robot, subject.end, palette.GOAL)))

    return _png(colors, size)


def _camera(frame: Frame, away: Vector, width: int, height: int) -> tuple[Matrix, float]:
    """Return ``T_camera_world`` (z forward, y down), shape (4, 4), and the focal length [px] that show it whole."""
    focal = 0.5 * height / np.tan(0.5 * OPENING)
    aside = np.array([0.0, 1.0, 0.0]) if abs(away @ UP) > 0.999 else UP
    right = np.cross(aside, away)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(right, away), -away])

    half = FILLED * 0.5 * np.array([width, height]) / focal
    target = frame.centre
    distance = 2.0 * frame.size
    for _ in range(12):
        spots = (frame.points - target) @ axes.T
        seen = spots[:, :2] / np.maximum(distance + spots[:, 2:], 1e-6 * frame.size) / half
        low = seen.min(axis=0)
        high = seen.max(axis=0)
        target = target + (0.5 * (low + high) * distance * half) @ axes[:2]
        distance *= max(0.5 * float((high - low).max()), 0.5)

    T = np.eye(4)
    T[:3, :3] = axes
    T[:3, 3] = -axes @ (target + distance * away)
    return T, float(focal)


def _solids(recording: Recording, below: str = ROOT) -> Iterator[Solid]:
    """Yield what a recording draws below a node, where it is."""
    for path, (geometry, material) in recording.drawn.items():
        surface = _surface(geometry) if path.startswith(below) else None
        if surface is not None:
            pose = recording.pose(path)
            vertices = surface[0] @ pose[:3, :3].T + pose[:3, 3]
            color = np.array(fractions(f"#{material.color:06x}"))
            yield Solid(vertices, vertex_normals(vertices, surface[1]), surface[1], color, material.opacity)


def _ghost(recording: Recording, robot: Robot, q: Vector, color: str) -> Iterator[Solid]:
    """Yield the arm in another configuration, in one colour."""
    frames = robot.joint_frames(q[None])[0]
    for name, there in zip(joint_nodes(robot), frames, strict=True):
        here = recording.pose(f"{ROOT}/robot/{name}")
        move = there @ np.linalg.inv(here)
        for solid in _solids(recording, f"{ROOT}/robot/{name}/"):
            vertices = solid.vertices @ move[:3, :3].T + move[:3, 3]
            yield Solid(vertices, solid.normals @ move[:3, :3].T, solid.faces, np.array(fractions(color)), GHOST)


def _surface(geometry: Geometry) -> tuple[Matrix, Faces] | None:
    """Return the triangles of a geometry; None for points."""
    if isinstance(geometry, TriangleGeometry):
        return geometry.vertices, geometry.faces
    if isinstance(geometry, SphereGeometry):
        return Sphere(geometry.radius).surface()
    if isinstance(geometry, BoxGeometry):
        return split_creases(*Box(geometry.sides).surface())
    if isinstance(geometry, CylinderGeometry):
        radius = max(geometry.above, geometry.below)
        vertices, faces = split_creases(*Cylinder(radius, geometry.length).surface())
        share = 0.5 + vertices[:, 2:] / geometry.length  # from below to above
        ends = (geometry.below + (geometry.above - geometry.below) * share) / radius
        return np.column_stack([vertices[:, :2] * ends, vertices[:, 2]])[:, [0, 2, 1]] * [1, 1, -1], faces
    return None


def _shaded(solid: Solid, T_camera_world: Matrix) -> NDArray[np.float32]:
    """Return the colours of the vertices of a solid in the light of the page, shape (n, 3)."""
    towards = -T_camera_world[:3, :3].T @ T_camera_world[:3, 3] - solid.vertices
    facing = np.sign(np.einsum("ij,ij->i", solid.normals, towards))[:, None]
    normals = solid.normals * np.where(facing == 0.0, 1.0, facing)
    sky = 0.5 + 0.5 * normals @ UP
    light = KEY_SHARE * np.maximum(normals @ KEY, 0.0) + GROUND_SHARE + (SKY_SHARE - GROUND_SHARE) * sky
    shaded: NDArray[np.float32] = np.minimum(solid.color * light[:, None] / 0.95, 1.0).astype(np.float32)
    return shaded


def _background(width: int, height: int) -> NDArray[np.float32]:
    ends = [np.array(fractions(color)) for color in (palette.BACKGROUND_TOP, palette.BACKGROUND_BOTTOM)]
    share = np.linspace(0.0, 1.0, height)[:, None, None]
    rows = (1.0 - share) * ends[0] + share * ends[1]
    return np.repeat(rows, width, axis=1).astype(np.float32)


def _png(colors: NDArray[np.float32], size: tuple[int, int]) -> bytes:
    """Return colours from 0 to 1, shape (height, width, 3), as a PNG of ``size`` pixels."""
    fine = Image.fromarray(np.rint(255.0 * np.clip(colors, 0.0, 1.0)).astype(np.uint8))
    small = fine.resize(size, Image.Resampling.LANCZOS).quantize(COLORS, dither=Image.Dither.NONE)
    file = BytesIO()
    small.save(file, "PNG", optimize=True)
    return file.getvalue()
