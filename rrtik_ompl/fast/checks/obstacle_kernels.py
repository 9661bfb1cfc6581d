"""Kernels that test a ball, in all lanes at once, against what stands still.

Lanes are bits of an integer. Rows: see :mod:`rrtik_ompl.fast.tables.layout`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rrtik_ompl.fast.simd.compiled import WIDTH, inlined, kernel
from rrtik_ompl.fast.simd.lanes import (
    absolute,
    bits,
    choose,
    field,
    first_bit,
    float_at,
    highest,
    int_at,
    lanes_at,
    larger,
    lowest,
    set_int,
    smaller,
    spread,
    square_root,
)
from rrtik_ompl.fast.tables import layout

ZERO, ONE = np.float32(0.0), np.float32(1.0)
UNBOUNDED_DISTANCE = np.float32(1e18)  # [m] where there is nothing to measure; its square is a float32 still


@inlined
def squared(x: Any, y: Any, z: Any) -> Any:
    """Squared length."""
    return x * x + y * y + z * z


@inlined
def along(row: int, place: int, x: Any, y: Any, z: Any) -> Any:
    """Dot product with the three numbers of a row from ``place`` on."""
    return x * float_at(row, place) + y * float_at(row, place + 1) + z * float_at(row, place + 2)


@inlined
def to_capsule(row: int, x: Any, y: Any, z: Any) -> Any:
    """Squared distance from a capsule's axis; x, y, z from its first end."""
    share = smaller(larger(along(row, 3, x, y, z) * float_at(row, 6), ZERO), ONE)
    return squared(x - share * float_at(row, 3), y - share * float_at(row, 4), z - share * float_at(row, 5))


@inlined
def to_box(row: int, x: Any, y: Any, z: Any) -> Any:
    """Squared distance from a box; x, y, z from its centre."""
    return squared(
        larger(absolute(along(row, 3, x, y, z)) - float_at(row, 12), ZERO),
        larger(absolute(along(row, 6, x, y, z)) - float_at(row, 13), ZERO),
        larger(absolute(along(row, 9, x, y, z)) - float_at(row, 14), ZERO),
    )


@inlined
def to_cylinder(row: int, x: Any, y: Any, z: Any) -> Any:
    """Squared distance from a cylinder; x, y, z from its centre."""
    height = along(row, 3, x, y, z)
    across = squared(x - height * float_at(row, 3), y - height * float_at(row, 4), z - height * float_at(row, 5))
    beyond = larger(absolute(height) - float_at(row, 6), ZERO)
    outside = larger(square_root(across) - float_at(row, 7), ZERO)
    return beyond * beyond + outside * outside


@kernel
def meets_convex(planes: int, start: int, end: int, share: Any, x: Any, y: Any, z: Any, radius: float) -> Any:
    """Lanes in which no plane has a ball in front of it. Share 0 asks for the centre only."""
    meeting = bits(spread(ZERO) < ONE)
    for plane in range(start, end):
        height = along(planes, 4 * plane, x, y, z) - float_at(planes, 4 * plane + 3)
        meeting &= bits(height < share * radius)
        if meeting == 0:
            break
    return meeting


@inlined
def meets_primitive(primitives: int, number: int, x: Any, y: Any, z: Any, radius: float, bound: bool) -> Any:
    """Lanes in which a ball meets a row; ``bound`` tells that the ball only stands for balls inside it."""
    row = field(primitives, layout.PRIMITIVES) + 4 * layout.PRIMITIVE_FLOATS * number
    numbers = field(primitives, layout.NUMBERS) + 16 * number
    kind = int_at(numbers, 0)
    if kind == layout.HALF_SPACE:
        return bits(along(row, 0, x, y, z) - float_at(row, 3) < radius)
    if kind == layout.CONVEX:
        planes = field(primitives, layout.PLANES)
        share = ONE if bound else float_at(row, 0)
        return meets_convex(planes, int_at(numbers, 2), int_at(numbers, 3), share, x, y, z, radius)
    x, y, z = x - float_at(row, 0), y - float_at(row, 1), z - float_at(row, 2)
    if kind == layout.BOX:
        return bits(to_box(row, x, y, z) < radius * radius)
    if kind == layout.BALL:
        reach = radius + float_at(row, 3)
        return bits(squared(x, y, z) < reach * reach)
    if kind == layout.CAPSULE:
        reach = radius + float_at(row, 7)
        return bits(to_capsule(row, x, y, z) < reach * reach)
    return bits(to_cylinder(row, x, y, z) < radius * radius)


