"""What kernels read from the table of a cloud, by name. A node is a group of boxes, by its level and number there."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rrtik_ompl.kernels.layout import AXES, PrimitiveTable
from rrtik_ompl.kernels.record import Tables
from rrtik_ompl.kernels.simd.compiled import WIDTH, inlined
from rrtik_ompl.kernels.simd.lanes import float_at, int_at, lanes_at
from rrtik_ompl.kernels.simd.records import table_reader
from rrtik_ompl.kernels.tables import cloud_layout as layout
from rrtik_ompl.kernels.tables.cloud_layout import LEAF, BoxGroups, CloudTable, PointBlocks

table_at: Callable[[Tables, int], CloudTable] = table_reader(CloudTable)

SIDES = len(layout.BOX_SIDES)
PARTS = LEAF // WIDTH  # of a run of LEAF floats, in lanes


@inlined
def cloud_at(primitives: PrimitiveTable, number: int) -> CloudTable:
    """The table of one of the clouds among primitives."""
    return table_at(primitives.clouds, number)


@inlined
def group_at(cloud: CloudTable, level: int, number: int) -> int:
    """Which of all groups a node is."""
    group: int = int_at(cloud.firsts, level) + number
    return group


@inlined
def sides_at(boxes: BoxGroups, group: int, side: int, part: int) -> Any:
    """A side of ``WIDTH`` boxes of a group. Here lanes hold boxes."""
    return lanes_at(boxes, (SIDES * group + side) * PARTS + part)


@inlined
def side_at(boxes: BoxGroups, group: int, side: int, child: int) -> float:
    """A side of one box of a group."""
    number: float = float_at(boxes, (SIDES * group + side) * LEAF + child)
    return number


@inlined
def coordinates_at(points: PointBlocks, block: int, axis: int, part: int) -> Any:
    """A coordinate of ``WIDTH`` points of a block. Here lanes hold points."""
    return lanes_at(points, (AXES * block + axis) * PARTS + part)


@inlined
def point_at(points: PointBlocks, block: int, number: int) -> Any:
    """One point of a block."""
    place = AXES * LEAF * block + number
    return float_at(points, place), float_at(points, place + LEAF), float_at(points, place + 2 * LEAF)
