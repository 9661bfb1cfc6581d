"""A path's check, and its repair, each in one call: cut from both sides, RRT-Connect between the pieces, shortcuts.

Source: [8; 1, ch. 5.2, algorithms 6 to 8]. The pieces are the trees from the beginning. Added to them: whole
motions between the pieces are tried first, and the first samples lie near the gap, in a box that grows with each of
them until it is the whole space.
"""

from __future__ import annotations

from rrtik_ompl.kernels.layout import FREE
from rrtik_ompl.kernels.search import connect_layout, repair_layout
from rrtik_ompl.kernels.search.connect_kernels import begin_between, search_on, write_path
from rrtik_ompl.kernels.search.motions.motion_kernels import (
    check_motion,
    configuration_free,
    step_count,
    whole_steps,
)
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration, copy_row, distance, row_at
from rrtik_ompl.kernels.search.repair_layout import RepairTable
from rrtik_ompl.kernels.search.shortcut_kernels import resume as resume_shortcuts
from rrtik_ompl.kernels.search.tree_kernels import parent_of
from rrtik_ompl.kernels.search.tree_layout import TreeTable
from rrtik_ompl.kernels.search.two_trees_kernels import meeting_of, tree_of
from rrtik_ompl.kernels.simd.compiled import entry, inlined, kernel

DIRECTION_TOLERANCE = 1e-9  # change of a unit vector that is none


@entry
def check_path(repair: RepairTable, rows: int) -> int:
    """Check the given path; the first blocked edge is searched for from either end. HIT, FREE_PATH or NO_ROOM."""
    if not divide(repair, rows):
        return repair_layout.NO_ROOM
    edges = repair.count - 1
    checked = 0
    for k in range(edges):
        checked += step_count(repair.motions, point_of(repair, k), point_of(repair, k + 1)) + 1
    repair.checked = checked

    first = 0
    while first < edges and edge_free(repair, first):
        first += 1
    last = edges - 1
    while last > first and edge_free(repair, last):
        last -= 1
    repair.first = first
    repair.last = last
    return repair_layout.FREE_PATH if first == edges else repair_layout.HIT


@entry
def repair_path(repair: RepairTable, seed: int, forgetting: int, budget: int) -> int:
    """After a check that found the path hit: join its pieces, or plan from scratch if ``forgetting``.

    Returns the number of rows of the new path. UNFINISHED: the search needs more than ``budget`` motions, or room; go
    on with it and call :func:`finish`. NO_PATH: an end is blocked, or the search has come to its end.
    """
    search = repair.search
    edges = repair.count - 1
    if repair.first == 0 and not configuration_free(repair.motions, point_of(repair, 0)):
        return repair_layout.NO_PATH
    if repair.last == edges - 1 and not configuration_free(repair.motions, point_of(repair, edges)):
        return repair_layout.NO_PATH
    if forgetting:
        repair.first = 0
        repair.last = edges - 1

    first = repair.first
    second = repair.last + 1
    starts = point_of(repair, 0)
    goals = point_of(repair, second)
    if begin_between(search, starts, first + 1, goals, edges - second + 1, seed) >= 0:
        return repair_layout.NO_PATH
    if forgetting:
        search.spread = connect_layout.UNBOUNDED_SPREAD
    else:
        sample_near(repair, first, second)

    status = search_on(search, budget)
    if status == connect_layout.EXHAUSTED:
        return repair_layout.NO_PATH
    return finish(repair, seed) if status == connect_layout.SOLVED else repair_layout.UNFINISHED