@kernel
def to_convex(planes: int, start: int, end: int, x: Any, y: Any, z: Any) -> Any:
    """Largest height over the planes of a convex row; no more than the distance from it."""
    height = along(planes, 4 * start, x, y, z) - float_at(planes, 4 * start + 3)
    for plane in range(start + 1, end):
        height = larger(height, along(planes, 4 * plane, x, y, z) - float_at(planes, 4 * plane + 3))
    return height


@kernel
def primitive_gap(primitives: int, number: int, x: Any, y: Any, z: Any, bound: bool) -> Any:
    """Signed distance of a point from a row, negative inside; ``bound`` tells that it stands for points near it."""
    row = field(primitives, layout.PRIMITIVES) + 4 * layout.PRIMITIVE_FLOATS * number
    numbers = field(primitives, layout.NUMBERS) + 16 * number
    kind = int_at(numbers, 0)
    if kind == layout.HALF_SPACE:
        return along(row, 0, x, y, z) - float_at(row, 3)
    if kind == layout.CONVEX:
        height = to_convex(field(primitives, layout.PLANES), int_at(numbers, 2), int_at(numbers, 3), x, y, z)
        if bound or float_at(row, 0) != ZERO:
            return height
        # Outside, the height is too small for an inner primitive.
        return choose(height < ZERO, height, spread(UNBOUNDED_DISTANCE))
    x, y, z = x - float_at(row, 0), y - float_at(row, 1), z - float_at(row, 2)
    if kind == layout.BALL:
        return square_root(squared(x, y, z)) - float_at(row, 3)
    if kind == layout.CAPSULE:
        return square_root(to_capsule(row, x, y, z)) - float_at(row, 7)
    if kind == layout.BOX:
        a = absolute(along(row, 3, x, y, z)) - float_at(row, 12)
        b = absolute(along(row, 6, x, y, z)) - float_at(row, 13)
        c = absolute(along(row, 9, x, y, z)) - float_at(row, 14)
        outside = square_root(squared(larger(a, ZERO), larger(b, ZERO), larger(c, ZERO)))
        return outside + smaller(larger(larger(a, b), c), ZERO)
    height = along(row, 3, x, y, z)
    across = squared(x - height * float_at(row, 3), y - height * float_at(row, 4), z - height * float_at(row, 5))
    a, b = absolute(height) - float_at(row, 6), square_root(across) - float_at(row, 7)
    outside = square_root(larger(a, ZERO) * larger(a, ZERO) + larger(b, ZERO) * larger(b, ZERO))
    return outside + smaller(larger(a, b), ZERO)


@kernel
def meets_primitives(
    primitives: int,
    x: Any,
    y: Any,
    z: Any,
    radius: float,
    bound: bool,
    wanted: int,
    source: int,
    count: int,
    sink: int,
    marks: int,
) -> Any:
    """Lanes among ``wanted`` in which a ball meets one of the primitives of a list; those that it meets go to ``sink``.

    Unless 0, ``marks`` is the address of one number for each standing body, which collects the lanes that meet it.
    """
    meeting, kept = 0, 0
    for k in range(count):
        number = int_at(source, k)
        found = meets_primitive(primitives, number, x, y, z, radius, bound) & wanted
        if found != 0:
            meeting |= found
            set_int(sink, kept, number)
            kept += 1
            if marks != 0:
                body = int_at(field(primitives, layout.NUMBERS), 4 * number + 1)
                set_int(marks, body, int_at(marks, body) | found)
    return meeting, kept


@kernel
def primitives_in_reach(primitives: int, x: Any, y: Any, z: Any, radius: float, found: int) -> int:
    """List the primitives whose bounding box meets the box around a ball in all lanes; returns their number.

    Here the lanes hold primitives, not configurations.
    """
    low_x, high_x = lowest(x) - radius, highest(x) + radius
    low_y, high_y = lowest(y) - radius, highest(y) + radius
    low_z, high_z = lowest(z) - radius, highest(z) + radius
    boxes = field(primitives, layout.BOXES)
    steps = field(primitives, layout.PADDED_COUNT) // WIDTH
    count = 0
    for k in range(steps):
        inside_x = (lanes_at(boxes, k) < high_x) & (lanes_at(boxes, steps + k) > low_x)
        inside_y = (lanes_at(boxes, 2 * steps + k) < high_y) & (lanes_at(boxes, 3 * steps + k) > low_y)
        inside_z = (lanes_at(boxes, 4 * steps + k) < high_z) & (lanes_at(boxes, 5 * steps + k) > low_z)
        left = bits(inside_x & inside_y & inside_z)
        while left != 0:
            set_int(found, count, k * WIDTH + first_bit(left))
            count += 1
            left &= left - 1
    return count
