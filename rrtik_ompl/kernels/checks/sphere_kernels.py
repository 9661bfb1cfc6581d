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
    BY_BALLS,
    LIKELY_COUNT,
    NO_MARKS,
    Ball,
    BallTable,
    Frame,
    LikelyBall,
    Marks,
    PrimitiveList,
    PrimitiveTable,
    ScratchTable,
    Watch,
)
from rrtik_ompl.kernels.simd.compiled import inlined, kernel
from rrtik_ompl.kernels.simd.lanes import int_at, set_int
from rrtik_ompl.kernels.simd.records import exists
from rrtik_ompl.kernels.tables.accessors import (
    ball_x,
    ball_y,
    ball_z,
    body_of_cluster,
    checked_row,
    cluster_at,
    end_ball_of,
    end_cluster_of_group,
    first_ball_of,
    first_cluster_of_group,
    frame_at,
    frame_of_cluster,
    frame_of_group,
    group_at,
    likely_at,
    likely_number_of,
    marks_row,
    origin_at,
    radius_at,
    rotation_row,
    set_likely,
    standing_body_at,
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
def placed_centre(frame: Frame, balls: Ball, number: int) -> Any:
    """Centre of a ball in the world."""
    x = ball_x(balls, number)
    y = ball_y(balls, number)
    z = ball_z(balls, number)
    return carried(frame, 0, x, y, z), carried(frame, 1, x, y, z), carried(frame, 2, x, y, z)


@inlined
def checked_primitives(
    primitives: PrimitiveTable, body: int, source: PrimitiveList, count: int, sink: PrimitiveList
) -> int:
    """Copy a list of primitives without those that balls of a body need not look at; returns how many are left."""
    everything = int_at(primitives.excluding, body) == 0
    checked = checked_row(primitives.checked, primitives.standing_count, body)
    heads = primitives.heads
    kept = 0

    for k in range(count):
        number = int_at(source, k)
        if everything or int_at(checked, standing_body_at(heads, number)) == BY_BALLS:
            set_int(sink, kept, number)
            kept += 1

    return kept


@kernel
def prepare(balls: BallTable, scratch: ScratchTable, joints: int) -> None:
    """Place the centres of the groups that the first joints carry, and forget the balls' centres of the last block."""
    frames = scratch.frames
    groups = balls.groups
    for group in range(balls.group_count):
        carrier = frame_of_group(group_at(groups, group))
        if carrier > joints:
            continue
        frame = frame_at(frames, carrier)
        x, y, z = placed_centre(frame, balls.group_balls, group)
        store_centre(scratch.group_centres, group, x, y, z)

    flags = scratch.placed
    for cluster in range(balls.cluster_count):
        set_int(flags, cluster, 0)


@inlined
def place_cluster(balls: BallTable, scratch: ScratchTable, number: int) -> None:
    """Place the centres of a cluster's balls if they are not yet."""
    if int_at(scratch.placed, number) != 0:
        return

    set_int(scratch.placed, number, 1)
    cluster = cluster_at(balls.clusters, number)
    frame = frame_at(scratch.frames, frame_of_cluster(cluster))
    centres = scratch.centres
    all_balls = balls.balls

    for ball in range(first_ball_of(cluster), end_ball_of(cluster)):
        x, y, z = placed_centre(frame, all_balls, ball)
        store_centre(centres, ball, x, y, z)


@kernel
def remember(likely: LikelyBall, number: int, frame: int, body: int) -> None:
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
    likely: LikelyBall,
    slack: float,
) -> Any:
    """Lanes in which a ball of a cluster meets one of the first ``count`` primitives found; see ``scene_collision``.

    Also whether one of them, wider by ``slack``, does.
    """
    cluster = cluster_at(balls.clusters, number)
    body = body_of_cluster(cluster)
    frame = frame_at(scratch.frames, frame_of_cluster(cluster))
    near = scratch.near
    met = scratch.met
    count = checked_primitives(primitives, body, scratch.found, count, near)
    if count == 0:
        return 0, False

    around = balls.cluster_balls
    x, y, z = placed_centre(frame, around, number)
    radius = radius_at(around, number) + slack
    close, count = meets_primitives(primitives, x, y, z, radius, True, wanted, near, count, near, NO_MARKS)
    if close == 0:
        return 0, False

    place_cluster(balls, scratch, number)
    centres = scratch.centres
    all_balls = balls.balls
    own_marks = marks_row(marks, primitives.standing_count, body) if exists(marks) else NO_MARKS
    meeting = 0
    near_by = False

    for ball in range(first_ball_of(cluster), end_ball_of(cluster)):
        x, y, z = stored_centre(centres, ball)
        still = close if exists(marks) else close & ~meeting
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

        if not exists(marks) and (meeting == close or (one and meeting != 0)):
            break

    return meeting, near_by


