"""Trees of RRT-Connect in kernels: vertices in lanes for the nearest neighbour, in float64 for motions.

Vertices are counted from 0 in the order in which they came, so a parent comes before its children. A vertex that was
cut off stays in place and is never the nearest again.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rrtik_ompl.fast.search.motions.row_kernels import Configuration, JointValues, copy_row, row_at
from rrtik_ompl.fast.search.tree_layout import (
    CAPACITY,
    CUT,
    DOF,
    JOINTS,
    LIVE,
    PARENTS,
    POINTS,
    RADII,
    ROWS,
    SIZE,
    STATES,
    VALUES,
    TreeTable,
)
from rrtik_ompl.fast.simd.compiled import WIDTH, inlined, kernel
from rrtik_ompl.fast.simd.lanes import (
    bits,
    choose,
    double_at,
    field,
    first_bit,
    float_at,
    int_at,
    lanes_at,
    lowest,
    set_field,
    set_float,
    set_int,
    set_lanes,
    spread,
)

ABSENT_COORDINATE = np.float32(1e15)  # [rad or m] of what is no vertex: farther than any that is one
UNBOUNDED_SQUARE = np.float32(3e38)  # [unit of the configurations, squared] more than any squared distance
UNBOUNDED_BLOCK = np.float32(3e38)  # more than the number of any block
ZERO = np.float32(0.0)


@inlined
def row_of(tree: TreeTable, vertex: int) -> Any:
    """Address of a vertex's configuration."""
    return row_at(field(tree, ROWS), field(tree, DOF), vertex)


@inlined
def values_of(tree: TreeTable, vertex: int) -> Any:
    """Address of a vertex's joint values."""
    return row_at(field(tree, VALUES), field(tree, JOINTS), vertex)


@inlined
def parent_of(tree: TreeTable, vertex: int) -> Any:
    """The parent of a vertex, -1 for a root."""
    return int_at(field(tree, PARENTS), vertex)


@inlined
def state_of(tree: TreeTable, vertex: int) -> Any:
    """CERTAIN, OPEN or CUT."""
    return int_at(field(tree, STATES), vertex)


@inlined
def set_state(tree: TreeTable, vertex: int, state: int) -> None:
    """Set whether a vertex is CERTAIN, OPEN or CUT."""
    set_int(field(tree, STATES), vertex, state)


@inlined
def radius_of(tree: TreeTable, vertex: int) -> Any:
    """Radius of a vertex's domain [unit of the configurations]."""
    return float_at(field(tree, RADII), vertex)


@inlined
def set_radius(tree: TreeTable, vertex: int, radius: float) -> None:
    """Set the radius of a vertex's domain."""
    set_float(field(tree, RADII), vertex, np.float32(radius))


@inlined
def live_of(tree: TreeTable) -> Any:
    """How many vertices are not cut off."""
    return field(tree, LIVE)


@inlined
def is_full(tree: TreeTable) -> Any:
    """Whether a tree has no room for one more vertex."""
    return field(tree, SIZE) >= field(tree, CAPACITY)


@inlined
def lane_place(dof: int, vertex: int, coordinate: int) -> Any:
    """Which of the floats in lanes is a coordinate of a vertex."""
    return (vertex // WIDTH * dof + coordinate) * WIDTH + vertex % WIDTH


@kernel
def nearest_vertex(tree: TreeTable, query: int) -> Any:
    """The vertex nearest to ``DOF`` floats; of several the first one."""
    dof, points = field(tree, DOF), field(tree, POINTS)
    least, place = spread(UNBOUNDED_SQUARE), spread(ZERO)
    for block in range((field(tree, SIZE) + WIDTH - 1) // WIDTH):
        total = spread(ZERO)
        for k in range(dof):
            gap = lanes_at(points, block * dof + k) - float_at(query, k)
            total = total + gap * gap
        closer = total < least
        least = choose(closer, total, least)
        place = choose(closer, spread(np.float32(block)), place)
    winners = least <= lowest(least)
    block = lowest(choose(winners, place, spread(UNBOUNDED_BLOCK)))
    return int(block) * WIDTH + first_bit(bits(winners & (place <= block)))


@kernel
def add_vertex(tree: TreeTable, row: Configuration, values: JointValues, parent: int, state: int, radius: float) -> Any:
    """Append a vertex; there must be room. Returns its number."""
    dof, vertex = field(tree, DOF), field(tree, SIZE)
    points = field(tree, POINTS)
    if vertex % WIDTH == 0:
        set_lanes(points, vertex // WIDTH * dof, spread(ABSENT_COORDINATE))
    copy_row(dof, row, row_of(tree, vertex))
    for k in range(dof):
        set_float(points, lane_place(dof, vertex, k), np.float32(double_at(row, k)))
    if field(tree, VALUES) != field(tree, ROWS):
        copy_row(field(tree, JOINTS), values, values_of(tree, vertex))
    set_int(field(tree, PARENTS), vertex, parent)
    set_state(tree, vertex, state)
    set_radius(tree, vertex, radius)
    set_field(tree, SIZE, vertex + 1)
    set_field(tree, LIVE, field(tree, LIVE) + 1)
    return vertex


@kernel
def cut_vertex(tree: TreeTable, vertex: int) -> int:
    """Cut one vertex off, not its descendants."""
    set_state(tree, vertex, CUT)
    set_field(tree, LIVE, field(tree, LIVE) - 1)
    set_float(field(tree, POINTS), lane_place(field(tree, DOF), vertex, 0), ABSENT_COORDINATE)
    return vertex


@kernel
def cut_branch(tree: TreeTable, vertex: int) -> Any:
    """Cut a vertex and all its descendants off; returns how many vertices are left."""
    if state_of(tree, vertex) != CUT:
        cut_vertex(tree, vertex)
    for later in range(vertex + 1, field(tree, SIZE)):
        parent = parent_of(tree, later)
        if parent >= 0 and state_of(tree, later) != CUT and state_of(tree, parent) == CUT:
            cut_vertex(tree, later)
    return field(tree, LIVE)


@kernel
def clear_tree(tree: TreeTable) -> int:
    """Forget all vertices."""
    set_field(tree, SIZE, 0)
    set_field(tree, LIVE, 0)
    return 0
