"""Searches with C-RDT trees, run in kernels: their memory, and callbacks for undecided edges.

The kernels decide what they can; the world is asked about the rest, all edges of an extension at once.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from time import thread_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.errors import PlannerError
from rrtik_ompl.kernels.layout import COLLIDING, FREE, UNDECIDED
from rrtik_ompl.kernels.search.crdt import layout as crdt_layout
from rrtik_ompl.kernels.search.crdt.layout import CrdtTable, CrdtTreeTable
from rrtik_ompl.kernels.search.crdt.rules import KERNELS, CrdtRules
from rrtik_ompl.kernels.search.motions.motion_table import NO_LIMIT, FastMotions
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.kernels.simd.processor import WIDTH
from rrtik_ompl.kernels.tables.memory import PlannedTable, TablePlan, aligned, packed, sizes_of
from rrtik_ompl.model.robot import LIMIT_TOLERANCE, Robot

FIRST_CAPACITY = 256  # vertices
FIRST_BUDGET = 16  # iterations
MIN_PAUSE, MAX_PAUSE = 0.5e-3, 2e-3  # [s] between two readings of the clock, if iterations are not longer


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
        vertices: For which each tree has room at first.
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
        vertices: int = FIRST_CAPACITY,
    ) -> None:
        kernels = library(KERNELS)
        motions = world.motions
        if kernels is None or motions is None:
            raise PlannerError("there are no kernels for this processor; see has_kernels")
        self._world = world  # they own the tables
        self._motions = motions
        self._resume = kernels.resume_pair if goals is None else kernels.resume_single
        self._trees = [TreeMemory(rows, vertices) for rows in roots]
        aims = np.zeros((0, motions.dof)) if goals is None else goals
        self._table = _search_table(motions, world.robot, rules, aims)
        self._table.random = seed
        self._table.iteration_limit = NO_LIMIT if limit is None else limit
        self._table.next = crdt_layout.BEGIN if goals is None else crdt_layout.CHOOSE_GOAL
        self._table.vertex_end = 0 if goals is None else len(roots[0])
        self._table.goal_tolerance = tolerance * tolerance
        for name, tree in zip(("tree", "other_tree"), self._trees, strict=False):
            self._table.put(**{name: tree.table})
        self._budget = FIRST_BUDGET

    @property
    def tables(self) -> tuple[CrdtTable, tuple[CrdtTreeTable, ...]]:
        """What the kernels read: the table of the search, and those of its trees."""
        return self._table, tuple(tree.table for tree in self._trees)

    @property
    def iterations(self) -> int:
        """Samples drawn so far."""
        return self._table.iterations

    @property
    def vertices(self) -> int:
        """Vertices of all trees."""
        return sum(tree.size for tree in self._trees)

    @property
    def motions(self) -> int:
        """Edges that were checked so far."""
        return self._table.checked

    def advance(self, stop: Callable[[], Any]) -> bool:
        """Go on to the next solution; False if ``stop()`` or the limit of iterations came first."""
        while not stop():
            begin = thread_time()
            until = self.iterations + self._budget
            status = self._go_on(until)
            while status in (crdt_layout.ASKING, crdt_layout.FULL) and thread_time() - begin < MAX_PAUSE:
                status = self._go_on(until)
            if status in (crdt_layout.SOLVED, crdt_layout.EXHAUSTED):
                return status == crdt_layout.SOLVED
            self._pace(thread_time() - begin)
        return False

    def meeting(self) -> tuple[Matrix, Matrix]:
        """The branch of each of two trees from its root to the vertex at which they met, shapes (k, n)."""
        met = self._table.met
        other = self._table.last
        if self._table.growing == 0:  # the turns have changed since
            met, other = other, met
        return self._trees[0].branch(met), self._trees[1].branch(other)

    def ending(self) -> Matrix:
        """The branch of a single tree from its root to the goal that it reached, shape (k, n)."""
        return self._trees[0].branch(self._table.last)

    def tree(self, number: int) -> Matrix:
        """The vertices of a tree, shape (size, n)."""
        return np.ascontiguousarray(self._trees[number].vertices)

    def grown(self, number: int) -> tuple[Matrix, NDArray[np.int64]]:
        """The vertices of a tree, shape (size, n), and their parents, shape (size,)."""
        return self.tree(number), self._trees[number].parents

    def branch(self, number: int, vertex: int) -> Matrix:
        """The branch of a tree from its root to a vertex, shape (k, n)."""
        return self._trees[number].branch(vertex)

    def intact(self) -> bool:
        """Whether no kernel has written beyond the memory of the search or what it works on."""
        return self._motions.intact() and self._table.intact() and all(tree.intact() for tree in self._trees)

    def _go_on(self, until: int) -> int:
        """Let the kernel work up to a number of iterations, or until it wants an answer or room, and give it that."""
        status = self._resume(self._table.address, until - self.iterations)
        if status == crdt_layout.ASKING:
            self._answer()
        elif status == crdt_layout.FULL:
            self._grow()
        return status

    def _answer(self) -> None:
        """Ask the world about the edges that the kernels left undecided."""
        verdicts = self._table.verdicts.view(np.int32)[: self._table.edge_count]
        asked = np.flatnonzero(verdicts == UNDECIDED)
        rows = self._table.extension.reshape(-1, self._motions.dof)[crdt_layout.EDGES :]
        starts, ends = np.split(rows, 2)
        free = self._world.motion_valid_batch(starts[asked], ends[asked])
        verdicts[asked] = np.where(free, FREE, COLLIDING)

    def _grow(self) -> None:
        """Twice the room for each tree."""
        for tree in self._trees:
            tree.grow()

    def _pace(self, seconds: float) -> None:
        """More or fewer iterations next time, so that the clock is read about every millisecond."""
        if seconds < MIN_PAUSE:
            self._budget *= 2
        elif seconds > MAX_PAUSE:
            self._budget = max(1, self._budget // 2)


def _search_table(motions: FastMotions, robot: Robot, rules: CrdtRules, goals: Matrix) -> CrdtTable:
    """The table of a search; fields that are not set here are set later, by the search or its kernels."""
    table = CrdtTable(PlannedTable(_plan(motions.dof, len(rules.axes), len(goals))))
    table.put(motions=motions.table)
    limits = robot.lower - LIMIT_TOLERANCE, robot.upper + LIMIT_TOLERANCE
    rows = (*limits, rules.lower, rules.upper, rules.scale, rules.smallest_move, rules.chance)
    table.rules[:] = np.concatenate(rows)
    table.axes.view(np.int32)[: len(rules.axes)] = rules.axes
    table.goals[:] = goals.ravel()
    return table


@lru_cache(maxsize=64)
def _plan(dof: int, axes: int, goals: int) -> TablePlan:
    """Where the arrays of a search lie; the first one is read in whole lanes."""
    return sizes_of(
        CrdtTable,
        nearest=2 * WIDTH,
        rules=crdt_layout.RULE_COUNT * dof,
        extension=(crdt_layout.EDGES + 2 * (dof + 1)) * dof,
        axes=_words(axes),
        order=_words(dof),
        verdicts=_words(dof + 1),
        goals=goals * dof,
        axis_count=axes,
        goal_count=goals,
    )


def _words(integers: int) -> int:
    """Words of 8 bytes that so many int32 take."""
    return -(-integers // 2)


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
        vertices = self.vertices
        parents = self._parents[: self.size]
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
