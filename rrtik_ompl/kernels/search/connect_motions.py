"""The motions that RRT-Connect checks: which one is next, and whether it is free."""

from __future__ import annotations

from typing import Any

import numpy as np

from rrtik_ompl.kernels.checks.check_kernels import check_part
from rrtik_ompl.kernels.search import connect_layout
from rrtik_ompl.kernels.search.bounded.cost_kernels import from_roots, is_bounded, may_lead, vertex_for
from rrtik_ompl.kernels.search.connect_layout import ConnectTable
from rrtik_ompl.kernels.search.motions.motion_kernels import descends, set_joint_values, step_count
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration, copy_row, distance
from rrtik_ompl.kernels.search.tree_kernels import (
    cost_of,
    nearest_and_square,
    nearest_by_cost,
    nearest_vertex,
    radius_of,
    row_of,
    values_of,
)
from rrtik_ompl.kernels.search.tree_layout import TreeTable
from rrtik_ompl.kernels.simd.compiled import WIDTH, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import (
    larger,
    set_lanes,
    set_wide_lanes,
    single,
    smaller,
    wide_lanes_at,
)
from rrtik_ompl.kernels.simd.random_kernels import next_point
from rrtik_ompl.kernels.simd.records import same_place

MAX_STRAIGHT_MOTIONS = 16  # whole motions to goals that are tried first
SAMPLE_BOX_GROWTH = 1.1  # from one sample to the next, where samples begin near a place
LAST_IN_TURN = 1023  # of the samples after which the trees change the halves of the box that they are drawn from
RANGE_TOLERANCE = 1e-9  # of the range, by which a motion of the trees may be longer


@inlined
def dof_in(search: ConnectTable) -> int:
    """How many numbers a configuration has."""
    return search.motions.dof


@inlined
def tree_of(search: ConnectTable, side: int) -> TreeTable:
    """The tree from the starts (0) or from the goals (1)."""
    return search.start_tree if side == 0 else search.goal_tree


@inlined
def meeting_of(search: ConnectTable, side: int) -> Any:
    """The vertex of a tree at which it meets the other one."""
    return search.start_meeting if side == 0 else search.goal_meeting


@inlined
def set_meeting(search: ConnectTable, side: int, vertex: int) -> None:
    """Set the vertex of a tree at which it meets the other one."""
    if side == 0:
        search.start_meeting = vertex
    else:
        search.goal_meeting = vertex


@kernel
def set_row_values(search: ConnectTable) -> None:
    """Joint values of the row, unless they are the configuration itself."""
    row, values = search.row, search.row_values
    if not same_place(row, values):
        set_joint_values(search.motions, row, values)


@kernel
def nearest_to(search: ConnectTable, side: int, row: Configuration) -> Any:
    """The vertex of a tree that is nearest to a configuration."""
    query = search.query
    for k in range(dof_in(search)):
        query[k] = np.float32(row[k])
    return nearest_vertex(tree_of(search, side), query)


@kernel
def met_by(search: ConnectTable, side: int, vertex: int) -> Any:
    """The vertex of the other tree that is joined with a new one of tree ``side``."""
    tree, other, row = tree_of(search, side), tree_of(search, 1 - side), search.row
    if not is_bounded(search):
        return nearest_to(search, 1 - side, row)
    query = search.query
    for k in range(dof_in(search)):
        query[k] = np.float32(row[k])
    return nearest_by_cost(other, query, max(search.bound - cost_of(tree, vertex), 0.0))


@kernel
def steer(search: ConnectTable, start: Configuration, aim: Configuration, length: float) -> Any:
    """Set the row to ``aim``, or to the point at the range on the motion to it; returns whether it is ``aim``."""
    row, span = search.row, search.range
    reached = length <= span * (1.0 + RANGE_TOLERANCE)
    for k in range(dof_in(search)):
        there = aim[k]
        if not reached:
            here = start[k]
            there = here + (there - here) * (span / length)
        row[k] = there
    set_row_values(search)
    return reached


