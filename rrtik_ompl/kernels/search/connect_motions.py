"""The motions that RRT-Connect checks: which one is next, and whether it is free."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from rrtik_ompl.kernels.checks.check_kernels import check_part
from rrtik_ompl.kernels.layout import JointValues
from rrtik_ompl.kernels.search import connect_layout
from rrtik_ompl.kernels.search.bounded.cost_kernels import bound_of, from_roots, is_bounded, may_lead, vertex_for
from rrtik_ompl.kernels.search.connect_layout import ConnectTable
from rrtik_ompl.kernels.search.motions.motion_kernels import descends, dof_of, set_joint_values, step_count, world_of
from rrtik_ompl.kernels.search.motions.motion_layout import MotionTable
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration, copy_row, distance
from rrtik_ompl.kernels.search.tree_kernels import (
    cost_of,
    live_of,
    nearest_and_square,
    nearest_by_cost,
    nearest_vertex,
    radius_of,
    row_of,
    values_of,
)
from rrtik_ompl.kernels.search.tree_layout import TreeTable
from rrtik_ompl.kernels.simd.access import count_up, field_reader
from rrtik_ompl.kernels.simd.compiled import WIDTH, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import (
    double_at,
    field,
    larger,
    set_double,
    set_field,
    set_float,
    set_lanes,
    set_wide_lanes,
    single,
    smaller,
    wide_lanes_at,
)
from rrtik_ompl.kernels.simd.random_kernels import next_point_at

MAX_STRAIGHT_MOTIONS = 16  # whole motions to goals that are tried first
SAMPLE_BOX_GROWTH = 1.1  # from one sample to the next, where samples begin near a place
LAST_IN_TURN = 1023  # of the samples after which the trees change the halves of the box that they are drawn from
RANGE_TOLERANCE = 1e-9  # of the range, by which a motion of the trees may be longer


motions_of: Callable[[ConnectTable], MotionTable] = field_reader(connect_layout.MOTIONS)
candidate_row_of: Callable[[ConnectTable], Configuration] = field_reader(connect_layout.ROW)
candidate_values_of: Callable[[ConnectTable], JointValues] = field_reader(connect_layout.ROW_VALUES)


@inlined
def dof_in(search: ConnectTable) -> int:
    """How many numbers a configuration has."""
    return dof_of(motions_of(search))


@inlined
def tree_of(search: ConnectTable, side: int) -> TreeTable:
    """The tree from the starts (0) or from the goals (1)."""
    tree: TreeTable = field(search, connect_layout.START_TREE + side)
    return tree


@inlined
def meeting_of(search: ConnectTable, side: int) -> Any:
    """The vertex of a tree at which it meets the other one."""
    return field(search, connect_layout.START_MEETING + side)


@inlined
def set_meeting(search: ConnectTable, side: int, vertex: int) -> None:
    """Set the vertex of a tree at which it meets the other one."""
    set_field(search, connect_layout.START_MEETING + side, vertex)


@inlined
def number_of(search: ConnectTable, place: int) -> Any:
    """RANGE, DOMAIN or SPREAD."""
    return double_at(field(search, connect_layout.NUMBERS), place)


@kernel
def set_row_values(search: ConnectTable) -> None:
    """Joint values of ROW, unless they are the configuration itself."""
    row, values = candidate_row_of(search), candidate_values_of(search)
    if int(row) != values:
        set_joint_values(motions_of(search), row, values)


@kernel
def nearest_to(search: ConnectTable, side: int, row: Configuration) -> Any:
    """The vertex of a tree that is nearest to a configuration."""
    query = field(search, connect_layout.QUERY)
    for k in range(dof_in(search)):
        set_float(query, k, np.float32(double_at(row, k)))
    return nearest_vertex(tree_of(search, side), query)


@kernel
def met_by(search: ConnectTable, side: int, vertex: int) -> Any:
    """The vertex of the other tree that is joined with a new one of tree ``side``."""
    tree, other, row = tree_of(search, side), tree_of(search, 1 - side), candidate_row_of(search)
    if not is_bounded(search):
        return nearest_to(search, 1 - side, row)
    query = field(search, connect_layout.QUERY)
    for k in range(dof_in(search)):
        set_float(query, k, np.float32(double_at(row, k)))
    return nearest_by_cost(other, query, max(bound_of(search) - cost_of(tree, vertex), 0.0))


@kernel
def steer(search: ConnectTable, start: Configuration, aim: Configuration, length: float) -> Any:
    """Set ROW to ``aim``, or to the point at the range on the motion to it; returns whether it is ``aim``."""
    row, span = candidate_row_of(search), number_of(search, connect_layout.RANGE)
    reached = length <= span * (1.0 + RANGE_TOLERANCE)
    for k in range(dof_in(search)):
        there = double_at(aim, k)
        if not reached:
            here = double_at(start, k)
            there = here + (there - here) * (span / length)
        set_double(row, k, there)
    set_row_values(search)
    return reached


@kernel
def check_candidate(search: ConnectTable) -> int:
    """Check the motion from FROM to ROW at the configurations that are checked in either direction.

    The ends that are vertices are left out: they were checked with the motion that led to them, or as roots.
    """
    motions, tree = motions_of(search), tree_of(search, field(search, connect_layout.GROWING))
    vertex, row = field(search, connect_layout.FROM), candidate_row_of(search)
    start, values = row_of(tree, vertex), values_of(tree, vertex)
    last = step_count(motions, start, row)
    count = last - field(search, connect_layout.BRIDGE)
    resolve = field(search, connect_layout.RESOLVE) != 0
    count_up(search, connect_layout.CHECKED)
    there, first = candidate_values_of(search), 1
    if descends(dof_of(motions), start, row):
        values, there, first = there, values, last - count
    return check_part(world_of(motions), values, there, last, first, count, resolve)


@inlined
def set_candidate(search: ConnectTable, side: int, start: int, bridge: int) -> None:
    """The motion to ROW starts at a vertex of tree ``side``; ``bridge`` is 1 if it ends at a vertex of the other."""
    set_field(search, connect_layout.GROWING, side)
    set_field(search, connect_layout.FROM, start)
    set_field(search, connect_layout.BRIDGE, bridge)


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
    set_field(search, connect_layout.TARGET, target)
    set_candidate(search, side, start, 1 if reached else 0)
    return True


@kernel
def aim_straight(search: ConnectTable) -> bool:
    """The next motion: a whole one from the nearest start to the next goal. False when no goal is left."""
    goal = field(search, connect_layout.STRAIGHT_TRIED)
    if goal >= min(field(search, connect_layout.GOAL_COUNT), MAX_STRAIGHT_MOTIONS):
        return False
    count_up(search, connect_layout.STRAIGHT_TRIED)
    target = row_of(tree_of(search, 1), goal)
    copy_row(dof_in(search), target, candidate_row_of(search))
    set_row_values(search)
    set_field(search, connect_layout.TARGET, goal)
    set_candidate(search, 0, nearest_to(search, 0, target), 1)
    return True


@kernel
def place_sample(search: ConnectTable) -> None:
    """Set ROW and QUERY to where POINT, of the unit box, lies in the box of samples; the next box is larger."""
    spread = number_of(search, connect_layout.SPREAD)
    for block in range((dof_in(search) + WIDTH - 1) // WIDTH):
        middle = wide_lanes_at(field(search, connect_layout.CENTRE), block)
        low = larger(wide_lanes_at(field(search, connect_layout.LOWER), block), middle - spread)
        high = smaller(wide_lanes_at(field(search, connect_layout.UPPER), block), middle + spread)
        share = wide_lanes_at(field(search, connect_layout.POINT), block)
        sample = low + (high - low) * share
        set_wide_lanes(candidate_row_of(search), block, sample)
        set_lanes(field(search, connect_layout.QUERY), block, single(sample))
    wider = min(SAMPLE_BOX_GROWTH * spread, connect_layout.UNBOUNDED_SPREAD)
    set_double(field(search, connect_layout.NUMBERS), connect_layout.SPREAD, wider)


@kernel
def nearest_inside(search: ConnectTable, side: int) -> Any:
    """The vertex of a tree to be extended towards the sample; -1 if that is outside its domain, or of no use."""
    tree = tree_of(search, side)
    if is_bounded(search):
        near = vertex_for(search, tree, tree_of(search, 1 - side), candidate_row_of(search))
        far = near >= 0 and distance(dof_in(search), row_of(tree, near), candidate_row_of(search)) > radius_of(
            tree, near
        )
        return -1 if far else near
    near, square = nearest_and_square(tree, field(search, connect_layout.QUERY))
    return -1 if np.sqrt(square) > radius_of(tree, near) else near


@kernel
def aim_at_sample(search: ConnectTable) -> bool:
    """The next motion: from the nearest vertex of a tree towards a sample. False if that is outside its domain."""
    count_up(search, connect_layout.ITERATIONS)
    side = 1 - field(search, connect_layout.GROWER)
    if live_of(tree_of(search, side)) > live_of(tree_of(search, 1 - side)):
        side = 1 - side
    set_field(search, connect_layout.GROWER, side)
    dof, row = dof_in(search), candidate_row_of(search)
    point, bases = field(search, connect_layout.POINT), field(search, connect_layout.INVERSE_BASES)
    next_point_at(search, connect_layout.RANDOM, point, bases, dof)
    if field(search, connect_layout.ITERATIONS) & LAST_IN_TURN == 0:
        # Points of base 2 fall into the two halves of the box by turns, as the trees grow: each would see but one half.
        next_point_at(search, connect_layout.RANDOM, point, bases, dof)
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
