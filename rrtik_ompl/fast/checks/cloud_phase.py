"""The narrow phase of a body and a cloud: its solids against each point that one of its balls has found.

The balls cover the body, so a point that none of them meets is clear of it. The standing solid of a cloud is a ball
around whatever point is at hand: its corners are written here. A set of lanes is an integer, one bit a lane.
"""

from __future__ import annotations

from math import sqrt
from typing import Any, TypeAlias

from rrtik_ompl.fast.checks.gjk import SHORTEST, Frames, compare, dot, minus, scaled
from rrtik_ompl.fast.checks.sphere_kernels import place_cluster
from rrtik_ompl.fast.clouds.accessors import blocks_of, point_at
from rrtik_ompl.fast.clouds.kernels import next_block, points_in_reach
from rrtik_ompl.fast.clouds.primitive_kernels import in_cloud, table_of
from rrtik_ompl.fast.simd.compiled import WIDTH, inlined, kernel
from rrtik_ompl.fast.simd.lanes import first_bit, float_at, int_at, set_double, set_lanes, spread
from rrtik_ompl.fast.simd.vectors import squared
from rrtik_ompl.fast.tables import layout
from rrtik_ompl.fast.tables.accessors import (
    balls_of,
    body_of,
    centre_of,
    centres_of,
    cloud_radius_of,
    cluster_of,
    corners_of,
    end_around_of,
    end_ball_of,
    end_block_of,
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
    frames_of,
    head_of,
    kind_of_solid,
    moving_solids_of,
    note_of,
    outer_balls_of,
    outer_primitives_of,
    own_of,
    radius_at,
    scratch_of,
    second_axis_of,
    shape_of,
    sizes_of,
    solid_of,
    span_of,
    standing_solids_of,
    third_axis_of,
)
from rrtik_ompl.fast.tables.layout import (
    COLLIDING,
    FREE,
    UNDECIDED,
    CentreArray,
    PrimitiveShape,
    ScratchTable,
    SolidTable,
    Span,
    WorldTable,
)

Cloud: TypeAlias = Any  # address of its table, its shape, the table and the number of its standing solid


@inlined
def is_cloud(solids: SolidTable, body: int) -> bool:
    """Whether a body of a table of solids is a cloud."""
    kind: int = kind_of_solid(solid_of(solids, first_around_of(span_of(solids, body))))
    return kind == layout.CLOUD_SOLID


@inlined
def out_of_cloud(shape: PrimitiveShape, p: Any) -> Any:
    """A point of a cloud's frame in the world."""
    a, b, c, centre = first_axis_of(shape), second_axis_of(shape), third_axis_of(shape), centre_of(shape)
    return (
        a[0] * p[0] + b[0] * p[1] + c[0] * p[2] + centre[0],
        a[1] * p[0] + b[1] * p[1] + c[1] * p[2] + centre[1],
        a[2] * p[0] + b[2] * p[1] + c[2] * p[2] + centre[2],
    )


@inlined
def centre_in_lane(centres: CentreArray, ball: int, lane: int) -> Any:
    """The centre of a ball in one lane."""
    place = layout.AXES * WIDTH * ball + lane
    return float_at(centres, place), float_at(centres, place + WIDTH), float_at(centres, place + 2 * WIDTH)


@kernel
def put_point(solids: SolidTable, number: int, p: Any) -> None:
    """Let the standing solid of a cloud be the ball around a point of the world."""
    solid, corners, sizes = solid_of(solids, number), corners_of(solids), sizes_of(solids, number)
    for block in range(first_block_of(solid), end_block_of(solid)):
        for axis in range(layout.AXES):
            set_lanes(corners, layout.AXES * block + axis, spread(p[axis]))
    for axis in range(layout.AXES):
        set_double(sizes, layout.BOUND_CENTRE + axis, p[axis])


