"""What becomes of a motion of RRT-Connect that was checked or answered for: a vertex, a meeting, questions, a path."""

from __future__ import annotations

from rrtik_ompl.kernels.search import connect_layout
from rrtik_ompl.kernels.search.bounded.cost_kernels import is_bounded, note_cost
from rrtik_ompl.kernels.search.connect_layout import ConnectTable
from rrtik_ompl.kernels.search.connect_motions import (
    dof_in,
    meeting_of,
    met_by,
    set_meeting,
    tree_of,
)
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration, copy_row, distance, row_at
from rrtik_ompl.kernels.search.tree_kernels import (
    add_vertex,
    cut_branch,
    parent_of,
    row_of,
    set_radius,
    set_state,
    state_of,
)
from rrtik_ompl.kernels.search.tree_layout import CERTAIN, CUT, OPEN, TreeTable
from rrtik_ompl.kernels.simd.compiled import kernel


@kernel
def shrink_domain(search: ConnectTable, side: int, vertex: int) -> None:
    """A vertex that was blocked is given a domain."""
    set_radius(tree_of(search, side), vertex, search.domain)


@kernel
def on_blocked(search: ConnectTable) -> None:
    """The motion is not free."""
    if search.phase == connect_layout.EXTEND:
        shrink_domain(search, search.growing, search.start)
    elif search.phase == connect_layout.CONNECT:
        search.phase = connect_layout.EXTEND


@kernel
def on_free(search: ConnectTable, state: int) -> int:
    """The motion is free, or taken to be for now; returns the status."""
    side, start = search.growing, search.start
    if search.bridge != 0:
        set_meeting(search, side, start)
        set_meeting(search, 1 - side, search.target)
        search.meeting_state = state
        return finish_or_ask(search)
    row, values = search.row, search.row_values
    vertex = add_vertex(tree_of(search, side), row, values, start, state, connect_layout.UNBOUNDED_DOMAIN)
    if is_bounded(search):
        note_cost(search, tree_of(search, side), vertex)
    if search.phase == connect_layout.EXTEND:
        search.phase = connect_layout.CONNECT
        search.growing = 1 - side
        search.start = met_by(search, side, vertex)
        search.target = vertex
    else:
        search.start = vertex
    return connect_layout.RUNNING


@kernel
def ask(search: ConnectTable, kind: int, start: Configuration, end: Configuration, side: int, vertex: int) -> None:
    """Ask whether the motion from ``start`` to ``end`` is free, which leads to a vertex of a tree or to NO_VERTEX."""
    place, dof = search.questions, dof_in(search)
    copy_row(dof, start, row_at(search.question_starts, dof, place))
    copy_row(dof, end, row_at(search.question_ends, dof, place))
    search.question_sides[place] = side
    search.question_vertices[place] = vertex
    search.questions = place + 1
    search.asked = kind


@kernel
def ask_for_candidate(search: ConnectTable) -> None:
    """Ask whether the motion to the row is free, before it is inserted."""
    tree = tree_of(search, search.growing)
    start, end = row_of(tree, search.start), search.row
    search.questions = 0
    ask(search, connect_layout.MOTION_QUESTION, start, end, 0, connect_layout.NO_VERTEX)


@kernel
def finish_or_ask(search: ConnectTable) -> int:
    """The trees have met: SOLVED if all motions of the path are certain, else the open ones are asked for."""
    kind, most = connect_layout.PATH_QUESTION, connect_layout.MAX_QUESTIONS
    search.questions = 0
    for side in range(2):
        tree, vertex = tree_of(search, side), meeting_of(search, side)
        while vertex >= 0:
            parent = parent_of(tree, vertex)
            if state_of(tree, vertex) == OPEN and search.questions < most:
                ask(search, kind, row_of(tree, parent), row_of(tree, vertex), side, vertex)
            vertex = parent
    if search.meeting_state != CERTAIN and search.questions < most:
        start, end = (
            row_of(tree_of(search, 0), meeting_of(search, 0)),
            row_of(tree_of(search, 1), meeting_of(search, 1)),
        )
        ask(search, kind, start, end, 0, connect_layout.NO_VERTEX)
    return connect_layout.SOLVED if search.questions == 0 else connect_layout.ASKING


@kernel
def apply_path_answers(search: ConnectTable) -> int:
    """Use the answers for the motions of a path; returns the status."""
    rejected = 0
    for k in range(search.questions):
        side = search.question_sides[k]
        vertex = search.question_vertices[k]
        free, tree = search.answers[k] != 0, tree_of(search, side)
        if not free:
            rejected += 1
        if vertex == connect_layout.NO_VERTEX:
            search.meeting_state = CERTAIN if free else OPEN
        elif free and state_of(tree, vertex) != CUT:
            set_state(tree, vertex, CERTAIN)
        elif not free:
            shrink_domain(search, side, parent_of(tree, vertex))
            cut_branch(tree, vertex)
    if rejected == 0:
        return finish_or_ask(search)
    search.rejected += 1
    if search.phase == connect_layout.CONNECT:
        search.phase = connect_layout.EXTEND
    return connect_layout.RUNNING


@kernel
def resume_after_answers(search: ConnectTable) -> int:
    """Go on from the answers to what was asked; returns the status."""
    kind = search.asked
    search.asked = connect_layout.NO_QUESTION
    if kind == connect_layout.PATH_QUESTION:
        return apply_path_answers(search)
    if kind == connect_layout.MOTION_QUESTION:
        if search.answers[0] != 0:
            return on_free(search, CERTAIN)
        on_blocked(search)
    return connect_layout.RUNNING


@kernel
def depth(tree: TreeTable, vertex: int) -> int:
    """Number of vertices from a vertex to its root."""
    count = 0
    while vertex >= 0:
        count += 1
        vertex = parent_of(tree, vertex)
    return count


@kernel
def write_path(search: ConnectTable, rows: Configuration, capacity: int) -> int:
    """Write the path that was found, start first, if there is room for it; returns its number of rows."""
    starts, goals, dof = tree_of(search, 0), tree_of(search, 1), dof_in(search)
    vertex, other = meeting_of(search, 0), meeting_of(search, 1)
    place = depth(starts, vertex)
    if distance(dof, row_of(starts, vertex), row_of(goals, other)) == 0.0:  # the same configuration, in both trees
        other = parent_of(goals, other)
    total = place + depth(goals, other)
    if total > capacity:
        return total
    while vertex >= 0:
        place -= 1
        copy_row(dof, row_of(starts, vertex), row_at(rows, dof, place))
        vertex = parent_of(starts, vertex)
    place = depth(starts, meeting_of(search, 0))
    while other >= 0:
        copy_row(dof, row_of(goals, other), row_at(rows, dof, place))
        place += 1
        other = parent_of(goals, other)
    return total
