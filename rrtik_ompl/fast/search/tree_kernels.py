"""Search trees for kernels: vertices in lanes for the nearest neighbour, and in float64 for the motions between them.

Vertices are counted from 0 in the order in which they came, so a parent comes before its children. A vertex that was
cut off stays in place and is never the nearest again.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rrtik_ompl.fast.search.tree_layout import (
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
    set_double,
    set_field,
    set_float,
    set_int,
    set_lanes,
    spread,
)

FAR = np.float32(1e15)  # a coordinate of what is no vertex
ZERO, FARTHEST, LAST_BLOCK = np.float32(0.0), np.float32(3e38), np.float32(3e38)


@inlined
def row_of(tree: int, vertex: int) -> Any:
    """Address of a vertex's configuration."""
    return field(tree, ROWS) + 8 * field(tree, DOF) * vertex


@inlined
def values_of(tree: int, vertex: int) -> Any:
    """Address of a vertex's joint values."""
    return field(tree, VALUES) + 8 * field(tree, JOINTS) * vertex


@inlined
def parent_of(tree: int, vertex: int) -> Any:
    """The parent of a vertex, -1 for a root."""
    return int_at(field(tree, PARENTS), vertex)


@inlined
def state_of(tree: int, vertex: int) -> Any:
    """CERTAIN, OPEN or CUT."""
    return int_at(field(tree, STATES), vertex)


@kernel
def nearest_vertex(tree: int, query: int) -> Any:
    """The vertex nearest to ``DOF`` floats; of several the first one."""
    dof, points = field(tree, DOF), field(tree, POINTS)
    least, place = spread(FARTHEST), spread(ZERO)
    for block in range((field(tree, SIZE) + WIDTH - 1) // WIDTH):
        total = spread(ZERO)
        for k in range(dof):
            gap = lanes_at(points, block * dof + k) - float_at(query, k)
            total = total + gap * gap
        closer = total < least
        least = choose(closer, total, least)
        place = choose(closer, spread(np.float32(block)), place)
    winners = least <= lowest(least)
    block = lowest(choose(winners, place, spread(LAST_BLOCK)))
    return int(block) * WIDTH + first_bit(bits(winners & (place <= block)))


@kernel
def add_vertex(tree: int, row: int, values: int, parent: int, state: int, radius: float) -> Any:
    """Append a vertex; there must be room. Returns its number."""
    dof, vertex = field(tree, DOF), field(tree, SIZE)
    block, lane = vertex // WIDTH, vertex % WIDTH
    points = field(tree, POINTS)
    if lane == 0:
        set_lanes(points, block * dof, spread(FAR))
    for k in range(dof):
        set_double(row_of(tree, vertex), k, double_at(row, k))
        set_float(points, (block * dof + k) * WIDTH + lane, np.float32(double_at(row, k)))
    if field(tree, VALUES) != field(tree, ROWS):
        for k in range(field(tree, JOINTS)):
            set_double(values_of(tree, vertex), k, double_at(values, k))
    set_int(field(tree, PARENTS), vertex, parent)
    set_int(field(tree, STATES), vertex, state)
    set_float(field(tree, RADII), vertex, np.float32(radius))
    set_field(tree, SIZE, vertex + 1)
    set_field(tree, LIVE, field(tree, LIVE) + 1)
    return vertex


@kernel
def cut_vertex(tree: int, vertex: int) -> int:
    """Cut one vertex off, not its descendants."""
    set_int(field(tree, STATES), vertex, CUT)
    set_field(tree, LIVE, field(tree, LIVE) - 1)
    place = vertex // WIDTH * field(tree, DOF) * WIDTH + vertex % WIDTH
    set_float(field(tree, POINTS), place, FAR)
    return vertex


@kernel
def cut_branch(tree: int, vertex: int) -> Any:
    """Cut a vertex and all its descendants off; returns how many vertices are left."""
    if state_of(tree, vertex) != CUT:
        cut_vertex(tree, vertex)
    for later in range(vertex + 1, field(tree, SIZE)):
        parent = parent_of(tree, later)
        if parent >= 0 and state_of(tree, later) != CUT and state_of(tree, parent) == CUT:
            cut_vertex(tree, later)
    return field(tree, LIVE)


@kernel
def clear_tree(tree: int) -> int:
    """Forget all vertices."""
    set_field(tree, SIZE, 0)
    set_field(tree, LIVE, 0)
    return 0
