"""Trees of RRT-Connect in kernels: vertices in lanes for the nearest neighbour, in float64 for motions.

Vertices are counted from 0 in the order in which they came, so a parent comes before its children. A vertex that was
cut off stays in place and is never the nearest again.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rrtik_ompl.kernels.layout import JointValues
from rrtik_ompl.kernels.record import Floats
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration, copy_row, row_at
from rrtik_ompl.kernels.search.tree_layout import CUT, TreeTable
from rrtik_ompl.kernels.simd.access import lane_at
from rrtik_ompl.kernels.simd.compiled import WIDTH, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import (
    bits,
    choose,
    first_bit,
    lanes_at,
    larger,
    lowest,
    set_lanes,
    spread,
)
from rrtik_ompl.kernels.simd.records import same_place
from rrtik_ompl.kernels.tables.accessors import joint_row

ABSENT_COORDINATE = np.float32(1e15)  # [rad or m] of what is no vertex: farther than any that is one
UNBOUNDED_SQUARE = np.float32(3e38)  # [unit of the configurations, squared] more than any squared distance
UNBOUNDED_BLOCK = np.float32(3e38)  # more than the number of any block
ZERO = np.float32(0.0)


@inlined
def row_of(tree: TreeTable, vertex: int) -> Configuration:
    """Address of a vertex's configuration."""
    return row_at(tree.rows, tree.dof, vertex)


@inlined
def values_of(tree: TreeTable, vertex: int) -> JointValues:
    """Address of a vertex's joint values."""
    return joint_row(tree.values, tree.joints, vertex)


@inlined
def parent_of(tree: TreeTable, vertex: int) -> Any:
    """The parent of a vertex, -1 for a root."""
    return tree.parents[vertex]


@inlined
def state_of(tree: TreeTable, vertex: int) -> Any:
    """CERTAIN, OPEN or CUT."""
    return tree.states[vertex]


@inlined
def set_state(tree: TreeTable, vertex: int, state: int) -> None:
    """Set whether a vertex is CERTAIN, OPEN or CUT."""
    tree.states[vertex] = state


@inlined
def radius_of(tree: TreeTable, vertex: int) -> Any:
    """Radius of a vertex's domain [unit of the configurations]."""
    return tree.radii[vertex]


@inlined
def set_radius(tree: TreeTable, vertex: int, radius: float) -> None:
    """Set the radius of a vertex's domain."""
    tree.radii[vertex] = np.float32(radius)


@inlined
def cost_of(tree: TreeTable, vertex: int) -> Any:
    """Length of the path from a root to a vertex, where it was set."""
    return tree.costs[vertex]


@inlined
def set_cost(tree: TreeTable, vertex: int, cost: float) -> None:
    """Set the length of the path from a root to a vertex."""
    tree.costs[vertex] = np.float32(cost)


@inlined
def is_full(tree: TreeTable) -> Any:
    """Whether a tree has no room for one more vertex."""
    return tree.size >= tree.capacity


@inlined
def lane_place(dof: int, vertex: int, coordinate: int) -> Any:
    """Which of the floats in lanes is a coordinate of a vertex."""
    return (vertex // WIDTH * dof + coordinate) * WIDTH + vertex % WIDTH


@kernel
def nearest_vertex(tree: TreeTable, query: Floats) -> Any:
    """The vertex nearest to ``DOF`` floats; of several the first one."""
    vertex, _ = nearest_and_square(tree, query)
    return vertex


@inlined
def squares_of(points: Floats, query: Floats, dof: int, block: int) -> Any:
    """Squared distances of a block of vertices from ``dof`` floats, in lanes."""
    total = spread(ZERO)
    for k in range(dof):
        gap = lanes_at(points, block * dof + k) - query[k]
        total = total + gap * gap
    return total


@kernel
def nearest_by_cost(tree: TreeTable, query: Floats, cost: float) -> Any:
    """The vertex nearest to ``DOF`` floats and a cost, as if what it costs more were one more coordinate."""
    wanted = np.float32(cost)
    least = spread(UNBOUNDED_SQUARE)
    place = spread(ZERO)
    for block in range((tree.size + WIDTH - 1) // WIDTH):
        dearer = larger(lanes_at(tree.costs, block) - wanted, ZERO)
        total = squares_of(tree.points, query, tree.dof, block) + dearer * dearer
        closer = total < least
        least = choose(closer, total, least)
        place = choose(closer, spread(np.float32(block)), place)
    vertex, _ = least_lane(least, place)
    return vertex


@kernel
def nearest_and_square(tree: TreeTable, query: Floats) -> Any:
    """The same, and the square of its distance."""
    least = spread(UNBOUNDED_SQUARE)
    place = spread(ZERO)
    for block in range((tree.size + WIDTH - 1) // WIDTH):
        total = squares_of(tree.points, query, tree.dof, block)
        closer = total < least
        least = choose(closer, total, least)
        place = choose(closer, spread(np.float32(block)), place)
    return least_lane(least, place)


@inlined
def least_lane(least: Any, place: Any) -> Any:
    """The first vertex with the least number, from the least of each lane and its block; and that number."""
    square = lowest(least)
    winners = least <= square
    lane = first_bit(bits(winners))
    if bits(winners) == 1 << lane:  # a single one
        return int(lane_at(place, lane)) * WIDTH + lane, square
    block = lowest(choose(winners, place, spread(UNBOUNDED_BLOCK)))
    return int(block) * WIDTH + first_bit(bits(winners & (place <= block))), square


@kernel
def add_vertex(tree: TreeTable, row: Configuration, values: JointValues, parent: int, state: int, radius: float) -> Any:
    """Append a vertex; there must be room. Returns its number."""
    dof = tree.dof
    vertex = tree.size
    if vertex % WIDTH == 0:  # a new block: its other lanes are far from everything
        set_lanes(tree.points, vertex // WIDTH * dof, spread(ABSENT_COORDINATE))
    copy_row(dof, row, row_of(tree, vertex))
    for k in range(dof):
        tree.points[lane_place(dof, vertex, k)] = np.float32(row[k])
    if not same_place(tree.values, tree.rows):  # joint values are not the configuration itself
        copy_row(tree.joints, values, values_of(tree, vertex))

    tree.parents[vertex] = parent
    set_state(tree, vertex, state)
    set_radius(tree, vertex, radius)
    tree.size = vertex + 1
    tree.live += 1
    return vertex


@kernel
def cut_vertex(tree: TreeTable, vertex: int) -> int:
    """Cut one vertex off, not its descendants."""
    set_state(tree, vertex, CUT)
    tree.live -= 1
    tree.points[lane_place(tree.dof, vertex, 0)] = ABSENT_COORDINATE
    return vertex


@kernel
def cut_branch(tree: TreeTable, vertex: int) -> Any:
    """Cut a vertex and all its descendants off; returns how many vertices are left."""
    if state_of(tree, vertex) != CUT:
        cut_vertex(tree, vertex)
    for later in range(vertex + 1, tree.size):
        parent = parent_of(tree, later)
        if parent >= 0 and state_of(tree, later) != CUT and state_of(tree, parent) == CUT:
            cut_vertex(tree, later)
    return tree.live


@kernel
def clear_tree(tree: TreeTable) -> int:
    """Forget all vertices."""
    tree.size = 0
    tree.live = 0
    return 0
