"""Kernels that bound the distance between the arm and what it must not touch, ``WIDTH`` configurations at a time.

The distance between two sets of solids is at least that between sets that contain them and at most that between sets
inside them, so the tables of :mod:`rrtik_ompl.fast.checks.sphere_kernels` serve here too. Groups, neighbourhoods and
primitives that cannot come nearer than the nearest pair found so far are passed over in all lanes together.
"""

from __future__ import annotations

from typing import Any

from rrtik_ompl.fast.checks.check_kernels import forward_kinematics, load_row
from rrtik_ompl.fast.checks.obstacle_kernels import (
    UNBOUNDED_DISTANCE,
    ZERO,
    primitive_gap,
    primitives_in_reach,
    squared,
)
from rrtik_ompl.fast.checks.sphere_kernels import FRAME_BYTES, place_cluster, placed, prepare, stored
from rrtik_ompl.fast.simd.compiled import WIDTH, entry, inlined, kernel
from rrtik_ompl.fast.simd.lanes import (
    bits,
    field,
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
from rrtik_ompl.fast.tables import layout
from rrtik_ompl.fast.tables.layout import ARM, BEST, CENTRES, FOUND, FRAMES, GAPS, GROUP_CENTRES, SCRATCH, WHICH


@inlined
def could_be_nearer(probe: int, gap: Any) -> bool:
    """Whether in any lane a distance is below the smallest one so far."""
    nearer: bool = bits(gap < lanes_at(field(probe, BEST), 0)) != 0
    return nearer


@kernel
def note(probe: int, gap: Any, pair: int) -> None:
    """Keep the distance of a pair in the lanes in which it is the smallest one so far."""
    best = lanes_at(field(probe, BEST), 0)
    nearer = bits(gap < best)
    if nearer != 0:
        set_lanes(field(probe, BEST), 0, smaller(gap, best))
    while nearer != 0:
        set_int(field(probe, WHICH), first_bit(nearer), pair)
        nearer &= nearer - 1


@kernel
def cluster_to_primitive(balls: int, primitives: int, scratch: int, probe: int, cluster: int, number: int) -> None:
    """Measure the balls of a cluster against a primitive."""
    numbers = field(balls, layout.CLUSTERS) + 16 * cluster
    body, frame = int_at(numbers, 0), field(scratch, FRAMES) + FRAME_BYTES * int_at(numbers, 1)
    pair = body * field(primitives, layout.STANDING_COUNT) + int_at(field(primitives, layout.NUMBERS), 4 * number + 1)
    if int_at(field(primitives, layout.CHECKED), pair) == 0:
        return
    around = field(balls, layout.CLUSTER_BALLS)
    x, y, z = placed(frame, around, cluster)
    if not could_be_nearer(probe, primitive_gap(primitives, number, x, y, z, True) - float_at(around, 4 * cluster + 3)):
        return
    place_cluster(balls, scratch, cluster)
    for ball in range(int_at(numbers, 2), int_at(numbers, 3)):
        x, y, z = stored(field(scratch, CENTRES), ball)
        note(
            probe,
            primitive_gap(primitives, number, x, y, z, False) - float_at(field(balls, layout.BALLS), 4 * ball + 3),
            pair,
        )


@kernel
def group_to_primitive(balls: int, primitives: int, scratch: int, probe: int, group: int, number: int) -> None:
    """Measure the clusters of a group against a primitive."""
    groups = field(balls, layout.GROUPS)
    for cluster in range(int_at(groups, 3 * group + 1), int_at(groups, 3 * group + 2)):
        cluster_to_primitive(balls, primitives, scratch, probe, cluster, number)


@kernel
def primitives_near_group(balls: int, primitives: int, scratch: int, probe: int, group: int) -> Any:
    """List the primitives that could be nearer to a group than the best so far, and their distances from its ball.

    Returns:
        Their number, and the place in the list of the one that is nearest in any lane.
    """
    x, y, z = stored(field(scratch, GROUP_CENTRES), group)
    radius = float_at(field(balls, layout.GROUP_BALLS), 4 * group + 3)
    found, gaps = field(scratch, FOUND), field(probe, GAPS)
    reach = radius + max(highest(lanes_at(field(probe, BEST), 0)), ZERO)
    kept, first, nearest = 0, 0, UNBOUNDED_DISTANCE
    for k in range(primitives_in_reach(primitives, x, y, z, reach, found)):
        gap = primitive_gap(primitives, int_at(found, k), x, y, z, True) - radius
        if could_be_nearer(probe, gap):
            set_int(found, kept, int_at(found, k))
            set_lanes(gaps, kept, gap)
            if lowest(gap) < nearest:
                nearest, first = lowest(gap), kept
            kept += 1
    return kept, first


@kernel
def measure_scene(balls: int, primitives: int, scratch: int, probe: int) -> None:
    """Measure the arm against the primitives; the most promising one of a group first, so that it rules out others."""
    found, gaps = field(scratch, FOUND), field(probe, GAPS)
    for group in range(field(balls, layout.GROUP_COUNT)):
        kept, first = primitives_near_group(balls, primitives, scratch, probe, group)
        if kept > 0:
            group_to_primitive(balls, primitives, scratch, probe, group, int_at(found, first))
        for k in range(kept):
            if k != first and could_be_nearer(probe, lanes_at(gaps, k)):
                group_to_primitive(balls, primitives, scratch, probe, group, int_at(found, k))


@inlined
def within_best(probe: int, x: Any, y: Any, z: Any, centre: Any, reach: float) -> bool:
    """Whether in any lane two balls, whose radii add up to ``reach``, are nearer to each other than the best so far."""
    most = larger(lanes_at(field(probe, BEST), 0) + reach, ZERO)
    nearer: bool = bits(squared(x - centre[0], y - centre[1], z - centre[2]) < most * most) != 0
    return nearer


@kernel
def measure_clusters(balls: int, scratch: int, probe: int, first: int, second: int, pair: int) -> None:
    """Measure the balls of one cluster against those of another."""
    place_cluster(balls, scratch, first)
    place_cluster(balls, scratch, second)
    centres, all_balls = field(scratch, CENTRES), field(balls, layout.BALLS)
    mine, others = field(balls, layout.CLUSTERS) + 16 * first, field(balls, layout.CLUSTERS) + 16 * second
    for ball in range(int_at(mine, 2), int_at(mine, 3)):
        x, y, z = stored(centres, ball)
        for other in range(int_at(others, 2), int_at(others, 3)):
            reach = float_at(all_balls, 4 * ball + 3) + float_at(all_balls, 4 * other + 3)
            centre = stored(centres, other)
            if within_best(probe, x, y, z, centre, reach):
                apart = square_root(squared(x - centre[0], y - centre[1], z - centre[2]))
                note(probe, apart - reach, pair)


@kernel
def measure_bodies(balls: int, scratch: int, probe: int, first: int, second: int, pair: int) -> None:
    """Measure two bodies of the arm against each other."""
    frames, bodies = field(scratch, FRAMES), field(balls, layout.BODIES)
    around, hulls = field(balls, layout.CLUSTER_BALLS), field(balls, layout.BODY_BALLS)
    first_frame = frames + FRAME_BYTES * int_at(bodies, 3 * first)
    second_frame = frames + FRAME_BYTES * int_at(bodies, 3 * second)
    hull, radius = placed(second_frame, hulls, second), float_at(hulls, 4 * second + 3)
    for mine in range(int_at(bodies, 3 * first + 1), int_at(bodies, 3 * first + 2)):
        x, y, z = placed(first_frame, around, mine)
        extent = float_at(around, 4 * mine + 3)
        if not within_best(probe, x, y, z, hull, extent + radius):
            continue
        for other in range(int_at(bodies, 3 * second + 1), int_at(bodies, 3 * second + 2)):
            reach = extent + float_at(around, 4 * other + 3)
            if within_best(probe, x, y, z, placed(second_frame, around, other), reach):
                measure_clusters(balls, scratch, probe, mine, other, pair)


@kernel
def measure_self(balls: int, scratch: int, probe: int, start: int) -> None:
    """Measure the arm against itself; the pairs are numbered from ``start``."""
    groups, pairs = field(balls, layout.PAIR_GROUPS), field(balls, layout.PAIRS)
    around, centres = field(balls, layout.GROUP_BALLS), field(scratch, GROUP_CENTRES)
    for k in range(field(balls, layout.PAIR_GROUP_COUNT)):
        first, second = int_at(groups, 4 * k), int_at(groups, 4 * k + 1)
        x, y, z = stored(centres, first)
        reach = float_at(around, 4 * first + 3) + float_at(around, 4 * second + 3)
        if within_best(probe, x, y, z, stored(centres, second), reach):
            for pair in range(int_at(groups, 4 * k + 2), int_at(groups, 4 * k + 3)):
                measure_bodies(
                    balls, scratch, probe, int_at(pairs, 2 * pair), int_at(pairs, 2 * pair + 1), start + pair
                )


@entry
def measure(
    world: int, balls: int, primitives: int, values: int, count: int, probe: int, distances: int, pairs: int
) -> int:
    """Distances (float64) and numbers of the nearest pairs (int32) for ``count`` rows of joint values (float64).

    Pairs of moving and standing bodies come first, then those of moving bodies; -1 where there is none.
    """
    scratch = field(world, SCRATCH)
    crossing = field(balls, layout.BODY_COUNT) * field(primitives, layout.STANDING_COUNT)
    best, which = field(probe, BEST), field(probe, WHICH)
    for start in range(0, count, WIDTH):
        filled = min(WIDTH, count - start)
        for lane in range(WIDTH):
            load_row(world, values, start + min(lane, filled - 1), lane)
            set_int(which, lane, -1)
        set_lanes(best, 0, spread(UNBOUNDED_DISTANCE))
        forward_kinematics(field(world, ARM), scratch)
        prepare(balls, scratch)
        measure_self(balls, scratch, probe, crossing)
        measure_scene(balls, primitives, scratch, probe)
        for lane in range(filled):
            set_double(distances, start + lane, float_at(best, lane))
            set_int(pairs, start + lane, int_at(which, lane))
    return count
