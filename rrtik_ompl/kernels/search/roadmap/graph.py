"""Roadmaps on arrays: the object that keeps the memory of the kernels and answers their questions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Matrix, Vector, finite_array
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.kernels.search.motions.motion_table import FastMotions, MotionsFree
from rrtik_ompl.kernels.search.roadmap import layout
from rrtik_ompl.kernels.search.roadmap.layout import RoadmapTable
from rrtik_ompl.kernels.search.tree_layout import TreeTable
from rrtik_ompl.kernels.search.tree_memory import grow, sampled, tree_table
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.kernels.simd.processor import WIDTH
from rrtik_ompl.kernels.tables.memory import aligned

FIRST_VERTICES = 64 * WIDTH
SAMPLES_IN_CALL = 64  # samples drawn, about a millisecond
EDGES_IN_CALL = 128
HALVES_IN_CALL = 256  # of edges that a query follows
_BY_VERTEX = {"heads": np.int32, "costs": np.float64, "ahead": np.float64, "came": np.int32}
_BY_HALF = {"to": np.int32, "next": np.int32, "heap": np.int32, "keys": np.float64}
_BY_EDGE = {"lengths": np.float64, "states": np.int32}


class KernelGraph:
    """A roadmap whose searches run in kernels; for one thread at a time.

    Args:
        motions: How motions are checked in a world.
        lower, upper: The box of configurations, shape (n,), finite.
        near: With how many of the vertices near it a new one is joined, at least 1.
        seed: Of the samples.
        ask: Decides motions (A, B), shapes (m, n), that the kernels leave undecided, shape (m,); None: they count as
            colliding.

    Raises:
        InputError: If there are no kernels or shapes do not fit.
    """

    def __init__(
        self,
        motions: FastMotions,
        lower: ArrayLike,
        upper: ArrayLike,
        *,
        near: int,
        seed: int,
        ask: MotionsFree | None,
    ) -> None:
        kernels = library(layout.KERNELS)
        if kernels is None:
            raise InputError("roadmap in kernels: there are none; install numba")
        self._kernels = kernels
        self._motions = motions
        self._ask = ask
        self._near = near
        self._dof = motions.dof
        motions.fast.pinned = True
        box = finite_array(lower, (self._dof,), "lower bounds"), finite_array(upper, (self._dof,), "upper bounds")
        motions.require_covered(*box)
        joints = 0 if motions.identity else motions.joints
        self._vertices = tree_table(self._dof, joints, FIRST_VERTICES)
        halves = 2 * near * FIRST_VERTICES
        self._table = roadmap_table(motions, self._vertices, box, near, halves, resolve=ask is not None)
        self._kernels.seed_samples(self._table.address, int(seed) & (2**63 - 1))
        self._ends = aligned(np.zeros(self._dof)).reshape(1, self._dof)

    @property
    def size(self) -> int:
        """Number of vertices."""
        return self._table.mapped

    @property
    def rows(self) -> Matrix:
        """The vertices, shape (size, n); a copy."""
        return self._rows()[: self.size].copy()

    @property
    def edges(self) -> NDArray[np.int32]:
        """Pairs of vertices, shape (m, 2)."""
        self._kernels.forget_query(self._table.address)
        return self._table.to[: self._table.halves].reshape(-1, 2)[:, ::-1].copy()

    @property
    def states(self) -> NDArray[np.int32]:
        """What is known of the edges, shape (m,): UNKNOWN, SURE, DOUBTFUL or BLOCKED."""
        self._kernels.forget_query(self._table.address)
        return self._table.states[: self._table.halves // 2].copy()

    def restore(self, rows: Matrix, edges: NDArray[np.int32], states: NDArray[np.int32]) -> None:
        """Fill an empty roadmap with what another one gave; for states None nothing is known of the edges.

        Raises:
            InputError: If it is not empty, numbers of vertices do not fit, or a vertex is not in the box.
        """
        if self.size or len(edges) != len(states) or (len(edges) and not 0 <= edges.min() <= edges.max() < len(rows)):
            raise InputError("roadmap: its edges do not fit its vertices")
        self._kernels.forget_query(self._table.address)
        make_room(self._table, len(rows), 2 * len(edges))
        outside = self._kernels.insert(self._table.address, self._place_of(rows), len(rows))
        if outside >= 0:
            raise InputError(f"roadmap: vertex {outside} is not in the box of configurations")
        pairs = aligned(np.ascontiguousarray(edges, dtype=np.int32))
        self._kernels.connect(self._table.address, pairs.ctypes.data, len(edges))
        self._table.states[: len(edges)] = states

    def grow(self, wanted: int, stop: Callable[[], object]) -> int:
        """Add free samples until there are ``wanted`` more, or it is time to stop; how many were added."""
        self._kernels.forget_query(self._table.address)
        added = 0
        while added < wanted and not stop():
            more = min(wanted - added, SAMPLES_IN_CALL)
            make_room(self._table, *self._enough(more))
            added += self._kernels.grow(self._table.address, more, SAMPLES_IN_CALL)
        return added

    def learn(self, path: Matrix) -> int:
        """Make the rows of a free path, shape (k, n), vertices; how many, up to the first one outside the box."""
        self._kernels.forget_query(self._table.address)
        halves = self._table.halves + 2 * (self._near + 1) * len(path)
        make_room(self._table, self.size + len(path), halves)
        return self._kernels.learn(self._table.address, self._place_of(path), len(path))

    def check(self, stop: Callable[[], object]) -> None:
        """Check all edges that nobody has looked at, until it is time to stop."""
        self._kernels.forget_query(self._table.address)
        edges = self._table.halves // 2
        for first in range(0, edges, EDGES_IN_CALL):
            if stop():
                return
            self._kernels.check_edges(self._table.address, first, min(EDGES_IN_CALL, edges - first))

    def doubt(self) -> None:
        """Forget what is known of the edges, since an obstacle has moved."""
        self._kernels.doubt(self._table.address)

    def route(self, starts: Matrix, goals: Matrix, stop: Callable[[], object]) -> Matrix | None:
        """The shortest path on the roadmap from a start to a goal, shape (k, n); None if there is none in time.

        Args:
            starts: Free configurations, shape (s, n).
            goals: Free configurations, shape (g, n).
            stop: True to give up.

        Raises:
            InputError: If a start or goal is not in the box.
        """
        counts = len(starts), len(goals)
        halves = 2 * (self._near + counts[0]) * sum(counts)
        make_room(self._table, self.size + sum(counts), self._table.halves + halves)
        address = self._table.address
        place = self._place_of(np.concatenate([starts, goals]))
        outside = self._kernels.pose(address, place, *counts)
        if outside >= 0:
            what = f"start {outside}" if outside < counts[0] else f"goal {outside - counts[0]}"
            raise InputError(f"roadmap: {what} is not in the box of configurations")
        status = self._kernels.begin(address)
        while status != layout.SOLVED:
            if status == layout.EXHAUSTED or stop():
                return None
            status = self._answered() if status == layout.ASKING else self._kernels.search_on(address, HALVES_IN_CALL)
        return self._path()

    def statistics(self) -> dict[str, int | float]:
        """Counts since the roadmap was made."""
        self._kernels.forget_query(self._table.address)
        edges = self._table.halves // 2
        checked = self._table.checked
        return {"vertices": self.size, "edges": edges, "motions": checked, "iterations": self._table.samples}

    def intact(self) -> bool:
        """Whether no kernel has written beyond the memory of the roadmap or what it works on."""
        return self._motions.intact() and self._table.intact() and self._vertices.intact()

    def _answered(self) -> int:
        """Decide what the kernels ask; the next status."""
        count = self._table.asked
        halves = self._table.questions[:count]
        to = self._table.to
        rows = self._rows()
        free = np.zeros(count, dtype=bool) if self._ask is None else self._ask(rows[to[halves ^ 1]], rows[to[halves]])
        mask = sum(1 << k for k in np.flatnonzero(free).tolist())
        return self._kernels.answer(self._table.address, mask - (1 << 64 if mask >> 63 else 0))

    def _path(self) -> Matrix:
        vertex = self._table.meeting
        to = self._table.to
        came = self._table.came
        found = [vertex]
        while (half := int(came[vertex])) >= 0:
            vertex = int(to[half ^ 1])
            found.append(vertex)
        return self._rows()[found[::-1]]

    def _rows(self) -> Matrix:
        count = self._vertices.size
        return self._vertices.rows[: count * self._dof].reshape(count, self._dof)

    def _enough(self, more: int) -> tuple[int, int]:
        """Vertices and halves that there have to be room for, to add some vertices; room is doubled."""
        halves = self._table.halves + 2 * self._near * more
        room = len(self._table.to)
        return self.size + more, halves if halves <= room else 2 * room

    def _place_of(self, rows: Matrix) -> int:
        """Where rows are in memory that kernels may read."""
        if rows.ndim != 2 or rows.shape[1] != self._dof:
            raise InputError(f"roadmap: expected configurations of shape (k, {self._dof}), got {rows.shape}")
        if len(rows) > len(self._ends):
            self._ends = aligned(np.zeros(2 * rows.size)).reshape(-1, self._dof)
        self._ends[: len(rows)] = rows
        return int(self._ends.ctypes.data)


def roadmap_table(
    motions: FastMotions, vertices: TreeTable, box: tuple[Vector, Vector], near: int, halves: int, *, resolve: bool
) -> RoadmapTable:
    """The table of an empty roadmap.

    Args:
        motions: How motions are checked.
        vertices: Memory for these, a tree.
        box: Lower and upper bounds, shapes (n,).
        near: With how many vertices a new one is joined.
        halves: How many halves of edges there is room for, an even number.
        resolve: Whether undecided motions are asked for.
    """
    return sampled(
        RoadmapTable,
        motions,
        box,
        vertices=vertices,
        resolve=int(resolve),
        near=near,
        near_vertices=np.zeros(near, dtype=np.int32),
        near_squares=np.zeros(near, dtype=np.float32),
        questions=np.zeros(layout.MAX_QUESTIONS, dtype=np.int32),
        **_arrays(vertices.capacity, halves),
    )


def make_room(roadmap: RoadmapTable, rows: int, halves: int) -> None:
    """Let there be room for so many vertices and halves; addresses of the tables stay."""
    while roadmap.vertices.capacity < rows:
        grow(roadmap.vertices)
    for name, larger in _arrays(roadmap.vertices.capacity, max(halves, len(roadmap.to))).items():
        kept = getattr(roadmap, name)
        if len(larger) > len(kept):
            roomy = aligned(larger)
            roomy[: len(kept)] = kept
            roadmap.put(**{name: roomy})


def _arrays(vertices: int, halves: int) -> dict[str, NDArray[Any]]:
    found: dict[str, NDArray[Any]] = {}
    for size, kinds in ((vertices, _BY_VERTEX), (halves, _BY_HALF), (halves // 2, _BY_EDGE)):
        found |= {name: np.zeros(size, dtype=kind) for name, kind in kinds.items()}
    return found
