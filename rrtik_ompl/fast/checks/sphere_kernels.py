"""Kernels that find the lanes in which balls of the arm meet the surroundings or each other.

Balls are tested in three levels: all that a joint carries, neighbourhoods of a body, single balls. A level is left as
soon as no lane that is still open can touch. Lanes are bits of an integer. Rows and balls: see the tables' modules.
"""

from __future__ import annotations

from typing import Any

from rrtik_ompl.fast.checks.obstacle_kernels import meets_primitives, primitives_in_reach, squared
from rrtik_ompl.fast.simd.compiled import WIDTH, inlined, kernel
from rrtik_ompl.fast.simd.lanes import bits, field, float_at, int_at, lanes_at, set_int, set_lanes
from rrtik_ompl.fast.tables import layout
from rrtik_ompl.fast.tables.layout import CENTRES, FOUND, FRAMES, GROUP_CENTRES, MET, NEAR, PLACED

FRAME_BYTES = 12 * 4 * WIDTH


@inlined
def placed(frame: int, balls: int, number: int) -> Any:
    """Centre of a ball in the world; ``frame`` is the address of its frame."""
    x, y, z = float_at(balls, 4 * number), float_at(balls, 4 * number + 1), float_at(balls, 4 * number + 2)
    return (
        lanes_at(frame, 0) * x + lanes_at(frame, 1) * y + lanes_at(frame, 2) * z + lanes_at(frame, 9),
        lanes_at(frame, 3) * x + lanes_at(frame, 4) * y + lanes_at(frame, 5) * z + lanes_at(frame, 10),
        lanes_at(frame, 6) * x + lanes_at(frame, 7) * y + lanes_at(frame, 8) * z + lanes_at(frame, 11),
    )


@inlined
def stored(centres: int, number: int) -> Any:
    """Centre number ``number`` of a run of centres."""
    return lanes_at(centres, 3 * number), lanes_at(centres, 3 * number + 1), lanes_at(centres, 3 * number + 2)


@inlined
def store(centres: int, number: int, x: Any, y: Any, z: Any) -> None:
    """Set a centre of a run of centres."""
    set_lanes(centres, 3 * number, x)
    set_lanes(centres, 3 * number + 1, y)
    set_lanes(centres, 3 * number + 2, z)


@inlined
def checked_primitives(primitives: int, body: int, source: int, count: int, sink: int) -> int:
    """Copy a list of primitives without those that a body need not keep clear of; returns how many are left."""
    everything = int_at(field(primitives, layout.EXCLUDING), body) == 0
    checked = field(primitives, layout.CHECKED) + 4 * body * field(primitives, layout.STANDING_COUNT)
    numbers = field(primitives, layout.NUMBERS)
    kept = 0
    for k in range(count):
        number = int_at(source, k)
        if everything or int_at(checked, int_at(numbers, 4 * number + 1)) != 0:
            set_int(sink, kept, number)
            kept += 1
    return kept


@kernel
def prepare(balls: int, scratch: int) -> None:
    """Place the groups' centres and forget the balls' centres of the last block."""
    frames, groups = field(scratch, FRAMES), field(balls, layout.GROUPS)
    for group in range(field(balls, layout.GROUP_COUNT)):
        frame = frames + FRAME_BYTES * int_at(groups, 3 * group)
        x, y, z = placed(frame, field(balls, layout.GROUP_BALLS), group)
        store(field(scratch, GROUP_CENTRES), group, x, y, z)
    flags = field(scratch, PLACED)
    for cluster in range(field(balls, layout.CLUSTER_COUNT)):
        set_int(flags, cluster, 0)


@inlined
def place_cluster(balls: int, scratch: int, cluster: int) -> None:
    """Place the centres of a cluster's balls if they are not yet."""
    if int_at(field(scratch, PLACED), cluster) != 0:
        return
    set_int(field(scratch, PLACED), cluster, 1)
    numbers = field(balls, layout.CLUSTERS) + 16 * cluster
    frame = field(scratch, FRAMES) + FRAME_BYTES * int_at(numbers, 1)
    centres, all_balls = field(scratch, CENTRES), field(balls, layout.BALLS)
    for ball in range(int_at(numbers, 2), int_at(numbers, 3)):
        x, y, z = placed(frame, all_balls, ball)
        store(centres, ball, x, y, z)


