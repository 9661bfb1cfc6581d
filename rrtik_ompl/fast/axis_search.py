"""Searches with trees whose every edge moves one coordinate, run in kernels: their memory, and the talk with the world.

The kernels decide what they can; the world is asked about the rest, all edges of an extension at once.
"""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Matrix
from rrtik_ompl.fast import COLLIDING, FREE, UNDECIDED
from rrtik_ompl.fast import axis_kernels as kernel
from rrtik_ompl.fast.axis_rules import AxisRules
from rrtik_ompl.fast.compiled import WIDTH
from rrtik_ompl.fast.robot_tables import Table, table
from rrtik_ompl.robot import LIMIT_TOLERANCE

FIRST_CAPACITY = 256
FIRST_BUDGET = 64  # iterations
LEAST_PAUSE, MOST_PAUSE = 0.5e-3, 2e-3  # [s] between two looks at the clock, if iterations are not longer
NO_LIMIT = 2**62


class AxisSearch:
    """A search in progress. It stops at each solution and can be told to go on.

    Attributes:
        trees: The trees' tables.

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
        rules: AxisRules,
        seed: int,
        limit: int | None,
        *roots: Matrix,
        goals: Matrix | None = None,
        tolerance: float = 0.0,
    ) -> None:
        self._world = world
        self._resume = kernel.resume_pair if goals is None else kernel.resume_single
        self.trees = [_tree(rows) for rows in roots]
        dof = len(rules.lower)
        single = {} if goals is None else {kernel.GOALS: goals, kernel.GOAL_COUNT: len(goals)}
        fields = _zeros() | _motions(world, tolerance) | _extension(dof) | single
        fields |= {
            kernel.LOWER: rules.lower,
            kernel.UPPER: rules.upper,
            kernel.SCALE: rules.scale,
            kernel.SMALLEST_MOVE: rules.smallest_move,
            kernel.AXES: rules.axes,
            kernel.AXIS_COUNT: len(rules.axes),
            kernel.RANDOM: seed,
            kernel.ITERATION_LIMIT: NO_LIMIT if limit is None else limit,
            kernel.NEXT: kernel.BEGIN if goals is None else kernel.CHOOSE_GOAL,
            kernel.VERTEX_END: 0 if goals is None else len(roots[0]),
            kernel.TREES: np.array([t.address for t in self.trees]),
        }
        self._search = table(fields)
        self._edges = [self._search[place].reshape(dof + 1, dof) for place in (kernel.STARTS, kernel.ENDS)]
        self._budget = FIRST_BUDGET

    @property
    def iterations(self) -> int:
        """Samples drawn so far."""
        return self._field(kernel.ITERATIONS)

    @property
    def vertices(self) -> int:
        """Vertices of all trees."""
        return sum(int(t.header[kernel.SIZE]) for t in self.trees)

    @property
    def motions(self) -> int:
        """Edges that were asked about so far."""
        return self._field(kernel.MOTIONS)

    def advance(self, stop: Callable[[], Any]) -> bool:
        """Go on to the next solution; False if ``stop()`` or the limit of iterations came first."""
        while not stop():
            begin = perf_counter()
            status = self._run()
            if status != kernel.RUNNING:
                return status == kernel.SOLVED
            self._pace(perf_counter() - begin)
        return False

    def meeting(self) -> tuple[Matrix, Matrix]:
        """The way from the root of each of two trees to the vertex at which they met, shapes (k, n)."""
        other = self._field(kernel.GROWING)  # the turns have changed since
        ends = {1 - other: kernel.MET, other: kernel.LAST}
        return self.branch(0, self._field(ends[0])), self.branch(1, self._field(ends[1]))

    def ending(self) -> Matrix:
        """The way from the root of a single tree to the goal that it reached, shape (k, n)."""
        return self.branch(0, self._field(kernel.LAST))

    def coordinates(self, number: int) -> Matrix:
        """The vertices of a tree, shape (size, n). A view."""
        tree = self.trees[number]
        runs: Matrix = tree[kernel.COORDINATES].reshape(-1, int(tree.header[kernel.CAPACITY]))
        return runs[:, : int(tree.header[kernel.SIZE])].T

    def branch(self, number: int, vertex: int) -> Matrix:
        """The way from the root of a tree to a vertex, shape (k, n)."""
        parents, way = self.trees[number][kernel.PARENTS], [vertex]
        while parents[way[-1]] != kernel.ROOT:
            way.append(int(parents[way[-1]]))
        return np.ascontiguousarray(self.coordinates(number)[way[::-1]])

    def _run(self) -> int:
        """Let the kernel work until its budget is used up, with all the answers and the room that it asks for."""
        before = self.iterations
        while True:
            status = int(self._resume(self._search.address, self._budget - (self.iterations - before)))
            if status == kernel.ASKING:
                self._answer()
            elif status == kernel.FULL:
                self._grow()
            else:
                return status

    def _answer(self) -> None:
        """Have the world settle the edges that the kernels left undecided."""
        verdicts = self._search[kernel.VERDICTS][: self._field(kernel.EDGE_COUNT)]
        asked = np.flatnonzero(verdicts == UNDECIDED)
        free = self._world.motion_valid_batch(self._edges[0][asked], self._edges[1][asked])
        verdicts[asked] = np.where(free, FREE, COLLIDING)

    def _grow(self) -> None:
        """Twice the room for each tree."""
        addresses = self._search[kernel.TREES]
        for number, tree in enumerate(self.trees):
            parents = tree[kernel.PARENTS][: int(tree.header[kernel.SIZE])]
            grown = _tree(self.coordinates(number), parents, 2 * int(tree.header[kernel.CAPACITY]))
            self.trees[number], addresses[number] = grown, grown.address

    def _pace(self, seconds: float) -> None:
        """More or fewer iterations next time, so that the clock is looked at about every millisecond."""
        if seconds < LEAST_PAUSE:
            self._budget *= 2
        elif seconds > MOST_PAUSE:
            self._budget = max(1, self._budget // 2)

    def _field(self, place: int) -> int:
        return int(self._search.header[place])


def _tree(rows: Matrix, parents: NDArray[np.int32] | None = None, capacity: int = FIRST_CAPACITY) -> Table:
    """A tree of given vertices, roots all of them unless ``parents`` are given, with room for as many again."""
    while capacity < len(rows) + max(FIRST_CAPACITY, rows.shape[1]):
        capacity *= 2
    coordinates = np.zeros((rows.shape[1], -(-capacity // WIDTH) * WIDTH))
    coordinates[:, : len(rows)] = rows.T
    above = np.full(coordinates.shape[1], kernel.ROOT, dtype=np.int32)
    if parents is not None:
        above[: len(parents)] = parents
    return table(
        {
            kernel.SIZE: len(rows),
            kernel.CAPACITY: coordinates.shape[1],
            kernel.COORDINATES: coordinates,
            kernel.PARENTS: above,
        }
    )


def _zeros() -> dict[int, int | NDArray[Any]]:
    return dict.fromkeys(range(kernel.FIELDS), 0)


def _motions(world: Any, tolerance: float) -> dict[int, int | NDArray[Any]]:
    """What decides about a motion."""
    robot = world.robot
    return {
        kernel.WORLD: world.fast.address,
        kernel.DOF: robot.dof,
        kernel.GAIN: robot.chain.gain,
        kernel.OFFSET: robot.chain.offset,
        kernel.WEIGHTS: world.weights,
        kernel.LEAST: robot.lower - LIMIT_TOLERANCE,
        kernel.MOST: robot.upper + LIMIT_TOLERANCE,
        kernel.NUMBERS: np.array([world.motion_resolution, tolerance * tolerance]),
        kernel.VALUES: np.zeros((2, len(robot.chain.parent))),
        kernel.ASKS: int(getattr(world, "accuracy", "exact") == "exact"),
    }


def _extension(dof: int) -> dict[int, int | NDArray[Any]]:
    """Room for one extension."""
    return {
        kernel.TARGET: np.zeros(dof),
        kernel.ORDER: np.zeros(dof, dtype=np.int32),
        kernel.CURRENT: np.zeros(dof),
        kernel.STARTS: np.zeros((dof + 1, dof)),
        kernel.ENDS: np.zeros((dof + 1, dof)),
        kernel.VERDICTS: np.zeros(dof + 1, dtype=np.int32),
        kernel.DISTANCES: np.zeros((2, WIDTH)),
    }
