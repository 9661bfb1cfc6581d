"""The tree of C-RDT in Python, whose edges move one coordinate each, and its random numbers.

Source: [1, ch. 6.3, EXTEND and REWRITE].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum, auto
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.kernels.search.crdt.rules import CrdtRules
from rrtik_ompl.ompl_bridge import MotionChecker

ROOT = -1
FIRST_CAPACITY = 256
WORD = 2**64 - 1
# The constants of splitmix64 [46].
GOLDEN, FIRST_FACTOR, SECOND_FACTOR = 0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB


class Outcome(Enum):
    """What an extension achieved: nothing, a part of the extension, or the target exactly."""

    TRAPPED = auto()
    ADVANCED = auto()
    REACHED = auto()


class Turn(Enum):
    """How the first leg of an extension continues the edge that led to its vertex.

    Any turn other than ONWARD goes back along the edge's axis, so that parents are rewritten.
    """

    ONWARD = auto()  # onward along the axis, or along another one
    BETWEEN = auto()  # back to a point inside the edge
    BEYOND = auto()  # back to a point beyond the beginning of the edge
    BACK = auto()  # back exactly to the beginning of the edge


@dataclass(frozen=True, slots=True)
class Extension:
    """The outcome of an extension and the vertex at which it ended."""

    outcome: Outcome
    vertex: int


class CrdtTree:
    """A growing tree (or forest, if there are several roots) in preallocated arrays.

    Every edge has been checked as a whole, and so have those that come from rewriting parents.

    Attributes:
        size: Number of vertices.
    """

    def __init__(self, roots: Matrix, rules: CrdtRules) -> None:
        """Plant a tree.

        Args:
            roots: Configurations of the roots, shape (r, n).
            rules: How the tree grows.
        """
        capacity = max(FIRST_CAPACITY, len(roots))
        self._coordinates = np.empty((roots.shape[1], capacity))
        self._parents: NDArray[np.int64] = np.full(capacity, ROOT, dtype=np.int64)
        self._coordinates[:, : len(roots)] = roots.T
        self._rules = rules
        self._axes = rules.axes.tolist()
        self.size = len(roots)

    def vertex(self, i: int) -> Vector:
        """Return the coordinates of vertex i, shape (n,)."""
        return self._coordinates[:, i].copy()

    def grown(self) -> tuple[Matrix, NDArray[np.int64]]:
        """Return copies of the vertices, shape (size, n), and their parents, shape (size,), below 0 for a root."""
        return self._coordinates[:, : self.size].T.copy(), self._parents[: self.size].copy()

    def nearest(self, q: Vector) -> int:
        """Return the vertex nearest to q, shape (n,), in the scaled Euclidean metric; among equals the oldest."""
        difference = (self._coordinates[:, : self.size] - q[:, None]) * self._rules.scale[:, None]
        # This reduction adds in the same order as the kernels, so that both choose the same vertex.
        return int(np.add.reduce(difference * difference, axis=0).argmin())

    def branch(self, i: int) -> Matrix:
        """Return the path from the root to vertex i, shape (k, n)."""
        vertices = [i]
        while self._parents[vertices[-1]] != ROOT:
            vertices.append(int(self._parents[vertices[-1]]))
        return np.ascontiguousarray(self._coordinates[:, vertices[::-1]].T)

    def extend(self, target: Vector, checker: MotionChecker, rng: Random, *, exactly: bool = True) -> Extension:
        """Grow from the vertex nearest to ``target`` towards it, one axis after the other (algorithm 10).

        Args:
            target: Configuration to go to, shape (n,).
            checker: Checks motions.
            rng: Gives the order of the axes, and the axes that take part if ``exactly`` is False.
            exactly: Whether the target itself has to be reached, see :meth:`extend_from`; if not, costly joints take
                part only by chance.
        """
        near = self.nearest(target)
        target = target if exactly else self._held(near, target, rng)
        return self.extend_from(near, target, checker, rng, exactly=exactly)

    def extend_from(
        self, near: int, target: Vector, checker: MotionChecker, rng: Random, *, exactly: bool = True
    ) -> Extension:
        """Grow from vertex ``near`` towards ``target``, shape (n,).

        The axis that led to ``near`` goes first, which lengthens straight runs and so saves moves; the others follow in
        random order. The legs before the first blocked one are kept.

        Args:
            near: Number of a vertex.
            target: Configuration to go to, shape (n,).
            checker: Checks motions.
            rng: Gives the order of the axes.
            exactly: What happens at a leg that is shorter than the smallest move: if True the extension ends, since the
                target would be missed; if False the leg is left out.
        """
        current = near
        known = self.size
        for axis in self._axis_order(near, rng):
            here = self.vertex(current)
            start = float(here[axis])
            end = float(target[axis])
            # Only the first leg can turn back along the edge that led to the vertex.
            came_from = self._came_from(near, axis) if current == near else start
            turn = _turn(came_from, start, end)
            if start == end:
                continue

            too_short = _shortest_piece(turn, came_from, start, end) < self._rules.smallest_move[axis]
            if too_short and not exactly:
                continue

            step = _moved(here, axis, end)
            if too_short or not _free(turn, _moved(here, axis, came_from), here, step, checker):
                return Extension(Outcome.TRAPPED if self.size == known else Outcome.ADVANCED, current)
            current = self._attach(step, turn, current)
        return Extension(Outcome.REACHED, current)

    def _held(self, near: int, target: Vector, rng: Random) -> Vector:
        """Return the target with the coordinates of costly joints, by chance, replaced by those of a vertex."""
        chance = self._rules.chance
        stays = np.array([c < 1.0 and rng.random() >= c for c in chance.tolist()])
        held: Vector = np.where(stays, self._coordinates[:, near], target)
        return held

    def _axis_order(self, near: int, rng: Random) -> list[int]:
        order = [int(axis) for axis in rng.permutation(self._axes)]
        parent = self._parents[near]
        if parent != ROOT:  # No edge leads to a root.
            memory = int((self._coordinates[:, near] != self._coordinates[:, parent]).argmax())
            order.remove(memory)
            order.insert(0, memory)
        return order

    def _came_from(self, vertex: int, axis: int) -> float:
        """Return the coordinate, along an axis, at which the edge to a vertex begins; for a root its own coordinate."""
        parent = int(self._parents[vertex])
        return float(self._coordinates[axis, vertex if parent == ROOT else parent])

    def _attach(self, step: Vector, turn: Turn, current: int) -> int:
        """Add the end of a leg and return its vertex; if the leg turns back along an edge, rewrite parents.

        Args:
            step: Configuration at the end of the leg, shape (n,).
            turn: How the leg continues the edge to ``current``.
            current: Vertex where the leg begins.
        """
        if turn is Turn.ONWARD:
            return self._add(step, current)

        parent = int(self._parents[current])
        if turn is Turn.BACK:
            return parent
        new = self._add(step, parent)
        if turn is Turn.BETWEEN:
            self._parents[current] = new
        return new

    def _add(self, q: Vector, parent: int) -> int:
        if self.size == len(self._parents):
            self._coordinates = np.hstack([self._coordinates, np.empty_like(self._coordinates)])
            self._parents = np.concatenate([self._parents, np.full_like(self._parents, ROOT)])
        self._coordinates[:, self.size] = q
        self._parents[self.size] = parent
        self.size += 1
        return self.size - 1


def _turn(came_from: float, start: float, end: float) -> Turn:
    """Return how a leg from ``start`` to ``end`` continues an edge from ``came_from`` to ``start`` on the same axis."""
    if start == came_from or (start - came_from) * (end - start) > 0.0:
        return Turn.ONWARD
    beyond = end - came_from
    if beyond == 0.0:
        return Turn.BACK
    return Turn.BETWEEN if (start - came_from) * beyond > 0.0 else Turn.BEYOND


def _shortest_piece(turn: Turn, came_from: float, start: float, end: float) -> float:
    """Return the length of the shortest edge that a leg would leave in the tree."""
    length = abs(end - start)
    return min(length, abs(end - came_from)) if turn in (Turn.BETWEEN, Turn.BEYOND) else length


def _free(turn: Turn, parent: Vector, here: Vector, step: Vector, checker: MotionChecker) -> bool:
    """Check whether the new edges that a leg leaves in the tree are free.

    Args:
        turn: How the leg continues the edge to its vertex.
        parent: Configuration where that edge begins, shape (n,).
        here: Configuration where the leg begins, shape (n,).
        step: Configuration where the leg ends, shape (n,).
        checker: Checks motions.
    """
    onward = turn not in (Turn.ONWARD, Turn.BETWEEN) or checker.motion_valid(here, step)
    return onward and (turn not in (Turn.BETWEEN, Turn.BEYOND) or checker.motion_valid(parent, step))


def _moved(q: Vector, axis: int, value: float) -> Vector:
    copy = q.copy()
    copy[axis] = value
    return copy


class Random(Protocol):
    """The methods of a random generator that a tree needs; numpy's generator has them too."""

    def random(self) -> float:
        """Return a number in [0, 1)."""

    def permutation(self, axes: Sequence[int]) -> Sequence[int]:
        """Return the axes in random order."""


class CrdtStream:
    """A source of random numbers that gives the same numbers as the kernels, so that both find the same path.

    Args:
        seed: A whole number from 0 to 2^64 - 1.
    """

    def __init__(self, seed: int) -> None:
        self._state = seed

    def random(self) -> float:
        """Return a number in [0, 1)."""
        self._state = (self._state + GOLDEN) & WORD
        z = ((self._state ^ (self._state >> 30)) * FIRST_FACTOR) & WORD
        z = ((z ^ (z >> 27)) * SECOND_FACTOR) & WORD
        return ((z ^ (z >> 31)) >> 11) * 2.0**-53

    def uniform(self, lower: Vector, upper: Vector) -> Vector:
        """Return a random configuration between bounds, shapes (n,)."""
        shares = np.array([self.random() for _ in range(len(lower))])
        q: Vector = np.minimum(lower + shares * (upper - lower), upper)
        return q

    def permutation(self, axes: Sequence[int]) -> list[int]:
        """Return the axes in random order (Fisher and Yates)."""
        order = [int(axis) for axis in axes]
        for k in range(len(order) - 1, 0, -1):
            other = int(self.random() * (k + 1))
            order[k], order[other] = order[other], order[k]
        return order
