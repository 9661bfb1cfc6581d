"""The narrow phase in kernels: bodies that balls leave in doubt, compared by the solids around and inside them.

It goes body by body, in the lanes in doubt; what it does not decide is left to an exact checker. A set of lanes is an
integer, one bit a lane. Solids: see :mod:`rrtik_ompl.kernels.tables.solid_tables`.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from rrtik_ompl.kernels import layout
from rrtik_ompl.kernels.checks.cloud_phase import compare_cloud, is_cloud
from rrtik_ompl.kernels.checks.gjk import (
    SHORTEST,
    Frames,
    carried,
    compare,
    dot,
    farthest,
    minus,
    scaled,
    slack_between,
)
from rrtik_ompl.kernels.checks.neighbour_kernels import mark_neighbours, near_in_lanes
from rrtik_ompl.kernels.checks.obstacle_kernels import ZERO, primitive_gap
from rrtik_ompl.kernels.checks.self_kernels import self_collision
from rrtik_ompl.kernels.checks.sphere_kernels import prepare, scene_collision
from rrtik_ompl.kernels.layout import (
    COLLIDING,
    FREE,
    NO_WATCH,
    UNDECIDED,
    Frame,
    PrimitiveTable,
    ScratchTable,
    SolidTable,
    WorldTable,
)
from rrtik_ompl.kernels.simd.access import nonzero_ints
from rrtik_ompl.kernels.simd.compiled import WIDTH, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import first_bit, float_at, int_at, lowest, set_int, set_lanes, spread
from rrtik_ompl.kernels.tables.accessors import (
    axis_of,
    bound_centre_of,
    bound_radius_of,
    corner_block,
    disc_of,
    end_around_of,
    end_block_of,
    end_inside_of,
    first_around_of,
    first_block_of,
    first_inside_of,
    frame_at,
    frame_of_span,
    is_inside,
    kind_of_solid,
    mark_of_neighbours,
    marks_row,
    neighbours_at,
    one_body_of,
    other_body_of,
    pair_at,
    round_of,
    sizes_at,
    slack_of,
    solid_at,
    span_at,
)


@inlined
def outset(mine: SolidTable, first: int, others: SolidTable, second: int, frames: Frames, lane: int) -> Any:
    """Where the bounding ball of the first solid lies as seen from that of the second: the direction, and the gap."""
    own = sizes_at(mine.sizes, first)
    other = sizes_at(others.sizes, second)
    p = carried(frames[0], lane, bound_centre_of(own))
    direction = minus(p, carried(frames[1], lane, bound_centre_of(other)))
    length = sqrt(dot(direction, direction))
    gap = length - bound_radius_of(own) - bound_radius_of(other)
    if length < SHORTEST:
        return (1.0, 0.0, 0.0), gap
    return scaled(direction, 1.0 / length), gap


@kernel
def beyond_plane(mine: SolidTable, first: int, others: SolidTable, second: int, frames: Frames, lane: int) -> int:
    """Compare a solid with a half-space that stands still."""
    half_space = sizes_at(others.sizes, second)
    normal = axis_of(half_space)
    p = farthest(mine, first, frames[0], frames[2], lane, scaled(normal, -1.0))
    height = dot(normal, p) - disc_of(half_space) - round_of(sizes_at(mine.sizes, first))
    slack = slack_between(mine, first, others, second)
    if height > slack:
        return FREE
    return COLLIDING if height < -slack and is_inside(solid_at(mine.solids, first)) != 0 else UNDECIDED


@kernel
def compare_solids(mine: SolidTable, first: int, others: SolidTable, second: int, frames: Frames, wanted: int) -> Any:
    """Lanes among ``wanted`` in which two solids are not proven apart, and those in which they are proven to overlap.

    A plane that lies between two solids in one lane often does in the next.
    """
    kind = kind_of_solid(solid_at(others.solids, second))
    own = kind_of_solid(solid_at(mine.solids, first))
    if own != layout.CONVEX_SOLID or (kind != layout.CONVEX_SOLID and kind != layout.HALF_SPACE_SOLID):
        return wanted, 0

    open_ = 0
    overlapping = 0
    known = False
    last = (1.0, 0.0, 0.0)

    while wanted != 0:
        lane = first_bit(wanted)
        wanted &= wanted - 1
        if kind == layout.HALF_SPACE_SOLID:
            answer = beyond_plane(mine, first, others, second, frames, lane)
        else:
            direction, gap = outset(mine, first, others, second, frames, lane)
            if gap > slack_between(mine, first, others, second):
                continue
            answer, last = compare(mine, first, others, second, frames, lane, last if known else direction)
            known = True

        if answer != FREE:
            open_ |= 1 << lane
        if answer == COLLIDING:
            overlapping |= 1 << lane

    return open_, overlapping


@kernel
def compare_bodies(
    scratch: ScratchTable, mine: SolidTable, first: int, others: SolidTable, second: int, wanted: int
) -> Any:
    """As ``compare_solids``, for bodies: the solids around them, and then those inside them where they differ."""
    own = span_at(mine.spans, first)
    other_own = span_at(others.spans, second)
    frames = (
        frame_at(scratch.frames, frame_of_span(own)),
        frame_at(scratch.frames, frame_of_span(other_own)),
        scratch.note,
    )
    open_ = 0
    overlapping = 0

    for one in range(first_around_of(own), end_around_of(own)):
        for other in range(first_around_of(other_own), end_around_of(other_own)):
            left, hit = compare_solids(mine, one, others, other, frames, wanted & ~overlapping)
            open_ |= left
            overlapping |= hit

    if first_around_of(own) == first_inside_of(own) and first_around_of(other_own) == first_inside_of(other_own):
        return open_, overlapping

    for one in range(first_inside_of(own), end_inside_of(own)):
        for other in range(first_inside_of(other_own), end_inside_of(other_own)):
            _, hit = compare_solids(mine, one, others, other, frames, open_ & ~overlapping)
            overlapping |= hit

    return open_, overlapping


@kernel
def carried_axis(frame: Frame, lane: int, axis: int, a: Any, b: Any, c: Any) -> Any:
    """A coordinate in the world of points of a frame. Here lanes hold points; ``lane`` is that of the frame."""
    place = (layout.ROTATION + layout.AXES * axis) * WIDTH + lane
    turned = a * float_at(frame, place) + b * float_at(frame, place + WIDTH) + c * float_at(frame, place + 2 * WIDTH)
    return turned + float_at(frame, (layout.ORIGIN + axis) * WIDTH + lane)


@kernel
def corner_inside(
    mine: SolidTable, one: int, frame: Frame, lane: int, primitives: PrimitiveTable, primitive: int
) -> bool:
    """Whether a corner of a solid lies inside a primitive, in one lane."""
    solid = solid_at(mine.solids, one)
    corners = mine.corners
    for block in range(first_block_of(solid), end_block_of(solid)):
        a, b, c = corner_block(corners, block)
        x = carried_axis(frame, lane, 0, a, b, c)
        y = carried_axis(frame, lane, 1, a, b, c)
        gap = primitive_gap(primitives, primitive, x, y, carried_axis(frame, lane, 2, a, b, c), False)
        if lowest(gap) < -slack_of(sizes_at(mine.sizes, one)):
            return True

    return False


@kernel
def corners_inside(world: WorldTable, body: int, standing: int, wanted: int) -> int:
    """Lanes among ``wanted`` in which a point of a moving body lies inside one that stands still."""
    mine = world.moving_solids
    primitives = world.inner_primitives
    overlapping = 0
    primitive = int_at(primitives.own, standing)
    span = span_at(mine.spans, body)
    frame = frame_at(world.scratch.frames, frame_of_span(span))
    if primitive < 0:
        return 0

    for one in range(first_inside_of(span), end_inside_of(span)):
        if kind_of_solid(solid_at(mine.solids, one)) == layout.MERE_CORNERS:
            left = wanted & ~overlapping
            while left != 0:
                lane = first_bit(left)
                left &= left - 1
                if corner_inside(mine, one, frame, lane, primitives, primitive):
                    overlapping |= 1 << lane

    return overlapping


@kernel
def mark(world: WorldTable, wanted: int) -> int:
    """Collect for each pair of bodies the lanes in which it is not proven free; returns the number of pairs.

    Outer balls prove that, or the cells of neighbours.

    The numbers of moving and standing bodies come first, then those of the pairs of moving bodies.
    """
    scratch = world.scratch
    balls = world.outer_balls
    primitives = world.outer_primitives
    prepare(balls, scratch, world.arm.joint_count)
    marks = scratch.marks
    crossing = balls.body_count * primitives.standing_count
    total = crossing + balls.pair_count

    for block in range((total + WIDTH - 1) // WIDTH):  # a scene of ten thousand bodies has as many for each link
        set_lanes(marks, block, spread(ZERO))
    scene_collision(balls, primitives, scratch, wanted, marks, wanted < 0, scratch.outer_likely, NO_WATCH)
    self_collision(balls, scratch, wanted, marks_row(marks, crossing, 1), wanted < 0, NO_WATCH)
    mark_neighbours(world.neighbours, scratch.values, wanted, marks)
    return total


@kernel
def compare_pair(world: WorldTable, number: int, wanted: int) -> Any:
    """Lanes among ``wanted`` in which a marked pair is not proven apart, and those in which it is proven to overlap."""
    scratch = world.scratch
    balls = world.outer_balls
    mine = world.moving_solids
    standing = world.outer_primitives.standing_count
    crossing = balls.body_count * standing
    if number >= crossing:
        pair = pair_at(balls.pairs, number - crossing)
        return compare_bodies(scratch, mine, one_body_of(pair), world.wider_solids, other_body_of(pair), wanted)

    first = number // standing
    second = number % standing
    others = world.standing_solids
    if is_cloud(others, second):
        return compare_cloud(world, first, second, wanted)

    left, hit = compare_bodies(scratch, mine, first, others, second, wanted)
    if left != hit:
        hit |= corners_inside(world, first, second, left & ~hit)
    return left, hit


@kernel
def compared_neighbours(world: WorldTable, pairs: int, wanted: int, resolve: bool) -> int:
    """What cells, and with ``resolve`` solids, say of some neighbours (as bits) in the lanes: the worst answer."""
    neighbours = world.neighbours
    worst = FREE
    while pairs != 0 and worst != COLLIDING:
        number = first_bit(pairs)
        pairs &= pairs - 1
        near = near_in_lanes(neighbours, number, world.scratch.values, wanted)
        if near == 0:
            continue
        if not resolve:
            return UNDECIDED
        left, hit = compare_pair(world, mark_of_neighbours(neighbours_at(neighbours.pairs, number)), near)
        if left != 0:
            worst = COLLIDING if hit != 0 else UNDECIDED
    return worst


@kernel
def narrow_phase(world: WorldTable, wanted: int) -> Any:
    """Compare the pairs of bodies that the outer balls leave open in the lanes ``wanted``, solid by solid.

    The marks of what is proven apart are taken back. A lane in which something overlaps is not compared further.

    Returns:
        Lanes in which something remains open, and lanes that are colliding.
    """
    total = mark(world, wanted)
    marks = world.scratch.marks
    open_ = 0
    colliding = 0

    for block in range((total + WIDTH - 1) // WIDTH):
        marked = nonzero_ints(marks, block)
        while marked != 0:
            k = block * WIDTH + first_bit(marked)
            marked &= marked - 1
            lanes = int_at(marks, k) & ~colliding
            if lanes == 0:
                continue
            left, hit = compare_pair(world, k, lanes)
            set_int(marks, k, left | int_at(marks, k) & colliding)
            open_ |= left
            colliding |= hit

    return open_ & ~colliding, colliding
