"""Memory of searches in kernels, and of their trees."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.kernels.search.motions.motion_table import FastMotions
from rrtik_ompl.kernels.search.tree_layout import CERTAIN, TreeTable
from rrtik_ompl.kernels.search.two_trees_layout import SampledTable
from rrtik_ompl.kernels.tables.memory import aligned, packed, whole_lanes

PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37)  # a Halton sequence of more dimensions covers a box badly

S = TypeVar("S", bound=SampledTable)


def sampled(kind: type[S], motions: FastMotions, box: tuple[Vector, Vector], **fields: Any) -> S:
    """The table of a search that draws configurations from a box.

    Args:
        kind: Its class.
        motions: How motions are checked.
        box: Lower and upper bounds, shapes (n,).
        fields: Those of this kind of search; numbers that are not given are 0.
    """
    dof = motions.dof
    made = packed(
        kind,
        motions=motions.table,
        lower=whole_lanes(box[0]),
        upper=whole_lanes(box[1]),
        inverse_bases=whole_lanes(np.array(inverse_bases(dof))),
        point=whole_lanes(np.zeros(dof)),
        row=whole_lanes(np.zeros(dof)),
        row_values=np.zeros(motions.joints),
        query=whole_lanes(np.zeros(dof, dtype=np.float32)),
        **fields,
    )
    if motions.identity:
        made.put(row_values=made.row)
    return made


def inverse_bases(dimensions: int) -> list[float]:
    """Inverse bases of the Halton sequence [49] in that many dimensions; zeros where it would cover a box badly."""
    if dimensions > len(PRIMES):
        return [0.0] * dimensions
    return [1.0 / prime for prime in PRIMES[:dimensions]]


def tree_table(dof: int, joints: int, capacity: int) -> TreeTable:
    """An empty tree for configurations of ``dof`` numbers.

    Args:
        dof: At least 1.
        joints: Length of the joint values of a configuration; 0 if they are the configuration itself.
        capacity: How many vertices there is room for, a multiple of ``WIDTH``.
    """
    made = packed(TreeTable, capacity=capacity, dof=dof, joints=joints or dof, **_arrays(dof, joints, capacity))
    _share_values(made, joints)
    return made


def grow(tree: TreeTable, factor: int = 2) -> None:
    """Give a tree ``factor`` times the room; its address stays."""
    joints = 0 if np.shares_memory(tree.values, tree.rows) else tree.joints
    capacity = factor * tree.capacity
    for name, larger in _arrays(tree.dof, joints, capacity).items():
        kept = getattr(tree, name)
        roomy = aligned(larger)
        roomy[: min(len(kept), len(roomy))] = kept[: len(roomy)]
        tree.put(**{name: roomy})
    tree.capacity = capacity
    _share_values(tree, joints)


def certain_tree(tree: TreeTable) -> tuple[Matrix, NDArray[np.int64], Mask]:
    """Vertices of a tree, shape (size, n), their parents, below 0 for a root, and which motions to them are certain."""
    size = tree.size
    parents = tree.parents[:size].astype(np.int64)
    rows = tree.rows.reshape(-1, tree.dof)[:size].copy()
    return rows, parents, (tree.states[:size] == CERTAIN) | (parents < 0)


def _arrays(dof: int, joints: int, capacity: int) -> dict[str, NDArray[Any]]:
    return {
        "points": np.zeros(capacity * dof, dtype=np.float32),
        "rows": np.zeros(capacity * dof),
        "values": np.zeros(capacity * joints),
        "parents": np.zeros(capacity, dtype=np.int32),
        "radii": np.zeros(capacity, dtype=np.float32),
        "states": np.zeros(capacity, dtype=np.int32),
        "costs": np.zeros(capacity, dtype=np.float32),
    }


def _share_values(tree: TreeTable, joints: int) -> None:
    if joints == 0:
        tree.put(values=tree.rows)
