"""Memory of search trees in kernels."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix
from rrtik_ompl.kernels.search.tree_layout import (
    CAPACITY,
    CERTAIN,
    COSTS,
    DOF,
    JOINTS,
    LIVE,
    PARENTS,
    POINTS,
    RADII,
    ROWS,
    SIZE,
    STATES,
    VALUES,
)
from rrtik_ompl.kernels.tables.memory import Table, aligned, table


def tree_table(dof: int, joints: int, capacity: int) -> Table:
    """An empty tree for configurations of ``dof`` numbers.

    Args:
        dof: At least 1.
        joints: Length of the joint values of a configuration; 0 if they are the configuration itself.
        capacity: How many vertices there is room for, a multiple of ``WIDTH``.
    """
    fields: dict[int, int | NDArray[Any]] = {CAPACITY: capacity, SIZE: 0, LIVE: 0, DOF: dof, JOINTS: joints or dof}
    made = table(fields | {place: array for place, array in _arrays(dof, joints, capacity).items()})
    _share_values(made, joints)
    return made


def grow(tree: Table, factor: int = 2) -> None:
    """Give a tree ``factor`` times the room; its address stays."""
    dof, capacity = int(tree.header[DOF]), factor * int(tree.header[CAPACITY])
    joints = int(tree.header[JOINTS]) if tree.header[VALUES] != tree.header[ROWS] else 0
    for place, larger in _arrays(dof, joints, capacity).items():
        kept = tree.arrays[place]
        tree.arrays[place] = roomy = aligned(larger)
        roomy[: len(kept)] = kept
        tree.header[place] = roomy.ctypes.data
    tree.header[CAPACITY] = capacity
    _share_values(tree, joints)


def certain_tree(tree: Table) -> tuple[Matrix, NDArray[np.int64], Mask]:
    """Vertices of a tree, shape (size, n), their parents, below 0 for a root, and which motions to them are certain."""
    size, dof = int(tree.header[SIZE]), int(tree.header[DOF])
    parents, rows = tree[PARENTS][:size].astype(np.int64), tree[ROWS].reshape(-1, dof)[:size].copy()
    return rows, parents, (tree[STATES][:size] == CERTAIN) | (parents < 0)


def _arrays(dof: int, joints: int, capacity: int) -> dict[int, NDArray[Any]]:
    return {
        POINTS: np.zeros(capacity * dof, dtype=np.float32),
        ROWS: np.zeros(capacity * dof),
        VALUES: np.zeros(capacity * joints),
        PARENTS: np.zeros(capacity, dtype=np.int32),
        RADII: np.zeros(capacity, dtype=np.float32),
        STATES: np.zeros(capacity, dtype=np.int32),
        COSTS: np.zeros(capacity, dtype=np.float32),
    }


def _share_values(tree: Table, joints: int) -> None:
    if joints == 0:
        tree.header[VALUES] = tree.header[ROWS]
