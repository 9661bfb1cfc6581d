"""Where things stand in the table of a cloud; the tree is that of :mod:`rrtik_ompl.model.shapes.point_tree`.

One table serves all worlds: it is in the cloud's own frame, and where the cloud stands is said by whoever points to it.
"""

from __future__ import annotations

from typing import NewType

LEAF = 16  # points of a block, boxes of a group, as in the tree: kernels import nothing from there, so a test compares

CloudTable = NewType("CloudTable", int)
BoxGroups = NewType("BoxGroups", int)
PointBlocks = NewType("PointBlocks", int)

# LEVEL_COUNT · FIRSTS: number of the first group of each level, lowest level first (int32) · GROUPS: LEAF boxes each,
# in BOX_SIDES runs of floats · BLOCKS: LEAF points each, in three runs of floats
LEVEL_COUNT, FIRSTS, GROUPS, BLOCKS = range(4)
LOW_X, HIGH_X, LOW_Y, HIGH_Y, LOW_Z, HIGH_Z = BOX_SIDES = range(6)
