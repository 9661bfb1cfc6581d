"""A roadmap in Python for any motion check; :mod:`rrtik_ompl.kernels.search.roadmap.kernels` is its twin in kernels."""

from __future__ import annotations

import heapq
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.budget import Stop
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.kernels.search.roadmap.layout import BLOCKED, SURE, UNKNOWN
from rrtik_ompl.world.motion_queries import MotionFree

ROOT = -1  # stands for the edge by which a start was reached
BOX_TOLERANCE = 1e-6  # by which a vertex may lie outside the box, as in kernels (search/sample_kernels.py)


class PythonGraph:
    """A roadmap whose searches run in Python; see :class:`rrtik_ompl.kernels.search.roadmap.graph.KernelGraph`.

    Args:
        lower, upper: The box of configurations, shape (n,), finite.
        near: With how many of the vertices near it a new vertex is joined, at least 1.
        seed: Seed of the samples.
        valid: Returns whether a configuration, shape (n,), is free.
        motion_free: Returns whether a straight motion is free.
    """

    def __init__(
        self,
        lower: Vector,
        upper: Vector,
        *,
        near: int,
        seed: int,
        valid: Callable[[Vector], bool],
        motion_free: MotionFree,
    ) -> None:
        self._box = (lower, upper)
        self._near = near
        self._rng = np.random.default_rng(seed)
        self._valid = valid
        self._motion_free = motion_free
        self._rows: Matrix = np.empty((0, len(lower)))
        self._edges: list[tuple[int, int]] = []
        self._states: list[int] = []
        self._leaving: list[list[int]] = []  # edges of each vertex
        self.samples = self.motions = 0

    @property
    def size(self) -> int:
        """Number of vertices."""
        return len(self._rows)

    @property
    def rows(self) -> Matrix:
        """The vertices, shape (size, n); a copy."""
        return self._rows.copy()

    @property
    def edges(self) -> NDArray[np.int32]:
        """Pairs of vertices, shape (m, 2)."""
        return np.array(self._edges, dtype=np.int32).reshape(-1, 2)

    @property
    def states(self) -> NDArray[np.int32]:
        """State of each edge, shape (m,): UNKNOWN, SURE or BLOCKED."""
        return np.array(self._states, dtype=np.int32)

    def restore(self, rows: Matrix, edges: NDArray[np.int32], states: NDArray[np.int32]) -> None:
        """Fill an empty graph with the vertices, edges and states of another one.

        Raises:
            InputError: If a vertex is not in the box.
        """
        inside = self._count_inside(rows)
        if inside < len(rows):
            raise InputError(f"roadmap: vertex {inside} is not in the box of configurations")

        for row in rows:
            self._add(row)
        for (first, second), state in zip(edges.tolist(), states.tolist(), strict=True):
            self._join(first, second)
            self._states[-1] = state

    def grow(self, wanted: int, stop: Stop) -> int:
        """Add free samples until there are ``wanted`` more or it is time to stop, and return how many were added."""
        added = 0
        while added < wanted and not stop():
            self.samples += 1
            row = self._rng.uniform(*self._box)
            if self._valid(row):
                self._add_near(row, self.size)
                added += 1
        return added

    def learn(self, path: Matrix) -> int:
        """Add the waypoints of a free path, shape (k, n), as vertices joined in a row, and return how many.

        The first waypoint outside the box ends it.
        """
        count = self._count_inside(path)
        for k, row in enumerate(path[:count]):
            before = self.size
            self._add_near(row, before)
            if k > 0:
                self._join(before - 1, before)
        return count

    def check(self, stop: Stop) -> None:
        """Check all edges whose state is unknown, until it is time to stop."""
        for edge in range(len(self._edges)):
            if stop():
                return
            self._is_blocked(edge)

    def doubt(self) -> None:
        """Set the state of all edges to unknown, because an obstacle has moved."""
        self._states = [UNKNOWN] * len(self._states)

    def route(self, starts: Matrix, goals: Matrix, stop: Stop) -> Matrix | None:
        """Return the shortest path from a start to a goal, shape (k, n); None if none is found in time.

        Starts and goals are added as vertices for the time of the search and removed again.
        """
        num_vertices = self.size
        num_edges = len(self._edges)
        for k, row in enumerate(np.concatenate([starts, goals])):
            self._add_near(row, num_vertices)
            if k >= len(starts):  # goals are also joined straight with each start
                for start in range(len(starts)):
                    self._join(num_vertices + start, num_vertices + k)
        found = self._search(range(num_vertices, num_vertices + len(starts)), goals, stop)
        path = None if found is None else self._rows[found].copy()

        # Starts and goals are not part of the roadmap: remove them and their edges, the last ones first.
        while len(self._edges) > num_edges:
            for vertex in self._edges.pop():
                self._leaving[vertex].pop()
            self._states.pop()
        self._rows = self._rows[:num_vertices]
        self._leaving = self._leaving[:num_vertices]
        return path

    def statistics(self) -> dict[str, int | float]:
        """Return counts since the roadmap was made."""
        counts = {"vertices": self.size, "edges": len(self._edges)}
        return {**counts, "motions": self.motions, "iterations": self.samples}

    def _search(self, starts: range, goals: Matrix, stop: Stop) -> list[int] | None:
        """Search by A* with lazy checks of edges, and return the vertices of the shortest path, or None.

        The goals are the last vertices. The cost-to-go is estimated by the distance from the nearest goal. An edge is
        checked when the search takes it from the queue.
        """
        least_to_go = np.linalg.norm(self._rows[:, None] - goals, axis=2).min(axis=1)
        heap: list[tuple[float, float, int, int]] = [(float(least_to_go[start]), 0.0, start, ROOT) for start in starts]
        heapq.heapify(heap)
        edge_into: dict[int, int] = {}
        while heap and not stop():
            _, cost, vertex, edge = heapq.heappop(heap)
            if vertex in edge_into or (edge != ROOT and self._is_blocked(edge)):
                continue

            # The first time that a vertex is taken from the queue, it is reached by its shortest path.
            edge_into[vertex] = edge
            if vertex >= self.size - len(goals):
                return self._path_to(vertex, edge_into)

            for leaving in self._leaving[vertex]:
                head = self._other(leaving, vertex)
                if head not in edge_into:
                    reached = cost + float(np.linalg.norm(self._rows[head] - self._rows[vertex]))
                    heapq.heappush(heap, (reached + float(least_to_go[head]), reached, head, leaving))
        return None

    def _path_to(self, vertex: int, edge_into: dict[int, int]) -> list[int]:
        """Return the vertices from a start to a vertex, by the edges over which they were reached."""
        found = [vertex]
        while edge_into[vertex] != ROOT:
            vertex = self._other(edge_into[vertex], vertex)
            found.append(vertex)
        return found[::-1]

    def _other(self, edge: int, vertex: int) -> int:
        """Return the other end of an edge."""
        first, second = self._edges[edge]
        return second if vertex == first else first

    def _is_blocked(self, edge: int) -> bool:
        """Check whether an edge is blocked; if its state is unknown its motion is checked, and the answer is stored."""
        if self._states[edge] == UNKNOWN:
            self.motions += 1
            first, second = self._edges[edge]
            self._states[edge] = SURE if self._motion_free(self._rows[first], self._rows[second]) else BLOCKED
        return self._states[edge] == BLOCKED

    def _count_inside(self, rows: Matrix) -> int:
        """Return how many rows come before the first one outside the box."""
        lower, upper = self._box
        inside = ((rows >= lower - BOX_TOLERANCE) & (rows <= upper + BOX_TOLERANCE)).all(axis=1)
        return len(rows) if inside.all() else int(inside.argmin())

    def _add(self, row: Vector) -> int:
        """Add a vertex without edges, and return its number."""
        self._rows = np.vstack([self._rows, row])
        self._leaving.append([])
        return self.size - 1

    def _add_near(self, row: Vector, below: int) -> None:
        """Add a vertex, and join it with the nearest of the first ``below`` vertices."""
        near = np.argsort(np.linalg.norm(self._rows[:below] - row, axis=1), kind="stable")[: self._near]
        vertex = self._add(row)
        for other in near.tolist():
            self._join(vertex, other)

    def _join(self, first: int, second: int) -> None:
        """Add an edge whose state is unknown."""
        for vertex in (first, second):
            self._leaving[vertex].append(len(self._edges))
        self._edges.append((first, second))
        self._states.append(UNKNOWN)
