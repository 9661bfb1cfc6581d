"""What searches with two trees do alike in kernels: their trees, the row that they work on, vertices near it.

A search is any table that has the fields of :class:`TwoTrees`; each is compiled for itself.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from rrtik_ompl.kernels.layout import JointValues
from rrtik_ompl.kernels.record import Doubles, Floats
from rrtik_ompl.kernels.search.box_kernels import copy_inside
from rrtik_ompl.kernels.search.motions.motion_kernels import set_joint_values
from rrtik_ompl.kernels.search.motions.motion_layout import Configuration, MotionTable
from rrtik_ompl.kernels.search.tree_kernels import nearest_vertex
from rrtik_ompl.kernels.search.tree_layout import TreeTable
from rrtik_ompl.kernels.simd.compiled import inlined, kernel
from rrtik_ompl.kernels.simd.records import same_place


class TwoTrees(Protocol):
    """The fields of such a search, whatever else its table has."""

    motions: MotionTable
    start_tree: TreeTable
    goal_tree: TreeTable
    lower: Doubles
    upper: Doubles
    row: Configuration
    row_values: JointValues
    query: Floats


@inlined
def tree_of(search: TwoTrees, side: int) -> TreeTable:
    """The tree from the starts (0) or from the goals (1)."""
    return search.start_tree if side == 0 else search.goal_tree


@kernel
def set_row_values(search: TwoTrees) -> None:
    """Joint values of the row, unless they are the configuration itself."""
    row, values = search.row, search.row_values
    if not same_place(row, values):
        set_joint_values(search.motions, row, values)


@kernel
def load_row(search: TwoTrees, source: Configuration) -> bool:
    """Set the row to a configuration; False if that is outside the box."""
    lower, upper = search.lower, search.upper
    if not copy_inside(search.motions.dof, source, lower, upper, search.row):
        return False
    set_row_values(search)
    return True


@kernel
def nearest_to(search: TwoTrees, side: int, row: Configuration) -> Any:
    """The vertex of a tree that is nearest to a configuration."""
    query = search.query
    for k in range(search.motions.dof):
        query[k] = np.float32(row[k])
    return nearest_vertex(tree_of(search, side), query)
