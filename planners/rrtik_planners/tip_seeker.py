"""Base of the two forms of IKURT, which need only a goal of the tip and report how near the tip came to it."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.units import closest_configuration
from rrtik_ompl.ik.ikurt.metric import ConfigurationMetric, TipMetric
from rrtik_ompl.ik.ikurt.tree import IkurtTree
from rrtik_ompl.ik.targets import targets
from rrtik_ompl.model.goal import Goal, Target, TipGoal
from rrtik_ompl.ompl_bridge import MotionChecker, MotionQueries, SafePlanner, SearchResult
from rrtik_ompl.ompl_bridge.bindings import ob
from rrtik_ompl.world.world import World

DRAWS = 16  # number of targets drawn from a goal that leaves freedom
ARM_DIAGONAL = 14.0  # diagonal of the box of limits of an arm with seven joints [rad]
LEAST_DIFFERENCE = 1e-12  # least difference to the goal with which OMPL takes a path for approximate


class TipSeeker(SafePlanner):
    """Base class: holds the goal of the tip; without one the configurations of the problem definition are the goals."""

    finds_goals: ClassVar[bool] = True
    path_statistics: ClassVar[tuple[str, ...]] = ("position_error", "orientation_error")

    def __init__(
        self, si: ob.SpaceInformation, name: str, *, world: MotionQueries | None, seed: int | None, goal: Goal | None
    ) -> None:
        """Make a planner with a name in OMPL's reports; for the other options see `rrtik_planners.ikurt.IKURT`."""
        super().__init__(si, name, world=world, seed=seed)
        self.goal = goal if isinstance(goal, TipGoal) else None
        if self.goal is not None and not isinstance(world, World):
            raise InputError(f"goal: {name} needs world= to know the arm whose tip it is; or give OMPL configurations")

    def needs_goals(self) -> bool:
        """See :meth:`rrtik_ompl.ompl_bridge.SafePlanner.needs_goals`."""
        return self.goal is None

    def targets(self) -> list[Target]:
        """Return targets without freedom: the goal itself, or draws from a region; none without a goal of the tip."""
        return [] if self.goal is None else targets(self.goal, DRAWS, self.rng)

    def radian(self) -> float:
        """Return the length that counts as a radian: 1 in the space of an arm, otherwise a share of the diagonal."""
        if self.turning() is not None:
            return 1.0
        lower, upper = self.bounds()
        return float(np.linalg.norm(upper - lower)) / ARM_DIAGONAL

    def result(
        self,
        metric: TipMetric | ConfigurationMetric,
        tree: IkurtTree,
        found: Matrix | None,
        counts: dict[str, int],
        checker: MotionChecker,
    ) -> SearchResult:
        """Make the result: the path found, or else the path to the vertex nearest to the goal as an approximate one.

        Args:
            metric: Distance from the goal; counts its evaluations.
            tree: The tree from the start.
            found: The path found, shape (k, n), or None.
            counts: Statistics of the search.
            checker: Checks the last motion to a goal configuration.
        """
        nearest = int(tree.distance.argmin())
        path = tree.branch(nearest) if found is None else found
        exact = found is not None

        tip: dict[str, float] = {}
        if isinstance(metric, TipMetric):
            away, angle = metric.errors(path[-1])
            tip = {"position_error": float(away), "orientation_error": float(angle)}
        elif exact:
            path, exact = _ended(path, metric.goals, checker)

        difference = 0.0 if exact else max(float(tree.distance[nearest]), LEAST_DIFFERENCE)
        return SearchResult(
            path, {**counts, "metric_evaluations": metric.evaluations, **tip}, difference, graph=self.grown(tree.grown)
        )


def closest(metric: TipMetric, q: Vector) -> str:
    """Return a line that says how near the closest configuration, shape (n,), came to the goal."""
    away, angle = metric.errors(q)
    return closest_configuration(away, angle if any(t.oriented for t in metric.targets) else 0.0)


def _ended(path: Matrix, goals: Matrix, checker: MotionChecker) -> tuple[Matrix, bool]:
    """Extend a path to the nearest goal configuration, and return it with whether its last motion is free."""
    goal = goals[np.linalg.norm(goals - path[-1], axis=1).argmin()]
    if (goal == path[-1]).all():
        return path, True
    return np.vstack([path, goal]), checker.motion_valid(path[-1], goal)
