"""Which primitives are in reach of a ball: those whose bounding boxes meet the box around it.

Where there are many, boxes around neighbours are looked at first, so that time grows with what is near.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rrtik_ompl.kernels import layout
from rrtik_ompl.kernels.layout import PrimitiveList, PrimitiveTable
from rrtik_ompl.kernels.record import Floats
from rrtik_ompl.kernels.simd.compiled import WIDTH, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import bits, first_bit, float_at, highest, lanes_at, larger, lowest, set_int, spread

ZERO = np.float32(0.0)


@inlined
def boxes_that_meet(boxes: Floats, run: int, k: int, low: Any, high: Any) -> int:
    """Which of ``WIDTH`` bounding boxes meet a box, whose corners are given in all lanes."""
    x = (lanes_at(boxes, layout.LOW_X * run + k) < high[0]) & (lanes_at(boxes, layout.HIGH_X * run + k) > low[0])
    y = (lanes_at(boxes, layout.LOW_Y * run + k) < high[1]) & (lanes_at(boxes, layout.HIGH_Y * run + k) > low[1])
    z = (lanes_at(boxes, layout.LOW_Z * run + k) < high[2]) & (lanes_at(boxes, layout.HIGH_Z * run + k) > low[2])
    meeting: int = bits(x & y & z)
    return meeting


@inlined
def listed(found: PrimitiveList, count: int, first: int, left: int) -> int:
    """List numbers from ``first`` on, those of the bits of ``left``; returns how long the list is then."""
    while left != 0:
        set_int(found, count, first + first_bit(left))
        count += 1
        left &= left - 1
    return count


@inlined
def block_in_reach(boxes: Floats, run: int, block: int, x: Any, y: Any, z: Any, radius: Any) -> bool:
    """Whether a ball meets the box around a block of primitives in any lane."""
    place = block
    side = run * WIDTH
    square = spread(ZERO)

    for p in (x, y, z):
        beyond = larger(float_at(boxes, place) - p, p - float_at(boxes, place + side))
        square = square + larger(beyond, ZERO) * larger(beyond, ZERO)
        place += 2 * side

    near: bool = bits(square < radius * radius) != 0
    return near


@kernel
def primitives_in_reach(primitives: PrimitiveTable, x: Any, y: Any, z: Any, radius: float, found: PrimitiveList) -> int:
    """List the primitives whose bounding box meets the box around a ball in all lanes; returns their number.

    Here the lanes hold primitives, not configurations.
    """
    low = (lowest(x) - radius, lowest(y) - radius, lowest(z) - radius)
    high = (highest(x) + radius, highest(y) + radius, highest(z) + radius)
    boxes = primitives.boxes
    run = primitives.padded_count // WIDTH
    count = 0
    blocks = primitives.block_count // WIDTH

    if blocks == 0:
        for k in range(run):
            count = listed(found, count, k * WIDTH, boxes_that_meet(boxes, run, k, low, high))
        return count

    for k in range(blocks):
        left = boxes_that_meet(primitives.block_boxes, blocks, k, low, high)
        while left != 0:
            block = k * WIDTH + first_bit(left)
            left &= left - 1
            if not block_in_reach(primitives.block_boxes, blocks, block, x, y, z, radius):
                continue
            block *= layout.BLOCK // WIDTH
            for part in range(block, block + layout.BLOCK // WIDTH):
                count = listed(found, count, part * WIDTH, boxes_that_meet(boxes, run, part, low, high))

    return count
