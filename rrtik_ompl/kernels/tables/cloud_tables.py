"""The table of a cloud, made once for each cloud."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

from rrtik_ompl.kernels.tables.cloud_layout import BLOCKS, FIRSTS, GROUPS, LEVEL_COUNT
from rrtik_ompl.kernels.tables.memory import Table, table

if TYPE_CHECKING:
    from rrtik_ompl.model.shapes import PointCloud


def cloud_table(cloud: PointCloud) -> Table:
    """The tree of a cloud's points for the kernels; the cloud keeps it."""
    if not hasattr(cloud, "table"):
        tree = cloud.tree
        fields = {FIRSTS: tree.firsts, GROUPS: tree.boxes, BLOCKS: tree.blocks}
        object.__setattr__(cloud, "table", table({LEVEL_COUNT: len(tree.firsts), **fields}))
    return cast(Table, cloud.table)
