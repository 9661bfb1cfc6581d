"""Kernels of the sphere phase: the lanes in which balls of the arm meet each other.

As against the scene, groups come first, then bodies, their clusters, and single balls.
"""

from __future__ import annotations

from typing import Any

from rrtik_ompl.kernels.checks.sphere_kernels import place_cluster, placed_centre
from rrtik_ompl.kernels.checks.watch_kernels import ZERO, set_clear, slack_at
from rrtik_ompl.kernels.layout import BallTable, Marks, ScratchTable, Watch
from rrtik_ompl.kernels.simd.compiled import inlined, kernel
from rrtik_ompl.kernels.simd.lanes import bits, int_at, set_int
from rrtik_ompl.kernels.simd.records import exists
from rrtik_ompl.kernels.simd.vectors import squared
from rrtik_ompl.kernels.tables.accessors import (
    body_at,
    cluster_at,
    end_ball_of,
    end_cluster_of_body,
    end_pair_of,
    first_ball_of,
    first_cluster_of_body,
    first_pair_of,
    frame_at,
    frame_of_body,
    frame_of_cluster,
    looked_up_of,
    one_body_of,
    one_group_of,
    other_body_of,
    other_group_of,
    pair_at,
    pair_group_at,
    radius_at,
    stored_centre,
)


@inlined
def within(x: Any, y: Any, z: Any, centre: Any, reach: float) -> Any:
    """Lanes in which two points are nearer to each other than ``reach``."""
    return bits(squared(x - centre[0], y - centre[1], z - centre[2]) < reach * reach)


@kernel
def clusters_meet(balls: BallTable, scratch: ScratchTable, first: int, second: int, wanted: int, slack: float) -> Any:
    """Lanes in which a ball of one cluster meets one of another; all here meet that do not keep the margin.

    Also in which they do, or would if they were wider by ``slack``.
    """
    place_cluster(balls, scratch, first)
    place_cluster(balls, scratch, second)
    centres = scratch.centres
    all_balls = balls.balls
    around = balls.cluster_balls
    frames = scratch.frames
    mine = cluster_at(balls.clusters, first)
    others = cluster_at(balls.clusters, second)
    hull = placed_centre(frame_at(frames, frame_of_cluster(others)), around, second)
    meeting = 0
    near = 0
    kept = balls.self_margin[0]

    for ball in range(first_ball_of(mine), end_ball_of(mine)):
        x, y, z = stored_centre(centres, ball)
        radius = radius_at(all_balls, ball) + kept
        if within(x, y, z, hull, radius + radius_at(around, second) + slack) & wanted & ~meeting == 0:
            continue

        for other in range(first_ball_of(others), end_ball_of(others)):
            centre = stored_centre(centres, other)
            reach = radius + radius_at(all_balls, other)
            wide = within(x, y, z, centre, reach + slack) & wanted
            if wide != 0:
                near |= wide
                meeting |= within(x, y, z, centre, reach) & wanted

        if meeting == wanted:
            break

    return meeting, near


@kernel
def bodies_meet(balls: BallTable, scratch: ScratchTable, first: int, second: int, wanted: int, slack: float) -> Any:
    """Lanes in which a ball of one body meets one of another; whether balls around them, by ``slack`` wider, do."""
    frames = scratch.frames
    one = body_at(balls.bodies, first)
    two = body_at(balls.bodies, second)
    around = balls.cluster_balls
    hulls = balls.body_balls
    first_frame = frame_at(frames, frame_of_body(one))
    second_frame = frame_at(frames, frame_of_body(two))
    kept = balls.self_margin[0] + slack
    hull = placed_centre(second_frame, hulls, second)
    radius = radius_at(hulls, second) + kept
    x, y, z = placed_centre(first_frame, hulls, first)
    close = within(x, y, z, hull, radius + radius_at(hulls, first)) & wanted
    meeting = 0
    near_by = False
    if close == 0:
        return meeting, near_by

    for mine in range(first_cluster_of_body(one), end_cluster_of_body(one)):
        x, y, z = placed_centre(first_frame, around, mine)
        extent = radius_at(around, mine)
        near = within(x, y, z, hull, radius + extent) & close & ~meeting
        if near == 0:
            continue

        for other in range(first_cluster_of_body(two), end_cluster_of_body(two)):
            centre = placed_centre(second_frame, around, other)
            both = within(x, y, z, centre, extent + radius_at(around, other) + kept) & near & ~meeting
            if both != 0:
                found, wide = clusters_meet(balls, scratch, mine, other, both, slack)
                meeting |= found
                near_by = near_by or wide != 0

        if meeting == close:
            break

    return meeting, near_by


@kernel
def self_collision(balls: BallTable, scratch: ScratchTable, wanted: int, marks: Marks, one: bool, watch: Watch) -> int:
    """Lanes among ``wanted`` in which two bodies of the arm meet; if ``one`` is enough, not all of them.

    Neighbours that are looked up are left out.
    Unless ``NO_MARKS``, ``marks`` are one number for each pair, which collects the lanes. ``watch``: see
    :mod:`rrtik_ompl.kernels.checks.watch_kernels`.
    """
    groups = balls.pair_groups
    pairs = balls.pairs
    around = balls.group_balls
    centres = scratch.group_centres
    meeting = 0
    kept = balls.self_margin[0]
    watched = balls.group_count

    for number in range(balls.pair_group_count):
        slack = slack_at(watch, watched + number)
        if slack < ZERO:
            continue
        if slack > ZERO:
            set_clear(watch, watched + number, meeting == 0)
        group = pair_group_at(groups, number)
        first = one_group_of(group)
        second = other_group_of(group)
        x, y, z = stored_centre(centres, first)
        reach = radius_at(around, first) + radius_at(around, second) + kept + slack
        close = within(x, y, z, stored_centre(centres, second), reach) & wanted
        if not exists(marks):
            close &= ~meeting
        if close == 0:
            continue

        for k in range(first_pair_of(group), end_pair_of(group)):
            pair = pair_at(pairs, k)
            if looked_up_of(pair) != 0:
                continue
            found, near = bodies_meet(balls, scratch, one_body_of(pair), other_body_of(pair), close, slack)
            meeting |= found
            if near and slack > ZERO:
                set_clear(watch, watched + number, False)
            if exists(marks) and found != 0:
                set_int(marks, k, int_at(marks, k) | found)

        if not exists(marks) and (meeting == wanted or (one and meeting != 0)):
            break

    return meeting
