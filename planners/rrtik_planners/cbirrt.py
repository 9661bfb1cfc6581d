"""CBiRRT2: two trees that grow along path constraints by projection; in kernels, or in Python without them."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector, positive
from rrtik_ompl.base.budget import iteration_limit
from rrtik_ompl.constraints.held_regions import HeldRegions
from rrtik_ompl.constraints.walls import separation
from rrtik_ompl.ik.held_tables import HeldTables, held_tables
from rrtik_ompl.kernels.search.constrained.layout import KERNELS
from rrtik_ompl.kernels.search.constrained.search import ConstrainedSearch
from rrtik_ompl.kernels.search.motions.motion_table import NO_LIMIT, FastMotions
from rrtik_ompl.ompl_bridge import MotionChecker, MotionQueries, SafePlanner, SearchResult, Stop
from rrtik_ompl.ompl_bridge.bindings import ob
from rrtik_ompl.planning.search.along_constraints import AlongConstraints, rules_along
from rrtik_ompl.world.motion_queries import HoldingQueries, decider, has_kernels, keeps_constraints
from rrtik_planners.fast_rrt_connect import python_rules, search_in_python, sound_tree

PLAIN_SAMPLES = 200  # number of samples after which it is checked whether the constraints separate start and goal


class CBiRRT(SafePlanner):
    """CBiRRT2: each tree grows towards samples, and towards the other tree, in short steps that are projected.

    In a world with path constraints, paths keep these by the bound of
    :class:`rrtik_ompl.constraints.held_regions.HeldRegions`; in any other world it is an RRT-Connect. If no path is
    found after `PLAIN_SAMPLES` samples, the planner looks for a proof that the constraints alone keep start and goal
    apart (:mod:`rrtik_ompl.constraints.walls`), and if there is one, ends with that reason.
    """

    kernels: ClassVar[tuple[str, ...]] = (KERNELS,)
    supports_iteration_limit: ClassVar[bool] = True
    keeps_constraints: ClassVar[bool] = True

    def __init__(
        self,
        si: ob.SpaceInformation,
        *,
        world: MotionQueries | None = None,
        seed: int | None = None,
        range: float | None = None,
        max_iterations: int | None = None,
    ) -> None:
        """Make a planner with options in addition to those of :class:`~rrtik_ompl.ompl_bridge.SafePlanner`.

        Args:
            range: Longest step [unit of the space]; a length that suits the bounds if None.
            max_iterations: Largest number of samples; without limit if None.

        Raises:
            InputError: If an option is out of range or the space is of another kind.
        """
        super().__init__(si, "CBiRRT", world=world, seed=seed)
        self.range = None if range is None else positive(range, "range")
        self.max_iterations = iteration_limit(max_iterations)

    def search(self, starts: Matrix, goals: Matrix, checker: MotionChecker, ptc: Stop) -> SearchResult:
        """See :meth:`rrtik_ompl.ompl_bridge.SafePlanner.search`."""
        world = self._world
        motions = None
        tables = None
        if keeps_constraints(world):
            motions = world.free_motions
            tables = held_tables(world.robot, world.constraints)
            if motions is None or tables is None:
                return self._along_constraints(starts, goals, checker, ptc, world)
        elif has_kernels(world, KERNELS):
            motions = world.motions
            tables = held_tables(world.robot, HeldRegions(()))  # Without regions the search is an RRT-Connect.

        if motions is None or tables is None:
            rules = python_rules(self.bounds(), self.range, None, self.max_iterations, turning=self.turning())
            return search_in_python(self, starts, goals, rules, checker, ptc)
        return self._in_kernels(starts, goals, checker, ptc, motions, tables)

    def _along_constraints(
        self, starts: Matrix, goals: Matrix, checker: MotionChecker, ptc: Stop, world: HoldingQueries
    ) -> SearchResult:
        """Search in Python."""
        robot = world.robot
        lower, upper = self.bounds()
        box = np.maximum(lower, robot.lower), np.minimum(upper, robot.upper)
        rules = rules_along(robot, world.constraints, box, self.range, checker.motion_valid)
        search = AlongConstraints(starts, goals, rules, self.rng)
        limit = np.inf if self.max_iterations is None else self.max_iterations
        first = min(limit, PLAIN_SAMPLES)
        path = search.run(ptc, first)
        reason = "" if path is not None or first == limit or ptc() else _separation(world, starts, goals)
        if path is None and not reason and first < limit:
            path = search.run(ptc, limit)

        vertices = sum(tree.size for tree in search.trees)
        counts = {"iterations": search.iterations, "vertices": vertices}
        counts["edges"] = vertices - len(starts) - len(goals)
        if reason:
            counts["separated"] = 1
        graph = self.grown(search.trees[0].grown, search.trees[1].grown)
        return SearchResult(path, counts, reason=reason, graph=graph)

    def _in_kernels(
        self,
        starts: Matrix,
        goals: Matrix,
        checker: MotionChecker,
        ptc: Stop,
        motions: FastMotions,
        tables: HeldTables,
    ) -> SearchResult:
        lower, upper = self._box(motions)
        shortest = tables.shortest
        search = ConstrainedSearch(motions, tables.held, lower, upper, range_=self.range, shortest=shortest)
        ask = decider(self._world, checker.motion_valid_batch)
        limit = NO_LIMIT if self.max_iterations is None else self.max_iterations
        seed = self.rng.bit_generator.random_raw()

        # After a first part of the samples, look for a proof of separation, and go on only if there is none.
        first = min(limit, PLAIN_SAMPLES)
        path = search.solve(starts, goals, seed, ask=ask, stop=ptc, max_iterations=first)
        reason = "" if path is not None or first == limit or ptc() else _separation(self._world, starts, goals)
        if path is None and not reason and first < limit:
            path = search.go_on(limit, ask=ask, stop=ptc)

        counts = search.statistics()
        checker.checked_motions += int(counts["motions"])
        counts["edges"] = counts["vertices"] - len(starts) - len(goals)
        if reason:
            counts["separated"] = 1
        graph = self.grown(lambda: sound_tree(search.trees[0]), lambda: sound_tree(search.trees[1]))
        return SearchResult(path, counts, reason=reason, graph=graph)

    def _box(self, motions: FastMotions) -> tuple[Vector, Vector]:
        lower, upper = self.bounds()
        if keeps_constraints(self._world):
            robot = self._world.robot
            return np.maximum(lower, robot.lower), np.minimum(upper, robot.upper)
        return lower, upper


def _separation(world: object, starts: Matrix, goals: Matrix) -> str:
    """Return a line that says why path constraints keep all starts and goals apart; "" if that is not proven."""
    if not keeps_constraints(world):
        return ""
    said = [separation(world.constraints, start, goals) for start in starts]
    return said[0] if all(said) else ""
