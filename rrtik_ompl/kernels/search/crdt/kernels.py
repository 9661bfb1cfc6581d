"""Searches in kernels with C-RDT trees. Source: [1, ch. 6.3, algorithms 9 to 11].

A search finds the same path to the bit as the one in Python, with the same random stream. It stops and goes on where it
was: all that it remembers is in its table, and how far it runs at a time changes nothing.
"""

from __future__ import annotations

from typing import Any

from rrtik_ompl.kernels.search.crdt import layout as crdt_layout
from rrtik_ompl.kernels.search.crdt.accessors import dof_in, extension_row, goal_row, nearest_of, rule_row, tree_of
from rrtik_ompl.kernels.search.crdt.draws import sample
from rrtik_ompl.kernels.search.crdt.growth import add_free_edges, check_extension, lay_out
from rrtik_ompl.kernels.search.crdt.layout import CrdtTable, CrdtTreeTable
from rrtik_ompl.kernels.search.crdt.tree_kernels import coordinate, nearest_crdt_vertex, read_vertex, size_of
from rrtik_ompl.kernels.search.motions.row_kernels import copy_row
from rrtik_ompl.kernels.simd.access import count_up
from rrtik_ompl.kernels.simd.compiled import entry, inlined
from rrtik_ompl.kernels.simd.lanes import double_at, field, set_field


@inlined
def nearest_to_target(search: CrdtTable, tree: CrdtTreeTable) -> Any:
    """The vertex of a tree that is nearest to TARGET."""
    target, scale = extension_row(search, crdt_layout.TARGET), rule_row(search, crdt_layout.SCALE)
    return nearest_crdt_vertex(tree, dof_in(search), target, scale, nearest_of(search))


@inlined
def has_room(search: CrdtTable, tree: CrdtTreeTable) -> Any:
    """Whether a tree can take a whole extension."""
    return size_of(tree) + dof_in(search) <= field(tree, crdt_layout.CAPACITY)


@inlined
def swap(search: CrdtTable) -> None:
    """Let the other tree grow."""
    set_field(search, crdt_layout.GROWING, 1 - field(search, crdt_layout.GROWING))
    set_field(search, crdt_layout.NEXT, crdt_layout.BEGIN)


@entry
def resume_pair(search: CrdtTable, budget: int) -> int:
    """Go on with two trees that grow in turn, for at most ``budget`` iterations. Returns a status.

    ASKING: the edges whose verdict is UNDECIDED want an answer. FULL: both trees want more room.
    """
    done = 0
    while True:
        growing = tree_of(search, field(search, crdt_layout.GROWING))
        other = tree_of(search, 1 - field(search, crdt_layout.GROWING))
        step = field(search, crdt_layout.NEXT)
        if step == crdt_layout.BEGIN:
            if field(search, crdt_layout.ITERATIONS) >= field(search, crdt_layout.ITERATION_LIMIT):
                return crdt_layout.EXHAUSTED
            if done >= budget:
                return crdt_layout.RUNNING
            if not (has_room(search, growing) and has_room(search, other)):
                return crdt_layout.FULL
            done += 1
            count_up(search, crdt_layout.ITERATIONS)
            sample(search)
            tree, exactly, step = growing, False, crdt_layout.GROW
        elif step == crdt_layout.GROW:
            if add_free_edges(search, growing) == crdt_layout.TRAPPED:
                swap(search)
                continue
            set_field(search, crdt_layout.MET, field(search, crdt_layout.LAST))
            read_vertex(
                growing, dof_in(search), field(search, crdt_layout.LAST), extension_row(search, crdt_layout.TARGET)
            )
            tree, exactly, step = other, True, crdt_layout.MEET
        else:
            outcome = add_free_edges(search, other)
            swap(search)
            if outcome == crdt_layout.REACHED:
                return crdt_layout.SOLVED
            continue
        lay_out(search, tree, nearest_to_target(search, tree), exactly)
        set_field(search, crdt_layout.NEXT, step)
        if check_extension(search) > 0:
            return crdt_layout.ASKING


@inlined
def goal_in_reach(search: CrdtTable, tree: CrdtTreeTable, vertex: int, goal: int) -> Any:
    """Whether a goal lies within the tolerance around a vertex."""
    total = 0.0
    for axis in range(dof_in(search)):
        gap = double_at(goal_row(search, goal), axis) - coordinate(tree, vertex, axis)
        total += gap * gap
    return total <= double_at(field(search, crdt_layout.GOAL_TOLERANCE), 0)


@inlined
def choose_goal(search: CrdtTable, tree: CrdtTreeTable) -> bool:
    """Go on to the next vertex and goal that are near each other; False if there are none."""
    while field(search, crdt_layout.VERTEX) < field(search, crdt_layout.VERTEX_END):
        while field(search, crdt_layout.GOAL) < field(search, crdt_layout.GOAL_COUNT):
            if goal_in_reach(search, tree, field(search, crdt_layout.VERTEX), field(search, crdt_layout.GOAL)):
                return True
            count_up(search, crdt_layout.GOAL)
        count_up(search, crdt_layout.VERTEX)
        set_field(search, crdt_layout.GOAL, 0)
    return False


@entry
def resume_single(search: CrdtTable, budget: int) -> int:
    """Go on with one tree whose vertices near a goal try to reach it; else as :func:`resume_pair`."""
    tree, done = tree_of(search, 0), 0
    while True:
        step = field(search, crdt_layout.NEXT)
        if step == crdt_layout.GROW:
            add_free_edges(search, tree)
            set_field(search, crdt_layout.VERTEX_END, size_of(tree))
            set_field(search, crdt_layout.NEXT, crdt_layout.CHOOSE_GOAL)
            continue
        if step == crdt_layout.REACH_GOAL:
            set_field(search, crdt_layout.NEXT, crdt_layout.CHOOSE_GOAL)
            count_up(search, crdt_layout.GOAL)
            if add_free_edges(search, tree) == crdt_layout.REACHED:
                return crdt_layout.SOLVED
            continue
        if step == crdt_layout.CHOOSE_GOAL and not choose_goal(search, tree):
            set_field(search, crdt_layout.NEXT, crdt_layout.BEGIN)
            continue
        if step == crdt_layout.BEGIN and field(search, crdt_layout.ITERATIONS) >= field(
            search, crdt_layout.ITERATION_LIMIT
        ):
            return crdt_layout.EXHAUSTED
        if step == crdt_layout.BEGIN and done >= budget:
            return crdt_layout.RUNNING
        if not has_room(search, tree):
            return crdt_layout.FULL
        if step == crdt_layout.BEGIN:
            done += 1
            count_up(search, crdt_layout.ITERATIONS)
            set_field(search, crdt_layout.VERTEX, size_of(tree))
            set_field(search, crdt_layout.GOAL, 0)
            sample(search)
            near, next_step = nearest_to_target(search, tree), crdt_layout.GROW
        else:
            goal = goal_row(search, field(search, crdt_layout.GOAL))
            copy_row(dof_in(search), goal, extension_row(search, crdt_layout.TARGET))
            near, next_step = field(search, crdt_layout.VERTEX), crdt_layout.REACH_GOAL
        lay_out(search, tree, near, next_step == crdt_layout.REACH_GOAL)
        set_field(search, crdt_layout.NEXT, next_step)
        if check_extension(search) > 0:
            return crdt_layout.ASKING
