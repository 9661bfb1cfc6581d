"""RRT-Connect whole in a kernel: two trees grow towards each other until a path between a start and a goal is certain.

Sources: Kuffner and LaValle 2000 (RRT-Connect), Kuffner and LaValle 2005 (the smaller tree grows), Yershova, Jaillet,
Simeon and LaValle 2005 (dynamic domain: a vertex that was blocked is only extended towards samples near it).

A motion that the covers leave undecided is inserted as OPEN (lazy). When the trees meet, the open motions of the path
are asked for; those that are not free cut off what hangs on them, and the search goes on. After ``PATIENCE`` rejected
paths each undecided motion is asked for before it is inserted (eager).

The search runs in short calls of :func:`resume`. Nothing depends on how its work is divided into calls.
"""

from __future__ import annotations

from typing import Any

from rrtik_ompl.fast.checks.check_kernels import check_part
from rrtik_ompl.fast.checks.motion_kernels import copy_row
from rrtik_ompl.fast.search import connect_layout as table
from rrtik_ompl.fast.search.connect_motions import (
    aim_at_sample,
    aim_at_vertex,
    aim_straight,
    check_candidate,
    distance,
    set_row_values,
    tree_of,
)
from rrtik_ompl.fast.search.connect_outcomes import NO_DOMAIN, ask, on_blocked, on_free, resume_after_answers
from rrtik_ompl.fast.search.tree_kernels import add_vertex, clear_tree, parent_of, row_of
from rrtik_ompl.fast.search.tree_layout import CAPACITY, CERTAIN, OPEN, SIZE
from rrtik_ompl.fast.simd.compiled import entry, inlined, kernel
from rrtik_ompl.fast.simd.lanes import double_at, field, set_double, set_field
from rrtik_ompl.fast.simd.random_kernels import next_share, start_points
from rrtik_ompl.fast.tables.layout import FREE, UNDECIDED

OUTSIDE = 1e-6  # how far a start or goal may lie outside the bounds, as robots and spaces tolerate a little too


@kernel
def candidate(search: int) -> bool:
    """Choose the next motion to look at; False if there is none this time."""
    phase = field(search, table.PHASE)
    if phase == table.CONNECT:
        aim_at_vertex(search, field(search, table.GROWING), field(search, table.FROM), field(search, table.TARGET))
        return True
    if phase == table.STRAIGHT:
        if aim_straight(search):
            return True
        set_field(search, table.PHASE, table.SAMPLE)
        return False
    return aim_at_sample(search)


@inlined
def is_full(search: int, side: int) -> Any:
    """Whether a tree has no room for one more vertex."""
    return field(tree_of(search, side), SIZE) >= field(tree_of(search, side), CAPACITY)


@kernel
def advance(search: int) -> int:
    """Look at one motion; returns the status."""
    if not candidate(search):
        return table.RUNNING
    answer = check_candidate(search)
    if answer == UNDECIDED and field(search, table.RESOLVE) != 0:
        if field(search, table.REJECTED) < field(search, table.PATIENCE):
            return on_free(search, OPEN)
        set_field(search, table.QUESTIONS, 0)
        start = row_of(tree_of(search, field(search, table.GROWING)), field(search, table.FROM))
        ask(search, table.MOTION, start, field(search, table.ROW), 0, -1)
        return table.ASKING
    if answer == FREE:
        return on_free(search, CERTAIN)
    on_blocked(search)
    return table.RUNNING


@entry
def resume(search: int, budget: int) -> int:
    """Search on for at most ``budget`` motions or samples; returns the status.

    ASKING: there are QUESTIONS in the table; write the ANSWERS (1 for free) and call again. FULL: a tree needs room.
    """
    status = table.RUNNING
    if field(search, table.ASKED) != table.NOTHING:
        if is_full(search, 0) or is_full(search, 1):
            return table.FULL
        status = resume_after_answers(search)
    while status == table.RUNNING and budget > 0:
        if is_full(search, 0) or is_full(search, 1):
            return table.FULL
        if field(search, table.PHASE) == table.SAMPLE and field(search, table.ITERATIONS) >= field(search, table.LIMIT):
            return table.EXHAUSTED
        status = advance(search)
        budget -= 1
    return status


