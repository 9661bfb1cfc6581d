"""Two trees that grow towards each other along path constraints, in kernels.

Source: CBiRRT2 [17, section 5]; the smaller tree grows [5]; dynamic domain [6]. The search, and the kernels of it::

    while samples < limit:
        sample = next_sample(box)                    # draw
        near = nearest(trees[side], sample)          # nearest_to
        reached = walk(trees[side], near, sample)    # walk: short steps, each projected, bounded and checked
        other = nearest(trees[1 - side], reached)
        if walk(trees[1 - side], other, reached) == reached: return path

Source of a walk: [17, section 5, ConstrainedExtend of CBiRRT2]. A step is as long as the bound on motions allows:
halved where the motion would leave a region, longer again where it would not.
"""

from __future__ import annotations

from typing import Any

from rrtik_ompl.kernels.checks.check_kernels import check_part
from rrtik_ompl.kernels.layout import FREE, UNDECIDED
from rrtik_ompl.kernels.record import Ints
from rrtik_ompl.kernels.search.constrained import layout
from rrtik_ompl.kernels.search.constrained.layout import ConstrainedTable, HeldTable
from rrtik_ompl.kernels.search.constrained.projection_kernels import keeps, project
from rrtik_ompl.kernels.search.motions.motion_kernels import descends, step_count
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration, copy_row, distance, row_at
from rrtik_ompl.kernels.search.sample_kernels import draw, set_row_values
from rrtik_ompl.kernels.search.tree_kernels import (
    add_vertex,
    cut_branch,
    is_full,
    radius_of,
    row_of,
    set_radius,
    values_of,
)
from rrtik_ompl.kernels.search.tree_layout import CERTAIN, OPEN, TreeTable
from rrtik_ompl.kernels.search.two_trees_kernels import (
    nearest_to,
    next_grower,
    plant,
    plant_roots,
    set_meeting,
    tree_of,
)
from rrtik_ompl.kernels.search.two_trees_layout import UNBOUNDED_DOMAIN
from rrtik_ompl.kernels.simd.compiled import entry, inlined, kernel

MAX_STRAIGHT_WALKS = 16
PROJECTION_STEPS = 12  # of a short step; it begins near the region
FARTHEST = 2.0  # times the length of a step that projection may lead
NEARER = 0.05  # share of the length of a step by which it must come nearer
STUCK = 8.0  # times the shortest step: from there on shorter ones are not tried where a step comes no nearer
LENGTHENED = 1.6


@entry
def solve(search: ConstrainedTable, starts: int, goals: int, seed: int, budget: int) -> int:
    """Search anew between the roots in the table, with at most ``budget`` samples; returns the status.

    OUTSIDE less k: root number k is not in the box, goals counted after the starts.
    """
    search.step = search.longest
    outside = plant(search, search.start_rows, starts, search.goal_rows, goals, seed)
    return layout.OUTSIDE - outside if outside >= 0 else resume(search, budget)


@entry
def resume(search: ConstrainedTable, budget: int) -> int:
    """Search on with at most ``budget`` samples; returns the status. FULL: a tree needs room."""
    status = layout.RUNNING
    while status == layout.RUNNING and budget > 0:
        if lacks_room(search):
            return layout.FULL
        if search.iterations >= search.limit:
            return layout.EXHAUSTED
        status = advance(search)
        budget -= 1
    return status


@inlined
def lacks_room(search: ConstrainedTable) -> bool:
    """Whether a tree may not have room for the vertices of one sample."""
    a = tree_of(search, 0)
    b = tree_of(search, 1)
    room = search.walk_room
    lacks: bool = a.size + room >= a.capacity or b.size + room >= b.capacity
    return lacks


@kernel
def advance(search: ConstrainedTable) -> int:
    """Grow the trees towards one sample, or the tree of the starts straight to one goal; returns the status."""
    goal = search.straight_tried
    if goal < min(search.goal_count, MAX_STRAIGHT_WALKS):
        search.straight_tried += 1
        return meet(search, 1, goal)

    search.iterations += 1
    side = next_grower(search)
    draw(search, search.aim)
    tree = tree_of(search, side)
    near = nearest_to(search, side, search.aim)
    if distance(search.motions.dof, row_of(tree, near), search.aim) > radius_of(tree, near):
        return layout.RUNNING
    last, _ = walk(search, side, near, False)
    return meet(search, side, last)


