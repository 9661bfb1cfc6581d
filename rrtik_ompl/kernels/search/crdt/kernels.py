"""Searches in kernels with C-RDT trees. Source: [1, ch. 6.3, algorithms 9 to 11].

A search finds the same path to the bit as the one in Python, with the same random stream. It stops and goes on where it
was: all that it remembers is in its table, and how far it runs at a time changes nothing. The rules of an extension
are those of the planners' own ``CrdtTree``: EXTEND and REWRITE.
"""

from __future__ import annotations

from typing import Any

from rrtik_ompl.kernels.layout import COLLIDING, FREE, UNDECIDED
from rrtik_ompl.kernels.search.crdt import layout as crdt_layout
from rrtik_ompl.kernels.search.crdt.layout import BACK, BETWEEN, BEYOND, ONWARD, CrdtTable, CrdtTreeTable
from rrtik_ompl.kernels.search.crdt.tree_kernels import (
    add_crdt_vertex,
    coordinate,
    crdt_parent_of,
    nearest_crdt_vertex,
    read_vertex,
    set_crdt_parent,
)
from rrtik_ompl.kernels.search.motions.motion_kernels import check_motion, resolves
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration, copy_row, row_at
from rrtik_ompl.kernels.simd.compiled import entry, inlined, kernel
from rrtik_ompl.kernels.simd.random_kernels import next_share

# What Python calls.


@entry
def resume_pair(search: CrdtTable, budget: int) -> int:
    """Go on with two trees that grow in turn, for at most ``budget`` iterations. Returns a status.

    ASKING: the edges whose verdict is UNDECIDED want an answer. FULL: both trees want more room.
    """
    done = 0
    while True:
        growing = tree_of(search, search.growing)
        other = tree_of(search, 1 - search.growing)
        step = search.next
        if step == crdt_layout.BEGIN:
            if search.iterations >= search.iteration_limit:
                return crdt_layout.EXHAUSTED
            if done >= budget:
                return crdt_layout.RUNNING
            if not (has_room(search, growing) and has_room(search, other)):
                return crdt_layout.FULL
            done += 1
            search.iterations += 1
            sample(search)
            tree = growing
            exactly = False
            step = crdt_layout.GROW
        elif step == crdt_layout.GROW:
            if add_free_edges(search, growing) == crdt_layout.TRAPPED:
                swap(search)
                continue
            search.met = search.last
            read_vertex(growing, dof_in(search), search.last, extension_row(search, crdt_layout.TARGET))
            tree = other
            exactly = True
            step = crdt_layout.MEET
        else:
            outcome = add_free_edges(search, other)
            swap(search)
            if outcome == crdt_layout.REACHED:
                return crdt_layout.SOLVED
            continue

        lay_out(search, tree, nearest_to_target(search, tree), exactly)
        search.next = step
        if check_extension(search) > 0:
            return crdt_layout.ASKING


@inlined
def swap(search: CrdtTable) -> None:
    """Let the other tree grow."""
    search.growing = 1 - search.growing
    search.next = crdt_layout.BEGIN


@entry
def resume_single(search: CrdtTable, budget: int) -> int:
    """Go on with one tree whose vertices near a goal try to reach it; else as :func:`resume_pair`."""
    tree = tree_of(search, 0)
    done = 0
    while True:
        step = search.next
        if step == crdt_layout.GROW:
            add_free_edges(search, tree)
            search.vertex_end = tree.size
            search.next = crdt_layout.CHOOSE_GOAL
            continue
        if step == crdt_layout.REACH_GOAL:
            search.next = crdt_layout.CHOOSE_GOAL
            search.goal += 1
            if add_free_edges(search, tree) == crdt_layout.REACHED:
                return crdt_layout.SOLVED
            continue
        if step == crdt_layout.CHOOSE_GOAL and not choose_goal(search, tree):
            search.next = crdt_layout.BEGIN
            continue

        if step == crdt_layout.BEGIN and search.iterations >= search.iteration_limit:
            return crdt_layout.EXHAUSTED
        if step == crdt_layout.BEGIN and done >= budget:
            return crdt_layout.RUNNING
        if not has_room(search, tree):
            return crdt_layout.FULL

        if step == crdt_layout.BEGIN:
            done += 1
            search.iterations += 1
            search.vertex = tree.size
            search.goal = 0
            sample(search)
            near = nearest_to_target(search, tree)
            next_step = crdt_layout.GROW
        else:
            copy_row(dof_in(search), goal_row(search, search.goal), extension_row(search, crdt_layout.TARGET))
            near = search.vertex
            next_step = crdt_layout.REACH_GOAL

        lay_out(search, tree, near, next_step == crdt_layout.REACH_GOAL)
        search.next = next_step
        if check_extension(search) > 0:
            return crdt_layout.ASKING


