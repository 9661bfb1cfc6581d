"""Searches with C-RDT trees, run in kernels: their memory, and the talk with the world.

The kernels decide what they can; the world is asked about the rest, all edges of an extension at once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import accumulate
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Matrix
from rrtik_ompl.errors import PlannerError
from rrtik_ompl.fast.search.crdt import layout as table
from rrtik_ompl.fast.search.crdt.rules import KERNELS, CrdtRules
from rrtik_ompl.fast.simd.library import library
from rrtik_ompl.fast.simd.processor import WIDTH
from rrtik_ompl.fast.tables.layout import ALIGNMENT, COLLIDING, FREE, UNDECIDED
from rrtik_ompl.robot import LIMIT_TOLERANCE

FIRST_CAPACITY = 256
FIRST_BUDGET = 16  # iterations
LEAST_PAUSE, MOST_PAUSE = 0.5e-3, 2e-3  # [s] between two looks at the clock, if iterations are not longer
NO_LIMIT = 2**62


class CrdtSearch:
    """A search in progress. It stops at each solution and can be told to go on.

    Args:
        world: A :class:`rrtik_ompl.World` with kernels.
        rules: How trees grow.
        seed: Of the random stream, 0 to 2^63 - 1.
        limit: Most iterations, None for no limit.
        roots: Of each of the two trees, shapes (r, n); or of the only one.
        goals: For a single tree: what vertices near them try to reach, shape (g, n).
        tolerance: How near [unit of the space].
    """

    def __init__(
        self,
        world: Any,
        rules: CrdtRules,
        seed: int,
        limit: int | None,
        *roots: Matrix,
        goals: Matrix | None = None,
        tolerance: float = 0.0,
    ) -> None:
        kernels = library(KERNELS)
        if kernels is None:
            raise PlannerError("there are no kernels for this processor; see has_kernels")
        self._world = world
        single = goals is not None
        self._resume = kernels.resume_single if single else kernels.resume_pair
        self._trees = [_Tree(rows) for rows in roots]
        self._addresses = np.array([tree.address for tree in self._trees])
        dof, aims = len(rules.lower), np.empty((0, 0)) if goals is None else goals
        self._floats, self._integers = _floats(world, rules, tolerance, aims), _integers(rules)
        fields = {
            **self._floats.addresses,
            **self._integers.addresses,
            table.WORLD: world.fast.address,
            table.DOF: dof,
            table.ASKS: int(getattr(world, "accuracy", "exact") == "exact"),
            table.AXIS_COUNT: len(rules.axes),
            table.RANDOM: seed,
            table.ITERATION_LIMIT: NO_LIMIT if limit is None else limit,
            table.NEXT: table.CHOOSE_GOAL if single else table.BEGIN,
            table.TREES: int(self._addresses.ctypes.data),
            table.GOAL_COUNT: len(aims),
            table.VERTEX_END: len(roots[0]) if single else 0,
        }
        self._header = np.array([fields.get(place, 0) for place in range(table.FIELDS)], dtype=np.int64)
        self._address = int(self._header.ctypes.data)
        self._edges = [self._floats.of[place].reshape(dof + 1, dof) for place in (table.STARTS, table.ENDS)]
        self._budget = FIRST_BUDGET

    @property
    def iterations(self) -> int:
        """Samples drawn so far."""
        return self._field(table.ITERATIONS)

    @property
    def vertices(self) -> int:
        """Vertices of all trees."""
        return sum(tree.size for tree in self._trees)

    @property
    def motions(self) -> int:
        """Edges that were asked about so far."""
        return self._field(table.MOTIONS)

    def advance(self, stop: Callable[[], Any]) -> bool:
        """Go on to the next solution; False if ``stop()`` or the limit of iterations came first."""
        while not stop():
            begin, until = perf_counter(), self.iterations + self._budget
            status = self._go_on(until)
            while status in (table.ASKING, table.FULL) and perf_counter() - begin < MOST_PAUSE:
                status = self._go_on(until)
            if status in (table.SOLVED, table.EXHAUSTED):
                return status == table.SOLVED
            self._pace(perf_counter() - begin)
        return False

    def meeting(self) -> tuple[Matrix, Matrix]:
        """The way from the root of each of two trees to the vertex at which they met, shapes (k, n)."""
        met, other = self._field(table.MET), self._field(table.LAST)
        if self._field(table.GROWING) == 0:  # the turns have changed since
            met, other = other, met
        return self._trees[0].branch(met), self._trees[1].branch(other)

    def ending(self) -> Matrix:
        """The way from the root of a single tree to the goal that it reached, shape (k, n)."""
        return self._trees[0].branch(self._field(table.LAST))

    def tree(self, number: int) -> Matrix:
        """The vertices of a tree, shape (size, n)."""
        return np.ascontiguousarray(self._trees[number].vertices)

    def branch(self, number: int, vertex: int) -> Matrix:
        """The way from the root of a tree to a vertex, shape (k, n)."""
        return self._trees[number].branch(vertex)

    def _go_on(self, until: int) -> int:
        """Let the kernel work up to a number of iterations, or until it wants an answer or room, and give it that."""
        status = self._resume(self._address, until - self.iterations)
        if status == table.ASKING:
            self._answer()
        elif status == table.FULL:
            self._grow()
        return status

    def _answer(self) -> None:
        """Ask the world about the edges that the kernels left undecided."""
        verdicts = self._integers.of[table.VERDICTS][: self._field(table.EDGE_COUNT)]
        asked = np.flatnonzero(verdicts == UNDECIDED)
        free = self._world.motion_valid_batch(self._edges[0][asked], self._edges[1][asked])
        verdicts[asked] = np.where(free, FREE, COLLIDING)

    def _grow(self) -> None:
        """Twice the room for each tree."""
        self._trees = [tree.grown() for tree in self._trees]
        self._addresses[:] = [tree.address for tree in self._trees]

    def _pace(self, seconds: float) -> None:
        """More or fewer iterations next time, so that the clock is looked at about every millisecond."""
        if seconds < LEAST_PAUSE:
            self._budget *= 2
        elif seconds > MOST_PAUSE:
            self._budget = max(1, self._budget // 2)

    def _field(self, place: int) -> int:
        return int(self._header[place])


class _Tree:
    """Vertices of a tree, roots all of them unless ``parents`` are given, with room for more."""

    def __init__(self, rows: Matrix, parents: NDArray[np.int32] | None = None, capacity: int = FIRST_CAPACITY) -> None:
        count, dof = rows.shape
        while capacity < count + dof:
            capacity *= 2
        self.runs: Matrix = _room(dof * capacity, np.float64).reshape(dof, capacity)
        self.runs[:, :count] = rows.T
        self.parents: NDArray[np.int32] = _room(capacity, np.int32)
        self.parents[:count] = table.ROOT if parents is None else parents
        addresses = self.runs.ctypes.data, self.parents.ctypes.data
        self.header = np.array([count, capacity, *addresses], dtype=np.int64)
        self.address = int(self.header.ctypes.data)

    @property
    def size(self) -> int:
        """Number of vertices."""
        return int(self.header[table.SIZE])

    @property
    def vertices(self) -> Matrix:
        """Shape (size, n). A view."""
        return self.runs[:, : self.size].T

    def branch(self, vertex: int) -> Matrix:
        """The way from the root to a vertex, shape (k, n)."""
        way = [vertex]
        while (parent := self.parents.item(way[-1])) != table.ROOT:
            way.append(parent)
        return np.ascontiguousarray(self.runs[:, way[::-1]].T)

    def grown(self) -> _Tree:
        """The same tree with twice the room."""
        return _Tree(self.vertices, self.parents[: self.size], 2 * len(self.parents))


class _Arrays:
    """Arrays of one kind in a row in memory, each known by its field's number."""

    def __init__(self, kind: type, fields: Mapping[int, NDArray[Any] | int]) -> None:
        """Take numbers for the sizes of arrays of zeros."""
        sizes = [value if isinstance(value, int) else value.size for value in fields.values()]
        ends = list(accumulate(sizes))
        memory = _room(ends[-1], kind)
        self.of = {place: memory[end - size : end] for place, size, end in zip(fields, sizes, ends, strict=True)}
        for place, value in fields.items():
            if not isinstance(value, int):
                self.of[place][:] = value.ravel()
        start, width = memory.ctypes.data, memory.itemsize
        self.addresses = {p: start + width * (end - size) for p, size, end in zip(fields, sizes, ends, strict=True)}


