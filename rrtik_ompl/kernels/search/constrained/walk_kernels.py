"""Walks along path constraints in kernels: short projected steps towards a configuration, each a vertex of a tree.

Source: [17, section 5, ConstrainedExtend of CBiRRT2]. A step is as long as the bound on motions allows: halved where
the motion would leave a region, longer again where it would not.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rrtik_ompl.kernels.checks.check_kernels import check_part
from rrtik_ompl.kernels.layout import FREE, UNDECIDED
from rrtik_ompl.kernels.search.constrained.layout import ConstrainedTable
from rrtik_ompl.kernels.search.constrained.projection_kernels import keeps, project
from rrtik_ompl.kernels.search.motions.motion_kernels import descends, set_joint_values, step_count
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration, distance
from rrtik_ompl.kernels.search.tree_kernels import add_vertex, is_full, nearest_vertex, row_of, set_radius, values_of
from rrtik_ompl.kernels.search.tree_layout import CERTAIN, OPEN, TreeTable
from rrtik_ompl.kernels.simd.compiled import inlined, kernel
from rrtik_ompl.kernels.simd.records import same_place

PROJECTION_STEPS = 12  # of a short step; it begins near the region
FARTHEST = 2.0  # times the length of a step that projection may lead
NEARER = 0.05  # share of the length of a step by which it must come nearer
STUCK = 8.0  # times the shortest step: from there on shorter ones are not tried where a step comes no nearer
LENGTHENED = 1.6
UNBOUNDED_DOMAIN = 1e30


@inlined
def tree_of(search: ConstrainedTable, side: int) -> TreeTable:
    """The tree from the starts (0) or from the goals (1)."""
    return search.start_tree if side == 0 else search.goal_tree


@kernel
def set_row_values(search: ConstrainedTable) -> None:
    """Joint values of ROW, unless they are the configuration itself."""
    row, values = search.row, search.row_values
    if not same_place(row, values):
        set_joint_values(search.motions, row, values)


@kernel
def nearest_to(search: ConstrainedTable, side: int, row: Configuration) -> Any:
    """The vertex of a tree that is nearest to a configuration."""
    query = search.query
    for k in range(search.motions.dof):
        query[k] = np.float32(row[k])
    return nearest_vertex(tree_of(search, side), query)


@kernel
def check_row(search: ConstrainedTable, tree: TreeTable, vertex: int) -> Any:
    """Check the motion from a vertex to ROW for collisions: FREE, UNDECIDED or COLLIDING."""
    if search.unchecked != 0:
        return FREE
    motions, row = search.motions, search.row
    start, values, there = row_of(tree, vertex), values_of(tree, vertex), search.row_values
    search.checked += 1
    last = step_count(motions, start, row)
    first, resolve = 1, search.resolve != 0
    if descends(motions.dof, start, row):
        values, there, first = there, values, 0
    return check_part(motions.world, values, there, last, first, last, resolve)


@kernel
def step_towards(search: ConstrainedTable, here: Configuration, exact: bool) -> Any:
    """Set ROW to the end of a step from a vertex's configuration towards AIM, in the regions.

    Returns:
        How much nearer it is, 0 if there is no such step, and whether it is AIM itself. AIM is in the regions if
        ``exact``.
    """
    aim, row, held = search.aim, search.row, search.held
    dof = search.motions.dof
    left = distance(dof, here, aim)
    length = min(search.step, left)
    while True:
        last = exact and length >= left
        for k in range(dof):
            a, b = here[k], aim[k]
            row[k] = b if last else a + (b - a) * (length / left)
        if last or project(held, row, PROJECTION_STEPS):
            nearer = left - distance(dof, row, aim)
            if nearer < NEARER * length:
                if length <= STUCK * search.shortest:
                    return 0.0, False
            elif distance(dof, here, row) <= FARTHEST * length and keeps(held, here, row):
                longer = min(max(LENGTHENED * length, search.step), search.longest)
                search.step = longer if length < left else search.step
                return nearer, last
        length *= 0.5
        search.step = max(length, search.shortest)
        if length < search.shortest:
            return 0.0, False


@kernel
def walk(search: ConstrainedTable, side: int, vertex: int, exact: bool) -> Any:
    """Walk from a vertex of a tree towards AIM as far as it goes; the last vertex, and whether AIM is reached."""
    tree, row, first = tree_of(search, side), search.row, vertex
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
        vertex = add_vertex(tree, row, search.row_values, vertex, state, UNBOUNDED_DOMAIN)
        if last:
            return vertex, True
    return vertex, False
