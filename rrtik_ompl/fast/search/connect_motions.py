"""The motions that RRT-Connect looks at: which one is next, and whether it is free."""

from __future__ import annotations

from typing import Any

import numpy as np

from rrtik_ompl.fast.checks.check_kernels import check_part
from rrtik_ompl.fast.checks.motion_kernels import SLACK, copy_row, descends, joint_values, travel, whole_steps
from rrtik_ompl.fast.search import connect_layout as table
from rrtik_ompl.fast.search.tree_kernels import nearest_vertex, row_of, values_of
from rrtik_ompl.fast.search.tree_layout import LIVE, RADII
from rrtik_ompl.fast.simd.compiled import inlined, kernel
from rrtik_ompl.fast.simd.lanes import double_at, field, float_at, set_double, set_field, set_float
from rrtik_ompl.fast.simd.random_kernels import next_point

MOST_STRAIGHT = 16
WIDER = 1.1  # a sample's box than the one before, where samples begin near a place


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
def set_row_values(search: int) -> None:
    """Joint values of ROW, unless they are the configuration itself."""
    row, values = field(search, table.ROW), field(search, table.ROW_VALUES)
    if row != values:
        gain, offset = field(search, table.GAIN), field(search, table.OFFSET)
        joint_values(field(search, table.DOF), field(search, table.JOINTS), gain, offset, row, values)


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
    set_row_values(search)
    return reached


@kernel
def steps_of(search: int, start: int, end: int) -> Any:
    """Number of steps in which a motion is checked."""
    dof, per_unit = field(search, table.DOF), number(search, table.STEPS_PER_UNIT)
    steps = travel(dof, field(search, table.WEIGHTS), start, end) / number(search, table.RESOLUTION)
    if per_unit > 0.0:
        steps = max(steps, per_unit * distance(dof, start, end))
    return whole_steps(steps)


@kernel
def check_candidate(search: int) -> int:
    """Check the motion from FROM to ROW at the configurations that are checked in either direction.

    The ends that are vertices are left out: they were checked with the motion that led to them, or as roots.
    """
    tree, row = tree_of(search, field(search, table.GROWING)), field(search, table.ROW)
    start, values = row_of(tree, field(search, table.FROM)), values_of(tree, field(search, table.FROM))
    last = steps_of(search, start, row)
    count = last - field(search, table.BRIDGE)
    resolve = field(search, table.RESOLVE) != 0
    count_up(search, table.CHECKED)
    there, first = field(search, table.ROW_VALUES), 1
    if descends(field(search, table.DOF), start, row):
        values, there, first = there, values, last - count
    return check_part(field(search, table.WORLD), values, there, last, first, count, resolve)


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
    copy_row(field(search, table.DOF), target, row)
    set_row_values(search)
    set_field(search, table.GROWING, 0)
    set_field(search, table.FROM, nearest_to(search, 0, target))
    set_field(search, table.TARGET, goal)
    set_field(search, table.BRIDGE, 1)
    return True


@kernel
def place_sample(search: int) -> None:
    """Set ROW to where POINT, a point of the unit box, lies in the box of samples; the next one is wider."""
    spread = number(search, table.SPREAD)
    for k in range(field(search, table.DOF)):
        middle = double_at(field(search, table.CENTRE), k)
        low = max(double_at(field(search, table.LOWER), k), middle - spread)
        high = min(double_at(field(search, table.UPPER), k), middle + spread)
        set_double(field(search, table.ROW), k, low + (high - low) * double_at(field(search, table.POINT), k))
    set_double(field(search, table.NUMBERS), table.SPREAD, min(WIDER * spread, table.EVERYWHERE))


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
    place_sample(search)
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
