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

import numpy as np

from rrtik_ompl.fast import connect_layout as table
from rrtik_ompl.fast.compiled import entry, inlined, kernel
from rrtik_ompl.fast.kernels import judge_part
from rrtik_ompl.fast.lanes import double_at, field, float_at, int_at, set_double, set_field, set_float, set_int
from rrtik_ompl.fast.layout import FREE, UNDECIDED
from rrtik_ompl.fast.random_kernels import next_point, next_share, start_points
from rrtik_ompl.fast.tree_kernels import (
    add_vertex,
    clear_tree,
    cut_branch,
    nearest_vertex,
    parent_of,
    row_of,
    state_of,
    values_of,
)
from rrtik_ompl.fast.tree_layout import CAPACITY, CERTAIN, CUT, LIVE, OPEN, RADII, SIZE, STATES

MOST_STRAIGHT = 16
NO_DOMAIN = 1e30
OUTSIDE = 1e-6  # how far a start or goal may lie outside the bounds, as robots and spaces tolerate a little too
SLACK = 1e-9  # as in World.steps


@inlined
def number(search: int, place: int) -> Any:
    """One of the numbers."""
    return double_at(field(search, table.NUMBERS), place)


@inlined
def tree_of(search: int, side: int) -> Any:
    """The tree from the starts (0) or from the goals (1)."""
    return field(search, table.TREES + side)


@inlined
def count_up(search: int, place: int) -> None:
    """Add 1 to a field."""
    set_field(search, place, field(search, place) + 1)


@kernel
def lift(search: int, row: int, values: int) -> None:
    """Joint values of a configuration, unless they are the configuration itself."""
    if row != values:
        dof, gain = field(search, table.DOF), field(search, table.GAIN)
        for joint in range(field(search, table.JOINTS)):
            total = 0.0
            for k in range(dof):
                total += double_at(gain, joint * dof + k) * double_at(row, k)
            set_double(values, joint, total + double_at(field(search, table.OFFSET), joint))


@kernel
def distance(dof: int, one: int, two: int) -> float:
    """Euclidean distance of two configurations."""
    total = 0.0
    for k in range(dof):
        gap = double_at(two, k) - double_at(one, k)
        total += gap * gap
    return np.sqrt(total)  # type: ignore[no-any-return]


@kernel
def nearest_to(search: int, side: int, row: int) -> Any:
    """The vertex of a tree that is nearest to a configuration."""
    query = field(search, table.QUERY)
    for k in range(field(search, table.DOF)):
        set_float(query, k, np.float32(double_at(row, k)))
    return nearest_vertex(tree_of(search, side), query)


@kernel
def steer(search: int, start: int, aim: int, length: float) -> Any:
    """Set ROW to ``aim``, or to the point at the range on the way there; tells whether it is ``aim``."""
    row, span = field(search, table.ROW), number(search, table.RANGE)
    reached = length <= span * (1.0 + SLACK)
    for k in range(field(search, table.DOF)):
        there = double_at(aim, k)
        if not reached:
            here = double_at(start, k)
            there = here + (there - here) * (span / length)
        set_double(row, k, there)
    lift(search, row, field(search, table.ROW_VALUES))
    return reached


@kernel
def steps_of(search: int, start: int, end: int) -> Any:
    """Number of steps in which a motion is checked; the rule of :meth:`rrtik_ompl.world.World.steps`."""
    travel, dof = 0.0, field(search, table.DOF)
    for k in range(dof):
        travel += double_at(field(search, table.WEIGHTS), k) * abs(double_at(end, k) - double_at(start, k))
    steps = travel / number(search, table.RESOLUTION)
    if number(search, table.STEPS_PER_UNIT) > 0.0:
        steps = max(steps, number(search, table.STEPS_PER_UNIT) * distance(dof, start, end))
    return max(1, int(np.ceil(steps - SLACK)))


@kernel
def descends(dof: int, start: int, end: int) -> Any:
    """Whether the start comes after the end in the order of their coordinates."""
    for k in range(dof):
        if double_at(start, k) != double_at(end, k):
            return double_at(start, k) > double_at(end, k)
    return False


