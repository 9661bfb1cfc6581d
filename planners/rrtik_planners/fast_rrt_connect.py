"""RRT-Connect at the speed of its collision checks: the whole search runs in a kernel where the world has kernels."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager
from typing import ClassVar

import numpy as np
from ompl import base as ob

from rrtik_ompl.base.arrays import Mask, Matrix, Vector, positive
from rrtik_ompl.base.budget import iteration_limit
from rrtik_ompl.kernels.search.connect import ConnectSearch, Searched, kept_search, solve_each
from rrtik_ompl.kernels.search.connect_layout import KERNELS
from rrtik_ompl.kernels.search.connect_lengths import connect_lengths
from rrtik_ompl.kernels.search.tree_layout import TreeTable
from rrtik_ompl.kernels.search.tree_memory import certain_tree
from rrtik_ompl.ompl_bridge import MotionChecker, MotionQueries, SafePlanner, SearchResult, Stop
from rrtik_ompl.ompl_bridge.results import Tree, without
from rrtik_ompl.planning.search.rrt_connect import ConnectRules, RrtConnect, straight_path
from rrtik_ompl.world.motion_queries import KernelWorld, decider, has_kernels


class FastRRTConnect(SafePlanner):
    """RRT-Connect with dynamic domain and balanced trees; the straight motion is tried first.

    With a world that has kernels (``world.motions``) the search runs in them and a path comes back in microseconds.
    Motions that they cannot decide are checked by the world once they are part of a path, and never in a
    conservative world. With any other world, or none, a plain loop does the same on one motion at a time.
    """

    kernels: ClassVar[tuple[str, ...]] = (KERNELS,)
    supports_iteration_limit: ClassVar[bool] = True
    proof_iterations: ClassVar[int] = 20_000
    reseeded: ClassVar[bool] = True

    def __init__(
        self,
        si: ob.SpaceInformation,
        *,
        world: MotionQueries | None = None,
        seed: int | None = None,
        range: float | None = None,
        domain: float | None = None,
        max_iterations: int | None = None,
        bound: float | None = None,
    ) -> None:
        """Make a planner with options beside those of :class:`~rrtik_ompl.ompl_bridge.SafePlanner`.

        Args:
            range: Length of a motion of the trees, at most [unit of the space]; what suits the bounds if None.
            domain: Radius in which a vertex is extended once it was blocked [unit of the space]; as with ``range``.
            max_iterations: Samples at most; without limit if None.
            bound: Length that the path has to stay below, unless it is a straight motion [unit of the space]; then the
                search is one of AORRTC [15]. For worlds with kernels; any length elsewhere, and if None.

        Raises:
            InputError: If an option is out of range or the space is of another kind.
        """
        super().__init__(si, "FastRRTConnect", world=world, seed=seed)
        self.range = None if range is None else positive(range, "range")
        self.domain = None if domain is None else positive(domain, "domain")
        self.max_iterations = iteration_limit(max_iterations)
        self.bound = None if bound is None else positive(bound, "bound")

    def search(self, starts: Matrix, goals: Matrix, checker: MotionChecker, ptc: Stop) -> SearchResult:
        """See :meth:`rrtik_ompl.ompl_bridge.SafePlanner.search`."""
        return self.between(starts, goals, checker, ptc, bound=self.bound, max_iterations=self.max_iterations)

    def between(
        self,
        starts: Matrix,
        goals: Matrix,
        checker: MotionChecker,
        ptc: Stop,
        *,
        bound: float | None = None,
        max_iterations: int | None = None,
    ) -> SearchResult:
        """One search; see the options of the planner."""
        world = self._world
        if not has_kernels(world, KERNELS):
            rules = python_rules(self.bounds(), *self._lengths, max_iterations, turning=self.turning())
            return search_in_python(self, starts, goals, rules, checker, ptc)

        with self._kernels(world) as kernels:
            path = kernels.solve(
                starts,
                goals,
                self.rng.bit_generator.random_raw(),
                ask=decider(world, checker.motion_valid_batch),
                stop=ptc,
                max_iterations=max_iterations,
                bound=bound,
            )
            counts = kernels.statistics()
            graph = self.grown(lambda: sound_tree(kernels.trees[0]), lambda: sound_tree(kernels.trees[1]))
        checker.checked_motions += int(counts["motions"] - counts["questions"])  # the questions it has counted
        return SearchResult(path, {**counts, "edges": counts["vertices"] - len(starts) - len(goals)}, graph=graph)

    def solve_each(
        self, ends: Matrix, seeds: Sequence[int], bounds: tuple[Vector, Vector]
    ) -> Sequence[SearchResult | None]:
        """See :class:`rrtik_ompl.planning.many.SolvesEach`."""
        self._bounds = bounds
        if self.bound is not None or self.max_iterations is None or not has_kernels(self._world, KERNELS):
            return [None] * len(ends)

        drawn = [int(np.random.default_rng(seed).bit_generator.random_raw()) for seed in seeds]
        with self._kernels(self._world) as kernels:
            return [_result_of(found) for found in solve_each(kernels, ends, drawn, self.max_iterations)]

    def ends_free(self, rows: Matrix, checker: MotionChecker) -> Mask:
        """See :meth:`rrtik_ompl.ompl_bridge.SafePlanner.ends_free`; the kernels know in a few microseconds."""
        if has_kernels(self._world, KERNELS):
            with self._kernels(self._world) as kernels:
                proven = kernels.proven_free(rows)
            if proven:
                checker.checked_states += len(rows)
                return np.ones(len(rows), dtype=bool)
        return super().ends_free(rows, checker)

    @property
    def _lengths(self) -> tuple[float | None, float | None]:
        return self.range, self.domain

    def _kernels(self, world: KernelWorld) -> AbstractContextManager[ConnectSearch]:
        """The search in kernels for a world and the bounds of this solve."""
        lower, upper = self.bounds()
        key = (lower.tobytes(), upper.tobytes(), *self._lengths)
        return kept_search(world.motions, key, lambda: self._made(world, lower, upper))

    def _made(self, world: KernelWorld, lower: Vector, upper: Vector) -> ConnectSearch:
        range_, domain = connect_lengths(lower, upper, *self._lengths, turning=self.turning())
        lower = np.maximum(lower, world.robot.lower)  # kernels know no place beyond the limits
        upper = np.minimum(upper, world.robot.upper)
        return ConnectSearch(world.motions, lower, upper, range_=range_, domain=domain)


def _result_of(found: Searched | None) -> SearchResult | None:
    """One search of several, with the counts of a search of its own."""
    if found is None:
        return None
    names = ("iterations", "vertices", "motions", "questions", "rejected")
    counts = {name: getattr(found, name) for name in names} | {"edges": found.vertices - 2, "checked_states": 0}
    return SearchResult(found.path, {**counts, "checked_motions": found.motions - found.questions})


def python_rules(
    bounds: tuple[Vector, Vector],
    range_: float | None,
    domain: float | None,
    max_iterations: int | None,
    *,
    turning: Mask | None,
) -> ConnectRules:
    """How the trees grow in Python; see `FastRRTConnect` and `connect_lengths` for the arguments."""
    lower, upper = bounds
    lengths = connect_lengths(lower, upper, range_, domain, turning=turning)
    return ConnectRules(lower, upper, *lengths, balanced=True, max_iterations=max_iterations)


def sound_tree(tree: TreeTable) -> Tree:
    """The vertices of a tree in kernels to which certain motions lead, and their parents."""
    return without(*certain_tree(tree))


def search_in_python(
    planner: SafePlanner, starts: Matrix, goals: Matrix, rules: ConnectRules, checker: MotionChecker, ptc: Stop
) -> SearchResult:
    """The search of a planner without kernels, where every motion is decided at once."""
    search = RrtConnect(starts, goals, rules, checker.motion_valid, planner.rng)
    path = straight_path(starts, goals, checker.motion_valid, ptc)
    path = search.run(ptc) if path is None else path
    edges = search.vertices - len(starts) - len(goals)
    counts = {"iterations": search.iterations, "vertices": search.vertices, "edges": edges}
    graph = planner.grown(search.trees[0].grown, search.trees[1].grown)
    return SearchResult(path, counts, graph=graph)