@kernel
def meet(search: ConstrainedTable, side: int, vertex: int) -> int:
    """Walk from the other tree to a vertex of this one; returns the status."""
    other = 1 - side
    copy_row(search.motions.dof, row_of(tree_of(search, side), vertex), search.aim)
    near = nearest_to(search, other, search.aim)
    last, reached = walk(search, other, near, True)
    if not reached:
        return layout.RUNNING
    set_meeting(search, side, vertex)
    set_meeting(search, other, last)
    return layout.SOLVED


@kernel
def walk(search: ConstrainedTable, side: int, vertex: int, exact: bool) -> Any:
    """Walk from a vertex of a tree towards the aim as far as it goes; the last vertex, and whether the aim is reached.

    ``exact``: the aim is in the regions, and is to be reached itself.
    """
    tree = tree_of(search, side)
    first = vertex
    for _ in range(search.walk_room):
        if is_full(tree):
            break
        nearer, last = step_towards(search, row_of(tree, vertex), exact)
        if nearer <= 0.0:
            break
        set_row_values(search)
        answer = check_row(search, tree, vertex)
        if answer != FREE and (answer != UNDECIDED or search.resolve == 0):
            if vertex == first:
                set_radius(tree, vertex, search.domain)
            break
        state = CERTAIN if answer == FREE else OPEN
        vertex = add_vertex(tree, search.row, search.row_values, vertex, state, UNBOUNDED_DOMAIN)
        if last:
            return vertex, True
    return vertex, False


@kernel
def step_towards(search: ConstrainedTable, here: Configuration, exact: bool) -> Any:
    """Set the row to the end of a step from a vertex's configuration towards the aim, in the regions.

    Returns:
        How much nearer it is, 0 if there is no such step, and whether it is the aim itself.
    """
    aim = search.aim
    row = search.row
    held = search.held
    dof = search.motions.dof
    left = distance(dof, here, aim)
    length = min(search.step, left)
    while True:
        last = exact and length >= left
        for k in range(dof):
            row[k] = aim[k] if last else here[k] + (aim[k] - here[k]) * (length / left)
        if last or project(held, row, PROJECTION_STEPS):
            nearer = left - distance(dof, row, aim)
            if nearer < NEARER * length:
                if length <= STUCK * search.shortest:
                    return 0.0, False
            elif distance(dof, here, row) <= FARTHEST * length and keeps(held, here, row):
                if length < left:  # not a short last step: the next one may be longer
                    search.step = min(max(LENGTHENED * length, search.step), search.longest)
                return nearer, last
        length *= 0.5
        search.step = max(length, search.shortest)
        if length < search.shortest:
            return 0.0, False


@kernel
def check_row(search: ConstrainedTable, tree: TreeTable, vertex: int) -> Any:
    """Check the motion from a vertex to the row for collisions: FREE, UNDECIDED or COLLIDING."""
    if search.unchecked != 0:
        return FREE
    motions = search.motions
    start = row_of(tree, vertex)
    search.checked += 1
    last = step_count(motions, start, search.row)
    values = values_of(tree, vertex)
    others = search.row_values
    first = 1
    if descends(motions.dof, start, search.row):  # checked from the other end
        values, others = others, values
        first = 0
    return check_part(motions.world, values, others, last, first, last, search.resolve != 0)


@entry
def reject(search: ConstrainedTable, side: int, vertex: int) -> int:
    """Cut off a vertex to which the motion is not free; returns how many vertices of its tree are left."""
    left: int = cut_branch(tree_of(search, side), vertex)
    return left


@entry
def connect(search: ConstrainedTable) -> int:
    """Walk from the first row of the starts to the first of the goals in the tree of the starts.

    Returns:
        How many vertices that took, its rows in order; 0 if it does not get there.
    """
    search.step = search.longest
    search.checked = 0
    if plant_roots(search, 0, search.start_rows, 1) >= 0:
        return 0
    copy_row(search.motions.dof, search.goal_rows, search.aim)
    last, reached = walk(search, 0, 0, True)
    return last + 1 if reached else 0


@entry
def project_rows(held: HeldTable, rows: Configuration, count: int, steps: int, reached: Ints) -> int:
    """Move rows into the regions; int32 whether each is there. Returns how many are."""
    there = 0
    for k in range(count):
        arrived = 1 if project(held, row_at(rows, held.dof, k), steps) else 0
        reached[k] = arrived
        there += arrived
    return there
