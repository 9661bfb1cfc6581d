"""Data with which the page draws a planner's search: its trees as they grew, and the joint space of a two-joint arm."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import breadth_first_order, connected_components

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.search_tree import SearchTree
from rrtik_ompl.ompl_bridge.results import graph_of
from rrtik_ompl.planning.grown import tree_of
from rrtik_ompl.planning.search.roadmap import Roadmap
from rrtik_ompl.viewer.drawing import palette
from rrtik_ompl.viewer.subject import Subject
from rrtik_ompl.world.world import World

MOST_EDGES = 3000  # that are drawn; of a larger tree whole branches are left out
MOST_LINKS = 400  # of MB-RRT, for each joint
DIGITS = 4  # of joint values [rad or m]
LINK_DIGITS = 5  # of places [m]
CELLS = 160  # of the joint space, along each axis
ROADMAP = "#8c6bb1"


def search_tree_of(tree: object, robot: Robot | None) -> SearchTree | None:
    """Return the tree that a page draws; a roadmap is drawn with all edges that are not known to be blocked.

    Raises:
        InputError: If it is something else, or of an arm with another number of joints.
    """
    if tree is None:
        return None
    if isinstance(tree, Roadmap):
        tree = tree_of("roadmap", graph_of(tree.vertices, tree.edges), one_joint=False)
    if not isinstance(tree, SearchTree):
        raise InputError(f"tree to show: expected plan(tree=True).tree or a Roadmap, got a {type(tree).__name__}")
    if robot is None or tree.vertices.shape[1] != robot.dof:
        what = "a scene alone" if robot is None else f"robot '{robot.name}' of {robot.dof}"
        raise InputError(f"tree to show: it is of an arm of {tree.vertices.shape[1]} joints, not of {what}")
    return tree


def search_story(tree: SearchTree) -> dict[str, Any]:
    """Return a search as plain values: vertices, and the edges of each tree with the steps in which they came."""
    parts = _parts(tree)
    drawn = [edges[_thinned(tree, edges, MOST_EDGES * len(edges) // max(len(tree.edges), 1))] for _, _, edges in parts]
    used = np.unique(np.concatenate([tree.edges[each].ravel() for each in drawn] or [np.zeros(0, dtype=np.int64)]))
    number = np.zeros(len(tree.vertices), dtype=np.int64)
    number[used] = np.arange(len(used))

    shown = sum(map(len, drawn))
    return {
        "planner": tree.planner,
        "note": f"{shown} of {len(tree.edges)} edges drawn" if shown < len(tree.edges) else "",
        "vertices": (np.round(tree.vertices[used], DIGITS) + 0.0).tolist(),
        "parts": [
            {
                "name": name,
                "color": color,
                "count": len(every),
                "edges": number[tree.edges[kept]].tolist(),
                "steps": tree.steps[kept].tolist(),
            }
            for (name, color, every), kept in zip(parts, drawn, strict=True)
        ],
        "links": _links(tree.links),
    }


def _parts(tree: SearchTree) -> list[tuple[str, str, NDArray[np.int64]]]:
    """Return the trees of a search: a name, a colour, and the numbers of their edges; those without edges are left out.

    Planners of OMPL join two trees by an edge without length.
    """
    ends = tree.vertices[tree.edges]
    moving = np.flatnonzero((ends[:, 0] != ends[:, 1]).any(axis=1))
    if len(tree.starts) == 0 and len(tree.goals) == 0:
        return [("roadmap", ROADMAP, moving)] if len(moving) else []

    _, labels = connected_components(_joined(tree, moving), directed=False)
    from_goal = np.isin(labels[tree.edges[moving, 0]], np.setdiff1d(labels[tree.goals], labels[tree.starts]))
    named = [
        ("from the start", palette.START, moving[~from_goal]),
        ("from the goal", palette.GOAL, moving[from_goal]),
    ]
    return [each for each in named if len(each[2])]


def _thinned(tree: SearchTree, edges: NDArray[np.int64], most: int) -> NDArray[np.int64]:
    """Return which of some edges of a tree are drawn, at most ``most``: whole branches to vertices in even distances.

    Args:
        tree: The tree.
        edges: Numbers of edges.
        most: The largest number of them.
    """
    every = np.arange(len(edges))
    if len(edges) <= most:
        return every
    roots = np.concatenate([tree.starts, tree.goals])
    if len(roots) == 0:
        return every[:: -(-len(edges) // max(most, 1))]

    before = _predecessors(tree, edges, roots)
    ends = tree.edges[edges]
    outwards = before[ends[:, 1]] == ends[:, 0]
    later = np.where(outwards, ends[:, 1], ends[:, 0])  # of each edge the end away from its root
    spacing = 2
    while True:
        wanted = np.zeros(len(tree.vertices), dtype=bool)
        for vertex in later[::spacing].tolist():
            while vertex >= 0 and not wanted[vertex]:
                wanted[vertex] = True
                vertex = int(before[vertex])
        kept = every[wanted[later]]
        if len(kept) <= most or spacing > len(edges):
            return kept
        spacing *= 2


def _predecessors(tree: SearchTree, edges: NDArray[np.int64], roots: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the vertex before each one on the way from its root, shape (v,); below 0 for roots and what is apart."""
    before = np.full(len(tree.vertices), -1, dtype=np.int64)
    graph = _joined(tree, edges)
    for root in roots.tolist():
        _, found = breadth_first_order(graph, root, directed=False)
        before = np.where(found >= 0, found, before)
    return before


