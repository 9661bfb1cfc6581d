"""Two trees that grow towards each other along path constraints, in kernels.

Source: CBiRRT2 [17, section 5]; the smaller tree grows [5]; dynamic domain [6]. The search, and the kernels of it::

    while samples < limit:
        sample = next_sample(box)                    # draw
        near = nearest(trees[side], sample)          # nearest_to
        reached = walk(trees[side], near, sample)    # walk: short steps, each projected, bounded and checked
        other = nearest(trees[1 - side], reached)
        if walk(trees[1 - side], other, reached) == reached: return path
"""

from __future__ import annotations

from rrtik_ompl.kernels.layout import IntArray
from rrtik_ompl.kernels.search.box_kernels import copy_inside
from rrtik_ompl.kernels.search.constrained import layout
from rrtik_ompl.kernels.search.constrained.layout import ConstrainedTable, HeldTable
from rrtik_ompl.kernels.search.constrained.projection_kernels import project
from rrtik_ompl.kernels.search.constrained.region_kernels import dof_of as held_dof_of
from rrtik_ompl.kernels.search.constrained.walk_kernels import (
    UNBOUNDED_DOMAIN,
    aim_in,
    motions_of,
    nearest_to,
    number_of,
    row_in,
    row_values_in,
    set_number,
    set_row_values,
    tree_of,
    walk,
)
from rrtik_ompl.kernels.search.motions.motion_kernels import dof_of
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration, copy_row, distance, row_at
from rrtik_ompl.kernels.search.tree_kernels import (
    add_vertex,
    capacity_of,
    clear_tree,
    cut_branch,
    live_of,
    radius_of,
    row_of,
    size_of,
)
from rrtik_ompl.kernels.search.tree_layout import CERTAIN, NO_PARENT
from rrtik_ompl.kernels.simd.access import count_up
from rrtik_ompl.kernels.simd.compiled import entry, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import double_at, field, set_double, set_field, set_int
from rrtik_ompl.kernels.simd.random_kernels import next_point_at, next_share_at, start_points_at

MAX_STRAIGHT_WALKS = 16


@inlined
def lacks_room(search: ConstrainedTable) -> bool:
    """Whether a tree may not have room for the vertices of one sample."""
    a, b = tree_of(search, 0), tree_of(search, 1)
    room = field(search, layout.WALK_ROOM)
    lacks: bool = size_of(a) + room >= capacity_of(a) or size_of(b) + room >= capacity_of(b)
    return lacks


@kernel
def draw(search: ConstrainedTable) -> None:
    """Set AIM to the next sample of the box."""
    point, dof = field(search, layout.POINT), dof_of(motions_of(search))
    next_point_at(search, layout.RANDOM, point, field(search, layout.INVERSE_BASES), dof)
    for k in range(dof):
        low, high = double_at(field(search, layout.LOWER), k), double_at(field(search, layout.UPPER), k)
        set_double(aim_in(search), k, low + (high - low) * double_at(point, k))


@kernel
def meet(search: ConstrainedTable, side: int, vertex: int) -> int:
    """Walk from the other tree to a vertex of this one; returns the status."""
    other, dof = 1 - side, dof_of(motions_of(search))
    copy_row(dof, row_of(tree_of(search, side), vertex), aim_in(search))
    near = nearest_to(search, other, aim_in(search))
    last, reached = walk(search, other, near, True)
    if not reached:
        return layout.RUNNING
    set_field(search, layout.START_MEETING + side, vertex)
    set_field(search, layout.START_MEETING + other, last)
    return layout.SOLVED


@kernel
def advance(search: ConstrainedTable) -> int:
    """Grow the trees towards one sample, or the tree of the starts straight to one goal; returns the status."""
    goal = field(search, layout.STRAIGHT_TRIED)
    if goal < min(field(search, layout.GOAL_COUNT), MAX_STRAIGHT_WALKS):
        count_up(search, layout.STRAIGHT_TRIED)
        return meet(search, 1, goal)
    count_up(search, layout.ITERATIONS)
    side = 1 - field(search, layout.GROWER)
    if live_of(tree_of(search, side)) > live_of(tree_of(search, 1 - side)):
        side = 1 - side
    set_field(search, layout.GROWER, side)
    draw(search)
    tree, near = tree_of(search, side), nearest_to(search, side, aim_in(search))
    if distance(dof_of(motions_of(search)), row_of(tree, near), aim_in(search)) > radius_of(tree, near):
        return layout.RUNNING
    last, _ = walk(search, side, near, False)
    return meet(search, side, last)


