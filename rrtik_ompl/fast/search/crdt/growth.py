"""Kernels that lay out, check and keep an extension of a C-RDT tree.

The rules are those of the planners' own ``AxisTree``. Source: the C-RDT paper, EXTEND and REWRITE.
"""

from __future__ import annotations

from typing import Any

from rrtik_ompl.fast.checks.motion_kernels import check_motion, copy_row, travel, whole_steps
from rrtik_ompl.fast.search.crdt import layout as table
from rrtik_ompl.fast.search.crdt.draws import draw, shuffle, to_front
from rrtik_ompl.fast.simd.compiled import WIDTH, inlined, kernel
from rrtik_ompl.fast.simd.lanes import (
    choose,
    double_at,
    field,
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
from rrtik_ompl.fast.tables.layout import COLLIDING, FREE, UNDECIDED

FARTHEST = 1e300


@inlined
def coordinate(tree: int, vertex: int, axis: int) -> Any:
    """A coordinate of a vertex."""
    return double_at(field(tree, table.COORDINATES), axis * field(tree, table.CAPACITY) + vertex)


@inlined
def read_vertex(search: int, tree: int, vertex: int, sink: int) -> None:
    """Copy the coordinates of a vertex to an address."""
    for axis in range(field(search, table.DOF)):
        set_double(sink, axis, coordinate(tree, vertex, axis))


@inlined
def add_vertex(search: int, tree: int, row: int, parent: int) -> Any:
    """Add the coordinates at an address to a tree that has room; returns the number of the vertex."""
    vertex = field(tree, table.SIZE)
    for axis in range(field(search, table.DOF)):
        set_double(field(tree, table.COORDINATES), axis * field(tree, table.CAPACITY) + vertex, double_at(row, axis))
    set_int(field(tree, table.PARENTS), vertex, parent)
    set_field(tree, table.SIZE, vertex + 1)
    return vertex


@kernel
def nearest_vertex(search: int, tree: int) -> int:
    """The vertex nearest to the target in the scaled metric; among equals the oldest."""
    target, scale, coordinates = field(search, table.TARGET), field(search, table.SCALE), field(tree, table.COORDINATES)
    count, run = field(tree, table.SIZE), field(tree, table.CAPACITY) // WIDTH
    lowest, holder = spread_wide(FARTHEST), spread_wide(0.0)
    for block in range((count + WIDTH - 1) // WIDTH):
        total = spread_wide(0.0)
        for axis in range(field(search, table.DOF)):
            way = (wide_lanes_at(coordinates, axis * run + block) - double_at(target, axis)) * double_at(scale, axis)
            total = rounded_sum(total, way * way)
        numbers = lane_numbers() + float(block * WIDTH)
        total = choose(numbers < float(count), total, spread_wide(FARTHEST))
        nearer = total < lowest
        lowest, holder = choose(nearer, total, lowest), choose(nearer, numbers, holder)
    distances = field(search, table.DISTANCES)
    set_wide_lanes(distances, 0, lowest)
    set_wide_lanes(distances, 1, holder)
    best = 0
    for lane in range(1, WIDTH):
        a, b = double_at(distances, lane), double_at(distances, best)
        if a < b or (a == b and double_at(distances, WIDTH + lane) < double_at(distances, WIDTH + best)):
            best = lane
    return int(double_at(distances, WIDTH + best))


@inlined
def hold(search: int, tree: int, near: int) -> None:
    """Let each coordinate of the target stay as it is at a vertex if it does not take part this time."""
    for axis in range(field(search, table.DOF)):
        chance = double_at(field(search, table.CHANCE), axis)
        if chance < 1.0 and draw(search) >= chance:
            set_double(field(search, table.TARGET), axis, coordinate(tree, near, axis))


@inlined
def remembered_axis(search: int, tree: int, vertex: int, parent: int) -> int:
    """The axis of the edge that leads to a vertex."""
    axis = 0
    while axis < field(search, table.DOF) - 1 and coordinate(tree, vertex, axis) == coordinate(tree, parent, axis):
        axis += 1
    return axis


@kernel
def add_edge(search: int, axis: int, start: Any, end: Any) -> None:
    """Put an edge along an axis through the current row on the list."""
    count, dof, current = field(search, table.EDGE_COUNT), field(search, table.DOF), field(search, table.CURRENT)
    first, second = field(search, table.STARTS) + 8 * dof * count, field(search, table.ENDS) + 8 * dof * count
    copy_row(dof, current, first)
    copy_row(dof, current, second)
    set_double(first, axis, start)
    set_double(second, axis, end)
    set_field(search, table.EDGE_COUNT, count + 1)


@inlined
def turning(came_from: Any, here: Any, there: Any) -> int:
    """How a leg from ``here`` to ``there`` goes on after a move that came from ``came_from``."""
    if here == came_from or (here - came_from) * (there - here) > 0.0:
        return table.ONWARD
    beyond = there - came_from
    if beyond == 0.0:
        return table.BACK
    return table.BETWEEN if (here - came_from) * beyond > 0.0 else table.BEYOND


@inlined
def shortest_piece(turn: int, came_from: Any, here: Any, there: Any) -> Any:
    """Length of the shortest edge that a leg would leave in the tree."""
    length = abs(there - here)
    return min(length, abs(there - came_from)) if turn in (table.BETWEEN, table.BEYOND) else length


@kernel
def aim(search: int, tree: int, near: int, exactly: bool) -> None:
    """Lay out the way from a vertex to the target, one axis after the other: the axis that led to the vertex first.

    A leg shorter than the smallest move ends the way; towards a target that need not be met exactly it is left out.
    """
    parent, current = int_at(field(tree, table.PARENTS), near), field(search, table.CURRENT)
    if not exactly:
        hold(search, tree, near)
    shuffle(search)
    if parent != table.ROOT:  # a root has no direction to remember
        to_front(search, remembered_axis(search, tree, near, parent))
    read_vertex(search, tree, near, current)
    set_field(search, table.NEAR, near)
    set_field(search, table.TURN, table.ONWARD)
    set_field(search, table.FIRST_EDGES, 0)
    set_field(search, table.EDGE_COUNT, 0)
    set_field(search, table.COMPLETE, 1)
    legs = 0
    for k in range(field(search, table.AXIS_COUNT)):
        axis = int_at(field(search, table.ORDER), k)
        here, there = double_at(current, axis), double_at(field(search, table.TARGET), axis)
        came_from = here if legs > 0 or parent == table.ROOT else coordinate(tree, parent, axis)
        turn = turning(came_from, here, there)
        if here == there:
            continue
        if shortest_piece(turn, came_from, here, there) < double_at(field(search, table.SMALLEST_MOVE), axis):
            if exactly:
                set_field(search, table.COMPLETE, 0)
                break
            continue
        if turn in (table.ONWARD, table.BETWEEN):
            add_edge(search, axis, here, there)
        if turn in (table.BETWEEN, table.BEYOND):  # the edge to the vertex is split, or left out: the way has no turn
            add_edge(search, axis, came_from, there)
        if legs == 0:
            set_field(search, table.TURN, turn)
            set_field(search, table.FIRST_EDGES, field(search, table.EDGE_COUNT))
        set_double(current, axis, there)
        legs += 1


@kernel
def check_edge(search: int, start: int, end: int) -> int:
    """Check the motion between two configurations by the same configurations as the world, whatever its direction."""
    dof = field(search, table.DOF)
    for axis in range(dof):
        a, b = double_at(start, axis), double_at(end, axis)
        least, most = double_at(field(search, table.LEAST), axis), double_at(field(search, table.MOST), axis)
        if min(a, b) < least or max(a, b) > most:
            return COLLIDING
    way = travel(dof, field(search, table.WEIGHTS), start, end)
    steps = whole_steps(way / double_at(field(search, table.NUMBERS), table.RESOLUTION))
    world, gain, offset = field(search, table.WORLD), field(search, table.GAIN), field(search, table.OFFSET)
    resolve = field(search, table.ASKS) != 0
    answer: int = check_motion(world, dof, gain, offset, start, end, steps, field(search, table.VALUES), resolve)
    return answer


@kernel
def open_edges(search: int) -> int:
    """Check the edges of the extension up to the first that is not free; returns how many want an answer."""
    stride, count, open_ = 8 * field(search, table.DOF), field(search, table.EDGE_COUNT), 0
    for edge in range(count):
        verdict = check_edge(
            search, field(search, table.STARTS) + edge * stride, field(search, table.ENDS) + edge * stride
        )
        if verdict == UNDECIDED:
            verdict = UNDECIDED if field(search, table.ASKS) != 0 else COLLIDING
            open_ += 1 if field(search, table.ASKS) != 0 else 0
        set_int(field(search, table.VERDICTS), edge, verdict)
        if verdict == COLLIDING:
            set_field(search, table.EDGE_COUNT, edge + 1)
            break
    return open_


@kernel
def keep(search: int, tree: int) -> int:
    """Add the free leading part of the extension to the tree; returns what was achieved."""
    count, first, near = field(search, table.EDGE_COUNT), field(search, table.FIRST_EDGES), field(search, table.NEAR)
    stride, turn, known = 8 * field(search, table.DOF), field(search, table.TURN), field(tree, table.SIZE)
    free = 0
    while free < count and int_at(field(search, table.VERDICTS), free) == FREE:
        free += 1
    set_field(search, table.MOTIONS, field(search, table.MOTIONS) + min(free + 1, count))
    vertex = near
    if free >= first:
        parent = int_at(field(tree, table.PARENTS), near)
        if turn == table.BACK:
            vertex = parent
        elif first > 0:
            row = field(search, table.ENDS)
            vertex = add_vertex(search, tree, row, near if turn == table.ONWARD else parent)
            if turn == table.BETWEEN:
                set_int(field(tree, table.PARENTS), near, vertex)
        for edge in range(first, free):
            vertex = add_vertex(search, tree, field(search, table.ENDS) + edge * stride, vertex)
    set_field(search, table.LAST, vertex)
    if free == count and field(search, table.COMPLETE) != 0:
        return table.REACHED
    return table.TRAPPED if field(tree, table.SIZE) == known else table.ADVANCED
