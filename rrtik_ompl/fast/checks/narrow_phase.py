"""The narrow phase: kernels that compare bodies that balls leave in doubt, by the solids around and inside them.

Lanes are bits of an integer. Solids: see :mod:`rrtik_ompl.fast.tables.solid_tables`.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from rrtik_ompl.fast.checks.gjk import SHORTEST, carried, compare, dot, farthest, minus, scaled, size_of
from rrtik_ompl.fast.checks.obstacle_kernels import primitive_gap
from rrtik_ompl.fast.checks.sphere_kernels import FRAME_BYTES, prepare, scene_collision, self_collision
from rrtik_ompl.fast.simd.compiled import WIDTH, inlined, kernel
from rrtik_ompl.fast.simd.lanes import double_at, field, first_bit, float_at, int_at, lanes_at, lowest, set_int
from rrtik_ompl.fast.tables import layout
from rrtik_ompl.fast.tables.layout import (
    COLLIDING,
    FRAMES,
    FREE,
    INNER_PRIMITIVES,
    MARKS,
    MOVING_SOLIDS,
    OUTER,
    OUTER_LAST,
    OUTER_PRIMITIVES,
    SCRATCH,
    STANDING_SOLIDS,
    UNDECIDED,
)


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
def compare_bodies(scratch: int, mine: int, first: int, others: int, second: int, wanted: int) -> Any:
    """As ``compare_solids``, for bodies: the solids around them, and then those inside them where they differ."""
    spans, other_spans = field(mine, layout.SPANS) + 20 * first, field(others, layout.SPANS) + 20 * second
    frames = (
        field(scratch, FRAMES) + FRAME_BYTES * int_at(spans, 0),
        field(scratch, FRAMES) + FRAME_BYTES * int_at(other_spans, 0),
        field(scratch, layout.NOTE),
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
    place = 3 * axis * WIDTH + lane
    turned = a * float_at(frame, place) + b * float_at(frame, place + WIDTH) + c * float_at(frame, place + 2 * WIDTH)
    return turned + float_at(frame, (9 + axis) * WIDTH + lane)


@kernel
def corner_inside(mine: int, one: int, frame: int, lane: int, primitives: int, primitive: int) -> bool:
    """Whether a corner of a solid lies inside a primitive, in one lane."""
    numbers, corners = field(mine, layout.SOLIDS) + 16 * one, field(mine, layout.CORNERS)
    for block in range(int_at(numbers, 1), int_at(numbers, 2)):
        a, b, c = lanes_at(corners, 3 * block), lanes_at(corners, 3 * block + 1), lanes_at(corners, 3 * block + 2)
        x, y = carried_axis(frame, lane, 0, a, b, c), carried_axis(frame, lane, 1, a, b, c)
        gap = primitive_gap(primitives, primitive, x, y, carried_axis(frame, lane, 2, a, b, c), False)
        if lowest(gap) < -size_of(mine, one, layout.SLACK):
            return True
    return False


@kernel
def corners_inside(world: int, body: int, standing: int, wanted: int) -> int:
    """Lanes among ``wanted`` in which a point of a moving body lies inside one that stands still."""
    mine, primitives, overlapping = field(world, MOVING_SOLIDS), field(world, INNER_PRIMITIVES), 0
    primitive, spans = int_at(field(primitives, layout.OWN), standing), field(mine, layout.SPANS) + 20 * body
    frame = field(field(world, SCRATCH), FRAMES) + FRAME_BYTES * int_at(spans, 0)
    if primitive < 0:
        return 0
    for one in range(int_at(spans, 3), int_at(spans, 4)):
        if int_at(field(mine, layout.SOLIDS), 4 * one) == layout.MERE_CORNERS:
            left = wanted & ~overlapping
            while left != 0:
                lane = first_bit(left)
                left &= left - 1
                if corner_inside(mine, one, frame, lane, primitives, primitive):
                    overlapping |= 1 << lane
    return overlapping


@kernel
def mark(world: int, wanted: int) -> int:
    """Collect for each pair of bodies the lanes in which the outer balls cannot prove it free; returns their number.

    The numbers of moving and standing bodies come first, then those of the pairs of moving bodies.
    """
    scratch, balls, primitives = field(world, SCRATCH), field(world, OUTER), field(world, OUTER_PRIMITIVES)
    prepare(balls, scratch)
    marks = field(scratch, MARKS)
    crossing = field(balls, layout.BODY_COUNT) * field(primitives, layout.STANDING_COUNT)
    total: int = crossing + field(balls, layout.PAIR_COUNT)
    for k in range(total):
        set_int(marks, k, 0)
    scene_collision(balls, primitives, scratch, wanted, marks, wanted < 0, field(scratch, OUTER_LAST))
    self_collision(balls, scratch, wanted, marks + 4 * crossing, wanted < 0)
    return total


@kernel
def narrow_phase(world: int, wanted: int) -> Any:
    """Look at the pairs of bodies that the outer balls leave open in the lanes ``wanted``, solid by solid.

    The marks of what is proven apart are taken back. A lane in which something overlaps is not looked at further.

    Returns:
        Lanes in which something remains open, and lanes that are colliding.
    """
    total = mark(world, wanted)
    scratch, balls, mine = field(world, SCRATCH), field(world, OUTER), field(world, MOVING_SOLIDS)
    standing = field(field(world, OUTER_PRIMITIVES), layout.STANDING_COUNT)
    crossing = field(balls, layout.BODY_COUNT) * standing
    marks, pairs = field(scratch, MARKS), field(balls, layout.PAIRS)
    open_, colliding = 0, 0
    for k in range(total):
        marked = int_at(marks, k) & ~colliding
        if marked == 0:
            continue
        if k < crossing:
            first, second, others = k // standing, k % standing, field(world, STANDING_SOLIDS)
        else:
            first, second, others = int_at(pairs, 2 * (k - crossing)), int_at(pairs, 2 * (k - crossing) + 1), mine
        left, hit = compare_bodies(scratch, mine, first, others, second, marked)
        if k < crossing and left != hit:
            hit |= corners_inside(world, first, second, left & ~hit)
        set_int(marks, k, left | int_at(marks, k) & colliding)
        open_ |= left
        colliding |= hit
    return open_ & ~colliding, colliding
