"""RRT-Connect whole in a kernel: two trees grow towards each other until a path between a start and a goal is certain.

Sources: RRT-Connect [4]; the smaller tree grows [5]; dynamic domain: a vertex that was blocked is only extended towards
samples near it [6]. With a bound it is AORRTC [15], see :mod:`rrtik_ompl.kernels.search.bounded.cost_kernels`.

The search, as worlds without kernels run it in Python, and the kernels of each line::

    for goal in goals:                                       # phase STRAIGHT: aim_straight
        if free(nearest(starts, goal), goal):                #   check_candidate
            return path(start, goal)                         #   on_free, finish_or_ask
    while samples < limit:                                   # phase EXTEND: resume
        samples += 1                                         #   aim_at_sample
        side = 1 - side                                      #   .
        if size(trees[side]) > size(trees[1 - side]):        #   .
            side = 1 - side                                  #   .
        sample = next_sample(box)                            #   place_sample
        near = nearest(trees[side], sample)                  #   nearest_to
        if distance(near, sample) > domain(near):            #   aim_at_sample
            continue
        new = towards(near, sample, range)                   #   steer
        if not free(near, new):                              #   check_candidate
            shrink_domain(near); continue                    #   on_blocked, shrink_domain
        add(trees[side], new)                                #   on_free, add_vertex
        vertex = nearest(trees[1 - side], new)               #   on_free, nearest_to
        while True:                                          # phase CONNECT: aim_at_vertex
            next = towards(vertex, new, range)               #   steer
            if not free(vertex, next): break                 #   check_candidate, on_blocked
            if next == new: return path(new, vertex)         #   on_free, finish_or_ask, write_path
            vertex = add(trees[1 - side], next)              #   on_free, add_vertex

:func:`advance` checks one motion: :func:`candidate` aims at it by the phase, ``check_candidate`` checks it, and
``on_free`` or ``on_blocked`` say what follows.

A motion that the kernels leave undecided is inserted as OPEN (lazy). When the trees meet, the open motions of the path
are asked for (``finish_or_ask``); those that are not free cut off what hangs on them (``apply_path_answers``), and the
search goes on. After ``patience`` rejected paths each undecided motion is asked for before it is inserted (eager).

The search runs in short calls of :func:`resume`. Nothing depends on how its work is divided into calls.
"""

from __future__ import annotations

from rrtik_ompl.kernels.layout import FREE, UNDECIDED
from rrtik_ompl.kernels.record import Wholes
from rrtik_ompl.kernels.search import connect_layout
from rrtik_ompl.kernels.search.bounded.cost_kernels import note_cost
from rrtik_ompl.kernels.search.box_kernels import copy_inside
from rrtik_ompl.kernels.search.connect_layout import ConnectTable
from rrtik_ompl.kernels.search.connect_motions import (
    aim_at_sample,
    aim_at_vertex,
    aim_straight,
    check_candidate,
    dof_in,
    set_row_values,
    tree_of,
)
from rrtik_ompl.kernels.search.connect_outcomes import (
    ask_for_candidate,
    on_blocked,
    on_free,
    resume_after_answers,
    write_path,
)
from rrtik_ompl.kernels.search.motions.motion_kernels import configuration_free
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration, row_at
from rrtik_ompl.kernels.search.tree_kernels import add_vertex, clear_tree, is_full
from rrtik_ompl.kernels.search.tree_layout import CERTAIN, NO_PARENT, OPEN
from rrtik_ompl.kernels.simd.compiled import entry, inlined, kernel
from rrtik_ompl.kernels.simd.random_kernels import next_share, start_points


@kernel
def candidate(search: ConnectTable) -> bool:
    """Choose the next motion to check; False if there is none this time."""
    phase = search.phase
    if phase == connect_layout.CONNECT:
        side, start = search.growing, search.start
        if aim_at_vertex(search, side, start, search.target):
            return True
        search.phase = connect_layout.EXTEND
        return False
    if phase == connect_layout.STRAIGHT:
        if aim_straight(search):
            return True
        search.phase = connect_layout.EXTEND
        return False
    return aim_at_sample(search)


@kernel
def advance(search: ConnectTable) -> int:
    """Check one motion and do what follows from that; returns the status."""
    if not candidate(search):
        return connect_layout.RUNNING
    answer = check_candidate(search)
    if answer == UNDECIDED and search.resolve != 0:
        if search.rejected < search.patience:
            return on_free(search, OPEN)
        ask_for_candidate(search)
        return connect_layout.ASKING
    if answer == FREE:
        return on_free(search, CERTAIN)
    on_blocked(search)
    return connect_layout.RUNNING


@inlined
def lacks_room(search: ConnectTable) -> bool:
    """Whether one of the trees has no room for one more vertex."""
    full: bool = is_full(tree_of(search, 0)) or is_full(tree_of(search, 1))
    return full


@inlined
def samples_spent(search: ConnectTable) -> bool:
    """Whether the next motion wants a sample, and there may be no more."""
    spent: bool = search.iterations >= search.limit
    return spent and search.phase == connect_layout.EXTEND


