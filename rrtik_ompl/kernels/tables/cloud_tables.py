"""The table of a cloud, made once for each cloud."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

from rrtik_ompl.kernels.tables.cloud_layout import CloudTable
from rrtik_ompl.kernels.tables.memory import packed

if TYPE_CHECKING:
    from rrtik_ompl.model.shapes import PointCloud


def cloud_table(cloud: PointCloud) -> CloudTable:
    """The tree of a cloud's points for the kernels; the cloud keeps it."""
    if not hasattr(cloud, "table"):
        tree = cloud.tree
        made = packed(
            CloudTable, level_count=len(tree.firsts), firsts=tree.firsts, groups=tree.boxes, blocks=tree.blocks
        )
        object.__setattr__(cloud, "table", made)

    return cast(CloudTable, cloud.table)
