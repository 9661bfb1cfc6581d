"""BiCRDT: two trees that move one joint at a time and meet exactly. Source: [1, ch. 6.3, algorithm 11]."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.kernels.search.crdt.rules import KERNELS, CrdtRules
from rrtik_ompl.kernels.search.crdt.search import CrdtSearch
from rrtik_ompl.ompl_bridge import MotionChecker, SearchResult, Stop
from rrtik_ompl.world.motion_queries import has_kernels
from rrtik_planners.crdt_tree import CrdtStream, CrdtTree, Outcome
from rrtik_planners.one_joint_planner import OneJointPlanner


class BiCRDT(OneJointPlanner):
    """Grows one tree from the start and one from the goal in turn, without step length, goal bias or goal tolerance.

    Moves of one axis end exactly on their target, so the trees meet exactly and every edge of the path moves one joint.

    In a world with kernels the whole search runs there and finds the same path as the search in Python.
    """

    ompl_name: ClassVar[str] = "BiCRDT"
    supports_iteration_limit: ClassVar[bool] = True
    proof_iterations: ClassVar[int] = 200

    def between(self, starts: Matrix, goals: Matrix, checker: MotionChecker, ptc: Stop) -> SearchResult:
        """See :meth:`OneJointPlanner.between`."""
        rules = self.options.growth(*self.bounds(), starts[0])
        seed = int(self.rng.integers(2**63))
        limit = self.options.max_iterations
        path = _common_row(starts, goals)

        trees: CrdtSearch | TwoTreeSearch
        if has_kernels(self._world, KERNELS, within=np.vstack([starts, goals, rules.lower, rules.upper])):
            trees = CrdtSearch(self._world, rules, seed, limit, starts, goals)
        else:
            trees = TwoTreeSearch(rules, seed, limit, starts, goals, checker)
        while path is None and trees.advance(ptc):
            met = _join(*trees.meeting())
            path = met if self.options.accepts(met) else None

        checker.checked_motions += trees.motions
        edges = trees.vertices - len(starts) - len(goals)
        graph = self.grown(lambda: trees.grown(0), lambda: trees.grown(1))
        counts = {"iterations": trees.iterations, "vertices": trees.vertices, "edges": edges}
        return SearchResult(path, counts, graph=graph)


class TwoTreeSearch:
    """The search in Python, for any checker; each step is that of `rrtik_ompl.kernels.search.crdt.search.CrdtSearch`.

    Attributes:
        iterations: Number of samples drawn so far.
        motions: Number of edges that were checked but not counted by the checker: 0.
    """

    motions = 0

    def __init__(
        self, rules: CrdtRules, seed: int, limit: int | None, starts: Matrix, goals: Matrix, checker: MotionChecker
    ) -> None:
        self._rules = rules
        self._limit = limit
        self._checker = checker
        self._stream = CrdtStream(seed)
        self._trees = CrdtTree(starts, rules), CrdtTree(goals, rules)
        self._growing = 0
        self._met = (0, 0)
        self.iterations = 0

    @property
    def vertices(self) -> int:
        """Number of vertices of both trees."""
        return sum(tree.size for tree in self._trees)

    def advance(self, stop: Stop) -> bool:
        """Search for the next solution; return False if ``stop()`` or the limit of iterations came first."""
        while self.iterations != self._limit and not stop():
            self.iterations += 1
            if self._step():
                return True
        return False

    def meeting(self) -> tuple[Matrix, Matrix]:
        """Return the branch of each tree from its root to the vertex at which the trees met, shapes (k, n)."""
        return self._trees[0].branch(self._met[0]), self._trees[1].branch(self._met[1])

    def grown(self, number: int) -> tuple[Matrix, NDArray[np.int64]]:
        """Return the vertices of a tree, shape (size, n), and their parents, shape (size,)."""
        return self._trees[number].grown()

    def _step(self) -> bool:
        """Do one iteration and return whether the trees have met.

        One tree is extended towards a sample, then the other one towards the new vertex; they swap roles each time.
        """
        number = self._growing
        self._growing = 1 - self._growing
        growing = self._trees[number]
        other = self._trees[1 - number]

        target = self._stream.uniform(self._rules.lower, self._rules.upper)
        grown = growing.extend(target, self._checker, self._stream, exactly=False)
        if grown.outcome is Outcome.TRAPPED:
            return False

        meeting = other.extend(growing.vertex(grown.vertex), self._checker, self._stream)
        ends = grown.vertex, meeting.vertex
        self._met = ends if number == 0 else ends[::-1]
        return meeting.outcome is Outcome.REACHED


def _join(one: Matrix, two: Matrix) -> Matrix:
    """Join two branches, shapes (k, n), that end at the same point: the first one, then the second one reversed."""
    return np.vstack([one, two[-2::-1]]) if len(two) > 1 else one


def _common_row(starts: Matrix, goals: Matrix) -> Matrix | None:
    """Return a path of a single row, shape (1, n), if a start is itself a goal; else None."""
    for start in starts:
        if (goals == start).all(axis=1).any():
            return np.array([start])
    return None
