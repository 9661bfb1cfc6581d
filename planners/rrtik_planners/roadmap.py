"""Probabilistic roadmaps [63] whose motions are checked only when a query needs them [64]."""

from __future__ import annotations

import os
from functools import partial
from typing import ClassVar

import numpy as np

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.errors import InputError, PlannerError, require
from rrtik_ompl.geometry.collision.digests import world_digest
from rrtik_ompl.kernels.search import connect_layout
from rrtik_ompl.kernels.search.roadmap.graph import KernelGraph
from rrtik_ompl.kernels.search.roadmap.layout import KERNELS, SURE
from rrtik_ompl.ompl_bridge import MotionChecker, MotionQueries, SafePlanner, SearchResult, Stop
from rrtik_ompl.ompl_bridge.bindings import ob
from rrtik_ompl.ompl_bridge.results import PlannerGraph, graph_of
from rrtik_ompl.planning.search.roadmap import NEAR, Graph, Roadmap, checked_near, graph_in
from rrtik_ompl.world.world import World
from rrtik_planners.fast_rrt_connect import FastRRTConnect

FIRST_VERTICES = 100  # of a roadmap that is made for one query


class RoadmapPlanner(SafePlanner):
    """Returns the shortest path on a roadmap; if there is none, a path of RRT-Connect is added to it, as in [66].

    With the option ``roadmap`` many queries in a world share one roadmap and what it learns. Without it every solve
    makes a small roadmap of its own.
    """

    kernels: ClassVar[tuple[str, ...]] = (KERNELS, connect_layout.KERNELS)

    def __init__(
        self,
        si: ob.SpaceInformation,
        *,
        world: MotionQueries | None = None,
        seed: int | None = None,
        roadmap: Roadmap | str | os.PathLike[str] | None = None,
        near: int = NEAR,
    ) -> None:
        """Make a planner with options in addition to those of :class:`~rrtik_ompl.ompl_bridge.SafePlanner`.

        Args:
            roadmap: A :class:`~rrtik_ompl.planning.search.roadmap.Roadmap` of the world, or the file of one.
            near: Number of nearest vertices that a new vertex is joined with, if there is no ``roadmap``.

        Raises:
            InputError: If an option is out of range, the roadmap is of another world, or the space of another kind.
        """
        super().__init__(si, "RoadmapPlanner", world=world, seed=seed)
        require(roadmap, Roadmap | str | os.PathLike | None, "roadmap", "use Roadmap(world), or the file of one")
        self.near = checked_near(near)
        self.roadmap = None if roadmap is None else _roadmap_in(world, roadmap)

    def search(self, starts: Matrix, goals: Matrix, checker: MotionChecker, ptc: Stop) -> SearchResult:
        """See :meth:`rrtik_ompl.ompl_bridge.SafePlanner.search`."""
        known = self.roadmap
        graph = self._new_graph(checker, ptc) if known is None else known.graph
        find, learn = (graph.route, graph.learn) if known is None else (known.route, known.learn)
        before = graph.statistics()

        path = find(starts, goals, ptc)
        asked = 0
        if path is None and not ptc():
            found, asked = self._connected(starts, goals, ptc)
            if found is not None:
                learn(found)
                path = find(starts, goals, ptc)
                path = found if path is None else path

        counts = graph.statistics()
        if known is not None:
            counts["motions"] -= before["motions"]  # Leave out the motions of earlier queries.
        if isinstance(graph, KernelGraph):
            checker.checked_motions += int(counts["motions"])
        checker.checked_motions += asked
        drawn = partial(_checked_graph, graph) if self.graph_wanted else None
        return SearchResult(None if path is None else _without_repeats(path), counts, graph=drawn)

    def _connected(self, starts: Matrix, goals: Matrix, ptc: Stop) -> tuple[Matrix | None, int]:
        """Run RRT-Connect; return its path, shape (k, n), or None, and the number of motions checked."""
        seed = int(self.rng.integers(2**31))
        planner = FastRRTConnect(self.getSpaceInformation(), world=self._world, seed=seed)
        _, rows = planner.solve_rows(starts, goals, self.bounds(), ptc, checked=True)
        if planner.failure is not None:
            raise PlannerError(planner.failure.summary)
        return rows, int(planner.statistics["checked_motions"])

    def _new_graph(self, checker: MotionChecker, ptc: Stop) -> Graph:
        seed = int(self.rng.integers(2**31))
        graph = graph_in(self._world, *self.bounds(), near=self.near, seed=seed, checks=checker)
        graph.grow(FIRST_VERTICES, ptc)
        return graph


def _checked_graph(graph: Graph) -> PlannerGraph:
    """Return the free edges of a roadmap, also those that no query has needed."""
    graph.check(lambda: False)
    return graph_of(graph.rows, graph.edges[graph.states == SURE])


def _without_repeats(path: Matrix) -> Matrix:
    """Return a path, shape (k, n), without repeated rows, which occur where a start is a vertex or the goal."""
    kept: Matrix = path[np.append(True, (path[1:] != path[:-1]).any(axis=1))]
    return kept


def _roadmap_in(world: MotionQueries | None, roadmap: Roadmap | str | os.PathLike[str]) -> Roadmap:
    """Return a roadmap for a world.

    A roadmap of the same bodies with another clearance or resolution is moved to this world, where all its motions are
    checked again.

    Raises:
        InputError: If the roadmap is of another world, or its file cannot be used.
    """
    if not isinstance(world, World):
        raise InputError("roadmap: it needs the world that it is of; use plan(), or give the planner world=")
    if not isinstance(roadmap, Roadmap):
        return Roadmap.load(roadmap, world)
    if roadmap.world is world:
        return roadmap
    one, other = (world_digest(each.robot, each.bodies, each.pairs) for each in (roadmap.world, world))
    if one != other:
        raise InputError("roadmap: it is of another world; use roadmap.moved_to(world), or make a new one")
    return roadmap.moved_to(world)
