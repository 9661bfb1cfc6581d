"""The tree of a planner's search, in the order in which it grew, from the graph that the planner keeps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import frozen
from rrtik_ompl.model.search_tree import SearchTree
from rrtik_ompl.ompl_bridge.results import PlannerGraph


def tree_of(planner: str, graph: PlannerGraph, *, one_joint: bool) -> SearchTree:
    """Return a graph as a tree whose edges are in the order in which they came.

    Args:
        planner: Name of the planner.
        graph: Its graph.
        one_joint: Whether its edges move one joint each and may be divided later on by further vertices.
    """
    edges = _undivided(graph) if one_joint else graph.edges
    _, births = np.unique(graph.births, return_inverse=True)  # numbers of vertices, not of checks
    steps = births[edges].max(axis=1, initial=0)
    order = np.argsort(steps, kind="stable")
    return SearchTree(
        planner,
        graph.vertices,
        frozen(edges[order], dtype=np.int64),
        frozen(steps[order], dtype=np.int64),
        graph.starts,
        graph.goals,
        graph.links,
    )


def _undivided(graph: PlannerGraph) -> NDArray[np.int64]:
    """Return the edges of a tree as they were when they came, before later vertices divided them, shape (e, 2).

    An edge that is divided by a vertex on it leads to its child from a parent that is younger. All of the younger ones
    lie on the edge, so that it began at the next ancestor that is older.
    """
    parents = np.full(len(graph.vertices), -1, dtype=np.int64)
    parents[graph.edges[:, 1]] = graph.edges[:, 0]
    began = graph.edges.copy()
    while True:
        younger = began[:, 0] > began[:, 1]
        if not younger.any():
            return began
        began[younger, 0] = parents[began[younger, 0]]
