"""Kernels of the broad and the sphere phase: the lanes in which balls of the arm meet the scene.

Balls are tested in three levels: all that a joint carries, clusters of a body, single balls. A level is left as soon as
no lane that is still open can touch. A set of lanes is an integer, one bit a lane. Primitives and balls: see
:mod:`rrtik_ompl.fast.tables.layout`.
"""

from __future__ import annotations

from typing import Any

from rrtik_ompl.fast.checks.obstacle_kernels import meets_primitives, primitives_in_reach
from rrtik_ompl.fast.simd.compiled import inlined, kernel
from rrtik_ompl.fast.simd.lanes import int_at, set_int
from rrtik_ompl.fast.tables.accessors import (
    ball_x,
    ball_y,
    ball_z,
    balls_of,
    body_of_cluster,
    centres_of,
    checked_of,
    checked_row,
    cluster_balls_of,
    cluster_count_of,
    cluster_of,
    end_ball_of,
    end_cluster_of_group,
    excluding_of,
    first_ball_of,
    first_cluster_of_group,
    found_of,
    frame_at,
    frame_of_cluster,
    frame_of_group,
    frames_of,
    group_at,
    group_balls_of,
    group_centres_of,
    group_count_of,
    groups_of,
    heads_of,
    last_ball_of,
    last_frame_of,
    last_primitive_list,
    last_primitive_of,
    marks_row,
    met_of,
    near_of,
    origin_at,
    placed_flags_of,
    primitive_count_of,
    radius_at,
    remember_hit,
    rotation_row,
    standing_body_at,
    standing_count_of,
    store_centre,
    stored_centre,
)
from rrtik_ompl.fast.tables.layout import (
    NO_MARKS,
    BallArray,
    BallTable,
    Frame,
    LastHit,
    Marks,
    PrimitiveList,
    PrimitiveTable,
    ScratchTable,
)


@inlined
def carried(frame: Frame, row: int, x: float, y: float, z: float) -> Any:
    """A coordinate in the world of a point of a frame."""
    a, b, c = rotation_row(frame, row)
    return a * x + b * y + c * z + origin_at(frame, row)


@inlined
def placed_centre(frame: Frame, balls: BallArray, number: int) -> Any:
    """Centre of a ball in the world."""
    x, y, z = ball_x(balls, number), ball_y(balls, number), ball_z(balls, number)
    return carried(frame, 0, x, y, z), carried(frame, 1, x, y, z), carried(frame, 2, x, y, z)


@inlined
def checked_primitives(
    primitives: PrimitiveTable, body: int, source: PrimitiveList, count: int, sink: PrimitiveList
) -> int:
    """Copy a list of primitives without those that a body need not keep clear of; returns how many are left."""
    everything = int_at(excluding_of(primitives), body) == 0
    checked = checked_row(checked_of(primitives), standing_count_of(primitives), body)
    heads, kept = heads_of(primitives), 0
    for k in range(count):
        number = int_at(source, k)
        if everything or int_at(checked, standing_body_at(heads, number)) != 0:
            set_int(sink, kept, number)
            kept += 1
    return kept


@kernel
def prepare(balls: BallTable, scratch: ScratchTable) -> None:
    """Place the groups' centres and forget the balls' centres of the last block."""
    frames, groups = frames_of(scratch), groups_of(balls)
    for group in range(group_count_of(balls)):
        frame = frame_at(frames, frame_of_group(group_at(groups, group)))
        x, y, z = placed_centre(frame, group_balls_of(balls), group)
        store_centre(group_centres_of(scratch), group, x, y, z)
    flags = placed_flags_of(scratch)
    for cluster in range(cluster_count_of(balls)):
        set_int(flags, cluster, 0)


@inlined
def place_cluster(balls: BallTable, scratch: ScratchTable, number: int) -> None:
    """Place the centres of a cluster's balls if they are not yet."""
    if int_at(placed_flags_of(scratch), number) != 0:
        return
    set_int(placed_flags_of(scratch), number, 1)
    cluster = cluster_of(balls, number)
    frame = frame_at(frames_of(scratch), frame_of_cluster(cluster))
    centres, all_balls = centres_of(scratch), balls_of(balls)
    for ball in range(first_ball_of(cluster), end_ball_of(cluster)):
        x, y, z = placed_centre(frame, all_balls, ball)
        store_centre(centres, ball, x, y, z)


