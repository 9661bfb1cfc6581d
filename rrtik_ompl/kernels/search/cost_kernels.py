"""Searches that are bounded by the length of a path: RRT-Connect in the space of configurations and costs.

Source: AORRTC [15]. A vertex has the length of the path to it as one more coordinate, its cost. A sample is given a
cost too, of those with which a path through it may be short enough; what is nearest to both is extended. No vertex is
added, and no two are joined, through which no path below the bound can lead.
"""

from __future__ import annotations

from typing import Any

from rrtik_ompl.kernels.search import connect_layout
from rrtik_ompl.kernels.search.connect_layout import ConnectTable
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration, distance
from rrtik_ompl.kernels.search.tree_kernels import cost_of, nearest_by_cost, parent_of, row_of, set_cost
from rrtik_ompl.kernels.search.tree_layout import TreeTable
from rrtik_ompl.kernels.simd.compiled import inlined, kernel
from rrtik_ompl.kernels.simd.random_kernels import next_share


@inlined
def is_bounded(search: ConnectTable) -> bool:
    """Whether there is a bound."""
    bounded: bool = search.bound < connect_layout.UNBOUNDED_COST
    return bounded


@kernel
def vertex_for(search: ConnectTable, tree: TreeTable, other: TreeTable, row: Configuration) -> Any:
    """The vertex to be extended towards a sample, and -1 if no path below the bound leads through that."""
    dof = search.motions.dof
    least = from_roots(dof, tree, row)
    most = search.bound - from_roots(dof, other, row)
    if least >= most:
        return -1
    cost = least + next_share(search) * (most - least)
    return nearest_by_cost(tree, search.query, cost)


@kernel
def from_roots(dof: int, tree: TreeTable, row: Configuration) -> float:
    """Distance of a configuration from the nearest root of a tree."""
    least = connect_layout.UNBOUNDED_COST
    vertex = 0
    while vertex < tree.size and parent_of(tree, vertex) < 0:  # roots come first
        least = min(least, distance(dof, row_of(tree, vertex), row))
        vertex += 1
    return least


@kernel
def may_lead(search: ConnectTable, tree: TreeTable, vertex: int, row: Configuration, rest: float) -> bool:
    """Whether a path below the bound may lead from a vertex to a configuration, from which ``rest`` is left."""
    dof = search.motions.dof
    return cost_of(tree, vertex) + distance(dof, row_of(tree, vertex), row) + rest < search.bound  # type: ignore[no-any-return]


@kernel
def note_cost(search: ConnectTable, tree: TreeTable, vertex: int) -> None:
    """Set the cost of a new vertex: that of its parent, and the motion from there."""
    dof = search.motions.dof
    parent = parent_of(tree, vertex)
    set_cost(tree, vertex, cost_of(tree, parent) + distance(dof, row_of(tree, parent), row_of(tree, vertex)))
