"""What searches by two trees have in common: their roots, which of them grows, where they meet."""

from __future__ import annotations

from typing import Any

from rrtik_ompl.kernels.search.motions.row_kernels import Configuration, row_at
from rrtik_ompl.kernels.search.sample_kernels import load_row, set_query, start_samples
from rrtik_ompl.kernels.search.tree_kernels import add_vertex, clear_tree, nearest_vertex, set_cost
from rrtik_ompl.kernels.search.tree_layout import CERTAIN, NO_PARENT, TreeTable
from rrtik_ompl.kernels.search.two_trees_layout import UNBOUNDED_DOMAIN, TwoTreesTable
from rrtik_ompl.kernels.simd.compiled import inlined, kernel


@inlined
def tree_of(search: TwoTreesTable, side: int) -> TreeTable:
    """The tree from the starts (0) or from the goals (1)."""
    return search.start_tree if side == 0 else search.goal_tree


@inlined
def meeting_of(search: TwoTreesTable, side: int) -> Any:
    """The vertex of a tree at which it meets the other one."""
    return search.start_meeting if side == 0 else search.goal_meeting


@inlined
def set_meeting(search: TwoTreesTable, side: int, vertex: int) -> None:
    """Set the vertex of a tree at which it meets the other one."""
    if side == 0:
        search.start_meeting = vertex
    else:
        search.goal_meeting = vertex


@kernel
def plant(
    search: TwoTreesTable, start_rows: Configuration, starts: int, goal_rows: Configuration, goals: int, seed: int
) -> int:
    """Begin anew from roots at two addresses; returns -1, or the number of one outside the box, goals after starts."""
    search.iterations = 0
    search.checked = 0
    search.straight_tried = 0
    search.grower = 0
    search.goal_count = goals
    start_samples(search, seed)
    outside = plant_roots(search, 0, start_rows, starts)
    if outside >= 0:
        return outside
    outside = plant_roots(search, 1, goal_rows, goals)
    return starts + outside if outside >= 0 else -1


@kernel
def plant_roots(search: TwoTreesTable, side: int, rows: Configuration, count: int) -> int:
    """Make the rows the roots of a tree; returns the number of the first one outside the box, or -1."""
    tree = tree_of(search, side)
    clear_tree(tree)
    for k in range(count):
        if not load_row(search, row_at(rows, search.motions.dof, k)):
            return k
        vertex = add_vertex(tree, search.row, search.row_values, NO_PARENT, CERTAIN, UNBOUNDED_DOMAIN)
        set_cost(tree, vertex, 0.0)
    return -1


@inlined
def next_grower(search: TwoTreesTable) -> Any:
    """The side whose tree is extended towards the next sample: by turns, but never the larger one [5]."""
    side = 1 - search.grower
    if tree_of(search, side).live > tree_of(search, 1 - side).live:
        side = 1 - side
    search.grower = side
    return side


@kernel
def nearest_to(search: TwoTreesTable, side: int, row: Configuration) -> Any:
    """The vertex of a tree that is nearest to a configuration."""
    set_query(search, row)
    return nearest_vertex(tree_of(search, side), search.query)
