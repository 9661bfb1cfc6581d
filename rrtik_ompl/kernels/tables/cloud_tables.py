"""The table of a cloud, made once for each cloud."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

import numpy as np

from rrtik_ompl.geometry.collision.shape_table import BOX_CORNERS
from rrtik_ompl.kernels.tables.cloud_layout import LEAF, CloudTable
from rrtik_ompl.kernels.tables.memory import packed

if TYPE_CHECKING:
    from rrtik_ompl.model.shapes.point_cloud import Cloud

# Corners of a cube of side 2, shape (LEAF, 3): as many as points of a block, so each of them twice
CORNERS = np.tile(BOX_CORNERS, (LEAF // len(BOX_CORNERS), 1))


def cloud_table(cloud: Cloud) -> CloudTable:
    """The tree of a cloud's points or cubes for the kernels; the cloud keeps it."""
    if not hasattr(cloud, "table"):
        tree = cloud.tree
        made = packed(
            CloudTable,
            half=cloud.half,
            level_count=len(tree.firsts),
            firsts=tree.firsts,
            groups=tree.boxes,
            blocks=tree.blocks,
            corners=(cloud.half * CORNERS.T).astype(np.float32),
        )
        object.__setattr__(cloud, "table", made)

    return cast(CloudTable, cloud.table)