@inlined
def cluster_reaches(
    balls: BallTable, primitives: PrimitiveTable, scratch: ScratchTable, number: int, slack: Any
) -> int:
    """List the primitives in reach of a cluster that is wider by ``slack``; returns their number."""
    frame = frame_at(scratch.frames, frame_of_cluster(cluster_at(balls.clusters, number)))
    x, y, z = placed_centre(frame, balls.cluster_balls, number)
    return primitives_in_reach(primitives, x, y, z, radius_at(balls.cluster_balls, number) + slack, scratch.found)


@inlined
def open_lanes(lanes: int, meeting: int, marks: Marks) -> int:
    """Lanes that are still asked for: all of them where each pair is marked, else those that meet nothing yet."""
    return lanes if exists(marks) else lanes & ~meeting


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
    likely: LikelyBall,
    slack: float,
) -> Any:
    """Lanes in which a ball of a group meets one of the first ``count`` primitives found; see ``cluster_meets``."""
    close = wanted
    each = count > FEW
    found = scratch.found

    if not each:
        x, y, z = stored_centre(scratch.group_centres, number)
        radius = radius_at(balls.group_balls, number) + slack
        close, count = meets_primitives(primitives, x, y, z, radius, True, wanted, found, count, found, NO_MARKS)
        if close == 0:
            return 0, False

    group = group_at(balls.groups, number)
    meeting = 0
    near = False

    for cluster in range(first_cluster_of_group(group), end_cluster_of_group(group)):
        left = open_lanes(close, meeting, marks)
        if each:
            count = cluster_reaches(balls, primitives, scratch, cluster, slack)
        lanes, by = cluster_meets(balls, primitives, scratch, cluster, count, left, marks, one, likely, slack)
        meeting |= lanes
        near |= by
        if one and meeting != 0 and not exists(marks):
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
    likely: LikelyBall,
    watch: Watch,
) -> Any:
    """Lanes among ``wanted`` in which the arm meets a primitive; if ``one`` is enough, not all of them.

    The balls that met are noted in ``likely``. Unless ``NO_MARKS``, ``marks`` are one number for each moving and
    standing body, which collects the lanes in which the two meet. ``watch``: see
    :mod:`rrtik_ompl.kernels.checks.watch_kernels`.
    """
    if primitives.count == 0 and not exists(watch):
        return 0

    around = balls.group_balls
    found = scratch.found
    meeting = 0

    for number in range(balls.group_count):
        slack = slack_at(watch, number)
        if slack < ZERO:
            continue
        if slack > ZERO:
            set_clear(watch, number, meeting == 0)
        x, y, z = stored_centre(scratch.group_centres, number)
        radius = radius_at(around, number) + slack
        still = open_lanes(wanted, meeting, marks)
        count = primitives_in_reach(primitives, x, y, z, radius, found)
        if count == 0:
            continue

        lanes, near = group_meets(balls, primitives, scratch, number, count, still, marks, one, likely, slack)
        meeting |= lanes
        if near:
            set_clear(watch, number, False)
        if meeting != 0 and (one or meeting == wanted) and not exists(marks):
            break

    return meeting
