"""The volumes of hulls on both sides of possible cuts, by kernels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector, welded
from rrtik_ompl.kernels.covers.cut_layout import FACE, KERNELS, MOST_FACES, MOST_POINTS, PLANE
from rrtik_ompl.kernels.covers.memory import called, room
from rrtik_ompl.kernels.covers.points import in_lanes
from rrtik_ompl.kernels.simd.library import Library, library
from rrtik_ompl.kernels.simd.processor import WIDTH


def has_kernels() -> bool:
    """Whether this machine has the kernels that the other functions need."""
    return library(KERNELS) is not None


def hull_volume(points: Matrix) -> float:
    """Return the volume of the convex hull of at most ``MOST_POINTS`` points, shape (n, 3), up to some millionths."""
    volume = np.empty(1)
    called(_kernels().hull_volume_of, points.astype(np.float64, order="C"), len(points), *_hull_scratch(), volume)
    return float(volume[0])


def cut_volumes(
    surface: NDArray[np.float64],
    points: Matrix,
    boxes: NDArray[np.float64],
    bounds: tuple[Vector, Vector],
    shares: Sequence[float],
    directions: Matrix,
) -> Matrix:
    """Return for each cut of a cell the volume of the hulls on its sides, shape (3, len(shares)).

    The hulls are those of the points that are extreme in the given directions.

    Args:
        surface: Triangles in the cell, shape (m, 3, 3).
        points: Corners of the triangles and of the boxes, each once, shape (n, 3).
        boxes: Lowest and highest corners of boxes in the cell, shape (k, 2, 3).
        bounds: Lowest and highest corner of the cell.
        shares: Positions of the cuts, as shares of the cell's side along each axis.
        directions: Unit vectors, shape (d, 3), at most ``MOST_POINTS``.
    """
    corners = surface.reshape(-1, 3)
    first, place = welded(np.concatenate([corners, points]))
    distinct = np.concatenate([corners, points])[first]
    numbers = np.ascontiguousarray(place[: len(corners)])

    lanes = in_lanes(directions)
    most = len(distinct) + 2 * len(surface) + 4 * len(boxes)
    volumes = np.empty((3, len(shares), 2))
    called(
        _kernels().cut_volumes,
        numbers,
        len(surface),
        distinct,
        len(distinct),
        np.ascontiguousarray(boxes),
        len(boxes),
        np.concatenate(bounds),
        np.array(shares),
        len(shares),
        lanes,
        len(lanes),
        np.empty((2, most, 3)),
        np.empty((most, 3), dtype=np.float32),
        room(len(lanes) * WIDTH),
        np.empty(most, dtype=np.int32),
        np.empty((MOST_POINTS, 3)),
        *_hull_scratch(),
        most,
        volumes,
    )
    return np.asarray(volumes.sum(axis=2))


def _kernels() -> Library:
    kernels = library(KERNELS)
    assert kernels is not None
    return kernels


def _hull_scratch() -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.int32]]:
    """Return room for the planes and faces of a hull, and for the work on them."""
    return (
        np.empty((MOST_FACES, PLANE)),
        np.empty((MOST_FACES, FACE), dtype=np.int32),
        np.empty(MOST_POINTS**2 + 2 * MOST_FACES, dtype=np.int32),
    )
