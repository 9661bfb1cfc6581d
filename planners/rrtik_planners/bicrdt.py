"""BiCRDT: two trees that move one joint at a time and meet exactly. Source: the C-RDT paper, algorithm 11."""

from __future__ import annotations

from typing import Any

import numpy as np

from rrtik_ompl.arrays import Matrix
from rrtik_ompl.ompl_bridge import MotionChecker, SafePlanner, SearchResult, WorldLike
from rrtik_planners.axis_tree import AxisTree, Outcome
from rrtik_planners.crdt import iteration_limit, metric_scale


class BiCRDT(SafePlanner):
    """One tree from the start and one from the goal, grown in turn; no step length, no bias, no goal tolerance.

    Axis moves end exactly on their target, so the trees meet exactly and every edge of the path moves one joint.
    """

    def __init__(
        self,
        si: Any,
        *,
        world: WorldLike | None = None,
        seed: int | None = None,
        scale_by_range: bool = False,
        max_iterations: int | None = None,
    ) -> None:
        """Make a planner.

        Args:
            si: ``ompl.base.SpaceInformation`` of a RealVectorStateSpace.
            world: Asked instead of ``si`` whether configurations and motions are free, if given.
            seed: At least 0; drawn from OMPL's if None.
            scale_by_range: Divide each coordinate by its range in the metric of the nearest neighbour.
            max_iterations: The K of the paper; without limit if None.

        Raises:
            InputError: If an option is out of range or the space is of another kind.
        """
        super().__init__(si, "BiCRDT", world=world, seed=seed)
        self.scale_by_range = scale_by_range
        self.max_iterations = iteration_limit(max_iterations)

    def search(self, starts: Matrix, goals: Matrix, checker: MotionChecker, ptc: Any) -> SearchResult:
        """See :meth:`rrtik_ompl.ompl_bridge.SafePlanner.search`."""
        lower, upper = self.bounds()
        scale = metric_scale(lower, upper, self.scale_by_range)
        from_start, from_goal = AxisTree(starts, scale), AxisTree(goals, scale)
        growing, other = from_start, from_goal
        path, iterations = _common_row(starts, goals), 0
        while path is None and not ptc() and iterations < self.max_iterations:
            iterations += 1
            extension = growing.extend(self.rng.uniform(lower, upper), checker, self.rng)
            if extension.outcome is not Outcome.TRAPPED:
                meeting = other.extend(growing.vertex(extension.vertex), checker, self.rng)
                if meeting.outcome is Outcome.REACHED:
                    path = _join(growing.branch(extension.vertex), other.branch(meeting.vertex))
                    path = path if growing is from_start else path[::-1]
            growing, other = other, growing
        return SearchResult(path, {"iterations": iterations, "vertices": from_start.size + from_goal.size})


def _join(one: Matrix, two: Matrix) -> Matrix:
    """The branch ``one`` from its root to the meeting point, then ``two`` from there to its own root."""
    return np.vstack([one, two[-2::-1]]) if len(two) > 1 else one


def _common_row(starts: Matrix, goals: Matrix) -> Matrix | None:
    """The path of a single row if a start is itself a goal."""
    for start in starts:
        if (goals == start).all(axis=1).any():
            return np.array([start])
    return None
