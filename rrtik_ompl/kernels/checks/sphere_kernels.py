"""Kernels of the broad and the sphere phase: the lanes in which balls of the arm meet the scene.

Balls are tested in three levels: all that a joint carries, clusters of a body, single balls. A level is left as soon as
no lane that is still open can touch. A set of lanes is an integer, one bit a lane. Primitives and balls: see
:mod:`rrtik_ompl.kernels.layout`.
"""

from __future__ import annotations

from typing import Any

from rrtik_ompl.kernels.checks.broad_phase import primitives_in_reach
from rrtik_ompl.kernels.checks.obstacle_kernels import meets_primitives
from rrtik_ompl.kernels.checks.watch_kernels import ZERO, set_clear, slack_at
from rrtik_ompl.kernels.layout import (
    LIKELY_COUNT,
    NO_MARKS,
    NO_WATCH,
    BallArray,
    BallTable,
    Frame,
    LikelyBalls,
    Marks,
    PrimitiveList,
    PrimitiveTable,
    ScratchTable,
    Watch,
)
from rrtik_ompl.kernels.simd.compiled import inlined, kernel
from rrtik_ompl.kernels.simd.lanes import int_at, set_int
from rrtik_ompl.kernels.tables.accessors import (
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
    likely_at,
    likely_number_of,
    marks_row,
    met_of,
    near_of,
    origin_at,
    placed_flags_of,
    primitive_count_of,
    radius_at,
    rotation_row,
    set_likely,
    standing_body_at,
    standing_count_of,
    store_centre,
    stored_centre,
)

FEW = 16  # primitives in reach of a group, up to which all of its clusters choose among these


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
def prepare(balls: BallTable, scratch: ScratchTable, joints: int) -> None:
    """Place the centres of the groups that the first joints carry, and forget the balls' centres of the last block."""
    frames, groups = frames_of(scratch), groups_of(balls)
    for group in range(group_count_of(balls)):
        carrier = frame_of_group(group_at(groups, group))
        if carrier > joints:
            continue
        frame = frame_at(frames, carrier)
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
def remember(likely: LikelyBalls, number: int, frame: int, body: int) -> None:
    """Note a ball that met something, in the last place, unless it is in the list."""
    for k in range(LIKELY_COUNT):
        if likely_number_of(likely_at(likely, k)) == number:
            return
    set_likely(likely_at(likely, LIKELY_COUNT - 1), number, frame, body)


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
    likely: LikelyBalls,
    slack: float,
) -> Any:
    """Lanes in which a ball of a cluster meets one of the first ``count`` primitives found; see ``scene_collision``.

    Also whether one of them, wider by ``slack``, does.
    """
    cluster = cluster_of(balls, number)
    body, frame = body_of_cluster(cluster), frame_at(frames_of(scratch), frame_of_cluster(cluster))
    near, met = near_of(scratch), met_of(scratch)
    count = checked_primitives(primitives, body, found_of(scratch), count, near)
    if count == 0:
        return 0, False
    around = cluster_balls_of(balls)
    x, y, z = placed_centre(frame, around, number)
    radius = radius_at(around, number) + slack
    close, count = meets_primitives(primitives, x, y, z, radius, True, wanted, near, count, near, NO_MARKS)
    if close == 0:
        return 0, False
    place_cluster(balls, scratch, number)
    centres, all_balls = centres_of(scratch), balls_of(balls)
    own_marks = NO_MARKS if marks == NO_MARKS else marks_row(marks, standing_count_of(primitives), body)
    meeting, near_by = 0, False
    for ball in range(first_ball_of(cluster), end_ball_of(cluster)):
        x, y, z = stored_centre(centres, ball)
        still = close if marks != NO_MARKS else close & ~meeting
        radius = radius_at(all_balls, ball)
        if slack > ZERO:
            found, _ = meets_primitives(primitives, x, y, z, radius + slack, True, still, near, count, met, NO_MARKS)
            if found == 0:
                continue
            near_by = True
        found, _ = meets_primitives(primitives, x, y, z, radius, False, still, near, count, met, own_marks)
        if found != 0:
            meeting |= found
            remember(likely, ball, frame_of_cluster(cluster), body)
        if marks == NO_MARKS and (meeting == close or (one and meeting != 0)):
            break
    return meeting, near_by


