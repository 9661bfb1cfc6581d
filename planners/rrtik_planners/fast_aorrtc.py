"""AORRTC in kernels: RRT-Connect in the space of configurations and costs, with a falling bound. Source: [15]."""

from __future__ import annotations

from typing import ClassVar

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.ompl_bridge import MotionChecker, SearchResult, Stop
from rrtik_ompl.planning.improving import BOUND, BOUNDED_SAMPLES
from rrtik_planners.restart_shorten import RestartShorten


class FastAORRTC(RestartShorten):
    """Works like :class:`RestartShorten`, but each further path has to stay below a length before it is shortened.

    By the costs of AORRTC [15], the trees take only vertices through which a path below that length can lead. The bound
    begins at one and a half times the best length and approaches it as long as nothing is gained; meanwhile the number
    of samples grows. Without kernels there is no bound. OMPL's own planner of that kind is called AORRTC.
    """

    ompl_name: ClassVar[str] = "FastAORRTC"

    def another(
        self, starts: Matrix, goals: Matrix, best: float, idle: int, checker: MotionChecker, ptc: Stop
    ) -> SearchResult:
        """See :meth:`RestartShorten.another`."""
        bound = best * (1.0 + (BOUND - 1.0) / idle)
        return self.between(starts, goals, checker, ptc, bound=bound, max_iterations=BOUNDED_SAMPLES * idle)
