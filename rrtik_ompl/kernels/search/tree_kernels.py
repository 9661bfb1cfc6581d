"""Trees of RRT-Connect in kernels: vertices in lanes for the nearest neighbour, in float64 for motions.

Vertices are counted from 0 in the order in which they came, so a parent comes before its children. A vertex that was
cut off stays in place and is never the nearest again.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from rrtik_ompl.kernels.layout import IntArray, JointValues, LaneArray
from rrtik_ompl.kernels.search import tree_layout
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration, copy_row, row_at
from rrtik_ompl.kernels.search.tree_layout import CUT, TreeTable
from rrtik_ompl.kernels.simd.access import field_reader, lane_at
from rrtik_ompl.kernels.simd.compiled import WIDTH, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import (
    bits,
    choose,
    double_at,
    first_bit,
    float_at,
    int_at,
    lanes_at,
    larger,
    lowest,
    set_field,
    set_float,
    set_int,
    set_lanes,
    spread,
)
from rrtik_ompl.kernels.tables.accessors import joint_row

ABSENT_COORDINATE = np.float32(1e15)  # [rad or m] of what is no vertex: farther than any that is one
UNBOUNDED_SQUARE = np.float32(3e38)  # [unit of the configurations, squared] more than any squared distance
UNBOUNDED_BLOCK = np.float32(3e38)  # more than the number of any block
ZERO = np.float32(0.0)


size_of: Callable[[TreeTable], int] = field_reader(tree_layout.SIZE)
capacity_of: Callable[[TreeTable], int] = field_reader(tree_layout.CAPACITY)
live_of: Callable[[TreeTable], int] = field_reader(tree_layout.LIVE)  # vertices that are not cut off
dof_of: Callable[[TreeTable], int] = field_reader(tree_layout.DOF)
joints_of: Callable[[TreeTable], int] = field_reader(tree_layout.JOINTS)
points_of: Callable[[TreeTable], LaneArray] = field_reader(tree_layout.POINTS)
rows_of: Callable[[TreeTable], Configuration] = field_reader(tree_layout.ROWS)
all_values_of: Callable[[TreeTable], JointValues] = field_reader(tree_layout.VALUES)
parents_of: Callable[[TreeTable], IntArray] = field_reader(tree_layout.PARENTS)
radii_of: Callable[[TreeTable], LaneArray] = field_reader(tree_layout.RADII)
states_of: Callable[[TreeTable], IntArray] = field_reader(tree_layout.STATES)
costs_of: Callable[[TreeTable], LaneArray] = field_reader(tree_layout.COSTS)


@inlined
def row_of(tree: TreeTable, vertex: int) -> Configuration:
    """Address of a vertex's configuration."""
    return row_at(rows_of(tree), dof_of(tree), vertex)


@inlined
def values_of(tree: TreeTable, vertex: int) -> JointValues:
    """Address of a vertex's joint values."""
    return joint_row(all_values_of(tree), joints_of(tree), vertex)


@inlined
def parent_of(tree: TreeTable, vertex: int) -> Any:
    """The parent of a vertex, -1 for a root."""
    return int_at(parents_of(tree), vertex)


@inlined
def state_of(tree: TreeTable, vertex: int) -> Any:
    """CERTAIN, OPEN or CUT."""
    return int_at(states_of(tree), vertex)


@inlined
def set_state(tree: TreeTable, vertex: int, state: int) -> None:
    """Set whether a vertex is CERTAIN, OPEN or CUT."""
    set_int(states_of(tree), vertex, state)


@inlined
def radius_of(tree: TreeTable, vertex: int) -> Any:
    """Radius of a vertex's domain [unit of the configurations]."""
    return float_at(radii_of(tree), vertex)


@inlined
def set_radius(tree: TreeTable, vertex: int, radius: float) -> None:
    """Set the radius of a vertex's domain."""
    set_float(radii_of(tree), vertex, np.float32(radius))


@inlined
def cost_of(tree: TreeTable, vertex: int) -> Any:
    """Length of the path from a root to a vertex, where it was set."""
    return float_at(costs_of(tree), vertex)


@inlined
def set_cost(tree: TreeTable, vertex: int, cost: float) -> None:
    """Set the length of the path from a root to a vertex."""
    set_float(costs_of(tree), vertex, np.float32(cost))


@inlined
def is_full(tree: TreeTable) -> Any:
    """Whether a tree has no room for one more vertex."""
    return size_of(tree) >= capacity_of(tree)