@entry
def resume(search: ConstrainedTable, budget: int) -> int:
    """Search on with at most ``budget`` samples; returns the status. FULL: a tree needs room."""
    status = layout.RUNNING
    while status == layout.RUNNING and budget > 0:
        if lacks_room(search):
            return layout.FULL
        if field(search, layout.ITERATIONS) >= field(search, layout.LIMIT):
            return layout.EXHAUSTED
        status = advance(search)
        budget -= 1
    return status


@kernel
def load_row(search: ConstrainedTable, source: Configuration) -> bool:
    """Set ROW to a configuration; False if that is outside the box."""
    lower, upper = field(search, layout.LOWER), field(search, layout.UPPER)
    if not copy_inside(dof_of(motions_of(search)), source, lower, upper, row_in(search)):
        return False
    set_row_values(search)
    return True


@kernel
def plant_roots(search: ConstrainedTable, side: int, rows: Configuration, count: int) -> int:
    """Make the rows the roots of a tree; returns the number of the first one outside the box, or -1."""
    tree = tree_of(search, side)
    clear_tree(tree)
    for k in range(count):
        if not load_row(search, row_at(rows, dof_of(motions_of(search)), k)):
            return k
        add_vertex(tree, row_in(search), row_values_in(search), NO_PARENT, CERTAIN, UNBOUNDED_DOMAIN)
    return -1


@entry
def solve(search: ConstrainedTable, starts: int, goals: int, seed: int, budget: int) -> int:
    """Search anew between the roots in the table, with at most ``budget`` samples; returns the status.

    OUTSIDE less k: root number k is not in the box, goals counted after the starts.
    """
    for place in (layout.ITERATIONS, layout.CHECKED, layout.STRAIGHT_TRIED, layout.GROWER):
        set_field(search, place, 0)
    set_field(search, layout.GOAL_COUNT, goals)
    set_field(search, layout.RANDOM, seed)
    set_number(search, layout.STEP, number_of(search, layout.LONGEST))
    next_share_at(search, layout.RANDOM)
    start_points_at(search, layout.RANDOM, field(search, layout.POINT), dof_of(motions_of(search)))
    outside = plant_roots(search, 0, field(search, layout.START_ROWS), starts)
    if outside >= 0:
        return layout.OUTSIDE - outside
    outside = plant_roots(search, 1, field(search, layout.GOAL_ROWS), goals)
    return layout.OUTSIDE - starts - outside if outside >= 0 else resume(search, budget)


@entry
def reject(search: ConstrainedTable, side: int, vertex: int) -> int:
    """Cut off a vertex to which the motion is not free; returns how many vertices of its tree are left."""
    left: int = cut_branch(tree_of(search, side), vertex)
    return left


@entry
def connect(search: ConstrainedTable) -> int:
    """Walk from the first row of START_ROWS to the first of GOAL_ROWS in the tree of the starts.

    Returns:
        How many vertices that took, its rows in order; 0 if it does not get there.
    """
    dof = dof_of(motions_of(search))
    set_number(search, layout.STEP, number_of(search, layout.LONGEST))
    set_field(search, layout.CHECKED, 0)
    if plant_roots(search, 0, field(search, layout.START_ROWS), 1) >= 0:
        return 0
    copy_row(dof, field(search, layout.GOAL_ROWS), aim_in(search))
    last, reached = walk(search, 0, 0, True)
    return last + 1 if reached else 0


@entry
def project_rows(held: HeldTable, rows: Configuration, count: int, steps: int, reached: IntArray) -> int:
    """Move rows into the regions; int32 whether each is there. Returns how many are."""
    there = 0
    for k in range(count):
        arrived = 1 if project(held, row_at(rows, held_dof_of(held), k), steps) else 0
        set_int(reached, k, arrived)
        there += arrived
    return there
