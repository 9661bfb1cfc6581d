"""Kernels that compare convex solids themselves where balls leave a pair of bodies open: apart, overlapping or neither.

Each verdict is a proof with a margin. Two solids are apart if a plane is found between them; they overlap if points of
their difference surround the origin or a point of both is found. How plane and points are found (Gilbert, Johnson and
Keerthi 1988) can then do no harm: a poor search only leaves a pair undecided. Solids: see ``solid_tables``.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from rrtik_ompl.fast import layout
from rrtik_ompl.fast.compiled import WIDTH, inlined, kernel
from rrtik_ompl.fast.lanes import (
    bits,
    choose,
    double_at,
    field,
    first_bit,
    float_at,
    highest,
    int_at,
    lanes_at,
    lowest,
    set_int,
    set_lanes,
    spread,
)
from rrtik_ompl.fast.layout import (
    COLLIDING,
    FRAMES,
    FREE,
    INNER_ROWS,
    MARKS,
    MOVING_SOLIDS,
    OUTER,
    OUTER_LAST,
    OUTER_ROWS,
    STANDING_SOLIDS,
    UNDECIDED,
    WORK,
)
from rrtik_ompl.fast.overlap import FRAME_BYTES, meets_itself, meets_surroundings, prepare
from rrtik_ompl.fast.row_kernels import row_gap

MOST_STEPS = 24
CONVERGED = 1e-7  # [m]
SHORTEST = 1e-9  # [m] of a vector that has a direction
SMALLEST_AREA = 1e-10  # [m^2] of two faces that have a side
THINNEST = 1e-6  # [m] height of a tetrahedron that has an inside
LOWEST = np.float32(-1e18)


@inlined
def dot(a: Any, b: Any) -> float:
    """Scalar product."""
    product: float = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return product


@inlined
def cross(a: Any, b: Any) -> Any:
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inlined
def minus(a: Any, b: Any) -> Any:
    """Difference of two vectors."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inlined
def scaled(a: Any, factor: float) -> Any:
    """A vector times a number."""
    return a[0] * factor, a[1] * factor, a[2] * factor


@inlined
def entry_of(frame: int, lane: int, place: int) -> float:
    """A number of a frame in one lane."""
    number: float = np.float64(float_at(frame, place * WIDTH + lane))
    return number


@inlined
def carried(frame: int, lane: int, p: Any) -> Any:
    """A point of a frame in the world."""
    x = entry_of(frame, lane, 0) * p[0] + entry_of(frame, lane, 1) * p[1] + entry_of(frame, lane, 2) * p[2]
    y = entry_of(frame, lane, 3) * p[0] + entry_of(frame, lane, 4) * p[1] + entry_of(frame, lane, 5) * p[2]
    z = entry_of(frame, lane, 6) * p[0] + entry_of(frame, lane, 7) * p[1] + entry_of(frame, lane, 8) * p[2]
    return x + entry_of(frame, lane, 9), y + entry_of(frame, lane, 10), z + entry_of(frame, lane, 11)


