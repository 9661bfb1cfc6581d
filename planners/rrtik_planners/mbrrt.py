"""MB-RRT as a planner: a tree in the workspace finds goal configurations, two trees in joint space the path there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import ClassVar

import numpy as np

from rrtik_ompl.base.arrays import Matrix, frozen
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.ik.mb_rrt.axes import misfit
from rrtik_ompl.ik.mb_rrt.search import tree_aims
from rrtik_ompl.model.goal import Goal, TipGoal
from rrtik_ompl.ompl_bridge import MotionChecker, MotionQueries, SearchResult, Stop
from rrtik_ompl.ompl_bridge.bindings import ob
from rrtik_ompl.ompl_bridge.results import PlannerGraph
from rrtik_ompl.world.world import World
from rrtik_planners.bicrdt import BiCRDT


class MBRRT(BiCRDT):
    """Plans to a pose, a position or a region: MB-RRT finds goal configurations, BiCRDT the path to one of them.

    Source: [3], which names this use and leaves the path to a planner. In plain OMPL, give the problem definition a
    :class:`rrtik_ompl.ompl.GoalSampler`, or any goal that consists of configurations; these are used as they are.
    """

    ompl_name: ClassVar[str] = "MBRRT"
    proof_iterations: ClassVar[int] = 0

    def __init__(
        self,
        si: ob.SpaceInformation,
        *,
        world: MotionQueries | None = None,
        seed: int | None = None,
        goal: Goal | None = None,
        ik_seconds: float = 1.0,
        scale_by_range: bool = False,
        max_iterations: int | None = None,
    ) -> None:
        """Make a planner with options in addition to :class:`~rrtik_planners.one_joint_planner.OneJointPlanner`.

        Args:
            goal: Goal of the tip; needs a world. If None, or if the tree finds nothing, the configurations of the
                problem definition are the goals.
            ik_seconds: Time limit of the tree in the workspace [s].

        Raises:
            InputError: If an option is out of range, the space is of another kind, or the robot does not fit.
        """
        super().__init__(si, world=world, seed=seed, scale_by_range=scale_by_range, max_iterations=max_iterations)
        if not ik_seconds > 0.0:
            raise InputError(f"ik_seconds: expected a number greater than 0, got {ik_seconds!r}")
        self.ik_seconds = ik_seconds
        self.goal = goal if isinstance(goal, TipGoal) else None
        if self.goal is not None:
            _check_fit(world)

    def search(self, starts: Matrix, goals: Matrix, checker: MotionChecker, ptc: Stop) -> SearchResult:
        """See :meth:`rrtik_ompl.ompl_bridge.SafePlanner.search`."""
        trees: list[list[Matrix]] = []
        aims = self._aims(starts, trees)
        result = super().search(starts, aims if len(aims) else goals, checker, ptc)
        graph = None if result.graph is None else partial(_with_links, result.graph, trees)
        return replace(result, statistics={**result.statistics, "tree_goals": len(aims)}, graph=graph)

    def _aims(self, starts: Matrix, trees: list[list[Matrix]]) -> Matrix:
        """Return free configurations at the goal of the tip inside the bounds of the space, shape (k, n).

        The links of the trees that found them are added to ``trees``, if the graph is wanted.
        """
        if self.goal is None or not isinstance(self._world, World):
            return np.zeros((0, starts.shape[1]))
        keep = trees.append if self.graph_wanted else None
        rows = tree_aims(self._world, self.goal, starts[0], self.rng, seconds=self.ik_seconds, on_links=keep)
        lower, upper = self.bounds()
        inside: Matrix = rows[((rows >= lower) & (rows <= upper)).all(axis=1)]
        return inside


def _with_links(make: Callable[[], PlannerGraph], trees: list[list[Matrix]]) -> PlannerGraph:
    """Return a graph with the links of trees in the workspace, joint by joint."""
    return replace(make(), links=tuple(map(frozen, map(np.concatenate, zip(*trees, strict=True)))))


def _check_fit(world: MotionQueries | None) -> None:
    if not isinstance(world, World):
        raise InputError("goal: MBRRT needs world= to know the arm whose tip it is; or give OMPL a GoalSampler")
    fault = misfit(world.robot)
    if fault:
        raise InputError(f"robot '{world.robot.name}' does not fit MB-RRT: {fault}; use planner bicrdt")