@kernel
def judge_candidate(search: int) -> int:
    """Judge the motion from FROM to ROW at the configurations that are checked in either direction.

    The ends that are vertices are left out: they were judged with the motion that led to them, or as roots.
    """
    tree, row = tree_of(search, field(search, table.GROWING)), field(search, table.ROW)
    start, values = row_of(tree, field(search, table.FROM)), values_of(tree, field(search, table.FROM))
    last = steps_of(search, start, row)
    count = last - field(search, table.BRIDGE)
    proving = field(search, table.PROVING) != 0
    count_up(search, table.JUDGED)
    if descends(field(search, table.DOF), start, row):
        first = last - count
        return judge_part(
            field(search, table.WORLD), field(search, table.ROW_VALUES), values, last, first, count, proving
        )
    return judge_part(field(search, table.WORLD), values, field(search, table.ROW_VALUES), last, 1, count, proving)


@kernel
def aim_at_vertex(search: int, side: int, start: int, target: int) -> None:
    """The next motion: from a vertex of tree ``side`` towards a vertex of the other tree."""
    goal = row_of(tree_of(search, 1 - side), target)
    begin = row_of(tree_of(search, side), start)
    reached = steer(search, begin, goal, distance(field(search, table.DOF), begin, goal))
    set_field(search, table.GROWING, side)
    set_field(search, table.FROM, start)
    set_field(search, table.TARGET, target)
    set_field(search, table.BRIDGE, 1 if reached else 0)


@kernel
def aim_straight(search: int) -> bool:
    """The next motion: a whole one from the nearest start to the next goal. False when no goal is left."""
    goal = field(search, table.STRAIGHT_TRIED)
    if goal >= min(field(search, table.ROOTS), MOST_STRAIGHT):
        return False
    set_field(search, table.STRAIGHT_TRIED, goal + 1)
    target, row = row_of(tree_of(search, 1), goal), field(search, table.ROW)
    for k in range(field(search, table.DOF)):
        set_double(row, k, double_at(target, k))
    lift(search, row, field(search, table.ROW_VALUES))
    set_field(search, table.GROWING, 0)
    set_field(search, table.FROM, nearest_to(search, 0, target))
    set_field(search, table.TARGET, goal)
    set_field(search, table.BRIDGE, 1)
    return True


@kernel
def aim_at_sample(search: int) -> bool:
    """The next motion: from the nearest vertex of a tree towards a sample. False if that is outside its domain."""
    count_up(search, table.ITERATIONS)
    side = 1 - field(search, table.GROWER)
    if field(tree_of(search, side), LIVE) > field(tree_of(search, 1 - side), LIVE):
        side = 1 - side
    set_field(search, table.GROWER, side)
    dof, point, row = field(search, table.DOF), field(search, table.POINT), field(search, table.ROW)
    next_point(search, table.RANDOM, point, field(search, table.INVERSES), dof)
    for k in range(dof):
        low = double_at(field(search, table.LOWER), k)
        set_double(row, k, low + (double_at(field(search, table.UPPER), k) - low) * double_at(point, k))
    tree = tree_of(search, side)
    near = nearest_to(search, side, row)
    begin = row_of(tree, near)
    length = distance(dof, begin, row)
    if length > float_at(field(tree, RADII), near) or length == 0.0:
        return False
    steer(search, begin, row, length)
    set_field(search, table.GROWING, side)
    set_field(search, table.FROM, near)
    set_field(search, table.BRIDGE, 0)
    return True


@kernel
def shrink_domain(search: int, side: int, vertex: int) -> None:
    """A vertex that was blocked is given a domain."""
    set_float(field(tree_of(search, side), RADII), vertex, np.float32(number(search, table.DOMAIN)))


@kernel
def blocked(search: int) -> None:
    """The motion is not free."""
    if field(search, table.PHASE) == table.SAMPLE:
        shrink_domain(search, field(search, table.GROWING), field(search, table.FROM))
    elif field(search, table.PHASE) == table.CONNECT:
        set_field(search, table.PHASE, table.SAMPLE)


