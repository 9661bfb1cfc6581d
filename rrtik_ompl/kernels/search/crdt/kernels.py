"""Searches in kernels with C-RDT trees. Source: [1, ch. 6.3, algorithms 9 to 11].

A search finds the same path to the bit as the one in Python, with the same random stream. It stops and goes on where it
was: all that it remembers is in its table, and how far it runs at a time changes nothing.
"""

from __future__ import annotations

from typing import Any

from rrtik_ompl.kernels.search.crdt import layout as crdt_layout
from rrtik_ompl.kernels.search.crdt.accessors import dof_in, extension_row, goal_row, rule_row, tree_of
from rrtik_ompl.kernels.search.crdt.draws import sample
from rrtik_ompl.kernels.search.crdt.growth import add_free_edges, check_extension, lay_out
from rrtik_ompl.kernels.search.crdt.layout import CrdtTable, CrdtTreeTable
from rrtik_ompl.kernels.search.crdt.tree_kernels import coordinate, nearest_crdt_vertex, read_vertex
from rrtik_ompl.kernels.search.motions.row_kernels import copy_row
from rrtik_ompl.kernels.simd.compiled import entry, inlined


@inlined
def nearest_to_target(search: CrdtTable, tree: CrdtTreeTable) -> Any:
    """The vertex of a tree that is nearest to TARGET."""
    target, scale = extension_row(search, crdt_layout.TARGET), rule_row(search, crdt_layout.SCALE)
    return nearest_crdt_vertex(tree, dof_in(search), target, scale, search.nearest)


@inlined
def has_room(search: CrdtTable, tree: CrdtTreeTable) -> Any:
    """Whether a tree can take a whole extension."""
    return tree.size + dof_in(search) <= tree.capacity


@inlined
def swap(search: CrdtTable) -> None:
    """Let the other tree grow."""
    search.growing = 1 - search.growing
    search.next = crdt_layout.BEGIN


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
            tree, exactly, step = growing, False, crdt_layout.GROW
        elif step == crdt_layout.GROW:
            if add_free_edges(search, growing) == crdt_layout.TRAPPED:
                swap(search)
                continue
            search.met = search.last
            read_vertex(growing, dof_in(search), search.last, extension_row(search, crdt_layout.TARGET))
            tree, exactly, step = other, True, crdt_layout.MEET
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
def goal_in_reach(search: CrdtTable, tree: CrdtTreeTable, vertex: int, goal: int) -> Any:
    """Whether a goal lies within the tolerance around a vertex."""
    total = 0.0
    for axis in range(dof_in(search)):
        gap = goal_row(search, goal)[axis] - coordinate(tree, vertex, axis)
        total += gap * gap
    return total <= search.goal_tolerance


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


@entry
def resume_single(search: CrdtTable, budget: int) -> int:
    """Go on with one tree whose vertices near a goal try to reach it; else as :func:`resume_pair`."""
    tree, done = tree_of(search, 0), 0
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
            near, next_step = nearest_to_target(search, tree), crdt_layout.GROW
        else:
            goal = goal_row(search, search.goal)
            copy_row(dof_in(search), goal, extension_row(search, crdt_layout.TARGET))
            near, next_step = search.vertex, crdt_layout.REACH_GOAL
        lay_out(search, tree, near, next_step == crdt_layout.REACH_GOAL)
        search.next = next_step
        if check_extension(search) > 0:
            return crdt_layout.ASKING
