"""C-RDT: a rapidly exploring tree that moves one joint at a time. Source: [1, ch. 6.3, algorithms 9 and 10]."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.kernels.search.crdt.rules import KERNELS, CrdtRules
from rrtik_ompl.kernels.search.crdt.search import CrdtSearch
from rrtik_ompl.ompl_bridge import MotionChecker, MotionQueries, SearchResult, Stop
from rrtik_ompl.ompl_bridge.bindings import ob
from rrtik_ompl.planning.moves.rules import Joints, PerJoint
from rrtik_ompl.world.motion_queries import has_kernels
from rrtik_planners.crdt_tree import CrdtStream, CrdtTree, Outcome
from rrtik_planners.one_joint_planner import OneJointPlanner

GOAL_TOLERANCE_SHARE = 0.2  # default goal tolerance as a share of the diagonal of the space


class CRDT(OneJointPlanner):
    """Grows a single tree from the start, without step length or goal bias.

    The basic algorithm ends when a vertex is close enough to the goal. Here every vertex that is close enough tries to
    reach the goal exactly, one axis at a time, so that an exact solution ends in the goal itself. If time runs out
    first, the path to the vertex nearest to a goal is reported as an approximate solution.

    With a small goal tolerance an arm of six joints needs very many iterations, since nothing draws the tree towards
    the goal; the default is so large that it is met soon. The comparison with RRT in [1, ch. 6.3] used the step length
    of the RRT as tolerance.

    In a world with kernels the whole search runs there and finds the same path as the search in Python.
    """

    ompl_name: ClassVar[str] = "CRDT"
    supports_iteration_limit: ClassVar[bool] = True

    def __init__(
        self,
        si: ob.SpaceInformation,
        *,
        world: MotionQueries | None = None,
        seed: int | None = None,
        goal_tolerance: float | None = None,
        scale_by_range: bool = False,
        max_iterations: int | None = None,
        joint_costs: PerJoint | None = None,
        frozen_joints: Joints = (),
        smallest_move: PerJoint = 0.0,
    ) -> None:
        """Make a planner with an additional option to :class:`~rrtik_planners.one_joint_planner.OneJointPlanner`.

        Args:
            goal_tolerance: Euclidean distance to a goal up to which a vertex tries to reach it [unit of the space];
                a fifth of the diagonal of the space if None.

        Raises:
            InputError: If an option is out of range or the space is of another kind.
        """
        super().__init__(
            si,
            world=world,
            seed=seed,
            scale_by_range=scale_by_range,
            max_iterations=max_iterations,
            joint_costs=joint_costs,
            frozen_joints=frozen_joints,
            smallest_move=smallest_move,
        )
        if goal_tolerance is not None and not goal_tolerance > 0.0:
            raise InputError(f"goal_tolerance: expected a number greater than 0, got {goal_tolerance!r}")
        self.goal_tolerance = goal_tolerance

    def between(self, starts: Matrix, goals: Matrix, checker: MotionChecker, ptc: Stop) -> SearchResult:
        """See :meth:`OneJointPlanner.between`."""
        lower, upper = self.bounds()
        tolerance = self.goal_tolerance or GOAL_TOLERANCE_SHARE * float(np.linalg.norm(upper - lower))
        rules = self.options.growth(lower, upper, starts[0])
        seed = int(self.rng.integers(2**63))
        limit = self.options.max_iterations
        path = None

        tree: CrdtSearch | OneTreeSearch
        if has_kernels(self._world, KERNELS, within=np.vstack([starts, goals, rules.lower, rules.upper])):
            tree = CrdtSearch(self._world, rules, seed, limit, starts, goals=goals, tolerance=tolerance)
        else:
            tree = OneTreeSearch(rules, seed, limit, starts, goals, tolerance, checker)
        while path is None and tree.advance(ptc):
            found = tree.ending()
            path = found if self.options.accepts(found) else None

        checker.checked_motions += tree.motions
        statistics = {"iterations": tree.iterations, "vertices": tree.vertices, "edges": tree.vertices - len(starts)}
        graph = self.grown(lambda: tree.grown(0))
        if path is not None:
            return SearchResult(path, statistics, graph=graph)
        nearest, distance = _nearest_to_goal(tree.tree(0), goals)
        return SearchResult(tree.branch(0, nearest), statistics, distance, graph=graph)


class OneTreeSearch:
    """The search in Python, for any checker; each step is that of `rrtik_ompl.kernels.search.crdt.search.CrdtSearch`.

    Attributes:
        iterations: Number of samples drawn so far.
        motions: Number of edges that were checked but not counted by the checker: 0.
    """

    motions = 0

    def __init__(
        self,
        rules: CrdtRules,
        seed: int,
        limit: int | None,
        starts: Matrix,
        goals: Matrix,
        tolerance: float,
        checker: MotionChecker,
    ) -> None:
        self._rules = rules
        self._limit = limit
        self._checker = checker
        self._goals = goals
        self._tolerance = tolerance
        self._stream = CrdtStream(seed)
        self._tree = CrdtTree(starts, rules)
        self._waiting = self._near_goals(0)
        self._ending = 0
        self.iterations = 0

    @property
    def vertices(self) -> int:
        """Number of vertices of the tree."""
        return self._tree.size

    def advance(self, stop: Stop) -> bool:
        """Search for the next solution; return False if ``stop()`` or the limit of iterations came first."""
        while not stop():
            while self._waiting:
                vertex, goal = self._waiting.pop(0)
                extension = self._tree.extend_from(vertex, self._goals[goal], self._checker, self._stream)
                if extension.outcome is Outcome.REACHED:
                    self._ending = extension.vertex
                    return True

            if self.iterations == self._limit:
                return False
            self.iterations += 1
            known = self._tree.size
            target = self._stream.uniform(self._rules.lower, self._rules.upper)
            self._tree.extend(target, self._checker, self._stream, exactly=False)
            self._waiting = self._near_goals(known)
        return False

    def ending(self) -> Matrix:
        """Return the path from the root to the goal that was reached, shape (k, n)."""
        return self._tree.branch(self._ending)

    def branch(self, number: int, vertex: int) -> Matrix:
        """Return the path from the root to a vertex, shape (k, n); ``number`` is that of the only tree, 0."""
        return self._tree.branch(vertex)

    def tree(self, number: int) -> Matrix:
        """Return the vertices of the only tree, shape (size, n)."""
        return np.array([self._tree.vertex(i) for i in range(self._tree.size)])

    def grown(self, number: int) -> tuple[Matrix, NDArray[np.int64]]:
        """Return the vertices of the only tree, shape (size, n), and their parents, shape (size,)."""
        return self._tree.grown()

    def _near_goals(self, known: int) -> list[tuple[int, int]]:
        """Return pairs of a vertex, from number ``known`` on, and a goal within the tolerance around it."""
        found = []
        for vertex in range(known, self._tree.size):
            distances = np.linalg.norm(self._goals - self._tree.vertex(vertex), axis=1)
            found += [(vertex, int(goal)) for goal in np.flatnonzero(distances <= self._tolerance)]
        return found


def _nearest_to_goal(vertices: Matrix, goals: Matrix) -> tuple[int, float]:
    """Return the vertex nearest to any of the goals, and its distance from that goal."""
    distances = np.array([np.linalg.norm(vertices - goal, axis=1) for goal in goals])
    best = int(distances.min(axis=0).argmin())
    return best, float(distances[:, best].min())
