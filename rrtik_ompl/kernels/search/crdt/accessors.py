"""What C-RDT kernels read of a search's table: the motion table, trees, rules, and rows of the extension."""

from __future__ import annotations

from typing import Any

from rrtik_ompl.kernels.search.crdt import layout as crdt_layout
from rrtik_ompl.kernels.search.crdt.layout import CrdtTable, CrdtTreeTable
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration, row_at
from rrtik_ompl.kernels.simd.compiled import inlined


@inlined
def dof_in(search: CrdtTable) -> int:
    """How many numbers a configuration has."""
    return search.motions.dof


@inlined
def tree_of(search: CrdtTable, side: int) -> CrdtTreeTable:
    """The first (0) or the second tree."""
    return search.tree if side == 0 else search.other_tree


@inlined
def rule_row(search: CrdtTable, rule: int) -> Configuration:
    """Address of a rule's numbers, one for each axis."""
    return row_at(search.rules, dof_in(search), rule)


@inlined
def rule_of(search: CrdtTable, rule: int, axis: int) -> Any:
    """A rule's number for an axis."""
    return rule_row(search, rule)[axis]


@inlined
def extension_row(search: CrdtTable, row: int) -> Configuration:
    """Address of a row of the extension, such as TARGET or CURRENT."""
    return row_at(search.extension, dof_in(search), row)


@inlined
def edge_start(search: CrdtTable, edge: int) -> Configuration:
    """Address of the start of an edge of the extension."""
    return extension_row(search, crdt_layout.EDGES + edge)


@inlined
def edge_end(search: CrdtTable, edge: int) -> Configuration:
    """Address of the end of an edge of the extension."""
    return extension_row(search, crdt_layout.EDGES + dof_in(search) + 1 + edge)


@inlined
def goal_row(search: CrdtTable, goal: int) -> Configuration:
    """Address of a goal of a single tree."""
    return row_at(search.goals, dof_in(search), goal)