@kernel
def cluster_meets(
    balls: BallTable,
    primitives: PrimitiveTable,
    scratch: ScratchTable,
    number: int,
    count: int,
    wanted: int,
    marks: Marks,
    one: bool,
    last: LastHit,
) -> int:
    """Lanes in which a ball of a cluster meets one of the first ``count`` primitives found; see ``scene_collision``."""
    cluster = cluster_of(balls, number)
    body, frame = body_of_cluster(cluster), frame_at(frames_of(scratch), frame_of_cluster(cluster))
    near, met = near_of(scratch), met_of(scratch)
    count = checked_primitives(primitives, body, found_of(scratch), count, near)
    if count == 0:
        return 0
    around = cluster_balls_of(balls)
    x, y, z = placed_centre(frame, around, number)
    radius = radius_at(around, number)
    close, count = meets_primitives(primitives, x, y, z, radius, True, wanted, near, count, near, NO_MARKS)
    if close == 0:
        return 0
    place_cluster(balls, scratch, number)
    centres, all_balls = centres_of(scratch), balls_of(balls)
    own_marks = NO_MARKS if marks == NO_MARKS else marks_row(marks, standing_count_of(primitives), body)
    meeting = 0
    for ball in range(first_ball_of(cluster), end_ball_of(cluster)):
        x, y, z = stored_centre(centres, ball)
        still = close if marks != NO_MARKS else close & ~meeting
        radius = radius_at(all_balls, ball)
        found, _ = meets_primitives(primitives, x, y, z, radius, False, still, near, count, met, own_marks)
        if found != 0:
            meeting |= found
            remember_hit(last, ball, frame_of_cluster(cluster), int_at(met, 0))
        if marks == NO_MARKS and (meeting == close or (one and meeting != 0)):
            break
    return meeting


@kernel
def scene_collision(
    balls: BallTable,
    primitives: PrimitiveTable,
    scratch: ScratchTable,
    wanted: int,
    marks: Marks,
    one: bool,
    last: LastHit,
) -> int:
    """Lanes among ``wanted`` in which the arm meets a primitive; if ``one`` is enough, not all of them.

    What met is written to ``last``. Unless ``NO_MARKS``, ``marks`` are one number for each moving and standing body,
    which collects the lanes in which the two meet.
    """
    if primitive_count_of(primitives) == 0:
        return 0
    groups, around, found = groups_of(balls), group_balls_of(balls), found_of(scratch)
    meeting = 0
    for number in range(group_count_of(balls)):
        x, y, z = stored_centre(group_centres_of(scratch), number)
        radius = radius_at(around, number)
        still = wanted if marks != NO_MARKS else wanted & ~meeting
        count = primitives_in_reach(primitives, x, y, z, radius, found)
        if count == 0:
            continue
        close, count = meets_primitives(primitives, x, y, z, radius, True, still, found, count, found, NO_MARKS)
        if close == 0:
            continue
        group = group_at(groups, number)
        for cluster in range(first_cluster_of_group(group), end_cluster_of_group(group)):
            left = close if marks != NO_MARKS else close & ~meeting
            meeting |= cluster_meets(balls, primitives, scratch, cluster, count, left, marks, one, last)
            if one and meeting != 0 and marks == NO_MARKS:
                return meeting
        if meeting == wanted and marks == NO_MARKS:
            break
    return meeting


@kernel
def recheck_last_hit(
    balls: BallTable, primitives: PrimitiveTable, scratch: ScratchTable, wanted: int, last: LastHit
) -> int:
    """Lanes among ``wanted`` in which the ball and the primitive meet that met last: often the quickest answer."""
    if last_primitive_of(last) < 0:
        return 0
    ball, all_balls = last_ball_of(last), balls_of(balls)
    x, y, z = placed_centre(frame_at(frames_of(scratch), last_frame_of(last)), all_balls, ball)
    radius, source = radius_at(all_balls, ball), last_primitive_list(last)
    found, _ = meets_primitives(primitives, x, y, z, radius, False, wanted, source, 1, met_of(scratch), NO_MARKS)
    return int(found)
