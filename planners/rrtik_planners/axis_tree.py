"""The tree of C-RDT, every edge of which moves one coordinate. Source: the C-RDT paper, EXTEND and REWRITE."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.ompl_bridge import MotionChecker

ROOT = -1
FIRST_CAPACITY = 256


class Outcome(Enum):
    """What an extension achieved: nothing, a part of the way, or the target exactly."""

    TRAPPED = auto()
    ADVANCED = auto()
    REACHED = auto()


@dataclass(frozen=True, slots=True)
class Extension:
    """The outcome of an extension and the vertex at which it ended."""

    outcome: Outcome
    vertex: int


class AxisTree:
    """A growing tree (or forest, if there are several roots) in preallocated arrays.

    Attributes:
        size: Number of vertices.
    """

    def __init__(self, roots: Matrix, scale: Vector) -> None:
        """Plant a tree.

        Args:
            roots: Shape (r, n).
            scale: Weight of each coordinate in the metric of the nearest neighbour, shape (n,).
        """
        capacity = max(FIRST_CAPACITY, len(roots))
        self._vertices = np.empty((capacity, roots.shape[1]))
        self._parents: NDArray[np.int64] = np.full(capacity, ROOT, dtype=np.int64)
        self._vertices[: len(roots)] = roots
        self._scale = scale
        self.size = len(roots)

    def vertex(self, i: int) -> Vector:
        """Coordinates of vertex i, shape (n,). A view, valid until the tree grows."""
        row: Vector = self._vertices[i]
        return row

    def nearest(self, q: Vector) -> int:
        """The vertex nearest to q, shape (n,), in the scaled Euclidean metric."""
        difference = (self._vertices[: self.size] - q) * self._scale
        return int(np.einsum("ij,ij->i", difference, difference).argmin())

    def branch(self, i: int) -> Matrix:
        """The way from the root to vertex i, shape (k, n)."""
        way = [i]
        while self._parents[way[-1]] != ROOT:
            way.append(int(self._parents[way[-1]]))
        return self._vertices[way[::-1]]

    def extend(self, target: Vector, checker: MotionChecker, rng: np.random.Generator) -> Extension:
        """Grow from the vertex nearest to ``target`` towards it, one axis after the other (algorithm 10)."""
        return self.extend_from(self.nearest(target), target, checker, rng)

    def extend_from(self, near: int, target: Vector, checker: MotionChecker, rng: np.random.Generator) -> Extension:
        """Grow from vertex ``near`` towards ``target``, shape (n,).

        The axis that led to ``near`` goes first, which lengthens straight runs and so saves transitions; the others
        follow in random order. The leading part that is free is kept.
        """
        current, known = near, self.size
        for axis in self._axis_order(near, rng):
            here = self._vertices[current]
            if target[axis] == here[axis]:
                continue
            step = here.copy()
            step[axis] = target[axis]
            if not checker.motion_valid(here, step):
                return Extension(Outcome.TRAPPED if self.size == known else Outcome.ADVANCED, current)
            current = self._attach(step, axis, current) if current == near else self._add(step, current)
        return Extension(Outcome.REACHED, current)

    def _axis_order(self, near: int, rng: np.random.Generator) -> list[int]:
        order: list[int] = rng.permutation(self._vertices.shape[1]).tolist()
        parent = self._parents[near]
        if parent != ROOT:  # a root has no direction to remember
            memory = int(np.abs(self._vertices[near] - self._vertices[parent]).argmax())
            order.remove(memory)
            order.insert(0, memory)
        return order

    def _attach(self, step: Vector, axis: int, near: int) -> int:
        """Add the first new vertex of an extension; where it turns back along the edge to ``near``, rewrite parents."""
        parent = int(self._parents[near])
        if parent == ROOT:
            return self._add(step, near)
        came = self._vertices[near, axis] - self._vertices[parent, axis]
        beyond = step[axis] - self._vertices[parent, axis]
        if came == 0.0 or came * (step[axis] - self._vertices[near, axis]) > 0.0:
            return self._add(step, near)
        if beyond == 0.0:  # exactly back at the parent
            return parent
        new = self._add(step, parent)
        if came * beyond > 0.0:  # between the two: the edge is split
            self._parents[near] = new
        return new

    def _add(self, q: Vector, parent: int) -> int:
        if self.size == len(self._vertices):
            self._vertices = np.concatenate([self._vertices, np.empty_like(self._vertices)])
            self._parents = np.concatenate([self._parents, np.full_like(self._parents, ROOT)])
        self._vertices[self.size] = q
        self._parents[self.size] = parent
        self.size += 1
        return self.size - 1