@kernel
def farthest(solids: int, number: int, frame: int, note: int, lane: int, way: Any) -> Any:
    """The point of a solid's core that lies farthest along a unit vector, in the world. Here lanes hold corners.

    ``note`` is the address of lanes to write to.
    """
    x = entry_of(frame, lane, 0) * way[0] + entry_of(frame, lane, 3) * way[1] + entry_of(frame, lane, 6) * way[2]
    y = entry_of(frame, lane, 1) * way[0] + entry_of(frame, lane, 4) * way[1] + entry_of(frame, lane, 7) * way[2]
    z = entry_of(frame, lane, 2) * way[0] + entry_of(frame, lane, 5) * way[1] + entry_of(frame, lane, 8) * way[2]
    a, b, c = np.float32(x), np.float32(y), np.float32(z)
    numbers, corners = field(solids, layout.SOLIDS) + 16 * number, field(solids, layout.CORNERS)
    best, where = spread(LOWEST), spread(np.float32(0.0))
    for block in range(int_at(numbers, 1), int_at(numbers, 2)):
        height = lanes_at(corners, 3 * block) * a + lanes_at(corners, 3 * block + 1) * b
        height = height + lanes_at(corners, 3 * block + 2) * c
        higher = height > best
        best = choose(higher, height, best)
        where = choose(higher, spread(np.float32(block)), where)
    first = first_bit(bits(best >= highest(best)))
    set_lanes(note, 0, where)
    corner = 3 * WIDTH * int(float_at(note, first)) + first
    p = (
        np.float64(float_at(corners, corner)),
        np.float64(float_at(corners, corner + WIDTH)),
        np.float64(float_at(corners, corner + 2 * WIDTH)),
    )
    sizes = field(solids, layout.SIZES) + 8 * layout.SIZE_COUNT * number
    radius = double_at(sizes, layout.DISC)
    if radius > 0.0:
        axis = double_at(sizes, layout.AXIS), double_at(sizes, layout.AXIS + 1), double_at(sizes, layout.AXIS + 2)
        across = minus((x, y, z), scaled(axis, dot(axis, (x, y, z))))
        length = sqrt(dot(across, across))
        if length > SHORTEST:
            p = minus(p, scaled(across, -radius / length))
    return carried(frame, lane, p)


@kernel
def nearest_on_triangle(a: Any, b: Any, c: Any) -> Any:
    """The point of a triangle that is nearest to the origin (Ericson 2005, 5.1.5); the corners may coincide.

    Whatever rounding does, it is a mean of the corners with weights that are not negative.
    """
    ab, ac = minus(b, a), minus(c, a)
    d1, d2, d3, d4, d5, d6 = -dot(ab, a), -dot(ac, a), -dot(ab, b), -dot(ac, b), -dot(ab, c), -dot(ac, c)
    if d1 <= 0.0 and d2 <= 0.0:
        return a
    if d3 >= 0.0 and d4 <= d3:
        return b
    if d6 >= 0.0 and d5 <= d6:
        return c
    of_c, of_b, of_a = d1 * d4 - d3 * d2, d5 * d2 - d1 * d6, d3 * d6 - d5 * d4
    if of_c <= 0.0 and d1 >= 0.0 >= d3 and d1 > d3:
        return minus(a, scaled(ab, -d1 / (d1 - d3)))
    if of_b <= 0.0 and d2 >= 0.0 >= d6 and d2 > d6:
        return minus(a, scaled(ac, -d2 / (d2 - d6)))
    if of_a <= 0.0 and d4 >= d3 and d5 >= d6 and (d4 - d3) + (d5 - d6) > 0.0:
        return minus(b, scaled(minus(c, b), -(d4 - d3) / ((d4 - d3) + (d5 - d6))))
    whole = 1.0 / (of_a + of_b + of_c)
    v, w = of_b * whole, of_c * whole
    if not (v >= 0.0 and w >= 0.0 and v + w <= 1.0):
        return a
    return minus(minus(a, scaled(ab, -v)), scaled(ac, -w))


@inlined
def behind(a: Any, b: Any, c: Any, opposite: Any) -> float:
    """How far the origin lies behind the plane of three corners, on the side of the fourth; -1 if there is no side."""
    normal = cross(minus(b, a), minus(c, a))
    length = sqrt(dot(normal, normal))
    if length < SMALLEST_AREA:
        return -1.0
    side, height = dot(normal, minus(opposite, a)) / length, -dot(normal, a) / length
    if abs(side) < THINNEST:
        return -1.0
    return height if side > 0.0 else -height


@kernel
def depth_inside(a: Any, b: Any, c: Any, d: Any) -> float:
    """Distance of the origin from the faces of the tetrahedron that it lies in; negative if it lies outside.

    Where rounding could say which side of a face a corner is on, the origin counts as outside.
    """
    depth: float = min(behind(a, b, c, d), behind(a, b, d, c), behind(a, c, d, b), behind(b, c, d, a))
    return depth


