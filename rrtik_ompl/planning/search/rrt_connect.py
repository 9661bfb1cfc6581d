"""RRT-Connect in Python for any motion check; :mod:`rrtik_ompl.kernels.search.connect_kernels` is its twin in kernels.

Sources: [4]; the smaller tree grows: [5]; the dynamic domain, which limits the extension of blocked vertices: [6].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.budget import Stop
from rrtik_ompl.world.motion_queries import MotionFree

ROOT = -1  # the parent of a root


@dataclass(frozen=True, slots=True, eq=False)
class ConnectRules:
    """Parameters of the growth of the trees.

    Attributes:
        lower, upper: The box in which samples are drawn, shape (n,).
        max_edge: Greatest length of an edge [unit of the space].
        domain: Radius within which a vertex is extended once an extension of it was blocked; +inf for no limit.
        balanced: Whether the smaller tree grows next; otherwise the trees take turns.
        max_iterations: Limit of the samples; None for no limit.
    """

    lower: Vector
    upper: Vector
    max_edge: float
    domain: float = np.inf
    balanced: bool = False
    max_iterations: int | None = None


class RrtConnect:
    """An RRT-Connect search between two sets of configurations.

    Attributes:
        trees: The tree from the starts and the tree from the goals.
        iterations: Samples drawn so far.

    Args:
        starts: Free configurations, shape (s, n).
        goals: Free configurations, shape (g, n).
        rules: Parameters of the growth of the trees.
        motion_free: Returns whether a straight motion is free.
        rng: Draws the samples.
    """

    def __init__(
        self, starts: Matrix, goals: Matrix, rules: ConnectRules, motion_free: MotionFree, rng: np.random.Generator
    ) -> None:
        self.trees = ConfigurationTree(starts), ConfigurationTree(goals)
        self.iterations = 0
        self._rules = rules
        self._motion_free = motion_free
        self._rng = rng
        self._last_side = 1  # index of the tree that grew last
        self._limit = np.inf if rules.max_iterations is None else rules.max_iterations

    @property
    def vertices(self) -> int:
        """Number of vertices of both trees."""
        return sum(tree.size for tree in self.trees)

    def run(self, stop: Stop) -> Matrix | None:
        """Grow the trees until they meet, and return the path from a start to a goal, shape (k, n), or None.

        Args:
            stop: Called before every sample and every edge; True ends the search without a path.
        """
        rules = self._rules
        motion_free = self._motion_free
        lower = rules.lower
        extent = rules.upper - rules.lower
        while not stop() and self.iterations < self._limit:
            self.iterations += 1
            side = self._next_side()
            self._last_side = side
            growing = self.trees[side]
            other = self.trees[1 - side]
            # Extend one tree towards a random sample, then connect the other tree to the new vertex.
            vertex = extend(growing, lower + extent * self._rng.random(len(lower)), rules, motion_free)
            if vertex is None:
                continue

            met = reach(other, growing.row(vertex), rules, motion_free, stop)
            if met is not None:
                from_start, from_goal = (vertex, met) if side == 0 else (met, vertex)
                return path_between(self.trees[0].branch(from_start), self.trees[1].branch(from_goal))
        return None

    def _next_side(self) -> int:
        """Return the index of the tree that grows next."""
        side = 1 - self._last_side
        is_larger = self.trees[side].size > self.trees[1 - side].size
        if self._rules.balanced and is_larger:
            return 1 - side
        return side


def straight_path(starts: Matrix, goals: Matrix, motion_free: MotionFree, stop: Stop) -> Matrix | None:
    """Return a free straight motion from the nearest start to a goal, or None.

    Args:
        starts: Shape (s, n).
        goals: Shape (g, n), tried in this order.
        motion_free: Returns whether a straight motion is free.
        stop: Called before every motion; True skips the motion.

    Returns:
        Shape (2, n), or (1, n) if start and goal are the same.
    """
    for goal in goals:
        start = starts[np.linalg.norm(starts - goal, axis=1).argmin()]
        if (start == goal).all() or (not stop() and motion_free(start, goal)):
            return path_between(start[None], goal[None])
    return None


def extend(tree: ConfigurationTree, sample: Vector, rules: ConnectRules, motion_free: MotionFree) -> int | None:
    """EXTEND: add an edge from the nearest vertex towards a sample, shape (n,); return the new vertex, or None.

    A vertex whose extension was blocked before is only extended towards samples within the domain.

    Args:
        tree: Gets the new vertex, in place.
        sample: Shape (n,).
        rules: Length of edges and radius of the domain.
        motion_free: Returns whether a straight motion is free.

    Returns:
        The index of the new vertex; None if the sample is out of the domain or the edge is blocked.
    """
    near = tree.nearest(sample)
    start = tree.row(near)
    length = float(np.linalg.norm(sample - start))
    if length == 0.0 or length > tree.radii[near]:
        return None
    end = _towards(start, sample, length, rules.max_edge)
    if motion_free(start, end):
        return tree.add(end, near)
    tree.radii[near] = rules.domain
    return None


def reach(
    tree: ConfigurationTree, target: Vector, rules: ConnectRules, motion_free: MotionFree, stop: Stop
) -> int | None:
    """CONNECT: add edges towards a target, shape (n,), until it is reached or an edge is blocked.

    Args:
        tree: Gets the new vertices, in place.
        target: Shape (n,).
        rules: Length of edges.
        motion_free: Returns whether a straight motion is free.
        stop: Returns True to give up.

    Returns:
        The vertex from which the target itself is reached; the target is not added to the tree. None if it is not
        reached.
    """
    vertex = tree.nearest(target)
    while not stop():
        start = tree.row(vertex)
        length = float(np.linalg.norm(target - start))
        end = _towards(start, target, length, rules.max_edge)
        if length > 0.0 and not motion_free(start, end):
            return None
        if length <= rules.max_edge:
            return vertex
        vertex = tree.add(end, vertex)
    return None


def path_between(first: Matrix, second: Matrix) -> Matrix:
    """Join a branch from a start and the reverse of a branch from a goal, shapes (k, n); a common end occurs once."""
    shared = bool((first[-1] == second[-1]).all())
    return np.vstack([first, second[::-1][int(shared) :]])


def _towards(start: Vector, end: Vector, length: float, max_length: float) -> Vector:
    """Return the point at a distance of at most ``max_length`` from start on the straight line to end, shape (n,).

    ``length`` is the distance from start to end. If it is not too long, the point is the end itself.
    """
    if length <= max_length:
        return end
    return start + (end - start) * (max_length / length)


class ConfigurationTree:
    """A tree of configurations in the order in which they were added, the roots first.

    Attributes:
        size: Number of vertices.
        parents: Index of each vertex's parent, -1 for a root.
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
        """The configurations, shape (size, n), as a view that is valid until a vertex is added."""
        return self._rows[: self.size]

    def grown(self) -> tuple[Matrix, NDArray[np.int64]]:
        """Return copies of the configurations, shape (size, n), and of their parents, shape (size,), -1 for a root."""
        return self.rows.copy(), np.array(self.parents, dtype=np.int64)

    def row(self, vertex: int) -> Vector:
        """Return the configuration of a vertex, shape (n,)."""
        row: Vector = self._rows[vertex]
        return row

    def add(self, row: Vector, parent: int) -> int:
        """Append a vertex below a parent, and return its index."""
        if self.size == len(self._rows):
            self._rows = np.vstack([self._rows, np.empty_like(self._rows)])
        self._rows[self.size] = row
        self.parents.append(parent)
        self.radii.append(np.inf)
        self.size += 1
        return self.size - 1

    def nearest(self, row: Vector) -> int:
        """Return the vertex nearest to a configuration, shape (n,), by Euclidean distance; of equal ones the oldest."""
        gaps = self.rows - row
        return int(np.einsum("ij,ij->i", gaps, gaps).argmin())

    def branch(self, vertex: int) -> Matrix:
        """Return the configurations from the root to a vertex, shape (k, n)."""
        vertices = []
        while vertex != ROOT:
            vertices.append(vertex)
            vertex = self.parents[vertex]
        rows: Matrix = self._rows[vertices[::-1]]
        return rows
