"""Triangle meshes."""

from __future__ import annotations

import os
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import (
    Mask,
    Matrix,
    bounded_array,
    dimensions,
    distinct,
    finite_array,
    frozen,
    number_rows,
    positive,
    welded,
)
from rrtik_ompl.base.copies import as_value, in_one_line
from rrtik_ompl.base.errors import InputError, at_most, require
from rrtik_ompl.files.kinds import read
from rrtik_ompl.model.shapes.mesh_repair import edges_of, in_closed_parts, repaired
from rrtik_ompl.model.shapes.shape import Shape
from rrtik_ompl.model.shapes.surfaces import Triangles

MOST_TRIANGLES = 5_000_000
SAME_DIGITS = 12  # decimals of metres in which vertices differ if they are not equal up to rounding errors


@dataclass(frozen=True, slots=True, eq=False)
class Mesh(Shape):
    """A triangle mesh. Parts of it that are closed count as solids, open ones as surfaces.

    Equal vertices are merged and triangles without area dropped. Where the surface is open, triangles that are there
    twice are dropped, triangles are cut at vertices that lie on their edges, and turned like those around them.

    Attributes:
        vertices: Shape (n, 3), metres.
        triangles: Vertex indices, shape (m, 3).
        open_edges: Number of edges that triangles do not pass equally often in both directions.
        source: Path of the file it was read from, or "".
        scale: Factor that was applied to the file's numbers; it is written back with the scene.

    Example:
        >>> corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
        >>> solid = rrtik.Mesh(corners, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
        >>> rrtik.Obstacle("tetrahedron", solid, [0.5, 0.0, 0.0]).shape.triangles.shape
        (4, 3)
    """

    key = "mesh"
    fine = True

    vertices: Matrix
    triangles: NDArray[np.int64]
    source: str = ""
    scale: float = 1.0
    open_edges: int = field(default=0)

    __reduce__ = as_value
    __repr__ = in_one_line

    def __init__(self, vertices: ArrayLike, triangles: ArrayLike, source: str = "", scale: float = 1.0) -> None:
        require(source, str, "source of a mesh")
        what = f"mesh {source}" if source else "mesh"

        points = bounded_array(vertices, (None, 3), f"{what}: vertices")
        rows = number_rows(triangles, f"{what}: triangles")
        if dimensions(triangles) != 2 or rows.shape[1] != 3 or len(rows) == 0:
            raise InputError(f"{what}: needs at least one triangle (three vertex numbers each); export it triangulated")
        at_most(len(rows), MOST_TRIANGLES, f"{what}: triangles", "simplify it")
        numbers = finite_array(rows, (None, 3), f"{what}: triangles")
        if (odd := numbers[numbers != np.floor(numbers)]).size:
            raise InputError(f"{what}: vertex numbers of triangles must be whole, got {odd[0]:g}")
        faces = numbers.astype(np.int64)
        if faces.min() < 0 or faces.max() >= len(points):
            raise InputError(f"{what}: a triangle names vertex {int(faces.max())}, but there are only {len(points)}")

        points, faces = mended(points, faces)
        if len(faces) == 0:
            raise InputError(f"{what}: every triangle has zero area; check its scale and export it again")

        object.__setattr__(self, "vertices", frozen(points))
        object.__setattr__(self, "triangles", frozen(faces, np.int64))
        object.__setattr__(self, "source", source)
        object.__setattr__(self, "scale", positive(scale, f"{what}: scale"))
        object.__setattr__(self, "open_edges", int(edges_of(faces).open.sum()))

    @staticmethod
    def load(file: str | os.PathLike[str], scale: float = 1.0) -> Mesh:
        """Read a triangle mesh.

        Polygons are divided into triangles, equal vertices merged, and triangles without area dropped. A closed mesh
        whose triangles all face inwards is turned inside out. The unit that a DAE file states is used, its up axis is
        not.

        Args:
            file: File whose name ends in .stl, .obj, .dae, .ply, .glb or .gltf.
            scale: Metres per unit of the file.

        Raises:
            InputError: If the file cannot be read, is broken, or holds no triangle.

        Warns:
            MeshWarning: If a part is not closed: it is then treated as a surface, not as a solid.

        Example:
            >>> rrtik.Mesh.load("part.stl", scale=0.001)  # a file in millimetres  # doctest: +SKIP
        """
        return read(Mesh, file, scale)

    @property
    def closed(self) -> bool:
        """Whether triangles pass every edge equally often in both directions, so that it has an inside."""
        return self.open_edges == 0

    @property
    def in_closed_parts(self) -> Mask:
        """Which triangles belong to a closed part, shape (m,); parts have no vertex in common."""
        return in_closed_parts(self.triangles)

    @property
    def bounding_radius(self) -> float:
        """Distance of its farthest vertex from its origin [m]."""
        return float(np.linalg.norm(self.vertices[distinct(self.triangles)], axis=1).max())

    def surface(self) -> Triangles:
        """Return its triangles."""
        return Triangles(self.vertices, self.triangles)


def open_edges_told(mesh: Mesh) -> str:
    """Return what messages say of the open edges of a mesh, and of what follows from them."""
    part = "the part of it that has them" if mesh.in_closed_parts.any() else "it"
    return f"{mesh.open_edges} open edges; {part} is treated as a surface, not as a solid"


def mended(points: Matrix, faces: NDArray[np.int64]) -> tuple[Matrix, NDArray[np.int64]]:
    """Return a surface as `Mesh` has it: equal vertices merged, no triangles of zero area, small mistakes repaired.

    Args:
        points: Vertices, shape (n, 3) [m].
        faces: Indices of the vertices of each triangle, shape (m, 3).
    """
    points, faces = _welded(points, faces)
    return points, faces if len(faces) == 0 else repaired(points, faces)


def _welded(points: Matrix, faces: NDArray[np.int64]) -> tuple[Matrix, NDArray[np.int64]]:
    """Merge equal vertices (STL repeats them for each triangle) and drop triangles of zero area.

    If vertices differ only by rounding errors, these are merged as well. Coal reports contacts of balls with the
    slivers between such vertices, wherever the ball is, and a solid with such a seam would count as an open surface.
    """
    unique, merged = _merged(points, points, faces)
    sides = unique[merged] - unique[np.roll(merged, 1, axis=1)]
    if (np.abs(sides).max(axis=2) < 10.0**-SAME_DIGITS).any() or edges_of(merged).open.any():
        # Neighbours that fall on different sides of a rounding boundary are merged with the shifted one.
        for shift in (0.0, 0.37 * 10.0**-SAME_DIGITS):
            unique, merged = _merged(np.round(unique + shift, SAME_DIGITS) + 0.0, unique, merged)

    a, b, c = (unique[merged[:, k]] for k in range(3))
    return unique, merged[np.linalg.norm(np.cross(b - a, c - a), axis=1) > 0.0]


def _merged(keys: Matrix, points: Matrix, faces: NDArray[np.int64]) -> tuple[Matrix, NDArray[np.int64]]:
    """Keep one of the points with equal keys, and renumber the faces accordingly.

    Returns:
        The points in the order of their keys, shape (n, 3), and the faces, shape (m, 3).
    """
    first, place = welded(keys)
    order = np.lexsort(keys[first].T[::-1])
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    return points[first[order]], rank[place][faces]
