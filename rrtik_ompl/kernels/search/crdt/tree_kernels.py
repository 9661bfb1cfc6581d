"""C-RDT trees in kernels: float64 coordinates in runs, for the nearest vertex in a scaled metric to the bit.

A tree of RRT-Connect is another one: it is searched in float32, and keeps joint values and states of its vertices.
"""

from __future__ import annotations

from typing import Any

from rrtik_ompl.kernels.record import Doubles
from rrtik_ompl.kernels.search.crdt.layout import CrdtTreeTable
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration
from rrtik_ompl.kernels.simd.compiled import WIDTH, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import (
    choose,
    lane_numbers,
    rounded_sum,
    set_wide_lanes,
    spread_wide,
    wide_lanes_at,
)

UNBOUNDED_SQUARE = 1e300  # [squared unit of the scaled metric] more than any squared distance


@inlined
def coordinate(tree: CrdtTreeTable, vertex: int, axis: int) -> Any:
    """A coordinate of a vertex."""
    return tree.coordinates[axis * tree.capacity + vertex]


@inlined
def crdt_parent_of(tree: CrdtTreeTable, vertex: int) -> Any:
    """The parent of a vertex, ROOT for a root."""
    return tree.parents[vertex]


@inlined
def set_crdt_parent(tree: CrdtTreeTable, vertex: int, parent: int) -> None:
    """Hang a vertex on another one."""
    tree.parents[vertex] = parent


@inlined
def read_vertex(tree: CrdtTreeTable, dof: int, vertex: int, sink: Configuration) -> None:
    """Copy the coordinates of a vertex to an address."""
    for axis in range(dof):
        sink[axis] = coordinate(tree, vertex, axis)


@inlined
def add_crdt_vertex(tree: CrdtTreeTable, dof: int, row: Configuration, parent: int) -> Any:
    """Add the coordinates at an address to a tree that has room; returns the number of the vertex."""
    vertex = tree.size
    for axis in range(dof):
        tree.coordinates[axis * tree.capacity + vertex] = row[axis]
    set_crdt_parent(tree, vertex, parent)
    tree.size = vertex + 1
    return vertex


@kernel
def nearest_crdt_vertex(
    tree: CrdtTreeTable, dof: int, target: Configuration, scale: Configuration, nearest: Doubles
) -> int:
    """The vertex nearest to a target in the scaled metric; among equals the oldest. ``nearest``: two wide lanes."""
    count = tree.size
    run = tree.capacity // WIDTH  # blocks of a coordinate
    lowest = spread_wide(UNBOUNDED_SQUARE)
    holder = spread_wide(0.0)  # the vertex that has it
    for block in range((count + WIDTH - 1) // WIDTH):
        total = spread_wide(0.0)
        for axis in range(dof):
            gap = (wide_lanes_at(tree.coordinates, axis * run + block) - target[axis]) * scale[axis]
            total = rounded_sum(total, gap * gap)
        numbers = lane_numbers() + float(block * WIDTH)
        total = choose(numbers < float(count), total, spread_wide(UNBOUNDED_SQUARE))
        nearer = total < lowest
        lowest = choose(nearer, total, lowest)
        holder = choose(nearer, numbers, holder)
    set_wide_lanes(nearest, 0, lowest)
    set_wide_lanes(nearest, 1, holder)

    best = 0
    for lane in range(1, WIDTH):
        closer = nearest[lane] < nearest[best]
        if closer or (nearest[lane] == nearest[best] and nearest[WIDTH + lane] < nearest[WIDTH + best]):
            best = lane
    return int(nearest[WIDTH + best])
