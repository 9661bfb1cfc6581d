"""A look at a path, and its repair, each in one call: cut from both sides, RRT-Connect between the pieces, shortcuts.

Source: DRRT-Con paper, algorithms 1 to 8. The pieces are the trees from the beginning. Added to the paper: whole
motions between the pieces are tried first, and the first samples lie near the gap, in a box that grows with each of
them until it is the whole space.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rrtik_ompl.fast.checks.check_kernels import check_part
from rrtik_ompl.fast.checks.motion_kernels import SLACK, check_motion, copy_row, joint_values
from rrtik_ompl.fast.search import connect_layout, shortcut_layout
from rrtik_ompl.fast.search import repair_layout as table
from rrtik_ompl.fast.search.connect_kernels import begin_between, resume, write_path
from rrtik_ompl.fast.search.connect_motions import distance, steps_of, tree_of
from rrtik_ompl.fast.search.shortcut_kernels import resume as resume_cuts
from rrtik_ompl.fast.search.tree_kernels import parent_of
from rrtik_ompl.fast.simd.compiled import entry, inlined, kernel
from rrtik_ompl.fast.simd.lanes import double_at, field, set_double, set_field
from rrtik_ompl.fast.tables.layout import ARM, FREE, JOINT_COUNT

STRAIGHT = 1e-9  # change of direction that is none


@inlined
def row_at(repair: int, place: int, number: int) -> Any:
    """Address of a row of GIVEN, POINTS or PATH."""
    return field(repair, place) + 8 * field(field(repair, table.SEARCH), connect_layout.DOF) * number


@kernel
def divide(repair: int, rows: int) -> bool:
    """Set POINTS to points along the path as it was given, all its waypoints among them; False if there is no room."""
    dof, count = field(field(repair, table.SEARCH), connect_layout.DOF), 1
    step = double_at(field(repair, table.NUMBERS), table.STEP)
    copy_row(dof, field(repair, table.GIVEN), field(repair, table.POINTS))
    for k in range(rows - 1):
        here, there = row_at(repair, table.GIVEN, k), row_at(repair, table.GIVEN, k + 1)
        parts = max(1, int(np.ceil(distance(dof, here, there) / step - SLACK)))
        if count + parts > field(repair, table.ROOM):
            set_field(repair, table.COUNT, count + parts)
            return False
        for part in range(1, parts + 1):
            share, point = part / parts, row_at(repair, table.POINTS, count)
            for j in range(dof):
                set_double(point, j, (1.0 - share) * double_at(here, j) + share * double_at(there, j))
            count += 1
    set_field(repair, table.COUNT, count)
    return True


@kernel
def edge_free(repair: int, edge: int) -> bool:
    """Whether the motion between a point and the next one is proven free."""
    search, cuts = field(repair, table.SEARCH), field(repair, table.CUTS)
    a, b = row_at(repair, table.POINTS, edge), row_at(repair, table.POINTS, edge + 1)
    values = field(cuts, shortcut_layout.VALUES)
    gain, offset = field(cuts, shortcut_layout.GAIN), field(cuts, shortcut_layout.OFFSET)
    dof, steps = field(search, connect_layout.DOF), steps_of(search, a, b)
    answer = check_motion(field(search, connect_layout.WORLD), dof, gain, offset, a, b, steps, values, False)
    return answer == FREE  # type: ignore[no-any-return]


@kernel
def point_free(repair: int, point: int) -> bool:
    """Whether a point is proven free."""
    search, cuts = field(repair, table.SEARCH), field(repair, table.CUTS)
    world, dof = field(search, connect_layout.WORLD), field(search, connect_layout.DOF)
    values, joints = field(cuts, shortcut_layout.VALUES), field(field(world, ARM), JOINT_COUNT)
    gain, offset = field(cuts, shortcut_layout.GAIN), field(cuts, shortcut_layout.OFFSET)
    joint_values(dof, joints, gain, offset, row_at(repair, table.POINTS, point), values)
    return check_part(world, values, values, 1, 1, 1, False) == FREE


@entry
def look(repair: int, rows: int) -> int:
    """Check the given path; the first blocked edge is looked for from either end. HIT, FREE_PATH or NO_ROOM."""
    if not divide(repair, rows):
        return table.NO_ROOM
    edges, checked = field(repair, table.COUNT) - 1, 0
    for k in range(edges):
        a, b = row_at(repair, table.POINTS, k), row_at(repair, table.POINTS, k + 1)
        checked += steps_of(field(repair, table.SEARCH), a, b) + 1
    set_field(repair, table.CHECKED, checked)
    first = 0
    while first < edges and edge_free(repair, first):
        first += 1
    last = edges - 1
    while last > first and edge_free(repair, last):
        last -= 1
    set_field(repair, table.FIRST, first)
    set_field(repair, table.LAST, last)
    return table.FREE_PATH if first == edges else table.HIT


@kernel
def sample_near(repair: int, first: int, second: int) -> None:
    """Let the first samples lie around the middle of two points."""
    search = field(repair, table.SEARCH)
    a, b = row_at(repair, table.POINTS, first), row_at(repair, table.POINTS, second)
    dof = field(search, connect_layout.DOF)
    for k in range(dof):
        set_double(field(search, connect_layout.CENTRE), k, 0.5 * (double_at(a, k) + double_at(b, k)))
    spread = double_at(field(repair, table.NUMBERS), table.NEAR) * distance(dof, a, b)
    set_double(field(search, connect_layout.NUMBERS), connect_layout.SPREAD, spread)


@entry
def repair(table_: int, seed: int, forgetting: int, budget: int) -> int:
    """After a look that found the path hit: join its pieces, or plan from scratch if ``forgetting``.

    Returns the number of rows of the new PATH. NOT_YET: the search needs more than ``budget`` motions, or room; go on
    with it and call :func:`finish`. NO_WAY: an end is blocked, or the search has come to its end.
    """
    edges = field(table_, table.COUNT) - 1
    if field(table_, table.FIRST) == 0 and not point_free(table_, 0):
        return table.NO_WAY
    if field(table_, table.LAST) == edges - 1 and not point_free(table_, edges):
        return table.NO_WAY
    if forgetting:
        set_field(table_, table.FIRST, 0)
        set_field(table_, table.LAST, edges - 1)
    first, second, search = field(table_, table.FIRST), field(table_, table.LAST) + 1, field(table_, table.SEARCH)
    starts, goals = row_at(table_, table.POINTS, 0), row_at(table_, table.POINTS, second)
    if begin_between(search, starts, first + 1, goals, edges - second + 1, seed) >= 0:
        return table.NO_WAY
    if forgetting:
        set_double(field(search, connect_layout.NUMBERS), connect_layout.SPREAD, connect_layout.EVERYWHERE)
    else:
        sample_near(table_, first, second)
    status = resume(search, budget)
    if status == connect_layout.EXHAUSTED:
        return table.NO_WAY
    return finish(table_, seed) if status == connect_layout.SOLVED else table.NOT_YET


@kernel
def root_of(tree: int, vertex: int) -> int:
    """The root that a vertex hangs on."""
    while parent_of(tree, vertex) >= 0:
        vertex = parent_of(tree, vertex)
    return vertex


@kernel
def append(repair: int, count: int, row: int) -> int:
    """Add a row to PATH, in place of the last one if the way goes straight on there; the number of rows then."""
    dof = field(field(repair, table.SEARCH), connect_layout.DOF)
    if count > 0 and distance(dof, row_at(repair, table.PATH, count - 1), row) == 0.0:
        return count
    if count > 1:
        before, last = row_at(repair, table.PATH, count - 2), row_at(repair, table.PATH, count - 1)
        one, two, turn = distance(dof, before, last), distance(dof, last, row), 0.0
        for k in range(dof):
            here = double_at(last, k)
            gap = (here - double_at(before, k)) / one - (double_at(row, k) - here) / two
            turn += gap * gap
        if turn <= STRAIGHT * STRAIGHT:
            count -= 1
    copy_row(dof, row, row_at(repair, table.PATH, count))
    return count + 1


@kernel
def shorten(repair: int, rows: int, seed: int) -> None:
    """Shorten the route of CUTS, which has that many rows."""
    cuts = field(repair, table.CUTS)
    for place in (shortcut_layout.TRIES, shortcut_layout.FAILURES, shortcut_layout.GAINS, shortcut_layout.QUESTIONS):
        set_field(cuts, place, 0)
    set_field(cuts, shortcut_layout.COUNT, rows)
    set_field(cuts, shortcut_layout.RANDOM, seed)
    set_field(cuts, shortcut_layout.MOST_TRIES, field(repair, table.TRIES))
    set_field(cuts, shortcut_layout.PATIENCE, field(repair, table.PATIENCE))
    resume_cuts(cuts, field(repair, table.TRIES) + 1)


@entry
def finish(repair: int, seed: int) -> int:
    """Write the PATH that a search has found, what is new of it shortened; its rows, or LONG if there is no room."""
    search, cuts = field(repair, table.SEARCH), field(repair, table.CUTS)
    dof, route = field(search, connect_layout.DOF), field(cuts, shortcut_layout.ROUTE)
    begin = root_of(tree_of(search, 0), field(search, connect_layout.MEETINGS))
    end = field(repair, table.LAST) + 1
    end += root_of(tree_of(search, 1), field(search, connect_layout.MEETINGS + 1))
    new = write_path(search, route, field(repair, table.ROOM))
    if new > field(repair, table.ROOM):
        return table.LONG
    shorten(repair, new, seed)
    rows = 0
    for k in range(begin):
        rows = append(repair, rows, row_at(repair, table.POINTS, k))
    for k in range(field(cuts, shortcut_layout.COUNT)):
        rows = append(repair, rows, route + 8 * dof * k)
    for k in range(end + 1, field(repair, table.COUNT)):
        rows = append(repair, rows, row_at(repair, table.POINTS, k))
    return rows
