"""IKURT exactly as published, for comparison with the improved one. Source: [1, ch. 5.1, algorithms 4 and 5]."""

from __future__ import annotations

from dataclasses import replace

from rrtik_ompl.base.arrays import Matrix, positive
from rrtik_ompl.ik.ikurt.metric import JOINT_RADIUS, ConfigurationMetric, TipMetric, reach
from rrtik_ompl.ik.ikurt.published import PublishedSearch, Steps
from rrtik_ompl.model.goal import Goal
from rrtik_ompl.ompl_bridge import MotionChecker, MotionQueries, SearchResult, Stop
from rrtik_ompl.ompl_bridge.bindings import ob
from rrtik_ompl.world.world import World
from rrtik_planners.tip_seeker import TipSeeker, closest

STEP = 0.15  # [rad]
THRESHOLD_ANGLE = 0.5  # [rad] in the metric of poses
THRESHOLD_REACH = 0.13  # share of the reach, for positions


class IKURTPublished(TipSeeker):
    """Extended inverse kinematics as published: one sample at a time, no Jacobian; slow if goals lie on joint limits.

    [1] gives no numbers; the defaults are a proposal. ``statistics`` are those of :class:`rrtik_planners.ikurt.IKURT`.
    """

    def __init__(
        self,
        si: ob.SpaceInformation,
        *,
        world: MotionQueries | None = None,
        seed: int | None = None,
        goal: Goal | None = None,
        mu: float | None = None,
        step: float | None = None,
        threshold: float | None = None,
        accuracy: float | None = None,
    ) -> None:
        """Make a planner with options in addition to those of :class:`~rrtik_ompl.ompl_bridge.SafePlanner`.

        Args:
            goal: See :class:`rrtik_planners.ikurt.IKURT`.
            mu: Weight of the distance in the metric of poses [1/m]; if None the distance at the start counts as much
                as the largest angle.
            step: Growth step delta0 [unit of the space]; if None 0.15 rad, or 1 % of a space that is not an arm's.
            threshold: Distance in the metric below which the step shrinks; if None 0.5 rad, or 13 % of the reach, or
                4 % of a space that is not an arm's.
            accuracy: Distance in the metric at which the goal counts as reached, the published min_threshold; if None
                it follows from the tolerances of the goal.

        Raises:
            InputError: If an option is out of range or the space is of another kind.
        """
        super().__init__(si, "IKURTPublished", world=world, seed=seed, goal=goal)
        self.step = None if step is None else positive(step, "step")
        self.mu = None if mu is None else positive(mu, "mu")
        self.threshold = None if threshold is None else positive(threshold, "threshold")
        self.accuracy = None if accuracy is None else positive(accuracy, "accuracy")

    def search(self, starts: Matrix, goals: Matrix, checker: MotionChecker, ptc: Stop) -> SearchResult:
        """See :meth:`rrtik_ompl.ompl_bridge.SafePlanner.search`; only the first start is used, as published."""
        start = starts[0]
        radian = self.radian()
        metric: TipMetric | ConfigurationMetric = ConfigurationMetric(goals, JOINT_RADIUS * radian)
        threshold = THRESHOLD_ANGLE * radian
        if isinstance(self._world, World) and self.goal is not None:
            metric = TipMetric.published(self._world.robot, self.targets(), start, self.mu)
            threshold = THRESHOLD_ANGLE if metric.metres_per_radian else THRESHOLD_REACH * reach(self._world.robot)

        steps = Steps(self.step or STEP * radian, self.threshold or threshold, self.accuracy or metric.radius)
        search = PublishedSearch(metric, steps, *self.bounds(), checker.motion_valid, ptc, self.rng, start)
        vertex = search.run()

        path = None if vertex is None else search.tree.branch(vertex)
        counts = {"connects": search.connects, "vertices": search.tree.size}
        result = self.result(metric, search.tree, path, counts, checker)
        if vertex is None and isinstance(metric, TipMetric):
            nearest = search.tree.q[search.tree.distance.argmin()]
            return replace(result, reason=f"goal not reached: {closest(metric, nearest)}")
        return result
