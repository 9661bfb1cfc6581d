"""Find the space that an open mesh encloses: many meshes of links have holes or torn edges, and so no defined inside.

Space is divided into a grid of cells: those that cannot be reached from outside without coming near the surface are
enclosed. This closes holes that are smaller than about a cell; a surface with a wide opening encloses nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector, bounds_of, box_of
from rrtik_ompl.geometry.collision.solids import (
    around,
    bvh,
    is_mesh,
    measured,
    mesh_arrays,
    once_per_geometry,
    outward_planes,
)
from rrtik_ompl.model.shapes.box_pile import surface_of_boxes

if TYPE_CHECKING:
    import coal


CELLS = 32  # number of cells along the longest side of the mesh
HALVINGS = 24  # most times that triangles are halved to make them smaller than a cell


class Enclosure:
    """The cells that a mesh encloses.

    Attributes:
        origin: Lowest corner of the grid [m], shape (3,).
        size: Edge of a cell [m].
        inside: Mask of the enclosed cells, shape (nx, ny, nz).
    """

    def __init__(self, vertices: Matrix, triangles: NDArray[np.int64]) -> None:
        corners = vertices[triangles]
        low, high = box_of(corners.reshape(-1, 3))

        self.size = float((high - low).max()) / CELLS
        self.origin: Vector = low - 1.5 * self.size
        shape = np.ceil((high - low) / self.size).astype(np.int64) + 3

        near_surface = np.zeros(shape, dtype=bool)
        for triangles_part in _cut_small((corners - self.origin) / self.size):
            _flag_cells(near_surface, triangles_part)
        self.inside = ~near_surface & ~_outside(near_surface)

    def boxes(self) -> tuple[Matrix, Matrix]:
        """Return boxes that make up the enclosed cells: their lowest and highest corners [m], shape (k, 3) each.

        Each box is a run of cells along z.
        """
        runs = np.diff(self.inside.astype(np.int8), axis=2, prepend=0, append=0)
        begin = np.argwhere(runs == 1)
        # Runs along z do not overlap, so their ends come in the same order as their beginnings.
        end = np.argwhere(runs == -1)
        high = np.column_stack([end[:, :2] + 1, end[:, 2]])
        return self.origin + self.size * begin, self.origin + self.size * high

    def keep_behind(self, planes: Matrix) -> None:
        """Drop the boxes that are not wholly behind all planes: unit normals and offsets, shape (k, 4)."""
        low, high = self.boxes()
        sticks_out = np.zeros(len(low), dtype=bool)
        for normal, offset in zip(planes[:, :3], planes[:, 3], strict=True):
            # The farthest corner of a box along a normal.
            sticks_out |= np.where(normal > 0.0, high, low) @ normal > offset
        cells = np.rint((low[sticks_out] - self.origin) / self.size).astype(np.int64)
        lengths = np.rint((high[sticks_out, 2] - low[sticks_out, 2]) / self.size).astype(np.int64)
        for (x, y, z), length in zip(cells.tolist(), lengths.tolist(), strict=True):
            self.inside[x, y, z : z + length] = False

    def holds(self, points: Matrix) -> bool:
        """Check whether any of the points, shape (k, 3), is in an enclosed cell."""
        cells = np.floor((points - self.origin) / self.size).astype(np.int64)
        in_grid = ((cells >= 0) & (cells < self.inside.shape)).all(axis=1)
        return bool(self.inside[tuple(cells[in_grid].T)].any())


@once_per_geometry
def enclosure(geometry: coal.CollisionGeometry) -> Enclosure:
    """Return the enclosed cells of a coal mesh, without those that stick out of its convex hull.

    So no enclosed point moves farther than the farthest one of the hull.
    """
    found = Enclosure(*mesh_arrays(geometry))
    solid = around(geometry)
    planes = None if is_mesh(solid) else outward_planes(solid)
    if planes is None:
        found.inside[:] = False
    else:
        found.keep_behind(planes)
    return found


@once_per_geometry
def with_enclosed_boxes(geometry: coal.CollisionGeometry) -> coal.BVHModelBase:
    """Return a coal mesh with the faces of the boxes of the cells that it encloses."""
    vertices, triangles = mesh_arrays(geometry)
    low, high = enclosure(geometry).boxes()
    corners, faces = surface_of_boxes(0.5 * (low + high), high - low)
    return measured(bvh(np.vstack([vertices, corners]), np.vstack([triangles, faces + len(vertices)])))


def _cut_small(triangles: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Halve triangles, shape (k, 3, 3), across their longest edges until each fits into a cell along every axis."""
    small_triangles = []
    for _ in range(HALVINGS):
        low, high = bounds_of(triangles)
        x, y, z = ((high - low) > 1.0).T
        is_large = x | y | z
        small_triangles.append(triangles[~is_large])
        triangles = triangles[is_large]

        # Squared lengths of the edges, from each corner to the next.
        a, b, c = (triangles[:, k] for k in range(3))
        edges = np.stack([((q - p) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a))])
        longest_edge = edges.argmax(axis=0)
        rows = np.arange(len(triangles))
        a, b, c = (triangles[rows, (longest_edge + k) % 3] for k in range(3))
        middle = 0.5 * (a + b)
        triangles = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
    return [*small_triangles, triangles]


def _flag_cells(near_surface: NDArray[np.bool_], triangles: NDArray[np.float64]) -> None:
    """Flag all cells that the bounding boxes of triangles reach into, in place."""
    low, high = (np.floor(bound).astype(np.int64) for bound in bounds_of(triangles))
    for steps in np.ndindex(*(np.max(high - low, axis=0, initial=0) + 1)):
        cells = low + np.array(steps)
        near_surface[tuple(cells[(cells <= high).all(axis=1)].T)] = True


def _outside(near_surface: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return a mask of the cells that can be reached from the border through cells that are not near the surface."""
    from scipy.ndimage import label  # Loading it takes longer than most plans, and few meshes are open.

    region, _ = label(~near_surface)
    outside: NDArray[np.bool_] = region == region[0, 0, 0]  # The outermost cells are never near the surface.
    return outside