@inlined
def difference(mine: int, first: int, others: int, second: int, frames: Any, lane: int, way: Any) -> Any:
    """The point of (first solid - second solid) that lies farthest against a unit vector."""
    p = farthest(mine, first, frames[0], frames[2], lane, scaled(way, -1.0))
    return minus(p, farthest(others, second, frames[1], frames[2], lane, way))


@inlined
def size_of(solids: int, number: int, place: int) -> float:
    """A number of a solid."""
    size: float = double_at(field(solids, layout.SIZES) + 8 * layout.SIZE_COUNT * number, place)
    return size


@kernel
def compare(mine: int, first: int, others: int, second: int, frames: Any, lane: int, way: Any) -> Any:
    """Compare two solids in one lane, beginning with a plane across the unit vector ``way``.

    Returns:
        FREE, UNDECIDED or COLLIDING, and the unit vector across the last plane, from the second solid to the first.
    """
    reach = size_of(mine, first, layout.ROUND) + size_of(others, second, layout.ROUND)
    slack = size_of(mine, first, layout.SLACK) + size_of(others, second, layout.SLACK)
    solid = int_at(field(mine, layout.SOLIDS), 4 * first + 3) & int_at(field(others, layout.SOLIDS), 4 * second + 3)
    a = difference(mine, first, others, second, frames, lane, way)
    if dot(way, a) > reach + slack:
        return FREE, way
    b, c, v = a, a, a
    for _ in range(MOST_STEPS):
        length = sqrt(dot(v, v))
        if length < reach - slack and solid:
            return COLLIDING, way
        if length < SHORTEST:
            break
        way = scaled(v, 1.0 / length)
        d = difference(mine, first, others, second, frames, lane, way)
        height = dot(way, d)
        if height > reach + slack:
            return FREE, way
        if height <= 0.0:
            depth = depth_inside(a, b, c, d)
            if depth > slack and solid:
                return COLLIDING, way
            if depth >= 0.0:
                break
        if length - height < CONVERGED:
            break
        p, q, r = nearest_on_triangle(a, b, d), nearest_on_triangle(b, c, d), nearest_on_triangle(c, a, d)
        to_p, to_q, to_r = dot(p, p), dot(q, q), dot(r, r)
        if to_p <= to_q and to_p <= to_r:
            c, v = d, p
        elif to_q <= to_r:
            a, v = d, q
        else:
            b, v = d, r
    return UNDECIDED, way


@inlined
def outset(mine: int, first: int, others: int, second: int, frames: Any, lane: int) -> Any:
    """Where the bounding ball of the first solid lies as seen from that of the second: the way, and the gap."""
    sizes = field(mine, layout.SIZES) + 8 * layout.SIZE_COUNT * first
    centre = double_at(sizes, layout.BOUND), double_at(sizes, layout.BOUND + 1), double_at(sizes, layout.BOUND + 2)
    p = carried(frames[0], lane, centre)
    sizes = field(others, layout.SIZES) + 8 * layout.SIZE_COUNT * second
    centre = double_at(sizes, layout.BOUND), double_at(sizes, layout.BOUND + 1), double_at(sizes, layout.BOUND + 2)
    way = minus(p, carried(frames[1], lane, centre))
    length = sqrt(dot(way, way))
    gap = length - size_of(mine, first, layout.BOUND + 3) - size_of(others, second, layout.BOUND + 3)
    if length < SHORTEST:
        return (1.0, 0.0, 0.0), gap
    return scaled(way, 1.0 / length), gap