@kernel
def accepted(search: int, state: int) -> int:
    """The motion is free, or taken to be for now; returns the status."""
    side = field(search, table.GROWING)
    if field(search, table.BRIDGE) != 0:
        set_field(search, table.MEETINGS + side, field(search, table.FROM))
        set_field(search, table.MEETINGS + 1 - side, field(search, table.TARGET))
        set_field(search, table.MEETING_OPEN, state)
        return concluded(search)
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
    for k in range(dof):
        set_double(field(search, table.QUESTION_STARTS), place * dof + k, double_at(start, k))
        set_double(field(search, table.QUESTION_ENDS), place * dof + k, double_at(end, k))
    set_int(field(search, table.QUESTION_TREES), place, side)
    set_int(field(search, table.QUESTION_VERTICES), place, vertex)
    set_field(search, table.QUESTIONS, place + 1)
    set_field(search, table.ASKED, kind)


@kernel
def concluded(search: int) -> int:
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
def settled(search: int) -> int:
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
        return concluded(search)
    count_up(search, table.REJECTED)
    if field(search, table.PHASE) == table.CONNECT:
        set_field(search, table.PHASE, table.SAMPLE)
    return table.RUNNING


@kernel
def answered(search: int) -> int:
    """Go on from the answers to what was asked; returns the status."""
    kind = field(search, table.ASKED)
    set_field(search, table.ASKED, table.NOTHING)
    if kind == table.PATH:
        return settled(search)
    if kind == table.MOTION:
        if int_at(field(search, table.ANSWERS), 0) != 0:
            return accepted(search, CERTAIN)
        blocked(search)
    return table.RUNNING


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
    answer = judge_candidate(search)
    if answer == UNDECIDED and field(search, table.PROVING) != 0:
        if field(search, table.REJECTED) < field(search, table.PATIENCE):
            return accepted(search, OPEN)
        set_field(search, table.QUESTIONS, 0)
        start = row_of(tree_of(search, field(search, table.GROWING)), field(search, table.FROM))
        ask(search, table.MOTION, start, field(search, table.ROW), 0, -1)
        return table.ASKING
    if answer == FREE:
        return accepted(search, CERTAIN)
    blocked(search)
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
        status = answered(search)
    while status == table.RUNNING and budget > 0:
        if is_full(search, 0) or is_full(search, 1):
            return table.FULL
        if field(search, table.PHASE) == table.SAMPLE and field(search, table.ITERATIONS) >= field(search, table.LIMIT):
            return table.EXHAUSTED
        status = advance(search)
        budget -= 1
    return status


@kernel
def plant(search: int, side: int, rows: int, count: int) -> int:
    """Make the rows the roots of a tree; returns the number of the first one outside the bounds, or -1."""
    tree, dof, row = tree_of(search, side), field(search, table.DOF), field(search, table.ROW)
    clear_tree(tree)
    for k in range(count):
        for d in range(dof):
            value = double_at(rows, k * dof + d)
            low, high = double_at(field(search, table.LOWER), d), double_at(field(search, table.UPPER), d)
            if not (value >= low - OUTSIDE and value <= high + OUTSIDE):
                return k
            set_double(row, d, value)
        lift(search, row, field(search, table.ROW_VALUES))
        add_vertex(tree, row, field(search, table.ROW_VALUES), -1, CERTAIN, NO_DOMAIN)
    return -1


@entry
def begin(search: int, starts: int, goals: int, seed: int) -> int:
    """Start anew from the roots in the table; returns -1, or the number of a root that is outside the bounds."""
    for place in (
        table.ITERATIONS,
        table.REJECTED,
        table.JUDGED,
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
    outside = plant(search, 0, field(search, table.START_ROWS), starts)
    if outside >= 0:
        return outside
    outside = plant(search, 1, field(search, table.GOAL_ROWS), goals)
    return starts + outside if outside >= 0 else -1


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
        for k in range(dof):
            set_double(rows, place * dof + k, double_at(row_of(starts, vertex), k))
        vertex = parent_of(starts, vertex)
    place = depth(starts, field(search, table.MEETINGS))
    while other >= 0:
        for k in range(dof):
            set_double(rows, place * dof + k, double_at(row_of(goals, other), k))
        place += 1
        other = parent_of(goals, other)
    return total