@kernel
def compare_point(
    mine: SolidTable, span: Span, others: SolidTable, number: int, frames: Frames, lane: int, way: Any
) -> int:
    """Compare the solids of a body with the point that is put, in one lane; ``way``: a unit vector to begin with."""
    answer = FREE
    for one in range(first_around_of(span), end_around_of(span)):
        if kind_of_solid(solid_of(mine, one)) != layout.CONVEX_SOLID:
            return UNDECIDED
        found, _ = compare(mine, one, others, number, frames, lane, way)
        if found == COLLIDING:
            return COLLIDING
        if found != FREE:
            answer = UNDECIDED
    if answer == FREE or first_around_of(span) == first_inside_of(span):
        return answer
    for one in range(first_inside_of(span), end_inside_of(span)):
        if kind_of_solid(solid_of(mine, one)) == layout.CONVEX_SOLID:
            found, _ = compare(mine, one, others, number, frames, lane, way)
            if found == COLLIDING:
                return COLLIDING
    return answer


@kernel
def compare_ball(
    cloud: Cloud, mine: SolidTable, span: Span, frames: Frames, lane: int, centre: Any, radius: float
) -> int:
    """Compare a body with the points that one of its balls meets, in one lane."""
    table, shape, others, number = cloud
    reach = radius + cloud_radius_of(shape)
    own = in_cloud(shape, centre[0], centre[1], centre[2])
    low = own[0] - reach, own[1] - reach, own[2] - reach
    high = own[0] + reach, own[1] + reach, own[2] + reach
    points, answer, block = blocks_of(table), FREE, -1
    while True:
        block = next_block(table, low, high, block)
        if block < 0:
            return answer
        left = points_in_reach(points, block, low, high)
        while left != 0:
            p = point_at(points, block, first_bit(left))
            left &= left - 1
            if squared(p[0] - own[0], p[1] - own[1], p[2] - own[2]) >= reach * reach:
                continue
            p = out_of_cloud(shape, p)
            put_point(others, number, p)
            way = minus((float(centre[0]), float(centre[1]), float(centre[2])), p)
            length = sqrt(dot(way, way))
            way = scaled(way, 1.0 / length) if length > SHORTEST else (1.0, 0.0, 0.0)
            found = compare_point(mine, span, others, number, frames, lane, way)
            if found == COLLIDING:
                return COLLIDING
            answer = max(answer, found)


@inlined
def cloud_of(world: WorldTable, standing: int) -> Cloud:
    """The cloud that a standing body is; see ``Cloud``."""
    primitives, others = outer_primitives_of(world), standing_solids_of(world)
    primitive = int_at(own_of(primitives), standing)
    number = first_around_of(span_of(others, standing))
    return table_of(primitives, head_of(primitives, primitive)), shape_of(primitives, primitive), others, number


@inlined
def frames_for(scratch: ScratchTable, span: Span) -> Frames:
    """The frames of a body and of the world."""
    return frame_at(frames_of(scratch), frame_of_span(span)), frame_at(frames_of(scratch), 0), note_of(scratch)


@kernel
def compare_cloud(world: WorldTable, body: int, standing: int, wanted: int) -> Any:
    """Lanes among ``wanted`` in which a body and a cloud are not proven apart, and those in which they overlap."""
    scratch, balls, mine = scratch_of(world), outer_balls_of(world), moving_solids_of(world)
    cloud, span = cloud_of(world, standing), span_of(mine, body)
    frames, carried = frames_for(scratch, span), body_of(balls, body)
    open_, overlapping = 0, 0
    while wanted != 0:
        lane = first_bit(wanted)
        wanted &= wanted - 1
        answer = FREE
        for number in range(first_cluster_of_body(carried), end_cluster_of_body(carried)):
            place_cluster(balls, scratch, number)
            cluster = cluster_of(balls, number)
            for ball in range(first_ball_of(cluster), end_ball_of(cluster)):
                centre = centre_in_lane(centres_of(scratch), ball, lane)
                radius = radius_at(balls_of(balls), ball)
                answer = max(answer, compare_ball(cloud, mine, span, frames, lane, centre, radius))
                if answer == COLLIDING:
                    break
            if answer == COLLIDING:
                break
        if answer != FREE:
            open_ |= 1 << lane
        if answer == COLLIDING:
            overlapping |= 1 << lane
    return open_, overlapping
