"""The table of a cloud of points or of equal cubes; the tree is that of :mod:`rrtik_ompl.model.shapes.point_tree`.

One table serves all worlds: it is in the cloud's own frame, and where the cloud stands is said by whoever points to it.
"""

from __future__ import annotations

from rrtik_ompl.kernels.record import Floats, Ints, Record

LEAF = 16  # points of a block, boxes of a group, as in the tree: kernels import nothing from there, so a test compares


class BoxGroups(Floats):
    """``LEAF`` boxes each, in ``BOX_SIDES`` runs."""


class PointBlocks(Floats):
    """``LEAF`` points, or centres of cubes, each, in three runs."""


class CloudTable(Record):
    """The tree of a cloud's points, each of which may be the centre of a cube along the cloud's axes.

    Boxes of groups contain the cubes.
    """

    half: float  # half a side of each cube [m]; 0 for points
    level_count: int
    firsts: Ints  # number of the first group of each level, lowest level first
    groups: BoxGroups
    blocks: PointBlocks
    corners: Floats  # of a cube, seen from its centre, in three runs of ``LEAF``; all 0 for points


LOW_X, HIGH_X, LOW_Y, HIGH_Y, LOW_Z, HIGH_Z = BOX_SIDES = range(6)