@kernel
def cluster_meets(
    balls: int, primitives: int, scratch: int, cluster: int, count: int, wanted: int, marks: int, one: bool, last: int
) -> int:
    """Lanes in which a ball of a cluster meets one of the first ``count`` primitives found; see ``scene_collision``."""
    numbers = field(balls, layout.CLUSTERS) + 16 * cluster
    body, frame = int_at(numbers, 0), field(scratch, FRAMES) + FRAME_BYTES * int_at(numbers, 1)
    near, met = field(scratch, NEAR), field(scratch, MET)
    count = checked_primitives(primitives, body, field(scratch, FOUND), count, near)
    if count == 0:
        return 0
    around = field(balls, layout.CLUSTER_BALLS)
    x, y, z = placed(frame, around, cluster)
    close, count = meets_primitives(
        primitives, x, y, z, float_at(around, 4 * cluster + 3), True, wanted, near, count, near, 0
    )
    if close == 0:
        return 0
    place_cluster(balls, scratch, cluster)
    centres, all_balls = field(scratch, CENTRES), field(balls, layout.BALLS)
    flags = 0 if marks == 0 else marks + 4 * body * field(primitives, layout.STANDING_COUNT)
    meeting = 0
    for ball in range(int_at(numbers, 2), int_at(numbers, 3)):
        x, y, z = stored(centres, ball)
        still = close if marks != 0 else close & ~meeting
        radius = float_at(all_balls, 4 * ball + 3)
        found, _ = meets_primitives(primitives, x, y, z, radius, False, still, near, count, met, flags)
        if found != 0:
            meeting |= found
            set_int(last, 0, ball)
            set_int(last, 1, int_at(numbers, 1))
            set_int(last, 2, int_at(met, 0))
        if marks == 0 and (meeting == close or (one and meeting != 0)):
            break
    return meeting


@kernel
def scene_collision(balls: int, primitives: int, scratch: int, wanted: int, marks: int, one: bool, last: int) -> int:
    """Lanes among ``wanted`` in which the arm meets a row; if ``one`` is enough, not all of them.

    What met is written to ``last``. Unless 0, ``marks`` is the address of one number for each moving and standing
    body, which collects the lanes in which the two meet.
    """
    if field(primitives, layout.PRIMITIVE_COUNT) == 0:
        return 0
    groups, around = field(balls, layout.GROUPS), field(balls, layout.GROUP_BALLS)
    found = field(scratch, FOUND)
    meeting = 0
    for group in range(field(balls, layout.GROUP_COUNT)):
        x, y, z = stored(field(scratch, GROUP_CENTRES), group)
        radius = float_at(around, 4 * group + 3)
        still = wanted if marks != 0 else wanted & ~meeting
        count = primitives_in_reach(primitives, x, y, z, radius, found)
        if count == 0:
            continue
        close, count = meets_primitives(primitives, x, y, z, radius, True, still, found, count, found, 0)
        if close == 0:
            continue
        for cluster in range(int_at(groups, 3 * group + 1), int_at(groups, 3 * group + 2)):
            left = close if marks != 0 else close & ~meeting
            meeting |= cluster_meets(balls, primitives, scratch, cluster, count, left, marks, one, last)
            if one and meeting != 0 and marks == 0:
                return meeting
        if meeting == wanted and marks == 0:
            break
    return meeting


@kernel
def recheck_last_hit(balls: int, primitives: int, scratch: int, wanted: int, last: int) -> int:
    """Lanes among ``wanted`` in which the ball and the row meet that met last: often the quickest way to an answer."""
    if int_at(last, 2) < 0:
        return 0
    ball, all_balls = int_at(last, 0), field(balls, layout.BALLS)
    x, y, z = placed(field(scratch, FRAMES) + FRAME_BYTES * int_at(last, 1), all_balls, ball)
    radius = float_at(all_balls, 4 * ball + 3)
    found, _ = meets_primitives(primitives, x, y, z, radius, False, wanted, last + 8, 1, field(scratch, MET), 0)
    return int(found)


@inlined
def within(x: Any, y: Any, z: Any, centre: Any, reach: float) -> Any:
    """Lanes in which two points are nearer to each other than ``reach``."""
    return bits(squared(x - centre[0], y - centre[1], z - centre[2]) < reach * reach)


