"""Kernels that walk the tree of a cloud: which lanes have a point near, how near the nearest is, what comes next.

A point may be the centre of a cube, see :class:`CloudTable`; it is as near as the cube is then.

A walk goes through the children of a node in their order, down where one is in reach and up again behind it, so that
it needs no memory. First lanes hold the ``LEAF`` children of a node, or points of a block, and compare them with the
box around what is asked for in all lanes; what passes is then compared with each lane of its own.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rrtik_ompl.kernels.clouds.accessors import (
    PARTS,
    coordinates_at,
    group_at,
    point_at,
    side_at,
    sides_at,
)
from rrtik_ompl.kernels.simd.compiled import WIDTH, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import (
    absolute,
    bits,
    first_bit,
    highest,
    larger,
    lowest,
    smaller,
    spread,
    square_root,
)
from rrtik_ompl.kernels.simd.vectors import along, squared
from rrtik_ompl.kernels.tables import cloud_layout as layout
from rrtik_ompl.kernels.tables.cloud_layout import LEAF, BoxGroups, CloudTable, PointBlocks

ZERO = np.float32(0.0)
HALF = np.float32(0.5)
FAR_SQUARE = np.float32(1e36)  # [m^2] where there is nothing to measure


@inlined
def boxes_in_reach(boxes: BoxGroups, group: int, low: Any, high: Any) -> int:
    """The children of a group, as bits, whose boxes meet a box. Here lanes hold boxes."""
    found = 0
    for part in range(PARTS):
        x = (sides_at(boxes, group, layout.LOW_X, part) <= high[0]) & (
            sides_at(boxes, group, layout.HIGH_X, part) >= low[0]
        )
        y = (sides_at(boxes, group, layout.LOW_Y, part) <= high[1]) & (
            sides_at(boxes, group, layout.HIGH_Y, part) >= low[1]
        )
        z = (sides_at(boxes, group, layout.LOW_Z, part) <= high[2]) & (
            sides_at(boxes, group, layout.HIGH_Z, part) >= low[2]
        )
        found |= bits(x & y & z) << (WIDTH * part)

    return found


@inlined
def points_in_reach(points: PointBlocks, block: int, low: Any, high: Any) -> int:
    """The points of a block, as bits, that lie in a box. Here lanes hold points."""
    found = 0
    for part in range(PARTS):
        x = coordinates_at(points, block, 0, part)
        y = coordinates_at(points, block, 1, part)
        z = coordinates_at(points, block, 2, part)
        inside = (x <= high[0]) & (x >= low[0]) & (y <= high[1]) & (y >= low[1]) & (z <= high[2]) & (z >= low[2])
        found |= bits(inside) << (WIDTH * part)

    return found


@inlined
def points_below(points: PointBlocks, block: int, normal: Any, height: float) -> int:
    """The points of a block, as bits, that lie below a plane. Here lanes hold points."""
    found = 0
    for part in range(PARTS):
        x = coordinates_at(points, block, 0, part)
        y = coordinates_at(points, block, 1, part)
        found |= bits(along(normal, x, y, coordinates_at(points, block, 2, part)) < height) << (WIDTH * part)

    return found


@inlined
def beyond(below: Any, above: Any) -> Any:
    """How far a coordinate lies outside two sides, given how far it lies below the one and above the other."""
    return larger(larger(below, above), ZERO)


@inlined
def to_box(boxes: BoxGroups, group: int, child: int, x: Any, y: Any, z: Any) -> Any:
    """Squared distance of lanes of points from a box."""
    a = beyond(side_at(boxes, group, layout.LOW_X, child) - x, x - side_at(boxes, group, layout.HIGH_X, child))
    b = beyond(side_at(boxes, group, layout.LOW_Y, child) - y, y - side_at(boxes, group, layout.HIGH_Y, child))
    c = beyond(side_at(boxes, group, layout.LOW_Z, child) - z, z - side_at(boxes, group, layout.HIGH_Z, child))
    return squared(a, b, c)


@inlined
def to_cube(x: Any, y: Any, z: Any, half: Any) -> Any:
    """Squared distance of lanes of points from a cube, or a point, around the origin."""
    a = larger(absolute(x) - half, ZERO)
    b = larger(absolute(y) - half, ZERO)
    c = larger(absolute(z) - half, ZERO)
    return squared(a, b, c)


@inlined
def widened(low: Any, high: Any, half: Any) -> Any:
    """A box that contains the centres of all cubes that meet a box."""
    return (low[0] - half, low[1] - half, low[2] - half), (high[0] + half, high[1] + half, high[2] + half)


@inlined
def above(left: int, child: int) -> int:
    """The bits of a number from one place on."""
    return (left >> child) << child


@inlined
def around_lanes(x: Any, y: Any, z: Any, reach: float) -> Any:
    """Lowest and highest corner of a box around all that is no farther than a reach from lanes of points."""
    low = lowest(x) - reach, lowest(y) - reach, lowest(z) - reach
    return low, (highest(x) + reach, highest(y) + reach, highest(z) + reach)


@kernel
def block_meets(cloud: CloudTable, block: int, low: Any, high: Any, x: Any, y: Any, z: Any, square: float) -> int:
    """Lanes with a point of a block nearer than the root of ``square``."""
    points = cloud.blocks
    half = np.float32(cloud.half)
    low, high = widened(low, high, half)
    left = points_in_reach(points, block, low, high)
    meeting = 0
    while left != 0:
        a, b, c = point_at(points, block, first_bit(left))
        left &= left - 1
        meeting |= bits(to_cube(x - a, y - b, z - c, half) < square)

    return meeting


@kernel
def meets_points(cloud: CloudTable, x: Any, y: Any, z: Any, reach: float, bound: bool, wanted: int) -> int:
    """Lanes among ``wanted`` with a point of the cloud nearer than ``reach``; coordinates are in the cloud's frame.

    With ``bound`` a block of points in reach will do.
    """
    boxes = cloud.groups
    top = cloud.level_count - 1
    low, high = around_lanes(x, y, z, reach)
    square = reach * reach
    meeting = 0
    level = top
    number = 0
    group = group_at(cloud, top, 0)
    left = boxes_in_reach(boxes, group, low, high)

    while True:
        if left == 0:
            if level == top:
                break
            level = level + 1
            child = number % LEAF + 1
            number = number // LEAF
            group = group_at(cloud, level, number)
            left = above(boxes_in_reach(boxes, group, low, high), child)
            continue

        child = first_bit(left)
        left &= left - 1
        near = bits(to_box(boxes, group, child, x, y, z) < square) & wanted & ~meeting
        if near == 0:
            continue
        if level > 0:
            level = level - 1
            number = LEAF * number + child
            group = group_at(cloud, level, number)
            left = boxes_in_reach(boxes, group, low, high)
            continue

        if not bound:
            near &= block_meets(cloud, LEAF * number + child, low, high, x, y, z, square)
        meeting |= near
        if meeting == wanted:
            break

    return meeting


@kernel
def nearest_child(boxes: BoxGroups, group: int, x: float, y: float, z: float) -> int:
    """The child of a group whose box is nearest to a point. Here lanes hold boxes."""
    best = FAR_SQUARE
    found = 0
    for part in range(PARTS):
        a = beyond(
            sides_at(boxes, group, layout.LOW_X, part) - x, spread(x) - sides_at(boxes, group, layout.HIGH_X, part)
        )
        b = beyond(
            sides_at(boxes, group, layout.LOW_Y, part) - y, spread(y) - sides_at(boxes, group, layout.HIGH_Y, part)
        )
        c = beyond(
            sides_at(boxes, group, layout.LOW_Z, part) - z, spread(z) - sides_at(boxes, group, layout.HIGH_Z, part)
        )
        away = squared(a, b, c)
        if lowest(away) < best:
            best = lowest(away)
            found = WIDTH * part + first_bit(bits(away <= lowest(away)))

    return found


@kernel
def nearer_of_block(cloud: CloudTable, block: int, x: Any, y: Any, z: Any, best: Any) -> Any:
    """The smaller of lanes of squared distances and those from the points of a block."""
    points = cloud.blocks
    half = np.float32(cloud.half)
    for number in range(LEAF):
        a, b, c = point_at(points, block, number)
        best = smaller(best, to_cube(x - a, y - b, z - c, half))
    return best


@kernel
def to_points(cloud: CloudTable, x: Any, y: Any, z: Any) -> Any:
    """Distance of lanes of points, in the cloud's frame, from the nearest point of the cloud."""
    boxes = cloud.groups
    top = cloud.level_count - 1
    middle = HALF * (lowest(x) + highest(x)), HALF * (lowest(y) + highest(y)), HALF * (lowest(z) + highest(z))
    number = 0

    for down in range(top + 1):
        child = nearest_child(boxes, group_at(cloud, top - down, number), middle[0], middle[1], middle[2])
        number = LEAF * number + child

    best = nearer_of_block(cloud, number, x, y, z, spread(FAR_SQUARE))
    level = top
    number = 0
    group = group_at(cloud, top, 0)
    left = (1 << LEAF) - 1

    while True:
        if left == 0:
            if level == top:
                break
            level = level + 1
            child = number % LEAF + 1
            number = number // LEAF
            group = group_at(cloud, level, number)
            low, high = around_lanes(x, y, z, highest(square_root(best)))
            left = above(boxes_in_reach(boxes, group, low, high), child)
            continue

        child = first_bit(left)
        left &= left - 1
        if bits(to_box(boxes, group, child, x, y, z) < best) == 0:
            continue
        if level > 0:
            level = level - 1
            number = LEAF * number + child
            group = group_at(cloud, level, number)
            low, high = around_lanes(x, y, z, highest(square_root(best)))
            left = boxes_in_reach(boxes, group, low, high)
            continue

        best = nearer_of_block(cloud, LEAF * number + child, x, y, z, best)

    return square_root(best)


@kernel
def next_block(cloud: CloudTable, low: Any, high: Any, after: int) -> int:
    """The first block of points behind a number (-1 for the first of all) whose box meets a box; -1 if none does."""
    boxes = cloud.groups
    top = cloud.level_count - 1
    level = 0
    number = after // LEAF
    child = after % LEAF + 1

    if after < 0:
        level = top
        number = 0
        child = 0

    while True:
        left = above(boxes_in_reach(boxes, group_at(cloud, level, number), low, high), child)
        if left == 0:
            if level == top:
                return -1
            level = level + 1
            child = number % LEAF + 1
            number = number // LEAF
            continue

        found: int = LEAF * number + first_bit(left)
        if level == 0:
            return found

        level = level - 1
        number = found
        child = 0
