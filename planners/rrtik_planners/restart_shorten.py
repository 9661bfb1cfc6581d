"""Plan repeatedly by RRT-Connect, shorten each path and keep the best; other seeds pass obstacles on other sides."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import ClassVar

import numpy as np

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.kernels.search.connect_layout import KERNELS
from rrtik_ompl.kernels.search.shortcut_layout import KERNELS as SHORTCUTS
from rrtik_ompl.model.transitions import route_length
from rrtik_ompl.ompl_bridge import MotionChecker, MotionQueries, SearchResult, Stop
from rrtik_ompl.ompl_bridge.bindings import ob
from rrtik_ompl.planning.improving import GAIN, PATIENCE, QUICK_CHECKS, SETTLED, WORTH
from rrtik_ompl.planning.shortening.best import best_in_time
from rrtik_ompl.planning.shortening.task import Task, Wishes
from rrtik_ompl.world.motion_queries import has_kernels
from rrtik_planners.fast_rrt_connect import FastRRTConnect


class RestartShorten(FastRRTConnect):
    """Repeats RRT-Connect with other random numbers and shortens each path, until time is up or nothing is gained.

    `plan(improve=)` does the same for any planner and proves its paths; this class is for uses that need a planner,
    such as OMPL's Benchmark. ``progress`` has the length of the best path over time.
    """

    kernels: ClassVar[tuple[str, ...]] = (KERNELS, SHORTCUTS)
    anytime: ClassVar[bool] = True
    supports_iteration_limit: ClassVar[bool] = False
    proof_iterations: ClassVar[int] = 0

    ompl_name: ClassVar[str] = "RestartShorten"

    def __init__(
        self,
        si: ob.SpaceInformation,
        *,
        world: MotionQueries | None = None,
        seed: int | None = None,
        range: float | None = None,
        domain: float | None = None,
        patience: int = PATIENCE,
    ) -> None:
        """Make a planner with an option in addition to those of :class:`FastRRTConnect`.

        Args:
            patience: Number of plans in a row without a gain after which the search ends; with 0 it ends after the
                first path is shortened.

        Raises:
            InputError: If an option is out of range or the space is of another kind.
        """
        super().__init__(si, world=world, seed=seed, range=range, domain=domain)
        if isinstance(patience, bool) or not isinstance(patience, int) or patience < 0:
            raise InputError(f"patience must be a whole number of at least 0, got {patience!r}")
        self.patience = patience
        self.setName(self.ompl_name)

    def search(self, starts: Matrix, goals: Matrix, checker: MotionChecker, ptc: Stop) -> SearchResult:
        """See :meth:`rrtik_ompl.ompl_bridge.SafePlanner.search`."""
        course: list[tuple[float, float]] = []  # times [s], and the length of the best path from then on
        begun = time.perf_counter()
        best = np.inf
        found = last = self._first(starts, goals, checker, ptc)
        least = np.linalg.norm(starts[:, None] - goals[None], axis=2).min()  # lower bound on the length of a path
        plans = 1
        idle = 0  # number of plans in a row without a gain
        iterations = int(last.statistics["iterations"])

        while found.path is not None:
            if last.path is not None:
                if not course:
                    best = route_length(last.path)
                    course.append((time.perf_counter() - begun, best))

                route = self._shortened(last.path, best, plans, checker, ptc)
                length = route_length(route)
                if length < best * (1.0 - GAIN) and self.stands(route, checker):
                    idle = 0
                    best = length
                    found = replace(last, path=route)
                    course.append((time.perf_counter() - begun, length))

            if idle >= self.patience or ptc() or best <= least * (1.0 + GAIN):
                break

            plans += 1
            idle += 1
            last = self.another(starts, goals, best, idle, checker, ptc)
            iterations += int(last.statistics["iterations"])

        counts = {**found.statistics, "iterations": iterations, "plans": plans}
        return replace(found, statistics=counts, progress=tuple(course))

    def another(
        self, starts: Matrix, goals: Matrix, best: float, idle: int, checker: MotionChecker, ptc: Stop
    ) -> SearchResult:
        """Search for another path; subclasses may override this.

        Args:
            starts: Free start configurations, shape (s, n).
            goals: Free goal configurations, shape (g, n).
            best: Length of the shortest path so far.
            idle: Number of plans since it was found, this one included.
            checker: Checks motions.
            ptc: Returns True when it is time to stop.
        """
        return self.between(starts, goals, checker, ptc)

    def _first(self, starts: Matrix, goals: Matrix, checker: MotionChecker, ptc: Stop) -> SearchResult:
        """Search until a path passes the final check of :meth:`stands`; if time is up first, return one that fails."""
        found = self.between(starts, goals, checker, ptc)
        while found.path is not None and not self.stands(found.path, checker) and not ptc():
            found = self.between(starts, goals, checker, ptc)
        return found

    def _shortened(self, path: Matrix, best: float, number: int, checker: MotionChecker, ptc: Stop) -> Matrix:
        """Shorten a path by a few checks, then by more as long as it gains from them and may become the best.

        Args:
            path: Waypoints of a free path, shape (k, n).
            best: Length of the shortest path so far.
            number: Number of the plan, from which the seeds follow.
            checker: Checks motions and counts them.
            ptc: Returns True when it is time to stop.
        """
        motions = self._world if has_kernels(self._world, SHORTCUTS) else checker
        assert motions is not None
        before = np.inf
        for turn in range(100):
            budget = Budget(100 * number + turn, iterations=QUICK_CHECKS, stop=ptc)
            task = Task(motions, Wishes(budget))
            found = best_in_time(path, task)
            checker.checked_motions += task.asked if motions is self._world else 0
            # Parts of free motions, checked as edges of their own, may be refused.
            if not self.stands(found, checker):
                break

            path = found
            length = route_length(found)
            if length > WORTH * best or length > before * (1.0 - SETTLED) or ptc():
                break
            before = length
        return path
