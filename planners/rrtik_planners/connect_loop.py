"""RRT-Connect as a plain loop over any motion checker, for worlds without kernels.

The same algorithm as in :mod:`rrtik_ompl.fast.search.connect_kernels`, with the same sources; every motion is decided
at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.ompl_bridge import MotionChecker


@dataclass(frozen=True, slots=True, eq=False)
class ConnectRules:
    """What a search keeps to.

    Attributes:
        lower, upper: The box to sample in, shape (n,).
        range: Length of a motion of the trees, at most.
        domain: Radius in which a vertex is extended once it was blocked.
        max_iterations: Samples at most, None for no limit.
    """

    lower: Vector
    upper: Vector
    range: float
    domain: float
    max_iterations: int | None


class ConnectTree:
    """Vertices in rows, from several roots."""

    def __init__(self, roots: Matrix) -> None:
        self.size = len(roots)
        self._rows = np.array(roots)
        self._parents = [-1] * self.size
        self.radii = [np.inf] * self.size

    def row(self, vertex: int) -> Vector:
        """The configuration of a vertex, shape (n,)."""
        row: Vector = self._rows[vertex]
        return row

    def add(self, row: Vector, parent: int) -> int:
        """Append a vertex; returns its number."""
        if self.size == len(self._rows):
            self._rows = np.vstack([self._rows, np.empty_like(self._rows)])
        self._rows[self.size] = row
        self._parents.append(parent)
        self.radii.append(np.inf)
        self.size += 1
        return self.size - 1

    def nearest(self, row: Vector) -> int:
        """The vertex nearest to a configuration."""
        gaps = self._rows[: self.size] - row
        return int(np.einsum("ij,ij->i", gaps, gaps).argmin())

    def branch(self, vertex: int) -> Matrix:
        """Configurations from the root to a vertex, shape (k, n)."""
        vertices = []
        while vertex >= 0:
            vertices.append(vertex)
            vertex = self._parents[vertex]
        rows: Matrix = self._rows[vertices[::-1]]
        return rows


def connect(
    starts: Matrix, goals: Matrix, rules: ConnectRules, checker: MotionChecker, rng: np.random.Generator, ptc: Any
) -> tuple[Matrix | None, dict[str, int]]:
    """Look for a path from any start to any goal until ``ptc()``; the path, shape (k, n), or None, and counts."""
    trees = ConnectTree(starts), ConnectTree(goals)
    path, side, iterations = _straight(starts, goals, checker, ptc), 1, 0
    limit = np.inf if rules.max_iterations is None else rules.max_iterations
    while path is None and not ptc() and iterations < limit:
        iterations += 1
        side = 1 - side
        if trees[side].size > trees[1 - side].size:
            side = 1 - side
        vertex = _extend(trees[side], rng.uniform(rules.lower, rules.upper), rules, checker)
        if vertex is not None:
            other = _reach(trees[1 - side], trees[side].row(vertex), rules, checker, ptc)
            if other is not None:
                meeting = (vertex, other) if side == 0 else (other, vertex)
                path = _joined(trees[0].branch(meeting[0]), trees[1].branch(meeting[1]))
    vertices = trees[0].size + trees[1].size
    return path, {"iterations": iterations, "vertices": vertices, "edges": vertices - len(starts) - len(goals)}


def _straight(starts: Matrix, goals: Matrix, checker: MotionChecker, ptc: Any) -> Matrix | None:
    """A whole motion from the nearest start to a goal, if one is free."""
    for goal in goals:
        start = starts[np.linalg.norm(starts - goal, axis=1).argmin()]
        if (start == goal).all() or (not ptc() and checker.motion_valid(start, goal)):
            return _joined(start[None], goal[None])
    return None


def _extend(tree: ConnectTree, sample: Vector, rules: ConnectRules, checker: MotionChecker) -> int | None:
    """Grow towards a sample; the new vertex, or None. A vertex that was blocked only takes samples near it."""
    near = tree.nearest(sample)
    length = float(np.linalg.norm(sample - tree.row(near)))
    if length == 0.0 or length > tree.radii[near]:
        return None
    row = _towards(tree.row(near), sample, length, rules.range)
    if checker.motion_valid(tree.row(near), row):
        return tree.add(row, near)
    tree.radii[near] = rules.domain
    return None


def _reach(tree: ConnectTree, target: Vector, rules: ConnectRules, checker: MotionChecker, ptc: Any) -> int | None:
    """Grow towards a target as far as it goes; the vertex from which the target itself is reached, or None."""
    vertex = tree.nearest(target)
    while not ptc():
        length = float(np.linalg.norm(target - tree.row(vertex)))
        row = _towards(tree.row(vertex), target, length, rules.range)
        if not checker.motion_valid(tree.row(vertex), row):
            return None
        if length <= rules.range:
            return vertex
        vertex = tree.add(row, vertex)
    return None


def _towards(start: Vector, end: Vector, length: float, most: float) -> Vector:
    """The end, or the point at a distance of ``most`` from the start on the way there."""
    return end if length <= most else start + (end - start) * (most / length)


def _joined(first: Matrix, second: Matrix) -> Matrix:
    """A branch from a start, then a branch from a goal the other way; a shared end stands once."""
    shared = bool((first[-1] == second[-1]).all())
    return np.vstack([first, second[::-1][int(shared) :]])