@kernel
def beyond_plane(mine: int, first: int, others: int, second: int, frames: Any, lane: int) -> int:
    """Compare a solid with a half-space that stands still."""
    sizes = field(others, layout.SIZES) + 8 * layout.SIZE_COUNT * second
    normal = double_at(sizes, layout.AXIS), double_at(sizes, layout.AXIS + 1), double_at(sizes, layout.AXIS + 2)
    p = farthest(mine, first, frames[0], frames[2], lane, scaled(normal, -1.0))
    height = dot(normal, p) - size_of(others, second, layout.DISC) - size_of(mine, first, layout.ROUND)
    slack = size_of(mine, first, layout.SLACK) + size_of(others, second, layout.SLACK)
    if height > slack:
        return FREE
    return COLLIDING if height < -slack and int_at(field(mine, layout.SOLIDS), 4 * first + 3) != 0 else UNDECIDED


@kernel
def compare_solids(mine: int, first: int, others: int, second: int, frames: Any, wanted: int) -> Any:
    """Lanes among ``wanted`` in which two solids are not proven apart, and those in which they are proven to overlap.

    A plane that lies between two solids in one lane often does in the next.
    """
    kind = int_at(field(others, layout.SOLIDS), 4 * second)
    own = int_at(field(mine, layout.SOLIDS), 4 * first)
    if own != layout.CONVEX_SOLID or (kind != layout.CONVEX_SOLID and kind != layout.HALF_SPACE_SOLID):
        return wanted, 0
    open_, overlapping, known, last = 0, 0, False, (1.0, 0.0, 0.0)
    while wanted != 0:
        lane = first_bit(wanted)
        wanted &= wanted - 1
        if kind == layout.HALF_SPACE_SOLID:
            answer = beyond_plane(mine, first, others, second, frames, lane)
        else:
            way, gap = outset(mine, first, others, second, frames, lane)
            if gap > size_of(mine, first, layout.SLACK) + size_of(others, second, layout.SLACK):
                continue
            answer, last = compare(mine, first, others, second, frames, lane, last if known else way)
            known = True
        if answer != FREE:
            open_ |= 1 << lane
        if answer == COLLIDING:
            overlapping |= 1 << lane
    return open_, overlapping


@kernel
def compare_bodies(work: int, mine: int, first: int, others: int, second: int, wanted: int) -> Any:
    """As ``compare_solids``, for bodies: the solids around them, and then those inside them where they differ."""
    spans, other_spans = field(mine, layout.SPANS) + 20 * first, field(others, layout.SPANS) + 20 * second
    frames = (
        field(work, FRAMES) + FRAME_BYTES * int_at(spans, 0),
        field(work, FRAMES) + FRAME_BYTES * int_at(other_spans, 0),
        field(work, layout.NOTE),
    )
    open_, overlapping = 0, 0
    for one in range(int_at(spans, 1), int_at(spans, 2)):
        for other in range(int_at(other_spans, 1), int_at(other_spans, 2)):
            left, hit = compare_solids(mine, one, others, other, frames, wanted & ~overlapping)
            open_ |= left
            overlapping |= hit
    if int_at(spans, 1) == int_at(spans, 3) and int_at(other_spans, 1) == int_at(other_spans, 3):
        return open_, overlapping
    for one in range(int_at(spans, 3), int_at(spans, 4)):
        for other in range(int_at(other_spans, 3), int_at(other_spans, 4)):
            _, hit = compare_solids(mine, one, others, other, frames, open_ & ~overlapping)
            overlapping |= hit
    return open_, overlapping


@inlined
def carried_axis(frame: int, lane: int, axis: int, a: Any, b: Any, c: Any) -> Any:
    """A coordinate in the world of points of a frame. Here lanes hold points; ``lane`` is that of the frame."""
    row = 3 * axis * WIDTH + lane
    turned = a * float_at(frame, row) + b * float_at(frame, row + WIDTH) + c * float_at(frame, row + 2 * WIDTH)
    return turned + float_at(frame, (9 + axis) * WIDTH + lane)