@inlined
def lane_place(dof: int, vertex: int, coordinate: int) -> Any:
    """Which of the floats in lanes is a coordinate of a vertex."""
    return (vertex // WIDTH * dof + coordinate) * WIDTH + vertex % WIDTH


@kernel
def nearest_vertex(tree: TreeTable, query: int) -> Any:
    """The vertex nearest to ``DOF`` floats; of several the first one."""
    vertex, _ = nearest_and_square(tree, query)
    return vertex


@inlined
def squares_of(points: LaneArray, query: int, dof: int, block: int) -> Any:
    """Squared distances of a block of vertices from ``dof`` floats, in lanes."""
    total = spread(ZERO)
    for k in range(dof):
        gap = lanes_at(points, block * dof + k) - float_at(query, k)
        total = total + gap * gap
    return total


@kernel
def nearest_by_cost(tree: TreeTable, query: int, cost: float) -> Any:
    """The vertex nearest to ``DOF`` floats and a cost, as if what it costs more were one more coordinate."""
    dof, points, costs, wanted = dof_of(tree), points_of(tree), costs_of(tree), np.float32(cost)
    least, place = spread(UNBOUNDED_SQUARE), spread(ZERO)
    for block in range((size_of(tree) + WIDTH - 1) // WIDTH):
        dearer = larger(lanes_at(costs, block) - wanted, ZERO)
        total = squares_of(points, query, dof, block) + dearer * dearer
        closer = total < least
        least = choose(closer, total, least)
        place = choose(closer, spread(np.float32(block)), place)
    vertex, _ = least_lane(least, place)
    return vertex


@kernel
def nearest_and_square(tree: TreeTable, query: int) -> Any:
    """The same, and the square of its distance."""
    dof, points = dof_of(tree), points_of(tree)
    least, place = spread(UNBOUNDED_SQUARE), spread(ZERO)
    for block in range((size_of(tree) + WIDTH - 1) // WIDTH):
        total = squares_of(points, query, dof, block)
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
    if bits(winners) == 1 << lane:
        return int(lane_at(place, lane)) * WIDTH + lane, square
    block = lowest(choose(winners, place, spread(UNBOUNDED_BLOCK)))
    return int(block) * WIDTH + first_bit(bits(winners & (place <= block))), square


@kernel
def add_vertex(tree: TreeTable, row: Configuration, values: JointValues, parent: int, state: int, radius: float) -> Any:
    """Append a vertex; there must be room. Returns its number."""
    dof, vertex = dof_of(tree), size_of(tree)
    points = points_of(tree)
    if vertex % WIDTH == 0:
        set_lanes(points, vertex // WIDTH * dof, spread(ABSENT_COORDINATE))
    copy_row(dof, row, row_of(tree, vertex))
    for k in range(dof):
        set_float(points, lane_place(dof, vertex, k), np.float32(double_at(row, k)))
    if int(all_values_of(tree)) != rows_of(tree):  # joint values are not the configuration itself
        copy_row(joints_of(tree), values, values_of(tree, vertex))
    set_int(parents_of(tree), vertex, parent)
    set_state(tree, vertex, state)
    set_radius(tree, vertex, radius)
    set_field(tree, tree_layout.SIZE, vertex + 1)
    set_field(tree, tree_layout.LIVE, live_of(tree) + 1)
    return vertex


@kernel
def cut_vertex(tree: TreeTable, vertex: int) -> int:
    """Cut one vertex off, not its descendants."""
    set_state(tree, vertex, CUT)
    set_field(tree, tree_layout.LIVE, live_of(tree) - 1)
    set_float(points_of(tree), lane_place(dof_of(tree), vertex, 0), ABSENT_COORDINATE)
    return vertex


@kernel
def cut_branch(tree: TreeTable, vertex: int) -> Any:
    """Cut a vertex and all its descendants off; returns how many vertices are left."""
    if state_of(tree, vertex) != CUT:
        cut_vertex(tree, vertex)
    for later in range(vertex + 1, size_of(tree)):
        parent = parent_of(tree, later)
        if parent >= 0 and state_of(tree, later) != CUT and state_of(tree, parent) == CUT:
            cut_vertex(tree, later)
    return live_of(tree)


@kernel
def clear_tree(tree: TreeTable) -> int:
    """Forget all vertices."""
    set_field(tree, tree_layout.SIZE, 0)
    set_field(tree, tree_layout.LIVE, 0)
    return 0
