"""Walks along path constraints in kernels: short projected steps towards a configuration, each a vertex of a tree.

Source: [17, section 5, ConstrainedExtend of CBiRRT2]. A step is as long as the bound on motions allows: halved where
the motion would leave a region, longer again where it would not.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from rrtik_ompl.kernels.checks.check_kernels import check_part
from rrtik_ompl.kernels.layout import FREE, UNDECIDED, JointValues
from rrtik_ompl.kernels.search.constrained import layout
from rrtik_ompl.kernels.search.constrained.layout import ConstrainedTable, HeldTable
from rrtik_ompl.kernels.search.constrained.projection_kernels import keeps, project
from rrtik_ompl.kernels.search.motions.motion_kernels import descends, dof_of, set_joint_values, step_count, world_of
from rrtik_ompl.kernels.search.motions.motion_layout import MotionTable
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration, distance
from rrtik_ompl.kernels.search.tree_kernels import add_vertex, is_full, nearest_vertex, row_of, set_radius, values_of
from rrtik_ompl.kernels.search.tree_layout import CERTAIN, OPEN, TreeTable
from rrtik_ompl.kernels.simd.access import count_up, field_reader
from rrtik_ompl.kernels.simd.compiled import inlined, kernel
from rrtik_ompl.kernels.simd.lanes import double_at, field, set_double, set_float

PROJECTION_STEPS = 12  # of a short step; it begins near the region
FARTHEST = 2.0  # times the length of a step that projection may lead
NEARER = 0.05  # share of the length of a step by which it must come nearer
STUCK = 8.0  # times the shortest step: from there on shorter ones are not tried where a step comes no nearer
LENGTHENED = 1.6
UNBOUNDED_DOMAIN = 1e30

motions_of: Callable[[ConstrainedTable], MotionTable] = field_reader(layout.MOTIONS)
held_of: Callable[[ConstrainedTable], HeldTable] = field_reader(layout.HELD)
row_in: Callable[[ConstrainedTable], Configuration] = field_reader(layout.ROW)
row_values_in: Callable[[ConstrainedTable], JointValues] = field_reader(layout.ROW_VALUES)
aim_in: Callable[[ConstrainedTable], Configuration] = field_reader(layout.AIM)


@inlined
def tree_of(search: ConstrainedTable, side: int) -> TreeTable:
    """The tree from the starts (0) or from the goals (1)."""
    tree: TreeTable = field(search, layout.START_TREE + side)
    return tree


@inlined
def number_of(search: ConstrainedTable, place: int) -> Any:
    """One of the search's numbers."""
    return double_at(field(search, layout.NUMBERS), place)


@inlined
def set_number(search: ConstrainedTable, place: int, value: float) -> None:
    """Set one of the search's numbers."""
    set_double(field(search, layout.NUMBERS), place, value)


@kernel
def set_row_values(search: ConstrainedTable) -> None:
    """Joint values of ROW, unless they are the configuration itself."""
    row, values = row_in(search), row_values_in(search)
    if int(row) != values:
        set_joint_values(motions_of(search), row, values)


@kernel
def nearest_to(search: ConstrainedTable, side: int, row: Configuration) -> Any:
    """The vertex of a tree that is nearest to a configuration."""
    query = field(search, layout.QUERY)
    for k in range(dof_of(motions_of(search))):
        set_float(query, k, np.float32(double_at(row, k)))
    return nearest_vertex(tree_of(search, side), query)


@kernel
def check_row(search: ConstrainedTable, tree: TreeTable, vertex: int) -> Any:
    """Check the motion from a vertex to ROW for collisions: FREE, UNDECIDED or COLLIDING."""
    if field(search, layout.UNCHECKED) != 0:
        return FREE
    motions, row = motions_of(search), row_in(search)
    start, values, there = row_of(tree, vertex), values_of(tree, vertex), row_values_in(search)
    count_up(search, layout.CHECKED)
    last = step_count(motions, start, row)
    first, resolve = 1, field(search, layout.RESOLVE) != 0
    if descends(dof_of(motions), start, row):
        values, there, first = there, values, 0
    return check_part(world_of(motions), values, there, last, first, last, resolve)


@kernel
def step_towards(search: ConstrainedTable, here: Configuration, exact: bool) -> Any:
    """Set ROW to the end of a step from a vertex's configuration towards AIM, in the regions.

    Returns:
        How much nearer it is, 0 if there is no such step, and whether it is AIM itself. AIM is in the regions if
        ``exact``.
    """
    aim, row, held = aim_in(search), row_in(search), held_of(search)
    dof = dof_of(motions_of(search))
    left = distance(dof, here, aim)
    length = min(number_of(search, layout.STEP), left)
    while True:
        last = exact and length >= left
        for k in range(dof):
            a, b = double_at(here, k), double_at(aim, k)
            set_double(row, k, b if last else a + (b - a) * (length / left))
        if last or project(held, row, PROJECTION_STEPS):
            nearer = left - distance(dof, row, aim)
            if nearer < NEARER * length:
                if length <= STUCK * number_of(search, layout.SHORTEST):
                    return 0.0, False
            elif distance(dof, here, row) <= FARTHEST * length and keeps(held, here, row):
                longer = min(
                    max(LENGTHENED * length, number_of(search, layout.STEP)), number_of(search, layout.LONGEST)
                )
                set_number(search, layout.STEP, longer if length < left else number_of(search, layout.STEP))
                return nearer, last
        length *= 0.5
        set_number(search, layout.STEP, max(length, number_of(search, layout.SHORTEST)))
        if length < number_of(search, layout.SHORTEST):
            return 0.0, False


@kernel
def walk(search: ConstrainedTable, side: int, vertex: int, exact: bool) -> Any:
    """Walk from a vertex of a tree towards AIM as far as it goes; the last vertex, and whether AIM is reached."""
    tree, row, first = tree_of(search, side), row_in(search), vertex
    for _ in range(field(search, layout.WALK_ROOM)):
        if is_full(tree):
            break
        nearer, last = step_towards(search, row_of(tree, vertex), exact)
        if nearer <= 0.0:
            break
        set_row_values(search)
        answer = check_row(search, tree, vertex)
        if answer != FREE and (answer != UNDECIDED or field(search, layout.RESOLVE) == 0):
            if vertex == first:
                set_radius(tree, vertex, number_of(search, layout.DOMAIN))
            break
        state = CERTAIN if answer == FREE else OPEN
        vertex = add_vertex(tree, row, row_values_in(search), vertex, state, UNBOUNDED_DOMAIN)
        if last:
            return vertex, True
    return vertex, False