@kernel
def search_on(search: ConnectTable, budget: int) -> int:
    """Search on for at most ``budget`` motions or samples; returns the status.

    ASKING: there are questions in the table; write the answers (1 for free) and call again. FULL: a tree needs room.
    """
    status = connect_layout.RUNNING
    if search.asked != connect_layout.NO_QUESTION:
        if lacks_room(search):
            return connect_layout.FULL
        status = resume_after_answers(search)
    while status == connect_layout.RUNNING and budget > 0:
        if lacks_room(search):
            return connect_layout.FULL
        if samples_spent(search):
            return connect_layout.EXHAUSTED
        status = advance(search)
        budget -= 1
    return status


@kernel
def load_row(search: ConnectTable, source: Configuration) -> bool:
    """Set the row to a configuration; False if that is outside the box."""
    lower, upper = search.lower, search.upper
    if not copy_inside(dof_in(search), source, lower, upper, search.row):
        return False
    set_row_values(search)
    return True


@kernel
def plant_roots(search: ConnectTable, side: int, rows: Configuration, count: int) -> int:
    """Make the rows the roots of a tree; returns the number of the first one outside the box, or -1."""
    tree = tree_of(search, side)
    row, values = search.row, search.row_values
    clear_tree(tree)
    for k in range(count):
        if not load_row(search, row_at(rows, dof_in(search), k)):
            return k
        note_cost(search, tree, add_vertex(tree, row, values, NO_PARENT, CERTAIN, connect_layout.UNBOUNDED_DOMAIN))
    return -1


@entry
def rows_free(search: ConnectTable, count: int) -> int:
    """Whether all starts are in the box and proven free: 1 if they are, 0 if one may not be."""
    for k in range(count):
        if not load_row(search, row_at(search.start_rows, dof_in(search), k)):
            return 0
        if not configuration_free(search.motions, search.row):
            return 0
    return 1


@kernel
def begin_between(
    search: ConnectTable, start_rows: Configuration, starts: int, goal_rows: Configuration, goals: int, seed: int
) -> int:
    """Start anew from roots at two addresses; returns -1, or the number of a root that is outside the box."""
    search.iterations = 0
    search.rejected = 0
    search.checked = 0
    search.straight_tried = 0
    search.asked = connect_layout.NO_QUESTION
    search.questions = 0
    search.grower = 0
    search.phase = connect_layout.STRAIGHT
    search.goal_count = goals
    search.random = seed
    next_share(search)
    start_points(search, search.point, dof_in(search))
    outside = plant_roots(search, 0, start_rows, starts)
    if outside >= 0:
        return outside
    outside = plant_roots(search, 1, goal_rows, goals)
    return starts + outside if outside >= 0 else -1


@entry
def keep_path(search: ConnectTable) -> int:
    """Keep the path in the table, if there is room for it; returns its number of rows."""
    count = write_path(search, search.path, search.path_capacity)
    search.path_rows = count
    return count


@entry
def resume(search: ConnectTable, budget: int) -> int:
    """:func:`search_on`; where it ends with a path, that is kept."""
    status = search_on(search, budget)
    if status == connect_layout.SOLVED:
        keep_path(search)
    return status


@entry
def solve(search: ConnectTable, starts: int, goals: int, seed: int, budget: int) -> int:
    """Search anew between the roots in the table, for at most ``budget`` motions or samples; returns the status.

    OUTSIDE less k: root number k is not in the box, goals counted after the starts.
    """
    start_rows, goal_rows = search.start_rows, search.goal_rows
    outside = begin_between(search, start_rows, starts, goal_rows, goals, seed)
    return connect_layout.OUTSIDE - outside if outside >= 0 else resume(search, budget)


@kernel
def refuse_all(search: ConnectTable) -> int:
    """Answer that none of what is asked is free; returns how many there were."""
    count: int = search.questions
    for k in range(count):
        search.answers[k] = 0
    return count


@entry
def solve_each(
    search: ConnectTable,
    ends: Configuration,
    seeds: Wholes,
    count: int,
    budget: int,
    paths: Configuration,
    capacity: int,
    results: Wholes,
) -> int:
    """Search for one query after the other; of what is asked none is free, so it is never asked.

    ``ends``: a start and a goal each. ``budget``: motions and samples for all of them. ``paths``: room for ``capacity``
    rows, one path behind the other. ``results``: see RESULT_NUMBERS; RUNNING if it was not searched to its end.
    """
    dof, used = dof_in(search), 0
    for k in range(count):
        status, rows, questions = connect_layout.RUNNING, 0, 0
        start, goal = row_at(ends, dof, 2 * k), row_at(ends, dof, 2 * k + 1)
        if budget > 0 and begin_between(search, start, 1, goal, 1, seeds[k]) < 0:
            status = search_on(search, budget)
            while status == connect_layout.ASKING:
                questions += refuse_all(search)
                status = search_on(search, budget)
            budget -= search.iterations + search.checked
            if status == connect_layout.SOLVED:
                rows = write_path(search, row_at(paths, dof, used), capacity - used)
            if rows > capacity - used:
                status, rows = connect_layout.RUNNING, 0
        place = connect_layout.RESULT_NUMBERS * k
        results[place] = status
        results[place + 1] = rows
        results[place + 2] = search.iterations
        results[place + 3] = search.checked
        results[place + 4] = tree_of(search, 0).size + tree_of(search, 1).size
        results[place + 5] = questions
        results[place + 6] = search.rejected
        used += rows
    return used