@kernel
def corner_inside(mine: int, one: int, frame: int, lane: int, rows: int, row: int) -> bool:
    """Whether a corner of a solid lies inside a row, in one lane."""
    numbers, corners = field(mine, layout.SOLIDS) + 16 * one, field(mine, layout.CORNERS)
    for block in range(int_at(numbers, 1), int_at(numbers, 2)):
        a, b, c = lanes_at(corners, 3 * block), lanes_at(corners, 3 * block + 1), lanes_at(corners, 3 * block + 2)
        x, y = carried_axis(frame, lane, 0, a, b, c), carried_axis(frame, lane, 1, a, b, c)
        gap = row_gap(rows, row, x, y, carried_axis(frame, lane, 2, a, b, c), False)
        if lowest(gap) < -size_of(mine, one, layout.SLACK):
            return True
    return False


@kernel
def corners_inside(world: int, body: int, standing: int, wanted: int) -> int:
    """Lanes among ``wanted`` in which a point of a moving body lies inside one that stands still."""
    mine, rows, overlapping = field(world, MOVING_SOLIDS), field(world, INNER_ROWS), 0
    row, spans = int_at(field(rows, layout.OWN), standing), field(mine, layout.SPANS) + 20 * body
    frame = field(field(world, WORK), FRAMES) + FRAME_BYTES * int_at(spans, 0)
    if row < 0:
        return 0
    for one in range(int_at(spans, 3), int_at(spans, 4)):
        if int_at(field(mine, layout.SOLIDS), 4 * one) == layout.MERE_CORNERS:
            left = wanted & ~overlapping
            while left != 0:
                lane = first_bit(left)
                left &= left - 1
                if corner_inside(mine, one, frame, lane, rows, row):
                    overlapping |= 1 << lane
    return overlapping


@kernel
def mark(world: int, wanted: int) -> int:
    """Collect for each pair of bodies the lanes in which the outer balls cannot prove it free; returns their number.

    The numbers of moving and standing bodies come first, then those of the pairs of moving bodies.
    """
    work, balls, rows = field(world, WORK), field(world, OUTER), field(world, OUTER_ROWS)
    prepare(balls, work)
    marks = field(work, MARKS)
    crossing = field(balls, layout.BODY_COUNT) * field(rows, layout.STANDING_COUNT)
    total: int = crossing + field(balls, layout.PAIR_COUNT)
    for k in range(total):
        set_int(marks, k, 0)
    meets_surroundings(balls, rows, work, wanted, marks, wanted < 0, field(work, OUTER_LAST))
    meets_itself(balls, work, wanted, marks + 4 * crossing, wanted < 0)
    return total


@kernel
def settle(world: int, wanted: int) -> Any:
    """Look at the pairs of bodies that the outer balls leave open in the lanes ``wanted``, solid by solid.

    The marks of what is proven apart are taken back. A lane in which something overlaps is not looked at further.

    Returns:
        Lanes in which something remains open, and lanes that are colliding.
    """
    total = mark(world, wanted)
    work, balls, mine = field(world, WORK), field(world, OUTER), field(world, MOVING_SOLIDS)
    standing = field(field(world, OUTER_ROWS), layout.STANDING_COUNT)
    crossing = field(balls, layout.BODY_COUNT) * standing
    marks, pairs = field(work, MARKS), field(balls, layout.PAIRS)
    open_, colliding = 0, 0
    for k in range(total):
        marked = int_at(marks, k) & ~colliding
        if marked == 0:
            continue
        if k < crossing:
            first, second, others = k // standing, k % standing, field(world, STANDING_SOLIDS)
        else:
            first, second, others = int_at(pairs, 2 * (k - crossing)), int_at(pairs, 2 * (k - crossing) + 1), mine
        left, hit = compare_bodies(work, mine, first, others, second, marked)
        if k < crossing and left != hit:
            hit |= corners_inside(world, first, second, left & ~hit)
        set_int(marks, k, left | int_at(marks, k) & colliding)
        open_ |= left
        colliding |= hit
    return open_ & ~colliding, colliding