def _joined(tree: SearchTree, edges: NDArray[np.int64]) -> csr_array:
    first, second = tree.edges[edges].T
    count = len(tree.vertices)
    return coo_array((np.ones(len(edges)), (first, second)), shape=(count, count)).tocsr()


def _links(links: tuple[Matrix, ...]) -> list[dict[str, Any]]:
    """Return the links of MB-RRT by their joints: a name, a colour, both ends, and how many there are."""
    return [
        {
            "name": f"links of joint {k + 1}",
            "color": palette.SERIES[k % len(palette.SERIES)],
            "count": len(each),
            "ends": (np.round(each[:MOST_LINKS].reshape(-1, 6), LINK_DIGITS) + 0.0).tolist(),
        }
        for k, each in enumerate(links)
    ]


def joint_space(subject: Subject, world: World | None, tree: SearchTree | None) -> dict[str, Any] | None:
    """Return the joint space of an arm of two joints, one of which turns at least; None for other arms.

    Args:
        subject: What is shown.
        world: Checks configurations.
        tree: A tree that has to be in the picture, or None.

    Returns:
        ``low`` and ``high`` ends of both axes, the number of ``cells`` along each, and ``blocked``: the cells whose
        middle is not free, as a path of SVG in units of cells, the first joint to the right and the second one down.
    """
    robot = subject.robot
    if robot is None or world is None or robot.dof != 2 or bool(robot.prismatic.all()):
        return None

    rows = [subject.waypoints, *([] if tree is None else [tree.vertices])]
    if subject.end is not None:
        rows.append(subject.end[None])
    seen = np.concatenate(rows)
    low = np.minimum(np.where(np.isfinite(robot.lower), robot.lower, -np.pi), seen.min(axis=0))
    high = np.maximum(np.where(np.isfinite(robot.upper), robot.upper, np.pi), seen.max(axis=0))
    first, second = (_middles(low[k], high[k]) for k in (0, 1))
    grid = np.stack(np.meshgrid(first, second), axis=-1).reshape(-1, 2)
    blocked = ~world.valid_batch(grid).reshape(CELLS, CELLS)
    return {"low": low.tolist(), "high": high.tolist(), "cells": CELLS, "blocked": _outlined(blocked)}


def _middles(low: float, high: float) -> Vector:
    middles: Vector = low + (high - low) * (np.arange(CELLS) + 0.5) / CELLS
    return middles


def _outlined(blocked: Mask) -> str:
    """Return cells as a path of SVG: a strip for each run of cells in a row."""
    strips = []
    edges = np.diff(np.pad(blocked, [(0, 0), (1, 1)]).astype(np.int8), axis=1)
    for row, line in enumerate(edges):
        for begin, end in zip(np.flatnonzero(line == 1).tolist(), np.flatnonzero(line == -1).tolist(), strict=True):
            strips.append(f"M{begin} {row}h{end - begin}v1H{begin}z")
    return "".join(strips)
