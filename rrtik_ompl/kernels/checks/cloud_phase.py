"""The narrow phase of a body and a cloud: its solids against each point that one of its balls has found.

The balls cover the body, so a point that none of them meets is clear of it. The standing solid of a cloud is the ball
around whatever point is at hand, or the cube: its corners are written here. A set of lanes is an integer, one bit a
lane.
"""

from __future__ import annotations

from math import sqrt
from typing import Any, TypeAlias

import numpy as np

from rrtik_ompl.kernels import layout
from rrtik_ompl.kernels.checks.gjk import SHORTEST, Frames, compare, dot, farthest, minus, scaled
from rrtik_ompl.kernels.checks.sphere_kernels import place_cluster
from rrtik_ompl.kernels.clouds.accessors import PARTS, point_at
from rrtik_ompl.kernels.clouds.kernels import next_block, points_below, points_in_reach, widened
from rrtik_ompl.kernels.clouds.primitive_kernels import in_cloud, table_of
from rrtik_ompl.kernels.layout import (
    COLLIDING,
    FREE,
    UNDECIDED,
    Centre,
    PrimitiveShape,
    ScratchTable,
    SolidTable,
    Span,
    WorldTable,
)
from rrtik_ompl.kernels.simd.compiled import WIDTH, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import first_bit, float_at, int_at, lanes_at, set_double, set_lanes
from rrtik_ompl.kernels.simd.vectors import squared
from rrtik_ompl.kernels.tables.accessors import (
    body_at,
    centre_of,
    cloud_radius_of,
    cluster_at,
    end_around_of,
    end_ball_of,
    end_cluster_of_body,
    end_inside_of,
    first_around_of,
    first_axis_of,
    first_ball_of,
    first_block_of,
    first_cluster_of_body,
    first_inside_of,
    frame_at,
    frame_of_span,
    head_at,
    kind_of_solid,
    radius_at,
    round_of,
    second_axis_of,
    shape_at,
    sizes_at,
    slack_of,
    solid_at,
    span_at,
    third_axis_of,
)

Cloud: TypeAlias = Any  # address of its table, its shape, the table and the number of its standing solid
Plane: TypeAlias = Any  # unit normal and height, in the cloud's frame

ZERO = np.float32(0.0)
NO_PLANE = (ZERO, ZERO, ZERO, np.float32(-1.0))  # that no point lies below
HIGHEST = 1e18  # [m]
ROUNDING = 1e-6  # more than eight roundings of a float32, which is what a height is made of


@inlined
def is_cloud(solids: SolidTable, body: int) -> bool:
    """Whether a body of a table of solids is a cloud."""
    kind: int = kind_of_solid(solid_at(solids.solids, first_around_of(span_at(solids.spans, body))))
    return kind == layout.CLOUD_SOLID


@inlined
def out_of_cloud(shape: PrimitiveShape, p: Any) -> Any:
    """A point of a cloud's frame in the world."""
    a = first_axis_of(shape)
    b = second_axis_of(shape)
    c = third_axis_of(shape)
    centre = centre_of(shape)

    return (
        a[0] * p[0] + b[0] * p[1] + c[0] * p[2] + centre[0],
        a[1] * p[0] + b[1] * p[1] + c[1] * p[2] + centre[1],
        a[2] * p[0] + b[2] * p[1] + c[2] * p[2] + centre[2],
    )


@inlined
def centre_in_lane(centres: Centre, ball: int, lane: int) -> Any:
    """The centre of a ball in one lane."""
    place = layout.AXES * WIDTH * ball + lane
    return float_at(centres, place), float_at(centres, place + WIDTH), float_at(centres, place + 2 * WIDTH)