def _room(count: int, kind: type) -> NDArray[Any]:
    """Zeros, the first of them at a multiple of ``ALIGNMENT`` bytes."""
    memory = np.zeros(count * np.dtype(kind).itemsize + ALIGNMENT, dtype=np.uint8)
    start = -memory.ctypes.data % ALIGNMENT
    return memory[start : start + count * np.dtype(kind).itemsize].view(kind)


def _floats(world: Any, rules: CrdtRules, tolerance: float, goals: Matrix) -> _Arrays:
    """What decides about a motion and how trees grow, and room for one extension."""
    robot, dof = world.robot, len(rules.lower)
    return _Arrays(
        np.float64,
        {
            table.DISTANCES: 2 * WIDTH,
            table.GAIN: robot.chain.gain,
            table.OFFSET: robot.chain.offset,
            table.WEIGHTS: world.weights,
            table.LEAST: robot.lower - LIMIT_TOLERANCE,
            table.MOST: robot.upper + LIMIT_TOLERANCE,
            table.NUMBERS: np.array([world.motion_resolution, tolerance * tolerance]),
            table.VALUES: 2 * len(robot.chain.parent),
            table.LOWER: rules.lower,
            table.UPPER: rules.upper,
            table.SCALE: rules.scale,
            table.SMALLEST_MOVE: rules.smallest_move,
            table.CHANCE: rules.chance,
            table.TARGET: dof,
            table.CURRENT: dof,
            table.STARTS: (dof + 1) * dof,
            table.ENDS: (dof + 1) * dof,
            table.GOALS: goals,
        },
    )


def _integers(rules: CrdtRules) -> _Arrays:
    """The axes that may move, and room for their order and for verdicts."""
    dof = len(rules.lower)
    return _Arrays(np.int32, {table.AXES: rules.axes, table.ORDER: dof, table.VERDICTS: dof + 1})
