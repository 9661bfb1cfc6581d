"""Memory of C-RDT trees in kernels."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.kernels.search.crdt import layout as crdt_layout
from rrtik_ompl.kernels.search.crdt.layout import CrdtTreeTable
from rrtik_ompl.kernels.tables.memory import aligned, packed


class TreeMemory:
    """Vertices of a C-RDT tree, with room for more.

    Attributes:
        table: What kernels read.
        address: Of that table; stays when the tree is given more room.

    Args:
        roots: Its first vertices, shape (r, n).
        capacity: How many vertices there is room for, a multiple of the lanes; doubled until the roots have room.
    """

    def __init__(self, roots: Matrix, capacity: int) -> None:
        count, self._dof = roots.shape
        while capacity < count + self._dof:
            capacity *= 2
        self.table = packed(CrdtTreeTable, size=count, capacity=capacity, **self._arrays(capacity))
        self._runs[:, :count] = roots.T
        self._parents[:count] = crdt_layout.ROOT
        self.address = self.table.address

    @property
    def size(self) -> int:
        """Number of vertices."""
        return self.table.size

    @property
    def vertices(self) -> Matrix:
        """Shape (size, n). A view."""
        return self._runs[:, : self.size].T

    @property
    def parents(self) -> NDArray[np.int64]:
        """The parent of each vertex, shape (size,), below 0 for a root; a copy."""
        return self._parents[: self.size].astype(np.int64)

    def branch(self, vertex: int) -> Matrix:
        """The configurations from the root to a vertex, shape (k, n)."""
        chain = [vertex]
        while (parent := self._parents.item(chain[-1])) != crdt_layout.ROOT:
            chain.append(parent)
        return np.ascontiguousarray(self._runs[:, chain[::-1]].T)

    def intact(self) -> bool:
        """Whether no kernel has written beyond this memory."""
        return self.table.intact()

    def grow(self) -> None:
        """Give the tree twice the room."""
        vertices, parents = self.vertices, self._parents[: self.size]
        capacity = 2 * self.table.capacity
        self.table.put(**{name: aligned(larger) for name, larger in self._arrays(capacity).items()})
        self.table.capacity = capacity
        self._runs[:, : self.size] = vertices.T
        self._parents[: self.size] = parents

    @property
    def _runs(self) -> Matrix:
        """Coordinates, shape (n, capacity)."""
        return self.table.coordinates.reshape(self._dof, -1)

    @property
    def _parents(self) -> NDArray[Any]:
        return self.table.parents

    def _arrays(self, capacity: int) -> dict[str, NDArray[Any]]:
        return {
            "coordinates": np.zeros(self._dof * capacity),
            "parents": np.zeros(capacity, dtype=np.int32),
        }
