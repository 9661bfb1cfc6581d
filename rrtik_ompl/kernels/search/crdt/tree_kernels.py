"""C-RDT trees in kernels: float64 coordinates in runs, for the nearest vertex in a scaled metric to the bit.

A tree of RRT-Connect is another one: it is searched in float32, and keeps joint values and states of its vertices.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rrtik_ompl.kernels.layout import DoubleArray, IntArray
from rrtik_ompl.kernels.search.crdt import layout as crdt_layout
from rrtik_ompl.kernels.search.crdt.layout import CrdtTreeTable
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration
from rrtik_ompl.kernels.simd.access import field_reader
from rrtik_ompl.kernels.simd.compiled import WIDTH, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import (
    choose,
    double_at,
    int_at,
    lane_numbers,
    rounded_sum,
    set_double,
    set_field,
    set_int,
    set_wide_lanes,
    spread_wide,
    wide_lanes_at,
)

UNBOUNDED_SQUARE = 1e300  # [squared unit of the scaled metric] more than any squared distance


size_of: Callable[[CrdtTreeTable], int] = field_reader(crdt_layout.SIZE)
capacity_of: Callable[[CrdtTreeTable], int] = field_reader(crdt_layout.CAPACITY)
coordinates_of: Callable[[CrdtTreeTable], DoubleArray] = field_reader(crdt_layout.COORDINATES)
parents_of: Callable[[CrdtTreeTable], IntArray] = field_reader(crdt_layout.PARENTS)


@inlined
def coordinate(tree: CrdtTreeTable, vertex: int, axis: int) -> Any:
    """A coordinate of a vertex."""
    return double_at(coordinates_of(tree), axis * capacity_of(tree) + vertex)


@inlined
def crdt_parent_of(tree: CrdtTreeTable, vertex: int) -> Any:
    """The parent of a vertex, ROOT for a root."""
    return int_at(parents_of(tree), vertex)


@inlined
def set_crdt_parent(tree: CrdtTreeTable, vertex: int, parent: int) -> None:
    """Hang a vertex on another one."""
    set_int(parents_of(tree), vertex, parent)


@inlined
def read_vertex(tree: CrdtTreeTable, dof: int, vertex: int, sink: Configuration) -> None:
    """Copy the coordinates of a vertex to an address."""
    for axis in range(dof):
        set_double(sink, axis, coordinate(tree, vertex, axis))


@inlined
def add_crdt_vertex(tree: CrdtTreeTable, dof: int, row: Configuration, parent: int) -> Any:
    """Add the coordinates at an address to a tree that has room; returns the number of the vertex."""
    vertex, coordinates = size_of(tree), coordinates_of(tree)
    for axis in range(dof):
        set_double(coordinates, axis * capacity_of(tree) + vertex, double_at(row, axis))
    set_crdt_parent(tree, vertex, parent)
    set_field(tree, crdt_layout.SIZE, vertex + 1)
    return vertex


@kernel
def nearest_crdt_vertex(
    tree: CrdtTreeTable, dof: int, target: Configuration, scale: Configuration, nearest: DoubleArray
) -> int:
    """The vertex nearest to a target in the scaled metric; among equals the oldest. ``nearest``: two wide lanes."""
    coordinates = coordinates_of(tree)
    count, run = size_of(tree), capacity_of(tree) // WIDTH
    lowest, holder = spread_wide(UNBOUNDED_SQUARE), spread_wide(0.0)
    for block in range((count + WIDTH - 1) // WIDTH):
        total = spread_wide(0.0)
        for axis in range(dof):
            gap = (wide_lanes_at(coordinates, axis * run + block) - double_at(target, axis)) * double_at(scale, axis)
            total = rounded_sum(total, gap * gap)
        numbers = lane_numbers() + float(block * WIDTH)
        total = choose(numbers < float(count), total, spread_wide(UNBOUNDED_SQUARE))
        nearer = total < lowest
        lowest, holder = choose(nearer, total, lowest), choose(nearer, numbers, holder)
    set_wide_lanes(nearest, 0, lowest)
    set_wide_lanes(nearest, 1, holder)
    best = 0
    for lane in range(1, WIDTH):
        a, b = double_at(nearest, lane), double_at(nearest, best)
        if a < b or (a == b and double_at(nearest, WIDTH + lane) < double_at(nearest, WIDTH + best)):
            best = lane
    return int(double_at(nearest, WIDTH + best))
