"""The tree of RRT-Connect in Python: configurations, each with its parent, below any number of roots."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector

ROOT = -1  # the parent of a root


class ConfigurationTree:
    """Configurations in the order in which they were added, the roots first.

    Attributes:
        size: Number of vertices.
        parents: Number of each vertex's parent, -1 for a root.
        radii: Distance up to which a vertex is extended towards a sample; +inf until an extension of it was blocked.

    Args:
        roots: Shape (r, n), r at least 1.
    """

    def __init__(self, roots: Matrix) -> None:
        self.size = len(roots)
        self.parents = [ROOT] * self.size
        self.radii = [np.inf] * self.size
        self._rows = np.array(roots)

    @property
    def rows(self) -> Matrix:
        """The configurations, shape (size, n); a view that holds until a vertex is added."""
        return self._rows[: self.size]

    def grown(self) -> tuple[Matrix, NDArray[np.int64]]:
        """The configurations, shape (size, n), and their parents, shape (size,), -1 for a root."""
        return self.rows.copy(), np.array(self.parents, dtype=np.int64)

    def row(self, vertex: int) -> Vector:
        """The configuration of a vertex, shape (n,)."""
        row: Vector = self._rows[vertex]
        return row

    def add(self, row: Vector, parent: int) -> int:
        """Append a vertex below another one; returns its number."""
        if self.size == len(self._rows):
            self._rows = np.vstack([self._rows, np.empty_like(self._rows)])
        self._rows[self.size] = row
        self.parents.append(parent)
        self.radii.append(np.inf)
        self.size += 1
        return self.size - 1

    def nearest(self, row: Vector) -> int:
        """The vertex nearest to a configuration, shape (n,), by the Euclidean distance; among equals the oldest."""
        gaps = self.rows - row
        return int(np.einsum("ij,ij->i", gaps, gaps).argmin())

    def branch(self, vertex: int) -> Matrix:
        """Configurations from the root to a vertex, shape (k, n)."""
        vertices = []
        while vertex != ROOT:
            vertices.append(vertex)
            vertex = self.parents[vertex]
        rows: Matrix = self._rows[vertices[::-1]]
        return rows
