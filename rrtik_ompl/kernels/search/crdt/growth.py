"""Kernels that lay out, check and keep an extension of a C-RDT tree.

The rules are those of the planners' own ``CrdtTree``. Source: [1, ch. 6.3, algorithms 9 to 11], EXTEND and REWRITE.
"""

from __future__ import annotations

from typing import Any

from rrtik_ompl.kernels.layout import COLLIDING, FREE, UNDECIDED
from rrtik_ompl.kernels.search.crdt import layout as crdt_layout
from rrtik_ompl.kernels.search.crdt.accessors import (
    dof_in,
    edge_end,
    edge_start,
    extension_row,
    rule_of,
)
from rrtik_ompl.kernels.search.crdt.draws import draw, shuffle, to_front
from rrtik_ompl.kernels.search.crdt.layout import BACK, BETWEEN, BEYOND, ONWARD, CrdtTable, CrdtTreeTable
from rrtik_ompl.kernels.search.crdt.tree_kernels import (
    add_crdt_vertex,
    coordinate,
    crdt_parent_of,
    read_vertex,
    set_crdt_parent,
)
from rrtik_ompl.kernels.search.motions.motion_kernels import check_motion, resolves
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration, copy_row
from rrtik_ompl.kernels.simd.compiled import inlined, kernel


@inlined
def hold_idle_axes(search: CrdtTable, tree: CrdtTreeTable, near: int) -> None:
    """Let each coordinate of the target stay as it is at a vertex if it does not take part this time."""
    for axis in range(dof_in(search)):
        chance = rule_of(search, crdt_layout.CHANCE, axis)
        if chance < 1.0 and draw(search) >= chance:
            extension_row(search, crdt_layout.TARGET)[axis] = coordinate(tree, near, axis)


@inlined
def remembered_axis(search: CrdtTable, tree: CrdtTreeTable, vertex: int, parent: int) -> int:
    """The axis of the edge that leads to a vertex."""
    axis = 0
    while axis < dof_in(search) - 1 and coordinate(tree, vertex, axis) == coordinate(tree, parent, axis):
        axis += 1
    return axis


@kernel
def add_edge(search: CrdtTable, axis: int, start: Any, end: Any) -> None:
    """Put an edge along an axis through the current row on the list."""
    count, dof = search.edge_count, dof_in(search)
    current = extension_row(search, crdt_layout.CURRENT)
    first, second = edge_start(search, count), edge_end(search, count)
    copy_row(dof, current, first)
    copy_row(dof, current, second)
    first[axis] = start
    second[axis] = end
    search.edge_count += 1


@inlined
def turning(came_from: Any, here: Any, there: Any) -> int:
    """How a leg from ``here`` to ``there`` goes on after a move that came from ``came_from``."""
    if here == came_from or (here - came_from) * (there - here) > 0.0:
        return ONWARD
    beyond = there - came_from
    if beyond == 0.0:
        return BACK
    return BETWEEN if (here - came_from) * beyond > 0.0 else BEYOND


@inlined
def shortest_piece(turn: int, came_from: Any, here: Any, there: Any) -> Any:
    """Length of the shortest edge that a leg would leave in the tree."""
    length = abs(there - here)
    return min(length, abs(there - came_from)) if turn in (BETWEEN, BEYOND) else length


@kernel
def lay_out(search: CrdtTable, tree: CrdtTreeTable, near: int, exactly: bool) -> None:
    """Lay out an extension from a vertex to the target, axis after axis, first the one that led to the vertex.

    A leg shorter than the smallest move ends the extension; if the target need not be met exactly, it is left out.
    """
    parent, current = crdt_parent_of(tree, near), extension_row(search, crdt_layout.CURRENT)
    if not exactly:
        hold_idle_axes(search, tree, near)
    shuffle(search)
    if parent != crdt_layout.ROOT:  # a root has no direction to remember
        to_front(search, remembered_axis(search, tree, near, parent))
    read_vertex(tree, dof_in(search), near, current)
    search.near = near
    search.turn = ONWARD
    search.first_edges = 0
    search.edge_count = 0
    search.complete = 1
    legs = 0
    for k in range(search.axis_count):
        axis = search.order[k]
        here, there = current[axis], extension_row(search, crdt_layout.TARGET)[axis]
        came_from = here if legs > 0 or parent == crdt_layout.ROOT else coordinate(tree, parent, axis)
        turn = turning(came_from, here, there)
        if here == there:
            continue
        if shortest_piece(turn, came_from, here, there) < rule_of(search, crdt_layout.SMALLEST_MOVE, axis):
            if exactly:
                search.complete = 0
                break
            continue
        if turn in (ONWARD, BETWEEN):
            add_edge(search, axis, here, there)
        if turn in (BETWEEN, BEYOND):  # the edge to the vertex is split, or left out
            add_edge(search, axis, came_from, there)
        if legs == 0:
            search.turn = turn
            search.first_edges = search.edge_count
        current[axis] = there
        legs += 1


@kernel
def check_edge(search: CrdtTable, start: Configuration, end: Configuration) -> int:
    """Check the motion between two configurations as the world does, whatever its direction."""
    for axis in range(dof_in(search)):
        a, b = start[axis], end[axis]
        lower, upper = rule_of(search, crdt_layout.LIMIT_LOWER, axis), rule_of(search, crdt_layout.LIMIT_UPPER, axis)
        if min(a, b) < lower or max(a, b) > upper:
            return COLLIDING
    motions = search.motions
    answer: int = check_motion(motions, start, end, resolves(motions))
    return answer


@kernel
def check_extension(search: CrdtTable) -> int:
    """Check the edges of the extension up to the first that is not free; returns how many want an answer."""
    count, open_, resolve = search.edge_count, 0, resolves(search.motions)
    for edge in range(count):
        verdict = check_edge(search, edge_start(search, edge), edge_end(search, edge))
        if verdict == UNDECIDED:
            verdict = UNDECIDED if resolve else COLLIDING
            open_ += 1 if resolve else 0
        search.verdicts[edge] = verdict
        if verdict == COLLIDING:
            search.edge_count = edge + 1
            break
    return open_


@inlined
def count_free(search: CrdtTable) -> int:
    """How many edges at the beginning of the extension are free."""
    free = 0
    while free < search.edge_count and search.verdicts[free] == FREE:
        free += 1
    return free


@kernel
def add_free_edges(search: CrdtTable, tree: CrdtTreeTable) -> int:
    """Add the free leading part of the extension to the tree; returns what was achieved."""
    count, first = search.edge_count, search.first_edges
    near, turn = search.near, search.turn
    dof, known, free = dof_in(search), tree.size, count_free(search)
    search.checked += min(free + 1, count)
    vertex = near
    if free >= first:
        parent = crdt_parent_of(tree, near)
        if turn == BACK:
            vertex = parent
        elif first > 0:
            vertex = add_crdt_vertex(tree, dof, edge_end(search, 0), near if turn == ONWARD else parent)
            if turn == BETWEEN:
                set_crdt_parent(tree, near, vertex)
        for edge in range(first, free):
            vertex = add_crdt_vertex(tree, dof, edge_end(search, edge), vertex)
    search.last = vertex
    if free == count and search.complete != 0:
        return crdt_layout.REACHED
    return crdt_layout.TRAPPED if tree.size == known else crdt_layout.ADVANCED
