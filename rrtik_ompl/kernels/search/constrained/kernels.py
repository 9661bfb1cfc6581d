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

from rrtik_ompl.kernels.record import Ints
from rrtik_ompl.kernels.search.box_kernels import copy_inside
from rrtik_ompl.kernels.search.constrained import layout
from rrtik_ompl.kernels.search.constrained.layout import ConstrainedTable, HeldTable
from rrtik_ompl.kernels.search.constrained.projection_kernels import project
from rrtik_ompl.kernels.search.constrained.walk_kernels import (
    UNBOUNDED_DOMAIN,
    nearest_to,
    set_row_values,
    tree_of,
    walk,
)
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration, copy_row, distance, row_at
from rrtik_ompl.kernels.search.tree_kernels import (
    add_vertex,
    clear_tree,
    cut_branch,
    radius_of,
    row_of,
)
from rrtik_ompl.kernels.search.tree_layout import CERTAIN, NO_PARENT
from rrtik_ompl.kernels.simd.compiled import entry, inlined, kernel
from rrtik_ompl.kernels.simd.random_kernels import next_point, next_share, start_points

MAX_STRAIGHT_WALKS = 16


@inlined
def lacks_room(search: ConstrainedTable) -> bool:
    """Whether a tree may not have room for the vertices of one sample."""
    a, b = tree_of(search, 0), tree_of(search, 1)
    room = search.walk_room
    lacks: bool = a.size + room >= a.capacity or b.size + room >= b.capacity
    return lacks


@kernel
def draw(search: ConstrainedTable) -> None:
    """Set AIM to the next sample of the box."""
    point, dof = search.point, search.motions.dof
    next_point(search, point, search.inverse_bases, dof)
    for k in range(dof):
        low, high = search.lower[k], search.upper[k]
        search.aim[k] = low + (high - low) * point[k]


@kernel
def meet(search: ConstrainedTable, side: int, vertex: int) -> int:
    """Walk from the other tree to a vertex of this one; returns the status."""
    other, dof = 1 - side, search.motions.dof
    copy_row(dof, row_of(tree_of(search, side), vertex), search.aim)
    near = nearest_to(search, other, search.aim)
    last, reached = walk(search, other, near, True)
    if not reached:
        return layout.RUNNING
    search.start_meeting = vertex if side == 0 else last
    search.goal_meeting = last if side == 0 else vertex
    return layout.SOLVED


@kernel
def advance(search: ConstrainedTable) -> int:
    """Grow the trees towards one sample, or the tree of the starts straight to one goal; returns the status."""
    goal = search.straight_tried
    if goal < min(search.goal_count, MAX_STRAIGHT_WALKS):
        search.straight_tried += 1
        return meet(search, 1, goal)
    search.iterations += 1
    side = 1 - search.grower
    if tree_of(search, side).live > tree_of(search, 1 - side).live:
        side = 1 - side
    search.grower = side
    draw(search)
    tree, near = tree_of(search, side), nearest_to(search, side, search.aim)
    if distance(search.motions.dof, row_of(tree, near), search.aim) > radius_of(tree, near):
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
        if search.iterations >= search.limit:
            return layout.EXHAUSTED
        status = advance(search)
        budget -= 1
    return status


@kernel
def load_row(search: ConstrainedTable, source: Configuration) -> bool:
    """Set ROW to a configuration; False if that is outside the box."""
    lower, upper = search.lower, search.upper
    if not copy_inside(search.motions.dof, source, lower, upper, search.row):
        return False
    set_row_values(search)
    return True


@kernel
def plant_roots(search: ConstrainedTable, side: int, rows: Configuration, count: int) -> int:
    """Make the rows the roots of a tree; returns the number of the first one outside the box, or -1."""
    tree = tree_of(search, side)
    clear_tree(tree)
    for k in range(count):
        if not load_row(search, row_at(rows, search.motions.dof, k)):
            return k
        add_vertex(tree, search.row, search.row_values, NO_PARENT, CERTAIN, UNBOUNDED_DOMAIN)
    return -1


@entry
def solve(search: ConstrainedTable, starts: int, goals: int, seed: int, budget: int) -> int:
    """Search anew between the roots in the table, with at most ``budget`` samples; returns the status.

    OUTSIDE less k: root number k is not in the box, goals counted after the starts.
    """
    search.iterations = 0
    search.checked = 0
    search.straight_tried = 0
    search.grower = 0
    search.goal_count = goals
    search.random = seed
    search.step = search.longest
    next_share(search)
    start_points(search, search.point, search.motions.dof)
    outside = plant_roots(search, 0, search.start_rows, starts)
    if outside >= 0:
        return layout.OUTSIDE - outside
    outside = plant_roots(search, 1, search.goal_rows, goals)
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
    dof = search.motions.dof
    search.step = search.longest
    search.checked = 0
    if plant_roots(search, 0, search.start_rows, 1) >= 0:
        return 0
    copy_row(dof, search.goal_rows, search.aim)
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
