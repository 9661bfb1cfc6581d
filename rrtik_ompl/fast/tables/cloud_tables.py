"""The table of a cloud, made once for each cloud."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

from rrtik_ompl.fast.tables.cloud_layout import BLOCKS, FIRSTS, GROUPS, LEVEL_COUNT
from rrtik_ompl.fast.tables.memory import Table, table

if TYPE_CHECKING:
    from rrtik_ompl.collision.cloud_solid import CloudSolid


def cloud_table(solid: CloudSolid) -> Table:
    """The tree of a cloud's points for the kernels."""
    if solid.table is None:
        tree = solid.cloud.tree
        fields = {FIRSTS: tree.firsts, GROUPS: tree.boxes, BLOCKS: tree.blocks}
        solid.table = table({LEVEL_COUNT: len(tree.firsts), **fields})
    return cast(Table, solid.table)