@kernel
def load_row(search: int, source: int) -> bool:
    """Set ROW to a configuration; False if that is outside the bounds."""
    for k in range(field(search, table.DOF)):
        value = double_at(source, k)
        low, high = double_at(field(search, table.LOWER), k), double_at(field(search, table.UPPER), k)
        if not (value >= low - OUTSIDE and value <= high + OUTSIDE):
            return False
        set_double(field(search, table.ROW), k, value)
    set_row_values(search)
    return True


@kernel
def plant(search: int, side: int, rows: int, count: int) -> int:
    """Make the rows the roots of a tree; returns the number of the first one outside the bounds, or -1."""
    tree, row, values = tree_of(search, side), field(search, table.ROW), field(search, table.ROW_VALUES)
    clear_tree(tree)
    for k in range(count):
        if not load_row(search, rows + 8 * field(search, table.DOF) * k):
            return k
        add_vertex(tree, row, values, -1, CERTAIN, NO_DOMAIN)
    return -1


@entry
def rows_free(search: int, rows: int, count: int) -> int:
    """Whether all of some configurations are in the box and proven free: 1 if they are, 0 if one may not be."""
    dof, values = field(search, table.DOF), field(search, table.ROW_VALUES)
    for k in range(count):
        if not load_row(search, rows + 8 * dof * k):
            return 0
        if check_part(field(search, table.WORLD), values, values, 1, 1, 1, False) != FREE:
            return 0
    return 1


@kernel
def begin_between(search: int, start_rows: int, starts: int, goal_rows: int, goals: int, seed: int) -> int:
    """Start anew from roots at two addresses; returns -1, or the number of a root that is outside the bounds."""
    for place in (
        table.ITERATIONS,
        table.REJECTED,
        table.CHECKED,
        table.STRAIGHT_TRIED,
        table.ASKED,
        table.QUESTIONS,
        table.GROWER,
    ):
        set_field(search, place, 0)
    set_field(search, table.PHASE, table.STRAIGHT)
    set_field(search, table.ROOTS, goals)
    set_field(search, table.RANDOM, seed)
    next_share(search, table.RANDOM)
    start_points(search, table.RANDOM, field(search, table.POINT), field(search, table.DOF))
    outside = plant(search, 0, start_rows, starts)
    if outside >= 0:
        return outside
    outside = plant(search, 1, goal_rows, goals)
    return starts + outside if outside >= 0 else -1


@entry
def begin(search: int, starts: int, goals: int, seed: int) -> int:
    """:func:`begin_between` the roots in the table."""
    start_rows, goal_rows = field(search, table.START_ROWS), field(search, table.GOAL_ROWS)
    return begin_between(search, start_rows, starts, goal_rows, goals, seed)


@kernel
def depth(tree: int, vertex: int) -> int:
    """Number of vertices from a vertex to its root."""
    count = 0
    while vertex >= 0:
        count += 1
        vertex = parent_of(tree, vertex)
    return count


@entry
def write_path(search: int, rows: int, capacity: int) -> int:
    """Write the path that was found, start first, if there is room for it; returns its number of rows."""
    starts, goals, dof = tree_of(search, 0), tree_of(search, 1), field(search, table.DOF)
    vertex, other = field(search, table.MEETINGS), field(search, table.MEETINGS + 1)
    place = depth(starts, vertex)
    if distance(dof, row_of(starts, vertex), row_of(goals, other)) == 0.0 and parent_of(goals, other) >= 0:
        other = parent_of(goals, other)  # the same configuration stands in both trees
    elif distance(dof, row_of(starts, vertex), row_of(goals, other)) == 0.0:
        other = -1
    total = place + depth(goals, other)
    if total > capacity:
        return total
    while vertex >= 0:
        place -= 1
        copy_row(dof, row_of(starts, vertex), rows + 8 * dof * place)
        vertex = parent_of(starts, vertex)
    place = depth(starts, field(search, table.MEETINGS))
    while other >= 0:
        copy_row(dof, row_of(goals, other), rows + 8 * dof * place)
        place += 1
        other = parent_of(goals, other)
    return total