@entry
def finish(repair: RepairTable, seed: int) -> int:
    """Write the path that a search has found, what is new of it shortened; its rows, or TOO_LONG without room."""
    search = repair.search
    cuts = repair.shortcuts
    new = write_path(search, cuts.route, repair.capacity)
    if new > repair.capacity:
        return repair_layout.TOO_LONG
    shorten(repair, new, seed)

    begin = root_of(tree_of(search, 0), meeting_of(search, 0))  # where the new part leaves the path
    end = repair.last + 1 + root_of(tree_of(search, 1), meeting_of(search, 1))
    rows = 0
    for k in range(begin):
        rows = append(repair, rows, point_of(repair, k))
    for k in range(cuts.count):
        rows = append(repair, rows, row_at(cuts.route, repair.motions.dof, k))
    for k in range(end + 1, repair.count):
        rows = append(repair, rows, point_of(repair, k))
    return rows


@inlined
def given(repair: RepairTable, number: int) -> Configuration:
    """Address of a waypoint of the path as it was given."""
    return row_at(repair.given, repair.motions.dof, number)


@inlined
def point_of(repair: RepairTable, number: int) -> Configuration:
    """Address of a point along the path."""
    return row_at(repair.points, repair.motions.dof, number)


@inlined
def repaired(repair: RepairTable, number: int) -> Configuration:
    """Address of a waypoint of the repaired path."""
    return row_at(repair.path, repair.motions.dof, number)


@kernel
def divide(repair: RepairTable, rows: int) -> bool:
    """Set points along the path as it was given, all its waypoints among them; False if there is no room."""
    dof = repair.motions.dof
    copy_row(dof, given(repair, 0), point_of(repair, 0))
    count = 1
    for k in range(rows - 1):
        here = given(repair, k)
        there = given(repair, k + 1)
        parts = whole_steps(distance(dof, here, there) / repair.step)
        if count + parts > repair.capacity:
            repair.count = count + parts
            return False
        for part in range(1, parts + 1):
            share = part / parts
            point = point_of(repair, count)
            for j in range(dof):
                point[j] = (1.0 - share) * here[j] + share * there[j]
            count += 1
    repair.count = count
    return True


@kernel
def edge_free(repair: RepairTable, edge: int) -> bool:
    """Whether the motion between a point and the next one is proven free."""
    answer: int = check_motion(repair.motions, point_of(repair, edge), point_of(repair, edge + 1), False)
    return answer == FREE


@kernel
def sample_near(repair: RepairTable, first: int, second: int) -> None:
    """Let the first samples lie around the middle of two points."""
    search = repair.search
    dof = repair.motions.dof
    a = point_of(repair, first)
    b = point_of(repair, second)
    for k in range(dof):
        search.centre[k] = 0.5 * (a[k] + b[k])
    search.spread = repair.box_ratio * distance(dof, a, b)


@kernel
def root_of(tree: TreeTable, vertex: int) -> int:
    """The root that a vertex hangs on."""
    while parent_of(tree, vertex) >= 0:
        vertex = parent_of(tree, vertex)
    return vertex


@kernel
def shorten(repair: RepairTable, rows: int, seed: int) -> None:
    """Shorten the route of the shortcuts, which has that many rows."""
    cuts = repair.shortcuts
    cuts.tries = 0
    cuts.failures = 0
    cuts.gains = 0
    cuts.questions = 0
    cuts.count = rows
    cuts.random = seed
    cuts.max_tries = repair.tries
    cuts.patience = repair.patience
    resume_shortcuts(cuts, repair.tries + 1)


@kernel
def append(repair: RepairTable, count: int, row: Configuration) -> int:
    """Add a row to the path, in place of the last one if the path goes straight on there; the number of rows then."""
    dof = repair.motions.dof
    if count > 0 and distance(dof, repaired(repair, count - 1), row) == 0.0:
        return count
    if count > 1:
        before = repaired(repair, count - 2)
        last = repaired(repair, count - 1)
        to_last = distance(dof, before, last)
        to_row = distance(dof, last, row)
        turn = 0.0  # squared, of the direction
        for k in range(dof):
            change = (last[k] - before[k]) / to_last - (row[k] - last[k]) / to_row
            turn += change * change
        if turn <= DIRECTION_TOLERANCE * DIRECTION_TOLERANCE:
            count -= 1
    copy_row(dof, row, repaired(repair, count))
    return count + 1
