"""Kernels that bound the distance between the arm and what it must not touch, ``WIDTH`` configurations at a time.

The distance between two sets of solids is at least that between sets that contain them and at most that between sets
inside them, so the tables of :mod:`rrtik_ompl.kernels.checks.sphere_kernels` serve here too. Groups, clusters and
primitives that cannot come nearer than the nearest pair found so far are passed over in all lanes together.
"""

from __future__ import annotations

from typing import Any

from rrtik_ompl.kernels.checks.broad_phase import primitives_in_reach
from rrtik_ompl.kernels.checks.check_kernels import load_row, sound_count
from rrtik_ompl.kernels.checks.kinematics import forward_kinematics
from rrtik_ompl.kernels.checks.obstacle_kernels import UNBOUNDED_DISTANCE, ZERO, primitive_gap
from rrtik_ompl.kernels.checks.sphere_kernels import place_cluster, placed_centre, prepare
from rrtik_ompl.kernels.layout import (
    BallTable,
    JointValues,
    PrimitiveTable,
    ProbeTable,
    ScratchTable,
    WorldTable,
)
from rrtik_ompl.kernels.record import Doubles, Ints
from rrtik_ompl.kernels.simd.compiled import WIDTH, entry, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import (
    bits,
    first_bit,
    float_at,
    highest,
    int_at,
    lanes_at,
    larger,
    lowest,
    set_double,
    set_int,
    set_lanes,
    smaller,
    spread,
    square_root,
)
from rrtik_ompl.kernels.simd.vectors import squared
from rrtik_ompl.kernels.tables.accessors import (
    body_at,
    body_of_cluster,
    cluster_at,
    end_ball_of,
    end_cluster_of_body,
    end_cluster_of_group,
    end_pair_of,
    first_ball_of,
    first_cluster_of_body,
    first_cluster_of_group,
    first_pair_of,
    frame_at,
    frame_of_body,
    frame_of_cluster,
    group_at,
    one_body_of,
    one_group_of,
    other_body_of,
    other_group_of,
    pair_at,
    pair_group_at,
    radius_at,
    standing_body_at,
    stored_centre,
)


@inlined
def could_be_nearer(probe: ProbeTable, gap: Any) -> bool:
    """Whether in any lane a distance is below the smallest one so far."""
    nearer: bool = bits(gap < lanes_at(probe.best, 0)) != 0
    return nearer


@kernel
def note(probe: ProbeTable, gap: Any, pair: int) -> None:
    """Keep the distance of a pair in the lanes in which it is the smallest one so far."""
    best = lanes_at(probe.best, 0)
    nearer = bits(gap < best)
    if nearer != 0:
        set_lanes(probe.best, 0, smaller(gap, best))
    while nearer != 0:
        set_int(probe.which, first_bit(nearer), pair)
        nearer &= nearer - 1


@kernel
def cluster_to_primitive(
    balls: BallTable, primitives: PrimitiveTable, scratch: ScratchTable, probe: ProbeTable, place: int, number: int
) -> None:
    """Measure the balls of a cluster against a primitive."""
    cluster = cluster_at(balls.clusters, place)
    frame = frame_at(scratch.frames, frame_of_cluster(cluster))
    pair = body_of_cluster(cluster) * primitives.standing_count + standing_body_at(primitives.heads, number)
    if int_at(primitives.checked, pair) == 0:
        return

    around = balls.cluster_balls
    x, y, z = placed_centre(frame, around, place)
    if not could_be_nearer(probe, primitive_gap(primitives, number, x, y, z, True) - radius_at(around, place)):
        return

    place_cluster(balls, scratch, place)
    for ball in range(first_ball_of(cluster), end_ball_of(cluster)):
        x, y, z = stored_centre(scratch.centres, ball)
        gap = primitive_gap(primitives, number, x, y, z, False) - radius_at(balls.balls, ball)
        note(probe, gap, pair)


@kernel
def group_to_primitive(
    balls: BallTable, primitives: PrimitiveTable, scratch: ScratchTable, probe: ProbeTable, place: int, number: int
) -> None:
    """Measure the clusters of a group against a primitive."""
    group = group_at(balls.groups, place)
    for cluster in range(first_cluster_of_group(group), end_cluster_of_group(group)):
        cluster_to_primitive(balls, primitives, scratch, probe, cluster, number)


@kernel
def primitives_near_group(
    balls: BallTable, primitives: PrimitiveTable, scratch: ScratchTable, probe: ProbeTable, group: int
) -> Any:
    """List the primitives that could be nearer to a group than the best so far, and their distances from its ball.

    Returns:
        Their number, and the place in the list of the one that is nearest in any lane.
    """
    x, y, z = stored_centre(scratch.group_centres, group)
    radius = radius_at(balls.group_balls, group)
    found = scratch.found
    gaps = probe.gaps
    reach = radius + max(highest(lanes_at(probe.best, 0)), ZERO)
    kept = 0
    first = 0
    nearest = UNBOUNDED_DISTANCE

    for k in range(primitives_in_reach(primitives, x, y, z, reach, found)):
        gap = primitive_gap(primitives, int_at(found, k), x, y, z, True) - radius
        if could_be_nearer(probe, gap):
            set_int(found, kept, int_at(found, k))
            set_lanes(gaps, kept, gap)
            if lowest(gap) < nearest:
                nearest = lowest(gap)
                first = kept

            kept += 1

    return kept, first


