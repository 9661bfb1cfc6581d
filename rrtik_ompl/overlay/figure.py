"""Many surfaces as one set of arrays, and where they are for a camera: the work of every frame, in a few calls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.overlay.surfaces import Surface

AMBIENT = 0.35  # share of the light that comes from everywhere; the rest comes from the eye


@dataclass(frozen=True, slots=True, eq=False)
class Figure:
    """Surfaces put together, sorted by frame.

    Attributes:
        vertices, normals: In the frames that carry them, shape (n, 3).
        faces: Shape (m, 3).
        colors: Of the vertices, shape (n, 3).
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
    """A figure for one camera: vertices in its frame and what colour the light makes of them."""

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


def placed(figure: Figure, T_camera_frames: Sequence[Any] | NDArray[np.float64]) -> Placed:
    """A figure before a camera, lit by a lamp at the eye.

    Args:
        figure: What is drawn.
        T_camera_frames: Pose of frame k in the frame of the camera, shape (frames, 4, 4).
    """
    poses = np.asarray(T_camera_frames, dtype=np.float32)
    points, normals = np.empty_like(figure.vertices), np.empty_like(figure.normals)
    for frame, low, high in zip(figure.frames, figure.bounds, figure.bounds[1:], strict=False):
        turn = poses[frame, :3, :3].T
        np.matmul(figure.vertices[low:high], turn, out=points[low:high])
        points[low:high] += poses[frame, :3, 3]
        np.matmul(figure.normals[low:high], turn, out=normals[low:high])
    lengths = np.sqrt(np.einsum("ij,ij->i", points, points))
    facing = np.abs(np.einsum("ij,ij->i", normals, points)) / np.maximum(lengths, 1e-9)
    colors = figure.colors * (AMBIENT + (1.0 - AMBIENT) * facing)[:, None]
    return Placed(points, figure.faces, colors.astype(np.float32))