@inlined
def choose_goal(search: CrdtTable, tree: CrdtTreeTable) -> bool:
    """Go on to the next vertex and goal that are near each other; False if there are none."""
    while search.vertex < search.vertex_end:
        while search.goal < search.goal_count:
            if goal_in_reach(search, tree, search.vertex, search.goal):
                return True
            search.goal += 1
        search.vertex += 1
        search.goal = 0
    return False


@inlined
def goal_in_reach(search: CrdtTable, tree: CrdtTreeTable, vertex: int, goal: int) -> Any:
    """Whether a goal lies within the tolerance around a vertex."""
    total = 0.0
    for axis in range(dof_in(search)):
        gap = goal_row(search, goal)[axis] - coordinate(tree, vertex, axis)
        total += gap * gap
    return total <= search.goal_tolerance


@inlined
def has_room(search: CrdtTable, tree: CrdtTreeTable) -> Any:
    """Whether a tree can take a whole extension."""
    return tree.size + dof_in(search) <= tree.capacity


@inlined
def nearest_to_target(search: CrdtTable, tree: CrdtTreeTable) -> Any:
    """The vertex of a tree that is nearest to TARGET."""
    target = extension_row(search, crdt_layout.TARGET)
    scale = rule_row(search, crdt_layout.SCALE)
    return nearest_crdt_vertex(tree, dof_in(search), target, scale, search.nearest)


# An extension is laid out, its edges are checked, those that are free join the tree.


@kernel
def lay_out(search: CrdtTable, tree: CrdtTreeTable, near: int, exactly: bool) -> None:
    """Lay out an extension from a vertex to the target, axis after axis, first the one that led to the vertex.

    A leg shorter than the smallest move ends the extension; if the target need not be met exactly, it is left out.
    """
    target = extension_row(search, crdt_layout.TARGET)
    current = extension_row(search, crdt_layout.CURRENT)
    parent = crdt_parent_of(tree, near)
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
        here = current[axis]
        there = target[axis]
        if here == there:
            continue
        came_from = here if legs > 0 or parent == crdt_layout.ROOT else coordinate(tree, parent, axis)
        turn = turning(came_from, here, there)
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


@inlined
def hold_idle_axes(search: CrdtTable, tree: CrdtTreeTable, near: int) -> None:
    """Let each coordinate of the target stay as it is at a vertex if it does not take part this time."""
    for axis in range(dof_in(search)):
        chance = rule_of(search, crdt_layout.CHANCE, axis)
        if chance < 1.0 and next_share(search) >= chance:
            extension_row(search, crdt_layout.TARGET)[axis] = coordinate(tree, near, axis)


@kernel
def shuffle(search: CrdtTable) -> None:
    """The axes that may move, in random order."""
    order = search.order
    count = search.axis_count
    for k in range(count):
        order[k] = search.axes[k]
    for k in range(count - 1, 0, -1):
        other = int(next_share(search) * (k + 1))
        axis = order[k]
        order[k] = order[other]
        order[other] = axis


@inlined
def to_front(search: CrdtTable, axis: int) -> None:
    """Let an axis go first and the others keep their order."""
    order = search.order
    k = 0
    while order[k] != axis:
        k += 1
    for place in range(k, 0, -1):
        order[place] = order[place - 1]
    order[0] = axis


@inlined
def remembered_axis(search: CrdtTable, tree: CrdtTreeTable, vertex: int, parent: int) -> int:
    """The axis of the edge that leads to a vertex."""
    axis = 0
    while axis < dof_in(search) - 1 and coordinate(tree, vertex, axis) == coordinate(tree, parent, axis):
        axis += 1
    return axis


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
def add_edge(search: CrdtTable, axis: int, start: Any, end: Any) -> None:
    """Put an edge along an axis through the current row on the list."""
    current = extension_row(search, crdt_layout.CURRENT)
    first = edge_start(search, search.edge_count)
    second = edge_end(search, search.edge_count)
    copy_row(dof_in(search), current, first)
    copy_row(dof_in(search), current, second)
    first[axis] = start
    second[axis] = end
    search.edge_count += 1


