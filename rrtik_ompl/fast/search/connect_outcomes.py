"""What becomes of a motion of RRT-Connect that was checked or answered for: a vertex, a meeting, questions, a path."""

from __future__ import annotations

import numpy as np

from rrtik_ompl.fast.checks.motion_kernels import copy_row
from rrtik_ompl.fast.search import connect_layout as table
from rrtik_ompl.fast.search.connect_motions import count_up, nearest_to, number, tree_of
from rrtik_ompl.fast.search.tree_kernels import add_vertex, cut_branch, parent_of, row_of, state_of
from rrtik_ompl.fast.search.tree_layout import CERTAIN, CUT, OPEN, RADII, STATES
from rrtik_ompl.fast.simd.compiled import kernel
from rrtik_ompl.fast.simd.lanes import field, int_at, set_field, set_float, set_int

NO_DOMAIN = 1e30


@kernel
def shrink_domain(search: int, side: int, vertex: int) -> None:
    """A vertex that was blocked is given a domain."""
    set_float(field(tree_of(search, side), RADII), vertex, np.float32(number(search, table.DOMAIN)))


@kernel
def on_blocked(search: int) -> None:
    """The motion is not free."""
    if field(search, table.PHASE) == table.SAMPLE:
        shrink_domain(search, field(search, table.GROWING), field(search, table.FROM))
    elif field(search, table.PHASE) == table.CONNECT:
        set_field(search, table.PHASE, table.SAMPLE)


@kernel
def on_free(search: int, state: int) -> int:
    """The motion is free, or taken to be for now; returns the status."""
    side = field(search, table.GROWING)
    if field(search, table.BRIDGE) != 0:
        set_field(search, table.MEETINGS + side, field(search, table.FROM))
        set_field(search, table.MEETINGS + 1 - side, field(search, table.TARGET))
        set_field(search, table.MEETING_OPEN, state)
        return finish_or_ask(search)
    row, values = field(search, table.ROW), field(search, table.ROW_VALUES)
    vertex = add_vertex(tree_of(search, side), row, values, field(search, table.FROM), state, NO_DOMAIN)
    if field(search, table.PHASE) == table.SAMPLE:
        set_field(search, table.PHASE, table.CONNECT)
        set_field(search, table.GROWING, 1 - side)
        set_field(search, table.FROM, nearest_to(search, 1 - side, row))
        set_field(search, table.TARGET, vertex)
    else:
        set_field(search, table.FROM, vertex)
    return table.RUNNING


@kernel
def ask(search: int, kind: int, start: int, end: int, side: int, vertex: int) -> None:
    """Put a question: is the motion from ``start`` to ``end``, which leads to a vertex (or to none: -1), free?"""
    place, dof = field(search, table.QUESTIONS), field(search, table.DOF)
    copy_row(dof, start, field(search, table.QUESTION_STARTS) + 8 * dof * place)
    copy_row(dof, end, field(search, table.QUESTION_ENDS) + 8 * dof * place)
    set_int(field(search, table.QUESTION_TREES), place, side)
    set_int(field(search, table.QUESTION_VERTICES), place, vertex)
    set_field(search, table.QUESTIONS, place + 1)
    set_field(search, table.ASKED, kind)


@kernel
def finish_or_ask(search: int) -> int:
    """The trees have met: SOLVED if all motions of the path are certain, else the open ones are asked for."""
    set_field(search, table.QUESTIONS, 0)
    for side in range(2):
        tree, vertex = tree_of(search, side), field(search, table.MEETINGS + side)
        while vertex >= 0:
            if state_of(tree, vertex) == OPEN and field(search, table.QUESTIONS) < table.MOST_QUESTIONS:
                ask(search, table.PATH, row_of(tree, parent_of(tree, vertex)), row_of(tree, vertex), side, vertex)
            vertex = parent_of(tree, vertex)
    if field(search, table.MEETING_OPEN) != CERTAIN and field(search, table.QUESTIONS) < table.MOST_QUESTIONS:
        start = row_of(tree_of(search, 0), field(search, table.MEETINGS))
        ask(search, table.PATH, start, row_of(tree_of(search, 1), field(search, table.MEETINGS + 1)), 0, -1)
    return table.SOLVED if field(search, table.QUESTIONS) == 0 else table.ASKING


@kernel
def apply_path_answers(search: int) -> int:
    """Use the answers for the motions of a path; returns the status."""
    rejected = 0
    for k in range(field(search, table.QUESTIONS)):
        side, vertex = int_at(field(search, table.QUESTION_TREES), k), int_at(field(search, table.QUESTION_VERTICES), k)
        free, tree = int_at(field(search, table.ANSWERS), k) != 0, tree_of(search, side)
        if not free:
            rejected += 1
        if vertex < 0:
            set_field(search, table.MEETING_OPEN, CERTAIN if free else OPEN)
        elif free and state_of(tree, vertex) != CUT:
            set_int(field(tree, STATES), vertex, CERTAIN)
        elif not free:
            shrink_domain(search, side, parent_of(tree, vertex))
            cut_branch(tree, vertex)
    if rejected == 0:
        return finish_or_ask(search)
    count_up(search, table.REJECTED)
    if field(search, table.PHASE) == table.CONNECT:
        set_field(search, table.PHASE, table.SAMPLE)
    return table.RUNNING


@kernel
def resume_after_answers(search: int) -> int:
    """Go on from the answers to what was asked; returns the status."""
    kind = field(search, table.ASKED)
    set_field(search, table.ASKED, table.NOTHING)
    if kind == table.PATH:
        return apply_path_answers(search)
    if kind == table.MOTION:
        if int_at(field(search, table.ANSWERS), 0) != 0:
            return on_free(search, CERTAIN)
        on_blocked(search)
    return table.RUNNING
