"""A search along path constraints on arrays: the object that keeps the memory of the kernels and asks the world."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.kernels.search import tree_layout
from rrtik_ompl.kernels.search.connect_lengths import connect_lengths
from rrtik_ompl.kernels.search.constrained import layout
from rrtik_ompl.kernels.search.constrained.layout import ConstrainedTable, HeldTable
from rrtik_ompl.kernels.search.motions.motion_table import NO_LIMIT, FastMotions, MotionsFree
from rrtik_ompl.kernels.search.tree_layout import TreeTable
from rrtik_ompl.kernels.search.tree_memory import grow, sampled, tree_table
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.kernels.simd.processor import WIDTH
from rrtik_ompl.kernels.tables.memory import aligned

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
        held: The table of the constraints (:class:`rrtik_ompl.ik.held_tables.HeldTables`).
        lower, upper: The box, shape (n,), finite.
        range_: Longest step [unit of the box]; what suits the box if None.
        shortest: Shortest step, likewise.

    Raises:
        InputError: If there are no kernels, or a number is out of range.
    """

    def __init__(
        self,
        motions: FastMotions,
        held: HeldTable,
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
        self._kernels = kernels
        self._motions = motions
        self._dof = motions.dof
        longest, domain = connect_lengths(lower, upper, range_, None, turning=np.ones(motions.dof, dtype=bool))
        joints = 0 if motions.identity else motions.joints
        self._trees = [tree_table(self._dof, joints, FIRST_CAPACITY) for _ in range(2)]
        self._room = min(round(layout.ROOM * max(SHORTEST_STEP / shortest, 1.0)), MOST_ROOM)
        self._search = sampled(
            ConstrainedTable,
            motions,
            (np.asarray(lower), np.asarray(upper)),
            start_tree=self._trees[0],
            goal_tree=self._trees[1],
            held=held,
            domain=domain,
            walk_room=self._room,
            longest=longest,
            shortest=min(shortest, longest),
            step=longest,
            aim=np.zeros(motions.dof),
        )
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
        self._search.put(resolve=int(ask is not None), unchecked=int(unchecked))
        self._search.limit = NO_LIMIT if max_iterations is None else max_iterations
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
        self._search.limit = NO_LIMIT if max_iterations is None else max_iterations
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
        self._search.put(resolve=int(ask is not None), unchecked=0)
        count = self._kernels.connect(self._search.address)
        rows = self._rows(0)[:count].copy()
        if count == 0 or ask is None:
            return rows if count else None
        open_ = np.flatnonzero(self._trees[0].states[:count] == tree_layout.OPEN)
        return rows if len(open_) == 0 or ask(rows[open_ - 1], rows[open_]).all() else None

    @property
    def trees(self) -> list[TreeTable]:
        """The trees from the starts and from the goals."""
        return self._trees

    @property
    def sizes(self) -> tuple[int, int]:
        """Vertices of the trees from the starts and from the goals."""
        first, second = (tree.size for tree in self._trees)
        return first, second

    def statistics(self) -> dict[str, int | float]:
        """Counts of the last search."""
        return {
            "iterations": self._search.iterations,
            "vertices": sum(self.sizes),
            "motions": self._search.checked,
            "questions": self._questions,
            "rejected": self._rejected,
        }

    def intact(self) -> bool:
        """Whether no kernel has written beyond the memory of the search."""
        return all(own.intact() for own in (self._search, *self._trees))

    def _settled(self, ask: MotionsFree | None) -> Matrix | None:
        """The path, once the world has answered for its open motions; None where one of them is not free."""
        branches = [self._branch(0, self._search.start_meeting), self._branch(1, self._search.goal_meeting)]
        for side, branch in enumerate(branches):
            tree = self._trees[side]
            states = tree.states
            parents = tree.parents
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
        parents = self._trees[side].parents
        branch = [vertex]
        while (vertex := int(parents[vertex])) >= 0:
            branch.append(vertex)
        return branch

    def _rows(self, side: int) -> Matrix:
        rows: Matrix = self._trees[side].rows.reshape(-1, self._dof)
        return rows

    def _set_roots(self, side: int, rows: Matrix) -> None:
        while len(rows) + self._room >= self._trees[0].capacity:
            for tree in self._trees:
                grow(tree)
        self._search.put(**{("start_rows", "goal_rows")[side]: aligned(np.asarray(rows, dtype=np.float64))})
