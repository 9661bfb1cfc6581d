"""The tree of IKURT: configurations, parents, and how far each is from the goal in the workspace."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector

FIRST_ROOM = 256  # vertices that arrays have room for at first; doubled whenever they are full
PENALTY = 1.3  # factor on the distance of a vertex for each time that CONNECT has failed from it


class IkurtTree:
    """A tree of configurations, in the order in which they were added, roots first.

    Args:
        roots: Configurations of the roots, shape (k, n).
        distances: Distances of the roots from the goal, shape (k,).
    """

    def __init__(self, roots: Matrix, distances: Vector) -> None:
        self._q = np.empty((max(FIRST_ROOM, len(roots)), roots.shape[1]))
        self._parent = np.empty(len(self._q), dtype=np.int64)
        self._distance = np.empty(len(self._q))
        self._penalised_distance = np.empty(len(self._q))
        self.size = 0
        self.add(roots, np.full(len(roots), -1), distances)

    @property
    def q(self) -> Matrix:
        """The vertices, shape (size, n)."""
        return self._q[: self.size]

    @property
    def distance(self) -> Vector:
        """Workspace distance of each vertex from the goal, shape (size,)."""
        return self._distance[: self.size]

    def add(self, q: Matrix, parents: NDArray[np.int64], distances: Vector) -> NDArray[np.int64]:
        """Add vertices and return their numbers, shape (k,).

        Args:
            q: Configurations, shape (k, n).
            parents: Numbers of their parents, -1 for roots, shape (k,).
            distances: Their distances from the goal, shape (k,).
        """
        while self.size + len(q) > len(self._q):
            self._grow()
        numbers = np.arange(self.size, self.size + len(q))
        self._q[numbers] = q
        self._parent[numbers] = parents
        self._distance[numbers] = self._penalised_distance[numbers] = distances
        self.size += len(q)
        return numbers

    def grown(self) -> tuple[Matrix, NDArray[np.int64]]:
        """Return copies of the vertices, shape (size, n), and their parents, shape (size,), -1 for a root."""
        return self.q.copy(), self._parent[: self.size].copy()

    def best(self) -> int:
        """Return the vertex with the least workspace distance from the goal, penalties included."""
        return int(self._penalised_distance[: self.size].argmin())

    def penalise(self, first: int, last: int) -> None:
        """Penalise the vertices from ``last`` back to its ancestor ``first``, along which CONNECT has failed."""
        vertex = last
        while vertex >= 0:
            self._penalised_distance[vertex] *= PENALTY
            vertex = -1 if vertex == first else int(self._parent[vertex])

    def nearest(self, Q: Matrix) -> NDArray[np.int64]:
        """Return the vertex nearest in joint space (Euclidean) to each row of Q, shape (m, n); shape (m,)."""
        square = np.einsum("ij,ij->i", self.q, self.q)
        nearest: NDArray[np.int64] = (square - 2.0 * Q @ self.q.T).argmin(axis=1)
        return nearest

    def branch(self, vertex: int) -> Matrix:
        """Return the path from a root to a vertex, shape (k, n)."""
        numbers = [vertex]
        while self._parent[numbers[-1]] >= 0:
            numbers.append(int(self._parent[numbers[-1]]))
        return np.array(self._q[numbers[::-1]])

    def _grow(self) -> None:
        """Make room for twice as many vertices."""
        self._q = np.concatenate([self._q, np.empty_like(self._q)])
        self._parent = np.concatenate([self._parent, np.empty_like(self._parent)])
        self._distance = np.concatenate([self._distance, np.empty_like(self._distance)])
        self._penalised_distance = np.concatenate([self._penalised_distance, np.empty_like(self._penalised_distance)])