@kernel
def check_extension(search: CrdtTable) -> int:
    """Check the edges of the extension up to the first that is not free; returns how many want an answer."""
    asked = 0
    for edge in range(search.edge_count):
        verdict = check_edge(search, edge_start(search, edge), edge_end(search, edge))
        if verdict == UNDECIDED:
            if resolves(search.motions):
                asked += 1
            else:
                verdict = COLLIDING
        search.verdicts[edge] = verdict
        if verdict == COLLIDING:
            search.edge_count = edge + 1
            break
    return asked


@kernel
def check_edge(search: CrdtTable, start: Configuration, end: Configuration) -> int:
    """Check the motion between two configurations as the world does, whatever its direction."""
    for axis in range(dof_in(search)):
        lowest = min(start[axis], end[axis])
        highest = max(start[axis], end[axis])
        lower = rule_of(search, crdt_layout.LIMIT_LOWER, axis)
        upper = rule_of(search, crdt_layout.LIMIT_UPPER, axis)
        if lowest < lower or highest > upper:
            return COLLIDING
    motions = search.motions
    answer: int = check_motion(motions, start, end, resolves(motions))
    return answer


@kernel
def add_free_edges(search: CrdtTable, tree: CrdtTreeTable) -> int:
    """Add the free leading part of the extension to the tree; returns what was achieved."""
    dof = dof_in(search)
    count = search.edge_count
    first = search.first_edges
    near = search.near
    known = tree.size
    free = count_free(search)
    search.checked += min(free + 1, count)
    vertex = near
    if free >= first:
        parent = crdt_parent_of(tree, near)
        if search.turn == BACK:
            vertex = parent
        elif first > 0:
            vertex = add_crdt_vertex(tree, dof, edge_end(search, 0), near if search.turn == ONWARD else parent)
            if search.turn == BETWEEN:  # the edge to the vertex is split
                set_crdt_parent(tree, near, vertex)
        for edge in range(first, free):
            vertex = add_crdt_vertex(tree, dof, edge_end(search, edge), vertex)
    search.last = vertex

    if free == count and search.complete != 0:
        return crdt_layout.REACHED
    return crdt_layout.TRAPPED if tree.size == known else crdt_layout.ADVANCED


@inlined
def count_free(search: CrdtTable) -> int:
    """How many edges at the beginning of the extension are free."""
    free = 0
    while free < search.edge_count and search.verdicts[free] == FREE:
        free += 1
    return free


# Random numbers, the same as those of the search in Python.


@inlined
def sample(search: CrdtTable) -> None:
    """Draw a target within the bounds."""
    for axis in range(dof_in(search)):
        low = rule_of(search, crdt_layout.SAMPLE_LOWER, axis)
        high = rule_of(search, crdt_layout.SAMPLE_UPPER, axis)
        share = next_share(search)
        extension_row(search, crdt_layout.TARGET)[axis] = min(low + share * (high - low), high)


# What stands in the table.


@inlined
def dof_in(search: CrdtTable) -> int:
    """How many numbers a configuration has."""
    return search.motions.dof


@inlined
def tree_of(search: CrdtTable, side: int) -> CrdtTreeTable:
    """The first (0) or the second tree."""
    return search.tree if side == 0 else search.other_tree


@inlined
def rule_row(search: CrdtTable, rule: int) -> Configuration:
    """Address of a rule's numbers, one for each axis."""
    return row_at(search.rules, dof_in(search), rule)


@inlined
def rule_of(search: CrdtTable, rule: int, axis: int) -> Any:
    """A rule's number for an axis."""
    return rule_row(search, rule)[axis]


@inlined
def extension_row(search: CrdtTable, row: int) -> Configuration:
    """Address of a row of the extension, such as TARGET or CURRENT."""
    return row_at(search.extension, dof_in(search), row)


@inlined
def edge_start(search: CrdtTable, edge: int) -> Configuration:
    """Address of the start of an edge of the extension."""
    return extension_row(search, crdt_layout.EDGES + edge)


@inlined
def edge_end(search: CrdtTable, edge: int) -> Configuration:
    """Address of the end of an edge of the extension."""
    return extension_row(search, crdt_layout.EDGES + dof_in(search) + 1 + edge)


@inlined
def goal_row(search: CrdtTable, goal: int) -> Configuration:
    """Address of a goal of a single tree."""
    return row_at(search.goals, dof_in(search), goal)