@kernel
def check_candidate(search: ConnectTable) -> int:
    """Check the motion from its start to the row at the configurations that are checked in either direction.

    The ends that are vertices are left out: they were checked with the motion that led to them, or as roots.
    """
    motions, tree = search.motions, tree_of(search, search.growing)
    vertex, row = search.start, search.row
    start, values = row_of(tree, vertex), values_of(tree, vertex)
    last = step_count(motions, start, row)
    count = last - search.bridge
    resolve = search.resolve != 0
    search.checked += 1
    there, first = search.row_values, 1
    if descends(motions.dof, start, row):
        values, there, first = there, values, last - count
    return check_part(motions.world, values, there, last, first, count, resolve)


@inlined
def set_candidate(search: ConnectTable, side: int, start: int, bridge: int) -> None:
    """The motion to the row starts at a vertex of tree ``side``; ``bridge`` is 1 if it ends at one of the other."""
    search.growing = side
    search.start = start
    search.bridge = bridge


@kernel
def aim_at_vertex(search: ConnectTable, side: int, start: int, target: int) -> bool:
    """The next motion: from a vertex of tree ``side`` towards one of the other tree. False if a bound forbids it."""
    goal = row_of(tree_of(search, 1 - side), target)
    if is_bounded(search):
        rest = cost_of(tree_of(search, 1 - side), target)
        if not may_lead(search, tree_of(search, side), start, goal, rest):
            return False
    begin = row_of(tree_of(search, side), start)
    reached = steer(search, begin, goal, distance(dof_in(search), begin, goal))
    search.target = target
    set_candidate(search, side, start, 1 if reached else 0)
    return True


@kernel
def aim_straight(search: ConnectTable) -> bool:
    """The next motion: a whole one from the nearest start to the next goal. False when no goal is left."""
    goal = search.straight_tried
    if goal >= min(search.goal_count, MAX_STRAIGHT_MOTIONS):
        return False
    search.straight_tried += 1
    target = row_of(tree_of(search, 1), goal)
    copy_row(dof_in(search), target, search.row)
    set_row_values(search)
    search.target = goal
    set_candidate(search, 0, nearest_to(search, 0, target), 1)
    return True


@kernel
def place_sample(search: ConnectTable) -> None:
    """Set the row and the query to where the point lies in the box of samples; the next box is larger."""
    spread = search.spread
    for block in range((dof_in(search) + WIDTH - 1) // WIDTH):
        middle = wide_lanes_at(search.centre, block)
        low = larger(wide_lanes_at(search.lower, block), middle - spread)
        high = smaller(wide_lanes_at(search.upper, block), middle + spread)
        share = wide_lanes_at(search.point, block)
        sample = low + (high - low) * share
        set_wide_lanes(search.row, block, sample)
        set_lanes(search.query, block, single(sample))
    wider = min(SAMPLE_BOX_GROWTH * spread, connect_layout.UNBOUNDED_SPREAD)
    search.spread = wider


@kernel
def nearest_inside(search: ConnectTable, side: int) -> Any:
    """The vertex of a tree to be extended towards the sample; -1 if that is outside its domain, or of no use."""
    tree = tree_of(search, side)
    if is_bounded(search):
        near = vertex_for(search, tree, tree_of(search, 1 - side), search.row)
        far = near >= 0 and distance(dof_in(search), row_of(tree, near), search.row) > radius_of(tree, near)
        return -1 if far else near
    near, square = nearest_and_square(tree, search.query)
    return -1 if np.sqrt(square) > radius_of(tree, near) else near


@kernel
def aim_at_sample(search: ConnectTable) -> bool:
    """The next motion: from the nearest vertex of a tree towards a sample. False if that is outside its domain."""
    search.iterations += 1
    side = 1 - search.grower
    if tree_of(search, side).live > tree_of(search, 1 - side).live:
        side = 1 - side
    search.grower = side
    dof, row = dof_in(search), search.row
    point, bases = search.point, search.inverse_bases
    next_point(search, point, bases, dof)
    if search.iterations & LAST_IN_TURN == 0:
        # Points of base 2 fall into the two halves of the box by turns, as the trees grow: each would see but one half.
        next_point(search, point, bases, dof)
    place_sample(search)
    tree = tree_of(search, side)
    near = nearest_inside(search, side)
    if near < 0:
        return False
    begin = row_of(tree, near)
    length = distance(dof, begin, row)
    if length == 0.0:
        return False
    steer(search, begin, row, length)
    if is_bounded(search):
        rest = from_roots(dof, tree_of(search, 1 - side), row)
        if not may_lead(search, tree, near, row, rest):
            return False
    set_candidate(search, side, near, 0)
    return True
