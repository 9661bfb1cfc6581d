"""Searches in kernels with C-RDT trees. Source: the C-RDT paper, algorithms 9 to 11.

A search finds the same path to the bit as the one in Python, with the same random stream. It stops and goes on where it
was: all that it remembers is in its table, and how far it runs at a time changes nothing.
"""

from __future__ import annotations

from typing import Any

from rrtik_ompl.fast.checks.motion_kernels import copy_row
from rrtik_ompl.fast.search.crdt import layout as table
from rrtik_ompl.fast.search.crdt.draws import sample
from rrtik_ompl.fast.search.crdt.growth import aim, coordinate, keep, nearest_vertex, open_edges, read_vertex
from rrtik_ompl.fast.simd.compiled import entry, inlined
from rrtik_ompl.fast.simd.lanes import double_at, field, set_field


@inlined
def has_room(search: int, tree: int) -> Any:
    """Whether a tree can take a whole extension."""
    return field(tree, table.SIZE) + field(search, table.DOF) <= field(tree, table.CAPACITY)


@inlined
def swap(search: int) -> None:
    """Let the other tree grow."""
    set_field(search, table.GROWING, 1 - field(search, table.GROWING))
    set_field(search, table.NEXT, table.BEGIN)


@entry
def resume_pair(search: int, budget: int) -> int:
    """Go on with two trees that grow in turn, for at most ``budget`` iterations. Returns a status.

    ASKING: the edges whose verdict is UNDECIDED want an answer. FULL: both trees want more room.
    """
    done = 0
    while True:
        growing = field(field(search, table.TREES), field(search, table.GROWING))
        other = field(field(search, table.TREES), 1 - field(search, table.GROWING))
        step = field(search, table.NEXT)
        if step == table.BEGIN:
            if field(search, table.ITERATIONS) >= field(search, table.ITERATION_LIMIT):
                return table.EXHAUSTED
            if done >= budget:
                return table.RUNNING
            if not (has_room(search, growing) and has_room(search, other)):
                return table.FULL
            done += 1
            set_field(search, table.ITERATIONS, field(search, table.ITERATIONS) + 1)
            sample(search)
            tree, exactly, step = growing, False, table.GROW
        elif step == table.GROW:
            if keep(search, growing) == table.TRAPPED:
                swap(search)
                continue
            set_field(search, table.MET, field(search, table.LAST))
            read_vertex(search, growing, field(search, table.LAST), field(search, table.TARGET))
            tree, exactly, step = other, True, table.MEET
        else:
            outcome = keep(search, other)
            swap(search)
            if outcome == table.REACHED:
                return table.SOLVED
            continue
        aim(search, tree, nearest_vertex(search, tree), exactly)
        set_field(search, table.NEXT, step)
        if open_edges(search) > 0:
            return table.ASKING


@inlined
def goal_in_reach(search: int, tree: int, vertex: int, goal: int) -> Any:
    """Whether a goal lies within the tolerance around a vertex."""
    total = 0.0
    for axis in range(field(search, table.DOF)):
        way = double_at(field(search, table.GOALS), goal * field(search, table.DOF) + axis) - coordinate(
            tree, vertex, axis
        )
        total += way * way
    return total <= double_at(field(search, table.NUMBERS), table.TOLERANCE_SQUARED)


@inlined
def choose_goal(search: int, tree: int) -> bool:
    """Go on to the next vertex and goal that are near each other; False if there are none."""
    while field(search, table.VERTEX) < field(search, table.VERTEX_END):
        while field(search, table.GOAL) < field(search, table.GOAL_COUNT):
            if goal_in_reach(search, tree, field(search, table.VERTEX), field(search, table.GOAL)):
                return True
            set_field(search, table.GOAL, field(search, table.GOAL) + 1)
        set_field(search, table.VERTEX, field(search, table.VERTEX) + 1)
        set_field(search, table.GOAL, 0)
    return False


@entry
def resume_single(search: int, budget: int) -> int:
    """Go on with one tree whose vertices near a goal try to reach it; else as :func:`resume_pair`."""
    tree, done = field(field(search, table.TREES), 0), 0
    while True:
        step = field(search, table.NEXT)
        if step == table.GROW:
            keep(search, tree)
            set_field(search, table.VERTEX_END, field(tree, table.SIZE))
            set_field(search, table.NEXT, table.CHOOSE_GOAL)
            continue
        if step == table.REACH_GOAL:
            set_field(search, table.NEXT, table.CHOOSE_GOAL)
            set_field(search, table.GOAL, field(search, table.GOAL) + 1)
            if keep(search, tree) == table.REACHED:
                return table.SOLVED
            continue
        if step == table.CHOOSE_GOAL and not choose_goal(search, tree):
            set_field(search, table.NEXT, table.BEGIN)
            continue
        if step == table.BEGIN and field(search, table.ITERATIONS) >= field(search, table.ITERATION_LIMIT):
            return table.EXHAUSTED
        if step == table.BEGIN and done >= budget:
            return table.RUNNING
        if not has_room(search, tree):
            return table.FULL
        if step == table.BEGIN:
            done += 1
            set_field(search, table.ITERATIONS, field(search, table.ITERATIONS) + 1)
            set_field(search, table.VERTEX, field(tree, table.SIZE))
            set_field(search, table.GOAL, 0)
            sample(search)
            near, next_step = nearest_vertex(search, tree), table.GROW
        else:
            dof = field(search, table.DOF)
            copy_row(dof, field(search, table.GOALS) + 8 * dof * field(search, table.GOAL), field(search, table.TARGET))
            near, next_step = field(search, table.VERTEX), table.REACH_GOAL
        aim(search, tree, near, next_step == table.REACH_GOAL)
        set_field(search, table.NEXT, next_step)
        if open_edges(search) > 0:
            return table.ASKING
