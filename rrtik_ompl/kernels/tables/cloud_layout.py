"""The table of a cloud; the tree is that of :mod:`rrtik_ompl.model.shapes.point_tree`.

One table serves all worlds: it is in the cloud's own frame, and where the cloud stands is said by whoever points to it.
"""

from __future__ import annotations

from rrtik_ompl.kernels.record import Floats, Ints, Record

LEAF = 16  # points of a block, boxes of a group, as in the tree: kernels import nothing from there, so a test compares


class BoxGroups(Floats):
    """``LEAF`` boxes each, in ``BOX_SIDES`` runs."""


class PointBlocks(Floats):
    """``LEAF`` points each, in three runs."""


class CloudTable(Record):
    """The tree of a cloud's points."""

    level_count: int
    firsts: Ints  # number of the first group of each level, lowest level first
    groups: BoxGroups
    blocks: PointBlocks


LOW_X, HIGH_X, LOW_Y, HIGH_Y, LOW_Z, HIGH_Z = BOX_SIDES = range(6)
