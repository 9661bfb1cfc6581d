"""What C-RDT kernels read of a search's table: the motion table, trees, rules, and rows of the extension."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rrtik_ompl.kernels.layout import DoubleArray, IntArray
from rrtik_ompl.kernels.search.crdt import layout as crdt_layout
from rrtik_ompl.kernels.search.crdt.layout import CrdtTable, CrdtTreeTable
from rrtik_ompl.kernels.search.motions.motion_kernels import dof_of
from rrtik_ompl.kernels.search.motions.motion_layout import MotionTable
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration, row_at
from rrtik_ompl.kernels.simd.access import field_reader
from rrtik_ompl.kernels.simd.compiled import inlined
from rrtik_ompl.kernels.simd.lanes import double_at, field

motions_of: Callable[[CrdtTable], MotionTable] = field_reader(crdt_layout.MOTIONS)
rules_of: Callable[[CrdtTable], Configuration] = field_reader(crdt_layout.RULES)
extension_of: Callable[[CrdtTable], Configuration] = field_reader(crdt_layout.EXTENSION)
goals_of: Callable[[CrdtTable], Configuration] = field_reader(crdt_layout.GOALS)
order_of: Callable[[CrdtTable], IntArray] = field_reader(crdt_layout.ORDER)
verdicts_of: Callable[[CrdtTable], IntArray] = field_reader(crdt_layout.VERDICTS)
nearest_of: Callable[[CrdtTable], DoubleArray] = field_reader(crdt_layout.NEAREST)
edge_count_of: Callable[[CrdtTable], int] = field_reader(crdt_layout.EDGE_COUNT)


@inlined
def dof_in(search: CrdtTable) -> int:
    """How many numbers a configuration has."""
    return dof_of(motions_of(search))


@inlined
def tree_of(search: CrdtTable, side: int) -> CrdtTreeTable:
    """The first (0) or the second tree."""
    tree: CrdtTreeTable = field(search, crdt_layout.TREE + side)
    return tree


@inlined
def rule_row(search: CrdtTable, rule: int) -> Configuration:
    """Address of a rule's numbers, one for each axis."""
    return row_at(rules_of(search), dof_in(search), rule)


@inlined
def rule_of(search: CrdtTable, rule: int, axis: int) -> Any:
    """A rule's number for an axis."""
    return double_at(rule_row(search, rule), axis)


@inlined
def extension_row(search: CrdtTable, row: int) -> Configuration:
    """Address of a row of the extension, such as TARGET or CURRENT."""
    return row_at(extension_of(search), dof_in(search), row)


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
    return row_at(goals_of(search), dof_in(search), goal)