@kernel
def put_point(cloud: Cloud, p: Any) -> Any:
    """Let the standing solid of a cloud be the ball or the cube around one of its points; the point in the world."""
    table, shape, solids, number = cloud
    first = first_block_of(solid_at(solids.solids, number))
    sizes = sizes_at(solids.sizes, number)

    for part in range(PARTS):
        corners = out_of_cloud(
            shape,
            (
                p[0] + lanes_at(table.corners, part),
                p[1] + lanes_at(table.corners, PARTS + part),
                p[2] + lanes_at(table.corners, 2 * PARTS + part),
            ),
        )
        for axis in range(layout.AXES):
            set_lanes(solids.corners, layout.AXES * (first + part) + axis, corners[axis])

    middle = out_of_cloud(shape, p)
    for axis in range(layout.AXES):
        set_double(sizes, layout.BOUND_CENTRE + axis, middle[axis])
    return middle


@kernel
def compare_point(
    mine: SolidTable, span: Span, others: SolidTable, number: int, frames: Frames, lane: int, way: Any, open_: bool
) -> Any:
    """Compare the solids of a body with the point that is put, in one lane; ``way``: a unit vector to begin with.

    With ``open_`` another point is not proven apart already, and this one can only be proven to touch.

    Returns:
        FREE, UNDECIDED or COLLIDING, and the unit vector across the last plane, from the point to the body.
    """
    answer = FREE
    if open_:
        answer = UNDECIDED
    else:
        for one in range(first_around_of(span), end_around_of(span)):
            if kind_of_solid(solid_at(mine.solids, one)) != layout.CONVEX_SOLID:
                answer = UNDECIDED
                break

            found, way = compare(mine, one, others, number, frames, lane, way)
            answer = max(answer, found)
            if found == COLLIDING:
                break

    if answer != UNDECIDED:
        return answer, way

    for one in range(first_inside_of(span), end_inside_of(span)):
        if kind_of_solid(solid_at(mine.solids, one)) == layout.CONVEX_SOLID:
            found, _ = compare(mine, one, others, number, frames, lane, way)
            if found == COLLIDING:
                return COLLIDING, way

    return UNDECIDED, way


@inlined
def outside(coordinate: Any, half: Any) -> Any:
    """How far a coordinate lies outside a cube around the origin."""
    return max(abs(coordinate) - half, ZERO)


@kernel
def may_overlap(mine: SolidTable, span: Span) -> bool:
    """Whether a body has a solid inside it, so that an overlap can be proven."""
    for one in range(first_inside_of(span), end_inside_of(span)):
        if kind_of_solid(solid_at(mine.solids, one)) == layout.CONVEX_SOLID:
            return True
    return False


@kernel
def plane_below(cloud: Cloud, mine: SolidTable, span: Span, frames: Frames, lane: int, way: Any, size: float) -> Plane:
    """The plane across a unit vector, in the cloud's frame, below which no point touches a body.

    ``size``: largest sum of a point's coordinates there [m], for what rounding may do.
    """
    table, shape, others, number = cloud
    a = first_axis_of(shape)
    b = second_axis_of(shape)
    c = third_axis_of(shape)
    centre = centre_of(shape)
    origin = float(centre[0]), float(centre[1]), float(centre[2])
    least = HIGHEST
    down = scaled(way, -1.0)

    for one in range(first_around_of(span), end_around_of(span)):
        p = farthest(mine, one, frames[0], frames[2], lane, down)
        sizes = sizes_at(mine.sizes, one)
        least = min(least, dot(way, p) - round_of(sizes) - slack_of(sizes))

    ball = sizes_at(others.sizes, number)
    rounding = ROUNDING * (size + abs(origin[0]) + abs(origin[1]) + abs(origin[2]))
    normal = dot(a, way), dot(b, way), dot(c, way)
    cube = table.half * (abs(normal[0]) + abs(normal[1]) + abs(normal[2]))
    height = least - dot(way, origin) - round_of(ball) - slack_of(ball) - cube - rounding
    return np.float32(normal[0]), np.float32(normal[1]), np.float32(normal[2]), np.float32(height)


