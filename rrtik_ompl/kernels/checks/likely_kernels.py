"""A quick look at the balls of the arm that met something lately: most motions that are not free are found out here.

Few balls are enough, as a motion that meets something mostly does so with many of them. The list orders itself: a ball
that meets something moves up by one place [62]; one that was found in the full check replaces the last one.
"""

from __future__ import annotations

from rrtik_ompl.kernels.checks.broad_phase import primitives_in_reach
from rrtik_ompl.kernels.checks.obstacle_kernels import meets_primitives
from rrtik_ompl.kernels.checks.sphere_kernels import checked_primitives, placed_centre
from rrtik_ompl.kernels.layout import LIKELY_COUNT, NO_MARKS, BallTable, LikelyBall, PrimitiveTable, ScratchTable
from rrtik_ompl.kernels.simd.compiled import inlined, kernel
from rrtik_ompl.kernels.tables.accessors import (
    frame_at,
    likely_at,
    likely_body_of,
    likely_frame_of,
    likely_number_of,
    radius_at,
    set_likely,
)


@inlined
def move_up(likely: LikelyBall, place: int) -> None:
    """Let a ball of the list and the one before it change places."""
    this = likely_at(likely, place)
    before = likely_at(likely, place - 1)
    number = likely_number_of(this)
    frame = likely_frame_of(this)
    body = likely_body_of(this)
    set_likely(this, likely_number_of(before), likely_frame_of(before), likely_body_of(before))
    set_likely(before, number, frame, body)


@kernel
def likely_collision(
    balls: BallTable, primitives: PrimitiveTable, scratch: ScratchTable, wanted: int, likely: LikelyBall
) -> int:
    """Lanes among ``wanted`` in which the first likely ball that meets a primitive does so; 0 says nothing."""
    all_balls = balls.balls
    found = scratch.found
    near = scratch.near

    for place in range(LIKELY_COUNT):
        ball = likely_at(likely, place)
        number = likely_number_of(ball)
        body = likely_body_of(ball)
        if number < 0:
            continue

        x, y, z = placed_centre(frame_at(scratch.frames, likely_frame_of(ball)), all_balls, number)
        radius = radius_at(all_balls, number)
        count = primitives_in_reach(primitives, x, y, z, radius, found)
        count = checked_primitives(primitives, body, found, count, near)
        if count == 0:
            continue

        meeting, _ = meets_primitives(primitives, x, y, z, radius, False, wanted, near, count, scratch.met, NO_MARKS)
        if meeting != 0:
            if place > 0:
                move_up(likely, place)
            return int(meeting)

    return 0