@inlined
def cluster_reaches(
    balls: BallTable, primitives: PrimitiveTable, scratch: ScratchTable, number: int, slack: Any
) -> int:
    """List the primitives in reach of a cluster that is wider by ``slack``; returns their number."""
    frame = frame_at(frames_of(scratch), frame_of_cluster(cluster_of(balls, number)))
    x, y, z = placed_centre(frame, cluster_balls_of(balls), number)
    return primitives_in_reach(
        primitives, x, y, z, radius_at(cluster_balls_of(balls), number) + slack, found_of(scratch)
    )


@inlined
def open_lanes(lanes: int, meeting: int, marks: Marks) -> int:
    """Lanes that are still asked for: all of them where each pair is marked, else those that meet nothing yet."""
    return lanes if marks != NO_MARKS else lanes & ~meeting


@kernel
def group_meets(
    balls: BallTable,
    primitives: PrimitiveTable,
    scratch: ScratchTable,
    number: int,
    count: int,
    wanted: int,
    marks: Marks,
    one: bool,
    likely: LikelyBalls,
    slack: float,
) -> Any:
    """Lanes in which a ball of a group meets one of the first ``count`` primitives found; see ``cluster_meets``."""
    close, each, found = wanted, count > FEW, found_of(scratch)
    if not each:
        x, y, z = stored_centre(group_centres_of(scratch), number)
        radius = radius_at(group_balls_of(balls), number) + slack
        close, count = meets_primitives(primitives, x, y, z, radius, True, wanted, found, count, found, NO_MARKS)
        if close == 0:
            return 0, False
    group, meeting, near = group_at(groups_of(balls), number), 0, False
    for cluster in range(first_cluster_of_group(group), end_cluster_of_group(group)):
        left = open_lanes(close, meeting, marks)
        if each:
            count = cluster_reaches(balls, primitives, scratch, cluster, slack)
        lanes, by = cluster_meets(balls, primitives, scratch, cluster, count, left, marks, one, likely, slack)
        meeting |= lanes
        near |= by
        if one and meeting != 0 and marks == NO_MARKS:
            break
    return meeting, near


@kernel
def scene_collision(
    balls: BallTable,
    primitives: PrimitiveTable,
    scratch: ScratchTable,
    wanted: int,
    marks: Marks,
    one: bool,
    likely: LikelyBalls,
    watch: Watch,
) -> Any:
    """Lanes among ``wanted`` in which the arm meets a primitive; if ``one`` is enough, not all of them.

    The balls that met are noted in ``likely``. Unless ``NO_MARKS``, ``marks`` are one number for each moving and
    standing body, which collects the lanes in which the two meet. ``watch``: see
    :mod:`rrtik_ompl.kernels.checks.watch_kernels`.
    """
    if primitive_count_of(primitives) == 0 and watch == NO_WATCH:
        return 0
    around, found = group_balls_of(balls), found_of(scratch)
    meeting = 0
    for number in range(group_count_of(balls)):
        slack = slack_at(watch, number)
        if slack < ZERO:
            continue
        if slack > ZERO:
            set_clear(watch, number, meeting == 0)
        x, y, z = stored_centre(group_centres_of(scratch), number)
        radius = radius_at(around, number) + slack
        still = open_lanes(wanted, meeting, marks)
        count = primitives_in_reach(primitives, x, y, z, radius, found)
        if count == 0:
            continue
        lanes, near = group_meets(balls, primitives, scratch, number, count, still, marks, one, likely, slack)
        meeting |= lanes
        if near:
            set_clear(watch, number, False)
        if meeting != 0 and (one or meeting == wanted) and marks == NO_MARKS:
            break
    return meeting