@kernel
def compare_ball(cloud: Cloud, mine: SolidTable, span: Span, frames: Frames, lane: int, ball: Any, so_far: Any) -> Any:
    """Compare a body with the points that one of its balls (x, y, z, radius) meets, in one lane.

    Where a cloud is a wall, one plane tells nearly all of its points apart from the body: what lies below it is not
    looked at, and the plane of the last comparison takes its place. ``so_far``: the answer to the points before, the
    plane, and the answer at which nothing more is looked at.

    Returns:
        FREE, UNDECIDED or COLLIDING of all points, and the last plane.
    """
    answer, plane, worst = so_far
    table, shape, others, number = cloud
    x, y, z, radius = ball
    reach = radius + cloud_radius_of(shape)
    own = in_cloud(shape, x, y, z)
    low = own[0] - reach, own[1] - reach, own[2] - reach
    high = own[0] + reach, own[1] + reach, own[2] + reach
    size = abs(own[0]) + abs(own[1]) + abs(own[2]) + 3.0 * reach
    half = np.float32(table.half)
    near = widened(low, high, half)
    points = table.blocks
    block = -1

    while True:
        block = next_block(table, low, high, block)
        if block < 0 or answer >= worst:
            return answer, plane

        left = points_in_reach(points, block, near[0], near[1]) & ~points_below(points, block, plane, plane[3])
        while left != 0:
            p = point_at(points, block, first_bit(left))
            left &= left - 1
            away = outside(p[0] - own[0], half), outside(p[1] - own[1], half), outside(p[2] - own[2], half)
            if squared(away[0], away[1], away[2]) >= reach * reach:
                continue

            p = put_point(cloud, p)
            way = minus((float(x), float(y), float(z)), p)
            length = sqrt(dot(way, way))
            way = scaled(way, 1.0 / length) if length > SHORTEST else (1.0, 0.0, 0.0)
            open_ = answer != FREE
            found, way = compare_point(mine, span, others, number, frames, lane, way, open_)
            answer = max(answer, found)
            if answer >= worst:
                break
            if found == FREE:
                plane = plane_below(cloud, mine, span, frames, lane, way, float(size))
                left &= ~points_below(points, block, plane, plane[3])


@inlined
def cloud_of(world: WorldTable, standing: int) -> Cloud:
    """The cloud that a standing body is; see ``Cloud``."""
    primitives = world.outer_primitives
    others = world.standing_solids
    primitive = int_at(primitives.own, standing)
    number = first_around_of(span_at(others.spans, standing))
    table = table_of(primitives, head_at(primitives.heads, primitive))

    return table, shape_at(primitives.shapes, primitive), others, number


@inlined
def frames_for(scratch: ScratchTable, span: Span) -> Frames:
    """The frames of a body and of the world."""
    return frame_at(scratch.frames, frame_of_span(span)), frame_at(scratch.frames, 0), scratch.note


@kernel
def compare_cloud(world: WorldTable, body: int, standing: int, wanted: int) -> Any:
    """Lanes among ``wanted`` in which a body and a cloud are not proven apart, and those in which they overlap."""
    scratch = world.scratch
    balls = world.outer_balls
    mine = world.moving_solids
    cloud = cloud_of(world, standing)
    span = span_at(mine.spans, body)
    frames = frames_for(scratch, span)
    carried = body_at(balls.bodies, body)
    open_ = 0
    overlapping = 0
    worst = COLLIDING if may_overlap(mine, span) else UNDECIDED

    while wanted != 0:
        lane = first_bit(wanted)
        wanted &= wanted - 1
        answer = FREE
        plane = NO_PLANE

        for number in range(first_cluster_of_body(carried), end_cluster_of_body(carried)):
            place_cluster(balls, scratch, number)
            cluster = cluster_at(balls.clusters, number)
            for ball in range(first_ball_of(cluster), end_ball_of(cluster)):
                x, y, z = centre_in_lane(scratch.centres, ball, lane)
                asked = x, y, z, radius_at(balls.balls, ball)
                answer, plane = compare_ball(cloud, mine, span, frames, lane, asked, (answer, plane, worst))
                if answer >= worst:
                    break

            if answer >= worst:
                break

        if answer != FREE:
            open_ |= 1 << lane
        if answer == COLLIDING:
            overlapping |= 1 << lane

    return open_, overlapping