@kernel
def clusters_meet(balls: int, scratch: int, first: int, second: int, wanted: int) -> int:
    """Lanes in which a ball of one cluster meets a ball of another."""
    place_cluster(balls, scratch, first)
    place_cluster(balls, scratch, second)
    centres, all_balls = field(scratch, CENTRES), field(balls, layout.BALLS)
    around, frames = field(balls, layout.CLUSTER_BALLS), field(scratch, FRAMES)
    mine, others = field(balls, layout.CLUSTERS) + 16 * first, field(balls, layout.CLUSTERS) + 16 * second
    hull = placed(frames + FRAME_BYTES * int_at(others, 1), around, second)
    meeting = 0
    for ball in range(int_at(mine, 2), int_at(mine, 3)):
        x, y, z = stored(centres, ball)
        radius = float_at(all_balls, 4 * ball + 3)
        if within(x, y, z, hull, radius + float_at(around, 4 * second + 3)) & wanted & ~meeting == 0:
            continue
        for other in range(int_at(others, 2), int_at(others, 3)):
            meeting |= within(x, y, z, stored(centres, other), radius + float_at(all_balls, 4 * other + 3)) & wanted
        if meeting == wanted:
            break
    return meeting


@kernel
def bodies_meet(balls: int, scratch: int, first: int, second: int, wanted: int) -> int:
    """Lanes in which a ball of one body meets a ball of another."""
    frames, bodies = field(scratch, FRAMES), field(balls, layout.BODIES)
    around, hulls = field(balls, layout.CLUSTER_BALLS), field(balls, layout.BODY_BALLS)
    first_frame = frames + FRAME_BYTES * int_at(bodies, 3 * first)
    second_frame = frames + FRAME_BYTES * int_at(bodies, 3 * second)
    hull, radius = placed(second_frame, hulls, second), float_at(hulls, 4 * second + 3)
    x, y, z = placed(first_frame, hulls, first)
    close = within(x, y, z, hull, radius + float_at(hulls, 4 * first + 3)) & wanted
    meeting = 0
    if close == 0:
        return meeting
    for mine in range(int_at(bodies, 3 * first + 1), int_at(bodies, 3 * first + 2)):
        x, y, z = placed(first_frame, around, mine)
        extent = float_at(around, 4 * mine + 3)
        near = within(x, y, z, hull, radius + extent) & close & ~meeting
        if near == 0:
            continue
        for other in range(int_at(bodies, 3 * second + 1), int_at(bodies, 3 * second + 2)):
            centre = placed(second_frame, around, other)
            both = within(x, y, z, centre, extent + float_at(around, 4 * other + 3)) & near & ~meeting
            if both != 0:
                meeting |= clusters_meet(balls, scratch, mine, other, both)
        if meeting == close:
            break
    return meeting


@kernel
def self_collision(balls: int, scratch: int, wanted: int, marks: int, one: bool) -> int:
    """Lanes among ``wanted`` in which two bodies of the arm meet; if ``one`` is enough, not all of them.

    Unless 0, ``marks`` is the address of one number for each pair, which collects the lanes.
    """
    groups, pairs = field(balls, layout.PAIR_GROUPS), field(balls, layout.PAIRS)
    around, centres = field(balls, layout.GROUP_BALLS), field(scratch, GROUP_CENTRES)
    meeting = 0
    for k in range(field(balls, layout.PAIR_GROUP_COUNT)):
        first, second = int_at(groups, 4 * k), int_at(groups, 4 * k + 1)
        x, y, z = stored(centres, first)
        reach = float_at(around, 4 * first + 3) + float_at(around, 4 * second + 3)
        close = within(x, y, z, stored(centres, second), reach) & wanted
        if marks == 0:
            close &= ~meeting
        if close == 0:
            continue
        for pair in range(int_at(groups, 4 * k + 2), int_at(groups, 4 * k + 3)):
            found = bodies_meet(balls, scratch, int_at(pairs, 2 * pair), int_at(pairs, 2 * pair + 1), close)
            meeting |= found
            if marks != 0 and found != 0:
                set_int(marks, pair, int_at(marks, pair) | found)
        if marks == 0 and (meeting == wanted or (one and meeting != 0)):
            break
    return meeting
