"""A search along path constraints on arrays: the object that keeps the memory of the kernels and asks the world."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.kernels.search import tree_layout
from rrtik_ompl.kernels.search.connect_lengths import connect_lengths
from rrtik_ompl.kernels.search.constrained import layout
from rrtik_ompl.kernels.search.motions.motion_table import NO_LIMIT, FastMotions, MotionsFree
from rrtik_ompl.kernels.search.tree_memory import grow, tree_table
from rrtik_ompl.kernels.simd.halton import inverse_bases
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.kernels.simd.processor import WIDTH
from rrtik_ompl.kernels.tables.memory import Table, aligned, is_intact, table, whole_lanes

FIRST_CAPACITY = 128 * WIDTH  # vertices
MOST_ROOM = 16_384  # vertices of one walk
FIRST_BUDGET, MAX_BUDGET = 4, 1 << 14  # samples in one call of the kernel
CALL_SECONDS = 1e-3  # that a call should take; the processor's own clock takes up to half of it to read
SHORTEST_STEP = 0.01  # [unit of the box]; a walk of shorter ones may have more vertices


class ConstrainedSearch:
    """Trees along path constraints in a box of configurations; one object serves any number of searches.

    The same seed gives the same path.

    Args:
        motions: How motions are checked for collisions.
        held: The table of the constraints (:class:`rrtik_ompl.ik.held_tables.HeldTables`), which must outlive this.
        lower, upper: The box, shape (n,), finite.
        range_: Longest step [unit of the box]; what suits the box if None.
        shortest: Shortest step, likewise.

    Raises:
        InputError: If there are no kernels, or a number is out of range.
    """

    def __init__(
        self,
        motions: FastMotions,
        held: int,
        lower: Vector,
        upper: Vector,
        *,
        range_: float | None = None,
        shortest: float = SHORTEST_STEP,
    ) -> None:
        kernels = library(layout.KERNELS)
        if kernels is None:
            raise InputError("search in kernels: there are none; install numba")
        motions.require_covered(lower, upper)
        self._kernels, self._motions, self._dof = kernels, motions, motions.dof
        longest, domain = connect_lengths(lower, upper, range_, None, turning=np.ones(motions.dof, dtype=bool))
        joints = 0 if motions.identity else motions.joints
        self._trees = [tree_table(self._dof, joints, FIRST_CAPACITY) for _ in range(2)]
        numbers = np.array([longest, min(shortest, longest), longest, domain])
        self._search = _search_table(motions, self._trees, held, (lower, upper), numbers)
        fields: Any = self._search.header
        self._fields = memoryview(fields)
        self._room = min(round(layout.ROOM * max(SHORTEST_STEP / shortest, 1.0)), MOST_ROOM)
        self._fields[layout.WALK_ROOM] = self._room
        self._roots: list[NDArray[np.float64]] = [np.empty(0), np.empty(0)]
        self._questions = self._rejected = 0

    def solve(
        self,
        starts: Matrix,
        goals: Matrix,
        seed: int,
        *,
        ask: MotionsFree | None = None,
        stop: Callable[[], object] | None = None,
        max_iterations: int | None = None,
        unchecked: bool = False,
    ) -> Matrix | None:
        """Search for a path from any start to any goal.

        Args:
            starts: Configurations that are free and held, shape (s, n), s at least 1.
            goals: Likewise, shape (g, n), g at least 1.
            seed: Any whole number.
            ask: Decides motions (A, B), shapes (m, n), that the kernels leave undecided, shape (m,); if None, they
                count as colliding.
            stop: Called about every millisecond; true to give up.
            max_iterations: Samples at most.
            unchecked: Leave collisions out: what the constraints and the box alone allow.

        Returns:
            The path, start first, shape (k, n), or None.

        Raises:
            InputError: If a start or goal is not in the box.
        """
        self._set_roots(0, starts)
        self._set_roots(1, goals)
        self._fields[layout.RESOLVE], self._fields[layout.UNCHECKED] = int(ask is not None), int(unchecked)
        self._fields[layout.LIMIT] = NO_LIMIT if max_iterations is None else max_iterations
        self._questions = self._rejected = 0
        counts, number = (len(starts), len(goals)), int(seed) & (2**63 - 1)
        status = self._kernels.solve(self._search.address, *counts, number, FIRST_BUDGET)
        if status <= layout.OUTSIDE:
            root = layout.OUTSIDE - status
            what = f"start {root}" if root < counts[0] else f"goal {root - counts[0]}"
            raise InputError(f"search: {what} is not in the box of configurations")
        return self._finished(status, ask, stop)

    def go_on(
        self, max_iterations: int | None, *, ask: MotionsFree | None = None, stop: Callable[[], object] | None = None
    ) -> Matrix | None:
        """Search on, up to so many samples altogether; see :meth:`solve`."""
        self._fields[layout.LIMIT] = NO_LIMIT if max_iterations is None else max_iterations
        return self._finished(layout.RUNNING, ask, stop)

    def _finished(self, status: int, ask: MotionsFree | None, stop: Callable[[], object] | None) -> Matrix | None:
        """Call the kernel again and again until there is a path, or no more samples or time; the path."""
        budget = FIRST_BUDGET
        while status != layout.EXHAUSTED:
            if status == layout.SOLVED:
                path = self._settled(ask)
                if path is not None:
                    return path
            elif status == layout.FULL:
                for tree in self._trees:
                    grow(tree)
            if stop is not None and stop():
                break
            begin = time.perf_counter()
            status = self._kernels.resume(self._search.address, budget)
            elapsed = time.perf_counter() - begin
            budget = min(2 * budget, MAX_BUDGET) if elapsed < 0.5 * CALL_SECONDS else max(budget // 2, 1)
        return None

    def connect(self, a: Vector, b: Vector, *, ask: MotionsFree | None = None) -> Matrix | None:
        """A free way from a to b, shapes (n,), in steps along the constraints straight towards b; shape (k, n).

        See :meth:`solve` for ``ask``; None if it does not get there.
        """
        self._set_roots(0, a[None])
        self._set_roots(1, b[None])
        self._fields[layout.RESOLVE], self._fields[layout.UNCHECKED] = int(ask is not None), 0
        count = self._kernels.connect(self._search.address)
        rows = self._rows(0)[:count].copy()
        if count == 0 or ask is None:
            return rows if count else None
        open_ = np.flatnonzero(self._trees[0][tree_layout.STATES][:count] == tree_layout.OPEN)
        return rows if len(open_) == 0 or ask(rows[open_ - 1], rows[open_]).all() else None

    @property
    def trees(self) -> list[Table]:
        """The trees from the starts and from the goals."""
        return self._trees

    @property
    def sizes(self) -> tuple[int, int]:
        """Vertices of the trees from the starts and from the goals."""
        first, second = (int(tree.header[tree_layout.SIZE]) for tree in self._trees)
        return first, second

    def statistics(self) -> dict[str, int | float]:
        """Counts of the last search."""
        return {
            "iterations": self._fields[layout.ITERATIONS],
            "vertices": sum(self.sizes),
            "motions": self._fields[layout.CHECKED],
            "questions": self._questions,
            "rejected": self._rejected,
        }

    def intact(self) -> bool:
        """Whether no kernel has written beyond the memory of the search."""
        tables = all(own.intact() for own in (self._search, *self._trees))
        return tables and all(is_intact(rows) for rows in self._roots)

    def _settled(self, ask: MotionsFree | None) -> Matrix | None:
        """The path, once the world has answered for its open motions; None where one of them is not free."""
        branches = [self._branch(side, self._fields[layout.START_MEETING + side]) for side in range(2)]
        for side, branch in enumerate(branches):
            tree = self._trees[side]
            states, parents = tree[tree_layout.STATES], tree[tree_layout.PARENTS]
            open_ = [vertex for vertex in branch if states[vertex] == tree_layout.OPEN]
            if not open_ or ask is None:
                continue
            rows = self._rows(side)
            free = ask(rows[parents[open_]].copy(), rows[open_].copy())
            self._questions += len(open_)
            states[np.array(open_)[free]] = tree_layout.CERTAIN
            for vertex in np.array(open_)[~free].tolist():
                self._kernels.reject(self._search.address, side, vertex)
            if not free.all():
                self._rejected += 1
                return None
        there, back = (self._rows(side)[branch] for side, branch in enumerate(branches))
        return np.vstack([there[::-1], back[1:]])

    def _branch(self, side: int, vertex: int) -> list[int]:
        """A vertex and what leads to it, the root last."""
        parents, branch = self._trees[side][tree_layout.PARENTS], [vertex]
        while (vertex := int(parents[vertex])) >= 0:
            branch.append(vertex)
        return branch

    def _rows(self, side: int) -> Matrix:
        rows: Matrix = self._trees[side][tree_layout.ROWS].reshape(-1, self._dof)
        return rows

    def _set_roots(self, side: int, rows: Matrix) -> None:
        while len(rows) + self._room >= int(self._trees[0].header[tree_layout.CAPACITY]):
            for tree in self._trees:
                grow(tree)
        self._roots[side] = aligned(np.asarray(rows, dtype=np.float64))
        self._fields[layout.START_ROWS + side] = self._roots[side].ctypes.data


def _search_table(
    motions: FastMotions, trees: list[Table], held: int, box: tuple[Vector, Vector], numbers: Vector
) -> Table:
    """The table of a search; fields that are not named here are numbers that the kernels set."""
    dof = motions.dof
    fields: dict[int, int | NDArray[Any]] = dict.fromkeys(range(layout.FIELD_COUNT), 0)
    fields |= {layout.MOTIONS: motions.address, layout.HELD: held, layout.NUMBERS: numbers}
    fields |= {layout.START_TREE + side: tree.address for side, tree in enumerate(trees)}
    fields |= {layout.LOWER: np.asarray(box[0]), layout.UPPER: np.asarray(box[1])}
    fields |= {layout.INVERSE_BASES: whole_lanes(np.array(inverse_bases(dof)))}
    fields |= {place: whole_lanes(np.zeros(dof)) for place in (layout.ROW, layout.AIM, layout.POINT)}
    fields |= {layout.ROW_VALUES: np.zeros(motions.joints), layout.QUERY: np.zeros(dof, dtype=np.float32)}
    made = table(fields)
    if motions.identity:
        made.header[layout.ROW_VALUES] = made.header[layout.ROW]
    return made