@kernel
def measure_scene(balls: BallTable, primitives: PrimitiveTable, scratch: ScratchTable, probe: ProbeTable) -> None:
    """Measure the arm against the primitives; the most promising one of a group first, so that it rules out others."""
    found = scratch.found
    gaps = probe.gaps
    for group in range(balls.group_count):
        kept, first = primitives_near_group(balls, primitives, scratch, probe, group)
        if kept > 0:
            group_to_primitive(balls, primitives, scratch, probe, group, int_at(found, first))
        for k in range(kept):
            if k != first and could_be_nearer(probe, lanes_at(gaps, k)):
                group_to_primitive(balls, primitives, scratch, probe, group, int_at(found, k))


@inlined
def within_best(probe: ProbeTable, x: Any, y: Any, z: Any, centre: Any, reach: float) -> bool:
    """Whether in any lane two balls, whose radii add up to ``reach``, are nearer to each other than the best so far."""
    most = larger(lanes_at(probe.best, 0) + reach, ZERO)
    nearer: bool = bits(squared(x - centre[0], y - centre[1], z - centre[2]) < most * most) != 0
    return nearer


@kernel
def measure_clusters(
    balls: BallTable, scratch: ScratchTable, probe: ProbeTable, first: int, second: int, pair: int
) -> None:
    """Measure the balls of one cluster against those of another."""
    place_cluster(balls, scratch, first)
    place_cluster(balls, scratch, second)
    centres = scratch.centres
    all_balls = balls.balls
    mine = cluster_at(balls.clusters, first)
    others = cluster_at(balls.clusters, second)
    kept = balls.self_margin[0]

    for ball in range(first_ball_of(mine), end_ball_of(mine)):
        x, y, z = stored_centre(centres, ball)
        for other in range(first_ball_of(others), end_ball_of(others)):
            reach = radius_at(all_balls, ball) + radius_at(all_balls, other) + kept
            centre = stored_centre(centres, other)
            if within_best(probe, x, y, z, centre, reach):
                apart = square_root(squared(x - centre[0], y - centre[1], z - centre[2]))
                note(probe, apart - reach, pair)


@kernel
def measure_bodies(
    balls: BallTable, scratch: ScratchTable, probe: ProbeTable, first: int, second: int, pair: int
) -> None:
    """Measure two bodies of the arm against each other, less the margin between them."""
    frames = scratch.frames
    one = body_at(balls.bodies, first)
    two = body_at(balls.bodies, second)
    around = balls.cluster_balls
    hulls = balls.body_balls
    first_frame = frame_at(frames, frame_of_body(one))
    second_frame = frame_at(frames, frame_of_body(two))
    kept = balls.self_margin[0]
    hull = placed_centre(second_frame, hulls, second)
    radius = radius_at(hulls, second) + kept

    for mine in range(first_cluster_of_body(one), end_cluster_of_body(one)):
        x, y, z = placed_centre(first_frame, around, mine)
        extent = radius_at(around, mine)
        if not within_best(probe, x, y, z, hull, extent + radius):
            continue
        for other in range(first_cluster_of_body(two), end_cluster_of_body(two)):
            reach = extent + radius_at(around, other) + kept
            if within_best(probe, x, y, z, placed_centre(second_frame, around, other), reach):
                measure_clusters(balls, scratch, probe, mine, other, pair)


@kernel
def measure_self(balls: BallTable, scratch: ScratchTable, probe: ProbeTable, start: int) -> None:
    """Measure the arm against itself; the pairs are numbered from ``start``."""
    groups = balls.pair_groups
    pairs = balls.pairs
    around = balls.group_balls
    centres = scratch.group_centres
    kept = balls.self_margin[0]

    for k in range(balls.pair_group_count):
        group = pair_group_at(groups, k)
        first = one_group_of(group)
        second = other_group_of(group)
        x, y, z = stored_centre(centres, first)
        reach = radius_at(around, first) + radius_at(around, second) + kept

        if within_best(probe, x, y, z, stored_centre(centres, second), reach):
            for number in range(first_pair_of(group), end_pair_of(group)):
                pair = pair_at(pairs, number)
                measure_bodies(balls, scratch, probe, one_body_of(pair), other_body_of(pair), start + number)


@entry
def measure(
    world: WorldTable,
    balls: BallTable,
    primitives: PrimitiveTable,
    values: JointValues,
    count: int,
    probe: ProbeTable,
    distances: Doubles,
    pairs: Ints,
) -> int:
    """Distances (float64) and numbers of the nearest pairs (int32) for ``count`` rows of joint values (float64).

    Pairs of moving and standing bodies come first, then those of moving bodies; -1 where there is none. Returns
    ``count``, or UNSOUND.
    """
    scratch = world.scratch
    crossing = balls.body_count * primitives.standing_count
    best = probe.best
    which = probe.which

    for start in range(0, count, WIDTH):
        filled = min(WIDTH, count - start)
        for lane in range(WIDTH):
            load_row(world, values, start + min(lane, filled - 1), lane)
            set_int(which, lane, -1)

        set_lanes(best, 0, spread(UNBOUNDED_DISTANCE))
        forward_kinematics(world.arm, scratch)
        prepare(balls, scratch, world.arm.joint_count)
        measure_self(balls, scratch, probe, crossing)
        measure_scene(balls, primitives, scratch, probe)

        for lane in range(filled):
            set_double(distances, start + lane, float_at(best, lane))
            set_int(pairs, start + lane, int_at(which, lane))

    return sound_count(world, count)
