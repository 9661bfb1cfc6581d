"""C-RDT: a rapidly exploring tree that moves one joint at a time. Source: the C-RDT paper, algorithms 9 and 10."""

from __future__ import annotations

from typing import Any

import numpy as np

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.errors import InputError
from rrtik_ompl.ompl_bridge import MotionChecker, SafePlanner, SearchResult, WorldLike
from rrtik_planners.axis_tree import AxisTree, Outcome

GOAL_TOLERANCE_SHARE = 0.2  # default goal tolerance as a share of the diagonal of the space


class CRDT(SafePlanner):
    """Single tree from the start; no step length, no goal bias.

    The basic algorithm ends when a vertex is close enough to the goal. Here every vertex that is close enough tries to
    reach the goal exactly, one axis at a time, so that an exact solution ends in the goal itself. If time runs out
    first, the way to the vertex nearest to a goal is reported as an approximate solution.

    A small goal tolerance needs very many iterations for an arm of six joints, since nothing draws the tree towards the
    goal; the default is meant to be met soon. The paper's comparison with RRT used the step length of the RRT.
    """

    def __init__(
        self,
        si: Any,
        *,
        world: WorldLike | None = None,
        seed: int | None = None,
        goal_tolerance: float | None = None,
        scale_by_range: bool = False,
        max_iterations: int | None = None,
    ) -> None:
        """Make a planner.

        Args:
            si: ``ompl.base.SpaceInformation`` of a RealVectorStateSpace.
            world: Asked instead of ``si`` whether configurations and motions are free, if given.
            seed: At least 0; drawn from OMPL's if None.
            goal_tolerance: Euclidean distance to a goal below which a vertex tries to reach it [unit of the space];
                a fifth of the diagonal of the space if None.
            scale_by_range: Divide each coordinate by its range in the metric of the nearest neighbour.
            max_iterations: The K of the paper; without limit if None.

        Raises:
            InputError: If an option is out of range or the space is of another kind.
        """
        super().__init__(si, "CRDT", world=world, seed=seed)
        if goal_tolerance is not None and not goal_tolerance > 0.0:
            raise InputError(f"goal_tolerance: expected a number greater than 0, got {goal_tolerance!r}")
        self.goal_tolerance = goal_tolerance
        self.scale_by_range = scale_by_range
        self.max_iterations = iteration_limit(max_iterations)

    def search(self, starts: Matrix, goals: Matrix, checker: MotionChecker, ptc: Any) -> SearchResult:
        """See :meth:`rrtik_ompl.ompl_bridge.SafePlanner.search`."""
        lower, upper = self.bounds()
        tolerance = self.goal_tolerance or GOAL_TOLERANCE_SHARE * float(np.linalg.norm(upper - lower))
        tree = AxisTree(starts, metric_scale(lower, upper, self.scale_by_range))
        ending, iterations = self._try_goals(tree, 0, goals, tolerance, checker), 0
        while ending is None and not ptc() and iterations < self.max_iterations:
            iterations += 1
            known = tree.size
            tree.extend(self.rng.uniform(lower, upper), checker, self.rng)
            ending = self._try_goals(tree, known, goals, tolerance, checker)
        statistics = {"iterations": iterations, "vertices": tree.size}
        if ending is not None:
            return SearchResult(tree.branch(ending), statistics)
        nearest, distance = _nearest_to_goal(tree, goals)
        return SearchResult(tree.branch(nearest), statistics, distance)

    def _try_goals(
        self, tree: AxisTree, known: int, goals: Matrix, tolerance: float, checker: MotionChecker
    ) -> int | None:
        """Try to reach a goal from the vertices added since there were ``known``; returns the vertex at the goal."""
        for vertex in range(known, tree.size):
            distances = np.linalg.norm(goals - tree.vertex(vertex), axis=1)
            for k in np.flatnonzero(distances <= tolerance):
                extension = tree.extend_from(vertex, goals[k], checker, self.rng)
                if extension.outcome is Outcome.REACHED:
                    return extension.vertex
        return None


def metric_scale(lower: Vector, upper: Vector, by_range: bool) -> Vector:
    """Weights of the coordinates in the metric of the nearest neighbour, shape (n,)."""
    return 1.0 / (upper - lower) if by_range else np.ones(len(lower))


def iteration_limit(limit: int | None) -> float:
    """The largest number of iterations, infinity if None.

    Raises:
        InputError: If the limit is no number of at least 1.
    """
    if limit is not None and (isinstance(limit, bool) or not isinstance(limit, int | float) or not limit >= 1):
        raise InputError(f"max_iterations: expected at least 1, got {limit!r}")
    return np.inf if limit is None else limit


def _nearest_to_goal(tree: AxisTree, goals: Matrix) -> tuple[int, float]:
    """The vertex nearest to any of the goals and its distance."""
    vertices = [tree.nearest(goal) for goal in goals]
    distances = [float(np.linalg.norm(tree.vertex(v) - goal)) for v, goal in zip(vertices, goals, strict=True)]
    best = int(np.argmin(distances))
    return vertices[best], distances[best]
