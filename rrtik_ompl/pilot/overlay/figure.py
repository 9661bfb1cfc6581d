"""Many surfaces as one set of arrays, and where they are for a camera: the work of every frame, in a few calls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.pilot.overlay.surfaces import Surface

AMBIENT = 0.35  # share of ambient light; the rest comes from the camera


@dataclass(frozen=True, slots=True, eq=False)
class Figure:
    """Surfaces put together, sorted by frame.

    Attributes:
        vertices: In the frames that carry them [m], shape (n, 3).
        normals: Unit vectors out of the solids, in the same frames, shape (n, 3).
        faces: Shape (m, 3).
        colors: Of the vertices: red, green, blue from 0 to 1, shape (n, 3).
        frames: Numbers of the frames.
        bounds: Vertices of ``frames[k]`` are those from ``bounds[k]`` to ``bounds[k + 1]``.
    """

    vertices: NDArray[np.float32]
    normals: NDArray[np.float32]
    faces: NDArray[np.int32]
    colors: NDArray[np.float32]
    frames: tuple[int, ...]
    bounds: tuple[int, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """A figure before a camera, ready to be drawn.

    Attributes:
        points: Vertices in the frame of the camera [m], shape (n, 3).
        faces: Shape (m, 3).
        colors: What the light makes of those of the vertices: red, green, blue from 0 to 1, shape (n, 3).
    """

    points: NDArray[np.float32]
    faces: NDArray[np.int32]
    colors: NDArray[np.float32]


def figure_of(surfaces: Sequence[Surface]) -> Figure:
    """Put surfaces together."""
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
    """A figure in the frame of a camera, lit by a lamp at the camera.

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
    """The same figure in shades of one colour: red, green, blue from 0 to 1. The brightest stay the brightest."""
    shades = AMBIENT + (1.0 - AMBIENT) * figure.colors.max(axis=1)
    return Placed(figure.points, figure.faces, np.outer(shades, color).astype(np.float32))
