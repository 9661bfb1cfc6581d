"""Points spread over the surface of a solid, and places in it: what the search for balls knows of the solid."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.kernels.covers.memory import called, room
from rrtik_ompl.kernels.covers.search_layout import BOX_POINTS, KERNELS
from rrtik_ompl.kernels.covers.solids import Triangles
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.kernels.simd.processor import WIDTH
from rrtik_ompl.model.shapes.point_tree import curve_places

AWAY = 1e15  # where the boxes stand that fill up a block


@dataclass(slots=True, eq=False)
class Places:
    """Centres of balls, shape (n, 3), and their estimated depths inside the solid, shape (n,).

    A depth that is not positive marks a centre at or beyond the surface, which is not moved.
    """

    centres: Matrix
    depth: Vector

    def __getitem__(self, rows: NDArray[np.int64] | NDArray[np.bool_] | slice) -> Places:
        return Places(self.centres[rows], self.depth[rows])


class Surface:
    """Points of a surface, of which the nearest ones are asked for.

    For the kernels they lie in boxes of ``BOX_POINTS`` neighbours along a curve.

    Attributes:
        data: The points, shape (n, 3).
    """

    def __init__(self, points: Matrix) -> None:
        self.data = points

    def query(self, points: Matrix) -> tuple[Vector, NDArray[np.int64]]:
        """Return the distance of each point, shape (k, 3), from the nearest point of the surface, and its index."""
        kernels = library(KERNELS)
        if kernels is None:
            distance, index = self._tree.query(points)
            return np.asarray(distance), np.asarray(index)

        distances = np.empty(len(points))
        places = np.empty(len(points), dtype=np.int64)
        queries = np.ascontiguousarray(points)
        called(kernels.nearest_of_each, queries, len(points), *self.arrays, distances, places)
        return distances, self._order[np.minimum(places, len(self._order) - 1)]

    @cached_property
    def _tree(self) -> Any:
        from scipy.spatial import cKDTree

        return cKDTree(self.data)

    @cached_property
    def _order(self) -> NDArray[np.int64]:
        """Return the numbers of the points along the curve, shape (n,)."""
        return np.argsort(curve_places(self.data.astype(np.float32)), kind="stable")

    @cached_property
    def arrays(self) -> tuple[NDArray[np.float32], NDArray[np.float32], int, NDArray[np.float32]]:
        """What kernels ask: points in boxes, the boxes, the number of blocks of boxes, and scratch for their distances.

        The points are of shape (boxes, 3, BOX_POINTS), and the last one fills up the last box. The boxes are of shape
        (6, WIDTH * blocks): lowest x, y, z, highest x, y, z.
        """
        count = -(-len(self._order) // BOX_POINTS)
        blocks = -(-count // WIDTH)
        numbers = np.minimum(np.arange(count * BOX_POINTS), len(self._order) - 1)

        surface = room(3 * count * BOX_POINTS).reshape(count, 3, BOX_POINTS)
        surface[:] = self.data[self._order[numbers]].reshape(count, BOX_POINTS, 3).transpose(0, 2, 1)
        boxes = room(6 * blocks * WIDTH).reshape(6, -1)
        boxes[:] = AWAY
        boxes[:3, :count] = surface.min(axis=2).T
        boxes[3:, :count] = surface.max(axis=2).T
        return surface, boxes, blocks, room(blocks * WIDTH)


def surface_points(triangles: Triangles, count: int) -> Matrix:
    """Return points spread evenly over triangles, always the same ones, and corners of the triangles.

    About ``count`` points are spread by area. All corners are added if there are at most ``count`` triangles, otherwise
    those of every k-th triangle.
    """
    a, b, c = (triangles[:, k] for k in range(3))
    sizes = np.cumsum(np.linalg.norm(np.cross(b - a, c - a), axis=1))
    which = np.searchsorted(sizes, (np.arange(count) + 0.5) / count * sizes[-1]).clip(0, len(triangles) - 1)

    u, v = ((np.arange(count) * step) % 1.0 for step in (0.7548776662466927, 0.5698402909980532))  # Roberts' sequence
    u, v = (np.where(u + v > 1.0, 1.0 - w, w)[:, None] for w in (u, v))

    spread = a[which] + u * (b - a)[which] + v * (c - a)[which]
    return np.concatenate([spread, triangles[:: -(-len(triangles) // count)].reshape(-1, 3)])
