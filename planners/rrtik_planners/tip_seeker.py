"""What the two forms of IKURT share: a goal of the tip is enough for them, and they say how near they came."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from ompl import base as ob

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.ik.ikurt.metric import ConfigurationMetric, TipMetric
from rrtik_ompl.ik.ikurt.tree import IkurtTree
from rrtik_ompl.ik.targets import targets
from rrtik_ompl.model.goal import Goal, Target, TipGoal
from rrtik_ompl.ompl_bridge import MotionChecker, MotionQueries, SafePlanner, SearchResult
from rrtik_ompl.world.world import World

DRAWS = 16  # targets of a goal that leaves freedom
ARM_DIAGONAL = 14.0  # [rad] of the limits of an arm with seven joints
LEAST_DIFFERENCE = 1e-12  # to the goal, of a path that OMPL is to take for approximate


class TipSeeker(SafePlanner):
    """Base class: knows the goal of the tip, or takes configurations of the problem definition for goals."""

    finds_goals: ClassVar[bool] = True
    path_statistics: ClassVar[tuple[str, ...]] = ("position_error", "orientation_error")

    def __init__(
        self, si: ob.SpaceInformation, name: str, *, world: MotionQueries | None, seed: int | None, goal: Goal | None
    ) -> None:
        """See :class:`rrtik_planners.ikurt.IKURT`."""
        super().__init__(si, name, world=world, seed=seed)
        self.goal = goal if isinstance(goal, TipGoal) else None
        if self.goal is not None and not isinstance(world, World):
            raise InputError(f"goal: {name} needs world= to know the arm whose tip it is; or give OMPL configurations")

    def needs_goals(self) -> bool:
        """See :meth:`rrtik_ompl.ompl_bridge.SafePlanner.needs_goals`."""
        return self.goal is None

    def targets(self) -> list[Target]:
        """The goal of the tip without freedom: itself, or draws from a region; none if the goals are configurations."""
        return [] if self.goal is None else targets(self.goal, DRAWS, self.rng)

    def radian(self) -> float:
        """What counts as a radian in this space: one where it is that of an arm, else a share of its diagonal."""
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
        """The path found, else that to the vertex nearest to the goal; with the error of the tip at its end."""
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


def misses(metric: TipMetric, q: Vector, what: str) -> str:
    """A line that says by how much a configuration misses the goal."""
    away, angle = metric.errors(q)
    turned = f" and {np.degrees(angle):.3g} deg" if any(t.oriented for t in metric.targets) else ""
    return f"{what} misses it by {away:.4g} m{turned}"


def _ended(path: Matrix, goals: Matrix, checker: MotionChecker) -> tuple[Matrix, bool]:
    """The path to exactly the goal configuration that it comes near to, and whether that is free."""
    goal = goals[np.linalg.norm(goals - path[-1], axis=1).argmin()]
    if (goal == path[-1]).all():
        return path, True
    return np.vstack([path, goal]), checker.motion_valid(path[-1], goal)
