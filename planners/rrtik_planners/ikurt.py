"""IKURT: finds a goal configuration for a goal of the tip and the path to it at once, by a tree in joint space."""

from __future__ import annotations

from dataclasses import replace

from rrtik_ompl.base.arrays import Matrix, positive, whole_number
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.ik.ikurt.metric import JOINT_RADIUS, ConfigurationMetric, TipMetric
from rrtik_ompl.ik.ikurt.search import BatchedSearch, IkurtValidity, Options
from rrtik_ompl.model.goal import Goal
from rrtik_ompl.ompl_bridge import MotionChecker, MotionQueries, SearchResult, Stop
from rrtik_ompl.ompl_bridge.bindings import ob
from rrtik_ompl.world.motion_queries import BatchedMotionQueries
from rrtik_ompl.world.world import World
from rrtik_planners.tip_seeker import TipSeeker, closest

STEP = 0.15  # first step of CONNECT [rad]
STRIDE = 0.6  # longest step of the exploration [rad]


class IKURT(TipSeeker):
    """Extended inverse kinematics: a tree in joint space that grows towards lower distance of the tip from its goal.

    Source: [1, ch. 5.1], made faster and more robust (:mod:`rrtik_ompl.ik.ikurt.search`);
    :class:`rrtik_planners.ikurt_published.IKURTPublished` is the algorithm as published. If the goals are
    configurations, as in plain OMPL, the distance is that in joint space.

    ``statistics`` says how far from the goal the tip ends: ``position_error`` [m], ``orientation_error`` [rad].
    """

    def __init__(
        self,
        si: ob.SpaceInformation,
        *,
        world: MotionQueries | None = None,
        seed: int | None = None,
        goal: Goal | None = None,
        jacobian: bool = True,
        metres_per_radian: float | None = None,
        step: float | None = None,
        stride: float | None = None,
        most_vertices: int = 10_000,
    ) -> None:
        """Make a planner with options in addition to those of :class:`~rrtik_ompl.ompl_bridge.SafePlanner`.

        Args:
            goal: Goal of the tip; needs a world. If None, the configurations of the problem definition are the goals.
            jacobian: Whether Levenberg-Marquardt from the vertices looks for goal configurations, accurate to 1e-9 of
                the reach. If False the tree alone has to get there, to the tolerances of the goal.
            metres_per_radian: Weight of the angle in the metric; if None a full turn counts as much as the reach.
            step: First step of CONNECT [unit of the space]; if None 0.15 rad, or 1 % of a space that is not an arm's.
            stride: Longest step of the exploration [unit of the space]; if None 0.6 rad, or 4 %.
            most_vertices: Number of vertices above which the trees are dropped and begun again.

        Raises:
            InputError: If an option is out of range or the space is of another kind.
        """
        super().__init__(si, "IKURT", world=world, seed=seed, goal=goal)
        most_vertices = whole_number(most_vertices, "most_vertices:", least=1)
        if not isinstance(jacobian, bool):
            raise InputError(f"jacobian: expected true or false, got {jacobian!r}")
        self.step = None if step is None else positive(step, "step")
        self.stride = None if stride is None else positive(stride, "stride")
        self.jacobian = jacobian
        self.most_vertices = most_vertices
        self.metres_per_radian = None if metres_per_radian is None else positive(metres_per_radian, "metres_per_radian")

    def search(self, starts: Matrix, goals: Matrix, checker: MotionChecker, ptc: Stop) -> SearchResult:
        """See :meth:`rrtik_ompl.ompl_bridge.SafePlanner.search`."""
        metric = self._metric(goals)
        radian = self.radian()
        step = self.step or STEP * radian
        stride = self.stride or STRIDE * radian
        options = Options(step, stride, self.jacobian, self.most_vertices)

        motions = BatchedMotionQueries(checker.motion_valid_batch, ptc)
        validity = IkurtValidity(checker.valid_batch, motions.in_time, ptc)
        search = BatchedSearch(metric, options, *self.bounds(), validity, self.rng, starts)
        path = search.run()

        counts = {"connects": search.connects, "restarts": search.restarts, "vertices": search.vertices}
        result = self.result(metric, search.tree, path, counts, checker)
        if path is None and isinstance(metric, TipMetric):
            return replace(result, reason=self._why(metric, search))
        return result

    def _metric(self, goals: Matrix) -> TipMetric | ConfigurationMetric:
        if isinstance(self._world, World) and self.goal is not None:
            return TipMetric(self._world.robot, self.targets(), metres_per_radian=self.metres_per_radian)
        return ConfigurationMetric(goals, JOINT_RADIUS * self.radian())

    def _why(self, metric: TipMetric, search: BatchedSearch) -> str:
        """Return why the goal was not reached, as far as the search can tell."""
        if len(search.goals):
            return f"no path to any of {len(search.goals)} free configurations at the goal"
        if len(search.blocked) and isinstance(self._world, World):
            what = self._world.explain(search.blocked[0]) or "outside the bounds"
            return f"all configurations found at the goal are in collision: for instance {what}"
        return f"goal not reached: {closest(metric, search.nearest)}"
