"""RRT-Connect on arrays: the search object that keeps the memory of the kernels and answers their questions."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Matrix, Vector, finite_array
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.kernels.search import connect_layout
from rrtik_ompl.kernels.search.connect_lengths import connect_lengths
from rrtik_ompl.kernels.search.motions.motion_table import NO_LIMIT, FastMotions, MotionsFree
from rrtik_ompl.kernels.search.tree_layout import CAPACITY, SIZE
from rrtik_ompl.kernels.search.tree_memory import grow, tree_table
from rrtik_ompl.kernels.simd.halton import inverse_bases
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.kernels.simd.processor import WIDTH
from rrtik_ompl.kernels.tables.memory import Table, aligned, is_intact, table, whole_lanes

PATIENCE = 8  # rejected paths until undecided motions are asked for at once
FIRST_CAPACITY = 64 * WIDTH  # vertices
FIRST_ROOTS = 16
FIRST_PATH = 64  # rows
FIRST_BUDGET, MIN_BUDGET, MAX_BUDGET = 256, 16, 1 << 20  # motions in one call of the kernel
CALL_SECONDS = 1e-3  # that a call should take; the processor's own clock takes up to half of it to read


class ConnectSearch:
    """RRT-Connect in a box of configurations, whole in a kernel; one object serves any number of searches.

    Its memory is made once and grows as needed. The same seed gives the same path.

    Attributes:
        range: Length of a motion of the trees, at most [unit of the box].
        domain: Radius in which a vertex is extended once it was blocked [unit of the box].

    Args:
        motions: How motions are checked in a world.
        lower, upper: The box, shape (n,), finite.
        range_: See ``range``; what suits the box if None.
        domain: See ``domain``; what suits the box if None.
        patience: Paths that may be rejected until undecided motions are asked for before they are used.
        vertices: For which each tree has room at first, a multiple of ``WIDTH``.

    Raises:
        InputError: If there are no kernels, shapes do not fit, or a number is out of range.
    """

    def __init__(
        self,
        motions: FastMotions,
        lower: ArrayLike,
        upper: ArrayLike,
        *,
        range_: float | None = None,
        domain: float | None = None,
        patience: int = PATIENCE,
        vertices: int = FIRST_CAPACITY,
    ) -> None:
        kernels = library(connect_layout.KERNELS)
        if kernels is None:
            raise InputError("search in kernels: there are none; install numba")
        self._kernels = kernels
        self._motions = motions  # owns the tables
        self._dof = dof = motions.dof
        box = finite_array(lower, (dof,), "lower bounds"), finite_array(upper, (dof,), "upper bounds")
        if dof == 0 or (box[0] > box[1]).any():
            raise InputError(f"bounds: expected {dof} upper ones, none below its lower one, and at least one")
        motions.require_covered(*box)
        self.range, self.domain = connect_lengths(*box, range_, domain, turning=np.ones(dof, dtype=bool))
        joints = 0 if motions.identity else motions.joints
        self._trees = [tree_table(dof, joints, vertices) for _ in range(2)]
        numbers = np.array([self.range, self.domain, connect_layout.UNBOUNDED_SPREAD, connect_layout.UNBOUNDED_COST])
        self._search = _search_table(motions, self._trees, box, numbers)
        fields: Any = self._search.header
        self._fields = memoryview(fields)  # numpy takes ten times as long for one number
        self._fields[connect_layout.PATIENCE] = patience
        self._roots = [np.empty((0, dof)), np.empty((0, dof))]
        self._places = [0, 0]  # addresses of the roots in memory, which numpy takes a microsecond to find
        for side in range(2):
            self._make_room(side, FIRST_ROOTS)
        self._make_path_room(FIRST_PATH)
        self._questions = 0

    def solve(
        self,
        starts: Matrix,
        goals: Matrix,
        seed: int,
        *,
        ask: MotionsFree | None = None,
        stop: Callable[[], object] | None = None,
        max_iterations: int | None = None,
        bound: float | None = None,
    ) -> Matrix | None:
        """Search for a path from any start to any goal.

        Args:
            starts: Free configurations, shape (s, n), s at least 1.
            goals: Free configurations, shape (g, n), g at least 1.
            seed: Any whole number.
            ask: Decides motions (A, B), shapes (m, n), that the kernels leave undecided, shape (m,); if None, they
                count as colliding.
            stop: Called about every millisecond and before each question; true to give up.
            max_iterations: Samples at most.
            bound: Length that the path has to stay below, if it is not a straight motion; None for any path.

        Returns:
            The path, start first, shape (k, n), or None.

        Raises:
            InputError: If shapes do not fit or a start or goal is not in the box.
        """
        self._set_roots(0, starts)
        self._set_roots(1, goals)
        self._fields[connect_layout.RESOLVE] = ask is not None
        self._fields[connect_layout.LIMIT] = NO_LIMIT if max_iterations is None else max_iterations
        length = connect_layout.UNBOUNDED_COST if bound is None else bound
        self._search[connect_layout.NUMBERS][connect_layout.BOUND] = length
        self._questions = 0
        counts, number = (len(starts), len(goals)), int(seed) & (2**63 - 1)
        status = self._kernels.solve(self._search.address, *counts, number, FIRST_BUDGET)
        if status <= connect_layout.OUTSIDE:
            root = connect_layout.OUTSIDE - status
            what = f"start {root}" if root < counts[0] else f"goal {root - counts[0]}"
            raise InputError(f"search: {what} is not in the box of configurations")
        return self._path() if self._finished(status, ask, stop) == connect_layout.SOLVED else None

    @property
    def table(self) -> Table:
        """What the kernels read."""
        return self._search

    @property
    def trees(self) -> tuple[Table, Table]:
        """The trees of the start and of the goal."""
        return self._trees[0], self._trees[1]

    @property
    def rows(self) -> tuple[Matrix, Matrix, Matrix]:
        """Where starts, goals and the path stand, shapes (k, n)."""
        return self._roots[0], self._roots[1], self._path_rows

    @property
    def capacity(self) -> int:
        """Vertices for which each tree has room."""
        return int(self._trees[0].header[CAPACITY])

    def serve(self, roots: int, max_iterations: int) -> int:
        """Let other kernels begin searches, with as many roots on a side; the address of the table.

        Such a search asks nothing and draws ``max_iterations`` samples at most; :meth:`go_on` continues it.
        """
        self._fit_trees(roots)
        self._fields[connect_layout.RESOLVE], self._fields[connect_layout.LIMIT] = 0, max_iterations
        return self._search.address

    def go_on(self, stop: Callable[[], object]) -> bool:
        """Search on, where another kernel has begun; whether there is a path."""
        return self._finished(connect_layout.RUNNING, None, stop) == connect_layout.SOLVED

    def proven_free(self, rows: Matrix) -> bool:
        """Whether all configurations, shape (k, n), lie in the box and the covers prove them free."""
        self._set_roots(0, rows)
        return self._kernels.rows_free(self._search.address, self._places[0], len(rows)) != 0

    def statistics(self) -> dict[str, int | float]:
        """Counts of the last search.

        Samples, vertices of both trees, motions checked, motions asked for, and paths that an answer has broken.
        """
        iterations, rejected, motions = self._fields[_COUNTS]
        vertices = sum(int(tree.header[SIZE]) for tree in self._trees)
        return {
            "iterations": iterations,
            "vertices": vertices,
            "motions": motions,
            "questions": self._questions,
            "rejected": rejected,
        }

    def intact(self) -> bool:
        """Whether no kernel has written beyond the memory of the search or what it works on."""
        tables = self._motions.intact() and all(own.intact() for own in (self._search, *self._trees))
        return tables and all(is_intact(rows) for rows in (*self._roots, self._path_rows))

    def _finished(self, status: int, ask: MotionsFree | None, stop: Callable[[], object] | None) -> int:
        """Do what a status asks for and call the kernel again, until it is done; its last status."""
        budget = FIRST_BUDGET
        while status > connect_layout.EXHAUSTED:
            if stop is not None and stop():
                return connect_layout.RUNNING
            if status == connect_layout.ASKING and ask is not None:
                self._answer(ask)
            elif status == connect_layout.FULL:
                self._grow()
            begin = time.perf_counter()
            status = self._kernels.resume(self._search.address, budget)
            elapsed = time.perf_counter() - begin
            if status == connect_layout.RUNNING:
                budget = min(2 * budget, MAX_BUDGET) if elapsed < 0.5 * CALL_SECONDS else budget
                budget = max(budget // 2, MIN_BUDGET) if elapsed > 2.0 * CALL_SECONDS else budget
        return status

    def _answer(self, ask: MotionsFree) -> None:
        count, shape = self._fields[connect_layout.QUESTIONS], (-1, self._dof)
        ends = (self._search[place].reshape(shape)[:count].copy() for place in _QUESTIONS)
        self._search[connect_layout.ANSWERS][:count] = ask(*ends)
        self._questions += count

    def _grow(self) -> None:
        for tree in self._trees:
            grow(tree)

    def _path(self) -> Matrix:
        count = self._fields[connect_layout.PATH_ROWS]
        if count > len(self._path_rows):
            self._make_path_room(2 * count)
            self._kernels.keep_path(self._search.address)
        return self._path_rows[:count].copy()

    def _set_roots(self, side: int, rows: Matrix) -> None:
        if rows.ndim != 2 or rows.shape[1] != self._dof or len(rows) == 0:
            raise InputError(f"search: expected starts and goals of shape (k, {self._dof}), got {rows.shape}")
        if len(rows) > len(self._roots[side]):
            self._make_room(side, 2 * len(rows))
        self._fit_trees(len(rows))
        self._roots[side][: len(rows)] = rows

    def _fit_trees(self, roots: int) -> None:
        while roots >= FIRST_CAPACITY and roots >= self.capacity:
            self._grow()  # both are as large

    def _make_room(self, side: int, count: int) -> None:
        self._roots[side] = aligned(np.zeros(count * self._dof)).reshape(count, self._dof)
        self._places[side] = self._roots[side].ctypes.data
        self._fields[connect_layout.START_ROWS + side] = self._places[side]

    def _make_path_room(self, count: int) -> None:
        self._path_rows = aligned(np.zeros(count * self._dof)).reshape(count, self._dof)
        self._fields[connect_layout.PATH] = self._path_rows.ctypes.data
        self._fields[connect_layout.PATH_CAPACITY] = count


_QUESTIONS = (connect_layout.QUESTION_STARTS, connect_layout.QUESTION_ENDS)
_COUNTS = slice(connect_layout.ITERATIONS, connect_layout.CHECKED + 1)


def _search_table(motions: FastMotions, trees: list[Table], box: tuple[Vector, Vector], numbers: Vector) -> Table:
    """The table of a search; fields that are not named here are numbers that the kernels set."""
    dof, asked = motions.dof, connect_layout.MAX_QUESTIONS
    fields: dict[int, int | NDArray[Any]] = dict.fromkeys(range(connect_layout.FIELD_COUNT), 0)
    fields |= {connect_layout.MOTIONS: motions.address}
    fields |= {connect_layout.START_TREE + side: tree.address for side, tree in enumerate(trees)}
    lanes: dict[int, NDArray[Any]] = {connect_layout.LOWER: box[0], connect_layout.UPPER: box[1]}
    lanes |= {connect_layout.INVERSE_BASES: np.array(inverse_bases(dof))}
    lanes |= {place: np.zeros(dof) for place in (connect_layout.ROW, connect_layout.POINT, connect_layout.CENTRE)}
    lanes |= {connect_layout.QUERY: np.zeros(dof, dtype=np.float32)}
    fields |= {place: whole_lanes(row) for place, row in lanes.items()}
    fields |= {connect_layout.NUMBERS: numbers}
    fields |= {connect_layout.ROW_VALUES: np.zeros(motions.joints)}
    fields |= {place: np.zeros(asked * dof) for place in _QUESTIONS}
    whole = (connect_layout.QUESTION_SIDES, connect_layout.QUESTION_VERTICES, connect_layout.ANSWERS)
    fields |= {place: np.zeros(asked, dtype=np.int32) for place in whole}
    made = table(fields)
    if motions.identity:
        made.header[connect_layout.ROW_VALUES] = made.header[connect_layout.ROW]
    return made
