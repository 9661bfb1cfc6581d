"""What an open mesh encloses. Many links' meshes have holes or torn edges, so that they have no inside to speak of.

A grid of cells decides: what cannot be reached from outside without coming near the surface is enclosed. Holes smaller
than about a cell are closed by that; a surface with a wide opening encloses nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.geometry.collision.solids import mesh_arrays, once_per_geometry

if TYPE_CHECKING:
    import coal


CELLS = 32  # along the longest side of the mesh
HALVINGS = 24  # of triangles, at most: until they are smaller than a cell


class Enclosure:
    """The cells that a mesh encloses.

    Attributes:
        origin: Lowest corner of the grid [m], shape (3,).
        size: Edge of a cell [m].
        inside: Flags of the enclosed cells, three-dimensional.
    """

    def __init__(self, vertices: Matrix, triangles: NDArray[np.int64]) -> None:
        corners = vertices[triangles]
        low = corners.min(axis=(0, 1))
        high = corners.max(axis=(0, 1))

        self.size = float((high - low).max()) / CELLS
        self.origin: Vector = low - 1.5 * self.size
        shape = np.ceil((high - low) / self.size).astype(np.int64) + 3

        near_surface = np.zeros(shape, dtype=bool)
        for triangles_part in _cut_small((corners - self.origin) / self.size):
            _flag_cells(near_surface, triangles_part)
        self.inside = ~near_surface & ~_outside(near_surface)

    def boxes(self) -> tuple[Matrix, Matrix]:
        """Boxes that make up the enclosed cells: lowest and highest corners [m], shape (k, 3) each."""
        runs = np.diff(self.inside.astype(np.int8), axis=2, prepend=0, append=0)
        begin = np.argwhere(runs == 1)
        end = np.argwhere(runs == -1)  # along z, in the same order
        high = np.column_stack([end[:, :2] + 1, end[:, 2]])
        return self.origin + self.size * begin, self.origin + self.size * high

    def holds(self, points: Matrix) -> bool:
        """Whether one of some points, shape (k, 3), is enclosed."""
        cells = np.floor((points - self.origin) / self.size).astype(np.int64)
        in_grid = ((cells >= 0) & (cells < self.inside.shape)).all(axis=1)
        return bool(self.inside[tuple(cells[in_grid].T)].any())


@once_per_geometry
def enclosure(geometry: coal.CollisionGeometry) -> Enclosure:
    """What a coal mesh encloses."""
    return Enclosure(*mesh_arrays(geometry))


def _cut_small(triangles: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Triangles, shape (k, 3, 3), cut across their longest edges until none is longer than a cell along any axis."""
    small_triangles = []
    for _ in range(HALVINGS):
        is_large = (np.ptp(triangles, axis=1) > 1.0).any(axis=1)
        small_triangles.append(triangles[~is_large])
        triangles = triangles[is_large]

        edges = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2)  # from each corner to the next
        longest_edge = edges.argmax(axis=1)
        rows = np.arange(len(triangles))
        a, b, c = (triangles[rows, (longest_edge + k) % 3] for k in range(3))
        middle = 0.5 * (a + b)
        triangles = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
    return [*small_triangles, triangles]


def _flag_cells(near_surface: NDArray[np.bool_], triangles: NDArray[np.float64]) -> None:
    """Flag all cells that the boxes around triangles reach into."""
    low = np.floor(triangles.min(axis=1)).astype(np.int64)
    high = np.floor(triangles.max(axis=1)).astype(np.int64)
    for steps in np.ndindex(*(np.max(high - low, axis=0, initial=0) + 1)):
        cells = low + np.array(steps)
        near_surface[tuple(cells[(cells <= high).all(axis=1)].T)] = True


def _outside(near_surface: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Cells that can be reached from the border through faces of cells that are not near the surface."""
    from scipy.ndimage import label  # loads slower than most plans take, and few meshes are open

    region, _ = label(~near_surface)
    outside: NDArray[np.bool_] = region == region[0, 0, 0]  # the outermost cells are free, so this is the outside
    return outside
